# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The list of sensors: its short form, names, topics and frames, and what is refused."""

from typing import Any

import numpy as np
import pytest
import yaml
from many_sensors import many_rig, many_sensors

from fieldtruth.bag.messages import rig_transforms
from fieldtruth.bag.topics import PAPER_TOPICS, topics_of
from fieldtruth.core import transforms
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning, UnknownNameError
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.files import dump_experiment, parse_experiment, with_overrides
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.sensors.camera.config import CameraConfig, StereoConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig

SMALL = {"name": "x", "environment": "park", "route": {"metres": {"start": [0, 0], "waypoints": [[9, 9]]}}}


def parsed(rig: dict[str, Any], **changes: Any) -> Rig:
    return parse_experiment(yaml.safe_dump({**SMALL, "rig": rig, **changes}), "x.yaml").rig


def lidar(**changes: Any) -> dict[str, Any]:
    return {"kind": "lidar", "name": "a", "mount": {"xyz": [0, 0, 1]}, **changes}


def camera(**changes: Any) -> dict[str, Any]:
    return {"kind": "camera", "name": "c", "mount": {"xyz": [0, 0, 1]}, **changes}


def test_a_rig_without_a_list_is_the_papers() -> None:
    assert parsed({}) == Rig() == paper_rig()
    assert [sensor.name for sensor in Rig().sensors] == ["imu", "gnss", "wheel_odometry", "lidar", "stereo"]


def test_the_short_form_changes_the_papers_sensors() -> None:
    rig = parsed({"lidar": {"columns": 1024}, "imu": {"rate_hz": 100}, "tachometers": {"rate_hz": 5.0}})
    assert rig == paper_rig(
        imu=ImuConfig(rate_hz=100.0),
        lidar=LidarConfig(columns=1024),
        wheel_odometry=WheelOdometryConfig(tachometer_rate_hz=5.0),
    )
    assert parsed({"tachometers": {"enabled": False}}).enabled(WheelOdometryConfig) == ()
    assert parsed({"odometry": {"rate_hz": 20.0}}).enabled(WheelOdometryConfig)[0].rate_hz == 20.0


def test_the_earlier_name_of_the_papers_cameras_warns() -> None:
    with pytest.warns(FieldtruthWarning, match=r"^stereo is now called cameras$"):
        rig = paper_rig(stereo=StereoConfig(width=64))
    assert rig == paper_rig(cameras=StereoConfig(width=64)) == parsed({"cameras": {"width": 64}})
    with pytest.raises(ConfigurationError, match=r"^stereo must be None where cameras is given"):
        paper_rig(stereo=StereoConfig(), cameras=StereoConfig())


def test_settings_of_another_sensor_are_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"^cameras must be of type StereoConfig, got 3$"):
        paper_rig(cameras=3)  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match=r"^imu must be of type ImuConfig, got "):
        paper_rig(imu=StereoConfig())
    for own in (None, LidarConfig()):
        with pytest.raises(UnknownNameError, match=r"^unknown sensor of the paper 'lidr'; did you mean 'lidar'"):
            paper_rig(lidr=own)


def test_the_short_form_changes_the_first_sensor_of_a_list() -> None:
    rig = parsed({"sensors": [lidar(), lidar(name="b")], "lidar": {"columns": 64}})
    assert [each.columns for each in rig.enabled(LidarConfig)] == [64, 512]
    assert parsed({"sensors": [lidar()], "imu": {"rate_hz": 10}}).enabled(ImuConfig) == (ImuConfig(rate_hz=10.0),)


def test_left_and_right_are_mount_and_baseline() -> None:
    left, right = {"xyz": [0.3, 0.2, 0.5], "rpy_deg": [0, 100, 0]}, {"xyz": [0.3, -0.1, 0.5], "rpy_deg": [0, 100, 0]}
    pair = parsed({"cameras": {"left": left, "right": right}}).stereo
    assert pair.mount.xyz == pytest.approx((0.3, 0.05, 0.5))
    assert pair.baseline == pytest.approx(0.3)
    assert pair.left.xyz == pytest.approx((0.3, 0.2, 0.5), abs=1e-15)


def test_one_side_of_a_pair_leaves_the_other_where_it_is() -> None:
    low = {"kind": "stereo", "baseline": 0.2, "mount": {"xyz": [0.3, 0.0, 0.5], "rpy_deg": [0, 90, 0]}}
    rig = parsed({"sensors": [low], "cameras": {"left": {"xyz": [0.3, 0.3, 0.5], "rpy_deg": [0, 90, 0]}}})
    assert rig.stereo.right.xyz == pytest.approx((0.3, -0.1, 0.5), abs=1e-15)
    assert rig.stereo.baseline == pytest.approx(0.4)


def test_a_model_beside_a_list_keeps_what_no_model_says() -> None:
    item = {"kind": "stereo", "depth": True, "width": 640, "jpeg_quality": 80}
    pair = parsed({"sensors": [item], "cameras": {"model": "realsense_d435i"}}).stereo
    assert (pair.depth, pair.jpeg_quality, pair.width, pair.baseline) == (True, 80, 1280, 0.05)
    own = {"organised": True, "clock": {"drift_ppm": 20.0}, "signal": "datasheet", "columns": 64}
    changed = parsed({"sensors": [lidar(**own)], "lidar": {"model": "vlp_16"}}).lidar
    assert changed == parsed({"sensors": [lidar(**own | {"model": "vlp_16", "columns": 1808})]}).lidar


def test_a_model_gives_a_pair_its_baseline_and_a_named_sensor_its_figures() -> None:
    assert parsed({"cameras": {"model": "realsense_d435i"}}).stereo.baseline == 0.05
    rig = parsed({"sensors": [lidar(model="vlp_16", max_range=50)]})
    assert (rig.lidar.rings, rig.lidar.max_range, rig.lidar.spinning) == (16, 50.0, True)


def test_names_give_topics_and_frames() -> None:
    rig = many_rig()
    names = {topic.name for topic in topics_of(rig)}
    assert {"/top/points", "/imu_rear/data", "/antenna_left/fix", "/front/tag/img_raw", "/pair/left/depth"} <= names
    assert {"top_link", "imu_rear_link", "antenna_left_link", "front_link", "pair_right_link"} <= rig.mounts().keys()
    assert [imager.name for imager in rig.imagers] == [
        "pair_left", "pair_right", "front", "rear", "fisheye", "panorama",
    ]  # fmt: skip
    assert len({topic.name for topic in PAPER_TOPICS}) == len(PAPER_TOPICS)


def test_topics_are_in_the_order_of_the_papers_table_whatever_that_of_the_list() -> None:
    backwards = Rig(sensors=tuple(reversed(Rig().sensors)))
    assert topics_of(backwards) == topics_of(Rig())
    assert list(backwards.mounts()) == list(Rig().mounts())


def test_a_camera_looks_along_x_and_a_pairs_right_camera_is_to_the_right() -> None:
    front, left, right = (
        next(each for each in many_rig().imagers if each.name == name) for name in ("front", "pair_left", "pair_right")
    )
    np.testing.assert_allclose(front.base_from_optical[:3, 2], [1, 0, 0], atol=1e-15)  # forward
    np.testing.assert_allclose(front.base_from_optical[:3, 0], [0, -1, 0], atol=1e-15)  # right
    left_from_right = transforms.inverse(left.base_from_optical) @ right.base_from_optical
    np.testing.assert_allclose(left_from_right[:3, 3], [0.1, 0, 0], atol=1e-15)
    assert (left.baseline, right.baseline) == (0.0, 0.1)


def test_frames_of_all_sensors_are_in_the_tree() -> None:
    tree = rig_transforms(many_rig())
    assert ("base_link", "low_link") in tree
    assert ("rear_link", "rear_link_optical") in tree
    down = tree["base_link", "low_link"][:3, 0]  # its x axis, pitched 15 deg down
    assert down[2] == pytest.approx(-np.sin(np.radians(15.0)))


def test_every_value_survives_dump_and_load() -> None:
    experiment = parse_experiment(yaml.safe_dump({**SMALL, "rig": {"sensors": many_sensors()}}))
    assert experiment.rig == many_rig()
    assert parse_experiment(dump_experiment(experiment)) == experiment


def test_overrides_change_all_sensors_of_a_kind() -> None:
    experiment = parse_experiment(yaml.safe_dump({**SMALL, "rig": {"sensors": many_sensors()}}))
    bare = with_overrides(experiment, cameras=False, lidar=False).rig
    assert (bare.imagers, bare.enabled(LidarConfig)) == ((), ())
    assert len(bare.mounts()) == len(experiment.rig.mounts())
    assert all(each.config.depth for each in with_overrides(experiment, extras=["depth"]).rig.imagers)


def test_a_copy_with_an_unknown_key_is_an_error() -> None:
    with pytest.raises(TypeError, match=r"^Rig has no lidar$"):
        Rig().model_copy(update={"lidar": LidarConfig()})


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"sensors": [lidar(), lidar()]}, "rig.sensors[1].name 'a' is already a name of sensors[0]"),
    (
        {"sensors": [lidar(), lidar(name="b", topic="/a/points")]},
        "rig.sensors[1].topic '/a/points' is already a topic of sensors[0]",
    ),
    (
        {"sensors": [lidar(), lidar(name="b", frame="a_link")]},
        "rig.sensors[1].frame 'a_link' is already a frame of sensors[0]",
    ),
    ({"sensors": [lidar(frame="base_link")]}, "rig.sensors[0].frame 'base_link' is already a frame of the robot"),
    ({"sensors": [lidar(topic="/tf")]}, "rig.sensors[0].topic '/tf' is already a topic of the robot"),
    ({"sensors": [lidar(topic="tf")]}, "rig.sensors[0].topic must be the name of a ROS topic, like /imu/data, got"),
    (
        {"sensors": [camera(name="left"), {"kind": "stereo"}]},
        "rig.sensors[1].name 'left' is already the name of a camera of sensors[0]",
    ),
    ({"sensors": [camera(kind="stereo", baseline=0)]}, "rig.sensors[0].baseline must be a number above 0, got 0"),
    (
        {"sensors": [camera(kind="stereo", frame="foo")]},
        "rig.sensors[0].frame must be the name of a frame with {side}, got 'foo'",
    ),
    ({"sensors": [{"kind": "lidr"}]}, "rig.sensors[0].kind 'lidr' is unknown; did you mean 'lidar'? Available: "),
    ({"sensors": [{"name": "x"}]}, "rig.sensors[0].kind is required: one of camera, "),
    ({"sensors": [3]}, "rig.sensors[0]: must be a mapping with the keys kind, name, ..., got 3"),
    ({"sensors": 5}, "rig.sensors must be a list of at most 64 sensors: mappings with the keys kind, name, ..., got 5"),
    ({"sensors": [{"kind": "lidar", "name": "b"}]}, "rig.sensors[0].mount is required: a mapping with the keys xyz, "),
    ({"sensors": [{"kind": "camera"}]}, "rig.sensors[0].mount is required: a mapping with the keys xyz, rpy_deg"),
    (
        {"sensors": [lidar(), lidar(name="b", colums=3)]},
        "unknown key 'rig.sensors[1].colums'; did you mean 'rig.sensors[1].columns'? Available: kind, name, ",
    ),
    ({"sensors": [lidar(mount={"xyz": [0, 0]})]}, "rig.sensors[0].mount.xyz[2] is required: a number"),
    (
        {"sensors": [{"kind": "wheel_odometry"}, {"kind": "wheel_odometry", "name": "w", "topic": "/w"}]},
        "rig.sensors[1].kind must differ: a rig has at most one wheel_odometry",
    ),
    ({"lidr": {}}, "unknown key 'rig.lidr'; did you mean 'rig.lidar'? Available: imu, gnss, tachometers, "),
    ({"lidar": {"columns": 3}}, "rig.lidar.columns must be an integer between 8 and 8192, got 3"),
    ({"cameras": {"left": {"xyz": [0, 0]}}}, "rig.cameras.left.xyz[2] is required: a number"),
    ({"tachometers": {"rate_hz": -1}}, "rig.tachometers.rate_hz must be a number between 0.01 and 1000, got -1"),
    ({"odometry": {"rate": 1}}, "unknown key 'rig.odometry.rate'; did you mean 'rig.odometry.rate_hz'? "),
    (
        {"sensors": [camera(width=1), camera(name="d", width=1)]},
        "rig.sensors[0].width must be an integer between 2 and 8192, got 1 (and 1 more)",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("rig", "line"), REFUSED, ids=[line[:60] for _, line in REFUSED])
def test_what_is_refused_is_one_line_that_names_the_key(rig: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        parsed(rig)
    assert str(refusal.value).startswith(f"x.yaml: {line}")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("kind", ["lidar", "camera", "gnss", "stereo"])
def test_no_eye_is_inside_the_robots_hull(kind: str) -> None:
    item = {"kind": kind, "name": "a", **({"baseline": 0.1} if kind == "stereo" else {})}
    inside, above = {"mount": {"xyz": [0.2, 0.1, 0.2]}}, {"mount": {"xyz": [0.2, 0.1, 0.26]}}
    with pytest.raises(ConfigurationError, match=r"^x\.yaml: rig\.sensors\[0\]\.mount .* inside the robot's hull at "):
        parsed({"sensors": [item | inside]})
    assert parsed({"sensors": [item | above]}).sensors
    assert parsed({"sensors": [item | inside | {"enabled": False}]}).sensors
    assert parsed({"sensors": [{"kind": "imu", "name": "a", **inside}]}).enabled(ImuConfig)


def test_a_pair_that_is_turned_has_its_baseline_in_its_own_frame() -> None:
    pair = StereoConfig(name="p", topic="/p", frame="p_{side}", forward="x", baseline=0.4, mount=Mount(xyz=(0, 0, 1)))
    turned = pair.model_copy(update={"mount": Mount(xyz=(0.0, 0.0, 1.0), rpy_deg=(0.0, 0.0, 90.0))})
    assert turned.left.xyz == pytest.approx((-0.2, 0.0, 1.0), abs=1e-15)  # facing left of the robot, its left is behind
    assert isinstance(pair, CameraConfig)

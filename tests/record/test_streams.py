# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A whole recording with fake sensors: topics, stamps, and agreement with the drive."""

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import paper_topics
import pytest
from record_fakes import (
    SMALL,
    FakeCamera,
    FakeLidar,
    FakeScan,
    FakeScene,
    fake_sensors,
    make_experiment,
    make_slices,
    make_track,
    make_world,
)
from rosbags.rosbag1 import Reader
from series import fixes_along, tachometers_along

from fieldtruth.bag import topics
from fieldtruth.bag.decode import (
    Reading,
    count_messages,
    image,
    matrix,
    points,
    pose_matrix,
    read_bag,
    stamp_ns,
    static_transforms,
)
from fieldtruth.bag.file import BagError
from fieldtruth.bag.topics import PAPER_TOPICS
from fieldtruth.core import transforms
from fieldtruth.core.classes import PALETTE
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.core.progress import Silent
from fieldtruth.drive.track import poses_at, stamps_at_rate, state_at
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.record.streams import sensor_factory, streams_of
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, StereoConfig
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.sensors.known import new_sensors
from fieldtruth.sensors.lidar.config import LidarConfig

SECONDS = 2.5
EXPERIMENT = make_experiment(SECONDS, seed=3)
WORLD = make_world(seed=3)
TRACK = make_track(WORLD, EXPERIMENT)

SPEC = {  # topic: type and rate [Hz]
    "/gazebo/model_states": ("gazebo_msgs/msg/ModelStates", 1000),
    "/imu/data": ("sensor_msgs/msg/Imu", 50),
    "/navsat/fix": ("sensor_msgs/msg/NavSatFix", 2),
    "/os1_cloud_node/points": ("sensor_msgs/msg/PointCloud2", 10),
    "/gazebo_client/front_left_speed": ("std_msgs/msg/Float32", 10),
    "/gazebo_client/front_right_speed": ("std_msgs/msg/Float32", 10),
    "/gazebo_client/rear_left_speed": ("std_msgs/msg/Float32", 10),
    "/gazebo_client/rear_right_speed": ("std_msgs/msg/Float32", 10),
    "/joint_states": ("sensor_msgs/msg/JointState", 50),
    "/odometry/wheel": ("nav_msgs/msg/Odometry", 50),
    "/cmd_vel": ("geometry_msgs/msg/Twist", 50),
    "/stereo/camera/left/real/compressed": ("sensor_msgs/msg/CompressedImage", 25),
    "/stereo/camera/right/real/compressed": ("sensor_msgs/msg/CompressedImage", 25),
    "/stereo/camera/left/tag/img_raw": ("sensor_msgs/msg/Image", 25),
    "/stereo/camera/right/tag/img_raw": ("sensor_msgs/msg/Image", 25),
    "/stereo/camera/left/camera_info": ("sensor_msgs/msg/CameraInfo", 25),
    "/stereo/camera/right/camera_info": ("sensor_msgs/msg/CameraInfo", 25),
    "/tf": ("tf2_msgs/msg/TFMessage", 50),
    "/ground_truth/odom": ("nav_msgs/msg/Odometry", 50),
    "/clock": ("rosgraph_msgs/msg/Clock", 1000),
}


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    slices = make_slices(folder, EXPERIMENT)
    slices.record(folder / "tiny.bag", 2, Silent())
    return folder / "tiny.bag"


@pytest.fixture(scope="module")
def readings(bag: Path) -> dict[str, list[Reading]]:
    result = defaultdict(list)
    for reading in read_bag(bag):
        result[reading.topic].append(reading)
    return result


def test_topics_types_and_counts(bag: Path) -> None:
    counts = count_messages(bag)
    assert counts.pop("/tf_static") == 1
    assert counts.keys() == SPEC.keys()
    for topic, (_, rate) in SPEC.items():
        assert abs(counts[topic] - SECONDS * rate) < 1, topic
    with Reader(bag) as reader:
        assert {t: i.msgtype for t, i in reader.topics.items() if t in SPEC} == {t: s[0] for t, s in SPEC.items()}


def test_the_table_states_the_same_rates() -> None:
    table = topics.topics_of(Rig())
    assert {t.name: t.rate_hz for t in table if t.rate_hz} == {t: rate for t, (_, rate) in SPEC.items()}


def test_extras_have_topics_if_enabled() -> None:
    plain = {t.name for t in topics.topics_of(Rig())}
    rig = paper_rig(cameras=StereoConfig(depth=True, instances=True))
    assert {t.name for t in topics.topics_of(rig)} - plain == {
        f"/stereo/camera/{side}/{extra}" for side in ("left", "right") for extra in ("depth", "instances")
    }
    assert topics.topics_of(rig, latched=True) == PAPER_TOPICS
    blind = paper_rig(cameras=StereoConfig(enabled=False, depth=True, instances=True))
    assert not any("camera" in t.name for t in topics.topics_of(blind))


def test_definitions_are_in_the_bag_and_tf_static_is_latched(bag: Path) -> None:
    with Reader(bag) as reader:
        assert len(reader.connections) == len(topics.topics_of(Rig()))
        for connection in reader.connections:
            assert connection.msgdef.data.strip()
            latching = getattr(connection.ext, "latching", None)
            assert latching == (1 if connection.topic == "/tf_static" else None)


def test_stamps_are_those_of_the_rate_and_headers_agree(readings: dict[str, list[Reading]]) -> None:
    for topic, (_, rate) in SPEC.items():
        stamps = [r.stamp_ns for r in readings[topic]]
        assert stamps[0] > 0
        assert stamps == stamps_at_rate(rate, round(SECONDS * 1e9)).tolist(), topic
        for k, reading in enumerate(readings[topic]):
            if hasattr(reading.message, "header"):
                assert stamp_ns(reading.message.header) == reading.stamp_ns
                assert reading.message.header.seq == k


def test_messages_are_stored_in_time_order_and_ties_in_table_order(bag: Path) -> None:
    # the reader sorts by time; positions in the file give the order of writing
    with Reader(bag) as reader:
        order = {topic.name: k for k, topic in enumerate(PAPER_TOPICS)}
        entries = [
            (entry.chunk_pos, entry.offset, entry.time, order[connection.topic])
            for connection in reader.connections
            for entry in reader.indexes[connection.id]
        ]
    written = [(time, place) for _, _, time, place in sorted(entries)]
    assert written == sorted(written)


def test_tf_static_holds_every_frame_of_the_paper_but_the_wheels(bag: Path) -> None:
    fixed = static_transforms(bag)
    table = {  # paper, Table 2: x y z [m], roll pitch yaw [deg]
        "GNSS_link": (0.10, 0, 0.890, 0, 0, 0),
        "os1_lidar": (0.09, 0, 0.826, 0, 0, 0),
        "right_camera": (0.15, -0.06, 0.720, 0, 90, 0),
        "left_camera": (0.15, 0.06, 0.720, 0, 90, 0),
        "imu_link": (0.19, 0, 0.149, 0, -90, 180),
        "base_footprint": (0, 0, -0.13228, 0, 0, 0),
    }
    for name, (x, y, z, roll, pitch, yaw) in table.items():
        expected = transforms.pose((x, y, z), (roll, pitch, yaw))
        np.testing.assert_allclose(fixed.pop(("base_link", name)), expected, atol=1e-12, err_msg=name)
    for side in ("left", "right"):
        np.testing.assert_allclose(
            fixed.pop((f"{side}_camera", f"{side}_camera_optical")), CAMERA_FROM_OPTICAL, atol=1e-15
        )
    assert not fixed


def test_the_wheels_turn_in_tf_about_the_axles_of_the_paper(readings: dict[str, list[Reading]]) -> None:
    mounts = Rig().mounts()
    for reading in readings["/tf"]:
        base, *wheels = reading.message.transforms
        assert (base.header.frame_id, base.child_frame_id) == ("world", "base_link")
        for each, rate in zip(wheels, (1.0, 2.0, 1.1, 2.2), strict=True):
            turned = transforms.pose(mounts[each.child_frame_id].xyz, (0, np.rad2deg(rate * reading.stamp_ns / 1e9), 0))
            np.testing.assert_allclose(matrix(each.transform), turned, atol=1e-12)


def test_model_states_odometry_and_tf_are_the_motion_at_their_stamp(readings: dict[str, list[Reading]]) -> None:
    truth = transforms.pose_from_quaternion_wxyz(TRACK.motion.position, TRACK.motion.quaternion_wxyz)
    for k, reading in enumerate(readings["/gazebo/model_states"]):
        assert reading.message.name[0] == "husky"
        np.testing.assert_allclose(pose_matrix(reading.message.pose[0]), truth[k], atol=1e-15)
    for odometry, tf in zip(readings["/ground_truth/odom"], readings["/tf"], strict=True):
        expected = truth[odometry.stamp_ns // 10**6 - 1]
        np.testing.assert_allclose(pose_matrix(odometry.message.pose.pose), expected, atol=1e-15)
        np.testing.assert_allclose(matrix(tf.message.transforms[0].transform), expected, atol=1e-15)


def test_a_scan_and_an_image_are_taken_from_the_pose_at_their_stamp(readings: dict[str, list[Reading]]) -> None:
    rig, scene = EXPERIMENT.rig, FakeScene(WORLD)
    lidar, camera = FakeLidar(rig.lidar, scene), FakeCamera(rig.stereo, scene)
    truth = transforms.pose_from_quaternion_wxyz(TRACK.motion.position, TRACK.motion.quaternion_wxyz)
    for reading in readings["/os1_cloud_node/points"]:
        cloud = points(reading.message)
        scan = lidar.scan(truth[reading.stamp_ns // 10**6 - 1] @ rig.lidar.mount.base_from_sensor)
        np.testing.assert_array_equal(np.stack([cloud["x"], cloud["y"], cloud["z"]], -1), scan.xyz)
        np.testing.assert_array_equal(cloud["intensity"], cloud["label"])
    for side, mount in (("left", rig.stereo.left), ("right", rig.stereo.right)):
        for photo, tag in zip(
            readings[paper_topics.photograph(side)], readings[paper_topics.tag(side)], strict=True
        ):  # the fake's photograph is brighter by a step for each millimetre
            base_from_optical = mount.base_from_sensor @ CAMERA_FROM_OPTICAL
            picture = camera.render(truth[photo.stamp_ns // 10**6 - 1] @ base_from_optical)
            assert np.abs(image(photo.message).astype(int) - picture.photo).mean() < 1.5
            np.testing.assert_array_equal(image(tag.message), PALETTE[picture.label])


def test_readings_of_the_drive_are_in_the_bag(readings: dict[str, list[Reading]]) -> None:
    assert TRACK.base is not None
    for name, column in (("front_left", 0), ("front_right", 1), ("rear_left", 2), ("rear_right", 3)):
        speeds = [r.message.data for r in readings[f"/gazebo_client/{name}_speed"]]
        assert speeds == tachometers_along(TRACK).wheel_speed[:, column].astype(np.float32).tolist()
    heights = [r.message.altitude for r in readings["/navsat/fix"]]
    assert heights == fixes_along(TRACK).geodetic[:, 2].tolist()


@pytest.mark.parametrize(
    ("rig", "gone"),
    [
        (paper_rig(cameras=StereoConfig(enabled=False)), "/stereo"),
        (paper_rig(lidar=LidarConfig(enabled=False), cameras=SMALL.stereo), "/os1_cloud_node"),
    ],
)
def test_a_disabled_sensor_has_no_topic(tmp_path: Path, rig: Rig, gone: str) -> None:
    slices = make_slices(tmp_path, make_experiment(0.5, rig=rig))
    slices.record(tmp_path / "x.bag", 1, Silent())
    counts = count_messages(tmp_path / "x.bag")
    assert counts.keys() == {t.name for t in topics.topics_of(Rig()) if not t.name.startswith(gone)}
    assert all(counts.values())


def test_rates_that_do_not_divide_the_physics(tmp_path: Path) -> None:
    rig = paper_rig(cameras=StereoConfig(width=64, height=48, rate_hz=30.0), lidar=LidarConfig(rate_hz=7.0))
    slices = make_slices(tmp_path, make_experiment(1.5, rig=rig))
    slices.record(tmp_path / "x.bag", 1, Silent())
    stamps = [r.stamp_ns for r in read_bag(tmp_path / "x.bag", ["/stereo/camera/left/tag/img_raw"])]
    assert stamps == [round(k * 1e9 / 30) for k in range(1, 46)]
    assert count_messages(tmp_path / "x.bag")["/os1_cloud_node/points"] == 10


def test_poses_at_many_stamps_are_those_at_each() -> None:
    """Between rows, on rows, before the first and after the last, and where the quaternion changes its sign."""
    motion = TRACK.motion
    flipped = replace(
        motion, quaternion_wxyz=motion.quaternion_wxyz * np.where(np.arange(len(motion.stamps_ns)) % 3, 1, -1)[:, None]
    )
    last = int(motion.stamps_ns[-1])
    stamps = np.array([0, 1, 999_999, 1_000_000, 1_500_001, 2_345_678, 7_000_000, last - 1, last, last + 10**9])
    for each in (motion, flipped):
        alone = np.stack([state_at(each, stamp).world_from_base for stamp in stamps.tolist()])
        np.testing.assert_allclose(poses_at(each, stamps), alone, rtol=0, atol=1e-14)


def test_a_spinning_lidar_gets_the_pose_of_each_column() -> None:
    rig = paper_rig(lidar=LidarConfig(columns=20, spinning=True), cameras=StereoConfig(enabled=False))
    track = make_track(WORLD, make_experiment(1.0, rig=rig))
    seen = []

    class Watch(FakeLidar):
        def scan(self, world_from_lidar: np.typing.NDArray[np.float64], stamp_ns: int = 0, number: int = 0) -> FakeScan:
            seen.append(world_from_lidar)
            return super().scan(world_from_lidar[0])

    stream = next(s for s in streams_of(WORLD, track, rig) if s.topics == (paper_topics.POINTS,))
    list(stream.messages(np.array([3]), fake_sensors(WORLD, rig, Watch)))
    motion = track.motion
    truth = (
        transforms.pose_from_quaternion_wxyz(motion.position, motion.quaternion_wxyz) @ rig.lidar.mount.base_from_sensor
    )
    np.testing.assert_allclose(seen[0], truth[399:500:5], atol=1e-15)  # 0.4 s and every 5 ms to the end of its 0.1 s


def test_the_light_is_baked_before_the_first_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a worker it would count as time of readings, and begin only when all kernels are compiled."""

    class BakedError(Exception):
        """Raised instead of baking."""

    def bake(*_: object) -> None:
        raise BakedError

    monkeypatch.setattr("fieldtruth.sensors.kind.bake", bake)
    rig, scene = paper_rig(lidar=LidarConfig(enabled=False)), FakeScene(WORLD)
    with pytest.raises(BakedError):
        sensor_factory(SensorWorld(WORLD, rig, scene=scene))  # type: ignore[arg-type]


def test_messages_made_many_at_once_are_those_made_one_by_one() -> None:
    """Of all sensors of motion, with signals, clocks that lose readings, and the truth beside them."""
    clock = {"jitter_s": 1e-4, "drop_share": 0.1, "drift_ppm": 50.0}
    kinds: dict[str, dict[str, Any]] = {
        "imu": {"rate_hz": 1000.0},
        "gnss": {"rate_hz": 10.0, "signal": {"obstacles": False}},
        "wheel_odometry": {"rate_hz": 33.0},
    }
    sensors = [{"kind": kind, "signal": "datasheet", "clock": clock, **values} for kind, values in kinds.items()]
    rig = Rig.model_validate({"sensors": sensors})
    made = new_sensors(SensorWorld(WORLD, rig, scene=None), rig)
    for stream in streams_of(WORLD, make_track(WORLD, make_experiment(1.0, rig=rig)), rig):
        rows = np.arange(len(stream.stamps_ns))
        whole = [tuple(each) for each in stream.messages(rows, made)]
        alone = [tuple(each) for row in rows for each in stream.messages(rows[row : row + 1], made)]
        assert whole == alone, stream.topics
        assert {len(each) for each in whole} == {len(stream.topics)}


def test_slices_hold_stamps_after_their_start_up_to_their_end(tmp_path: Path) -> None:
    slices = make_slices(tmp_path, EXPERIMENT)
    slices.make(1)
    assert slices.count == 3
    assert [slices.seconds(k) for k in range(3)] == [1.0, 1.0, 0.5]
    for k in range(3):
        stamps = [r.stamp_ns for r in read_bag(slices.path(k), ["/clock"])]
        assert (stamps[0], stamps[-1]) == (k * 10**9 + 10**6, min((k + 1) * 10**9, 2_500_000_000))


def test_errors_of_reading_bags(tmp_path: Path, bag: Path) -> None:
    with pytest.raises(BagError, match=r"none\.bag"):
        list(read_bag(tmp_path / "none.bag"))
    (tmp_path / "text.bag").write_text("no bag at all")
    kinds = r"it is not an MCAP file, a database of ROS 2 or a ROS 1 bag, which begins with #ROSBAG V2\.0"
    with pytest.raises(BagError, match=kinds):
        list(read_bag(tmp_path / "text.bag"))
    with pytest.raises(UnknownNameError, match="/imu/data"):
        list(read_bag(bag, ["/imu/date"]))

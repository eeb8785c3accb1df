# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A package for a rig with several sensors of each kind has each one's pose, frame, topic and rate in every file."""

import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest
import xacro
import yaml
import yourdfpy
from many_sensors import many_rig, many_sensors
from test_robot import FLAVOURS, _canonical, _tool, pose, sdf, values
from test_ros_package import FakeRos, fake, inclined_park, package

import fieldtruth.gazebo
from fieldtruth.bag import topics
from fieldtruth.bag.messages import rig_transforms
from fieldtruth.core import transforms
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.gazebo.robot import Flavour, body_shapes, write_robot
from fieldtruth.sense.lens import intrinsics_of
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import ray_directions
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig

__all__ = ["fake"]
ROS = pytest.mark.parametrize("ros", [1, 2])
BODY_FROM_OPTICAL = transforms.pose((0, 0, 0), (-90.0, 0.0, -90.0))
CAMERAS = ("pair_left", "pair_right", "front", "rear", "fisheye", "panorama")


def pinholes() -> list[dict[str, Any]]:
    """The items of ``many_sensors`` with a plain pinhole in every camera."""
    return [
        {key: value for key, value in item.items() if key != "lens" and value != "fisheye_190"}
        for item in many_sensors()
    ]


RIG = Rig.model_validate({"sensors": pinholes()})


@pytest.fixture(scope="module")
def urdf_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("many")
    write_robot(folder, RIG, "classic")
    return folder


def poses(rig: Rig) -> dict[str, Any]:
    """base_from_sensor (4, 4) of what Gazebo has, by its name there; a camera looks along its x axis."""
    mounts = {lidar.frame: lidar.mount for lidar in rig.enabled(LidarConfig)}
    mounts |= {sensor.name: sensor.mount for sensor in (*rig.enabled(ImuConfig), *rig.enabled(GnssConfig))}
    cameras = {i.name: i.base_from_optical @ transforms.inverse(BODY_FROM_OPTICAL) for i in rig.imagers}
    bodies = {f"{name}_{kind}": body for name, body in cameras.items() for kind in ("camera", "tag")}
    return {name: mount.base_from_sensor for name, mount in mounts.items()} | bodies


def test_the_urdf_has_the_frames_of_tf_static(urdf_folder: Path) -> None:
    urdf = yourdfpy.URDF.load(str(urdf_folder / "urdf/husky.urdf"), load_meshes=False)
    expected = rig_transforms(RIG)
    assert {(j.parent, j.child) for j in urdf.robot.joints} == set(expected)
    for (parent, child), parent_from_child in expected.items():
        np.testing.assert_allclose(urdf.get_transform(child, parent), parent_from_child, rtol=0, atol=1e-9)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_sdf_has_the_frames_and_the_sensors_at_their_poses(flavour: Flavour, tmp_path: Path) -> None:
    model = sdf(RIG, flavour, tmp_path)[0]
    found = {(e.get("attached_to"), e.get("name")): pose(e) for e in model.findall("frame")}
    found |= {("base_link", e.get("name")): pose(e) for e in model.findall("link")[1:]}
    expected = rig_transforms(RIG)
    assert set(found) == set(expected)
    for key in expected:
        np.testing.assert_allclose(found[key], expected[key], rtol=0, atol=1e-9)
    sensors = {str(s.get("name")): s for s in model.iter("sensor")}
    bodies = {name: body for name, body in poses(RIG).items() if flavour == "gz" or not name.endswith("_tag")}
    assert set(sensors) == set(bodies)
    for name, body in bodies.items():
        np.testing.assert_allclose(pose(sensors[name]), body, rtol=0, atol=1e-9)
    rates = {s.name: s.rate_hz for s in (*RIG.enabled(ImuConfig), *RIG.enabled(GnssConfig))} | {
        s.frame: s.rate_hz for s in RIG.enabled(LidarConfig)
    }
    rates |= {f"{i.name}_camera": i.config.rate_hz for i in RIG.imagers}
    for name, rate in rates.items():
        assert values(sensors[name], "update_rate") == [rate]
    for scope in (model, *model.iter("link")):
        names = [child.get("name") for child in scope if child.get("name")]
        assert len(names) == len(set(names))


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_rays_and_lenses_are_those_of_each_sensor(flavour: Flavour, tmp_path: Path) -> None:
    sensors = {str(s.get("name")): s for s in sdf(RIG, flavour, tmp_path)[0].iter("sensor")}
    for lidar in RIG.enabled(LidarConfig):
        scan = next(sensors[lidar.frame].iter("scan"))
        low, high = (values(scan, f"vertical/{end}_angle")[0] for end in ("min", "max"))
        ours = np.arcsin(ray_directions(lidar)[0, :, 2])
        np.testing.assert_allclose(np.linspace(low, high, lidar.rings), np.sort(ours), rtol=0, atol=1e-7)
        assert values(scan, "horizontal/samples") == [lidar.columns]
        assert values(next(sensors[lidar.frame].iter("range")), "max") == [lidar.max_range]
    for imager in RIG.imagers:
        camera = next(sensors[f"{imager.name}_camera"].iter("camera"))
        wanted = (*intrinsics_of(imager.config)[:2], imager.config.width, imager.config.height)
        paths = ("lens/intrinsics/fx", "lens/intrinsics/fy", "image/width", "image/height")
        assert [values(camera, path)[0] for path in paths] == list(wanted)


def test_check_urdf_and_libsdformat_find_nothing(urdf_folder: Path) -> None:
    checks = ([_tool("check_urdf"), "urdf/husky.urdf"], [_tool("ign"), "sdf", "-k", "models/husky/model.sdf"])
    for command in checks:
        result = subprocess.run(command, cwd=urdf_folder, capture_output=True, text=True)
        assert result.returncode == 0, result.stderr
        assert "Warning" not in result.stderr
        assert "Error:" not in result.stderr


def test_the_urdf_has_a_plugin_with_topic_and_frame_for_each_sensor(urdf_folder: Path) -> None:
    robot = ET.parse(urdf_folder / "urdf/husky.urdf").getroot()
    sensors = {str(s.get("name")): s for s in robot.iter("sensor")}
    assert set(sensors) == {s.frame for s in RIG.enabled(LidarConfig)} | {s.name for s in RIG.enabled(ImuConfig)} | {
        f"{n}_camera" for n in CAMERAS
    }
    expected = poses(RIG)
    for name, sensor in sensors.items():
        np.testing.assert_allclose(pose(sensor), expected[name], rtol=0, atol=1e-9)
    topic_of = {name: (s.findtext("plugin/topicName"), s.findtext("plugin/frameName")) for name, s in sensors.items()}
    for lidar in RIG.enabled(LidarConfig):
        assert topic_of[lidar.frame] == (lidar.topic, lidar.frame)
    for imu in RIG.enabled(ImuConfig):
        assert topic_of[imu.name] == (imu.topic[1:], imu.frame)
    for imager in RIG.imagers:
        plugin = sensors[f"{imager.name}_camera"].find("plugin")
        assert plugin is not None
        assert (plugin.findtext("cameraName"), plugin.findtext("imageTopicName")) == (imager.topic[1:], "real")
        assert plugin.findtext("frameName") == imager.optical_frame
        assert values(plugin, "hackBaseline") == [0.1 if imager.name == "pair_right" else 0.0]
    for antenna in RIG.enabled(GnssConfig):
        found = robot.find(f"gazebo/plugin[@name='{antenna.name}']")
        assert found is not None
        names = [found.findtext(key) for key in ("bodyName", "frameId", "topicName", "velocityTopicName", "updateRate")]
        assert names == [antenna.frame, antenna.frame, f"{antenna.name}/fix", f"{antenna.name}/vel", "5"]
        assert robot.find(f"link[@name='{antenna.frame}']/inertial") is not None
    assert sum(float(e.attrib["value"]) for e in robot.iter("mass")) == pytest.approx(RIG.robot.mass, abs=1e-9)


def test_xacro_expands_to_the_urdf_and_switches_all_of_a_kind(urdf_folder: Path) -> None:
    def expanded(**arguments: str) -> ET.Element:
        return ET.fromstring(xacro.process_file(urdf_folder / "urdf/husky.urdf.xacro", mappings=arguments).toxml())

    assert _canonical(expanded()) == _canonical(ET.parse(urdf_folder / "urdf/husky.urdf").getroot())
    assert [e.text for e in expanded(plain="true").iter("imageTopicName")] == ["tag/img_raw"] * 6
    assert {s.get("type") for s in expanded(lidar="false", cameras="false").iter("sensor")} == {"imu"}


def test_bridge_and_model_agree_on_topics(tmp_path: Path) -> None:
    package(tmp_path, 2, RIG)
    model = sdf(RIG, "gz", tmp_path)[0]
    rows = yaml.safe_load((tmp_path / "config/bridge.yaml").read_text())
    sensors = {str(s.get("name")): f"/{s.findtext('topic')}" for s in model.iter("sensor")}
    bridged = {row["ros_topic_name"]: row["gz_topic_name"] for row in rows}
    for lidar in RIG.enabled(LidarConfig):
        assert bridged[lidar.topic] == f"{sensors[lidar.frame]}/points"
    for sensor in (*RIG.enabled(ImuConfig), *RIG.enabled(GnssConfig)):
        assert bridged[sensor.topic] == sensors[sensor.name] == sensor.topic
    images = (tmp_path / "launch/world.launch.py").read_text()
    for imager in RIG.imagers:
        assert bridged[f"{imager.topic}/camera_info_gazebo"] == f"{imager.topic}/camera_info"
        assert sensors[f"{imager.name}_camera"] == f"{imager.topic}/real"
        assert sensors[f"{imager.name}_tag"] == f"{imager.topic}/segmentation"
        for topic in ("real", "segmentation/labels_map", "segmentation/colored_map"):
            assert f'"{imager.topic}/{topic}"' in images
    assert len(rows) == len(bridged) == 5 + 2 + 2 + 2 + 6
    frame_ids = {str(s.get("name")): s.findtext("gz_frame_id") for s in model.iter("sensor")}
    assert frame_ids["low_link"] == "low_link"
    assert frame_ids["imu_rear"] == "imu_rear_link"
    assert frame_ids["antenna_left"] == "antenna_left_link"
    assert frame_ids["rear_camera"] == frame_ids["rear_tag"] == "rear_link_optical"


@pytest.mark.parametrize("topic", ["/points", "/velodyne", "/velodyne/points"])
def test_a_cloud_may_have_any_topic(topic: str, tmp_path: Path) -> None:
    """The newer Gazebo adds /points to the topic of a LiDAR."""
    rig = paper_rig(lidar=LidarConfig(topic=topic))
    package(tmp_path, 2, rig)
    sensor = next(s for s in sdf(rig, "gz", tmp_path)[0].iter("sensor") if s.get("type") == "gpu_lidar")
    rows = yaml.safe_load((tmp_path / "config/bridge.yaml").read_text())
    bridged = {row["ros_topic_name"]: row["gz_topic_name"] for row in rows}
    assert sensor.findtext("topic")
    assert bridged[topic] == f"/{sensor.findtext('topic')}/points"


@ROS
def test_rviz_shows_every_lidar_and_camera(ros: int, tmp_path: Path) -> None:
    package(tmp_path, ros, RIG)
    config = yaml.safe_load((tmp_path / "rviz/fieldtruth.rviz").read_text())
    displays = config["Visualization Manager"]["Displays"]
    names = [display["Name"] for display in displays]
    assert len(names) == len(set(names)) == 3 + 2 + 2 * 5  # of a pair the left camera
    clouds = {d["Name"]: d["Topic"] for d in displays if d["Class"].endswith("/PointCloud2")}
    assert clouds == {"cloud by class, top": "/top/points", "cloud by class, low": "/low/points"}
    (time,) = (panel for panel in config["Panels"] if panel["Name"] == "Time")
    assert time["SyncSource"] in clouds
    shown = [d["Image Topic" if ros == 1 else "Topic"] for d in displays if d["Class"].endswith("/Image")]
    views = ("/pair/left", "/front", "/rear", "/fisheye", "/panorama")
    end = "real" if ros == 1 else "real/compressed"
    assert shown == [f"{view}/{end}" for view in views] + [f"{view}/tag/img_raw" for view in views]
    (axes,) = (display for display in displays if display["Name"] == "frames")
    hidden = {name for name, value in axes["Frames"].items() if name != "All Enabled" and value["Value"] is False}
    assert {f"{name}_link" for name in CAMERAS} <= hidden
    assert not any("left_camera" in name for name in hidden)


@ROS
def test_rviz_without_lidar_and_cameras(ros: int, tmp_path: Path) -> None:
    package(tmp_path, ros, Rig().with_sensors(CameraConfig, enabled=False).with_sensors(LidarConfig, enabled=False))
    config = yaml.safe_load((tmp_path / "rviz/fieldtruth.rviz").read_text())
    assert len(config["Visualization Manager"]["Displays"]) == len(config["Visualization Manager"]["Tools"]) == 3
    assert next(panel for panel in config["Panels"] if panel["Name"] == "Time")["SyncSource"] is None


@ROS
def test_relay_and_record_name_every_topic(ros: int, fake: FakeRos, tmp_path: Path) -> None:
    package(tmp_path, ros, RIG)
    fake.run(tmp_path / "scripts/relay.py", tmp_path / "config/cameras.yaml")
    for imager in RIG.imagers:
        header = SimpleNamespace(header=SimpleNamespace(frame_id=""))
        fake.callbacks[f"{imager.topic}/camera_info_gazebo"](header)
        (info,) = fake.published[f"{imager.topic}/camera_info"]
        assert (info.header.frame_id, info.width, info.height) == (imager.optical_frame, 160, 96)
        p = np.reshape(info.P if ros == 1 else info.p, (3, 4))
        assert p[0, 3] == pytest.approx(-p[0, 0] * imager.baseline, rel=1e-12)
    words = (tmp_path / "scripts/record.sh").read_text().split()
    assert {topic.name for topic in topics.topics_of(RIG)} <= set(words)
    fake.run(tmp_path / "scripts/waypoints.py", tmp_path / "config/park_1.yaml")
    assert {"/imu_front/data", "/antenna_left/fix"} <= set(fake.callbacks)
    assert not {"/imu/data", "/navsat/fix"} & set(fake.callbacks)


def test_launch_files_of_ros_1_speak_of_several(tmp_path: Path) -> None:
    package(tmp_path, 1, RIG)
    arguments = ET.parse(tmp_path / "launch/world.launch").getroot().findall("arg")
    assert {a.get("name"): a.get("doc") for a in arguments}["lidar"] == "whether the LiDARs scan"


@ROS
def test_the_package_has_an_experiment_with_its_sensors(ros: int, tmp_path: Path) -> None:
    """The commands of the read-me would otherwise take the paper's."""
    package(tmp_path / "own", ros, RIG)
    experiment = load_experiment(tmp_path / "own/config/experiment.yaml")
    assert (experiment.rig, experiment.environment, experiment.seed) == (RIG, "park", 0)
    assert (experiment.drive is None) == (ros == 1)
    assert "config/experiment.yaml" in (tmp_path / "own/README.md").read_text()
    package(tmp_path / "paper", ros)
    assert not (tmp_path / "paper/config/experiment.yaml").exists()


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_disabled_sensor_has_frames_but_no_plugin(flavour: Flavour, tmp_path: Path) -> None:
    rig = RIG.with_sensors(CameraConfig, enabled=False).with_sensors(LidarConfig, enabled=False)
    off = rig.with_sensors(ImuConfig, enabled=False).with_sensors(GnssConfig, enabled=False)
    model = sdf(off.with_sensors(WheelOdometryConfig, enabled=False), flavour, tmp_path)[0]
    assert not list(model.iter("sensor"))
    assert [visual.get("name") for visual in model.findall("link")[0].findall("visual")] == ["chassis_visual"]
    found = {(e.get("attached_to"), e.get("name")) for e in model.findall("frame")}
    assert found == {pair for pair in rig_transforms(RIG) if not pair[1].endswith("_wheel")}
    robot = ET.parse(tmp_path / "urdf/husky.urdf").getroot()
    assert not list(robot.iter("sensor"))
    assert {p.get("name") for p in robot.iter("plugin")} == {"drive", "joint_states", "ground_truth"}
    assert {joint.find("child").attrib["link"] for joint in robot.iter("joint")} == {c for _, c in rig_transforms(RIG)}  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (None, "rig.sensors: fisheye has the lens equidistant; a Gazebo package has plain pinhole cameras only; "
         "give enabled: false"),
        ({"name": "panorama", "lens": {"model": "equirectangular"}},
         "rig.sensors: panorama has the lens equirectangular; a Gazebo package has plain pinhole cameras only; "
         "give enabled: false"),
        ({"name": "front", "lens": {"fx": 100.0, "cx": 80.0}},
         "rig.sensors: front has a lens with fx, cx; a Gazebo package has plain pinhole cameras only; "
         "give enabled: false"),
        ({"name": "low", "model": "pandar64"},
         "rig.sensors: low has uneven elevations_deg; the beams of Gazebo's scanner are even and straight above each "
         "other; give enabled: false"),
        ({"name": "low", "model": "mid_360"},
         "rig.sensors: low has the pattern mid_360; Gazebo's scanner turns evenly; give enabled: false"),
    ],
)  # fmt: skip
def test_what_gazebo_does_not_have_is_one_line(change: dict[str, Any] | None, line: str, tmp_path: Path) -> None:
    items = pinholes() if change else many_sensors()
    changed = [{**item, **change} if change and item.get("name") == change["name"] else item for item in items]
    for flavour in ("classic", "both"):
        with pytest.raises(ConfigurationError) as error:
            fieldtruth.gazebo.write_gazebo(
                inclined_park(), tmp_path / "out", flavour=flavour, rig=Rig.model_validate({"sensors": changed})
            )
        assert str(error.value) == line
    assert not list(tmp_path.iterdir())


def test_many_rig_without_the_two_lenses_is_written(tmp_path: Path) -> None:
    """As the error advises: ``enabled: false``."""
    off = [{**i, "enabled": False} if i.get("name") in ("fisheye", "panorama") else i for i in many_sensors()]
    for flavour in get_args(Flavour):
        model = sdf(Rig.model_validate({"sensors": off}), flavour, tmp_path)[0]
        names = {frame.get("name") for frame in model.findall("frame")}
        assert {"fisheye_link", "fisheye_link_optical", "panorama_link", "panorama_link_optical"} <= names
        assert not any("fisheye" in str(s.get("name")) for s in model.iter("sensor"))
    with pytest.raises(ConfigurationError, match=r"^rig\.sensors: fisheye has the lens equidistant; "):
        write_robot(tmp_path, many_rig(), "gz")


@pytest.mark.parametrize(("config", "kind"), [(ImuConfig, "imu"), (GnssConfig, "gnss")])
@ROS
def test_a_rig_that_cannot_be_steered_is_one_line(ros: int, config: type, kind: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=rf"^rig\.sensors: no {kind} is enabled; the waypoint node "):
        package(tmp_path, ros, Rig().with_sensors(config, enabled=False))
    assert not list(tmp_path.iterdir())


def test_housings_that_another_sensor_would_see_are_not_drawn() -> None:
    """Beside the paper's sensors: a second LiDAR, which stands in the first one's beams or below them."""
    paper = Rig().model_dump()["sensors"]
    for z, drawn in ((0.9, False), (0.5, True)):
        beside = {"kind": "lidar", "name": "second", "mount": {"xyz": [-0.45, 0.0, z]}, "rings": 1, "columns": 8}
        names = {shape.name for shape in body_shapes(Rig.model_validate({"sensors": [*paper, beside]}))}
        assert ("second_housing" in names) == drawn
    ahead = {"kind": "camera", "name": "ahead", "mount": {"xyz": [0.6, 0.0, 0.72]}}
    assert "ahead_housing" not in {s.name for s in body_shapes(Rig.model_validate({"sensors": [*paper, ahead]}))}
    behind = ahead | {"mount": {"xyz": [-0.2, 0.0, 0.5], "rpy_deg": [0.0, 0.0, 180.0]}}
    assert "ahead_housing" in {s.name for s in body_shapes(Rig.model_validate({"sensors": [*paper, behind]}))}


def test_no_beam_of_any_lidar_meets_the_mast() -> None:
    paper = Rig().model_dump()["sensors"]
    for z in (0.6, 0.3):
        second = {"kind": "lidar", "name": "second", "mount": {"xyz": [0.6, 0.0, z]}, "vertical_fov_deg": 10.0}
        rig = Rig.model_validate({"sensors": [*paper, second]})
        tops = [s.xyz[2] + s.size[2] / 2 for s in body_shapes(rig) if s.name == "mast"]
        assert all(top < z for top in tops)
        assert len(tops) == (z == 0.6)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot for Gazebo and ROS, read back with parsers that we did not write, has our frames, masses and rays."""

import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import trimesh
import xacro
import yourdfpy

from fieldtruth.bag.messages import rig_transforms
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.readings import Cloud, Reading
from fieldtruth.drive.physics import ROTOR_INERTIA, wheel_speeds
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.experiment.robot_config import WHEELS, RobotConfig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.gazebo.robot import Flavour, Shape, body_shapes, robot_words, wheel_shape, write_robot
from fieldtruth.sense.lens import intrinsics_of
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, StereoConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import ray_directions
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig

HUSKY = RobotConfig()
FLAVOURS = get_args(Flavour)
OTHER_RIG = paper_rig(
    imu=ImuConfig(mount=Mount(xyz=(0.1, 0.02, 0.3), rpy_deg=(12.0, -35.0, 140.0))),
    lidar=LidarConfig(columns=33, rings=5, vertical_fov_deg=30.0, mount=Mount(xyz=(0.0, 0.1, 0.9), rpy_deg=(3, 4, 5))),
    cameras=StereoConfig(baseline=0.2, mount=Mount(xyz=(0.2, 0.0, 0.7), rpy_deg=(0.0, 100.0, 0.0))),
)
RIGS = pytest.mark.parametrize("rig", [Rig(), OTHER_RIG], ids=["default", "other"])


@pytest.fixture(scope="module")
def classic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("classic")
    write_robot(folder, Rig(), "classic")
    return folder


def sdf(rig: Rig, flavour: Flavour, folder: Path) -> ET.Element:
    write_robot(folder, rig, flavour)
    return ET.parse(folder / "models/husky/model.sdf").getroot()


def values(element: ET.Element, path: str) -> list[float]:
    return [float(word) for word in (element.findtext(path) or "").split()]


def pose(element: ET.Element) -> Array:
    xyzrpy = values(element, "pose")
    return transforms.pose(xyzrpy[:3], np.degrees(xyzrpy[3:]).tolist())


@RIGS
def test_urdf_has_the_frames_of_tf_static(rig: Rig, tmp_path: Path) -> None:
    write_robot(tmp_path, rig, "classic")
    urdf = yourdfpy.URDF.load(str(tmp_path / "urdf/husky.urdf"), load_meshes=False)
    expected = rig_transforms(rig)
    assert {(j.parent, j.child) for j in urdf.robot.joints} == set(expected)
    for (parent, child), parent_from_child in expected.items():
        np.testing.assert_allclose(urdf.get_transform(child, parent), parent_from_child, rtol=0, atol=1e-9)
    base_from_optical = rig.stereo.left.base_from_sensor @ CAMERA_FROM_OPTICAL
    np.testing.assert_allclose(urdf.get_transform("left_camera_optical"), base_from_optical, rtol=0, atol=1e-9)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_kind_may_give_an_element_of_its_own(
    flavour: Flavour, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(WheelOdometryConfig, "gazebo", lambda self, flavour: f"<sensor name='{self.name}' type='x'/>")
    assert sdf(Rig(), flavour, tmp_path).find(".//link[@name='base_link']/sensor[@type='x']") is not None
    urdf = ET.parse(tmp_path / "urdf/husky.urdf").getroot()
    assert urdf.find("gazebo[@reference='base_link']/sensor[@type='x']") is not None


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize(
    ("config", "replaced"),
    [(LidarConfig, {"ray", "gpu_lidar"}), (StereoConfig, {"camera", "segmentation"}), (ImuConfig, {"imu"})],
)
def test_an_element_of_its_own_takes_the_place_of_that_of_its_readings(
    config: type[SensorConfig],
    replaced: set[str],
    flavour: Flavour,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    usual = [sensor.get("type") for sensor in sdf(Rig(), flavour, tmp_path / "usual").iter("sensor")]
    monkeypatch.setattr(config, "gazebo", lambda self, flavour: f"<sensor name='{self.name}' type='x'/>")
    found = [sensor.get("type") for sensor in sdf(Rig(), flavour, tmp_path / "own").iter("sensor")]
    assert replaced & {*usual}
    assert Counter(found) == Counter(["x", *(each for each in usual if each not in replaced)])


@pytest.mark.parametrize("gives", [WheelOdometryConfig.gives, Cloud])
def test_an_element_of_the_other_flavour_does_not_help(
    gives: type[Reading], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor do readings of a type that Gazebo knows, of a kind that is not known to scan."""
    monkeypatch.setattr(WheelOdometryConfig, "needs_wheels", False)
    monkeypatch.setattr(WheelOdometryConfig, "gives", gives)
    monkeypatch.setattr(WheelOdometryConfig, "gazebo", lambda self, flavour: "<sensor/>" if flavour == "gz" else "")
    write_robot(tmp_path, Rig(), "gz")
    with pytest.raises(ConfigurationError, match=r"of kind wheel_odometry, which a Gazebo package cannot hold; "):
        write_robot(tmp_path, Rig(), "classic")


@RIGS
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_sdf_has_the_frames_of_tf_static(rig: Rig, flavour: Flavour, tmp_path: Path) -> None:
    model = sdf(rig, flavour, tmp_path)[0]
    found = {(e.get("attached_to"), e.get("name")): pose(e) for e in model.findall("frame")}
    found |= {("base_link", e.get("name")): pose(e) for e in model.findall("link")[1:]}
    expected = rig_transforms(rig)
    assert set(found) == set(expected)
    for key in expected:
        np.testing.assert_allclose(found[key], expected[key], rtol=0, atol=1e-9)


@RIGS
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_sensors_are_at_their_frames(rig: Rig, flavour: Flavour, tmp_path: Path) -> None:
    model = sdf(rig, flavour, tmp_path)[0]
    poses = {str(s.get("name")): pose(s) for s in model.iter("sensor")}
    for name, sensor in (("os1_lidar", rig.lidar), ("imu", rig.imu), ("gnss", rig.gnss)):
        np.testing.assert_allclose(poses[name], sensor.mount.base_from_sensor, rtol=0, atol=1e-9)
    # Gazebo's cameras look along x with z up; optical frames look along z with y down.
    body_from_optical = transforms.pose((0, 0, 0), (-90.0, 0.0, -90.0))
    for side, mount in (("left", rig.stereo.left), ("right", rig.stereo.right)):
        base_from_optical = mount.base_from_sensor @ CAMERA_FROM_OPTICAL
        np.testing.assert_allclose(poses[f"{side}_camera"] @ body_from_optical, base_from_optical, rtol=0, atol=1e-9)


@RIGS
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_rays_are_ours(rig: Rig, flavour: Flavour, tmp_path: Path) -> None:
    model = sdf(rig, flavour, tmp_path)[0]
    scan = next(model.iter("scan"))
    (columns,), (rings,) = values(scan, "horizontal/samples"), values(scan, "vertical/samples")
    assert (columns, rings) == (rig.lidar.columns, rig.lidar.rings)
    (left,), (right,) = values(scan, "horizontal/min_angle"), values(scan, "horizontal/max_angle")
    (low,), (high,) = values(scan, "vertical/min_angle"), values(scan, "vertical/max_angle")
    azimuth, elevation = np.linspace(left, right, int(columns)), np.linspace(low, high, int(rings))
    directions = np.empty((int(columns), int(rings), 3))
    directions[..., 0] = np.cos(azimuth)[:, None] * np.cos(elevation)
    directions[..., 1] = np.sin(azimuth)[:, None] * np.cos(elevation)
    directions[..., 2] = np.sin(elevation)
    n = rig.lidar.columns
    ours = ray_directions(rig.lidar)[(n // 2 - np.arange(n)) % n][:, ::-1]
    np.testing.assert_allclose(directions, ours, rtol=0, atol=1e-12)


def test_even_beams_of_a_table_are_ours(tmp_path: Path) -> None:
    """Ring 0 may be the highest or the lowest."""
    for angles in ((15.0, 4.0, -7.0), (-7.0, 4.0, 15.0)):
        scan = next(sdf(paper_rig(lidar=LidarConfig(elevations_deg=angles)), "gz", tmp_path).iter("scan"))
        low, high = (values(scan, f"vertical/{end}_angle")[0] for end in ("min", "max"))
        assert np.degrees(np.linspace(low, high, 3)) == pytest.approx([-7.0, 4.0, 15.0])


@pytest.mark.parametrize(
    ("lidar", "key"),
    [
        (LidarConfig(elevations_deg=(2.0, 1.0, -1.0)), "uneven elevations_deg"),
        (LidarConfig(model="pandar64"), "uneven elevations_deg"),
        (LidarConfig(rings=2, azimuth_offsets_deg=(0.0, 1.0)), "azimuth_offsets_deg"),
    ],
)
def test_beams_that_gazebo_cannot_have_are_an_error(lidar: LidarConfig, key: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=rf"^rig\.sensors: lidar has {key}; the beams of Gazebo's "):
        write_robot(tmp_path, paper_rig(lidar=lidar), "gz")
    write_robot(tmp_path, paper_rig(lidar=lidar.model_copy(update={"enabled": False})), "gz")


@pytest.mark.parametrize(
    ("robot", "title", "name"),
    [
        (RobotConfig(), "Clearpath Husky", "Husky"),
        (RobotConfig(model="scout"), "AgileX Scout 2.0", "Scout 2.0"),
        (RobotConfig(model="generic_skid_steer"), "Skid-steer robot of 30 kg", "robot"),
        (RobotConfig(max_speed=0.7), "Robot with figures other than a Clearpath Husky's", "robot"),
    ],
)
def test_words_are_those_of_the_robot(robot: RobotConfig, title: str, name: str, tmp_path: Path) -> None:
    assert robot_words(robot) == (title, name)
    write_robot(tmp_path, Rig(robot=robot), "classic")
    for path in ("models/husky/model.config", "models/husky/model.sdf", "urdf/husky.urdf"):
        assert f"{title} with " in (tmp_path / path).read_text().replace("&#39;", "'")


@RIGS
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_lens_is_our_pinhole(rig: Rig, flavour: Flavour, tmp_path: Path) -> None:
    """Gazebo's principal point counts from the image's border, so the centre of pixel 0 is at 0.5."""
    camera = next(sdf(rig, flavour, tmp_path).iter("camera"))
    fx, fy, cx, cy = (values(camera, f"lens/intrinsics/{name}")[0] for name in ("fx", "fy", "cx", "cy"))
    ours = intrinsics_of(rig.stereo)
    np.testing.assert_allclose((fx, fy, cx - 0.5, cy - 0.5), ours, rtol=1e-12)
    half_width = np.tan(values(camera, "horizontal_fov")[0] / 2)
    assert fx * half_width == pytest.approx(rig.stereo.width / 2, rel=1e-12)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_masses_are_the_physics(flavour: Flavour, tmp_path: Path) -> None:
    links = sdf(Rig(), flavour, tmp_path)[0].findall("link")
    masses = [values(link, "inertial/mass")[0] for link in links]
    assert sum(masses) == pytest.approx(HUSKY.mass, abs=1e-9)
    assert masses[1:] == [HUSKY.wheels.mass] * 4


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_inertia_of_roll_and_yaw_is_the_physics(flavour: Flavour, tmp_path: Path) -> None:
    """The moments across the axles that the rotors add to the wheels are taken from the chassis."""
    links = sdf(Rig(), flavour, tmp_path)[0].findall("link")
    scale = (HUSKY.mass - 4 * HUSKY.wheels.mass) / HUSKY.chassis_inertia_mass
    for axis, name in ((0, "ixx"), (2, "izz")):
        moments = [values(link, f"inertial/inertia/{name}")[0] for link in links]
        expected = HUSKY.chassis_inertia[axis] * scale + 4 * HUSKY.wheels.inertia[axis]
        assert sum(moments) == pytest.approx(expected, rel=1e-12)
    axle = values(links[1], "inertial/inertia/iyy")[0]
    assert axle == pytest.approx(HUSKY.wheels.inertia[1] + ROTOR_INERTIA)


def test_urdf_weighs_what_the_sdf_weighs(classic: Path) -> None:
    robot = ET.parse(classic / "urdf/husky.urdf").getroot()
    assert sum(float(e.attrib["value"]) for e in robot.iter("mass")) == pytest.approx(HUSKY.mass, abs=1e-9)


def test_a_turn_is_commanded_as_in_the_physics(classic: Path) -> None:
    """Both drives of Gazebo divide a turn by half the track they know; ours makes up for the skidding."""
    turn_rate, wheels = 0.3, Rig().wheels
    left, right, *_ = wheel_speeds((0.0, turn_rate), wheels) * wheels.radius
    plugin = ET.parse(classic / "urdf/husky.urdf").getroot().find("gazebo/plugin[@name='drive']")
    assert plugin is not None
    assert turn_rate * values(plugin, "wheelSeparation")[0] == pytest.approx(right - left, rel=1e-12)
    model = ET.parse(classic / "models/husky/model.sdf").getroot()[0]
    anchors = {
        str(joint.get("name")): transforms.pose(values(joint, "pose")[:3])[1, 3] for joint in model.findall("joint")
    }
    track = {name: wheels.half_track * (1 if "left" in name else -1) + anchor for name, anchor in anchors.items()}
    for end in ("front", "rear"):
        distance = track[f"{end}_left_wheel_joint"] - track[f"{end}_right_wheel_joint"]
        assert turn_rate * distance == pytest.approx(right - left, rel=1e-12)


def test_the_robot_does_not_see_itself() -> None:
    rig = Rig()
    lidar = transforms.inverse(rig.lidar.mount.base_from_sensor)
    camera, intrinsics = rig.stereo, intrinsics_of(rig.stereo)
    drawn = [(shape, (0.0, 0.0, 0.0)) for shape in body_shapes(rig)]
    drawn += [(wheel_shape(rig), rig.mounts()[f"{name}_wheel"].xyz) for name in WHEELS]
    for shape, xyz in drawn:
        points = _surface(shape) + xyz
        x, y, z = transforms.transform(lidar, points).T
        elevation, distance = np.degrees(np.arctan2(z, np.hypot(x, y))), np.linalg.norm((x, y, z), axis=0)
        below = np.abs(elevation) > rig.lidar.vertical_fov_deg / 2
        # Gazebo's rays begin at the least range; what is drawn nearer is behind the clipping plane.
        assert (below | (distance < rig.lidar.min_range)).all(), shape.name
        assert not shape.solid or below.all(), shape.name
        for mount in (camera.left, camera.right):
            u, v, depth = transforms.transform(
                transforms.inverse(mount.base_from_sensor @ CAMERA_FROM_OPTICAL), points
            ).T
            ahead = depth > 1e-9
            inside = (np.abs(u) * intrinsics.fx < depth * camera.width / 2) & (
                np.abs(v) * intrinsics.fy < depth * camera.height / 2
            )
            assert not (shape.drawn and (ahead & inside).any()), shape.name


def test_the_robot_casts_no_shadow(classic: Path) -> None:
    """Gazebo applies what <gazebo> says about <visual> to all visuals of the link."""
    model, robot = (ET.parse(classic / name).getroot() for name in ("models/husky/model.sdf", "urdf/husky.urdf"))
    visuals = list(model.iter("visual"))
    assert len(visuals) > 8
    assert {visual.findtext("cast_shadows") for visual in visuals} == {"0"}
    drawn = {link.get("name") for link in robot.findall("link") if link.find("visual") is not None}
    dark = {e.get("reference") for e in robot.findall("gazebo") if e.findtext("visual/cast_shadows") == "false"}
    assert drawn == dark


def _surface(shape: Shape) -> Array:
    mesh = trimesh.creation.box(shape.size) if shape.is_box else trimesh.creation.cylinder(shape.size[0], shape.size[1])
    mesh.apply_transform(transforms.pose(shape.xyz, np.degrees(shape.rpy).tolist()))
    points, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=1)
    return np.concatenate([points, mesh.vertices])


def test_xacro_expands_to_the_urdf(classic: Path) -> None:
    expanded = ET.fromstring(_xacro(classic))
    assert _canonical(expanded) == _canonical(ET.parse(classic / "urdf/husky.urdf").getroot())


def test_arguments_of_xacro_switch_sensors(classic: Path) -> None:
    bare = _xacro(classic, lidar="false", cameras="false")
    assert "libgazebo_ros_velodyne_laser.so" not in bare
    assert "libgazebo_ros_camera.so" not in bare
    plain = ET.fromstring(_xacro(classic, plain="true"))
    assert [e.text for e in plain.iter("imageTopicName")] == ["tag/img_raw"] * 2
    photographs = ET.fromstring(_xacro(classic))
    assert [e.text for e in photographs.iter("imageTopicName")] == ["real"] * 2


def test_check_urdf_finds_nothing(classic: Path) -> None:
    result = subprocess.run([_tool("check_urdf"), classic / "urdf/husky.urdf"], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert "Successfully Parsed XML" in result.stdout
    assert result.stderr == ""


@RIGS
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_libsdformat_finds_nothing(rig: Rig, flavour: Flavour, tmp_path: Path) -> None:
    write_robot(tmp_path, rig, flavour)
    command = [_tool("ign"), "sdf", "-k", str(tmp_path / "models/husky/model.sdf")]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert result.stdout == "Valid.\n"
    assert "Warning" not in result.stderr
    assert "Error:" not in result.stderr


def test_a_rig_without_lidar_and_cameras(tmp_path: Path) -> None:
    rig = paper_rig(lidar=LidarConfig(enabled=False), cameras=StereoConfig(enabled=False))
    assert {s.get("type") for s in sdf(rig, "classic", tmp_path).iter("sensor")} == {"imu", "gps"}
    text = _xacro(tmp_path)
    assert "velodyne" not in text
    assert "libgazebo_ros_camera" not in text


def _tool(name: str) -> str:
    packages = {"check_urdf": "liburdfdom-tools", "ign": "libsdformat-dev and ignition-tools"}
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"needs {name}; Debian: apt-get install {packages[name]}")
    return path


def _xacro(folder: Path, **arguments: str) -> str:
    return str(xacro.process_file(folder / "urdf/husky.urdf.xacro", mappings=arguments).toxml())


def _canonical(element: ET.Element) -> object:
    attributes = tuple(sorted(element.attrib.items()))
    return element.tag, attributes, (element.text or "").strip(), tuple(_canonical(child) for child in element)


def test_a_lidar_without_cameras_stands_on_a_pole_that_ends_below_it() -> None:
    rig = paper_rig(cameras=StereoConfig(enabled=False))
    pole = next(shape for shape in body_shapes(rig) if shape.name == "lidar_pole")
    upper = pole.xyz[2] + pole.size[1] / 2
    assert 0.7 < upper < rig.giving(Cloud)[0].mount.xyz[2]

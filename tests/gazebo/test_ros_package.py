# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ROS packages: both waypoint nodes command what our follower commands, and the files fit together."""

import math
import subprocess
import sys
import textwrap
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.drive.controller import WaypointFollower
from fieldtruth.experiment.config import geodetic_route, metres_from_route
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.files import load_experiment, parse_experiment
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.gazebo.robot import write_robot
from fieldtruth.gazebo.ros import builtin_experiments, write_ros_package
from fieldtruth.sensors.camera.sensor import camera_matrix, projection_matrix
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.wheel_odometry.config import WHEEL_SPEEDS
from fieldtruth.world.model import Heightfield, Raster, Terrain, World

TILTED = paper_rig(imu=ImuConfig(mount=Mount(xyz=(0.1, 0.0, 0.2), rpy_deg=(20.0, -75.0, 130.0))))
RIGS = pytest.mark.parametrize("rig", [Rig(), TILTED], ids=["upright", "tilted"])
ROS = pytest.mark.parametrize("ros", [1, 2])
SLOPE = 0.1  # rise along x


def inclined_park() -> World:
    """A plane that rises along x, under the name of an environment."""
    x = np.linspace(-50.0, 50.0, 101)
    heights = np.repeat((SLOPE * x)[:, None], 51, axis=1).astype(np.float32)
    far = Raster(values=np.ones((2, 2), np.float32), spacing=100.0, x0=-50.0, y0=-50.0)
    terrain = Terrain(
        field=Heightfield(heights=heights, spacing=1.0, x0=-50.0, y0=-25.0),
        trail_distance=far,
        cover=far,
        ground_materials=("soil",),
        trail_material="soil",
        border_material="soil",
    )
    return World(
        name="park", seed=0, size=(100.0, 50.0), terrain=terrain, meshes={}, instances=(), materials={}, textures={}
    )


def package(folder: Path, ros: int, rig: Rig | None = None) -> Path:
    write_ros_package(folder, inclined_park(), rig or Rig(), "classic" if ros == 1 else "gz")
    return folder


def twist() -> Any:
    return SimpleNamespace(linear=SimpleNamespace(x=0.0), angular=SimpleNamespace(z=0.0))


def float32(value: float | None = None, *, data: float | None = None) -> Any:
    return SimpleNamespace(data=value if data is None else data)


class FakeRos:
    """Modules of ROS 1 and ROS 2 that keep subscriptions and publications."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.callbacks: dict[str, Callable[[Any], None]] = {}
        self.published: dict[str, list[Any]] = {}
        fake = self

        class Publisher:
            def __init__(self, topic: str) -> None:
                self.messages = fake.published.setdefault(topic, [])

            def publish(self, message: Any) -> None:
                self.messages.append(message)

        class Node:
            def __init__(self, name: str) -> None: ...
            def create_publisher(self, kind: type, topic: str, depth: int) -> Publisher:
                return Publisher(topic)

            def create_subscription(self, kind: type, topic: str, callback: Any, depth: int) -> None:
                fake.callbacks[topic] = callback

            def get_logger(self) -> Any:
                return SimpleNamespace(info=lambda text: None)

        modules: dict[str, dict[str, Any]] = {
            "rospy": {
                "init_node": lambda name: None,
                "loginfo": lambda *a: None,
                "spin": lambda: None,
                "myargv": list,
                "Publisher": lambda topic, kind, queue_size: Publisher(topic),
                "Subscriber": lambda topic, kind, callback: self.callbacks.__setitem__(topic, callback),
            },
            "rclpy": {"init": lambda args: None, "spin": lambda node: None},
            "rclpy.node": {"Node": Node},
            "rclpy.utilities": {"remove_ros_args": list},
            "geometry_msgs": {},
            "geometry_msgs.msg": {"Twist": twist},
            "sensor_msgs": {},
            "sensor_msgs.msg": dict.fromkeys(("Imu", "NavSatFix", "JointState", "CameraInfo"), object),
            "std_msgs": {},
            "std_msgs.msg": {"Float32": float32},
        }
        for name, members in modules.items():
            module = ModuleType(name)
            vars(module).update(members)
            monkeypatch.setitem(sys.modules, name, module)

    def run(self, script: Path, config: Path) -> None:
        """Run the node's main, which returns after its subscriptions because ``spin`` does."""
        scope: dict[str, Any] = {"__name__": "node"}
        exec(compile(script.read_text(), str(script), "exec"), scope)
        scope["main"]([str(script), str(config)])


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeRos:
    return FakeRos(monkeypatch)


@RIGS
@ROS
def test_waypoint_nodes_command_as_the_follower(rig: Rig, ros: int, fake: FakeRos, tmp_path: Path) -> None:
    """A wandering antenna, which passes every waypoint, and a robot that pitches and rolls."""
    package(tmp_path, ros, rig)
    experiment = load_experiment("park_1")
    follower = WaypointFollower(geodetic_route(experiment.route).waypoints, experiment.control)
    fake.run(tmp_path / "scripts/waypoints.py", tmp_path / "config/park_1.yaml")
    rng = np.random.default_rng(1)
    corners = metres_from_route(experiment.route)
    along = np.linspace(0, len(corners) - 1, 300)
    path = np.column_stack([np.interp(along, np.arange(len(corners)), corners[:, k]) for k in range(2)])
    commands = []
    for x, y in path + rng.normal(scale=1.0, size=path.shape):
        latitude, longitude, height = geodetic_from_world((x, y, rng.uniform(-3.0, 3.0)))
        follower.update_fix(float(latitude), float(longitude))
        fix = SimpleNamespace(latitude=float(latitude), longitude=float(longitude), altitude=float(height))
        fake.callbacks[rig.gnss.topic](fix)
        heading, pitch, roll = rng.uniform(-math.pi, math.pi), *rng.uniform(-0.3, 0.3, 2)
        world_from_base = Rotation.from_euler("ZYX", [heading, pitch, roll])
        base_from_imu = Rotation.from_matrix(rig.imu.mount.base_from_sensor[:3, :3])
        q = dict(zip("xyzw", (world_from_base * base_from_imu).as_quat(), strict=True))
        fake.callbacks[rig.imu.topic](SimpleNamespace(orientation=SimpleNamespace(**q)))
        commands.append(follower.command(heading))
    found = [(message.linear.x, message.angular.z) for message in fake.published["/cmd_vel"]]
    np.testing.assert_allclose(found, commands, rtol=0, atol=1e-9)
    assert follower.finished
    assert found[-1] == (0.0, 0.0)
    rates = np.abs([rate for speed, rate in found if speed > 0])
    assert (rates == experiment.control.max_turn_rate).any()
    assert (rates < experiment.control.max_turn_rate).any()


@ROS
def test_no_command_moves_before_the_first_fix(ros: int, fake: FakeRos, tmp_path: Path) -> None:
    package(tmp_path, ros)
    fake.run(tmp_path / "scripts/waypoints.py", tmp_path / "config/park_1.yaml")
    fake.callbacks[Rig().imu.topic](SimpleNamespace(orientation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)))
    (command,) = fake.published["/cmd_vel"]
    assert (command.linear.x, command.angular.z) == (0.0, 0.0)


@ROS
def test_relay_completes_the_topics(ros: int, fake: FakeRos, tmp_path: Path) -> None:
    package(tmp_path, ros)
    fake.run(tmp_path / "scripts/relay.py", tmp_path / "config/cameras.yaml")
    joints = [f"{wheel}_wheel_joint" for wheel in ("rear_left", "front_left", "front_right", "rear_right")]
    for k in range(1, 301):  # 100 Hz for 3 s; the tachometers have 10 Hz
        stamp = SimpleNamespace(sec=k // 100, nanosec=k % 100 * 10_000_000, to_sec=lambda k=k: k / 100)
        header = SimpleNamespace(stamp=stamp)
        fake.callbacks["/joint_states"](SimpleNamespace(header=header, name=joints, velocity=[1.0, 2.0, 3.0, 4.0]))
    for topic, speed in zip(WHEEL_SPEEDS, (2.0, 3.0, 1.0, 4.0), strict=True):
        assert [message.data for message in fake.published[topic]] == [speed] * 30
    fake.callbacks["/stereo/camera/right/camera_info_gazebo"](SimpleNamespace(header=SimpleNamespace(frame_id="")))
    (info,) = fake.published["/stereo/camera/right/camera_info"]
    k, p = (info.K, info.P) if ros == 1 else (info.k, info.p)
    np.testing.assert_array_equal(np.reshape(k, (3, 3)), camera_matrix(Rig().stereo))
    np.testing.assert_array_equal(np.reshape(p, (3, 4)), projection_matrix(Rig().imagers[1]))
    assert (info.header.frame_id, info.width, info.height) == ("right_camera_optical", 1280, 720)


@ROS
def test_starts_and_waypoints_are_those_of_the_experiments(ros: int, tmp_path: Path) -> None:
    package(tmp_path, ros)
    experiments = builtin_experiments("park")
    assert [e.name for e in experiments] == ["park_1", "park_2"]
    for experiment in experiments:
        config = yaml.safe_load((tmp_path / "config" / f"{experiment.name}.yaml").read_text())
        route = geodetic_route(experiment.route)
        assert [tuple(waypoint) for waypoint in config["waypoints"]] == list(route.waypoints)
        (x, y), ahead = metres_from_route(route)[:2]
        start = config["start"]
        assert math.dist((start["x"], start["y"]), (x, y)) < 0.02  # tilted above the slope
        assert start["z"] == pytest.approx(SLOPE * x + 0.13228, abs=0.002)
        attitude = Rotation.from_euler("xyz", [start[name] for name in ("roll", "pitch", "yaw")]).as_matrix()
        slope = np.array([-SLOPE, 0.0, 1.0])
        np.testing.assert_allclose(attitude[:, 2], slope / np.linalg.norm(slope), atol=1e-5)
        heading = math.atan2(attitude[1, 0], attitude[0, 0])
        assert heading == pytest.approx(math.atan2(ahead[1] - y, ahead[0] - x), abs=1e-4)


def test_launch_files_of_ros_1_start_the_robot_at_its_pose(tmp_path: Path) -> None:
    package(tmp_path, 1)
    start = yaml.safe_load((tmp_path / "config/park_2.yaml").read_text())["start"]
    include = ET.parse(tmp_path / "launch/park_2.launch").getroot().find("include")
    assert include is not None
    given = {a.get("name"): a.get("value") for a in include.findall("arg")}
    assert {key: float(given[key] or "nan") for key in start} == start
    declared = {a.get("name") for a in ET.parse(tmp_path / "launch/world.launch").getroot().findall("arg")}
    assert set(given) <= declared


@ROS
def test_scripts_are_executable_and_name_every_topic(ros: int, tmp_path: Path) -> None:
    package(tmp_path, ros)
    scripts = sorted((tmp_path / "scripts").iterdir())
    assert [script.name for script in scripts] == ["record.sh", "relay.py", "waypoints.py"]
    assert all(script.stat().st_mode & 0o111 for script in scripts)
    record = scripts[0].read_text()
    assert subprocess.run(["sh", "-n", scripts[0]], capture_output=True).returncode == 0
    assert [word for word in record.split() if word.startswith("/") and word != "/bin/sh"] == [
        topic.name for topic in topics.topics_of(Rig())
    ]


def test_bridge_and_model_agree_on_topics(tmp_path: Path) -> None:
    package(tmp_path, 2)
    write_robot(tmp_path, Rig(), "gz")
    bridged = {row["gz_topic_name"] for row in yaml.safe_load((tmp_path / "config/bridge.yaml").read_text())}
    model = ET.parse(tmp_path / "models/husky/model.sdf").getroot()[0]
    sensors = {f"/{sensor.findtext('topic')}" for sensor in model.iter("sensor")}
    plugins = {f"/{e.text}" for p in model.findall("plugin") for e in p if "topic" in e.tag}
    cameras = {f"/stereo/camera/{side}/camera_info" for side in ("left", "right")}
    # A camera's info is beside its images; a LiDAR adds /points for the cloud.
    published = sensors | plugins | cameras | {f"{topic}/points" for topic in sensors} | {"/clock"}
    assert bridged <= published
    assert {"/imu/data", "/navsat/fix", "/os1_cloud_node/points", "/joint_states", "/cmd_vel"} <= bridged


@ROS
def test_rviz_has_the_classes_of_its_version(ros: int, tmp_path: Path) -> None:
    package(tmp_path, ros)
    config = yaml.safe_load((tmp_path / "rviz/fieldtruth.rviz").read_text())
    displays = {display["Class"].split("/")[0] for display in config["Visualization Manager"]["Displays"]}
    panels = {panel["Class"].split("/")[0] for panel in config["Panels"]}
    assert displays == {"rviz" if ros == 1 else "rviz_default_plugins"}
    assert panels == {"rviz" if ros == 1 else "rviz_common"}
    images = [d for d in config["Visualization Manager"]["Displays"] if d["Class"].endswith("/Image")]
    wanted = ["/stereo/camera/left/real/compressed", "/stereo/camera/left/tag/img_raw"]
    if ros == 1:
        assert [f"{i['Image Topic']}/{i['Transport Hint']}".removesuffix("/raw") for i in images] == wanted
    else:
        assert [i["Topic"] for i in images] == wanted


@ROS
def test_the_read_me_names_what_exists(ros: int, tmp_path: Path) -> None:
    package(tmp_path, ros)
    text = (tmp_path / "README.md").read_text()
    names = ("park_1.launch", "park_2.launch") if ros == 1 else ("experiment:=park_1", "experiment:=park_2")
    assert all(name in text for name in names)
    assert "{{" not in text


def test_the_recording_of_ros_2_is_a_track_file(tmp_path: Path) -> None:
    package(tmp_path, 2)
    text = (tmp_path / "README.md").read_text()
    start, end = text.index("    name: again"), text.index("    fieldtruth generate")
    experiment = parse_experiment(textwrap.dedent(text[start:end]))
    assert experiment.environment == "park"
    assert experiment.drive is not None
    assert experiment.drive.track == "/tmp/park_1"

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The package with ROS 1's own programs: roslaunch, robot_state_publisher, and the waypoint node at a real roscore."""

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from test_ros_package import inclined_park

from fieldtruth.bag.messages import rig_transforms
from fieldtruth.core.transforms import pose_from_quaternion_wxyz, wxyz_from_xyzw
from fieldtruth.drive.controller import WaypointFollower
from fieldtruth.experiment.config import geodetic_route
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.gazebo.robot import write_robot
from fieldtruth.gazebo.ros import write_ros_package

PYTHON = "/usr/bin/python3"  # ROS's modules belong to Debian's own Python
PUBLISHER = Path("/usr/lib/robot_state_publisher/robot_state_publisher")


def installed() -> bool:
    if shutil.which("roscore") is None or not Path(PYTHON).exists():
        return False
    modules = "import rospy, roslaunch, rosparam, geometry_msgs.msg, sensor_msgs.msg, tf2_msgs.msg"
    return subprocess.run([PYTHON, "-c", modules], capture_output=True, check=False).returncode == 0


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not installed(), reason="needs Debian's python3-rospy, python3-roslaunch, python3-rosparam, python3-tf2-msgs"
    ),
]

LAUNCH = """
import json, sys
from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader

config = ROSLaunchConfig()
XmlLoader(resolve_anon=False).load(sys.argv[1], config, verbose=False, argv=sys.argv[1:])
print(json.dumps({
    "nodes": {node.name: [node.package, node.type, node.args] for node in config.nodes},
    "errors": config.config_errors,
    "description": config.params["/robot_description"].value,
}))
"""
FEED = """
import json, sys
import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Imu, NavSatFix

rospy.init_node("feed")
commands = []
rospy.Subscriber("/cmd_vel", Twist, lambda m: commands.append([m.linear.x, m.angular.z]))
fixes = rospy.Publisher("/navsat/fix", NavSatFix, queue_size=9)
readings = rospy.Publisher("/imu/data", Imu, queue_size=9)
while not (fixes.get_num_connections() and readings.get_num_connections()):
    rospy.sleep(0.05)
for latitude, longitude in json.loads(sys.argv[1]):
    fixes.publish(NavSatFix(latitude=latitude, longitude=longitude))
    rospy.sleep(0.3)
    reading = Imu()
    reading.orientation.x = reading.orientation.z = 0.5 ** 0.5
    readings.publish(reading)
    rospy.sleep(0.3)
print(json.dumps(commands))
"""
FRAMES = """
import json
import rospy
from tf2_msgs.msg import TFMessage

rospy.init_node("listener")
message = rospy.wait_for_message("/tf_static", TFMessage, timeout=20)
print(json.dumps([
    [t.header.frame_id, t.child_frame_id, [getattr(t.transform.translation, k) for k in "xyz"],
     [getattr(t.transform.rotation, k) for k in "xyzw"]]
    for t in message.transforms
]))
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("package")
    write_robot(folder, Rig(), "classic")
    write_ros_package(folder, inclined_park(), Rig(), "classic")
    return folder


@pytest.fixture(scope="module")
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Environment of a roscore of our own."""
    home = tmp_path_factory.mktemp("ros")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("ROS", "PYTHON"))}
    environment |= {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_HOSTNAME": "127.0.0.1",
        "ROS_LOG_DIR": str(home),
        "HOME": str(home),
        "PATH": "/usr/bin:/bin",
    }
    core = subprocess.Popen(["roscore", "-p", str(port)], env=environment, stdout=subprocess.DEVNULL)
    try:
        listed = ["rosparam", "list"]
        for _ in range(100):
            if subprocess.run(listed, env=environment, capture_output=True, check=False).returncode == 0:
                break
            time.sleep(0.2)
        yield environment
    finally:
        core.terminate()
        core.wait(30)


def run_python(code: str, environment: dict[str, str], *arguments: str) -> str:
    command = [PYTHON, "-c", code, *arguments]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=60)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_the_waypoint_node_drives(package: Path, ros: dict[str, str]) -> None:
    experiment = load_experiment("park_1")
    route = geodetic_route(experiment.route)
    fixes = [route.start, (49.899766, 8.900077), (49.8999, 8.90003), route.waypoints[-1]]
    script, config = package / "scripts/waypoints.py", package / "config/park_1.yaml"
    node = subprocess.Popen([script, config], env=ros, stdout=subprocess.DEVNULL)
    try:
        found = json.loads(run_python(FEED, ros, json.dumps(fixes)))
    finally:
        node.terminate()
        node.wait(30)
    follower = WaypointFollower(route.waypoints, experiment.control)
    expected = []
    for latitude, longitude in fixes:
        follower.update_fix(latitude, longitude)
        expected.append(follower.command(0.0))  # imu_link's x is up when the robot heads north
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


@pytest.mark.skipif(not PUBLISHER.exists(), reason="needs Debian's ros-robot-state-publisher")
def test_robot_state_publisher_publishes_our_frames(package: Path, ros: dict[str, str]) -> None:
    urdf = package / "urdf/husky.urdf"
    subprocess.run(["rosparam", "set", "robot_description", "-t", urdf], env=ros, check=True)
    node = subprocess.Popen([PUBLISHER], env=ros, stderr=subprocess.DEVNULL)
    try:
        found = json.loads(run_python(FRAMES, ros))
    finally:
        node.terminate()
        node.wait(30)
    expected = {pair: value for pair, value in rig_transforms(Rig()).items() if not pair[1].endswith("wheel")}
    assert {(parent, child) for parent, child, *_ in found} == set(expected)
    for parent, child, xyz, xyzw in found:
        transform = pose_from_quaternion_wxyz(xyz, wxyz_from_xyzw(xyzw))
        np.testing.assert_allclose(transform, expected[parent, child], rtol=0, atol=1e-9)


def test_roslaunch_reads_the_launch_files(package: Path, ros: dict[str, str], tmp_path: Path) -> None:
    """With a stand-in for gazebo_ros, which Debian does not have."""
    stand_in = tmp_path / "gazebo_ros"
    (stand_in / "launch").mkdir(parents=True)
    (stand_in / "package.xml").write_text("<package><name>gazebo_ros</name></package>")
    (stand_in / "launch/empty_world.launch").write_text(
        '<launch><arg name="world_name"/><arg name="gui"/><arg name="use_sim_time"/>'
        '<node name="gazebo" pkg="gazebo_ros" type="gzserver" args="$(arg world_name)"/></launch>'
    )
    xacro = shutil.which("xacro")
    assert xacro is not None
    # xacro's first line names the Python that it belongs to.
    path = os.pathsep.join((str(Path(xacro).parent), "/usr/bin", "/bin"))
    environment = ros | {"ROS_PACKAGE_PATH": f"{package}:{tmp_path}", "PATH": path}
    file = str(package / "launch/park_2.launch")
    parsed = json.loads(run_python(LAUNCH, environment, file, "plain:=true", "record:=/tmp/park.bag"))
    assert parsed["errors"] == []
    nodes = parsed["nodes"]
    assert nodes["gazebo"][2].endswith("worlds/park_plain.world")
    assert Path(nodes["waypoints"][2]).resolve() == (package / "config/park_2.yaml").resolve()
    assert nodes["record"][:2] == ["fieldtruth_gazebo", "record.sh"]
    assert "tag/img_raw" in parsed["description"]
    assert "rviz" not in nodes
    parsed = json.loads(run_python(LAUNCH, environment, file, "drive:=false"))
    assert parsed["nodes"]["gazebo"][2].endswith("worlds/park.world")
    assert {"waypoints", "record"}.isdisjoint(parsed["nodes"])

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A node of ROS 1 with a real master: heard by rosbag and rostopic, driven by rospy. Runs where Debian has them."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from live_runs import wait_for
from rosbags.rosbag1 import Reader
from small_park import in_small_park

from fieldtruth.bag.messages import STORE
from fieldtruth.experiment.files import dump_experiment

PYTHON, PACKAGES = "/usr/bin/python3", "/usr/lib/python3/dist-packages"
LIVE = f"""
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs inherit that it is ignored
sys.path.append({PACKAGES!r})  # behind our own
from fieldtruth.cli import main
sys.exit(main(sys.argv[1:]))
"""
DRIVE = """
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

rospy.init_node("driver")
speeds, clock = [], []
rospy.Subscriber("/ground_truth/odom", Odometry, lambda m: speeds.append(m.twist.twist.linear.x))
publisher = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
twist = Twist()
twist.linear.x = -0.6
rate = rospy.Rate(20)
while not (speeds and speeds[-1] < -0.5):
    publisher.publish(twist)
    rate.sleep()
print("driven", rospy.get_time() > 0.1)
rospy.wait_for_service("/fieldtruth/pause")
print(rospy.ServiceProxy("/fieldtruth/pause", SetBool)(True).message)
step = rospy.Publisher("/fieldtruth/step", Float64, queue_size=1, latch=True)
step.publish(0.04)
print(rospy.ServiceProxy("/fieldtruth/reset", Trigger)().message)
print(rospy.ServiceProxy("/fieldtruth/pause", SetBool)(False).success)
"""


def missing() -> str:
    """What these tests lack, empty if nothing."""
    if absent := [name for name in ("roscore", "rostopic", "rosbag") if shutil.which(name) is None]:
        return f"needs {', '.join(absent)}"
    names = "rospy, std_srvs.srv, nav_msgs.msg, sensor_msgs.msg"
    found = subprocess.run([PYTHON, "-c", f"import {names}"], capture_output=True, check=False).returncode == 0
    if not found or not Path(PACKAGES, "rospy").exists():
        return f"needs Debian's packages of {names}"
    code = f"import sys; sys.path.append({PACKAGES!r}); import rospy"
    own = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    return "" if own.returncode == 0 else "Debian's rospy is for another Python"


pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing() or "-")]


@contextmanager
def started(command: list[str], log: Path, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    """Start a program in a session of its own, which ends with the context."""
    with log.open("wb") as out:
        process = subprocess.Popen(
            command, stdout=out, stderr=out, env={**os.environ, **environment}, start_new_session=True
        )
    try:
        yield process
    finally:
        with_children = os.getpgid(process.pid) if process.poll() is None else None
        if with_children is not None:
            os.killpg(with_children, signal.SIGINT)
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                os.killpg(with_children, signal.SIGKILL)


@pytest.fixture
def _master(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
    monkeypatch.setenv("ROS_IP", "127.0.0.1")
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros"))
    with started(["roscore", "-p", str(port)], tmp_path / "roscore.log"):
        wait_for(lambda: "started core service" in (tmp_path / "roscore.log").read_text(), 60.0)
        yield


@pytest.mark.usefixtures("_master")
def test_ros_hears_records_and_drives(tmp_path: Path) -> None:
    file, log = tmp_path / "small.yaml", tmp_path / "live.log"
    file.write_text(dump_experiment(in_small_park(rig={"lidar": {"columns": 64, "rings": 16}})))
    command = [sys.executable, "-c", LIVE, "live", str(file), "--ros1", "--no-cameras"]
    with started(command, log) as live:
        wait_for(lambda: "simulated" in log.read_text(), 300.0)
        bag = tmp_path / "heard.bag"
        topics = ["/os1_cloud_node/points", "/tf_static", "/imu/data", "/clock"]
        with started(["rosbag", "record", "-O", str(bag), *topics], tmp_path / "record.log"):
            time.sleep(5.0)
        hz = ["rostopic", "hz", "--wall-time", "-w", "30", "/imu/data"]
        with started(hz, tmp_path / "hz.log"):
            wait_for(lambda: "average rate" in (tmp_path / "hz.log").read_text())
        with started(["rostopic", "pub", "-r", "20", "/cmd_vel", "std_msgs/Bool", "true"], tmp_path / "pub.log"):
            wait_for(lambda: "must be geometry_msgs/msg/Twist or" in log.read_text())
        driven = subprocess.run([PYTHON, "-c", DRIVE], capture_output=True, text=True, check=True, timeout=60)
        lines = driven.stdout.splitlines()
        assert lines[0] == "driven True"
        assert lines[1].startswith("paused at ")
        assert lines[2:] == ["reset, seed 0", "True"]
        live.send_signal(signal.SIGINT)
        assert live.wait(20.0) == 0
    text = log.read_text().splitlines()
    assert text[0].startswith("small at node /fieldtruth on 127.0.0.1 of the ROS master http://127.0.0.1:")
    assert text[-1].startswith("ended: ")
    rate = float((tmp_path / "hz.log").read_text().split("average rate: ")[1].split()[0])
    assert 20.0 < rate < 60.0  # 50 Hz, where the machine has nothing else to do
    with Reader(bag) as reader:
        found = {c.topic: (c.msgtype, c.digest, c.msgcount) for c in reader.connections}
        clouds = [(stamp, data) for c, stamp, data in reader.messages() if c.topic == topics[0]]
    assert found.keys() == set(topics)
    assert found["/tf_static"][2] == 1
    assert found[topics[0]][1] == "1158d486dd51d683ce2f1be655c3c181"  # ROS's own sum of sensor_msgs/PointCloud2
    for _, data in clouds:
        STORE.deserialize_ros1(data, "sensor_msgs/msg/PointCloud2")
    assert len(clouds) > 5


def test_without_a_master_it_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "small.yaml"
    file.write_text(dump_experiment(in_small_park()))
    environment = {**os.environ, "ROS_MASTER_URI": "http://127.0.0.1:9"}
    command = [sys.executable, "-c", LIVE, "live", str(file), "--ros1", "--no-cameras"]
    found = subprocess.run(command, capture_output=True, text=True, env=environment, check=False, timeout=60)
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr == (
        "error: no ROS master answers at http://127.0.0.1:9; start roscore, or set ROS_MASTER_URI\n"
    )

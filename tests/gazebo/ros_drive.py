# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drives in Gazebo 11 with ROS 1, recorded to a bag by ``rosbag record``.

The robot is the exported URDF, as a launch file would spawn it; its plugins of gazebo_ros, which the chroot's
distribution lacks, are replaced by ``ros_plugin/``, which reads their parameters.
"""

import os
import re
import signal
import socket
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import yaml
from gazebo_run import CHROOT, GazeboError, in_chroot, missing_chroot

STEPS_PER_SECOND: Final = "400"
"""Steps of the physics per second of wall time: at 1000, rosbag's queues overflow on a busy machine."""


def add_robot(world: Path, out: Path, config: Path) -> Path:
    """Write a copy of a package's world file, beside it, with the robot where a launch file with ``config`` spawns it.

    Gazebo itself makes SDF of the URDF, as for a launch file. The robot has no cameras, which need a display.
    """
    package = world.parent.parent
    robot = ET.parse(package / "urdf" / "husky.urdf")
    for extension in robot.getroot().findall("gazebo"):
        for sensor in extension.findall("sensor[@type='camera']"):
            extension.remove(sensor)
    model = package / "models" / "husky_ros"
    model.mkdir(exist_ok=True)
    robot.write(model / "husky.urdf")
    (model / "model.config").write_text("<model><name>husky</name><sdf version='1.7'>husky.urdf</sdf></model>")
    tree = ET.parse(world)
    element = tree.getroot().find("world")
    assert element is not None
    include = ET.SubElement(element, "include")
    start = yaml.safe_load(config.read_text())["start"]
    pose = " ".join(repr(start[name]) for name in ("x", "y", "z", "roll", "pitch", "yaw"))
    for name, value in (("uri", "model://husky_ros"), ("name", "husky"), ("pose", pose)):
        ET.SubElement(include, name).text = value
    rate = element.find("physics/real_time_update_rate")
    assert rate is not None
    rate.text = STEPS_PER_SECOND
    tree.write(out)
    return out


def missing_ros() -> str:
    """Why no drive can run here, in one line; empty if it can."""
    if why := missing_chroot():
        return why
    if not (CHROOT / "opt/ros_plugin/build/libgazebo_to_ros.so").exists():
        return f"no ROS 1 in {CHROOT}: run tests/gazebo/make_chroot.sh again"
    return ""


@dataclass(frozen=True, kw_only=True)
class RosDrive:
    """A drive's bag, its simulated time [s], and its path [m] at 10 Hz."""

    bag: Path
    seconds: float
    metres: float


def drive_with_ros(
    world: Path,
    folder: Path,
    config: Path,
    *,
    metres: float,
    seconds: float,
    limit_s: float,
    clouds: str = "",
) -> RosDrive:
    """Drive the robot of a world file along the waypoints of ``config``, a file of the package's own folder config.

    The drive ends after ``metres``, or ``seconds`` of simulated time. ``folder``, for the results, must be new;
    ``clouds`` is first:last:period [s], the stamps of clouds.
    """
    folder.mkdir(parents=True)
    package = world.parent.parent
    settings = {
        "RESULTS": str(folder),
        "DRIVE_METRES": str(metres),
        "DRIVE_SECONDS": str(seconds),
        "CLOUDS": clouds,
        "ROS_MASTER_URI": f"http://127.0.0.1:{_free_port()}",
        "GAZEBO_MASTER_URI": f"http://127.0.0.1:{_free_port()}",
        "GAZEBO_IP": "127.0.0.1",
        "GAZEBO_MODEL_DATABASE_URI": "",  # never asks the network
        "GAZEBO_MODEL_PATH": str(package / "models"),
        "GAZEBO_RESOURCE_PATH": "/usr/share/gazebo-11",
        "GAZEBO_PLUGIN_PATH": "/usr/lib/x86_64-linux-gnu/gazebo-11/plugins",
    }
    script = Path(__file__).with_name("drive_with_ros.sh")
    variables = [f"{name}={value}" for name, value in settings.items()]
    command = in_chroot(
        *("env", *variables, "bash", str(script), str(world), str(config)), folders=[package, folder, script.parent]
    )
    process = subprocess.Popen(command, env=_environment(), start_new_session=True)
    try:
        process.wait(limit_s)
    except subprocess.TimeoutExpired:
        raise GazeboError(f"the drive has not ended in {limit_s} s; the outputs are in {folder}") from None
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)  # the namespace's processes end with it
            process.wait()
    log = (folder / "gazebo.log").read_text(errors="replace")
    if (found := re.search(r"drive ends: ([\d.]+) s, path ([\d.]+) m", log)) is None:
        raise GazeboError(f"Gazebo has crashed; the outputs are in {folder}")
    return RosDrive(bag=folder / "drive.bag", seconds=float(found[1]), metres=float(found[2]))


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    return port


def _environment() -> dict[str, str]:
    return {**os.environ, "GZ_CHROOT": str(CHROOT)}

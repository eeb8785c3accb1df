# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot with the sensors of a rig: models for Gazebo and a description for ROS, written from our own numbers."""

from pathlib import Path
from typing import Any, Final, Literal

from fieldtruth.bag import topics
from fieldtruth.core import geodesy
from fieldtruth.core.readings import Fix, Inertial, WheelSpeeds
from fieldtruth.drive.physics import FRICTION, skid_compensation
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import WHEELS
from fieldtruth.experiment.sensor_families import ImagingConfig, ScanningConfig
from fieldtruth.gazebo.robot import parts
from fieldtruth.gazebo.templates import render, write

Flavour = Literal["classic", "gz"]
"""Gazebo 11 with ROS 1, or the newer Gazebo (gz sim) with ROS 2."""

ARGUMENTS: Final = {"lidar": True, "cameras": True, "plain": False}
"""Arguments of husky.urdf.xacro with their defaults; ``plain`` publishes the images as tag images."""


def write_robot(folder: Path, rig: Rig, flavour: Flavour) -> None:
    """Write the robot into ``folder``, the root of a package of one flavour.

    - ``models/husky/model.sdf`` and ``model.config``: the model for Gazebo without ROS (classic), or for the newer
      Gazebo (gz). Gazebo 11 drives it by messages of type ``gazebo.msgs.Pose`` on ``~/husky/vel_cmd``: x is the speed
      [m/s], the yaw of the orientation the turn rate [rad/s], positive to the left. There the attitude of the IMU is
      relative to that at the start, and the wheels' radius is half the edge of their bounding box, by which the robot
      is up to 4 % slower when it starts at a few degrees from an axis of the world; with ROS neither is so.
    - ``urdf/husky.urdf.xacro`` and ``urdf/husky.urdf``, which is the same with the default arguments: the description
      for ROS, with the plugins of gazebo_ros. The newer Gazebo uses its frames only.

    Raises:
        ConfigurationError: a sensor that Gazebo does not have, see ``parts.check_rig``.
    """
    parts.check_rig(rig)
    values = _values(rig)
    sdf = render("robot", "husky.sdf.jinja", flavour=flavour, **values)
    version = "1.9" if flavour == "gz" else "1.7"
    words = {"robot": values["robot"], "sensors": _sensors(rig)}
    config = render("robot", "model.config.xml.jinja", version=version, **words)
    write(folder / "models" / "husky" / "model.sdf", sdf)
    write(folder / "models" / "husky" / "model.config", config)
    for name, xacro in (("husky.urdf.xacro", True), ("husky.urdf", False)):
        write(folder / "urdf" / name, render("robot", "husky.urdf.jinja", xacro=xacro, **values))


def _sensors(rig: Rig) -> str:
    """Name the kinds of sensors of a rig: ``LiDAR, stereo camera and IMU``."""
    cameras = sorted(rig.enabled(ImagingConfig), key=lambda camera: -len(camera.imagers()))
    found = (*rig.enabled(ScanningConfig), *cameras, *rig.giving(Inertial), *rig.giving(Fix))
    *rest, last = dict.fromkeys(sensor.noun for sensor in found) or ["none"]
    return f"{', '.join(rest)} and {last}" if rest else last


def _values(rig: Rig) -> dict[str, Any]:
    mounts = rig.mounts()
    track = 2 * rig.wheels.half_track * skid_compensation(rig.wheels)
    return {
        "rig": rig,
        "robot": parts.robot_words(rig.robot),
        "topics": topics,
        "geodesy": geodesy,
        "parts": parts,
        "friction": FRICTION,
        "defaults": ARGUMENTS,
        "frames": parts.fixed_frames(rig),
        "scanners": rig.enabled(ScanningConfig),
        "imus": rig.giving(Inertial),
        "receivers": rig.giving(Fix),
        "antennas": {receiver.frame for receiver in rig.giving(Fix)},
        "shapes": parts.body_shapes(rig),
        "tread": parts.wheel_shape(rig),
        "near": parts.NEAR,
        "yellow": parts.YELLOW,
        "black": parts.BLACK,
        "wheels": {wheel: mounts[f"{wheel}_wheel"].xyz for wheel in WHEELS},
        "tachometer_rate": rig.rate_of(WheelSpeeds) or Rig().rate_of(WheelSpeeds),
        "chassis_mass": rig.robot.chassis_mass,
        "inertia": parts.chassis_inertia(rig.robot),
        "track": track,
        "anchor": track / 2 - rig.wheels.half_track,
        "wheel_inertia": parts.wheel_inertia(rig.robot),
    }

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The Husky with the sensors of a rig: models for Gazebo and a description for ROS, written from our own numbers."""

from pathlib import Path
from typing import Any, Final, Literal

from fieldtruth.bag import topics
from fieldtruth.core import geodesy
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.physics import FRICTION
from fieldtruth.drive.robot import skid_compensation
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.topic import WHEELS
from fieldtruth.gazebo.robot import contact, parts
from fieldtruth.gazebo.templates import render, write
from fieldtruth.sense.pinhole import pinhole

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
        ConfigurationError: a robot without four driven wheels.
    """
    if rig.robot.drive != "skid_steer":
        raise ConfigurationError("rig.robot.drive must be skid_steer: the models for Gazebo have four driven wheels")
    values = _values(rig)
    sdf = render("robot", "husky.sdf.jinja", flavour=flavour, **values)
    config = render("robot", "model.config.xml.jinja", version="1.9" if flavour == "gz" else "1.7")
    write(folder / "models" / "husky" / "model.sdf", sdf)
    write(folder / "models" / "husky" / "model.config", config)
    for name, xacro in (("husky.urdf.xacro", True), ("husky.urdf", False)):
        write(folder / "urdf" / name, render("robot", "husky.urdf.jinja", xacro=xacro, **values))


def _values(rig: Rig) -> dict[str, Any]:
    mounts, cameras = rig.mounts(), {"left": rig.stereo.left, "right": rig.stereo.right}
    chassis_mass = rig.robot.mass - 4 * rig.wheels.mass
    track = 2 * rig.wheels.half_track * skid_compensation(rig.wheels)
    return {
        "rig": rig,
        "topics": topics,
        "geodesy": geodesy,
        "contact": contact,
        "friction": FRICTION,
        "defaults": ARGUMENTS,
        "frames": parts.fixed_frames(rig),
        "shapes": parts.body_shapes(rig),
        "tread": parts.wheel_shape(rig),
        "wheels": {wheel: mounts[f"{wheel}_wheel"].xyz for wheel in WHEELS},
        "chassis_mass": chassis_mass,
        "inertia": parts.chassis_inertia(rig.robot, chassis_mass),
        "gnss_mass": parts.GNSS_MASS,
        "gnss_inertia": parts.GNSS_INERTIA,
        "yellow": parts.YELLOW,
        "black": parts.BLACK,
        "track": track,
        "anchor": track / 2 - rig.wheels.half_track,
        "wheel_inertia": parts.wheel_inertia(rig.robot),
        "angles": parts.scan_angles(rig.lidar),
        "pinhole": pinhole(rig.stereo),
        "lidar_pose": parts.mount_pose(rig.lidar.mount),
        "imu_pose": parts.mount_pose(rig.imu.mount),
        "gnss_pose": parts.mount_pose(rig.gnss.mount),
        "cameras": {side: parts.camera_pose(mount) for side, mount in cameras.items()},
    }

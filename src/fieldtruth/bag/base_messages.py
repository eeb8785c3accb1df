# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames and joints of a robot with wheels, and the commands that it gets."""

from typing import Final

import numpy as np

from fieldtruth.bag import types as ros
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Commands
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.topic import BASE as BASE
from fieldtruth.experiment.topic import ODOM as ODOM
from fieldtruth.experiment.topic import WHEELS

WHEEL_FRAMES: Final = tuple(f"{wheel}_wheel" for wheel in WHEELS)
JOINTS: Final = tuple(f"{wheel}_wheel_joint" for wheel in WHEELS)
"""Names of the wheels' joints, as in the URDF of ``fieldtruth gazebo``; a differential robot has the first two."""


def command(k: int, commands: Commands) -> bytes:
    """Serialise geometry_msgs/Twist: forward speed [m/s] and turn rate [rad/s] in base_link; it has no header."""
    speed, turn_rate = map(float, commands.command[k])
    message = ros.Twist(ros.Vector3(speed, 0.0, 0.0), ros.Vector3(0.0, 0.0, turn_rate))
    return ros.serialize(message, "geometry_msgs/msg/Twist")


def wheel_transforms(rig: Rig, angles: Array) -> dict[str, Array]:
    """Return base_from_wheel (4, 4) by frame for the angles (n,) [rad] of the wheels about their axles."""
    mounts = rig.mounts()
    return {
        name: mounts[name].base_from_sensor @ transforms.pose((0.0, 0.0, 0.0), (0.0, float(np.rad2deg(angle)), 0.0))
        for name, angle in zip(WHEEL_FRAMES[: len(angles)], angles, strict=True)
    }

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of wheel encoders and of the driver that integrates them: Float32, JointState and Odometry."""

import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fieldtruth.bag import messages as ros
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Joints, Odometry
from fieldtruth.core.transforms import xyzw_from_wxyz

Covariances = tuple[Array, Array]
VARIANCES: Final = (0.001, 0.001, 0.001, 0.001, 0.001, 0.03)
"""Of x, y, z [m^2], roll, pitch, yaw [rad^2], and of their rates: those that a Husky's driver states (husky_control,
control.yaml). They are constants, although the error of dead reckoning grows."""


def wheel_speeds(speeds: Array) -> list[bytes]:
    """Serialise std_msgs/Float32 (..., wheels) [rad/s]; it has no header, so its stamp is that in the bag."""
    return ros.serialized(speeds.size, speeds.astype("<f4"))


@dataclass(frozen=True, kw_only=True, eq=False)
class WheelReading(Odometry):
    """Wheel odometry with the covariances (36,) of pose and twist that are added to those of the driver."""

    covariances: Covariances | None = None


def joint_states(k: Any, joints: Joints) -> list[bytes]:
    """Serialise sensor_msgs/JointState: angle [rad] and speed [rad/s] of each wheel, positive forwards; no torques."""
    count = struct.pack("<L", len(joints.names))
    return ros.serialized(
        np.size(k),
        *ros.header_fields(k, joints.header_ns, joints.frame),
        count + b"".join(map(ros.text_field, joints.names)),
        count,
        joints.angle,
        count,
        joints.speed,
        bytes(4),
    )


def wheel_odometry(k: Any, reading: WheelReading) -> list[bytes]:
    """Serialise nav_msgs/Odometry: the pose of base_link in odom, the twist in base_link; both are planar.

    Covariances of the reading are added to those of the driver, which stand for slip.
    """
    driver, added = np.diag(VARIANCES).ravel(), reading.covariances
    of_pose, of_twist = [driver.tobytes()] * 2 if added is None else (driver + each for each in added)
    return ros.serialized(
        np.size(k),
        *ros.header_fields(k, reading.header_ns, reading.frame),
        ros.text_field(reading.child),
        reading.position,
        xyzw_from_wxyz(reading.quaternion_wxyz),
        of_pose,
        reading.linear_velocity,
        reading.angular_velocity,
        of_twist,
    )

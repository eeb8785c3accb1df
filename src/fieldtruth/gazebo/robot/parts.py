# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames, masses and shapes of the robot for Gazebo, from the rig and the constants of the physics.

The robot must not be seen by its own sensors, as in our images and clouds. Nothing is drawn in front of a camera or
above the lowest beam outside the LiDAR's own housing, nothing casts a shadow, and the mast that obstacles touch ends
below the beams: so it holds for cameras that look ahead and beams that pass over the chassis, as those of the paper do.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive import robot
from fieldtruth.experiment.camera_config import CAMERA_FROM_OPTICAL, OPTICAL
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.lidar_config import LidarConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.experiment.topic import WHEELS

GNSS_MASS: Final = 0.001  # [kg]; a link of its own in ROS 1, whose GNSS plugin reads a link's position
GNSS_INERTIA: Final = 1e-6  # [kg m^2]

# Housings that are drawn: data sheets of the OS1 and the ZED-2; an antenna of usual size.
_OS1: Final = (0.0425, 0.0735)  # [m] radius, height
_ZED2: Final = (0.033, 0.175, 0.030)  # [m] along x, y, z
_ANTENNA: Final = (0.045, 0.02)  # [m] radius, height
_POLE: Final = 0.015  # [m] radius
_EVEN: Final = 1e-6  # [deg] of which the steps between beams may differ

YELLOW: Final = (0.8, 0.6, 0.05)
BLACK: Final = (0.12, 0.12, 0.12)


class Frame(NamedTuple):
    """A fixed frame: position [m] and roll, pitch, yaw [rad] in its parent."""

    name: str
    parent: str
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]


class Shape(NamedTuple):
    """A box (size along x, y, z) or a cylinder (radius, length along z) [m] in its link, rolled by ``roll`` [rad]."""

    name: str
    size: tuple[float, ...]
    xyz: tuple[float, float, float]
    colour: tuple[float, float, float] = BLACK
    roll: float = 0.0
    drawn: bool = True
    solid: bool = False

    @property
    def is_box(self) -> bool:
        """Whether it is a box."""
        return len(self.size) == 3


class Scan(NamedTuple):
    """Angles of a scanner [rad], both ends included: azimuth positive to the left, elevation positive upwards."""

    min_azimuth: float
    max_azimuth: float
    min_elevation: float
    max_elevation: float


def fixed_frames(rig: Rig) -> tuple[Frame, ...]:
    """Return the frames of the paper's Table 2 that do not turn, and the cameras' optical frames."""
    turning = {f"{wheel}_wheel" for wheel in WHEELS}
    table = [_frame(name, "base_link", mount) for name, mount in rig.mounts().items() if name not in turning]
    optical = Rotation.from_matrix(CAMERA_FROM_OPTICAL[:3, :3]).as_euler("xyz").tolist()
    sides = ("right", "left")
    return (*table, *(Frame(f"{s}_camera_optical", f"{s}_camera", (0.0, 0.0, 0.0), tuple(optical)) for s in sides))


def camera_pose(mount: Mount) -> tuple[float, ...]:
    """Pose in base_link (x, y, z [m], roll, pitch, yaw [rad]) of a camera whose x axis looks ahead, as Gazebo's do."""
    base_from_body = mount.base_from_sensor @ CAMERA_FROM_OPTICAL @ frames.inverse(OPTICAL)
    return (*mount.xyz, *np.round(Rotation.from_matrix(base_from_body[:3, :3]).as_euler("xyz"), 15).tolist())


def mount_pose(mount: Mount) -> tuple[float, ...]:
    """Pose of a mount in base_link: x, y, z [m], roll, pitch, yaw [rad]."""
    return (*mount.xyz, *np.radians(mount.rpy_deg).tolist())


def scan_angles(config: LidarConfig) -> Scan:
    """Return the angles of our rays, in Gazebo's order: from right to left, from the lowest ring to the highest.

    Gazebo's ray i of n has the angle min + i (max - min) / (n - 1). Its column i is our ``(n // 2 - i) % n``, because
    ours begin ahead and advance clockwise; its ring j is our ``rings - 1 - j``, or j where our ring 0 is the lowest.
    Its rays all leave at once: ``spinning`` and ``firing_offsets_ns`` have no counterpart.

    Raises:
        ConfigurationError: beams that are uneven or leave their column.
    """
    step = 2 * math.pi / config.columns
    first = -(config.columns // 2) * step
    half = math.radians(config.vertical_fov_deg) / 2 if config.rings > 1 else 0.0
    low, high = -half, half
    if config.elevations_deg is not None:
        low, high = math.radians(min(config.elevations_deg)), math.radians(max(config.elevations_deg))
    if config.enabled:
        _check_even(config)
    return Scan(first, first + (config.columns - 1) * step, low, high)


def _check_even(config: LidarConfig) -> None:
    steps = np.diff(config.elevations_deg or ())
    uneven = steps.size > 0 and np.ptp(steps) > _EVEN
    if uneven or any(config.azimuth_offsets_deg or ()):
        raise ConfigurationError(
            f"rig.lidar.{'elevations_deg' if uneven else 'azimuth_offsets_deg'}: the beams of Gazebo's scanner are "
            "even and straight above each other; give a LiDAR with such beams, or rig.lidar.enabled: false"
        )


def wheel_inertia(figures: RobotConfig) -> Array:
    """Principal moments (3,) [kg m^2] of a wheel; the motor's rotor turns with it about the axle.

    SDF allows no moment above the sum of the others, so those across the axle are larger than the wheel's.
    """
    axle = figures.wheels.inertia[1] + robot.ROTOR_INERTIA * robot.servo_scale(figures)
    across = max(figures.wheels.inertia[0], axle / 2)
    return np.array([across, axle, across])


def chassis_inertia(figures: RobotConfig, mass: float) -> Array:
    """Principal moments (3,) [kg m^2] of a chassis of this mass [kg], less what ``wheel_inertia`` adds."""
    inertia = np.array(figures.chassis_inertia) * (mass / figures.chassis_inertia_mass)
    return inertia - 4 * (wheel_inertia(figures) - figures.wheels.inertia) * (1.0, 0.0, 1.0)


def body_shapes(rig: Rig) -> tuple[Shape, ...]:
    """Shapes of base_link: chassis and mast are solid, the housings of the sensors are only drawn."""
    boxes = robot.body_boxes(rig)
    chassis = boxes["chassis"]
    top = float(chassis.size[2])
    x, y, z = rig.lidar.mount.xyz
    low = min(z, rig.stereo.left.xyz[2]) - _OS1[1] / 2
    (cx, _, cz), middle = rig.stereo.left.xyz, (rig.stereo.left.xyz[1] + rig.stereo.right.xyz[1]) / 2
    gx, gy, gz = rig.gnss.mount.xyz
    drawn = [
        Shape("pole", (_POLE, low - top), (x, y, (low + top) / 2)) if low > top else None,
        Shape("os1", _OS1, (x, y, z)) if rig.lidar.enabled else None,
        Shape("zed2", _ZED2, (cx - _ZED2[0] / 2, middle, cz)) if rig.stereo.enabled else None,
        Shape("antenna", _ANTENNA, (gx, gy, gz)),
    ]
    shapes = [Shape("chassis", tuple(chassis.size.tolist()), _xyz(chassis.centre), YELLOW, solid=True)]
    if "mast" in boxes and (mast := _mast(rig, boxes["mast"], top)):
        shapes.append(mast)
    return (*shapes, *(shape for shape in drawn if shape))


def wheel_shape(rig: Rig) -> Shape:
    """Return the cylinder of a wheel, whose axis is y."""
    size = (rig.wheels.radius, round(rig.wheels.width, 9))
    return Shape("tread", size, (0.0, 0.0, 0.0), roll=math.pi / 2, solid=True)


def _mast(rig: Rig, box: robot.Box, bottom: float) -> Shape | None:
    """Return the mast of the physics, cut off below the LiDAR's beams, which Gazebo would otherwise let it meet."""
    low, high = box.centre - box.size / 2, box.centre + box.size / 2
    if rig.lidar.enabled:
        x, y, z = rig.lidar.mount.xyz
        corner = max(math.hypot(cx - x, cy - y) for cx in (low[0], high[0]) for cy in (low[1], high[1]))
        angles = rig.lidar.elevations_deg
        below = rig.lidar.vertical_fov_deg / 2 if angles is None else max(-min(angles), 0.0)
        drop = corner * math.tan(math.radians(min(below, 89.0)))
        high[2] = min(high[2], z - drop - 0.01)
    if high[2] <= bottom:
        return None
    return Shape("mast", tuple(np.round(high - low, 9).tolist()), _xyz((high + low) / 2), drawn=False, solid=True)


def _frame(name: str, parent: str, mount: Mount) -> Frame:
    pose = mount_pose(mount)
    return Frame(name, parent, _xyz(pose[:3]), _xyz(pose[3:]))


def _xyz(values: Array | tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z

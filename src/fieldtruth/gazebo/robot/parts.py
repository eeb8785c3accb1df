# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames, poses of sensors, rays and masses of the robot for Gazebo, from the rig and the constants of the physics."""

import math
import warnings
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive import robot
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.experiment.sensor_families import OPTICAL, Imager, LensConfig
from fieldtruth.experiment.topic import WHEELS
from fieldtruth.sensors.lidar.config import LidarConfig

GNSS_MASS: Final = 0.001  # [kg]; a link of its own in ROS 1, whose GNSS plugin reads a link's position
GNSS_INERTIA: Final = 1e-6  # [kg m^2]

_EVEN: Final = 1e-6  # [deg] of which the steps between beams may differ


class Frame(NamedTuple):
    """A fixed frame: position [m] and roll, pitch, yaw [rad] in its parent."""

    name: str
    parent: str
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]


class Scan(NamedTuple):
    """Angles of a scanner [rad], both ends included: azimuth positive to the left, elevation positive upwards."""

    min_azimuth: float
    max_azimuth: float
    min_elevation: float
    max_elevation: float


def fixed_frames(rig: Rig) -> tuple[Frame, ...]:
    """Return the frames that do not turn: those in base_link (the paper's Table 2), and the cameras' optical frames."""
    turning = {f"{wheel}_wheel" for wheel in WHEELS}
    table = [_frame(name, "base_link", mount) for name, mount in rig.mounts().items() if name not in turning]
    for sensor in rig.sensors:
        for name, (parent, parent_from_optical) in reversed(sensor.optical_frames().items()):
            table.append(Frame(name, parent, (0.0, 0.0, 0.0), _xyz(_rpy(parent_from_optical))))
    return tuple(table)


def camera_pose(imager: Imager) -> tuple[float, ...]:
    """Pose in base_link (x, y, z [m], roll, pitch, yaw [rad]) of a camera whose x axis looks ahead, as Gazebo's do."""
    if np.array_equal(imager.frame_from_optical, OPTICAL):
        return mount_pose(imager.mount)
    base_from_body = imager.base_from_optical @ transforms.inverse(OPTICAL)
    return (*imager.mount.xyz, *np.round(_rpy(base_from_body), 15).tolist())


def mount_pose(mount: Mount) -> tuple[float, ...]:
    """Pose of a mount in base_link: x, y, z [m], roll, pitch, yaw [rad]."""
    return (*mount.xyz, *np.radians(mount.rpy_deg).tolist())


def scan_angles(config: LidarConfig) -> Scan:
    """Return the angles of our rays, in Gazebo's order: from right to left, from the lowest ring to the highest.

    Gazebo's ray i of n has the angle min + i (max - min) / (n - 1). Its column i is our ``(n // 2 - i) % n``, because
    ours begin ahead and advance clockwise; its ring j is our ``rings - 1 - j``, or j where our ring 0 is the lowest.
    Its rays all leave at once: ``spinning`` and ``firing_offsets_ns`` have no counterpart.
    """
    step = 2 * math.pi / config.columns
    first = -(config.columns // 2) * step
    half = math.radians(config.vertical_fov_deg) / 2 if config.rings > 1 else 0.0
    low, high = -half, half
    if config.elevations_deg is not None:
        low, high = math.radians(min(config.elevations_deg)), math.radians(max(config.elevations_deg))
    return Scan(first, first + (config.columns - 1) * step, low, high)


def cloud_topic(config: LidarConfig) -> str:
    """Topic of the LiDAR in the newer Gazebo, which adds /points to it for the cloud."""
    return config.topic.removesuffix("/points") or f"/{config.name}"


def check_rig(rig: Rig) -> None:
    """Check that Gazebo has the sensors that are enabled.

    Raises:
        ConfigurationError: beams that are uneven or leave their column; a lens other than a plain pinhole; a robot
            without four driven wheels.
    """
    if rig.robot.drive != "skid_steer":
        raise ConfigurationError("rig.robot.drive must be skid_steer: the models for Gazebo have four driven wheels")
    for lidar in rig.lidars:
        if lidar.pattern is not None:
            raise ConfigurationError(
                f"rig.sensors: {lidar.name} has the pattern {lidar.pattern}; Gazebo's scanner turns evenly; "
                "give enabled: false"
            )
        steps = np.diff(lidar.elevations_deg or ())
        uneven = steps.size > 0 and np.ptp(steps) > _EVEN
        if uneven or any(lidar.azimuth_offsets_deg or ()):
            raise ConfigurationError(
                f"rig.sensors: {lidar.name} has {'uneven elevations_deg' if uneven else 'azimuth_offsets_deg'}; the "
                "beams of Gazebo's scanner are even and straight above each other; give enabled: false"
            )
    for camera in rig.cameras:
        if camera.lens != LensConfig():
            changed = [key for key, value in LensConfig() if getattr(camera.lens, key) != value]
            own = (
                f"a lens with {', '.join(changed)}"
                if camera.lens.model == "pinhole"
                else f"the lens {camera.lens.model}"
            )
            raise ConfigurationError(
                f"rig.sensors: {camera.name} has {own}; a Gazebo package has plain pinhole cameras only; "
                "give enabled: false"
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


def _frame(name: str, parent: str, mount: Mount) -> Frame:
    pose = mount_pose(mount)
    return Frame(name, parent, _xyz(pose[:3]), _xyz(pose[3:]))


def _xyz(values: Array | tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _rpy(rotation_of: Array) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # gimbal lock: of the many pairs of roll and yaw, any one
        angles: Array = Rotation.from_matrix(rotation_of[:3, :3]).as_euler("xyz")
    return angles

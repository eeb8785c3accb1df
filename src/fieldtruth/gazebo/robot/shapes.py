# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes of the robot for Gazebo: chassis and mast, and the housings of its sensors.

The robot must not be seen by its own sensors, as in our images and clouds. A housing that another sensor would see is
not drawn, nothing casts a shadow, and the mast that obstacles touch ends below the beams of every LiDAR. So it holds
for cameras that look past chassis and wheels and beams that pass over them, as those of the paper do.
"""

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.drive.robot import Box, body_boxes
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.experiment.sensor_families import ImagingConfig
from fieldtruth.experiment.topic import WHEELS
from fieldtruth.gazebo.robot.parts import camera_pose, mount_pose, scan_angles
from fieldtruth.sensors.camera.pinhole import pinhole
from fieldtruth.sensors.camera.stereo_config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig

# Housings that are drawn: data sheets of the OS1 and the ZED-2; a camera and an antenna of usual size.
_OS1: Final = (0.0425, 0.0735)  # [m] radius, height
_ZED2: Final = (0.033, 0.055, 0.030)  # [m] along x, y (more than the baseline), z
_CAMERA: Final = (0.04, 0.04, 0.04)  # [m] along x, y, z
_ANTENNA: Final = (0.045, 0.02)  # [m] radius, height
_POLE: Final = 0.015  # [m] radius
_NAMES: Final = {"lidar": "os1", "stereo": "zed2", "gnss": "antenna"}
"""Of the housings of the paper's sensors, by the sensors' names."""

NEAR: Final = 0.1  # [m] from a camera, below which it sees nothing
YELLOW: Final = (0.8, 0.6, 0.05)
BLACK: Final = (0.12, 0.12, 0.12)


class Shape(NamedTuple):
    """A box (size along x, y, z) or a cylinder (radius, length along z) [m] in its link, turned by ``rpy`` [rad]."""

    name: str
    size: tuple[float, ...]
    xyz: tuple[float, ...]
    colour: tuple[float, float, float] = BLACK
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    drawn: bool = True
    solid: bool = False

    @property
    def is_box(self) -> bool:
        """Whether it is a box."""
        return len(self.size) == 3


def body_shapes(rig: Rig) -> tuple[Shape, ...]:
    """Shapes of base_link: chassis and mast are solid, the housings of the sensors are only drawn."""
    boxes = body_boxes(rig)
    chassis = boxes["chassis"]
    shapes = [_chassis(rig)]
    if "mast" in boxes and (mast := _mast(rig, boxes["mast"], float(chassis.size[2]))):
        shapes.append(mast)
    housings = [*_lidar_housings(rig, chassis), *_camera_housings(rig)]
    housings += [(each, _cylinder(_name(each), _ANTENNA, each.mount)) for each in rig.antennas]
    return (*shapes, *(shape for owner, shape in housings if not _observers(rig, shape, owner)))


def wheel_shape(rig: Rig) -> Shape:
    """Return the cylinder of a wheel, whose axis is y."""
    size = (rig.wheels.radius, round(rig.wheels.width, 9))
    return Shape("tread", size, (0.0, 0.0, 0.0), rpy=(math.pi / 2, 0.0, 0.0), solid=True)


def observers(rig: Rig) -> list[str]:
    """Names of the LiDARs and views that see the chassis or a wheel, which ours never do."""
    mounts, tread = rig.mounts(), wheel_shape(rig)
    wheels = [tread._replace(xyz=mounts[f"{wheel}_wheel"].xyz) for wheel in WHEELS]
    return list(dict.fromkeys(name for shape in (_chassis(rig), *wheels) for name in _observers(rig, shape)))


def _chassis(rig: Rig) -> Shape:
    box = body_boxes(rig)["chassis"]
    return Shape("chassis", tuple(box.size.tolist()), tuple(box.centre.tolist()), YELLOW, solid=True)


def _name(sensor: SensorConfig) -> str:
    return _NAMES.get(sensor.name, f"{sensor.name}_housing")


def _lidar_housings(rig: Rig, chassis: Box) -> Iterator[tuple[SensorConfig | None, Shape]]:
    """LiDARs with the poles on which they stand, which end below the cameras."""
    top = float(chassis.size[2])
    heights = [imager.mount.xyz[2] for imager in rig.imagers]
    for lidar in rig.lidars:
        x, y, z = lidar.mount.xyz
        low = min(z, *heights) - _OS1[1] / 2
        if low > top and (np.abs((x, y)) < chassis.size[:2] / 2).all():
            name = "pole" if _name(lidar) == "os1" else f"{lidar.name}_pole"
            yield None, Shape(name, (_POLE, low - top), (x, y, (low + top) / 2))
        yield lidar, _cylinder(_name(lidar), _OS1, lidar.mount)


def _camera_housings(rig: Rig) -> Iterator[tuple[SensorConfig | None, Shape]]:
    """Boxes behind the centres of the lenses."""
    for camera in rig.cameras:
        imagers = camera.imagers()
        poses = [camera_pose(imager) for imager in imagers]
        middle = np.mean([pose[:3] for pose in poses], axis=0)
        base_from_body = transforms.pose((0.0, 0.0, 0.0), np.degrees(poses[0][3:]).tolist())
        depth, width, height = _ZED2 if isinstance(camera, StereoConfig) else _CAMERA
        size = (depth, round(width + imagers[-1].baseline, 9), height)
        centre = np.round(middle - base_from_body[:3, 0] * depth / 2, 12).tolist()
        yield camera, Shape(_name(camera), size, tuple(centre), rpy=poses[0][3:])


def _cylinder(name: str, size: tuple[float, float], mount: Mount) -> Shape:
    pose = mount_pose(mount)
    return Shape(name, size, pose[:3], rpy=pose[3:])


def _observers(rig: Rig, shape: Shape, owner: SensorConfig | None = None) -> list[str]:
    """Names of the sensors other than its ``owner`` that would see a shape of base_link, by points within it."""
    extent = shape.size if shape.is_box else (2 * shape.size[0], 2 * shape.size[0], shape.size[1])
    grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 7)] * 3), axis=-1).reshape(-1, 3) * extent
    points = transforms.transform(transforms.pose(shape.xyz, np.degrees(shape.rpy).tolist()), grid)
    seen = {lidar.name: _hits(lidar, points) for lidar in rig.lidars if lidar != owner}
    seen |= {
        imager.name: _shows(imager.config, transforms.transform(transforms.inverse(imager.base_from_optical), points))
        for imager in rig.imagers
        if imager.config != owner
    }
    return [name for name, found in seen.items() if found]


def _hits(lidar: LidarConfig, points: Array) -> bool:
    x, y, z = transforms.transform(transforms.inverse(lidar.mount.base_from_sensor), points).T
    angles, elevation = scan_angles(lidar), np.arctan2(z, np.hypot(x, y))
    within = (angles.min_elevation <= elevation) & (elevation <= angles.max_elevation)
    return bool((within & (np.linalg.norm((x, y, z), axis=0) >= lidar.min_range)).any())


def _shows(camera: ImagingConfig, optical: Array) -> bool:
    lens, (u, v, depth) = pinhole(camera), optical.T
    inside = (np.abs(u) * lens.fx < depth * camera.width / 2) & (np.abs(v) * lens.fy < depth * camera.height / 2)
    return bool((inside & (depth > NEAR)).any())


def _mast(rig: Rig, box: Box, bottom: float) -> Shape | None:
    """Return the mast of the physics, cut off below the LiDARs' beams, which Gazebo would otherwise let it meet."""
    low, high = box.centre - box.size / 2, box.centre + box.size / 2
    for lidar in rig.lidars:
        x, y, z = lidar.mount.xyz
        corner = max(math.hypot(cx - x, cy - y) for cx in (low[0], high[0]) for cy in (low[1], high[1]))
        tilt = math.degrees(math.acos(np.clip(lidar.mount.base_from_sensor[2, 2], -1.0, 1.0)))
        angles = lidar.elevations_deg
        below = tilt + (lidar.vertical_fov_deg / 2 if angles is None else max(-min(angles), 0.0))
        drop = corner * math.tan(math.radians(min(below, 89.0)))
        high[2] = min(high[2], z - drop - 0.01)
    if high[2] <= bottom:
        return None
    xyz = tuple(((high + low) / 2).tolist())
    return Shape("mast", tuple(np.round(high - low, 9).tolist()), xyz, drawn=False, solid=True)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""World files with a model that carries the rig's sensors, written from the rig alone, without the exported robot.

The model has neither visuals nor collisions.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.lens import intrinsics_of
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL
from fieldtruth.sensors.lidar.config import LidarConfig

RATE_HZ = 10.0


def add_rig(world: Path, out: Path, rig: Rig, *, lidar: bool = False, camera: bool = False) -> Path:
    """Write a copy of a world file, beside it, with a model ``rig`` that floats: it is moved by ``tour``."""
    tree = ET.parse(world)
    element = tree.getroot().find("world")
    assert element is not None
    element.append(ET.fromstring(_model(rig, lidar, camera)))
    tree.write(out)
    return out


def tour(poses: Sequence[Array]) -> str:
    """Text of tour.txt: the model ``rig`` at each world_from_base pose (4, 4) in turn."""
    return "\n".join(["rig", *(_numbers(*pose[:3, 3], *_rpy(pose)) for pose in poses)])


def _model(rig: Rig, lidar: bool, camera: bool) -> str:
    # A ray sensor takes Gazebo 3 GB and 10 s to load, so that one has to make all scans.
    left = transforms.inverse(OPTICAL @ transforms.inverse(rig.stereo.left.base_from_sensor @ CAMERA_FROM_OPTICAL))
    return (
        "<model name='rig'><pose>0 0 1000 0 0 0</pose><link name='link'><gravity>false</gravity>"
        + _sensor("imu", "imu", _mount(rig.imu.mount), "")
        + _sensor("gnss", "gps", _mount(rig.gnss.mount), "")
        + lidar * _sensor("lidar", "ray", _mount(rig.lidar.mount), _ray(rig.lidar))
        + camera * _sensor("left", "camera", _numbers(*left[:3, 3], *_rpy(left)), _camera(rig))
        + "</link></model>"
    )


def _sensor(name: str, kind: str, pose: str, inside: str) -> str:
    return (
        f"<sensor name='{name}' type='{kind}'><always_on>true</always_on><update_rate>{RATE_HZ}</update_rate>"
        f"<pose>{pose}</pose>{inside}</sensor>"
    )


def _mount(mount: Mount) -> str:
    return _numbers(*mount.xyz, *np.radians(mount.rpy_deg))


def _rpy(pose: Array) -> Array:
    angles: Array = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz")
    return angles


def _numbers(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)


def _ray(lidar: LidarConfig) -> str:
    half = math.radians(lidar.vertical_fov_deg) / 2.0
    last = 2.0 * math.pi * (1.0 - 1.0 / lidar.columns)
    return (
        "<ray><scan>"
        f"<horizontal><samples>{lidar.columns}</samples><min_angle>0</min_angle><max_angle>{last!r}</max_angle></horizontal>"
        f"<vertical><samples>{lidar.rings}</samples><min_angle>{-half!r}</min_angle><max_angle>{half!r}</max_angle></vertical>"
        f"</scan><range><min>{lidar.min_range}</min><max>{lidar.max_range}</max></range></ray>"
    )


def beams(range_m: Array, lidar: LidarConfig) -> Array:
    """Reorder a scan of that sensor, (rings, columns), to our order: (columns, rings), clockwise, highest first."""
    assert range_m.shape == (lidar.rings, lidar.columns)
    return np.roll(range_m[::-1, ::-1], 1, axis=1).T


def _camera(rig: Rig) -> str:
    config, lens = rig.stereo, intrinsics_of(rig.stereo)
    # OpenGL's principal point is measured from the corner of the image, ours from the centre of the first pixel.
    return (
        f"<camera><horizontal_fov>{math.radians(config.horizontal_fov_deg)!r}</horizontal_fov>"
        f"<image><width>{config.width}</width><height>{config.height}</height><format>R8G8B8</format>"
        "</image>"
        f"<clip><near>0.1</near><far>{config.far}</far></clip>"
        f"<lens><intrinsics><fx>{lens.fx!r}</fx><fy>{lens.fy!r}</fy><cx>{lens.cx + 0.5!r}</cx>"
        f"<cy>{lens.cy + 0.5!r}</cy><s>0</s></intrinsics></lens></camera>"
    )

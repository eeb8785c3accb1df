# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground in the clouds of an ideal LiDAR: ring noise of short grass, litter, bare earth and gravel."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.core.classes import GROUND_ID
from fieldtruth.core.transforms import pose_from_quaternion_wxyz
from fieldtruth.drive.physics import resting_pose
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.world.build import load_world, reserved_corridors
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import World

F8 = NDArray[np.float64]
GRASS, EARTH = (8.0, 20.0), (2.0, 6.0)  # [mm]
CONFIG = LidarConfig(rings=64, columns=2048, vertical_fov_deg=33.2, min_range=0.8)


def ground_types(world: World, xy: F8) -> NDArray[np.str_]:
    """Ground type at positions (n, 2) where its share is above 0.7 and no trail's edge is near; empty elsewhere."""
    terrain = world.terrain
    cover, distance = terrain.cover.at(*xy.T), terrain.trail_distance.at(*xy.T)
    types = np.array([MATERIALS[n].ground_type for n in terrain.ground_materials], "U20")[cover.argmax(axis=-1)]
    types[cover.max(axis=-1) < 0.7] = ""
    types[distance < 0.15] = ""
    types[distance < -terrain.border_width - 0.05] = MATERIALS[terrain.trail_material].ground_type
    return np.asarray(types, np.str_)


def ring_noise(world: World, poses: int) -> dict[str, float]:
    """Robust deviation [m] of the second difference along rings by ground type, over sqrt 6, between 4 and 15 m."""
    lidar = IdealLidar(CONFIG, Scene(replace(world, instances=(), swarms=(), meshes={})))
    parts: dict[str, list[F8]] = {}
    for line in reserved_corridors(world.name):
        for k in np.linspace(0, len(line.points) - 1, poses + 2).astype(int)[1:-1]:
            resting = resting_pose(
                world.terrain.field, line.points[k], float(np.arctan2(*line.tangents[k, ::-1])), Rig()
            )
            pose = pose_from_quaternion_wxyz(*resting) @ CONFIG.mount.base_from_sensor
            scan = lidar.scan(pose)
            ranges, xy = np.full((2048, 64), np.nan), np.zeros((2048, 64, 2))
            ranges[scan.column, scan.ring] = np.where(scan.instance == GROUND_ID, scan.range_m, np.nan)
            xy[scan.column, scan.ring] = (scan.xyz @ pose[:3, :3].T + pose[:3, 3])[:, :2]
            second = np.roll(ranges, 1, axis=0) - 2.0 * ranges + np.roll(ranges, -1, axis=0)
            inside = (np.abs(xy) < np.array(world.size) / 2 - 0.2).all(axis=-1)
            used = np.isfinite(second) & (ranges > 4.0) & (ranges < 15.0) & inside
            types = ground_types(world, xy[used])
            for name in np.unique(types):
                parts.setdefault(str(name), []).append(second[used][types == name])
    found = {name: np.concatenate(values) for name, values in parts.items()}
    return {
        name: float(1.4826 * np.median(np.abs(v - np.median(v))) / np.sqrt(6.0))
        for name, v in found.items()
        if name and len(v) > 1500
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("environment", "bounds_mm"),
    [
        ("park", {"lawn": GRASS, "leaf_litter": (6.0, 20.0), "earth": EARTH, "gravel": (0.5, 2.0)}),
        ("lake", {"meadow": GRASS, "mud": (0.1, 2.0)}),
        ("forest", {"forest_floor": GRASS, "moss": GRASS, "trodden_earth": EARTH}),
        ("hillside", {"dry_turf": GRASS, "stony_soil": EARTH}),
    ],
)
def test_ring_noise_by_ground_type(environment: str, bounds_mm: dict[str, tuple[float, float]]) -> None:
    """A real frame in grass: 12 mm, its sensor's 3.6 mm included. Noise grows with range, so medians need the band."""
    found = ring_noise(load_world(environment), poses=30)  # medians of 5 scatter by 2 mm, of 12 by 1 mm
    for ground, (least, most) in bounds_mm.items():
        assert least < 1000.0 * found[ground] < most, (ground, found)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a sheet shows, before it is laid out: pictures, lines and counts of one environment as plain data."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.progress import Progress
from fieldtruth.drive.expected_path import expected_path, experiments_in, poses_along, standing_pose
from fieldtruth.experiment.config import LightConfig
from fieldtruth.experiment.rig import CAMERA_FROM_OPTICAL, CameraConfig, Rig
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.render.camera import Camera, CameraImages
from fieldtruth.report.drawing.aerial import Aerial, take_aerial
from fieldtruth.report.drawing.cloud import Cloud, scan_from
from fieldtruth.report.preview.viewpoints import free_stations, most_telling
from fieldtruth.report.shares import SPACING, ClassShares, count_classes
from fieldtruth.sense.scene import Scene
from fieldtruth.world.model import World

VIEWS: Final = 4
SCANS: Final = 240
"""At most so many scans make the cloud, spread evenly over the sample."""
FREE_PLACES: Final = 40
"""Size of the sample where no experiment drives."""


class Route(NamedTuple):
    """An experiment's route: way-points and line in x, y [m], the start first."""

    name: str
    waypoints: Array  # (1 + n, 2)
    path: Array  # (m, 2)


class View(NamedTuple):
    """What the left camera sees from x, y [m] with a heading [rad]."""

    station: Array  # (3,)
    picture: CameraImages


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Everything on a sheet. ``stations`` (n, 3) are the sample's places: x, y [m] and heading [rad]."""

    world: World
    routes: tuple[Route, ...]
    stations: Array
    shares: ClassShares
    aerial: Aerial
    views: tuple[View, ...]
    cloud: Cloud


def gather(
    world: World,
    *,
    aerial_width: int,
    rig: Rig | None = None,
    spacing: float = SPACING,
    workers: int,
    progress: Progress,
) -> Findings:
    """Look at a world from above, along the routes of its experiments, and from the best four places on them.

    Args:
        world: the place; its name is the environment's.
        aerial_width: pixels of the aerial photograph along x.
        rig: the sensors, by default the paper's.
        spacing: metres of way from one pose of the sample to the next.
        workers: threads.
        progress: is told what happens.
    """
    rig, experiments = Rig() if rig is None else rig, experiments_in(world.name)
    with progress.stage("prepare the scene"):
        scene = Scene(world)
        baked = bake(scene, LightConfig())
    paths = [expected_path(experiment, world) for experiment in experiments]
    routes = tuple(
        Route(experiment.name, metres_from_route(experiment.route), path[:, :2])
        for experiment, path in zip(experiments, paths, strict=True)
    )
    sample = (
        np.concatenate([poses_along(path, spacing) for path in paths])
        if paths
        else free_stations(world, FREE_PLACES, np.random.default_rng([world.seed, 3]))
    )
    poses = [standing_pose(world.terrain.field, station, rig) for station in sample]
    with progress.stage("count classes"):
        shares = count_classes(scene, rig, poses, workers=workers)
    chosen = most_telling(shares.pixels, sample[:, :2], VIEWS)
    with progress.stage("photographs"):
        aerial = take_aerial(baked, aerial_width)
        pictures = _photographs(baked, rig.cameras, [poses[row] for row in chosen])
    with progress.stage("cloud"):
        cloud = scan_from(scene, rig, poses[:: max(1, -(-len(poses) // SCANS))])
    views = tuple(View(sample[row], picture) for row, picture in zip(chosen, pictures, strict=True))
    return Findings(world=world, routes=routes, stations=sample, shares=shares, aerial=aerial, views=views, cloud=cloud)


def _photographs(baked: BakedScene, config: CameraConfig, poses: Sequence[NDArray[np.float64]]) -> list[CameraImages]:
    camera, base_from_optical = Camera(config, baked), config.left.base_from_sensor @ CAMERA_FROM_OPTICAL
    return [camera.render(pose @ base_from_optical) for pose in poses]

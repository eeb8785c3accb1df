# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Content of a preview sheet before it is laid out: viewpoints, images, routes, cloud and counts of an environment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import readings, transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.progress import Progress
from fieldtruth.core.readings import Image
from fieldtruth.drive.plan import expected_path, experiments_in, pose_on_ground, poses_along
from fieldtruth.drive.traversability import Traversability
from fieldtruth.experiment.config import metres_from_route
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.render.bake import bake
from fieldtruth.report.drawing.cloud import Cloud
from fieldtruth.report.drawing.maps import Aerial, render_aerial
from fieldtruth.report.shares import SPACING, ClassShares, count_classes
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import At, Sensor, SensorWorld, standing
from fieldtruth.sensors.known import new_sensors
from fieldtruth.world.model import World

APART: Final = 12.0
"""Preferred distance [m] between two viewpoints."""
_CLEARANCE: Final = 1.0  # [m] around the robot
_INSET: Final = 0.16  # share of the world's sides


def most_informative(pixels: Counts, positions: Array, count: int) -> list[int]:
    """Rows of the ``count`` viewpoints whose images together show most, in ascending order.

    Greedy: each step takes the viewpoint that adds most to the sum, over the classes, of the square root of their
    accumulated share. So rare classes count, and a second similar image adds little.

    Args:
        pixels: (n, classes) pixel counts of each viewpoint's image.
        positions: (n, 2) [m]; the chosen ones are ``APART`` where possible.
        count: number of rows; fewer if there are fewer viewpoints.
    """
    share = pixels / np.maximum(pixels.sum(axis=1, keepdims=True), 1)
    chosen: list[int] = []
    while len(chosen) < min(count, len(pixels)):
        gain = np.sqrt(share[chosen].sum(axis=0) + share).sum(axis=1)
        to_chosen = np.linalg.norm(positions[:, None] - positions[chosen], axis=2).min(axis=1, initial=APART)
        gain += 10.0 * to_chosen / APART
        gain[chosen] = -1.0
        chosen.append(int(np.argmax(gain)))
    return sorted(chosen)


def free_viewpoints(world: World, rig: Rig, count: int, rng: np.random.Generator) -> Array:
    """Random viewpoints (n, 3), x, y [m] and heading [rad], where the robot could stand, facing the middle.

    There are fewer than ``count`` if 200 draws for each are not enough.
    """
    sides = np.array(world.size)
    xy = rng.uniform(-0.5 + _INSET, 0.5 - _INSET, (200 * count, 2)) * sides
    xy = xy[Traversability(world, rig).clearance_at(xy) > _CLEARANCE][:count]
    target = rng.uniform(-0.2, 0.2, (len(xy), 2)) * sides
    return np.column_stack([xy, np.arctan2(target[:, 1] - xy[:, 1], target[:, 0] - xy[:, 0])])


VIEWS: Final = 4
SCANS: Final = 240
"""Maximum number of scans in the cloud, evenly spread over the sample."""
FREE_VIEWPOINTS: Final = 40
"""Size of the sample in an environment without experiments."""


class Route(NamedTuple):
    """An experiment's waypoints and expected path, x, y [m], starting with the start."""

    name: str
    waypoints: Array  # (1 + n, 2)
    path: Array  # (m, 2)


class View(NamedTuple):
    """Images of a sheet at a viewpoint: x, y [m] and heading [rad]."""

    viewpoint: Array  # (3,)
    photo: NDArray[np.uint8]
    label: NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class SheetContent:
    """Content of a sheet. ``viewpoints`` (n, 3), x, y [m] and heading [rad], are those of the class shares."""

    world: World
    routes: tuple[Route, ...]
    viewpoints: Array
    shares: ClassShares
    aerial: Aerial
    imager: Imager | None
    """The first view of the rig, that of ``views``; None for a rig without images."""
    views: tuple[View, ...]
    cloud: Cloud


def collect_content(
    world: World,
    *,
    aerial_width: int,
    rig: Rig | None = None,
    spacing: float = SPACING,
    workers: int,
    progress: Progress,
) -> SheetContent:
    """Render and scan a world from above, along the routes of its experiments, and from the four best viewpoints.

    Args:
        world: the world; its name is the environment's.
        aerial_width: of the aerial view [pixel].
        rig: the sensors; None takes the paper's.
        spacing: distance [m] along the path between viewpoints of the sample.
        workers: threads.
        progress: receives the stages of the work.
    """
    rig, experiments = Rig() if rig is None else rig, experiments_in(world.name)
    with progress.stage("prepare the scene"):
        scene = Scene(world)
        baked = bake(scene, workers=workers)
        ideal = rig.with_each(lambda each: {"signal": None, "clock": None})
        sensors = new_sensors(SensorWorld(world, ideal, baked=baked))
    paths = [expected_path(experiment, world) for experiment in experiments]
    routes = tuple(
        Route(experiment.name, metres_from_route(experiment.route), path[:, :2])
        for experiment, path in zip(experiments, paths, strict=True)
    )
    viewpoints = (
        np.concatenate([poses_along(path, spacing) for path in paths])
        if paths
        else free_viewpoints(world, rig, FREE_VIEWPOINTS, np.random.default_rng([world.seed, 3]))
    )
    poses = [pose_on_ground(world.terrain.field, viewpoint, rig) for viewpoint in viewpoints]
    with progress.stage("count classes"):
        shares = count_classes(scene, rig, poses, workers=workers)
    with progress.stage("render images"):
        aerial = render_aerial(baked, aerial_width)
        views = _views(sensors, poses, viewpoints, shares)
    with progress.stage("scan"):
        cloud = _scan(world, sensors, poses[:: max(1, -(-len(poses) // SCANS))])
    return SheetContent(
        world=world,
        routes=routes,
        viewpoints=viewpoints,
        shares=shares,
        aerial=aerial,
        imager=next(iter(rig.imagers), None),
        views=views,
        cloud=cloud,
    )


def _views(
    sensors: Mapping[str, Sensor], poses: Sequence[Array], viewpoints: Array, shares: ClassShares
) -> tuple[View, ...]:
    """Images of the first view, from where it sees most."""
    eye = next((sensor for sensor in sensors.values() if issubclass(sensor.config.gives, Image)), None)
    if eye is None:
        return ()
    output = eye.config.outputs()[0]
    rows = most_informative(shares.pixels, viewpoints[:, :2], VIEWS)
    found = (eye.read(output, At(row, 0, 0, standing(poses[row]))) for row in rows)
    return tuple(View(viewpoints[row], each.photo, each.label) for row, each in zip(rows, found, strict=True))


def _scan(world: World, sensors: Mapping[str, Sensor], poses: Sequence[Array]) -> Cloud:
    """Points inside the edges of the world, from a cloud of each sensor at each pose world_from_base (4, 4)."""
    scanners = [sensor for sensor in sensors.values() if issubclass(sensor.config.gives, readings.Cloud)]
    xyz, label = [np.zeros((0, 3))], [np.zeros(0, np.uint8)]
    for number, pose in enumerate(poses):
        for sensor in scanners:
            scan = sensor.read(sensor.config.outputs()[0], At(number, 0, 0, standing(pose)))
            points = transforms.transform(pose @ sensor.config.base_from_frames()[scan.frame], scan.xyz)
            inside = (np.abs(points[:, :2]) < np.array(world.size) / 2).all(axis=1)
            xyz.append(points[inside])
            label.append(scan.label[inside])
    return Cloud(xyz=np.concatenate(xyz), label=np.concatenate(label), scans=len(poses) * len(scanners))

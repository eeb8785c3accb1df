# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Poses of a robot that stands: separate frames on free ground, near a route, or on trails with a view along them.

Positions are free at any heading, by the map and the margin of planned routes. They are a low-discrepancy sequence
(multiples of the inverse plastic number; Roberts 2018, The unreasonable effectiveness of quasirandom sequences, quoted
from memory): any number of them is spread evenly, and fewer frames are the beginning of more.
"""

import warnings
from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import FieldtruthWarning, RouteError
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation, rotation_from_quaternion_wxyz
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.physics import resting_pose
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.routes import NODE_CLEARANCE
from fieldtruth.drive.track import Motion, Track
from fieldtruth.drive.traversability import Traversability
from fieldtruth.experiment.config import FRAME_RATE, Experiment, FramesConfig, metres_from_route
from fieldtruth.world.model import Raster, World

_PLASTIC: Final = 1.32471795724474602596  # x^3 = x + 1
_SIDE: Final = 4.0
"""[m] of a tile of the map in a large world, where frames are far from each other."""
_REACH: Final = 1.0
"""[m] from the robot's middle, or to its corners: its wheels stand within."""
_BLOCK: Final = 4096
_TRIES: Final = 20_000_000
"""Points of the sequence before a world counts as having no free ground."""
_NEAR: Final = 2.5
"""[m] around a point of a trail from which its direction follows."""
_NODES: Final = 21
"""Points along each side of that square."""
_SMOOTH: Final = 3.0
"""Standard deviation of the filter against ragged edges, in distances of these points: 0.75 m."""


def standing_robot(world: World, experiment: Experiment) -> Track:
    """Return the poses of the experiment's frames, one every 1 / ``FRAME_RATE`` seconds; velocities are 0.

    Raises:
        RouteError: no free ground, or a route that cannot be planned.
    """
    config = experiment.frames
    assert config is not None
    ground = Traversability(world, experiment.rig, side=_SIDE, clear=1.0)
    reach, rng = max(_REACH, ground.robot_radius), np.random.default_rng(config.seed)
    allowed, where = _allowed(world, experiment)
    along = config.along is not None and has_trail(world)
    if config.along is not None and not along:
        text = f"frames.along: {world.name} has no trail, so its frames are anywhere, at any heading"
        warnings.warn(text, FieldtruthWarning, stacklevel=2)

    def free(points: Array) -> Mask:
        return np.asarray((ground.clearance_at(points) >= NODE_CLEARANCE) & allowed(points))

    positions = _spread(world.size, free, config.count, rng)
    if len(positions) < config.count:
        raise RouteError(f"{world.name} (seed {world.seed}) has no free ground{where} where the robot could stand")
    random = rng.uniform(-1.0, 1.0, (config.count, 5 if along else 4))
    headings = np.pi * random[:, 0]
    if along:
        headings = trail_headings(world.terrain.trail_distance, positions) + np.pi * (random[:, 4] < 0)
        headings += np.radians(config.turn_deg) * random[:, 0]
    poses = [
        _tilted(*resting_pose(bearing_field(ground.parts.around(xy, reach)), xy, heading, experiment.rig), rest, config)
        for xy, heading, rest in zip(positions, headings.tolist(), random[:, 1:4].tolist(), strict=True)
    ]
    motion = Motion(
        stamps_ns=np.rint(np.arange(1, config.count + 1) * (1e9 / FRAME_RATE)).astype(np.int64),
        position=np.array([position for position, _ in poses]),
        quaternion_wxyz=np.array([quaternion for _, quaternion in poses]),
        linear_velocity=np.zeros((config.count, 3)),
        angular_velocity=np.zeros((config.count, 3)),
    )
    return Track(motion=motion, swept=motion, base=None, is_frames=True)


def _allowed(world: World, experiment: Experiment) -> tuple[Callable[[Array], Mask], str]:
    """Return which points (n, 2) [m] the experiment asks for, and where they are, in words."""
    config = experiment.frames
    assert config is not None
    if config.along is not None and has_trail(world):
        trail = world.terrain.trail_distance
        return lambda points: trail.at(points[:, 0], points[:, 1]) < 0, " on its trails"
    if experiment.route is None:
        return lambda points: np.ones(len(points), bool), ""
    corners = metres_from_route(plan_route(world, experiment, verify=False), world.origin)
    near = config.aside_m
    return lambda points: _distance_to_line(points, corners) <= near, f" within {near:g} m of the route"


def has_trail(world: World) -> bool:
    """Return whether the world has a trail."""
    return bool((world.terrain.trail_distance.values < 0).any())


def trail_headings(trail_distance: Raster, points: Array) -> Array:
    """Return the direction of the trail at points (n, 2) [m], (n,) [rad] from 0 to pi: either way along it.

    It is the direction in which the distance to the trail's edge changes least around a point: the second eigenvector
    of the mean of the gradient's outer product (structure tensor).
    """
    blocks = [_trail_headings(trail_distance, points[k : k + _BLOCK]) for k in range(0, len(points), _BLOCK)]
    return np.concatenate(blocks)


def _trail_headings(trail_distance: Raster, points: Array) -> Array:
    offsets = np.linspace(-_NEAR, _NEAR, _NODES)
    x, y = points[:, 0, None, None] + offsets[:, None], points[:, 1, None, None] + offsets
    smooth = gaussian_filter(trail_distance.at(x, y), _SMOOTH, axes=(1, 2))
    slope_x, slope_y = np.gradient(smooth, offsets, offsets, axis=(1, 2))
    weight = np.exp(-2.0 * (offsets[:, None] ** 2 + offsets**2) / _NEAR**2)
    xx, xy, yy = ((weight * product).sum(axis=(1, 2)) for product in (slope_x**2, slope_x * slope_y, slope_y**2))
    return np.asarray((0.5 * np.arctan2(2.0 * xy, xx - yy) + np.pi / 2) % np.pi)


def _spread(size: tuple[float, float], free: Callable[[Array], Mask], count: int, rng: np.random.Generator) -> Array:
    """Return the first ``count`` free points (n, 2) [m] of a sequence over the world; fewer if there are too few."""
    step = np.array([1 / _PLASTIC, 1 / _PLASTIC**2])
    start, found, number = rng.uniform(size=2), list[Array](), 0
    block = min(_BLOCK, 2 * count)
    for first in range(0, _TRIES, block):
        numbers = np.arange(first, first + block)[:, None]
        points = ((start + numbers * step) % 1.0 - 0.5) * size
        found.append(points[free(points)])
        number += len(found[-1])
        if number >= count:
            break
        if first >= _BLOCK and number * 1000 < first:  # less than a thousandth of the world is free
            return np.concatenate(found)
    return np.concatenate(found)[:count]


def _distance_to_line(points: Array, corners: Array) -> Array:
    """Distance [m] (n,) of points (n, 2) from the straight lines between corners (m, 2)."""
    nearest = np.full(len(points), np.inf)
    for start, end in pairwise(corners):
        along = end - start
        share = ((points - start) @ along / max(float(along @ along), 1e-12)).clip(0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(points - start - share[:, None] * along, axis=1))
    return nearest


def _tilted(position: Array, quaternion_wxyz: Array, random: list[float], config: FramesConfig) -> tuple[Array, Array]:
    """Raise and tilt a resting pose by ``random`` (-1 to 1) of pitch, roll and height."""
    pitch, roll, height = random
    tilt = Rotation.from_euler("yx", (pitch * config.pitch_deg, roll * config.roll_deg), degrees=True).as_matrix()
    turned = quaternion_wxyz_from_rotation(rotation_from_quaternion_wxyz(quaternion_wxyz) @ tilt)
    return position + np.array([0.0, 0.0, (height + 1.0) / 2 * config.raised_m]), turned

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Separate poses of a robot that stands on free ground, for frames without a drive.

Positions are free for the robot at any heading, by the map and the margin of planned routes. They are a low-discrepancy
sequence (multiples of the inverse plastic number; Roberts 2018, The unreasonable effectiveness of quasirandom
sequences, quoted from memory): any number of them is spread evenly, and fewer frames are the beginning of more.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import RouteError
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation, rotation_from_quaternion_wxyz
from fieldtruth.drive.bearing import bearing_field
from fieldtruth.drive.physics import resting_pose
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.route_grid import NODE_CLEARANCE
from fieldtruth.drive.track import Motion, Track
from fieldtruth.drive.traversability import Traversability
from fieldtruth.experiment.config import FRAME_RATE, Experiment, FramesConfig
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.world.model import World

_PLASTIC: Final = 1.32471795724474602596  # x^3 = x + 1
_SIDE: Final = 4.0
"""[m] of a tile of the map in a large world, where frames are far from each other."""
_REACH: Final = 1.0
"""[m] from the robot's middle, or to its corners: its wheels stand within."""
_BLOCK: Final = 4096
_TRIES: Final = 20_000_000
"""Points of the sequence before a world counts as having no free ground."""


def standing_robot(world: World, experiment: Experiment) -> Track:
    """Return the poses of the experiment's frames, one every 1 / ``FRAME_RATE`` seconds; velocities are 0.

    Raises:
        RouteError: no free ground, or a route that cannot be planned.
    """
    config = experiment.frames
    assert config is not None
    ground = Traversability(world, experiment.rig, side=_SIDE, clear=1.0)
    reach, rng = max(_REACH, ground.robot_radius), np.random.default_rng(config.seed)
    corners = None
    if experiment.route is not None:
        corners = metres_from_route(plan_route(world, experiment, verify=False))

    def free(points: Array) -> Mask:
        near = True if corners is None else _distance_to_line(points, corners) <= config.aside_m
        return np.asarray((ground.clearance_at(points) >= NODE_CLEARANCE) & near)

    positions = _spread(world.size, free, config.count, rng)
    if len(positions) < config.count:
        where = "" if corners is None else f" within {config.aside_m:g} m of the route"
        raise RouteError(f"{world.name} (seed {world.seed}) has no free ground{where} where the robot could stand")
    random = rng.uniform(-1.0, 1.0, (config.count, 4))
    poses = [
        _tilted(
            *resting_pose(bearing_field(ground.parts.around(xy, reach)), xy, np.pi * turn, experiment.rig),
            rest,
            config,
        )
        for xy, (turn, *rest) in zip(positions, random.tolist(), strict=True)
    ]
    motion = Motion(
        stamps_ns=np.rint(np.arange(1, config.count + 1) * (1e9 / FRAME_RATE)).astype(np.int64),
        position=np.array([position for position, _ in poses]),
        quaternion_wxyz=np.array([quaternion for _, quaternion in poses]),
        linear_velocity=np.zeros((config.count, 3)),
        angular_velocity=np.zeros((config.count, 3)),
    )
    return Track(motion=motion, swept=motion, base=None, is_frames=True)


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

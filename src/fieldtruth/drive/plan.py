# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Routes before the drive: checked, found at random, or expected without physics; and poses of a robot that stands.

On rough ground the robot skids away from the path that is expected, so a random route is driven while it is planned.
What the robot does up to a waypoint depends on no later one: a route that fails is not driven anew from its start, the
drive goes back to the last waypoint that is kept.

The expected path ignores slip and uneven ground. In the park the real drive stays within 0.25 m of it (5 cm on
average); it takes 20 ms instead of 20 s.

Positions of a robot that stands are free at any heading, by the map and the margin of planned routes. They are a
low-discrepancy sequence (multiples of the inverse plastic number; Roberts 2018, The unreasonable effectiveness of
quasirandom sequences, quoted from memory): any number of them is spread evenly, and fewer frames are the beginning of
more.
"""

from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import DriveError, RouteError
from fieldtruth.core.progress import Advance
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation, rotation_from_quaternion_wxyz
from fieldtruth.drive.controller import KinematicSimulator
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.physics import resting_pose
from fieldtruth.drive.routes import NODE_CLEARANCE, RandomRoutePlanner, check_route
from fieldtruth.drive.simulate import Checkpoint, Drive, drive
from fieldtruth.drive.track import Motion, Track
from fieldtruth.drive.traversability import Traversability
from fieldtruth.experiment.config import (
    FRAME_RATE,
    Experiment,
    FramesConfig,
    RandomRouteConfig,
    RouteConfig,
    geodetic_route,
    metres_from_route,
    route_from_metres,
)
from fieldtruth.experiment.environment_file import is_environment_file, world_name
from fieldtruth.experiment.files import load_experiment, validated
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Heightfield, World

_PLASTIC: Final = 1.32471795724474602596  # x^3 = x + 1
_SIDE: Final = 4.0
"""[m] of a tile of the map in a large world, where frames are far from each other."""
_REACH: Final = 1.0
"""[m] from the robot's middle, or to its corners: its wheels stand within."""
_BLOCK: Final = 4096
_TRIES: Final = 20_000_000
"""Points of the sequence before a world counts as having no free ground."""


class TrialDrive:
    """The drive in ``world`` of a route that changes; ``experiment`` supplies control, soil and rig.

    ``progress`` is called after every simulated second with the simulated time [s].
    """

    def __init__(self, world: World, experiment: Experiment, progress: Callable[[float], None] | None = None) -> None:
        self._world, self._experiment, self._progress = world, experiment, progress
        self._drive: Drive | None = None
        self._start: tuple[float, float] | None = None
        self._waypoints: list[tuple[float, float]] = []
        self._checkpoints: list[Checkpoint] = []  # where each of the waypoints was reached

    def reached(self, corners: Array) -> int:
        """Drive start and waypoints (1 + n, 2) [m], and return how many waypoints the robot reaches."""
        route = route_from_metres(corners[0].tolist(), corners[1:].tolist(), self._world.origin)
        with suppress(DriveError):
            drive = self._back_to(route)
            for row in range(len(self._waypoints), len(route.waypoints)):
                if row:  # the first one decides how the robot stands at the start
                    drive.add(route.waypoints[row])
                self._checkpoints.append(drive.reach_last())
                self._waypoints.append(route.waypoints[row])
        return len(self._waypoints)

    def finish(self) -> Track:
        """Stop at the last waypoint that was reached, and return the track of the whole drive; it is the last call.

        Raises:
            DriveError: it cannot stop there.
        """
        if self._drive is None or not self._checkpoints:
            raise DriveError("the robot reaches no waypoint")
        self._drive.restore(self._checkpoints[-1])
        return self._drive.finish()

    def _back_to(self, route: RouteConfig) -> Drive:
        """Return the drive at the last waypoint that it has in common with ``route``."""
        pairs = zip(self._waypoints, route.waypoints, strict=False)
        common = next((row for row, (ours, new) in enumerate(pairs) if ours != new), len(self._waypoints))
        common = min(common, len(route.waypoints)) if self._start == route.start else 0
        del self._waypoints[common:], self._checkpoints[common:]
        if self._drive is not None and common:
            self._drive.restore(self._checkpoints[-1])
        else:
            self._start = route.start
            first = RouteConfig(start=route.start, waypoints=route.waypoints[:1])
            self._drive = Drive(self._world, self._experiment, first, self._progress)
        return self._drive


def plan_route(world: World, experiment: Experiment, *, verify: bool = True) -> RouteConfig:
    """Return the waypoints that ``experiment`` drives in ``world``: its own, checked, or those of a random route.

    Checked are each waypoint and the spacing, the straight lines between them, and the path of the follower, which cuts
    corners. The result depends on the world and the experiment only, not on ``experiment.seconds``.

    Args:
        world: the world to drive in.
        experiment: supplies route, control and rig.
        verify: drive a random route in the physics simulation while it is planned (some 20 s for 150 m): on rough
            ground the robot skids farther from the expected path than the kinematic simulation predicts.

    Raises:
        RouteError: a waypoint or a leg that the robot cannot take, with its number and the obstacle; or no free route
            of the requested length, with the longest that was found.
    """
    route, _ = _planned(world, experiment, verify=verify)
    return route


def expected_seconds(experiment: Experiment) -> float | None:
    """Return the simulated time [s] of a drive at full speed along straight legs; None without a route."""
    if experiment.route is None or experiment.seconds is not None:
        return experiment.seconds
    if isinstance(experiment.route, RandomRouteConfig):
        length = experiment.route.random.length_m
    else:
        corners = metres_from_route(experiment.route, experiment.origin)
        length = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
    return length / experiment.control.speed


def plan_and_drive(world: World, experiment: Experiment, advance: Advance | None = None) -> Track:
    """Plan the route as ``plan_route`` does, and drive it for ``experiment.seconds``.

    A random route is driven while it is planned, and that drive is the result. ``advance`` receives the simulated time
    [s] that was driven.

    Raises:
        RouteError: as ``plan_route``.
        DriveError: the robot cannot drive the given waypoints.
    """
    done = None if advance is None else _increments(advance)
    route, track = _planned(world, experiment, verify=True, progress=done)
    if track is None or experiment.seconds is not None:
        return drive(world, experiment.model_copy(update={"route": route}), progress=done)
    return track


def _increments(advance: Advance) -> Callable[[float], None]:
    """Report the time that was reached, of drives that go back, as what is new of it."""
    reached = 0.0

    def report(time_s: float) -> None:
        nonlocal reached
        advance(max(0.0, time_s - reached))
        reached = max(reached, time_s)

    return report


def _planned(
    world: World, experiment: Experiment, *, verify: bool, progress: Callable[[float], None] | None = None
) -> tuple[RouteConfig, Track | None]:
    """Return the route and, if it is a random one that was verified, the track of the whole of it."""
    ground, simulator = Traversability(world, experiment.rig), KinematicSimulator(experiment, world.terrain.field)
    route = experiment.route
    if not isinstance(route, RandomRouteConfig):
        planned = geodetic_route(route, world.origin)
        check_route(ground, simulator, metres_from_route(planned, world.origin))
        return planned, None
    rng = np.random.default_rng(route.random.seed)
    trial, longest = TrialDrive(world, experiment, progress) if verify else None, 0.0
    reached = None if trial is None else trial.reached
    for corners, length in RandomRoutePlanner(ground, simulator, route.random.length_m, rng, reached).proposals():
        longest = max(longest, length)
        if corners is None:
            continue
        planned = route_from_metres(corners[0].tolist(), corners[1:].tolist(), world.origin)
        with suppress(RouteError, DriveError):
            check_route(ground, simulator, metres_from_route(planned, world.origin))
            return planned, None if trial is None else trial.finish()
    raise RouteError(
        f"no free route of {route.random.length_m:g} m found in {world.name} (seed {world.seed}); "
        f"the longest that was found is {longest:.0f} m"
    )


def experiments_in(environment: str) -> list[Experiment]:
    """Return the built-in experiments of an environment, by name; of a file, one with a random route."""
    if is_environment_file(environment):
        return [validated({"name": world_name(environment), "environment": environment}, environment)]
    experiments = map(load_experiment, EXPERIMENTS)
    return [experiment for experiment in experiments if experiment.environment == environment]


def expected_path(experiment: Experiment, world: World) -> Array:
    """Return the expected poses, every few centimetres: (n, 3) of x, y [m] and heading [rad], from start to end.

    Raises:
        RouteError: no free random route was found.
    """
    route = plan_route(world, experiment) if isinstance(experiment.route, RandomRouteConfig) else experiment.route
    legs, _ = KinematicSimulator(experiment).drive_route(metres_from_route(route, world.origin))
    return np.concatenate(legs)


def poses_along(path: Array, spacing: float) -> Array:
    """Return rows (m, 3) of a path (n, 3), one every ``spacing`` [m], the first at half of that."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    at = np.arange(spacing / 2, max(arc[-1], spacing), spacing)
    return path[np.minimum(np.searchsorted(arc, at), len(path) - 1)]


def pose_on_ground(field: Heightfield, pose: Array, rig: Rig) -> Array:
    """Return world_from_base (4, 4) of a robot at rest on the ground at x, y [m] with a heading [rad]."""
    x, y, heading = pose
    return transforms.pose_from_quaternion_wxyz(*resting_pose(field, np.array([x, y]), float(heading), rig))


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
        corners = metres_from_route(plan_route(world, experiment, verify=False), world.origin)

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

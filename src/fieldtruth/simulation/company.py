# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Robots and actors in one world: where each was at the knots of the simulated time, and how robots meet it there.

All robots drive together in blocks from one knot to the next. In a block a robot meets the others where they were when
the block began. Sensors see them as bodies that move, with their poses at all knots (``sense.moving``). After the end
of its drive a robot stays where it was at its last knot.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.actors.behaviour import RobotState
from fieldtruth.actors.cast import ActorStates, Cast
from fieldtruth.bag.bodies import Robots, leans_of, ruts_of
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import DriveError, RouteError
from fieldtruth.core.progress import Advance
from fieldtruth.core.transforms import pose_from_quaternion_wxyz
from fieldtruth.drive.physics import Other
from fieldtruth.drive.plan import expected_path, plan_route
from fieldtruth.drive.simulate import Drive, SimulatedRobot
from fieldtruth.drive.track import STEP_NS, STEP_S, Motion, Track
from fieldtruth.experiment.config import Experiment, RouteConfig, metres_from_route
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.leaning import LEAN_KNOT_NS
from fieldtruth.sense.moving import KNOT_NS, KnotPoses
from fieldtruth.sense.pressed import PressedPlants
from fieldtruth.sense.robots import robot_body, with_robots
from fieldtruth.sense.ruts import Ruts
from fieldtruth.sense.wind import leaning_of
from fieldtruth.world.model import World

KNOT_STEPS: Final = KNOT_NS // STEP_NS
"""Steps of the physics from one knot to the next."""
_STRIDE: Final = 100
"""Rows of a motion that is given between two points of the way that actors expect."""
ALONE: Final = ""
"""Name of the robot of an experiment that has no others."""


class Known(NamedTuple):
    """What a company knows of a drive that has ended, for ``Company.know``; it can be pickled."""

    routes: Mapping[str, RouteConfig]
    """Those that were planned, by robot."""
    poses: Mapping[str, Array]
    """Poses (n, 4, 4) at the knots from time 0 on, by robot."""
    actors: Mapping[str, tuple[Array, Array]]
    """Poses (n, 4, 4) of the root and values (n, joints) at the knots, by actor."""
    free_ns: list[int]
    """Stamps [ns] from which on users drive, of plants that yield."""
    ends_ns: list[int]
    """Stamps [ns] from which on robots stand, of what they leave behind them."""


class Company:
    """The robots of an experiment, and its actors, in its world.

    An experiment with one robot, and with actors, plants that yield or ruts, has a company, too. Its robot has no name.

    Args:
        experiment: with robots, actors, plants that yield or ruts.
        make_world: returns the world, which knows neither robots nor actors; called when it is first needed.
    """

    def __init__(self, experiment: Experiment, make_world: Callable[[], World]) -> None:
        self.experiments: Mapping[str, Experiment] = {name: experiment.of_robot(name) for name in experiment.robots}
        """The experiment of each robot."""
        if not experiment.robots:
            self.experiments = {ALONE: experiment}
        self.poses: Mapping[str, KnotPoses] = {name: KnotPoses() for name in self.experiments}
        """What is known of the motion of each."""
        self._experiment, self._make_world = experiment, make_world
        self._routes = dict[str, RouteConfig]()

    @cached_property
    def leans(self) -> list[PressedPlants]:
        """How the robots press plants; nothing if these do not yield."""
        return [leans_of(self.world, self._robots())] if self._experiment.plants.yielding else []

    @cached_property
    def ruts(self) -> Ruts | None:
        """The ruts that the robots leave; None if they leave none."""
        return ruts_of(self.world, self._robots()) if self._experiment.ground.ruts else None

    @property
    def _left(self) -> list[PressedPlants | Ruts]:
        """What robots leave behind them, which follows from all of their poses."""
        return [*self.leans, *([self.ruts] if self.ruts is not None else [])]

    def _robots(self) -> Robots:
        origin = self.world.origin
        return {
            name: (made, self.poses[name], metres_from_route(self._route(name), origin))
            for name, made in self.experiments.items()
        }

    def _route(self, name: str) -> RouteConfig:
        """Return the route of a robot, planned once."""
        if name not in self._routes:
            self._routes[name] = plan_route(self.world, self.experiments[name])
        return self._routes[name]

    @cached_property
    def cast(self) -> Cast | None:
        """The actors; None without any."""
        return Cast(self._experiment, self._of_robots) if self._experiment.actors else None

    @property
    def actors(self) -> ActorStates | None:
        """Motion of the actors, as far as it is known."""
        return None if self.cast is None else ActorStates(self.cast.actors)

    @cached_property
    def _of_robots(self) -> World:
        world, names = self._make_world(), self._experiment.robots
        return with_robots(world, names) if names else world

    @property
    def world(self) -> World:
        """The world, with the materials and instance ids of robots and actors."""
        return self._of_robots if self.cast is None else self.cast.world

    def others(self, name: str) -> dict[str, Other]:
        """Return what a robot meets: the rigs of other robots, and the colliders of actors."""
        return {**self._rigs(name), **(self.cast.colliders if self.cast else {})}

    def _rigs(self, name: str) -> dict[str, Rig]:
        return {other: made.rig for other, made in self.experiments.items() if other != name}

    def moving(self, name: str) -> Moving:
        """Return what moves for the sensors of a robot: other robots, actors, plants and ruts."""
        made, world = self._experiment, self.world
        robots = [robot_body(world, other, rig, self.poses[other]) for other, rig in self._rigs(name).items()]
        bodies = [*robots, *(self.cast.bodies() if self.cast else [])]
        return Moving(bodies, leaning_of(made.wind, world, made.seed, *self.leans), self.ruts)

    def begin(self, routes: Mapping[str, RouteConfig | None]) -> None:
        """Put the actors where they begin; the robots are at their starts, and have planned their routes.

        Raises:
            ConfigurationError: an actor cannot begin where it should.
        """
        if self.cast is not None:
            planned = (self.experiments[name].model_copy(update={"route": route}) for name, route in routes.items())
            self._begin([expected_path(made, self.world)[:, :2] for made in planned])
        for each in self._left:
            each.restart()

    def _begin(self, ways: Sequence[Array]) -> None:
        assert self.cast is not None
        self.cast.begin(ways, self._states(0))

    def step_actors(self, stamp_ns: int) -> None:
        """Find where the actors are at the knot after one [ns] at which all robots are known."""
        if self.cast is not None and self.cast.known_ns <= stamp_ns:
            self.cast.step(self._states(stamp_ns))

    def forget(self, before_ns: int) -> None:
        """Forget the motion of all that no stamp from this one [ns] on needs."""
        before_ns -= LEAN_KNOT_NS  # an interval with plants begins at their knot
        if not self._left:
            for poses in self.poses.values():
                poses.forget(before_ns)
        if self.cast is not None:
            self.cast.forget(before_ns)

    def set_free(self, stamp_ns: int) -> None:
        """Take note that users drive from a stamp [ns] on, so that robots may leave their routes."""
        for each in self.leans:
            each.free_ns = min(each.free_ns, stamp_ns)

    def end_actors(self, stamp_ns: int) -> None:
        """Let the actors stand from the knot [ns] on at which the last drive ends, as far as its bag knows them."""
        for each in self._left:
            each.end_ns = stamp_ns
        if self.cast is not None:
            self.cast.end(stamp_ns)

    def follow(self, swept: Motion, end_ns: int) -> None:
        """Move the actors while a robot alone moves as it was given, which touches nothing, up to a stamp [ns].

        Raises:
            ConfigurationError: an actor cannot begin where it should.
        """
        if self.cast is not None:
            self.poses[ALONE].restart(_pose_at_0(swept))
            self.add(ALONE, swept)
            self._begin([swept.position[::_STRIDE, :2]])
            for stamp in range(KNOT_NS, end_ns, KNOT_NS):
                self.step_actors(stamp)
            self.end_actors(end_ns)

    def save(self) -> Any:
        """Return what ``restore`` needs to go on from here."""
        poses = {name: each.save() for name, each in self.poses.items()}
        free, ends = [each.free_ns for each in self.leans], [each.end_ns for each in self._left]
        return None if self.cast is None else self.cast.save(), poses, (free, ends)

    def restore(self, saved: Any) -> None:
        """Go on from where ``save`` was called, in this company or another of the same experiment."""
        cast, poses, times = saved
        if self.cast is not None:
            self.cast.restore(cast)
        for name, each in self.poses.items():
            each.restore(poses[name])
        self._leave_again(*times)

    def known(self) -> Known:
        """Return what sensors need of a drive that has ended."""
        actors = {} if self.cast is None else self.cast.actors
        return Known(
            self._routes,
            {name: each.known for name, each in self.poses.items()},
            {name: (each.roots.known, each.joints.known) for name, each in actors.items()},
            [each.free_ns for each in self.leans],
            [each.end_ns for each in self._left],
        )

    def know(self, known: Known) -> None:
        """Take a drive from another company of the same experiment, for sensors; it cannot go on."""
        self._routes = dict(known.routes)
        for name, each in self.poses.items():
            each.restart(*known.poses[name])
        for name, motion in known.actors.items():
            assert self.cast is not None
            self.cast.actors[name].restart(*motion)
        self._leave_again(known.free_ns, known.ends_ns)

    def _leave_again(self, free_ns: Iterable[int], ends_ns: Iterable[int]) -> None:
        """Let plants and ruts follow from all poses, which may be of another drive than those found so far."""
        for left, end_ns in zip(self._left, ends_ns, strict=True):
            left.restart()
            left.end_ns = end_ns
        for pressed, free in zip(self.leans, free_ns, strict=True):
            pressed.free_ns = free

    def _states(self, stamp_ns: int) -> list[RobotState]:
        """Return where the robots are at a knot [ns], and how fast."""
        found = []
        for name, made in self.experiments.items():
            before, now = self.poses[name]([max(stamp_ns - KNOT_NS, 0), stamp_ns])
            ahead = now[:3, 0]
            speed = float((now[:3, 3] - before[:3, 3]) @ ahead) / (KNOT_NS / 1e9)
            length, width, _ = made.rig.robot.outline
            x, y, _ = now[:3, 3]
            found.append(RobotState(x, y, math.atan2(ahead[1], ahead[0]), speed, math.hypot(length, width) / 2))
        return found

    def add(self, name: str, motion: Motion) -> None:
        """Add the poses at the knots of a motion of a robot; before the next knot it may have rows of earlier ones."""
        rows = np.flatnonzero(motion.stamps_ns % KNOT_NS == 0)
        rows = rows[motion.stamps_ns[rows] >= len(self.poses[name]) * KNOT_NS]
        self.poses[name].add(pose_from_quaternion_wxyz(motion.position[rows], motion.quaternion_wxyz[rows]))

    def meet(self, robots: Mapping[str, SimulatedRobot], stamp_ns: int) -> None:
        """Put the others of each robot that drives where they are at a knot [ns]; all feel what any has pressed."""
        for name, robot in robots.items():
            self._put_others(name, robot, stamp_ns)
            if self.ruts is not None:
                robot.roll_in(self.ruts.at_knot(stamp_ns // LEAN_KNOT_NS))
        first, *others = [each.stems for each in robots.values()]
        if first is not None:
            first.share(filter(None, others))

    def _put_others(self, name: str, robot: SimulatedRobot, stamp_ns: int) -> None:
        poses = {other: self.poses[other]([stamp_ns])[0] for other in self.experiments if other != name}
        if self.cast is None:
            robot.meet(poses)
        else:
            roots = {own: pose for own, pose in self.cast.roots(stamp_ns).items() if own in self.cast.colliders}
            robot.meet(poses | roots, self.cast.twists(stamp_ns))

    def drive(self, advance: Advance | None = None) -> dict[str, Track]:
        """Plan all routes, and drive all robots to the ends of their drives; ``advance`` receives the time [s] driven.

        Raises:
            RouteError, DriveError: a robot, and why it cannot drive its route.
            ConfigurationError: an actor cannot begin where it should.
        """
        drives = {name: self._at_start(name) for name in self.experiments}
        self.begin(self._routes)
        left, stamp = list(drives), 0
        while left:
            self.meet({name: drives[name].robot for name in left}, stamp)
            stamp += KNOT_NS
            for name in left:
                with errors_of(name):
                    self.add(name, drives[name].go_on(stamp // STEP_NS))
            self.step_actors(stamp)
            left = [name for name in left if not drives[name].ended]
            if advance is not None:
                advance(KNOT_NS / 1e9)
        self.end_actors(stamp)
        return {name: each.finish() for name, each in drives.items()}

    def _at_start(self, name: str) -> Drive:
        made = self.experiments[name]
        with errors_of(name):
            route = self._route(name)
            drive = Drive(self.world, made, route, others=self.others(name))
        drive.whole = KNOT_STEPS
        drive.limit(made.seconds)
        self.poses[name].restart(pose_from_quaternion_wxyz(*drive.robot.pose))
        return drive


def _pose_at_0(motion: Motion) -> Array:
    """Pose (4, 4) at time 0, a step before the first row: its velocities are those since then."""
    pose = pose_from_quaternion_wxyz(motion.position[0], motion.quaternion_wxyz[0])
    pose[:3, 3] -= STEP_S * motion.linear_velocity[0]
    pose[:3, :3] = Rotation.from_rotvec(-STEP_S * motion.angular_velocity[0]).as_matrix() @ pose[:3, :3]
    return pose


@contextmanager
def errors_of(name: str) -> Iterator[None]:
    """Put the name of a robot, if it has one, before what is wrong with its route or drive."""
    try:
        yield
    except (RouteError, DriveError) as error:
        if not name:
            raise
        raise type(error)(f"{name}: {error}") from error

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What moves in a run beside its own robot, as bodies for ray tracers, which are where the bag has them."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from fieldtruth.actors.cast import Actor, Cast
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError, BagFile
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.reader import decoder, open_bag
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import wxyz_from_xyzw
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.soil import RutSoil
from fieldtruth.experiment.config import Experiment, RandomRouteConfig, geodetic_route, metres_from_route
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.leaning import plants_of
from fieldtruth.sense.moving import KNOT_NS, KnotPoses, MovingBody
from fieldtruth.sense.pressed import PressedPlants
from fieldtruth.sense.robots import robot_body, with_robots
from fieldtruth.sense.ruts import Ruts, Wheeled
from fieldtruth.sense.wind import leaning_of
from fieldtruth.world.model import World


def _with_bodies(world: World, run: BagFile, experiment: Experiment) -> tuple[World, list[MovingBody]]:
    """Return the world of a run with the materials and ids of what moves, and the bodies.

    Raises:
        BagError: the bag is damaged, or lacks them.
    """
    if experiment.robots:
        world = with_robots(world, experiment.robots)
    cast = Cast(experiment, world) if experiment.actors else None
    world, actors = (world, dict[str, Actor]()) if cast is None else (cast.world, cast.actors)
    rigs = {name: experiment.of_robot(name).rig for name in experiment.robots if name != experiment.namespace}
    if not rigs and not actors:
        return world, []
    poses = {name: KnotPoses() for name in (*rigs, *actors)}
    joints = _read(run, poses, [table.ACTOR_JOINTS] * bool(actors))
    _fill(actors.values(), poses, joints)
    bodies = [robot_body(world, name, rig, poses[name]) for name, rig in rigs.items()]
    return world, [*bodies, *(cast.bodies() if cast else [])]


def moving_in(world: World, run: BagFile, experiment: Experiment) -> tuple[World, Moving]:
    """Return the world of a run with what moves in it.

    Raises:
        BagError: the bag is damaged, or lacks them.
    """
    world, bodies = _with_bodies(world, run, experiment)
    pressing = experiment.plants.yielding or experiment.ground.ruts
    robots = _robots_in(world, run, experiment) if pressing else {}
    leans = [leans_of(world, robots)] if experiment.plants.yielding else []
    ruts = ruts_of(world, robots) if experiment.ground.ruts else None
    return world, Moving(bodies, leaning_of(experiment.wind, world, experiment.seed, *leans), ruts)


Robots = Mapping[str, tuple[Experiment, KnotPoses, Array]]
"""Robots by name, each with its experiment, its poses at the knots of bodies, and its way (m, 2) [m]."""


def leans_of(world: World, robots: Robots) -> PressedPlants:
    """Return how robots press plants."""
    hulls = {name: (made.rig, poses) for name, (made, poses, _) in robots.items()}
    return PressedPlants(world, plants_of(world), hulls, [way for _, _, way in robots.values()])


def ruts_of(world: World, robots: Robots) -> Ruts:
    """Return the ruts that robots leave."""
    return Ruts(
        world,
        [
            Wheeled(made.rig, poses, way, RutSoil(world, made.rig.robot, made.soil))
            for made, poses, way in robots.values()
        ],
    )


def _robots_in(world: World, run: BagFile, experiment: Experiment) -> Robots:
    """Return the robots of a run by their names in the bag; a random route is planned again."""
    made = {name: experiment.of_robot(name) for name in experiment.robots} or {table.ROBOT: experiment}
    poses = {name: KnotPoses() for name in made}
    _read(run, poses, [])
    return {name: (own, poses[name], _way(world, own)) for name, own in made.items()}


def _way(world: World, experiment: Experiment) -> Array:
    """Corners (n, 2) [m] of the route that a robot drove, as planned: the plants near it are those of the recording."""
    route = experiment.route
    planned = isinstance(route, RandomRouteConfig)
    return metres_from_route(
        plan_route(world, experiment) if planned else geodetic_route(route, world.origin), world.origin
    )


def _read(run: BagFile, poses: Mapping[str, KnotPoses], further: Sequence[str]) -> list[Array]:
    """Read the poses of what moves at each knot of the motion, and the joints of all actors from the first knot on."""
    run.require(table.MODEL_STATES, *further)
    states, joints, knots = ModelStatesReader(), list[Array](), 0
    with open_bag(run.bag) as bag:
        decode = decoder(bag)
        for raw in bag.messages([table.MODEL_STATES, *further]):
            if raw.topic != table.MODEL_STATES:
                joints.append(np.asarray(decode(raw).position))
                continue
            if raw.stamp_ns < knots * KNOT_NS:
                continue
            knots += 1  # the first message is for the knot at time 0, too
            found = states.poses(raw.data)[[states.row(raw.data, name) for name in poses]]
            matrices = transforms.pose_from_quaternion_wxyz(found[:, :3], wxyz_from_xyzw(found[:, 3:]))
            for known, matrix in zip(poses.values(), matrices, strict=True):
                known.add(matrix[None])
    return joints


def _fill(actors: Iterable[Actor], poses: Mapping[str, KnotPoses], joints: Sequence[Array]) -> None:
    """Give actors their motion; the joints at time 0 are those of the next knot."""
    first, actors = 0, list(actors)
    count = sum(len(actor.figure.joints) for actor in actors)
    if wrong := [len(each) for each in joints if len(each) != count]:
        raise BagError(f"a message of {table.ACTOR_JOINTS} has {wrong[0]} joints, its actors have {count}")
    for actor in actors:
        last = first + len(actor.figure.joints)
        roots = poses[actor.name]
        for root, values in zip(roots(np.arange(len(roots)) * KNOT_NS), [*joints[:1], *joints], strict=False):
            actor.add(root, values[first:last])
        first = last

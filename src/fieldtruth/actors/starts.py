# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Starts of actors on the ground: given, or random places near the robot's way that fit their behaviour."""

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.actors.behaviour import Member, Mind, RobotState
from fieldtruth.actors.places import Places, one_of
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.standing import trail_headings

_NEAR: Final = 25.0  # [m] from the robot's way, where there is room
_APART: Final = 2.0  # [m] from the robot's start; grazing animals keep more
_SHY: Final = 15.0
_TIME_TO_CROSS: Final = 5.0  # [m] of the way before the first place to cross it ahead of the robot
_NEARNESS: Final = 15.0
"""[m] from the robot's start at which a place is taken with 1 / e of the probability: it is to see actors soon."""
_SEATS: Final = (-0.45, 0.45)  # [m] along a bench
_BLOCK: Final = 64  # places that are looked at together
_AT_BENCH: Final = 2.0  # [m] from a start that is given to the seat
_BENCH: Final = "bench"


class Start(NamedTuple):
    """Where an actor begins: position (2,) [m] and heading [rad], and with what in mind."""

    position: Array
    heading: float
    mind: Mind


class Starts:
    """Finds starts one after the other; ``taken`` (x, y, radius) of others, those that are given included."""

    def __init__(
        self, places: Places, ways: Sequence[Array], robots: Sequence[RobotState], members: Sequence[Member]
    ) -> None:
        self._places, self._ways, self._way, self._robots = places, ways, np.concatenate(ways), robots
        given = ((m, m.own_start) for m in members if not m.flies)
        self.taken = [(*place, m.radius, m.name) for m, place in given if place is not None]

    def find(self, member: Member, rng: np.random.Generator, leader: Start | None) -> Start:
        """Return the start of a member; ``leader`` is that of the first of its group.

        Raises:
            ConfigurationError: the given start is not free, or there is no place for the behaviour.
        """
        behaviour, given = member.config.chosen_behaviour, member.config.start
        is_first = any(name == member.name for *_, name in self.taken)
        if behaviour == "sit":
            start = self._seat(member, rng, None if leader is None else leader.position)
        elif behaviour == "cross":
            start = self._beside_way(member, rng, np.array(given) if is_first else None, leader)
        elif given is not None and is_first:
            self._check(member, np.array(given))
            start = self._standing(member, rng, np.array(given))
        else:
            near = leader.position if leader is not None else None if given is None else np.array(given)
            start = self._standing(member, rng, self._random(member, rng, near))
            if leader is not None and behaviour != "stand":
                start = start._replace(heading=leader.heading)
        self.taken = [each for each in self.taken if each[3] != member.name]  # a seat may be beside what was given
        self.taken.append((*start.position.tolist(), member.radius, member.name))
        return start

    def _standing(self, member: Member, rng: np.random.Generator, position: Array) -> Start:
        behaviour, heading = member.config.chosen_behaviour, float(rng.uniform(-math.pi, math.pi))
        mind = Mind(rng, position)
        if behaviour == "trails":
            along = float(trail_headings(self._places.world.terrain.trail_distance, position[None])[0])
            heading = along if heading > 0 else along - math.pi
        if behaviour == "stand":
            x, y = self._nearest(position) - position
            heading = math.atan2(y, x)
            mind.front, mind.facing, mind.until = heading, heading, float(rng.uniform(1.0, 8.0))
        return Start(position, heading, mind)

    def _nearest(self, position: Array) -> Array:
        """Return the point of a trail that is nearest, or of the robot's way if no trail is near."""
        places = self._places
        away = np.hypot(*(places.nodes - position).T)
        trail = np.where((places.off_trail < 0) & (away > 0), away, np.inf)
        row = int(np.argmin(trail))
        if trail[row] < 10.0:
            return np.asarray(places.nodes[row])
        return np.asarray(self._way[int(np.argmin(np.hypot(*(self._way - position).T)))])

    def _check(self, member: Member, position: Array) -> None:
        """Raise ConfigurationError where the start that is given is not free."""
        x, y = position
        where = f"actors.{member.name}.start: ({x:g}, {y:g}) is"
        if (found := self._places.hindrance(position[None], member.radius)) is not None:
            raise ConfigurationError(
                f"{where} {found[1]}, for a {member.config.kind} with a radius of {member.radius:.2f} m"
            )
        self.check_robots(member, position)
        for ox, oy, radius, name in self.taken:
            if name != member.name and math.hypot(x - ox, y - oy) < member.radius + radius:
                raise ConfigurationError(f"{where} in the place of the actor {name}")

    def check_robots(self, member: Member, position: Array) -> None:
        """Raise ConfigurationError where an actor at a position (2,) [m] touches a robot at its start."""
        for robot in self._robots:
            if math.hypot(position[0] - robot.x, position[1] - robot.y) < member.radius + robot.radius:
                raise ConfigurationError(
                    f"actors.{member.name}.{'script[0]' if member.config.script else 'start'}: ({position[0]:g}, "
                    f"{position[1]:g}) is in the robot's start, ({robot.x:.1f}, {robot.y:.1f}); choose one beside it"
                )

    def _free(self, member: Member, points: Array, apart: float) -> Mask:
        """Which of points (n, 2) are free for a member, at a distance [m] from the robots."""
        free = self._places.clearance(points) >= member.radius + 0.05
        for robot in self._robots:
            free &= np.hypot(points[:, 0] - robot.x, points[:, 1] - robot.y) >= member.radius + robot.radius + apart
        for x, y, radius, _ in self.taken:
            free &= np.hypot(points[:, 0] - x, points[:, 1] - y) >= member.radius + radius + 0.1
        return np.asarray(free)

    def _random(self, member: Member, rng: np.random.Generator, near: Array | None) -> Array:
        places, behaviour = self._places, member.config.chosen_behaviour
        fits = places.free_nodes(member.radius) & self._suits(behaviour, member.radius)
        far = places.off_way if near is None else np.hypot(*(places.nodes - near).T)
        limit, apart = 3.0 + 2 * member.radius if near is not None else _NEAR, _SHY if behaviour == "graze" else _APART
        while limit < 1e4:
            nodes = np.flatnonzero(fits & (far <= limit))
            nodes = nodes[np.argsort(self._order(places.nodes[nodes], rng))]
            for first in range(0, len(nodes), _BLOCK):
                points = places.nodes[nodes[first : first + _BLOCK]]
                points = points + rng.uniform(-0.2, 0.2, points.shape)
                free = self._free(member, points, apart)
                if free.any():
                    return np.asarray(points[int(np.argmax(free))])
            limit *= 2
        what = "trail" if behaviour == "trails" else "free ground"
        raise ConfigurationError(
            f"actors.{member.name}: no {what} for behaviour {behaviour} of a {member.config.kind} with a radius of "
            f"{member.radius:.2f} m near the robot's way in {places.world.name}"
        )

    def _order(self, points: Array, rng: np.random.Generator) -> Array:
        """Numbers (n,) by which points (n, 2) are taken at random: rather near the start of the first robot."""
        away = np.hypot(points[:, 0] - self._robots[0].x, points[:, 1] - self._robots[0].y) if self._robots else 0.0
        return np.asarray(rng.exponential(size=len(points)) * np.exp(np.minimum(away / _NEARNESS, 5.0)))

    def _suits(self, behaviour: str, radius: float) -> Mask:
        """Nodes that fit a behaviour."""
        off_trail, off_way = self._places.off_trail, self._places.off_way
        if behaviour == "trails":
            return np.asarray(off_trail < -0.2)
        if behaviour == "stand":
            beside = off_way > 1.5 + radius
            by_trail = beside & (off_trail > radius + 0.1) & (off_trail < radius + 2.5)
            return np.asarray(by_trail if by_trail.any() else beside & (off_way < 8.0))
        if behaviour == "graze":
            return np.asarray((off_trail > 0.5) & (off_way > 4.0))
        return np.asarray(off_way > 1.0)

    def _beside_way(self, member: Member, rng: np.random.Generator, given: Array | None, leader: Start | None) -> Start:
        """Wait beside a robot's way, with free ground to the other side of it."""
        near = given if leader is None or leader.mind.across is None else leader.mind.across
        way = one_of(self._ways, near, rng)
        count = len(way)
        driven = np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))
        first = min(int(np.searchsorted(driven, _TIME_TO_CROSS)), max(count - 1, 0))
        if given is not None:
            self._check(member, given)
        for _ in range(400 if count > 1 else 0):
            if given is not None:
                row = int(np.argmin(np.hypot(*(way - given).T)))
            elif leader is not None and leader.mind.across is not None:
                row = int(np.argmin(np.hypot(*(way - np.array(leader.mind.across) - rng.normal(0.0, 1.5, 2)).T)))
            else:
                row = first + int((count - first) * rng.uniform() ** 2)
            middle = way[row]
            along = way[min(row + 5, count - 1)] - way[max(row - 5, 0)]
            aside = rng.uniform(2.5, 4.5) * (1.0 if rng.uniform() < 0.5 else -1.0)
            if leader is not None:
                across = np.array(leader.mind.across) - leader.position
                aside = math.copysign(aside, float(across[0] * along[1] - across[1] * along[0]))
            left = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
            position = middle + (aside + math.copysign(member.radius, aside)) * left if given is None else given
            other = 2 * middle - position
            free = self._places.is_clear(position, other, member.radius + 0.05) and (
                given is not None or bool(self._free(member, position[None], 4.0)[0])
            )
            if free and min(np.hypot(*(self._way - end).T).min() for end in (position, other)) > 1.2 + member.radius:
                mind = Mind(rng, position, task="beside", across=(float(middle[0]), float(middle[1])))
                mind.facing = math.atan2(*(middle - position)[::-1])
                return Start(position, mind.facing, mind)
            if given is not None:
                break
        raise ConfigurationError(
            f"actors.{member.name}: no free ground on both sides of the robot's way for behaviour cross of a "
            f"{member.config.kind} with a radius of {member.radius:.2f} m in {self._places.world.name}"
        )

    def _seat(self, member: Member, rng: np.random.Generator, leader: Array | None) -> Start:
        """Sit on a bench: of a leader the nearest, else one near the robot's way."""
        near = leader if leader is not None or member.config.start is None else np.array(member.config.start)
        found = list[tuple[float, Array, float]]()
        for position, heading in _seats(self._places):
            order = float(self._order(position[None], rng)[0])
            far = float(np.hypot(*(self._way - position).T).min())
            order = order + (far > _NEAR) * far if near is None else math.dist(near, position)
            if leader is None and near is not None and order > _AT_BENCH:
                continue  # the start that is given is at another one
            robots = ((r.x, r.y, r.radius) for r in self._robots)
            others = ((x, y, radius) for x, y, radius, name in self.taken if name != member.name)
            if all(math.hypot(position[0] - x, position[1] - y) >= member.radius + r for x, y, r in (*robots, *others)):
                found.append((order, position, heading))
        if not found:
            raise ConfigurationError(f"actors.{member.name}: no free bench to sit on in {self._places.world.name}")
        _, position, heading = min(found, key=lambda each: each[0])
        return Start(position, heading, Mind(rng, position, action="sit", facing=heading))


def _seats(places: Places) -> Iterator[tuple[Array, float]]:
    """Yield positions (2,) [m] and headings [rad] of the seats on benches, which face +x."""
    for instance in places.part.instances:
        pose = instance.world_from_object
        if instance.kind == _BENCH and ((pose[:2, 3] >= places.low) & (pose[:2, 3] <= places.high)).all():
            for y in _SEATS:
                yield (pose @ np.array([0.0, y, 0.0, 1.0]))[:2], math.atan2(pose[1, 0], pose[0, 0])

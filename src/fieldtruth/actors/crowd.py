# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Where all actors are at every knot of simulated time: behaviour, social forces, and hard limits.

A walker has a heading and a speed along it. The velocity that the forces ask for, desired velocity plus relaxation time
times forces, turns the heading and sets the speed, as in the headed social force model (Farina et al. 2017, Walking
ahead: the headed social force model, PLoS ONE 12(1), e0169734), here without lateral steps. Speeds are such that
walkers can stop before what is ahead. A walker that would touch something nevertheless stays where it is.
"""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fieldtruth.actors.behaviour import Behaviour, Member, Mind, Order, RobotState
from fieldtruth.actors.figure import STEP, Placement
from fieldtruth.actors.forces import (
    RELAXATION,
    away_from_others,
    away_from_walls,
    out_of_the_way,
    speed_behind,
    towards_group,
)
from fieldtruth.actors.paths import Flight, Script, flight_of
from fieldtruth.actors.places import Places
from fieldtruth.actors.starts import Start, Starts
from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.random import rng_of
from fieldtruth.world.model import World

_TURN: Final = 3.0  # [rad/s] at most
_TURNING: Final = 0.25  # [s] in which a heading follows
_CALM: Final = 0.25  # [m/s]; forces on one who stands that ask for less do not move it
_PUSHED: Final = 1.0  # [m/s] of one who stands, when forces move it
_ACCELERATION: Final[Mapping[str, float]] = {"deer": 6.0, "dog": 5.0, "cyclist": 3.0, "car": 2.5, "tractor": 1.5}
_OF_OTHERS: Final = 3.0  # [m/s2], of people and all others, along and across
_CRAWL: Final = 0.8  # [m/s] at which one turns away from what is straight ahead
_WARY: Final = 0.6  # [m] by which robots and what rolls seem larger than they are
_LAYER: Final = 1.5  # [m] of height in which flying actors keep apart


@dataclass
class State:
    """What changes from knot to knot."""

    knot: int
    position: Array  # (n, 2) [m]
    heading: Array  # (n,) [rad]
    speed: Array  # (n,) [m/s]
    along: Array  # (n,) parameter of a flight
    minds: list[Mind]
    orders: list[Order]


class Crowd:
    """Actors of one drive: ``placements`` are those of the knot that was reached, at first that of time 0.

    ``ways``, each (n, 2) [m], are the robots' expected paths. Equal arguments give equal motion.

    Raises:
        ConfigurationError: a start, a script or a speed that is not allowed, or no place for a behaviour.
    """

    def __init__(
        self, world: World, members: Sequence[Member], *, seed: int, ways: Sequence[Array], robots: Sequence[RobotState]
    ) -> None:
        self.members = tuple(members)
        given = [m.config.start for m in members if m.config.start] + [p.xy for m in members for p in m.config.script]
        ways = [np.asarray(way, np.float64)[:, :2] for way in ways]
        self._places = Places(world, np.concatenate(ways), np.array(given, np.float64).reshape(-1, 2))
        first: dict[str, int] = {}
        leaders = [first.setdefault(m.group, row) if m.group else row for row, m in enumerate(members)]
        self._behaviour = Behaviour(self._places, members, leaders)
        self._scripts = {k: Script(self._places, m) for k, m in enumerate(members) if m.config.script}
        self._flights: dict[int, Flight] = {}
        self._set_kinds(leaders)
        starts = self._starts(ways, seed, robots, leaders)
        self._state = State(
            knot=0,
            position=np.array([start.position for start in starts]).reshape(-1, 2),
            heading=np.array([start.heading for start in starts]),
            speed=np.zeros(len(members)),
            along=np.zeros(len(members)),
            minds=[start.mind for start in starts],
            orders=[
                Order((float(s.position[0]), float(s.position[1])), 0.0, s.mind.facing, s.mind.action) for s in starts
            ],
        )
        self._give_orders(robots, everyone=True)

    @property
    def placements(self) -> list[Placement]:
        """Where the actors are at the knot that was reached."""
        state, time = self._state, self._state.knot * STEP
        found = []
        for row, (member, order) in enumerate(zip(self.members, state.orders, strict=True)):
            x, y = state.position[row].tolist()
            height = 0.0
            if member.flies:
                ground = float(self._places.ground(state.position[row]))
                smooth = float(self._places.smooth_ground.at(x, y)) + member.config.height_m
                height = (self._scripts[row].at(time)[2] if row in self._scripts else smooth) - ground
            found.append(Placement(x, y, float(state.heading[row]), float(state.speed[row]), height, order.action))
        return found

    def save(self) -> State:
        """Return the state, from which ``restore`` goes on."""
        return copy.deepcopy(self._state)

    def restore(self, state: State) -> None:
        """Go back to a saved state."""
        self._state = copy.deepcopy(state)

    def step(self, robots: Sequence[RobotState]) -> list[Placement]:
        """Move all actors to the next knot, and return where they are; ``robots`` are those of the knot before."""
        state = self._state
        self._give_orders(robots)
        state.knot += 1
        position, heading, speed = state.position.copy(), state.heading.copy(), state.speed.copy()
        if len(self._walkers):
            self._walk(robots, position, heading, speed)
        along = state.along.copy()
        for row, flight in self._flights.items():
            along[row], position[row] = self._fly(row, flight)
        for row, script in self._scripts.items():
            position[row] = script.at(state.knot * STEP)[:2]
        self._stop_before_touching(robots, position, speed, along)
        state.along = along
        for row in (*self._flights, *self._scripts):
            heading[row], speed[row] = self._course(row, position[row])
        state.position, state.heading, state.speed = position, heading, speed
        return self.placements

    # Preparation.

    def _set_kinds(self, leaders: Sequence[int]) -> None:
        members = self.members
        flies = np.array([m.flies for m in members], bool)
        given = np.array([bool(m.config.script) or m.config.chosen_behaviour == "sit" for m in members], bool)
        self._walkers: Index = np.flatnonzero(~flies & ~given)
        self._ground: Index = np.flatnonzero(~flies)
        self._radius = np.array([m.radius for m in members])
        self._top = np.array([m.top_speed for m in members])
        turn_radius = np.array([m.turn_radius for m in members])
        self._turn_radius = turn_radius[self._walkers]
        self._stubborn = np.array([bool(m.config.script) for m in members], bool) | (turn_radius > 0)
        self._acceleration = np.array([_ACCELERATION.get(m.config.kind, _OF_OTHERS) for m in members])[self._walkers]
        self._slowing = 0.7 * self._acceleration
        self._yields = ~given
        height = np.array([m.config.height_m for m in members])
        same = (flies[:, None] == flies) & (~flies[:, None] | (np.abs(height[:, None] - height) < _LAYER))
        np.fill_diagonal(same, val=False)
        self._meet: Mask = same
        groups: dict[int, list[int]] = {}
        for place, row in enumerate(self._walkers.tolist()):
            if members[row].config.chosen_behaviour == "graze":
                continue  # a herd keeps together by where they go
            groups.setdefault(leaders[row], []).append(place)
        self._groups = [np.array(rows, np.intp) for rows in groups.values() if len(rows) > 1]

    def _starts(
        self, ways: Sequence[Array], seed: int, robots: Sequence[RobotState], leaders: Sequence[int]
    ) -> list[Start]:
        finder, found, flying = Starts(self._places, ways, robots, self.members), list[Start](), list[Array]()
        for row, member in enumerate(self.members):
            rng = rng_of(seed, "actor", member.name)
            if member.pace > member.top_speed:
                raise ConfigurationError(
                    f"actors.{member.name}.speed: must be at most {member.top_speed:g} m/s for a {member.config.kind}, "
                    f"got {member.pace:g}"
                )
            if row in self._scripts:
                script = self._scripts[row]
                point = np.array(script.at(0.0)[:2])
                if not member.flies:
                    finder.check_robots(member, point)
                found.append(Start(point, script.first_heading(), Mind(rng, point, until=math.inf)))
            elif member.flies:
                flight = self._flights[row] = flight_of(self._places, member, ways, rng, flying)
                point, after = np.array(flight.at(0.0)), np.array(flight.at(0.5))
                heading = math.atan2(*(after - point)[::-1])
                found.append(Start(point, heading, Mind(rng, point, until=math.inf)))
                flying.append(np.array([*point, member.radius]))
            else:
                found.append(finder.find(member, rng, found[leaders[row]] if leaders[row] < row else None))
        return found

    # One step.

    def _give_orders(self, robots: Sequence[RobotState], *, everyone: bool = False) -> None:
        """Ask each walker for its next order, a tenth of them at each knot."""
        state, every = self._state, round(Behaviour.period / STEP)
        for row in self._walkers.tolist():
            if everyone or (state.knot + row) % every == 0:
                body = (state.position[row].copy(), float(state.heading[row]), float(state.speed[row]))
                state.orders[row] = self._behaviour.order(row, state.minds, state.knot * STEP, body, robots)

    def _walk(self, robots: Sequence[RobotState], position: Array, heading: Array, speed: Array) -> None:
        """Move the walkers, in place, to where they want to be at the next knot."""
        state, rows = self._state, self._walkers
        orders = [state.orders[row] for row in rows.tolist()]
        pace = np.array([order.pace for order in orders])
        here, before, ahead = position[rows], speed[rows], _directions(heading[rows])
        velocity = before[:, None] * ahead
        others, touching, itself = self._others(robots)
        big = np.concatenate([self._stubborn[self._ground], np.ones(len(robots), bool)])
        offset = np.array([order.aim for order in orders]) - here
        going = np.abs(pace)[:, None] * offset / np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-9)[:, None]
        force = away_from_others(here, velocity, others, touching + _WARY * big, itself)
        force += out_of_the_way(here, going, others, touching, itself)
        gap = self._places.clearance(here) - self._radius[rows]
        force += away_from_walls(gap, self._places.uphill(here))
        for members in (group[pace[group] > 0] for group in self._groups):
            if len(members) > 1:
                force[members] += towards_group(here, velocity, pace, self._radius[rows], members)
        wanted = going + np.where((self._turn_radius > 0) & (pace == 0), 0.0, RELAXATION)[:, None] * force
        strength = np.hypot(wanted[:, 0], wanted[:, 1])
        most = np.where(pace == 0, _PUSHED, 1.3 * np.abs(pace))
        wanted *= (np.minimum(strength, most) / np.maximum(strength, 1e-9))[:, None]
        wanted[(pace == 0) & (strength < _CALM)] = 0.0
        rate, bend = self._turns(wanted, heading[rows], before, [order.facing for order in orders])
        heading[rows] += STEP * rate
        sense = np.where((before < 0) | ((pace < 0) & (before < STEP)), -1.0, 1.0)
        limit = np.minimum(
            speed_behind(here, sense[:, None] * ahead, self._slowing, others, touching, itself),
            self._speed_before_walls(here, heading[rows], bend, sense, np.abs(before)),
        )
        ahead = _directions(heading[rows])
        speed[rows] = self._speeds(wanted, before, pace, ahead, limit)
        position[rows] += STEP * speed[rows][:, None] * ahead

    def _others(self, robots: Sequence[RobotState]) -> tuple[tuple[Array, Array], Array, Mask]:
        """Positions and velocities (m, 2) of all on the ground, distances (n, m) of a touch, and which is itself."""
        state, rows, ground = self._state, self._walkers, self._ground
        at = np.concatenate([state.position[ground], np.array([(r.x, r.y) for r in robots]).reshape(-1, 2)])
        heading = np.concatenate([state.heading[ground], [r.heading for r in robots]])
        speed = np.concatenate([state.speed[ground], [r.speed for r in robots]])
        radius = np.concatenate([self._radius[ground], [r.radius for r in robots]])
        itself = np.concatenate([rows[:, None] == ground, np.zeros((len(rows), len(robots)), bool)], axis=1)
        return (at, speed[:, None] * _directions(heading)), self._radius[rows][:, None] + radius, itself

    def _turns(self, wanted: Array, heading: Array, speed: Array, facing: list[float]) -> tuple[Array, Array]:
        """Return turn rates (n,) [rad/s] towards the velocities wanted, and how the way bends (n,) [rad/m]."""
        strength = np.hypot(wanted[:, 0], wanted[:, 1])
        front = np.array(facing)
        stays = strength < 1e-6
        target = np.where(stays, np.where(np.isnan(front), heading, front), np.arctan2(wanted[:, 1], wanted[:, 0]))
        error = (target - heading + np.pi) % (2 * np.pi) - np.pi
        rate = error / _TURNING * np.where(stays, 0.5, np.minimum(1.0, strength / 0.3))
        going = np.maximum(np.abs(speed), 0.3)
        sharpest = np.where(self._turn_radius > 0, 1 / np.maximum(self._turn_radius, 1e-9), np.inf)
        going_round = np.where(self._turn_radius > 0, np.abs(speed) / np.maximum(self._turn_radius, 1e-9), np.inf)
        limit = np.minimum(_TURN, np.minimum(self._acceleration / going, going_round))
        return np.clip(rate, -limit, limit), np.clip(rate / going, -sharpest, sharpest)

    def _speeds(self, wanted: Array, before: Array, pace: Array, ahead: Array, limit: Array) -> Array:
        """Return the next speeds (n,) [m/s], which come down to a limit as fast as the walkers can brake."""
        top, least = self._top[self._walkers], np.where(self._turn_radius > 0, 0.3 * pace, 0.0)
        target = np.clip((wanted * ahead).sum(axis=1), np.maximum(least, 0.0), top)
        target = np.where(pace < 0, pace, target)
        change = (target - before) * -math.expm1(-STEP / RELAXATION)
        braking = STEP * self._acceleration
        speed = before + np.clip(change, -braking, braking)
        slowest = np.maximum(np.abs(before) - braking, 0.0)
        return np.asarray(np.sign(speed) * np.maximum(np.minimum(np.abs(speed), limit), slowest))

    def _speed_before_walls(self, here: Array, heading: Array, bend: Array, sense: Array, speed: Array) -> Array:
        """Return the speeds (n,) [m/s] from which walkers can stop before what blocks, in a curve or straight ahead."""
        reach = 0.3 + speed**2 / (2 * self._slowing)
        count = max(4, math.ceil(float(reach.max()) / 0.4))
        ways = (np.arange(1, count + 1) / count)[:, None] ** 1.5 * reach
        turned = heading + np.clip(ways / 2 * np.stack([bend, np.zeros(len(bend))])[:, None], -0.8, 0.8)
        points = here + (sense * ways)[..., None] * _directions(turned)
        blocked = self._places.clearance(points) < self._radius[self._walkers] + 0.01
        free = np.where(blocked, np.vstack([np.zeros(len(here)), ways[:-1]]), np.inf).min(axis=1)
        in_curve, straight = np.sqrt(2 * self._slowing * free)
        return np.asarray(np.minimum(in_curve, np.maximum(straight, _CRAWL)))

    def _fly(self, row: int, flight: Flight) -> tuple[float, Array]:
        """Return parameter and position of a multirotor at the next knot."""
        state, member = self._state, self.members[row]
        pace = 1.0 if flight.kind == "hover" else member.pace * -math.expm1(-state.knot * STEP)
        along = float(state.along[row]) + STEP * pace
        return along, np.array(flight.at(along))

    def _course(self, row: int, position: Array) -> tuple[float, float]:
        """Return heading [rad] and speed [m/s] of what moves along a given path."""
        state = self._state
        heading, step = float(state.heading[row]), position - state.position[row]
        speed = float(np.hypot(*step)) / STEP
        target = math.atan2(step[1], step[0]) if speed > 0.3 else heading
        if row in self._scripts:
            course = self._scripts[row].course((state.knot - 0.5) * STEP)
            target, speed = (heading, 0.0) if course is None else course
        turn = math.remainder(target - heading, math.tau) * STEP / _TURNING
        return heading + min(max(turn, -_TURN * STEP), _TURN * STEP), speed

    def _stop_before_touching(self, robots: Sequence[RobotState], position: Array, speed: Array, along: Array) -> None:
        """Leave those where they were, in place, who would touch something at the next knot."""
        state, rows = self._state, self._walkers
        old = state.position
        stopped = np.zeros(len(old), bool)
        clearance = self._places.clearance(np.stack([position[rows], old[rows]]))
        stopped[rows] = (clearance[0] < self._radius[rows]) & (clearance[0] < clearance[1])
        for r in robots:
            x, y = (r.x + STEP * r.speed * math.cos(r.heading), r.y + STEP * r.speed * math.sin(r.heading))
            after, before = (np.hypot(at[rows, 0] - x, at[rows, 1] - y) for at in (position, old))
            stopped[rows] |= (after < self._radius[rows] + r.radius + 0.01) & (after < before)
        reach = self._radius[:, None] + self._radius + 1e-9
        apart = _distances(old, old)
        both = self._meet & ((new := _distances(position, position)) < reach) & (new < apart)
        one = self._meet & ((new := _distances(position, old)) < reach) & (new < apart)
        count = -1
        while count < (count := int(stopped.sum())):
            moves = self._yields & ~stopped
            clash = both & ~stopped & moves[:, None]  # with one that moves: the later one stops
            clash &= ~self._yields | (np.arange(len(old))[:, None] > np.arange(len(old)))
            stopped |= clash.any(axis=1) | (moves & (one & stopped).any(axis=1))
        position[stopped], speed[stopped], along[stopped] = old[stopped], 0.0, state.along[stopped]


def _directions(headings: Array) -> Array:
    return np.stack([np.cos(headings), np.sin(headings)], axis=-1)


def _distances(first: Array, second: Array) -> Array:
    offset = first[:, None] - second
    return np.hypot(offset[..., 0], offset[..., 1])

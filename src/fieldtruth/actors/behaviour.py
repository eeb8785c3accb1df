# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Behaviour of actors on the ground: where each wants to go next, how fast, and when it waits or flees.

A mind is asked ten times a second for an order: a point to head for and a speed. Members of a group follow the paths of
its first member.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.actors.places import Places
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.experiment.actor_config import ActorConfig

FLIGHT: Final = 12.0
"""Distance [m] of a robot from which deer flee. De Boer et al. 2004 (Flight distances in roe deer Capreolus capreolus
and fallow deer Dama dama as related to hunting and other factors, quoted from its abstract) measured 42 to 65 m to
people on foot in reserves; these deer are used to people."""
ALERT: Final = 15.0
"""Distance [m] of a robot that moves from which deer raise their heads and watch it (assumed: 1.25 times FLIGHT)."""
_ASTIR: Final = 0.05  # [m/s] of a robot that moves
_WATCHES: Final = 1.5  # [s] that they do so at least
_SAFE: Final = 30.0  # [m] that they run at most
_PATIENCE: Final = 3.0  # [s] without a step before a walker looks for another way
_BACKING: Final = (2.0, 6.0)  # [s]
_ABREAST: Final = 0.8  # [m] between those who go together
_LANE: Final = (0.0, 0.5)  # [m] to the right of the middle of a path


class Member(NamedTuple):
    """An actor: its name and configuration, and numbers of its figure in metres and seconds."""

    name: str
    config: ActorConfig
    radius: float
    speed: float
    top_speed: float
    turn_radius: float = 0.0
    """0: it turns on the spot."""
    flies: bool = False
    group: str = ""
    """Equal for those who go together; empty: alone."""

    @property
    def own_start(self) -> tuple[float, float] | None:
        """The start that the configuration gives to it: of several, to the first only."""
        config = self.config
        if config.script:
            return config.script[0].xy
        return config.start if config.count == 1 or self.name.endswith("_1") else None

    @property
    def pace(self) -> float:
        """Speed [m/s] when nothing is in the way."""
        return self.config.speed or self.speed


class RobotState(NamedTuple):
    """A robot at a knot: position [m], heading [rad], speed [m/s], and the radius [m] of a circle around it."""

    x: float
    y: float
    heading: float
    speed: float
    radius: float


class Order(NamedTuple):
    """What an actor does until it is asked again."""

    aim: tuple[float, float]
    pace: float
    """[m/s]; 0: it stays; below 0: it backs."""
    facing: float = math.nan
    """[rad] of one who stays; nan: as it is."""
    action: str = "walk"


@dataclass
class Mind:
    """What an actor has in mind; ``task`` is go, wait, beside (the robot's way) or back."""

    rng: np.random.Generator
    home: Array
    task: str = "wait"
    until: float = 0.0
    path: Array = field(default_factory=lambda: np.zeros((0, 2)))
    leg: int = 0
    trips: int = 0
    front: float = math.nan
    """[rad], what one who stands mostly faces."""
    facing: float = math.nan
    action: str = "walk"
    pace: float = 0.0
    lane: float = 0.0
    """[m] to the right of the path that it keeps."""
    still: float = 0.0
    """[s] that it tries to go and does not."""
    flees: bool = False
    across: tuple[float, float] | None = None
    """Where it crosses the robot's way."""
    is_late: bool = False


class Behaviour:
    """Behaviour of ``members`` in ``places``; ``leaders``: row of the first of each member's group, or its own."""

    period: Final = 0.1
    """[s] from one order to the next."""

    def __init__(self, places: Places, members: Sequence[Member], leaders: Sequence[int]) -> None:
        self._places, self._members, self._leaders = places, members, leaders
        self._on_trail = places.off_trail < 0

    def order(
        self,
        row: int,
        minds: Sequence[Mind],
        now: float,
        body: tuple[Array, float, float],
        robots: Sequence[RobotState],
    ) -> Order:
        """Return the next order of a member at a time [s], whose ``body`` is position (2,), heading and speed."""
        member, mind = self._members[row], minds[row]
        position = body[0]
        self._watch_progress(member, mind, body[2], now)
        if member.config.kind == "deer" and not mind.flees and robots:
            self._heed(member, mind, position, robots, now)
        leader, grazes = minds[self._leaders[row]], member.config.chosen_behaviour == "graze"
        if leader is not mind and mind.task != "beside" and leader.trips > mind.trips and not grazes:
            self._follow(mind, leader, position, row - self._leaders[row])
        if mind.task == "beside" and self._may_cross(member, mind, position, robots):
            assert mind.across is not None
            other_side = 2 * np.array(mind.across) - position
            self._take(mind, np.stack([position, other_side]), member.pace)
        if mind.task == "back" and now >= mind.until:
            turned = body[1] + (math.pi if mind.rng.uniform() < 0.5 else 0.0)
            mind.task, mind.until = "wait", now
            self._depart(member, mind, (position, turned, body[2]), now)
        if mind.task == "go" and self._has_arrived(member, mind, position):
            self._arrive(member, mind, position, now)
        if mind.task == "wait" and now >= mind.until:
            self._decide(row, minds, now, body)
        return self._going(member, mind, position, body[2])

    def _going(self, member: Member, mind: Mind, position: Array, speed: float) -> Order:
        if mind.task in ("wait", "beside"):
            x, y = mind.home.tolist()
            strayed = math.hypot(x - position[0], y - position[1]) > 0.5 and member.turn_radius == 0
            return Order((x, y), 0.5 * member.pace if strayed else 0.0, mind.facing, mind.action)
        x, y = self._ahead(member, mind, position, speed)
        return Order((x, y), -0.6 if mind.task == "back" else mind.pace, action=mind.action)

    def _watch_progress(self, member: Member, mind: Mind, speed: float, now: float) -> None:
        """Back off (what rolls), and look for another way, after some time without progress."""
        mind.still = mind.still + self.period if mind.task == "go" and abs(speed) < 0.1 * mind.pace else 0.0
        if mind.task == "go" and member.turn_radius and mind.still > 1.0:
            mind.task, mind.until, mind.still = "back", now + float(mind.rng.uniform(*_BACKING)), 0.0
        elif mind.still > _PATIENCE:
            mind.task, mind.until, mind.still = "wait", now + float(mind.rng.uniform(0.0, 1.0)), 0.0

    # Decisions.

    def _decide(self, row: int, minds: Sequence[Mind], now: float, body: tuple[Array, float, float]) -> None:
        member, mind = self._members[row], minds[row]
        behaviour = member.config.chosen_behaviour
        if behaviour == "stand":
            mind.facing = mind.front + float(mind.rng.normal(0.0, 0.6))
            mind.until = now + float(mind.rng.uniform(4.0, 12.0))
        elif self._leaders[row] != row and behaviour != "graze":
            mind.until, leader = now + self.period, minds[self._leaders[row]]
            if leader.task == "go" and math.dist(body[0], leader.path[-1]) > 3.0:
                self._follow(mind, leader, body[0], row - self._leaders[row])  # it was left behind
        elif behaviour == "graze":
            self._graze(row, minds, now, body)
        else:
            self._depart(member, mind, body, now)

    def _graze(self, row: int, minds: Sequence[Mind], now: float, body: tuple[Array, float, float]) -> None:
        """Eat, step on, look up, or walk to another place."""
        member, mind = self._members[row], minds[row]
        mind.flees, mind.home, mind.facing = False, body[0].copy(), math.nan
        choice = float(mind.rng.uniform())
        if (choice < 0.65 and mind.action != "graze") or choice < 0.4:
            mind.action, mind.until = "graze", now + float(mind.rng.uniform(5.0, 20.0))
        elif choice < 0.55:
            mind.action, mind.until = "walk", now + float(mind.rng.uniform(2.0, 5.0))
        else:
            far = float(mind.rng.uniform()) < 0.25
            leader = minds[self._leaders[row]]
            near = None if leader is mind else leader.home
            self._depart(member, mind, body, now, (5.0, 15.0) if far else (0.5, 3.0), near)
            mind.action, mind.pace = ("walk", member.pace) if far else ("graze", min(0.4, member.pace))

    def _depart(
        self, member: Member, mind: Mind, body: tuple[Array, float, float], now: float,
        far: tuple[float, float] | None = None, near: Array | None = None,
    ) -> None:  # fmt: skip
        """Take a path to a random place between two distances, rather ahead than behind."""
        places, (position, heading, _) = self._places, body
        trails = member.config.chosen_behaviour == "trails"
        far = far or ((15.0, 80.0) if trails else (6.0, 30.0))
        ways = places.ways_from(places.node_at(position, member.radius), member.radius, 2 * far[1], trails=trails)
        there = np.isfinite(ways.cost) & (self._on_trail if trails else True)
        if near is not None:
            there &= np.hypot(*(places.nodes - near).T) < 8.0
        nodes = np.flatnonzero(there & (ways.cost >= far[0]) & (ways.cost <= far[1]))
        if not len(nodes):
            least = 0.6 * float(ways.cost[there].max(initial=0.0))
            nodes = np.flatnonzero(there & (ways.cost >= least) & (ways.cost > 0))
        if not len(nodes):
            mind.until = now + 2.0
            return
        path, away = np.zeros((0, 2)), math.inf
        for node in mind.rng.choice(nodes, 8).tolist():
            proposed = places.path_to(ways, node)
            first = proposed[min(6, len(proposed) - 1)] - position
            turn = abs(math.remainder(math.atan2(first[1], first[0]) - heading, math.tau))
            if turn < away - 0.5:
                path, away = proposed, turn
            if away < 1.2:
                break
        self._take(mind, path if trails else places.straight(path, member.radius), member.pace)

    def _take(self, mind: Mind, path: Array, pace: float) -> None:
        mind.path, mind.leg, mind.task, mind.pace, mind.action = path, 0, "go", pace, "walk"
        mind.trips += 1
        mind.lane, mind.still = float(mind.rng.uniform(*_LANE)), 0.0

    def _follow(self, mind: Mind, leader: Mind, position: Array, number: int) -> None:
        """Take the path of a leader, beside it: three in a row."""
        mind.trips, mind.path, mind.task, mind.pace, mind.still = leader.trips, leader.path, "go", leader.pace, 0.0
        mind.leg = int(np.argmin(((leader.path - position) ** 2).sum(axis=1)))
        mind.lane, mind.action = leader.lane + _ABREAST * (((number + 1) % 3) - 1), leader.action

    def _arrive(self, member: Member, mind: Mind, position: Array, now: float) -> None:
        mind.task, mind.home, mind.facing, mind.across = "wait", position.copy(), math.nan, None
        behaviour, rng = member.config.chosen_behaviour, mind.rng
        goes_on = member.turn_radius > 0 or (behaviour == "trails" and rng.uniform() < 0.8) or behaviour == "graze"
        mind.until = now if goes_on else now + float(rng.uniform(1.0, 6.0))
        if mind.flees:
            mind.until, mind.action = now + float(rng.uniform(3.0, 8.0)), "walk"
        mind.flees = False

    def _heed(self, member: Member, mind: Mind, position: Array, robots: Sequence[RobotState], now: float) -> None:
        """Run away from the nearest robot if it is too near, and watch the nearest one that moves, if it is near."""

        def gap(robot: RobotState) -> float:
            return math.hypot(robot.x - position[0], robot.y - position[1]) - robot.radius

        if gap(nearest := min(robots, key=gap)) < FLIGHT:
            self._flee_from(member, mind, position, nearest)
            return
        watched = min((robot for robot in robots if abs(robot.speed) > _ASTIR), key=gap, default=None)
        if watched is not None and gap(watched) < ALERT:
            rests_until = mind.until if mind.task == "wait" else now
            mind.task, mind.action, mind.home = "wait", "walk", position.copy()
            mind.until = max(rests_until, now + _WATCHES)
            mind.facing = math.atan2(watched.y - position[1], watched.x - position[0])

    def _flee_from(self, member: Member, mind: Mind, position: Array, robot: RobotState) -> None:
        """Run away from a robot."""
        places, danger = self._places, np.array([robot.x, robot.y])
        ways = places.ways_from(places.node_at(position, member.radius), member.radius, 1.5 * _SAFE)
        reached = np.isfinite(ways.cost) & (ways.cost <= _SAFE) & (ways.cost > 1.0)
        offset, towards = places.nodes - position, (danger - position) / max(math.dist(danger, position), 1e-6)
        length = np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-6)
        away: Mask = reached & (offset @ towards < 0.3 * length)
        nodes = np.flatnonzero(away if away.any() else reached)
        if len(nodes):
            best = nodes[int(np.argmax(np.hypot(*(places.nodes[nodes] - danger).T)))]
            self._take(mind, places.path_to(ways, int(best)), member.top_speed)
            mind.flees = True

    def _may_cross(self, member: Member, mind: Mind, position: Array, robots: Sequence[RobotState]) -> bool:
        """Return whether the time is right to cross before a robot, or behind one for which it was too late.

        The robot is expected by the straight line to the crossing, so it comes rather later than that.
        """
        assert mind.across is not None
        (x, y), free, in_time, too_near = mind.across, True, False, False
        for robot in robots:
            ahead, left = x - robot.x, y - robot.y
            distance = math.hypot(ahead, left) - robot.radius
            comes = robot.speed > _ASTIR and ahead * math.cos(robot.heading) + left * math.sin(robot.heading) > 0
            width = math.dist(position, mind.across) + robot.radius + member.radius + 0.5
            needed = width / member.pace + 1.0
            expected = distance / robot.speed if comes else math.inf
            in_time = in_time or needed + 0.5 < expected < needed + 3.0
            too_near = too_near or expected <= needed + 0.5
            free = free and expected > needed + 3.0 and distance > 2.0
        mind.is_late = mind.is_late or too_near
        return (in_time and not too_near) or (mind.is_late and free)

    # Ways.

    def _has_arrived(self, member: Member, mind: Mind, position: Array) -> bool:
        near = max(0.5, member.radius, 1.2 * member.turn_radius) + (1.0 if member.group else 0.0)
        return mind.leg >= len(mind.path) - 8 and math.dist(position, mind.path[-1]) < near

    def _ahead(self, member: Member, mind: Mind, position: Array, speed: float) -> tuple[float, float]:
        """Return the farthest point of the path nearby to which the way is free, a little to the right of it."""
        places, path = self._places, mind.path
        near = path[mind.leg : mind.leg + 6]
        mind.leg += int(np.argmin(((near - position) ** 2).sum(axis=1)))
        reach = max(2.0, 1.5 * member.turn_radius, speed)
        steps = 1 + max(1, math.ceil(reach / places.spacing))
        points = path[mind.leg + 1 : mind.leg + steps] if mind.leg + 1 < len(path) else path[-1:]
        shares = np.linspace(0.0, 1.0, 2 + math.ceil(reach / 0.3))
        lines = position + shares[:, None, None] * (points - position)
        visible = np.flatnonzero((places.clearance(lines[1:]) >= member.radius + 0.05).all(axis=0))
        aim = points[visible[-1] if len(visible) else 0]
        if mind.leg + 8 < len(path):
            (dx, dy), length = aim - position, max(math.dist(aim, position), 1e-6)
            aside = aim + mind.lane / length * np.array([dy, -dx])
            if places.is_clear(aim, aside, member.radius + 0.2):
                aim = aside
        return float(aim[0]), float(aim[1])

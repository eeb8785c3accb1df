# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Given paths: scripts, exact at each time, and flights of multirotors, along which only the pace changes."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fieldtruth.actors.behaviour import Member
from fieldtruth.actors.places import Places, one_of
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import ConfigurationError

_RADII = (8.0, 6.0, 10.0, 5.0, 12.0, 4.0, 3.0)  # [m] of orbits, in the order in which they are tried
_LENGTH = 30.0  # [m] of a pass to and fro
_GUST = 0.12  # [m] of each of three slow swings about where one hovers, along each axis
_BIN = 0.5  # [m] of height in which a flight of a script is compared with what is there
_MARGIN = 0.5  # [m] of free air around a flying actor


class Script:
    """Positions and heights of a script at any time; flying, heights [m] are above the sea, else 0."""

    def __init__(self, places: Places, member: Member) -> None:
        config = member.config
        self.times = np.array([point.at_s for point in config.script])
        self.points = np.array([point.xy for point in config.script])
        self.heights = np.zeros(len(self.times))
        if member.flies:
            above = [config.height_m if point.height_m is None else point.height_m for point in config.script]
            self.heights = places.ground(self.points) + np.array(above)
        self._check(places, member)

    def at(self, time: float) -> tuple[float, float, float]:
        """Return x, y and the height at a time [s]."""
        x, y = (float(np.interp(time, self.times, self.points[:, axis])) for axis in (0, 1))
        return x, y, float(np.interp(time, self.times, self.heights))

    def course(self, time: float) -> tuple[float, float] | None:
        """Return heading [rad] and speed [m/s] just after a time; None while it stands."""
        row = int(np.searchsorted(self.times, time, side="right"))
        if row in (0, len(self.times)):
            return None
        step = self.points[row] - self.points[row - 1]
        length = float(np.hypot(*step))
        heading = math.atan2(step[1], step[0])
        return (heading, length / float(self.times[row] - self.times[row - 1])) if length > 0 else None

    def first_heading(self) -> float:
        """Heading [rad] of the first step."""
        steps = np.diff(self.points, axis=0)
        moves = np.flatnonzero(np.hypot(steps[:, 0], steps[:, 1]) > 0)
        return math.atan2(steps[moves[0], 1], steps[moves[0], 0]) if len(moves) else 0.0

    def _check(self, places: Places, member: Member) -> None:
        """Raise ConfigurationError where it is too fast, or leads through what is solid, water or the world's edge."""
        for row, point in enumerate(self.points):
            before = self.points[max(row - 1, 0)]
            length, where = math.dist(before, point), f"actors.{member.name}.script[{row}]"
            name = f"({point[0]:g}, {point[1]:g})"
            needed = length / float(self.times[row] - self.times[row - 1]) if row else 0.0
            if needed > (1 + 1e-9) * member.top_speed:
                raise ConfigurationError(
                    f"{where}: {name} needs {needed:.1f} m/s from the point before; a {member.config.kind} moves at "
                    f"most at {member.top_speed:g} m/s"
                )
            line = before + np.linspace(0.0, 1.0, 2 + int(length / 0.02))[:, None] * (point - before)
            if member.flies:
                heights = np.linspace(self.heights[max(row - 1, 0)], self.heights[row], len(line))
                found = _obstructed(places, line, heights - places.ground(line), member.radius)
            else:
                found = places.hindrance(line, member.radius, steep=False)
            if found is not None:
                x, y = line[found[0]]
                raise ConfigurationError(
                    f"{where}: on the way to {name} a {member.config.kind} with a radius of {member.radius:.2f} m is "
                    f"{found[1]} at ({x:.1f}, {y:.1f})"
                )


def _obstructed(places: Places, points: Array, above: Array, radius: float) -> tuple[int, str] | None:
    """Return the first of points (n, 2), ``above`` (n,) [m] the ground, where a flying actor is not free, and why."""
    if (low := above < radius).any():
        return int(np.argmax(low)), "in the ground"
    levels = np.round(above / _BIN) * _BIN
    for level in np.unique(levels):
        rows = np.flatnonzero(levels == level)
        taken = ~_air(places, points[rows], float(level), radius)
        if taken.any():
            return int(rows[np.argmax(taken)]), "in an object, or outside"
    return None


def has_air(places: Places, points: Array, height: float, radius: float) -> bool:
    """Return whether points (n, 2) at a height [m] above the ground are free for a flying actor."""
    return bool(_air(places, points, height, radius).all())


def _air(places: Places, points: Array, height: float, radius: float) -> Mask:
    """Mask of points (n, 2) that are free at a height [m] above the ground."""
    return np.asarray(places.air(round(height, 1)).at(points[:, 0], points[:, 1]) >= radius + _MARGIN)


class Flight(NamedTuple):
    """A way in the air as a function of a parameter s: [m], of hovering [s]."""

    kind: str
    middle: tuple[float, float]
    direction: tuple[float, float]
    """Of a pass; of an orbit its radius [m] and the sense of rotation; else none."""
    phases: tuple[float, ...]

    def at(self, s: float) -> tuple[float, float]:
        """Return x and y [m]."""
        x, y = self.middle
        if self.kind == "orbit":
            angle = self.phases[0] + self.direction[1] * s / self.direction[0]
            return x + self.direction[0] * math.cos(angle), y + self.direction[0] * math.sin(angle)
        if self.kind == "pass":
            along = _LENGTH / 2 * math.sin(2 * s / _LENGTH + self.phases[0])
            return x + along * self.direction[0], y + along * self.direction[1]
        calm = s * s / (s * s + 4.0)  # at first it is still
        swings = [
            calm * _GUST / k * math.sin((0.4 + 0.7 * k) * s + phase)
            for k, phase in zip((1, 2, 3) * 2, self.phases, strict=True)
        ]
        return x + sum(swings[:3]), y + sum(swings[3:])


def flight_of(
    places: Places, member: Member, ways: Sequence[Array], rng: np.random.Generator, taken: Sequence[Array]
) -> Flight:
    """Return a flight about a robot's way, apart from the ``taken`` starts (3,) of others: x, y, radius.

    Raises:
        ConfigurationError: no free air.
    """
    kind, height, way = member.config.chosen_behaviour, member.config.height_m, one_of(ways, member.own_start, rng)
    driven = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    for attempt in range(200):
        ahead = 12.0 + (rng.uniform(-6.0, 6.0 + 0.3 * attempt) if attempt else 0.0)
        middle = way[min(int(np.searchsorted(driven, ahead)), len(way) - 1)] + rng.normal(0.0, 0.02 * attempt, 2)
        phases = tuple(rng.uniform(-math.pi, math.pi, 6).tolist())
        turn = float(rng.uniform(-math.pi, math.pi))
        direction = (math.cos(turn), math.sin(turn))
        if kind == "orbit":
            direction = (_RADII[attempt % len(_RADII)], 1.0 if turn > 0 else -1.0)
        if member.own_start is not None:
            start = np.array(member.own_start)
            if kind == "hover":
                middle = start
            elif kind == "orbit":
                direction = (max(math.dist(start, middle), 1.0), direction[1])
                phases = (math.atan2(start[1] - middle[1], start[0] - middle[0]), *phases[1:])
            else:
                across = (middle - start) / max(math.dist(start, middle), 1e-6)
                middle, direction = start + _LENGTH / 2 * across, (float(across[0]), float(across[1]))
                phases = (-math.pi / 2, *phases[1:])
        flight = Flight(kind, (float(middle[0]), float(middle[1])), direction, phases)
        line = np.array([flight.at(s) for s in np.arange(0.0, math.pi * _LENGTH, 0.4)])
        apart = all(math.dist(line[0], other[:2]) > member.radius + other[2] for other in taken)
        if apart and has_air(places, line, height, member.radius):
            return flight
    raise ConfigurationError(
        f"actors.{member.name}: no free air in {places.world.name} to {kind} about the robot's way at {height:g} m "
        "above the ground; another height_m or start may have some"
    )

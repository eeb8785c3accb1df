# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ways of actors for tests, and their parts along them."""

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.actors.figure import Figure, Ground, Placement
from fieldtruth.actors.kinds import KINDS

F8 = NDArray[np.float64]
STEP = 0.01
Of = Callable[[float], float]


def flat(x: float, y: float) -> float:
    return 0.0


def slope(x: float, y: float) -> float:
    return 0.2 * x + 0.1 * y


def placements(
    speed: Of, turn: Of = lambda t: 0.0, *, seconds: float, height: float = 0.0, action: str = "walk"
) -> list[Placement]:
    """Placements of a way from the origin with a speed [m/s] and a turn rate [rad/s] over time."""
    x = y = heading = 0.0
    found = [Placement(x, y, heading, speed(0.0), height, action)]
    for k in range(1, round(seconds / STEP)):
        t = k * STEP
        heading += turn(t) * STEP
        x += speed(t) * math.cos(heading) * STEP
        y += speed(t) * math.sin(heading) * STEP
        found.append(Placement(x, y, heading, speed(t), height, action))
    return found


def body_at(x: float, y: float, heading: float) -> F8:
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1.0]])


class Walk(NamedTuple):
    """An actor on its way."""

    figure: Figure
    roots: F8
    angles: F8
    carries: NDArray[np.bool_]  # (n, feet)
    parts: F8  # (n, parts, 4, 4)

    def points(self, part: int, point: Sequence[float]) -> F8:
        """Where a point (3,) of a part is in the world, (n, 3)."""
        return np.asarray((self.parts[:, part] @ [*point, 1.0])[:, :3])

    def with_angles(self, angles: F8) -> "Walk":
        return self._replace(angles=angles, parts=self.figure.poses(self.roots, angles))

    def column(self, name: str) -> F8:
        """Values (n,) of a joint."""
        return np.asarray(self.angles[:, [joint.name for joint in self.figure.joints].index(name)])


@cache
def _figure(kind: str, seed: int) -> Figure:
    return KINDS[kind].figure(kind, np.random.default_rng(seed))


def walk(kind: str, way: Sequence[Placement], ground: Ground = flat, seed: int = 2) -> Walk:
    """Let an actor go."""
    figure = _figure(kind, seed)
    gait = KINDS[kind].gait(figure, way[0], ground, np.random.default_rng(seed))
    roots, angles, carries = [], [], []
    for each in way:
        root, values = gait.step(each)
        roots.append(root)
        angles.append(values)
        carries.append([foot.carries for foot in getattr(gait, "feet", ())])
    parts = figure.poses(np.array(roots), np.array(angles))
    return Walk(figure, np.array(roots), np.array(angles), np.array(carries), parts)


def depth(done: Walk, parts: Sequence[int], ground: Ground, every: int = 9) -> float:
    """Greatest depth [m] of parts below the ground."""
    worst = 0.0
    for part in parts:
        pose, points = done.parts[::every, part], done.figure.parts[part].vertices
        world = np.einsum("nij,kj->nki", pose[:, :3, :3], points) + pose[:, None, :3, 3]
        heights = np.vectorize(ground)(world[..., 0], world[..., 1])
        worst = max(worst, float((heights - world[..., 2]).max()))
    return worst

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Puddles: shallow hollows of irregular outline, each with a sheet of water at its own level."""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.layered.config import Puddles
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields
from fieldtruth.world.grids import make_raster
from fieldtruth.world.model import Mesh, Raster
from fieldtruth.world.relief import Axes
from fieldtruth.world.water import DRY, make_sheet

RISE: Final = 0.02
"""Height [m] of a puddle's rim above its water at least."""
RIM: Final = 0.5
"""Width [m] of the rim that is raised to that."""
ROBOT: Final = 0.7
"""Distance [m] from a corridor's centre line that stays dry: half of a robot's width, and some."""
TRIES: Final = 400
_SIDES: Final = 48


class Puddle(NamedTuple):
    """A puddle: its centre, outline and depth."""

    x: float
    y: float
    radius: float  # [m], mean
    waves: tuple[tuple[int, float, float], ...]  # (number around it, share of the radius, phase [rad])
    depth: float  # [m]

    def reach(self, turn: Array) -> Array:
        """Radius [m] in directions [rad]."""
        return np.asarray(self.radius * (1.0 + sum(share * np.cos(k * turn + phase) for k, share, phase in self.waves)))


class Wet(NamedTuple):
    """Heights (nx, ny) [m] with hollows, the level of their water, and its sheets with their heights [m]."""

    heights: Array
    level: Raster | None
    sheets: list[tuple[Mesh, float]]


def dig_puddles(fields: Fields, puddles: Puddles, heights: Array, rng: np.random.Generator) -> Wet:
    """Dig the puddles into the heights at the fields' nodes; those that do not fit are left out."""
    dug, spacing = heights.copy(), float(fields.nodes[0][1] - fields.nodes[0][0])
    level, sheets = np.full(heights.shape, DRY), list[tuple[Mesh, float]]()
    for puddle in _scattered(fields, puddles, rng):
        (i, j), away, share = _around(fields.nodes, puddle)
        ground = dug[i, j]
        inside = share < 1.0
        if not inside.any():
            continue
        height = float(np.quantile(ground[inside], 0.2)) - RISE
        bed = height - puddle.depth * (1.0 - share**2)
        rim = np.maximum(ground, height + RISE)
        raised = rim + (ground - rim) * np.clip((away - RIM) / RIM, 0.0, 1.0)
        dug[i, j] = np.where(inside, np.minimum(bed, ground), raised)
        wet = (away < 1.5 * spacing) | inside
        level[i, j] = np.where(wet, height, level[i, j])
        sheets.append((_sheet(f"puddle_{len(sheets)}", puddle, puddles.material), height))
    return Wet(dug, make_raster(level, spacing, *fields.nodes) if sheets else None, sheets)


def _scattered(fields: Fields, puddles: Puddles, rng: np.random.Generator) -> list[Puddle]:
    darts = rng.uniform(-0.5, 0.5, (TRIES * max(1, puddles.count // 4), 2)) * (np.array(fields.size) - 4.0)
    darts = darts[rng.random(len(darts)) < fields.at(puddles.where, darts)]
    corridor = fields.at(Expression("corridor"), darts)
    found: list[Puddle] = []
    for (x, y), clear in zip(darts.tolist(), corridor.tolist(), strict=True):
        radius = float(np.exp(rng.uniform(*np.log(puddles.radius))))
        if len(found) == puddles.count:
            break
        away = [np.hypot(x - other.x, y - other.y) - 1.4 * (radius + other.radius) for other in found]
        if clear > 1.4 * radius + ROBOT and min(away, default=np.inf) > 2 * RIM:
            waves = tuple(
                (k, float(rng.uniform(0.3, 1.0)) * share, float(rng.uniform(0.0, 6.3)))
                for k, share in ((2, 0.26), (3, 0.14), (5, 0.06))
            )
            found.append(Puddle(x, y, radius, waves, float(rng.uniform(*puddles.depth))))
    return found


def _around(nodes: Axes, puddle: Puddle) -> tuple[tuple[slice, slice], Array, Array]:
    """Rows and columns of the nodes about a puddle, distance [m] to its edge, below 0 in it, and share of reach."""
    span = 1.5 * puddle.radius + 2 * RIM
    i, j = (slice(*np.searchsorted(axis, (c - span, c + span))) for axis, c in zip(nodes, puddle[:2], strict=True))
    x, y = np.meshgrid(nodes[0][i] - puddle.x, nodes[1][j] - puddle.y, indexing="ij")
    off, reach = np.hypot(x, y), puddle.reach(np.arctan2(y, x))
    return (i, j), off - reach, off / reach


def _sheet(name: str, puddle: Puddle, material: str) -> Mesh:
    """Disc of water that reaches a little into the rim, which hides its edge."""
    turn = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    rim = (puddle.reach(turn) + 0.15)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    vertices = np.zeros((_SIDES + 1, 3))
    vertices[1:, :2] = rim
    k = np.arange(_SIDES)
    faces = np.stack([np.zeros(_SIDES, int), 1 + k, 1 + (k + 1) % _SIDES], axis=1)
    return make_sheet(name, vertices + np.array([puddle.x, puddle.y, 0.0]), faces, material)

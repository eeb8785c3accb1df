# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trails that go on beyond a world's edge: bands of their materials on the land."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Land, height_beyond
from fieldtruth.world.grids import Line, Trail, distance_beyond
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh, Terrain, make_mesh, merge_meshes

LIFT: Final = 0.015  # [m] of a trail above the land's triangles at the edge, plus 1 mm per metre
STEP: Final = 0.05  # [m] between the points of a trail's line
STRIPS: Final = 4
"""Least number of strips across a trail, which follow land that bends there."""
WIDEST: Final = 0.6
"""Greatest width [m] of such a strip, as roads are wide."""
ROWS: Final = 5
"""Each of this number of a line's points has vertices."""


def continued(
    trails: Sequence[Trail], size: tuple[float, float], reach: float, rng: np.random.Generator
) -> list[Trail]:
    """The trails beyond the edge, continued for ``reach`` [m] in a slight bend; they start a little inside."""
    half, on = np.array(size) / 2, []
    for part, width in [(part, trail.width) for trail in trails for part in trail.line.parts()]:
        for points in (part.points, part.points[::-1]):
            outside = np.asarray((np.abs(points) > half).any(axis=1))
            if not outside[-1]:
                continue
            first = len(points) - int(np.argmax(~outside[::-1])) - round(2.0 * width / STEP)
            step = float(np.linalg.norm(points[-1] - points[-2]))
            s = np.arange(step, reach, step)
            bend = 0.5 * rng.choice([-1.0, 1.0]) * np.sin(s / reach * rng.uniform(1.5, 3.5)) ** 2
            heading = np.arctan2(*(points[-1] - points[-2])[::-1]) + bend
            ahead = points[-1] + np.cumsum(step * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
            whole = np.concatenate([points[max(first, 0) :], ahead])
            tangents = np.gradient(whole, axis=0)
            on.append(Trail(Line(whole, tangents / np.linalg.norm(tangents, axis=1, keepdims=True)), width))
    return on


def with_trails(backdrop: Mesh, trails: Sequence[Trail], terrain: Terrain, size: tuple[float, float]) -> Mesh:
    """A backdrop with trails on it, of the terrain's materials."""
    ground = height_beyond(terrain.field, size, backdrop)
    bands = [_band(trail.line, *band, size, ground) for trail in trails for band in _bands(trail.width, terrain)]
    return merge_meshes("backdrop", [backdrop, *bands], footprint=backdrop.footprint) if bands else backdrop


def _bands(width: float, terrain: Terrain) -> list[tuple[Array, str]]:
    """Bands across a trail: distances [m] of their vertices to the left of its centre line, and material."""
    half, border = width / 2, terrain.border_width
    columns = 1 + max(STRIPS, int(np.ceil((width - 2 * border) / WIDEST)))
    return [
        (np.array([-half, border - half]), terrain.border_material),
        (np.array([half - border, half]), terrain.border_material),
        (np.linspace(border - half, half - border, columns), terrain.trail_material),
    ]


def _band(line: Line, across: Array, material: str, size: tuple[float, float], ground: Land) -> Mesh:
    """A band along a line, slightly above the land's triangles; where it crosses the edge, vertices move onto it."""
    rows = np.arange(0, len(line.points), ROWS)
    left = np.stack([-line.tangents[rows, 1], line.tangents[rows, 0]], axis=1)
    xy = (line.points[rows, None] + across[:, None] * left[:, None]).reshape(-1, 2)
    half = np.array(size) / 2
    short = half - np.abs(xy)  # to the edge, along x and y
    inside = (short > 0).all(axis=1)
    axis = np.argmin(short, axis=1)
    moved = np.where(xy[np.arange(len(xy)), axis] < 0, -half[axis], half[axis])
    xy[inside, axis[inside]] = moved[inside]
    n = len(across)
    k = (n * np.arange(len(rows) - 1)[:, None] + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + n, k + n + 1], 1), np.stack([k, k + n + 1, k + 1], 1)])
    faces = faces[~inside[faces].all(axis=1)]  # others would lie between points that moved to two sides of a corner
    u, v = xy[faces[:, 1]] - xy[faces[:, 0]], xy[faces[:, 2]] - xy[faces[:, 0]]
    faces = faces[np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) > 1e-9]
    height = ground(*xy.T) + LIFT + 0.001 * distance_beyond(size, *xy.T)
    up = np.tile([0, 0, 1], (len(xy), 1))
    uv: Array = xy / MATERIALS[material].repeat
    return make_mesh(material, np.column_stack([xy, height]), up, uv, faces, (material,))

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Positions in parallel rows, along lines of an environment or beside its trails, and along contours of a field."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from contourpy import contour_generator

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.fields import Boolean, Frozen, Number, Positive
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields
from fieldtruth.world.environments.layered.sections import Distance
from fieldtruth.world.environments.layout import Share
from fieldtruth.world.grids import Line, Trail
from fieldtruth.world.placement import WorldBuilder

_CORNER: Final = 4
"""Each of this number of a contour's corners, of which every cell of the grid has one, is a corner of its line."""
APART: Final = 1e-6
"""Distance [m] of a contour's corners, of which two are the same where it passes through a node of the grid."""
_BESIDE: Final = 0.2
"""Distance [m] from a contour at which its larger side is looked up."""


class Rows(Frozen):
    """Parallel rows across the world."""

    spacing: Positive  # [m] between rows
    every: Positive  # [m] along a row
    angle: Number = 0.0  # [deg] to the x axis
    offset: Number = 0.0  # [m] of all rows to the left
    jitter: Distance = 0.0  # [m], standard deviation of the position
    gaps: Share = 0.0  # share of positions that are left out


class Along(Frozen):
    """Positions along a line of the environment, along its trails, or along the contour lines of a field."""

    line: str = ""
    contours: str = ""  # a field, instead
    step: Positive = 1.0  # of the field between its contours
    every: Positive  # [m]
    offset: Number = 0.0  # [m] to the left of the line, where a field is larger; of trails from their edge, both sides
    jitter: Distance = 0.0
    gaps: Share = 0.0
    facing: Boolean = False  # headings towards the line instead of along it


def in_rows(size: tuple[float, float], rows: Rows, rng: np.random.Generator) -> Array:
    """Positions (n, 3): x, y [m] and the heading [rad] of parallel rows over a world, row by row."""
    angle, reach = np.radians(rows.angle), float(np.hypot(*size)) / 2
    aside = rows.offset - rows.spacing * round(rows.offset / rows.spacing)  # of the row that is nearest to the middle
    across = np.arange(-np.ceil(reach / rows.spacing), np.ceil(reach / rows.spacing) + 1) * rows.spacing + aside
    along = np.arange(-np.ceil(reach / rows.every), np.ceil(reach / rows.every) + 1) * rows.every
    v, u = np.meshgrid(across, along, indexing="ij")
    x, y = u * np.cos(angle) - v * np.sin(angle), u * np.sin(angle) + v * np.cos(angle)
    candidates = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, angle)])
    return _kept(candidates, size, rows.jitter, rows.gaps, rng)


def along_line(builder: WorldBuilder, fields: Fields, along: Along, rng: np.random.Generator) -> Array:
    """Positions (n, 3): x, y [m] and the heading [rad] along a line or contours, or on both sides of the trails."""
    if along.line == "trail":
        lines = beside_trails(builder.trails, along.offset)
    else:
        parts = contours(fields, along.contours, along.step) if along.contours else fields.lines[along.line].parts()
        lines = [(part, along.offset) for part in parts]
    return _kept(along_lines(lines, along), builder.size, along.jitter, along.gaps, rng)


def beside_trails(trails: Sequence[Trail], offset: float) -> list[tuple[Line, float]]:
    """Lines of trails, each with the distances [m] to its left that are ``offset`` [m] outside its edges."""
    return [
        (part, side * (trail.width / 2 + offset))
        for trail in trails
        for part in trail.line.parts()
        for side in (-1.0, 1.0)
    ]


def along_lines(lines: Sequence[tuple[Line, float]], along: Along) -> Array:
    """Positions (n, 3): x, y [m] and the heading [rad] along lines with distances [m] to their left."""
    found = [np.zeros((0, 3))]
    for line, left in lines:
        step = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line.points, axis=0), axis=1))])
        rows = np.searchsorted(step, np.arange(0.0, step[-1], along.every))
        (tx, ty), points = line.tangents[rows].T, line.points[rows]
        turn = -np.sign(left) * np.pi / 2 if along.facing else 0.0
        found.append(np.column_stack([points + left * np.column_stack([-ty, tx]), np.arctan2(ty, tx) + turn]))
    return np.concatenate(found)


def contours(fields: Fields, name: str, step: float) -> list[Line]:
    """Lines along which a field is a multiple of ``step``; to their left it is larger."""
    rule = Expression(name)
    values, lines = fields.on(rule, fields.nodes), []
    traced = contour_generator(*fields.nodes, values.T)
    for level in np.arange(np.ceil(values.min() / step), np.floor(values.max() / step) + 1) * step:
        for corners in traced.lines(level):
            kept = np.asarray(corners)[np.unique([*range(0, len(corners), _CORNER), len(corners) - 1])]
            kept = kept[np.append(True, np.hypot(*np.diff(kept, axis=0).T) > APART)]
            if len(kept) < 3:
                continue
            line = Line.through(kept)
            middle = len(line.points) // 2
            left = line.points[middle] + line.tangents[middle, ::-1] * (-_BESIDE, _BESIDE)
            lines.append(line if fields.at(rule, left[None])[0] > level else Line.through(kept[::-1]))
    return lines


def _kept(candidates: Array, size: tuple[float, float], jitter: float, gaps: float, rng: np.random.Generator) -> Array:
    """Candidates (n, 3) inside the world, moved at random, some left out."""
    candidates[:, :2] += rng.normal(0.0, jitter, (len(candidates), 2))
    inside = (np.abs(candidates[:, :2]) < np.array(size) / 2).all(axis=1)
    return np.asarray(candidates[inside & (rng.random(len(candidates)) >= gaps)])

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stems seen from the ground: circles in slices of a terrestrial or mobile laser scan about breast height.

A circle through points of a cluster, found by random sample consensus (Fischler and Bolles 1981,
doi:10.1145/358669.358692), is a stem if it has points for a third of its turn, few beside it and hardly any inside, as
no bush is, and if the slice above has about the same circle, which is not asked where nearly the whole turn was seen.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.core.geodesy import Origin
from fieldtruth.maps.canopy import Canopy, height_of, plane
from fieldtruth.maps.elevation import metres_of_points, read_ground_points
from fieldtruth.maps.trees import SLENDER, Tree

SLICES: Final = ((1.0, 1.6), (1.6, 2.2))
"""Heights [m] above the ground of the slice about breast height, and of the one above it."""
FINE: Final = 0.26
"""Side [m] of the cells of a canopy below which its scan may be dense enough."""
DENSE: Final = 20.0
"""Points of the lower slice to the square metre of its area, from which stems can be seen in it."""
_GRAIN: Final = 0.01
"""Side [m] of cells of which one point is kept."""
_APART: Final = 0.08
"""Distance [m] between two points of one cluster."""
_RADII: Final = (0.025, 0.8)
"""Least and greatest radius [m] of a stem."""
_ROUGH: Final = 0.025, 0.06
"""Distance [m] from a circle at which a point is on it: noise of the scan and bark, and a share of the radius."""
_SHARE: Final = 0.45
"""Share of the points within and about a circle that are on it, at least."""
_MORE: Final = 0.3
"""Share by which they are more than points that lie anywhere would be."""
_TURN: Final = 1 / 3, 0.8
"""Share of a circle's turn with points, and that from which branches may hide it in the slice above."""
_LEAST: Final = 12
"""Points of a stem in a slice."""
_TRIES, _MOST = 150, 4000
"""Circles that are tried in half a square metre of a cluster, and in a whole one at most."""
_REACH: Final = 0.1
"""Least distance [m] within which the points of a circle are drawn; the greatest is that of the largest stem."""
_ROUNDS, _FINEST = 4, 0.002
"""Fits to the points about the best of them, and least median distance [m] of these from it."""
_SLIM: Final = 150.0
"""Height of a tree over the diameter of its stem, at most."""
_LEAN: Final = 0.15
"""Distance [m] between the circles of the two slices, and share of the radius by which they may differ."""


class Circle(NamedTuple):
    """A circle in world x and y [m], and the share of its turn that was seen."""

    x: float
    y: float
    radius: float
    turn: float = 1.0


def find_stems(points: Array, rng: np.random.Generator) -> list[Circle]:
    """Cross sections of stems at breast height, in points (n, 3): world x, y and height above the ground [m]."""
    lower, upper = (_circles(points[(points[:, 2] >= low) & (points[:, 2] < high), :2], rng) for low, high in SLICES)
    return [circle for circle in lower if circle.turn >= _TURN[1] or any(_goes_on(circle, each) for each in upper)]


def _goes_on(circle: Circle, above: Circle) -> bool:
    """Whether two circles of the slices are one stem."""
    away = np.hypot(above.x - circle.x, above.y - circle.y)
    return bool(away < _LEAN and abs(above.radius - circle.radius) < max(2 * _LEAN * circle.radius, 0.02))


def read_stems(
    path: Path, origin: Origin, size: tuple[float, float], *, crs: str | None = None, canopy: Canopy | None = None
) -> list[Circle]:
    """Cross sections of stems in a LAS or LAZ file within a world; none in one without a dense slice, as from the air.

    ``canopy`` is that of the scan, which is not read again if its cells are coarse; other arguments and errors are
    those of ``canopy.read_canopy_points``.
    """
    import laspy

    if canopy is not None and np.sqrt(canopy.cell_area) > FINE:
        return []
    ground = read_ground_points(path, origin, size, crs=crs, reference="ellipsoid")
    (to_world, _, _), metres = plane(ground.crs, origin, size), metres_of_points(ground.crs)
    slices, half = [np.zeros((0, 3))], np.array(size) / 2
    with laspy.open(path) as reader:
        for points in reader.chunk_iterator(2_000_000):
            kept = ~np.isin(np.asarray(points.classification), (2, 7, 18))
            east, north, z = (np.asarray(each)[kept] for each in (points.x, points.y, points.z))
            xy = (to_world @ np.stack([east, north, np.ones(len(z))])).T
            above = z * metres - height_of(ground, ground.crs, east, north)
            inside = (np.abs(xy) <= half).all(axis=1) & (above >= SLICES[0][0]) & (above < SLICES[1][1])
            slices.append(np.column_stack([xy, above])[inside])
    found = np.concatenate(slices)
    return find_stems(found, np.random.default_rng(0)) if is_dense(found) else []


def is_dense(points: Array) -> bool:
    """Whether points (n, 3), as of ``find_stems``, are dense enough to show stems."""
    low, high = SLICES[0]
    inside = points[(points[:, 2] >= low) & (points[:, 2] < high), :2]
    return len(inside) > DENSE * len(np.unique(np.floor(inside), axis=0)) > 0


def _circles(xy: Array, rng: np.random.Generator) -> list[Circle]:
    """Stems in a slice's points (n, 2)."""
    xy = xy[np.unique(np.floor(xy / _GRAIN).astype(np.int64), axis=0, return_index=True)[1]]
    circles = []
    for rows in _clusters(xy):
        points = xy[rows]
        while len(points) >= _LEAST and (circle := _stem(points, rng)) is not None:
            circles.append(circle)
            points = points[_off(circle, points) > max(0.5 * circle.radius, 0.1)]  # of two stems in one cluster
    return circles


def _clusters(xy: Array) -> Iterator[Index]:
    """Yield the rows of points (n, 2) that are near each other, by way of the cells that they occupy."""
    if not len(xy):
        return
    cells, number = np.unique(np.floor(2 * xy / _APART).astype(np.int64), axis=0, return_inverse=True)
    pairs = cKDTree(cells).query_pairs(2.01, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(cells), len(cells)))
    count, component = connected_components(graph, directed=False)
    of_point = component[number.reshape(-1)]
    order = np.argsort(of_point, kind="stable")
    for rows in np.split(order, np.cumsum(np.bincount(of_point, minlength=count))[:-1]):
        if len(rows) >= _LEAST:
            yield rows


def _tolerance(radius: float) -> float:
    return max(_ROUGH[0], _ROUGH[1] * radius)


def _off(circle: Circle, points: Array) -> Array:
    """Distance [m] of points (n, 2) outwards from a circle."""
    return np.hypot(points[:, 0] - circle.x, points[:, 1] - circle.y) - circle.radius


def _stem(points: Array, rng: np.random.Generator) -> Circle | None:
    """A stem in a cluster's points (n, 2), that of most points, or None.

    The points of a circle are drawn near each other, at distances of stems of all sizes: in undergrowth three points of
    the whole cluster would never be of one stem.
    """
    tree, best, most = cKDTree(points), None, 0.0
    area = len(np.unique(np.floor(points / 0.5), axis=0)) / 4
    tries = int(min(_TRIES * max(1.0, 2.0 * area), _MOST))
    reach = np.exp(rng.uniform(np.log(_REACH), np.log(2.0 * _RADII[1]), tries))
    for at, near in zip(rng.integers(len(points), size=tries).tolist(), reach.tolist(), strict=True):
        rows = tree.query_ball_point(points[at], near)
        if len(rows) < 3:
            continue
        circle = through(points[rng.choice(rows, 3, replace=False)])
        if circle is None:
            continue
        around = points[tree.query_ball_point(circle[:2], circle.radius + 2.0 * _tolerance(circle.radius))]
        on, turn = _on(circle, around)
        score = on.sum() * turn  # a branch is part of a large circle, of which it is a short arc
        if score > most and _checked(circle, around) is not None:
            best, most = circle, float(score)
    return None if best is None else _refined(best, points)


def _refined(circle: Circle, points: Array) -> Circle | None:
    """The circle fitted to the points (n, 2) about it; None if that is no stem."""
    best: Circle | None = circle
    for _ in range(_ROUNDS):
        if best is None:
            return None
        off = np.abs(_off(best, points))
        on = _on(best, points)[0]
        if not on.any():
            return None
        best = through(points[off < 2.5 * max(np.median(off[on]), _FINEST)])
    return None if best is None else _checked(best, points)


def through(points: Array) -> Circle | None:
    """Circle through points (n, 2), three or more, by least squares (Kåsa 1976); None if it is no stem's."""
    if len(points) < 3:
        return None
    middle = points.mean(axis=0)
    own = points - middle
    matrix = np.column_stack([2.0 * own, np.ones(len(own))])
    (x, y, rest), _, rank, _ = np.linalg.lstsq(matrix, (own**2).sum(axis=1), rcond=None)
    radius = float(np.sqrt(max(rest + x * x + y * y, 0.0)))
    if rank < 3 or not _RADII[0] <= radius <= _RADII[1]:
        return None
    return Circle(float(x + middle[0]), float(y + middle[1]), radius)


def _on(circle: Circle, points: Array) -> tuple[Mask, float]:
    """Mask of the points (n, 2) that are on a circle, and the share of its turn that has some."""
    on = np.abs(_off(circle, points)) < _tolerance(circle.radius)
    around = np.arctan2(points[on, 1] - circle.y, points[on, 0] - circle.x)
    return on, len(np.unique(np.floor(around / np.radians(15.0)))) / 24


def _checked(circle: Circle, points: Array) -> Circle | None:
    """The circle with its turn, if points (n, 2) about it are those of a stem."""
    off, tolerance = _off(circle, points), _tolerance(circle.radius)
    on, turn = _on(circle, points)
    near, inside = off < 2 * tolerance, off < -2 * tolerance
    even = 4.0 * circle.radius * tolerance / (circle.radius + 2.0 * tolerance) ** 2  # share of points that lie anywhere
    enough = on.sum() >= max(_LEAST, max(_SHARE, even + _MORE) * near.sum()) and inside.sum() < 0.2 * on.sum()
    return circle._replace(turn=turn) if enough and turn >= _TURN[0] else None


def with_stems(trees: Sequence[Tree], stems: Sequence[Circle], canopy: Canopy) -> list[Tree]:
    """Trees of a canopy moved to the stems below their crowns, and one for each further stem.

    From the highest on, each has the nearest free stem within its crown that is thick enough for it; other stems bear
    trees that the canopy hides, as high as it is there, and trees without a stem stay as they are.
    """
    at = np.array([stem[:2] for stem in stems]).reshape(-1, 2)
    made, tree_of, free = list[Tree](), cKDTree(at), np.ones(len(stems), np.bool_)
    for tree in sorted(trees, key=lambda each: -(each.height or 0.0)):
        below = tree_of.query_ball_point((tree.x, tree.y), max(tree.crown_radius or 0.0, 1.0))
        fit = [k for k in below if free[k] and 2.0 * stems[k].radius * _SLIM >= (tree.height or 0.0)]
        if fit:
            k = min(fit, key=lambda row: float(np.hypot(*(at[row] - (tree.x, tree.y)))))
            free[k] = False
            tree = tree._replace(x=stems[k].x, y=stems[k].y, diameter=2.0 * stems[k].radius)
        made.append(tree)
    inverse = np.linalg.inv(canopy.world_from_cell[:, :2])
    for stem in (stem for stem, left in zip(stems, free, strict=True) if left):
        row, column = np.rint(inverse @ (np.array(stem[:2]) - canopy.world_from_cell[:, 2])).astype(int)
        if 0 <= row < canopy.heights.shape[0] and 0 <= column < canopy.heights.shape[1]:
            height = min(float(canopy.heights[row, column]), 2.0 * stem.radius * _SLIM)
            if height > SLICES[1][1]:
                made.append(Tree(stem.x, stem.y, height, SLENDER * height, 2.0 * stem.radius, None))
    return made

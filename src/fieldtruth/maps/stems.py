# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stems seen from the ground: circles in slices of a terrestrial or mobile laser scan about breast height.

Points of a slice that are near each other are one thing; it is a stem if a circle of about the same radius and place
passes through most of its points (random sample consensus, Fischler and Bolles 1981, doi:10.1145/358669.358692) in the
slice about breast height and in the one above, for a third of its turn at least, and is empty inside, as no bush is.
"""

from collections.abc import Iterable, Iterator, Sequence
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
from fieldtruth.maps.trees import Tree

SLICES: Final = ((1.0, 1.6), (1.6, 2.2))
"""Heights [m] above the ground of the slice about breast height, and of the one above it."""
SCANNED: Final = 60.0
"""Points of a scan to the square unit of its map, of which fewer have no slice as dense as ``DENSE``."""
DENSE: Final = 20.0
"""Points of the lower slice to the square metre of its area, from which stems can be seen in it."""
_GRAIN: Final = 0.01
"""Side [m] of cells of which one point is kept."""
_APART: Final = 0.08
"""Distance [m] between two points of one thing."""
_RADII: Final = (0.025, 0.8)
"""Least and greatest radius [m] of a stem."""
_ROUGH: Final = 0.025, 0.06
"""Distance [m] from a circle at which a point is on it: noise of the scan and bark, and a share of the radius."""
_SHARE: Final = 0.45
"""Share of the points within and about a circle that are on it."""
_TURN: Final = 1 / 3, 0.8
"""Share of a circle's turn with points, and that from which branches may hide it in the slice above."""
_LEAST: Final = 12
"""Points of a stem in a slice."""
_TRIES, _ROUNDS, _FINEST = 150, 4, 0.002
"""Circles that are tried, fits to the points about the best of them, and least median distance [m] of these from it."""
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


def read_stems(path: Path, origin: Origin, size: tuple[float, float], *, crs: str | None = None) -> list[Circle]:
    """Cross sections of stems in a LAS or LAZ file with a world; none in one without a dense slice, as from the air.

    Arguments and errors are those of ``read_ground_points``.
    """
    import laspy

    with laspy.open(path) as reader:
        header = reader.header
        if header.point_count < SCANNED * np.prod(header.maxs[:2] - header.mins[:2]):
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
    for rows in _things(xy):
        points = xy[rows]
        while len(points) >= _LEAST and (circle := _stem(points, rng)) is not None:
            circles.append(circle)
            points = points[_off(circle, points) > max(0.5 * circle.radius, 0.1)]  # of two stems in one thing
    return circles


def _things(xy: Array) -> Iterator[Index]:
    """Yield the rows of points (n, 2) that are near each other."""
    pairs = cKDTree(xy).query_pairs(_APART, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(xy), len(xy)))
    count, number = connected_components(graph, directed=False)
    order = np.argsort(number, kind="stable")
    for rows in np.split(order, np.cumsum(np.bincount(number, minlength=count))[:-1]):
        if len(rows) >= _LEAST:
            yield rows


def _tolerance(radius: float) -> float:
    return max(_ROUGH[0], _ROUGH[1] * radius)


def _off(circle: Circle, points: Array) -> Array:
    """Distance [m] of points (n, 2) outwards from a circle."""
    return np.hypot(points[:, 0] - circle.x, points[:, 1] - circle.y) - circle.radius


def _stem(points: Array, rng: np.random.Generator) -> Circle | None:
    """The circle through most of a thing's points (n, 2); None if they are no stem."""
    best: Circle | None = None
    most = 0.0
    for _ in range(_TRIES):
        circle = through(points[rng.choice(len(points), 3, replace=False)])
        if circle is not None:
            on, turn = _on(circle, points)
            if on.sum() * turn > most:  # a branch is part of a large circle, of which it is a short arc
                best, most = circle, float(on.sum() * turn)
    for _ in range(_ROUNDS):
        if best is None:
            return None
        off = np.abs(_off(best, points))
        spread = np.median(off[_on(best, points)[0]])
        best = through(points[off < 2.5 * max(spread, _FINEST)])
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
    """The circle with its turn, if a thing's points (n, 2) are a stem."""
    off, tolerance = _off(circle, points), _tolerance(circle.radius)
    on, turn = _on(circle, points)
    near, inside = off < 2 * tolerance, off < -2 * tolerance
    enough = on.sum() >= max(_LEAST, _SHARE * near.sum()) and inside.sum() < 0.2 * on.sum()
    return circle._replace(turn=turn) if enough and turn >= _TURN[0] else None


def with_stems(trees: Sequence[Tree], stems: Iterable[Circle], canopy: Canopy) -> list[Tree]:
    """Trees of a canopy moved to the stems below their crowns, and one for each further stem.

    From the highest top down, each has the nearest free stem within its crown; other stems bear trees that the canopy
    hides, as high as it is there, and tops without a stem stay as they are.
    """
    left, made = list(stems), list[Tree]()
    for tree in sorted(trees, key=lambda each: -(each.height or 0.0)):
        away = [np.hypot(stem.x - tree.x, stem.y - tree.y) for stem in left]
        if left and min(away) <= max(tree.crown_radius or 0.0, 1.0):
            stem = left.pop(int(np.argmin(away)))
            tree = tree._replace(x=stem.x, y=stem.y, diameter=2.0 * stem.radius)
        made.append(tree)
    inverse = np.linalg.inv(canopy.world_from_cell[:, :2])
    for stem in left:
        row, column = np.rint(inverse @ (np.array(stem[:2]) - canopy.world_from_cell[:, 2])).astype(int)
        if 0 <= row < canopy.heights.shape[0] and 0 <= column < canopy.heights.shape[1]:
            height = float(canopy.heights[row, column])
            if height > SLICES[1][1]:
                made.append(Tree(stem.x, stem.y, height, None, 2.0 * stem.radius, None))
    return made

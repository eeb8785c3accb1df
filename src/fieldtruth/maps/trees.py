# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trees seen from above: tops and crowns in the heights of a canopy.

A tree's top is the highest place within a window that grows with its height, the width of a crown of that height
(Popescu and Wynne 2004, doi:10.14358/PERS.70.5.589). A crown is what drains from its top, if the canopy is turned
upside down: the watershed controlled by markers (Meyer and Beucher 1990, doi:10.1016/1047-3203(90)90014-M). It is
computed as the forest of the highest passes between basins, which is the same (Cousty et al. 2009,
doi:10.1109/TPAMI.2008.173).
"""

from collections.abc import Sequence
from itertools import product
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from fieldtruth.core.arrays import Array, Float32Array, Index, Mask
from fieldtruth.maps.canopy import Canopy

CROWN_WIDTH: Final = (2.51503, 0.0, 0.00901)
"""Width [m] of a crown over height h [m], a + b h + c h²: Popescu and Wynne's for mixed forest.

Theirs are (3.09632, 0, 0.00895) for deciduous forest and (3.75105, -0.17919, 0.01241) for pines.
"""
LOWEST: Final = 2.0
"""Height [m] below which vegetation is no tree."""
_EXCLUDED: Final = 0.3
"""Share of a tree's height below which there is no crown (Silva et al. 2016, doi:10.1080/07038992.2016.1196582)."""
_WIDEST: Final = 0.6
"""Largest radius of a crown, as a share of its tree's height (Silva et al. 2016)."""
_SMOOTHED: Final = 0.3
"""Standard deviation [m] of the smoothing that keeps single branches from being tops."""


class Tree(NamedTuple):
    """A tree of a map; what a map leaves out is missing, as None."""

    x: float
    """Position [m] in the world frame."""
    y: float
    height: float | None
    """[m] above the ground."""
    crown_radius: float | None
    """[m], of a circle."""
    diameter: float | None
    """[m] of the stem at breast height."""
    species: str | None
    """As the map has it: a species, a genus or a group."""


def find_trees(
    canopy: Canopy,
    *,
    crown_width: tuple[float, float, float] = CROWN_WIDTH,
    lowest: float = LOWEST,
    smoothing: float = _SMOOTHED,
) -> list[Tree]:
    """Trees of a canopy that stand within its world, from the tallest to the lowest.

    Trees below the crown of another are not seen; heights are those of the canopy's cells, so they miss the tip of a
    conifer between two returns.

    Args:
        canopy: heights above the ground.
        crown_width: a, b, c of the width [m] of the window, a + b h + c h², for a place of height h [m].
        lowest: height [m] of the smallest tree.
        smoothing: standard deviation [m] of the smoothing before tops are sought.
    """
    matrix = canopy.world_from_cell[:, :2]
    widths = np.hypot(*matrix)
    smooth = gaussian_filter(canopy.heights, smoothing / widths, mode="nearest", truncate=3.0)
    tops = _tops(smooth, matrix, np.array(crown_width), lowest)
    if not len(tops):
        return []
    height = maximum_filter(canopy.heights, size=3).ravel()[tops]
    areas = _crown_areas(smooth, matrix, tops, height, lowest) * canopy.cell_area
    rows, columns = np.unravel_index(tops, smooth.shape)
    places = canopy.world_from_cell @ np.stack([rows, columns, np.ones(len(tops))])
    inside = np.all(np.abs(places) <= np.array(canopy.size)[:, None] / 2, axis=0)
    return [
        Tree(float(x), float(y), float(h), float(np.sqrt(area / np.pi)), None, None)
        for (x, y), h, area, kept in zip(places.T, height, areas, inside, strict=True)
        if kept
    ]


_DEEPENS: Final = 0.45
"""Share of a tree's height by which its crown is lower at its edge than at its top: of a paraboloid."""
SLENDER: Final = 0.11
"""Radius of the crown of a tree among others, as a share of its height."""
_LEVEL: Final = 0.8
"""Share of the highest cell around it that the top of such a tree has, at least."""
_UNSEEN: Final = (2.5, 0.2)
"""Least height [m], and share of the canopy's height, by which known crowns are too low where another tree stands."""


def fill_canopy(canopy: Canopy, trees: Sequence[Tree], *, lowest: float = LOWEST) -> list[Tree]:
    """Lower trees, without which the canopy would be lower than it is, from the highest to the lowest.

    A window for tops finds one tree where several stand close together, and none in a gap that saplings and bushes
    fill. From the highest cell down, one is added wherever the crowns so far, as paraboloids, are clearly below the
    canopy: analysis by synthesis.
    """
    matrix, heights = canopy.world_from_cell[:, :2], canopy.heights
    inverse, shape = np.linalg.inv(matrix), heights.shape
    known = np.zeros(shape)
    for tree in trees:
        row, column = np.rint(inverse @ (np.array([tree.x, tree.y]) - canopy.world_from_cell[:, 2])).astype(int)
        _raise_crown(known, (int(row), int(column)), tree.height or 0.0, tree.crown_radius or 0.0, matrix)
    added = []
    # At the edge of a crown, cells are as high as a lower tree; it has its top among cells of about one height.
    level = heights >= _LEVEL * maximum_filter(heights, size=3)
    cells = np.flatnonzero((level & (heights >= lowest)).ravel())
    for cell in cells[np.argsort(-heights.ravel()[cells], kind="stable")].tolist():
        row, column = divmod(cell, shape[1])
        height = float(heights[row, column])
        if known[row, column] < height - max(_UNSEEN[0], _UNSEEN[1] * height):
            x, y = canopy.world_from_cell @ (row, column, 1.0)
            radius = max(SLENDER * height, 0.5)
            _raise_crown(known, (row, column), height, radius, matrix)
            if abs(x) <= canopy.size[0] / 2 and abs(y) <= canopy.size[1] / 2:
                added.append(Tree(float(x), float(y), height, radius, None, None))
    return added


def _raise_crown(known: Array, cell: tuple[int, int], height: float, radius: float, matrix: Array) -> None:
    """Raise heights to those of a tree's crown about a cell, which may be outside."""
    reach = np.ceil(radius * np.linalg.norm(np.linalg.inv(matrix), axis=1)).astype(int)
    rows, columns = (
        np.arange(max(0, at - n), max(0, min(size, at + n + 1)))
        for at, n, size in zip(cell, reach, known.shape, strict=True)
    )
    steps = np.stack(np.meshgrid(rows - cell[0], columns - cell[1], indexing="ij"))
    away = np.hypot(*np.tensordot(matrix, steps, 1)) / max(radius, 1e-6)
    own = np.where(away <= 1.0, height * (1.0 - _DEEPENS * away**2), 0.0)
    window = np.ix_(rows, columns)
    known[window] = np.maximum(known[window], own)


def _tops(heights: Float32Array, matrix: Array, crown_width: Array, lowest: float) -> Index:
    """Flat indices of the cells that are the highest within the window of their height, from the highest down.

    Of cells with the same height, the first one is the higher.
    """
    around = maximum_filter(heights, size=3, mode="constant", cval=-np.inf)
    cells = np.flatnonzero((heights >= around) & (heights >= lowest))
    cells = cells[np.argsort(-heights.ravel()[cells], kind="stable")]
    h = heights.ravel()[cells]
    radius = np.maximum(np.polynomial.polynomial.polyval(h, crown_width) / 2, np.hypot(*matrix).max())
    offsets, distances = _offsets(matrix, float(radius.max(initial=0.0)))
    row, column = np.divmod(cells, heights.shape[1])
    for (down, right), distance in zip(offsets, distances, strict=True):
        r, c = row + down, column + right
        inside = (r >= 0) & (r < heights.shape[0]) & (c >= 0) & (c < heights.shape[1])
        other = heights[np.where(inside, r, row), np.where(inside, c, column)]
        before = down < 0 or (down == 0 and right < 0)
        beaten = inside & (distance <= radius) & ((other > h) | ((other == h) & before))
        if beaten.any():
            row, column, h, radius, cells = (each[~beaten] for each in (row, column, h, radius, cells))
    return cells


def _offsets(matrix: Array, radius: float) -> tuple[Index, Array]:
    """(Rows, columns) (n, 2) from a cell to those within a radius [m], the nearest first, and their distances [m]."""
    reach = np.ceil(radius * np.linalg.norm(np.linalg.inv(matrix), axis=1)).astype(int)
    offsets = np.array(list(product(*(range(-n, n + 1) for n in reach))))
    distances = np.hypot(*(matrix @ offsets.T))
    order = np.argsort(distances, kind="stable")
    order = order[(distances[order] > 0.0) & (distances[order] <= radius)]
    return offsets[order], distances[order]


def _crown_areas(heights: Float32Array, matrix: Array, tops: Index, height: Float32Array, lowest: float) -> Array:
    """Number of cells (n,) of the crown of each top, a tree of that height [m]."""
    inside = heights >= lowest
    tree = _watershed(heights, inside, tops)
    cells = np.flatnonzero(tree >= 0)
    tree = tree[cells]
    top = height[tree]
    step = np.array(np.divmod(cells, heights.shape[1])) - np.array(np.divmod(tops, heights.shape[1]))[:, tree]
    crown = (heights.ravel()[cells] >= _EXCLUDED * top) & (np.hypot(*(matrix @ step)) <= _WIDEST * top)
    return np.bincount(tree[crown], minlength=len(tops)).astype(np.float64)


def _watershed(heights: Float32Array, inside: Mask, tops: Index) -> Index:
    """Number of the top to which each cell (flat) belongs, -1 outside or without one."""
    basin, summits = _basins(heights, inside)
    first, second, passes = _passes(heights, basin)
    n = len(summits)
    weight = 2.0 + float(passes.max(initial=0.0)) - passes  # the highest pass first
    marked = basin.ravel()[tops]
    rows = np.concatenate([first, np.full(len(tops), n)])
    columns = np.concatenate([second, marked])
    graph = coo_array((np.concatenate([weight, np.ones(len(tops))]), (rows, columns)), shape=(n + 1, n + 1))
    forest = minimum_spanning_tree(graph.tocsr()).tocoo()
    kept = (forest.row < n) & (forest.col < n)
    edges = coo_array((forest.data[kept], (forest.row[kept], forest.col[kept])), shape=(n, n))
    number, component = connected_components(edges, directed=False)
    names = np.full(number + 1, -1, np.intp)
    names[component[marked]] = np.arange(len(tops))
    return np.asarray(names[np.append(component, number)][basin.ravel()])


def _shifted(shape: Sequence[int], step: Sequence[int]) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Slices of an image's cells that have a neighbour at a step (row, column), and of those neighbours."""
    rows, columns = (
        (slice(max(0, -s), n - max(0, s)), slice(max(0, s), n - max(0, -s))) for s, n in zip(step, shape, strict=True)
    )
    return (rows[0], columns[0]), (rows[1], columns[1])


def _basins(heights: Float32Array, inside: Mask) -> tuple[Index, Index]:
    """Number (rows, columns) of the summit that one reaches from each cell by the steepest way, -1 outside; summits."""
    index = np.arange(heights.size, dtype=np.intp).reshape(heights.shape)
    upward, best = index.copy(), heights.copy()
    for step in product((-1, 0, 1), repeat=2):
        if step == (0, 0):
            continue
        here, there = _shifted(heights.shape, step)
        higher = (heights[there] > best[here]) | ((heights[there] == best[here]) & (index[there] < upward[here]))
        best[here][higher] = heights[there][higher]
        upward[here][higher] = index[there][higher]
    goal = upward.ravel()
    while not np.array_equal(further := goal[goal], goal):
        goal = further
    summits, basin = np.unique(goal[inside.ravel()], return_inverse=True)
    numbers = np.full(heights.size, -1, np.intp)
    numbers[inside.ravel()] = basin
    return numbers.reshape(heights.shape), summits


def _passes(heights: Float32Array, basin: Index) -> tuple[Index, Index, Array]:
    """Pairs of neighbouring basins, each once, and the height [m] of the highest pass between them."""
    pairs, heights_of = [], []
    for step in ((0, 1), (1, -1), (1, 0), (1, 1)):
        here, there = _shifted(heights.shape, step)
        border = (basin[here] != basin[there]) & (basin[here] >= 0) & (basin[there] >= 0)
        pairs.append(np.sort(np.stack([basin[here][border], basin[there][border]], axis=-1), axis=-1))
        heights_of.append(np.minimum(heights[here][border], heights[there][border]))
    pair, height = np.concatenate(pairs), np.concatenate(heights_of).astype(np.float64)
    order = np.lexsort((-height, pair[:, 1], pair[:, 0]))
    pair, height = pair[order], height[order]
    first = np.ones(len(pair), bool)
    first[1:] = (pair[1:] != pair[:-1]).any(axis=1)
    return pair[first, 0], pair[first, 1], height[first]

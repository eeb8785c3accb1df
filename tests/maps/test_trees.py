# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trees from above: forests whose trees are known, rated by what is found of them; crowns against a flooding."""

import heapq
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from fieldtruth.maps.canopy import Canopy
from fieldtruth.maps.trees import CROWN_WIDTH, Tree, _watershed, fill_canopy, find_trees

SIDE = 100.0


def forest(rng: np.random.Generator, cover: float, overlap: float) -> Any:
    """Trees (n, 5): x, y, height, crown's radius [m], and 1 if it is a cone, 0 if a paraboloid.

    The crowns' areas are ``cover`` of the ground's; two of them overlap by ``overlap`` of their radii at most.
    """
    trees = np.zeros((0, 5))
    while np.pi * (trees[:, 3] ** 2).sum() < cover * SIDE**2:
        x, y = rng.uniform(-SIDE / 2, SIDE / 2, 2)
        height = rng.uniform(6.0, 30.0)
        radius = np.polynomial.polynomial.polyval(height, CROWN_WIDTH) / 2 * rng.uniform(0.85, 1.3)
        if (np.hypot(trees[:, 0] - x, trees[:, 1] - y) >= (trees[:, 3] + radius) * (1.0 - overlap)).all():
            trees = np.vstack([trees, np.array((x, y, height, radius, rng.integers(2)))])
    return trees


def heights(trees: Any, x: Any, y: Any) -> Any:
    """Height [m] of the canopy at places of any shape; crowns begin at 0.4 of a tree's height."""
    h = np.zeros(np.broadcast(x, y).shape)
    for east, north, height, radius, cone in trees:
        r = np.hypot(x - east, y - north) / radius
        h = np.maximum(h, np.where(r <= 1.0, height * (1.0 - 0.6 * np.where(cone, r, r * r)), 0.0))
    return h


def canopy(trees: Any, cell: float = 0.5, matrix: Any = ((1.0, 0.0), (0.0, 1.0)), reach: float = SIDE / 2) -> Canopy:
    """A canopy on a grid whose cells have the sides cell * matrix."""
    n = int(2 * reach / cell)
    step = cell * np.array(matrix)
    grid = np.column_stack([step, -step @ [(n - 1) / 2, (n - 1) / 2]])
    index = np.stack([*np.meshgrid(range(n), range(n), indexing="ij"), np.ones((n, n))])
    return Canopy(Path("a"), heights(trees, *np.tensordot(grid, index, 1)).astype(np.float32), grid, (SIDE, SIDE))


class Rating(NamedTuple):
    """What is found of known trees; errors are those of the trees found."""

    found: float
    false: float
    height_bias: float
    height_worst: float
    radius_bias: float
    radius_spread: float


def rating(trees: Any, found: list[Tree]) -> Rating:
    """A tree is found if a top, the first one, is within 0.6 of its crown's radius, and it is the nearest tree."""
    nearest = cKDTree(trees[:, :2]).query(np.array([(t.x, t.y) for t in found]))
    pairs: dict[int, Tree] = {}
    for distance, k, tree in zip(*nearest, found, strict=True):
        if distance < 0.6 * trees[k, 3]:
            pairs.setdefault(int(k), tree)
    known = trees[list(pairs)]
    height = np.array([t.height for t in pairs.values()]) - known[:, 2]
    radius = np.array([t.crown_radius for t in pairs.values()]) / known[:, 3] - 1.0
    false = (len(found) - len(pairs)) / len(found)
    return Rating(
        len(pairs) / len(trees), false, height.mean(), np.abs(height).max(), radius.mean(), float(radius.std())
    )


@pytest.mark.parametrize(
    ("cover", "overlap", "cell", "most_missed", "height", "radius"),
    [
        (0.3, 0.0, 0.5, 0.01, 0.45, 0.08),
        (0.6, 0.1, 0.5, 0.08, 0.45, 0.09),
        (0.6, 0.1, 1.0, 0.08, 0.9, 0.14),
        (0.9, 0.25, 0.5, 0.38, 0.45, 0.13),
    ],
)
def test_the_trees_of_forests_are_found(
    cover: float, overlap: float, cell: float, most_missed: float, height: float, radius: float
) -> None:
    for seed in range(1):
        trees = forest(np.random.default_rng(seed), cover, overlap)
        rated = rating(trees, find_trees(canopy(trees, cell)))
        assert rated.found >= 1.0 - most_missed
        assert rated.false == 0.0
        assert -height < rated.height_bias < 0.0  # the middle of a cell is seldom at the tip of a cone
        assert rated.height_worst < 3.2 * cell  # cones fall by three metres in one
        assert abs(rated.radius_bias) < 0.07
        assert rated.radius_spread < radius


def test_a_tree_on_a_turned_and_stretched_grid_is_the_same_tree() -> None:
    known = np.array([(3.0, -7.0, 20.0, 3.2, 0.0), (12.0, 5.0, 9.0, 1.8, 1.0)])
    turned = ((0.8, 0.9), (-0.6, 1.2))
    for matrix in (((1.0, 0.0), (0.0, 1.0)), turned):
        found = find_trees(canopy(known, 0.25, matrix, reach=30.0))
        assert len(found) == 2
        for tree, (x, y, height, radius, _) in zip(found, known, strict=True):
            assert np.hypot(tree.x - x, tree.y - y) < 0.25
            assert tree.height == pytest.approx(height, abs=0.6)
            assert tree.crown_radius == pytest.approx(radius, rel=0.06)
            assert (tree.diameter, tree.species) == (None, None)


def test_the_window_decides_which_tops_are_trees() -> None:
    two = np.array([(0.0, -2.0, 20.0, 2.2, 0.0), (0.0, 2.0, 19.0, 2.2, 0.0)])  # 4 m apart; a window is 6 m wide
    assert len(find_trees(canopy(two, 0.25))) == 2
    wide = (12.0, 0.0, 0.0)
    assert [round(t.y) for t in find_trees(canopy(two, 0.25), crown_width=wide)] == [-2]


def test_bare_and_low_and_even_ground_has_no_trees() -> None:
    assert find_trees(canopy(np.zeros((0, 5)))) == []
    low = np.random.default_rng(0).uniform(0.0, 1.9, (200, 200)).astype(np.float32)
    grid = np.array([[0.5, 0.0, -50.0], [0.0, 0.5, -50.0]])
    assert find_trees(Canopy(Path("a"), low, grid, (SIDE, SIDE))) == []


def test_a_crown_ends_in_the_scrub_about_it() -> None:
    tree = np.array([(0.0, 0.0, 7.0, 1.5, 0.0), (0.0, 0.0, 3.0, 60.0, 1.0)])  # the scrub is a wide, flat cone
    found = find_trees(canopy(tree, 0.25))
    assert [each.crown_radius for each in found] == [pytest.approx(0.6 * 7.0, rel=0.02)]  # the widest of its height


def test_trees_beyond_the_world_are_left_out() -> None:
    trees = np.array([(49.0, 0.0, 15.0, 2.0, 0.0), (51.0, 10.0, 15.0, 2.0, 0.0)])
    assert [round(t.x) for t in find_trees(canopy(trees, reach=60.0))] == [49]


def test_the_same_canopy_gives_the_same_trees_and_equal_tops_one() -> None:
    trees = forest(np.random.default_rng(5), 0.6, 0.1)
    steps = canopy(trees)
    even = Canopy(steps.source, np.round(steps.heights), steps.world_from_cell, steps.size)  # full of equal cells
    first, second = find_trees(even, smoothing=0.0), find_trees(even, smoothing=0.0)
    assert first == second
    assert rating(trees, first).false == 0.0


def flooded(image: Any, inside: Any, tops: Any) -> Any:
    """The watershed by Meyer's flooding, of the image upside down, cell by cell from the highest one down."""
    owner = np.full(image.shape, -1)
    queue: list[tuple[float, int, int, int]] = []
    for number, (row, column) in enumerate(tops):
        owner[row, column] = number
        heapq.heappush(queue, (-image[row, column], len(queue), row, column))
    pushed = len(queue)
    while queue:
        _, _, row, column = heapq.heappop(queue)
        for r in range(max(row - 1, 0), min(row + 2, image.shape[0])):
            for c in range(max(column - 1, 0), min(column + 2, image.shape[1])):
                if inside[r, c] and owner[r, c] < 0:
                    owner[r, c] = owner[row, column]
                    heapq.heappush(queue, (-image[r, c], pushed, r, c))
                    pushed += 1
    return owner


@pytest.mark.parametrize("seed", range(4))
def test_crowns_are_those_of_a_flooding_from_the_tops(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = (gaussian_filter(rng.normal(size=(80, 90)), 2.0) * 50.0).astype(np.float32)
    inside: Any = image > np.quantile(image, 0.3)
    tops = np.flatnonzero(inside)[rng.choice(inside.sum(), 12, replace=False)]
    # A marker that is not a summit cuts its own basin, which flooding and basins do differently: climb first.
    for k, top in enumerate(tops):
        row, column = divmod(int(top), 90)
        while True:
            block = image[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
            r, c = np.unravel_index(block.argmax(), block.shape)
            above = max(row - 1, 0) + int(r), max(column - 1, 0) + int(c)
            if above == (row, column):
                break
            row, column = above
        tops[k] = row * 90 + column
    tops = np.unique(tops)
    assert len(tops) > 4
    crowns = _watershed(image, inside, tops).reshape(image.shape)
    assert (crowns == flooded(image, inside, [divmod(int(t), 90) for t in tops])).mean() > 0.995


def test_a_canopy_is_filled_by_the_lower_trees_that_it_needs() -> None:
    row, column = np.meshgrid(np.arange(81), np.arange(81), indexing="ij")
    x, y = 0.25 * (row - 40), 0.25 * (column - 40)
    heights = np.zeros(x.shape)
    for at, height, radius in ((-4.0, 20.0, 4.0), (3.0, 12.0, 1.3), (7.0, 4.0, 0.5)):
        share = np.hypot(x - at, y) / radius
        heights = np.maximum(heights, np.where(share <= 1.0, height * (1.0 - 0.45 * share**2), 0.0))
    seen = Canopy(Path("a.tif"), heights.astype(np.float32), np.array([[0.25, 0, -10.0], [0, 0.25, -10.0]]), (20, 20))
    lower = fill_canopy(seen, [Tree(-4.0, 0.0, 20.0, 4.0, None, None)])
    assert [(tree.x, tree.y, tree.height) for tree in lower] == [
        pytest.approx((3.0, 0.0, 12.0), abs=0.01),
        pytest.approx((7.0, 0.0, 4.0), abs=0.01),
    ]
    assert fill_canopy(seen, [Tree(-4.0, 0.0, 20.0, 4.0, None, None), *lower]) == []

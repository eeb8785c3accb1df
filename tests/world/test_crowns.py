# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The forest's crowns against the same crowns with leaves of real size and number: what a LiDAR measures in both.

The errors that docs/environments.md states are the limits here. Run as a program, it prints the table of that page.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from crown_statistics import CrownStatistics, crown_statistics, leaf_area, leaf_profile, with_needles

from fieldtruth.core.arrays import Array
from fieldtruth.world.build import layout_model
from fieldtruth.world.environments.layout import PLANTINGS
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import TREES, grow_tree
from fieldtruth.world.plants.species import leaf_share

HEIGHT = {"old": 20.0, "grown": 12.0, "young": 4.5}  # [m]
DISTANCES = {"old": (20.0, 35.0), "grown": (10.0, 25.0), "young": (5.0, 15.0)}
"""Distances [m]: as near as the highest ring of the LiDAR (22.5 deg) meets the crown, and farther away."""
SEEDS = {"old": range(1, 9), "grown": range(1, 3), "young": range(1, 3)}
"""Individuals. Old crowns differ most: their errors scatter by up to 0.08 m in height, 0.06 in jumps (spruce, pine)."""


class Crown(NamedTuple):
    """A crown of the forest: species and age."""

    name: str
    age: str

    def __str__(self) -> str:
        return f"{self.name}-{self.age}"


@cache
def grown(crown: Crown, seed: int, detail: float) -> Mesh:
    """A tree of the forest, with its leaves of real size at detail 1."""
    rng, height = np.random.default_rng(seed), HEIGHT[crown.age]
    return grow_tree(TREES[crown.name], name="tree", height=height, rng=rng, detail=detail, grown_in="stand")


def statistics(crown: Crown, distance: float, detail: float) -> Array:
    """Statistics in the order of `CrownStatistics`, averaged over individuals."""
    meshes = [(grown(crown, seed, detail), grown(crown, seed, 1.0)) for seed in SEEDS[crown.age]]
    each: list[CrownStatistics] = [crown_statistics(mesh, real, distance, views=2) for mesh, real in meshes]
    return np.asarray(np.mean([[s.passing, s.jumps, s.median_jump, s.high_jump, s.height] for s in each], axis=0))


TREE_DETAIL = {age: PLANTINGS["forest"].groups[age].detail for age in ("old", "grown", "young")}
CROWNS = [Crown(name, age) for age in TREE_DETAIL for name in layout_model("forest")().species]  # type: ignore[attr-defined]
FEW = [Crown("birch", "young"), Crown("spruce", "grown")]


def check(crown: Crown, *, near: bool) -> None:
    """Near, a single large leaf meets several pulses side by side."""
    distance = DISTANCES[crown.age][0 if near else 1]
    ours, real = (statistics(crown, distance, detail) for detail in (TREE_DETAIL[crown.age], 1.0))
    passing, jumps, median, high, height = np.abs(ours - real)
    assert passing < (0.07 if crown.name == "pine" else 0.04)
    assert jumps < (0.08 if near else 0.05)
    assert median < (0.14 if near else 0.07)
    assert high < (0.3 if near else 0.22) * real[3]
    assert height < 0.1


@pytest.mark.parametrize("crown", FEW, ids=str)
def test_lidar_measures_about_the_same_in_crowns_with_leaves_of_real_size(crown: Crown) -> None:
    check(crown, near=False)


@pytest.mark.slow
@pytest.mark.parametrize("crown", CROWNS, ids=str)
@pytest.mark.parametrize("near", [True, False])
def test_lidar_measures_about_the_same_in_all_crowns(crown: Crown, near: bool) -> None:
    check(crown, near=near)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "length", "width"), [("spruce", 0.015, 0.0012), ("pine", 0.05, 0.0015)])
def test_lidar_measures_about_the_same_in_crowns_with_single_needles(name: str, length: float, width: float) -> None:
    """Young trees, whose sprays are nearly as small as real shoots, against up to a million needles [m]."""
    ours = grown(Crown(name, "young"), 1, TREE_DETAIL["young"])
    real = with_needles(grown(Crown(name, "young"), 1, 1.0), length, width, np.random.default_rng(0))
    assert leaf_area(ours).sum() == pytest.approx(leaf_area(real).sum(), rel=0.05)
    for distance in DISTANCES["young"]:
        shoots, needles = (crown_statistics(mesh, real, distance, views=2) for mesh in (ours, real))
        assert abs(shoots.passing - needles.passing) < 0.09
        assert abs(shoots.jumps - needles.jumps) < 0.06
        assert abs(shoots.median_jump - needles.median_jump) < 0.08


@pytest.mark.parametrize("crown", FEW, ids=str)
def test_leaf_area_by_height_is_that_of_leaves_of_real_size(crown: Crown) -> None:
    edges = np.arange(0.0, 26.0)
    ours, real = (grown(crown, 1, detail) for detail in (TREE_DETAIL[crown.age], 1.0))
    assert np.abs(leaf_profile(ours, edges) - leaf_profile(real, edges)).sum() < 0.05 * leaf_area(real).sum()


def test_statistics_see_plates_of_half_a_metre() -> None:
    """With leaves seven times as long as real ones fewer neighbouring pulses jump: the limits above can be broken."""
    crown = Crown("birch", "grown")
    plates, real = (statistics(crown, 10.0, detail) for detail in (0.02, 1.0))
    assert plates[1] < real[1] - 0.1
    assert plates[2] < 0.6 * real[2]


def _table() -> None:
    print("| tree | leaves of | from | pulses that pass | jumps > 0.5 m | median | 90th percentile |")
    print("|---|---|---|---|---|---|---|")
    for crown in CROWNS:
        for distance in DISTANCES[crown.age]:
            ours, real = (statistics(crown, distance, detail) for detail in (TREE_DETAIL[crown.age], 1.0))
            cells = [f"{100 * a:.0f} ({100 * b:.0f}) %" for a, b in zip(ours[:2], real[:2], strict=True)]
            cells += [f"{a:.2f} ({b:.2f}) m" for a, b in zip(ours[2:4], real[2:4], strict=True)]
            size = leaf_share(TREES[crown.name].grown.leaf, TREE_DETAIL[crown.age]) ** -0.5
            print(f"| {crown.age} {crown.name} | {size:.1f} x | {distance:.0f} m | {' | '.join(cells)} |", flush=True)
        grown.cache_clear()


if __name__ == "__main__":
    _table()

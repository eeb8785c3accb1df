# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Whole trees and bushes: sound meshes, sizes, clear trunks, variation, classes, and the same bytes from a seed."""

from collections.abc import Iterable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from crown_statistics import leaf_area, leaf_corners
from mesh_checks import assert_same_bytes, assert_valid
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import BUSHES, TREES, GrownIn, grow_bush, grow_tree
from fieldtruth.world.plants.growth import Stems, grow_skeleton
from fieldtruth.world.plants.species import Habit, Leaf, at_detail, individual

FOLIAGE = 1
PINES = ("pine", "aleppo_pine")
SPRUCES = ("spruce", "northern_spruce")
SPARSE = (*PINES, "olive")


class Plant(NamedTuple):
    """Species, size and surroundings of one plant."""

    name: str
    height: float
    grown_in: GrownIn = "open"
    detail: float = 1.0

    def __str__(self) -> str:
        return f"{self.name}-{self.height:g}-{self.grown_in}-{self.detail:g}"

    def habit(self, seed: int = 3) -> Habit:
        """The habit of this individual."""
        if self.name in BUSHES:
            return BUSHES[self.name].habit(self.height)
        habit = TREES[self.name].habit(self.height, self.grown_in)
        return at_detail(individual(habit, np.random.default_rng(seed)), self.detail)


LARGE = [Plant(name, 11.0, "open", 0.25) for name in TREES]
YOUNG = [Plant(name, 3.0) for name in TREES]
STAND = [Plant(name, 20.0, "stand", 0.06) for name in TREES]
FAR = [Plant(name, 14.0, "stand", 0.015) for name in TREES]
SHRUBS = [Plant("box", 0.8), Plant("box", 1.3), Plant("hazel", 1.8), Plant("hazel", 2.8)]
PLANTS = [*LARGE, *YOUNG, *STAND, *FAR, Plant("pine", 4.0, "exposed"), Plant("lime", 9.0), *SHRUBS]
OFTEN = ("oak", "pine", "spruce")
"""Trees that every run of the tests grows in all sizes: broad leaves, sprays of needles and whorls down to the soil."""


def often(every: Iterable[Plant]) -> list[Any]:
    """Parameters: shrubs, and trees of the species above; the rest is slow."""
    return [k if k in SHRUBS or k.name in OFTEN else pytest.param(k, marks=pytest.mark.slow, id=str(k)) for k in every]


plants = pytest.mark.parametrize("plant", often(PLANTS), ids=str)
trees = pytest.mark.parametrize("plant", often(k for k in PLANTS if k.name in TREES), ids=str)
seeds = pytest.mark.parametrize("seed", [1, 2])
tree = pytest.mark.parametrize("name", TREES)


def grow(plant: Plant, seed: int = 3) -> Mesh:
    rng = np.random.default_rng(seed)
    if plant.name in BUSHES:
        return grow_bush(BUSHES[plant.name], name="plant", height=plant.height, rng=rng)
    return grow_tree(
        TREES[plant.name], name="plant", height=plant.height, rng=rng, detail=plant.detail, grown_in=plant.grown_in
    )


grown = cache(grow)


class Blades(NamedTuple):
    """Leaves of a mesh."""

    corners: Array  # (m, k, 3) [m]
    uv: Array  # (m, k, 2)
    base: Array  # (m, 3) [m]
    tip: Array  # (m, 3) [m]


def blades(mesh: Mesh, leaf: Leaf) -> Blades:
    """Corners in the order of `leaf_mesh`; the base and tip of a spray are those of its middle prong."""
    rows = np.unique(mesh.faces[mesh.material == FOLIAGE])
    count = 3 * leaf.prongs or (6 if leaf.rounded else 4)
    corners = mesh.vertices[rows].astype(np.float64).reshape(-1, count, 3)
    uv = mesh.uv[rows].astype(np.float64).reshape(-1, count, 2)
    if leaf.prongs:
        first = 3 * (leaf.prongs // 2)
        return Blades(corners, uv, corners[:, first : first + 2].mean(1), corners[:, first + 2])
    return Blades(corners, uv, corners[:, 0], corners[:, count // 2])


def wood_of(mesh: Mesh) -> Array:
    return np.asarray(mesh.vertices[np.unique(mesh.faces[mesh.material != FOLIAGE])], np.float64)


@plants
def test_mesh_is_valid(plant: Plant) -> None:
    mesh = grown(plant)
    assert_valid(mesh, least_area=1e-7)  # [m^2]: a tenth of a square millimetre


@plants
def test_roots_are_in_the_soil_and_height_is_as_requested(plant: Plant) -> None:
    mesh, leaf = grown(plant), plant.habit().leaf
    assert -0.4 < mesh.vertices[:, 2].min() < -0.15
    # Coarse crowns have no thin twigs, and the highest leaf may point up.
    bare = 0.2 if plant.name == "box" else 0.04 if plant.detail >= 0.25 else 0.12
    assert wood_of(mesh)[:, 2].max() == pytest.approx(plant.height, rel=bare)
    longest = leaf.length * np.exp(0.4)
    assert blades(mesh, leaf).corners[..., 2].max() < plant.height + max(0.2, 1.2 * longest)


@trees
def test_number_of_leaves_is_that_of_the_habit_and_wood_is_a_small_part(plant: Plant) -> None:
    mesh, habit = grown(plant), plant.habit()
    expected = habit.leaf.number * plant.height / habit.height
    count = len(blades(mesh, habit.leaf).base)
    assert 0.5 * expected < count < 1.05 * expected  # less pruned and dead limbs
    assert np.count_nonzero(mesh.material != FOLIAGE) < (7_000 if plant.detail < 0.1 else 32_000)


@tree
def test_less_detail_means_fewer_leaves_of_the_same_area_on_the_same_stems(name: str) -> None:
    detail = 0.06
    fine, coarse = (grow(Plant(name, 12.0, "stand", d)) for d in (1.0, detail))
    leaves = [np.count_nonzero(m.material == FOLIAGE) for m in (fine, coarse)]
    assert leaves[1] / leaves[0] == pytest.approx(detail, rel=0.1)
    assert leaf_area(coarse).sum() == pytest.approx(leaf_area(fine).sum(), rel=0.1)
    assert coarse.colliders == fine.colliders
    middle = [leaf_corners(m).mean((0, 1)) for m in (fine, coarse)]
    np.testing.assert_allclose(middle[0], middle[1], atol=0.15)  # [m]


def every_two_centimetres(stems: Stems) -> Array:
    """Points (n, 3) [m] of stems, the longest of which has one in 2 cm."""
    count, each = len(stems.length), int(stems.length.max(initial=0.0) / 0.02) + 2
    return stems.at(np.arange(count).repeat(each), np.tile(np.linspace(0, 1, each), count))[0]


@plants
def test_every_leaf_grows_on_a_twig(plant: Plant) -> None:
    mesh = grown(plant)
    rng = np.random.default_rng(3)
    habit, leaf = plant.habit(), plant.habit().leaf
    if plant.name in TREES:
        habit = individual(TREES[plant.name].habit(plant.height, plant.grown_in), rng)
    orders = grow_skeleton(habit, plant.height, rng)
    points = np.concatenate([every_two_centimetres(s) for s in orders[1:]])
    leaves = blades(mesh, leaf)
    distance, _ = cKDTree(points).query(leaves.base)
    behind = 0.6 * (1 - leaf.stands_for**-0.5) * np.linalg.norm(leaves.tip - leaves.base, axis=1)
    assert np.max(distance - behind) < leaf.stalk + 0.01


@plants
def test_classes_follow_from_the_materials(plant: Plant) -> None:
    mesh = grown(plant)
    labels = [MATERIALS[name].label for name in mesh.materials]
    if plant.name in BUSHES:
        assert set(labels) == {Label.BUSH}
    else:
        assert labels == [Label.TRUNK, Label.TREETOP, Label.TRUNK][: len(labels)]
    assert set(np.unique(mesh.material)) == set(range(len(labels)))


@pytest.mark.parametrize("seed", [1, 2])
def test_old_pine_has_two_barks_one_above_the_other(seed: int) -> None:
    mesh = grow(Plant("pine", 12.0), seed)
    assert mesh.materials == ("bark_pine", "leaf_pine", "bark_pine_upper")
    height = mesh.vertices[mesh.faces][:, :, 2].mean(1)
    assert height[mesh.material == 0].max() < 0.6 * 12.0
    assert height[mesh.material == 2].min() > 0.2 * 12.0


@pytest.mark.parametrize("plant", often(k for k in (*LARGE, *STAND) if k.name not in SPRUCES), ids=str)
@seeds
def test_only_the_trunk_is_below_the_clear_height(plant: Plant, seed: int) -> None:
    mesh, habit = grow(plant, seed), plant.habit(seed)
    clear = habit.clear - 0.1
    assert clear > 1.5
    low = mesh.vertices[mesh.vertices[:, 2] < clear]
    (trunk,) = mesh.colliders
    assert trunk.size[1] == 2.0
    # The trunk's collider, the root flare, and the lean.
    assert np.hypot(low[:, 0], low[:, 1]).max() < 2.5 * trunk.size[0] + 0.25
    assert blades(mesh, habit.leaf).corners[:, :, 2].min() > clear


@pytest.mark.parametrize("name", ["lime", "birch", "oak"])
def test_young_park_trees_have_no_leaves_below_one_metre(name: str) -> None:
    plant = Plant(name, 4.0)
    assert blades(grown(plant), plant.habit().leaf).corners[:, :, 2].min() > 1.0


@tree
@seeds
def test_lean_of_old_trunks_is_limited(name: str, seed: int) -> None:
    habit = Plant(name, 14.0, "stand").habit(seed)
    trunk = grow_skeleton(habit, 14.0, np.random.default_rng(seed))[0].axis[0]
    lean = np.degrees(np.arctan2(np.hypot(*(trunk[-1] - trunk[0])[:2]), trunk[-1, 2] - trunk[0, 2]))
    assert lean < habit.lean_limit + 1.5  # added by the fit to the height
    assert habit.lean_limit < 10


@pytest.mark.parametrize("name", [n for n in TREES if n not in (*SPRUCES, *PINES)])
@seeds
def test_crown_radius_varies_with_azimuth(name: str, seed: int) -> None:
    plant = Plant(name, 11.0, "open", 0.1)
    leaves = blades(grow(plant, seed), plant.habit(seed).leaf).corners.mean(1)
    centre = leaves.mean(0)
    sector = ((np.arctan2(*(leaves - centre)[:, 1::-1].T) / (2 * np.pi) + 0.5) * 24).astype(int) % 24
    radius = np.array([np.quantile(np.hypot(*(leaves - centre)[sector == k, :2].T), 0.98) for k in range(24)])
    assert radius.std() / radius.mean() > 0.08
    assert radius.min() > 0.05 * 11.0


OPEN = {"aleppo_pine": 0.32, "apple": 0.5}
"""Least cover of open crowns: a pine whose needles stay two years, and a tree that is pruned for light."""


@tree
def test_crown_covers_most_but_not_all_of_the_sky(name: str) -> None:
    """Share of horizontal rays through the crown's inner half that hit a leaf."""
    mesh = grown(Plant(name, 11.0, "open", 0.25))
    corner = mesh.vertices[mesh.faces[mesh.material == FOLIAGE]].astype(np.float64)[..., 1:]
    middle, spread = np.median(corner, (0, 1)), corner.std((0, 1))
    covered = []
    targets = middle + np.random.default_rng(0).uniform(-1, 1, (300, 2)) * spread
    near = cKDTree(corner[:, 0]).query_ball_point(targets, 0.3, p=np.inf)
    for target, rows in zip(targets, near, strict=True):
        p = corner[rows] - target
        q = np.roll(p, -1, 1)
        side = p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]
        covered.append(((side > 0).all(1) | (side < 0).all(1)).any())
    assert OPEN.get(name, 0.42 if name in SPARSE else 0.55) < np.mean(covered) < 0.99


@plants
def test_upper_sides_of_leaves_face_up_and_agree_with_shading_normals(plant: Plant) -> None:
    mesh = grown(plant)
    faces = mesh.faces[mesh.material == FOLIAGE]
    corner = mesh.vertices[faces].astype(np.float64)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert (normal[:, 2] > 0).mean() > (0.5 if plant.name in PINES else 0.6)
    # the shading normal is on the same side as the geometry for all but curled leaves
    assert ((normal * mesh.normals[faces].mean(1)).sum(1) > 0).mean() > 0.97


@plants
def test_leaf_coordinates_run_from_stalk_to_tip(plant: Plant) -> None:
    leaf = plant.habit().leaf
    uv = blades(grown(plant), leaf).uv
    assert uv.min() >= 0
    assert uv.max() <= 1
    if leaf.prongs:
        assert (uv[:, 2::3, 1] - uv[:, ::3, 1] > 0.9).all()
        np.testing.assert_allclose(uv[:, 2::3, 0], 0.5)
    else:
        tip = uv.shape[1] // 2
        assert (uv[:, tip, 1] - uv[:, 0, 1] > 0.9).all()
        np.testing.assert_allclose(uv[:, [0, tip], 0], 0.5)


@plants
def test_same_seed_gives_same_bytes_and_another_seed_another_plant(plant: Plant) -> None:
    first, again, other = grown(plant), grow(plant), grow(plant, 9)
    assert_same_bytes(first, again)
    assert first.vertices.tobytes() != other.vertices.tobytes()


@tree
def test_individuals_differ_visibly(name: str) -> None:
    """Height of the crown's middle, its offset from the trunk and its leaf area vary by more than a few percent."""
    seen = []
    for seed in range(6):
        mesh = grow(Plant(name, 14.0, "stand", 0.03), seed)
        leaves = mesh.vertices[mesh.faces[mesh.material == FOLIAGE]].mean(1)
        seen.append([np.median(leaves[:, 2]), np.hypot(*leaves[:, :2].mean(0)), leaf_area(mesh).sum()])
    middle, aside, area = np.array(seen).T
    assert np.ptp(middle) > 0.3
    assert np.ptp(aside) > 0.1
    assert np.ptp(area) / area.mean() > 0.04


@tree
def test_tree_in_a_stand_has_a_higher_narrower_crown(name: str) -> None:
    crowns = []
    for grown_in in ("open", "stand"):
        meshes = [grow(Plant(name, 12.0, grown_in, 0.06), seed) for seed in range(4)]
        leaves = [m.vertices[m.faces[m.material == FOLIAGE]].mean(1) for m in meshes]
        crowns.append(
            [
                np.mean([np.quantile(v[:, 2], 0.03) for v in leaves]),
                np.mean([np.quantile(np.hypot(*(v[:, :2] - v[:, :2].mean(0)).T), 0.95) for v in leaves]),
                np.mean([m.footprint for m in meshes]),
            ]
        )
    (low, wide, open_footprint), (high, narrow, stand_footprint) = crowns
    assert high > low + 1.0
    assert narrow < 0.9 * wide
    assert stand_footprint < 0.75 < open_footprint


@pytest.mark.parametrize("name", [n if n in OFTEN else pytest.param(n, marks=pytest.mark.slow) for n in TREES])
def test_young_tree_is_not_a_scaled_old_one(name: str) -> None:
    both = Plant(name, 11.0), Plant(name, 4.0)
    old, young = (grown(k) for k in both)
    assert young.colliders[0].size[0] / 4.0 < 0.8 * old.colliders[0].size[0] / 11.0
    size = [np.linalg.norm(b.tip - b.base, axis=1).mean() for b in (blades(grown(k), k.habit().leaf) for k in both)]
    assert size[1] == pytest.approx(size[0], rel=0.1)  # leaves do not grow with the tree


@plants
def test_collider_is_within_the_footprint(plant: Plant) -> None:
    mesh = grown(plant)
    (collider,) = mesh.colliders
    assert collider.shape == "cylinder"
    assert collider.size[0] < mesh.footprint < 0.8 * plant.height
    assert collider.size[1] <= max(2.0, plant.height)


@trees
def test_low_branches_are_within_the_footprint(plant: Plant) -> None:
    mesh = grown(plant)
    low = mesh.vertices[(mesh.vertices[:, 2] < 1.3) & (mesh.vertices[:, 2] > 0.3)]
    assert (np.hypot(low[:, 0], low[:, 1]) < mesh.footprint + 0.02).mean() > 0.97


@pytest.mark.parametrize("height", [-1.0, 0.0, 1.5, 30.0, float("nan")])
def test_height_outside_the_range_of_the_species_is_rejected(height: float) -> None:
    with pytest.raises(ValueError, match=r"height of lime must be between .* m, got"):
        grow(Plant("lime", height))


@pytest.mark.parametrize("detail", [0.0, 0.004, 1.5, float("nan")])
def test_detail_out_of_range_is_rejected(detail: float) -> None:
    with pytest.raises(ValueError, match=r"detail must be between 0\.005 and 1, got"):
        grow(Plant("lime", 10.0, "open", detail))

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bushes of every species and detail: triangle budgets, form, flowers, class, and the same bytes from a seed."""

import numpy as np
import pytest
from mesh_checks import assert_same_bytes, assert_valid

from fieldtruth.core.classes import Label
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import BUSHES, Species, grow_bush
from fieldtruth.world.plants.species import FINE_LEAVES

WOOD, FOLIAGE, FLOWER = 0, 1, 2
every_species = pytest.mark.parametrize("species", BUSHES.values(), ids=str)


def grow(species: Species, *, share: float = 1.0, detail: float = 1.0, seed: int = 4) -> Mesh:
    height = share * species.grown.height
    return grow_bush(species, name="bush", height=height, rng=np.random.default_rng(seed), detail=detail)


def leaf_area(mesh: Mesh) -> float:
    corner = mesh.vertices[mesh.faces[mesh.material != WOOD]].astype(np.float64)
    return float(0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum())


def test_species_of_every_environment_exist() -> None:
    assert {"box", "hazel", "juniper", "gorse", "bramble", "grey_willow", "heather"} <= set(BUSHES)


@every_species
def test_detail_scales_the_leaves_and_keeps_the_leaf_area(species: Species) -> None:
    full, half, quarter = (grow(species, detail=d) for d in (1.0, 0.5, 0.25))
    assert 8_000 < len(full.faces) < 42_000
    for mesh, detail in ((half, 0.5), (quarter, 0.25)):
        leaves = [np.count_nonzero(m.material != WOOD) for m in (mesh, full)]
        simpler = 0.5 if species.grown.leaf.rounded and detail <= FINE_LEAVES else 1.0  # two triangles instead of four
        assert leaves[0] / leaves[1] == pytest.approx(simpler * detail, rel=0.15)
        assert leaf_area(mesh) == pytest.approx(leaf_area(full), rel=0.3)
        assert mesh.footprint == pytest.approx(full.footprint, rel=0.25)
    assert 3_000 * simpler < len(quarter.faces) < 16_000


@every_species
def test_detail_out_of_range_is_rejected(species: Species) -> None:
    for detail in (0.0, 0.004, 1.5, float("nan")):
        with pytest.raises(ValueError, match=r"detail must be between 0\.005 and 1, got"):
            grow(species, detail=detail)


@every_species
@pytest.mark.parametrize("detail", [1.0, 0.4])
def test_mesh_is_valid_rooted_and_of_the_requested_height(species: Species, detail: float) -> None:
    mesh = grow(species, detail=detail)
    height = species.grown.height
    assert_valid(mesh, least_area=0.0)
    assert -0.8 < mesh.vertices[:, 2].min() < -0.15  # canes of bramble arch into the ground
    assert np.quantile(mesh.vertices[:, 2], 0.999) == pytest.approx(height, rel=0.15)
    wood = mesh.vertices[np.unique(mesh.faces[mesh.material == WOOD])]
    undrawn = 0.01 if detail == 1 else 0.06  # the highest twig may have leaves but no surface
    assert wood[:, 2].max() == pytest.approx(height, rel=0.2 if species.grown.sheared else undrawn)


@every_species
def test_foliage_begins_at_the_clear_height(species: Species) -> None:
    """Which is nearly at the ground but for trained plants."""
    mesh = grow(species, detail=0.5)
    leaves = mesh.vertices[np.unique(mesh.faces[mesh.material != WOOD]), 2]
    clear = species.grown.clear
    assert clear < 0.06 or species.name == "vine"
    assert 0 < leaves.min() < clear + 0.2 * species.grown.height
    assert leaves.min() > clear - 1e-6


@every_species
def test_all_materials_are_bush(species: Species) -> None:
    mesh = grow(species, detail=0.5)
    assert {MATERIALS[name].label for name in mesh.materials} == {Label.BUSH}
    assert set(np.unique(mesh.material)) == set(range(len(mesh.materials)))


@every_species
def test_collider_and_footprint_follow_from_the_leaves(species: Species) -> None:
    mesh = grow(species, detail=0.5)
    (collider,) = mesh.colliders
    assert collider.shape == "cylinder"
    assert collider.size[0] == pytest.approx(0.7 * mesh.footprint)
    assert collider.size[1] == pytest.approx(0.9 * species.grown.height)
    leaves = mesh.vertices[np.unique(mesh.faces[mesh.material != WOOD])]
    assert (np.hypot(leaves[:, 0], leaves[:, 1]) < mesh.footprint + 0.01).mean() > 0.97


@pytest.mark.parametrize("species", [s for s in BUSHES.values() if s.bloom is not None], ids=str)
def test_flowers_have_the_stated_share_and_are_on_top(species: Species) -> None:
    mesh = grow(species)
    flowers = (mesh.material == FLOWER).sum() / (mesh.material != WOOD).sum()
    assert flowers == pytest.approx(species.bloom_share, abs=0.005)
    middle = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    assert middle[mesh.material == FLOWER].mean() > middle[mesh.material == FOLIAGE].mean() + 0.1 * species.grown.height
    of_leaf = np.unique(mesh.faces[mesh.material == FOLIAGE, 0])
    of_flower = np.unique(mesh.faces[mesh.material == FLOWER, 0])
    assert not set(of_leaf) & set(of_flower)  # a leaf is all flower or none


@every_species
def test_same_seed_gives_same_bytes_and_another_seed_another_bush(species: Species) -> None:
    first, again, other = (grow(species, detail=0.4, seed=s) for s in (8, 8, 9))
    assert_same_bytes(first, again)
    assert first.vertices.tobytes() != other.vertices.tobytes()


def test_proportions_differ_between_species() -> None:
    """Juniper is a column, bramble and heather are wider than high, willow is about as wide as high."""
    slim = {name: BUSHES[name].grown.height / (2 * grow(BUSHES[name], detail=0.5).footprint) for name in BUSHES}
    assert slim["juniper"] > 1.0
    assert slim["bramble"] < 0.6
    assert slim["heather"] < 0.6
    assert 0.4 < slim["grey_willow"] < 1.0

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bushes of every kind at every detail: triangle budgets, form, flowers, class, and the same bytes from a seed."""

import numpy as np
import pytest

from fieldtruth.core.classes import Label
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import BUSHES, Species, grow_bush

WOOD, FOLIAGE, FLOWER = 0, 1, 2
kinds = pytest.mark.parametrize("kind", BUSHES.values(), ids=str)


def grow(kind: Species, *, share: float = 1.0, detail: float = 1.0, seed: int = 4) -> Mesh:
    height = share * kind.grown.height
    return grow_bush(kind, name="bush", height=height, rng=np.random.default_rng(seed), detail=detail)


def leaf_area(mesh: Mesh) -> float:
    corner = mesh.vertices[mesh.faces[mesh.material != WOOD]].astype(np.float64)
    return float(0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum())


def test_kinds_of_every_environment() -> None:
    assert {"box", "hazel", "juniper", "gorse", "bramble", "grey_willow", "heather"} <= set(BUSHES)


@kinds
def test_detail_buys_triangles_and_keeps_the_leaf_area(kind: Species) -> None:
    full, half, quarter = (grow(kind, detail=d) for d in (1.0, 0.5, 0.25))
    assert 8_000 < len(full.faces) < 42_000
    for mesh, detail in ((half, 0.5), (quarter, 0.25)):
        assert 0.7 * detail < len(mesh.faces) / len(full.faces) < 1.4 * detail
        assert leaf_area(mesh) == pytest.approx(leaf_area(full), rel=0.3)
        assert mesh.footprint == pytest.approx(full.footprint, rel=0.25)
    assert 3_000 < len(quarter.faces) < 12_000


@kinds
@pytest.mark.parametrize("detail", [0.0, 0.01, 1.5, float("nan")])
def test_a_detail_out_of_bounds(kind: Species, detail: float) -> None:
    with pytest.raises(ValueError, match=r"detail of a bush = .*: must be from 0\.03 to 1"):
        grow(kind, detail=detail)


@kinds
@pytest.mark.parametrize("detail", [1.0, 0.4])
def test_a_sound_mesh_that_stands_in_the_soil_and_is_as_high_as_asked(kind: Species, detail: float) -> None:
    mesh = grow(kind, detail=detail)
    height = kind.grown.height
    assert mesh.faces.max() < len(mesh.vertices)
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    assert -0.8 < mesh.vertices[:, 2].min() < -0.15  # canes of bramble arch back into the ground
    assert np.quantile(mesh.vertices[:, 2], 0.999) == pytest.approx(height, rel=0.15)
    wood = mesh.vertices[np.unique(mesh.faces[mesh.material == WOOD])]
    undrawn = 0.01 if detail == 1 else 0.06  # the topmost twig may be one that only bears leaves
    assert wood[:, 2].max() == pytest.approx(height, rel=0.2 if kind.grown.sheared else undrawn)


@kinds
def test_foliage_reaches_the_ground_and_stays_above_it(kind: Species) -> None:
    mesh = grow(kind, detail=0.5)
    leaves = mesh.vertices[np.unique(mesh.faces[mesh.material != WOOD]), 2]
    assert leaves.min() > 0
    assert leaves.min() < 0.2 * kind.grown.height


@kinds
def test_everything_is_bush(kind: Species) -> None:
    mesh = grow(kind, detail=0.5)
    assert {MATERIALS[name].label for name in mesh.materials} == {Label.BUSH}
    assert set(np.unique(mesh.material)) == set(range(len(mesh.materials)))


@kinds
def test_room_and_collider(kind: Species) -> None:
    mesh = grow(kind, detail=0.5)
    (collider,) = mesh.colliders
    assert collider.shape == "cylinder"
    assert collider.size[0] == pytest.approx(0.7 * mesh.footprint)
    assert collider.size[1] == pytest.approx(0.9 * kind.grown.height)
    leaves = mesh.vertices[np.unique(mesh.faces[mesh.material != WOOD])]
    assert (np.hypot(leaves[:, 0], leaves[:, 1]) < mesh.footprint + 0.01).mean() > 0.97


@pytest.mark.parametrize("kind", [k for k in BUSHES.values() if k.bloom is not None], ids=str)
def test_the_share_of_flowers_and_where_they_are(kind: Species) -> None:
    mesh = grow(kind)
    flowers = (mesh.material == FLOWER).sum() / (mesh.material != WOOD).sum()
    assert flowers == pytest.approx(kind.bloom_share, abs=0.005)
    middle = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    assert middle[mesh.material == FLOWER].mean() > middle[mesh.material == FOLIAGE].mean() + 0.1 * kind.grown.height
    of_leaf = np.unique(mesh.faces[mesh.material == FOLIAGE, 0])
    of_flower = np.unique(mesh.faces[mesh.material == FLOWER, 0])
    assert not set(of_leaf) & set(of_flower)  # no leaf is half a flower


@kinds
def test_the_same_seed_gives_the_same_bytes_and_another_another_bush(kind: Species) -> None:
    first, again, other = (grow(kind, detail=0.4, seed=s) for s in (8, 8, 9))
    for part in ("vertices", "normals", "uv", "faces", "material"):
        assert getattr(first, part).tobytes() == getattr(again, part).tobytes()
    assert first.vertices.tobytes() != other.vertices.tobytes()


def test_forms_differ_as_the_kinds_do() -> None:
    """Juniper is a column, bramble and heather are wider than high, willow is as wide as high."""
    slim = {name: BUSHES[name].grown.height / (2 * grow(BUSHES[name], detail=0.5).footprint) for name in BUSHES}
    assert slim["juniper"] > 1.0
    assert slim["bramble"] < 0.6
    assert slim["heather"] < 0.6
    assert 0.4 < slim["grey_willow"] < 1.0

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Whole plants: leaves hang on twigs, the way below is free, no two are alike, a seed gives the same bytes."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fieldtruth.classes import Label
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import BUSHES, SPECIES, Species, grow_bush, grow_tree
from fieldtruth.world.plants.growth import grow_skeleton

FOLIAGE = 1
KINDS = [
    *[(s, h) for s in SPECIES.values() for h in (9.0, 11.0, 15.0, 3.0, 4.5)],
    *[(BUSHES["box"], h) for h in (0.8, 1.3)],
    *[(BUSHES["hazel"], h) for h in (1.8, 2.8)],
]
kinds = pytest.mark.parametrize(("species", "height"), KINDS, ids=str)
large = pytest.mark.parametrize("seed", [1, 2, 3])
tree = pytest.mark.parametrize("name", SPECIES)


def grow(species: Species, height: float, seed: int = 3) -> Mesh:
    make = grow_bush if species.name in BUSHES else grow_tree
    return make(species, name="plant", height=height, rng=np.random.default_rng(seed))


def leaf_corners(mesh: Mesh) -> NDArray[np.float64]:
    """(m, 4, 3): base, left, tip, right of each leaf."""
    rows = np.unique(mesh.faces[mesh.material == FOLIAGE])
    corners: NDArray[np.float64] = mesh.vertices[rows].astype(np.float64).reshape(-1, 4, 3)
    return corners


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of vectors in the plane."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


@kinds
def test_the_mesh_is_sound(species: Species, height: float) -> None:
    mesh = grow(species, height)
    assert mesh.vertices.dtype == mesh.normals.dtype == mesh.uv.dtype == np.float32
    assert mesh.faces.dtype == mesh.material.dtype == np.int32
    assert len(mesh.vertices) == len(mesh.normals) == len(mesh.uv)
    assert len(mesh.faces) == len(mesh.material)
    assert all(np.isfinite(a).all() for a in (mesh.vertices, mesh.normals, mesh.uv))
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    corner = mesh.vertices[mesh.faces].astype(np.float64)
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    assert area.min() > 1e-7  # [m^2]: a tenth of a square millimetre
    assert mesh.faces.min() == 0
    assert mesh.faces.max() < len(mesh.vertices)


@kinds
def test_it_stands_in_the_soil_and_is_as_high_as_asked(species: Species, height: float) -> None:
    mesh = grow(species, height)
    assert -0.3 < mesh.vertices[:, 2].min() < -0.15
    wood = mesh.vertices[np.unique(mesh.faces[mesh.material != FOLIAGE])]
    assert wood[:, 2].max() == pytest.approx(height, rel=0.2 if species.name == "box" else 0.01)
    assert leaf_corners(mesh)[:, :, 2].max() < height + 0.2


@kinds
def test_triangles(species: Species, height: float) -> None:
    count = len(grow(species, height).faces)
    if height > 6:
        assert 50_000 < count < 65_000
    else:
        assert 5_000 < count < 40_000


@kinds
def test_every_leaf_hangs_on_a_twig(species: Species, height: float) -> None:
    mesh = grow(species, height)
    habit = species.habit(height)
    orders = grow_skeleton(habit, height, np.random.default_rng(3))
    steps = np.linspace(0, 1, 201)
    points = np.concatenate(
        [s.at(np.arange(len(s.length)).repeat(201), np.tile(steps, len(s.length)))[0] for s in orders[1:]]
    )
    distance, _ = cKDTree(points).query(leaf_corners(mesh)[:, 0])
    assert np.max(distance) < habit.leaf.stalk + 0.01


@kinds
def test_classes_follow_from_the_materials(species: Species, height: float) -> None:
    mesh = grow(species, height)
    labels = [MATERIALS[name].label for name in mesh.materials]
    if species.name in BUSHES:
        assert set(labels) == {Label.BUSH}
    else:
        assert labels == [Label.TRUNK, Label.TREETOP]
    assert set(np.unique(mesh.material)) == {0, 1}


@tree
@large
def test_the_robot_passes_beneath_a_large_tree(name: str, seed: int) -> None:
    mesh = grow(SPECIES[name], 11.0, seed)
    low = mesh.vertices[mesh.vertices[:, 2] < 2.2]
    (trunk,) = mesh.colliders
    assert trunk.size[1] == 2.0
    # Below 2.2 m there is nothing but the trunk: its collider, the root flare, and what it leans.
    assert np.hypot(low[:, 0], low[:, 1]).max() < 2.5 * trunk.size[0] + 0.25
    assert leaf_corners(mesh)[:, :, 2].min() > 2.2


@tree
def test_nothing_hangs_into_a_walker_s_way_below_a_young_tree(name: str) -> None:
    assert leaf_corners(grow(SPECIES[name], 4.0))[:, :, 2].min() > 1.0


@tree
@large
def test_a_crown_is_neither_a_ball_nor_a_stick(name: str, seed: int) -> None:
    leaves = leaf_corners(grow(SPECIES[name], 11.0, seed)).mean(1)
    centre = leaves.mean(0)
    sector = ((np.arctan2(*(leaves - centre)[:, 1::-1].T) / (2 * np.pi) + 0.5) * 24).astype(int) % 24
    reach = np.array([np.quantile(np.hypot(*(leaves - centre)[sector == k, :2].T), 0.98) for k in range(24)])
    assert reach.std() / reach.mean() > 0.08
    assert reach.min() > 0.07 * 11.0


@tree
@large
def test_a_crown_is_dense_and_yet_lets_some_sky_through(name: str, seed: int) -> None:
    """Rays from the side through the crown's inner half: the share that meets a leaf, in orthographic projection."""
    mesh = grow(SPECIES[name], 11.0, seed)
    corners = leaf_corners(mesh)
    y, z = corners[..., 1], corners[..., 2]
    rng = np.random.default_rng(0)
    middle = np.array([np.median(y), np.median(z)])
    spread = np.array([y.std(), z.std()])
    covered = []
    for target in middle + rng.uniform(-1, 1, (300, 2)) * spread:
        near = np.hypot(y[:, 0] - target[0], z[:, 0] - target[1]) < 0.3
        a = np.stack([y[near] - target[0], z[near] - target[1]], -1)
        inside = np.zeros(len(a), bool)
        for corner in ((0, 2, 1), (0, 3, 2)):
            p = a[:, corner]
            side = np.stack([cross(p[:, i], p[:, (i + 1) % 3]) for i in range(3)], -1)
            inside |= (side > 0).all(1) | (side < 0).all(1)
        covered.append(inside.any())
    assert 0.6 < np.mean(covered) < 0.98


@kinds
def test_leaves_turn_their_upper_side_to_the_light(species: Species, height: float) -> None:
    mesh = grow(species, height)
    faces = mesh.faces[mesh.material == FOLIAGE]
    corner = mesh.vertices[faces].astype(np.float64)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert (normal[:, 2] > 0).mean() > 0.6
    # the shading normal is on the same side as the geometry for all but the leaves that curl away
    assert ((normal * mesh.normals[faces].mean(1)).sum(1) > 0).mean() > 0.97


@kinds
def test_leaf_coordinates_run_from_stalk_to_tip(species: Species, height: float) -> None:
    mesh = grow(species, height)
    uv = mesh.uv[np.unique(mesh.faces[mesh.material == FOLIAGE])].reshape(-1, 4, 2)
    assert uv.min() >= 0
    assert uv.max() <= 1
    assert (uv[:, 2, 1] - uv[:, 0, 1] > 0.9).all()
    np.testing.assert_allclose(uv[:, [0, 2], 0], 0.5)


@kinds
def test_the_same_seed_gives_the_same_bytes_and_another_another_plant(species: Species, height: float) -> None:
    first, again, other = grow(species, height, 8), grow(species, height, 8), grow(species, height, 9)
    for part in ("vertices", "normals", "uv", "faces", "material"):
        assert getattr(first, part).tobytes() == getattr(again, part).tobytes()
    assert first.colliders == again.colliders
    assert first.footprint == again.footprint
    assert first.vertices.tobytes() != other.vertices.tobytes()


@tree
def test_a_young_tree_is_no_small_old_one(name: str) -> None:
    old, young = grow(SPECIES[name], 11.0), grow(SPECIES[name], 4.0)
    assert young.colliders[0].size[0] / 4.0 < 0.75 * old.colliders[0].size[0] / 11.0
    leaf = [np.linalg.norm(np.diff(leaf_corners(m)[:, [0, 2]], axis=1), axis=2).mean() for m in (old, young)]
    assert leaf[1] > 0.6 * leaf[0]


@kinds
def test_room_and_collider(species: Species, height: float) -> None:
    mesh = grow(species, height)
    (collider,) = mesh.colliders
    assert collider.shape == "cylinder"
    assert collider.size[0] < mesh.footprint < 0.8 * height
    assert collider.size[1] <= max(2.0, height)


@pytest.mark.parametrize("height", [-1.0, 0.0, 1.5, 30.0, float("nan")])
def test_a_height_that_no_lime_has(height: float) -> None:
    with pytest.raises(ValueError, match=r"height of a lime = .* m: must be from"):
        grow(SPECIES["lime"], height)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Litter lies on the surface, has the class of the ground it lies on, and changes nothing else of a world."""

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import without_textures

from fieldtruth.core.classes import Label
from fieldtruth.drive.ground import hard_surfaces
from fieldtruth.world.build import build_world
from fieldtruth.world.litter import LITTER_BY_GROUND, SHAPES
from fieldtruth.world.materials import GROUND_TYPES, MATERIALS
from fieldtruth.world.model import LITTER, Swarm, World

LAYOUT: dict[str, object] = {
    "size": [30, 24],
    "grid": 0.1,
    "old_trees": 2,
    "grown_trees": 2,
    "young_trees": 2,
    "snags": 1,
}
LAYOUT |= {"fallen_trunks": 1, "stumps": 1, "bushes": 3, "rocks": 3, "beyond": False, "individuals": 1}
LAYOUT |= {"species": {"birch": 1.0}} | dict.fromkeys(("seedlings_per_m2", "saplings_per_m2", "bilberries_per_m2"), 0)


def forest(litter: float) -> World:
    with without_textures():
        return build_world("forest", 3, LAYOUT | {"litter": litter})


@pytest.fixture(scope="module")
def world() -> World:
    return forest(1.0)


@pytest.fixture(scope="module")
def bare() -> World:
    return forest(0.0)


def litter_of(world: World) -> list[Swarm]:
    return [swarm for swarm in world.swarms if swarm.kind == LITTER]


def points(world: World, swarm: Swarm) -> NDArray[np.float64]:
    """All vertices of a swarm in the world frame (n, 3) [m]."""
    parts = []
    for row, name in enumerate(swarm.meshes):
        poses = swarm.world_from_object[swarm.mesh == row]
        moved = np.einsum("nij,vj->nvi", poses[:, :3, :3], world.meshes[name].vertices.astype(float))
        parts.append((moved + poses[:, None, :3, 3]).reshape(-1, 3))
    return np.concatenate(parts)


def test_all_else_is_the_same_without_it(world: World, bare: World) -> None:
    assert not litter_of(bare)
    assert [s.name for s in litter_of(world)] == ["ground_litter", "trail_litter"]
    kept = [swarm for swarm in world.swarms if swarm.kind != LITTER]
    assert len(kept) == len(bare.swarms)
    for ours, theirs in zip(kept, bare.swarms, strict=True):
        assert (ours.name, ours.object_id, ours.meshes) == (theirs.name, theirs.object_id, theirs.meshes)
        assert np.array_equal(ours.world_from_object, theirs.world_from_object)
    assert world.object_names[: len(bare.object_names)] == bare.object_names
    assert np.array_equal(world.terrain.surface.heights, bare.terrain.surface.heights)
    for one, other in zip(world.instances, bare.instances, strict=True):
        assert (one.name, one.object_id) == (other.name, other.object_id)
        assert np.array_equal(one.world_from_object, other.world_from_object)


def test_the_amount_scales_it(world: World) -> None:
    for ours, more in zip(litter_of(world), litter_of(forest(2.0)), strict=True):
        assert 1.8 < len(more.mesh) / len(ours.mesh) < 2.2


def test_it_lies_on_the_surface_and_has_the_class_of_what_is_below(world: World) -> None:
    for swarm, label in zip(litter_of(world), (Label.GROUND, Label.TRAIL), strict=True):
        assert {world.materials[m].label for name in swarm.meshes for m in world.meshes[name].materials} == {label}
        found = points(world, swarm)
        above = found[:, 2] - world.terrain.surface.height_at(*found[:, :2].T)
        low, middle, high = np.quantile(above, [0.001, 0.5, 0.999])
        assert low > -0.15
        assert -0.01 < middle < 0.04
        assert high < 0.2
        below = world.terrain.label_at(*found[:, :2].T)
        assert (below == label).mean() > 0.99


def test_small_things_are_more_frequent_than_large_ones(world: World) -> None:
    sizes = []
    for name, mesh in world.meshes.items():
        if name.startswith("litter_trodden"):
            stone = (
                mesh.faces[mesh.material == mesh.materials.index("trail_stone")]
                if "trail_stone" in mesh.materials
                else []
            )
            for faces in np.array(stone).reshape(-1, 20, 3):
                sizes.append(np.ptp(mesh.vertices[faces.ravel()], axis=0).max())
    assert len(sizes) >= 20
    assert np.median(sizes) < 0.5 * np.max(sizes)


def test_wheels_do_not_feel_it(world: World, bare: World) -> None:
    assert [s.names[0] for s in hard_surfaces(world)] == [s.names[0] for s in hard_surfaces(bare)]


def test_every_ground_and_thing_of_the_table_exists() -> None:
    assert set(LITTER_BY_GROUND) <= set(GROUND_TYPES)
    for name, covers in LITTER_BY_GROUND.items():
        for item in (item for cover in covers for item in cover.items):
            assert item.shape in SHAPES
            own = MATERIALS[f"{'trail' if name in ('gravel', 'trodden_earth') else 'litter'}_{item.material}"]
            assert own.label == (Label.TRAIL if name in ("gravel", "trodden_earth") else Label.GROUND)


@pytest.mark.parametrize("name", list(SHAPES))
def test_shapes_have_their_size_and_stay_near_the_ground(name: str) -> None:
    size, count = 0.05, 400
    vertices, normals, uv, faces = SHAPES[name](np.zeros((count, 3)), np.full(count, size), np.random.default_rng(2))
    assert np.isfinite(np.concatenate([vertices, normals], axis=1)).all()
    assert np.isfinite(uv).all()
    assert faces.max() == len(vertices) - 1
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    assert np.ptp(vertices, axis=0).max() < 3.0 * size
    assert vertices[:, 2].min() > -0.04
    assert 0.005 < vertices[:, 2].max() < 0.09

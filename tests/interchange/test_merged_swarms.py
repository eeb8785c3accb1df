# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Merged swarms: each member in exactly one tile, with its pose, class and tint."""

import numpy as np
from interchange_worlds import SIDE, areas, corners_of, mesh_areas, small_world

from fieldtruth.core.classes import Label
from fieldtruth.interchange.surfaces import beyond_edge, tiles_of_swarms


def test_every_member_is_in_the_tile_below_it() -> None:
    world = small_world()
    (swarm,) = world.swarms
    tiles = list(tiles_of_swarms(world, 5.0, beyond=True))
    assert sorted(np.concatenate([tile.members for tile in tiles]).tolist()) == list(range(40))
    assert len({tile.name for tile in tiles}) == len(tiles)
    for tile in tiles:
        (surface,) = tile.surfaces(world)
        i, j = (int(n) for n in tile.name.split("_")[-2:])
        xy = swarm.world_from_object[tile.members, :2, 3]
        side = 40.0 if tile.beyond else 5.0
        assert (np.floor((xy + SIDE / 2) / side) == (i, j)).all()
        assert surface.label == Label.HIGH_GRASS
        expected = sum(
            mesh_areas(world.meshes[swarm.meshes[swarm.mesh[m]]])["grass"] * (0.8 + 0.01 * m) ** 2 for m in tile.members
        )
        assert np.isclose(areas(corners_of(surface)).sum(), expected, rtol=1e-5)


def test_members_beyond_the_edge_are_optional() -> None:
    world = small_world()
    inside = list(tiles_of_swarms(world, 5.0, beyond=False))
    assert beyond_edge(world, world.swarms[0]).nonzero()[0].tolist() == list(range(30, 40))
    assert sorted(np.concatenate([tile.members for tile in inside]).tolist()) == list(range(30))
    assert not any(tile.beyond for tile in inside)


def test_vertices_have_pose_and_tint_of_their_member() -> None:
    world = small_world()
    (swarm,) = world.swarms
    (tile,) = tiles_of_swarms(world, 100.0, beyond=False)
    (surface,) = tile.surfaces(world)
    assert surface.tint is not None
    found = {tuple(np.round(v, 4)): t for v, t in zip(surface.vertices.tolist(), surface.tint.tolist(), strict=True)}
    for member in (0, 1, 17):
        mesh = world.meshes[swarm.meshes[swarm.mesh[member]]]
        for vertex in mesh.vertices:
            at = swarm.world_from_object[member, :3, :3] @ vertex + swarm.world_from_object[member, :3, 3]
            nearest = min(found, key=lambda v, at=at: float(np.abs(np.array(v) - at).max()))  # type: ignore[misc]
            np.testing.assert_allclose(nearest, at, atol=1e-4)
            np.testing.assert_array_equal(found[nearest], swarm.tint[member].tolist())

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Surfaces keep every triangle of a mesh, its class and its winding."""

import numpy as np
from interchange_worlds import across, areas, corners_of, mesh_areas, pose, small_world

from fieldtruth.core.classes import Label
from fieldtruth.interchange.surfaces import merge_surfaces, mesh_surfaces, placed


def test_a_mesh_is_split_by_material_with_the_vertices_that_each_part_uses() -> None:
    world = small_world()
    tree = world.meshes["tree"]
    bark, leaf = mesh_surfaces(tree, world.materials)
    assert (bark.label, leaf.label) == (Label.TRUNK, Label.TREETOP)
    assert (len(bark.faces), len(leaf.faces)) == (8, 4)
    for surface in (bark, leaf):
        assert set(surface.faces.ravel()) == set(range(len(surface.vertices)))
        assert np.isclose(areas(corners_of(surface)).sum(), mesh_areas(tree)[surface.material])
    both = np.concatenate([corners_of(bark), corners_of(leaf)])
    order = np.argsort(tree.material, kind="stable")
    np.testing.assert_array_equal(both, tree.vertices[tree.faces][order])


def test_placed_copies_are_rotated_scaled_and_moved() -> None:
    world = small_world()
    (surface,) = mesh_surfaces(world.meshes["bench"], world.materials)
    poses = np.array([pose(1, 2, 3, yaw_deg=40, tilt_deg=20, scale=2.0), pose(-5, 0, 1)])
    tints = np.array([[1, 2, 3], [4, 5, 6]], np.float32)
    copies = placed(surface, poses, tints)
    corners, count = corners_of(copies), len(surface.faces)
    assert len(copies.faces) == 2 * count
    expected = corners_of(surface) @ poses[0, :3, :3].T + poses[0, :3, 3]
    np.testing.assert_allclose(corners[:count], expected, atol=1e-6)
    np.testing.assert_allclose(areas(corners[:count]), 4 * areas(corners_of(surface)), rtol=1e-5)
    outwards = across(corners) / np.linalg.norm(across(corners), axis=1, keepdims=True)
    np.testing.assert_allclose(copies.normals[copies.faces[:, 0]], outwards, atol=1e-5)
    assert copies.tint is not None
    np.testing.assert_array_equal(copies.tint[copies.faces[:, 0]], np.repeat(tints, count, axis=0))


def test_merged_surfaces_keep_all_triangles() -> None:
    world = small_world()
    (surface,) = mesh_surfaces(world.meshes["bench"], world.materials)
    moved = placed(surface, pose(9, 0, 0)[None], np.full((1, 3), 0.5, np.float32))
    merged = merge_surfaces([surface, moved])
    np.testing.assert_array_equal(corners_of(merged), np.concatenate([corners_of(surface), corners_of(moved)]))
    assert merged.tint is not None
    assert merged.tint[:1].tolist() == [[1, 1, 1]]
    assert merged.tint[-1:].tolist() == [[0.5, 0.5, 0.5]]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Furniture has real dimensions, feet in the ground, one class, and colliders that fit."""

import numpy as np
import pytest
from mesh_checks import assert_valid, face_normals

from fieldtruth.core.arrays import Float32Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.furniture import FURNITURE, make_furniture
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Collider

LABELS = {"bench": Label.BENCH, "table": Label.TABLE, "lamp_post": Label.LAMP_POST, "trash_bin": Label.TRASH_BIN}
# Height, then extent along x and y [m]: least and most.
SIZES = {
    "bench_0": ((0.82, 0.90), (0.55, 0.75), (1.6, 1.8)),
    "bench_1": ((0.82, 0.90), (0.55, 0.75), (1.6, 1.8)),
    "bench_2": ((0.42, 0.48), (0.40, 0.55), (1.6, 1.8)),
    "table_0": ((0.72, 0.78), (0.75, 0.85), (1.7, 1.9)),
    "table_1": ((0.72, 0.78), (0.9, 1.1), (0.9, 1.1)),
    "lamp_post_0": ((4.0, 5.0), (0.3, 0.6), (0.3, 0.6)),
    "lamp_post_1": ((4.0, 5.0), (0.3, 0.7), (0.3, 0.7)),
    "trash_bin_0": ((0.85, 0.95), (0.5, 0.65), (0.5, 0.65)),
    "trash_bin_1": ((0.85, 1.05), (0.4, 0.6), (0.38, 0.5)),
}


PIECES = {name: (make_furniture(name), LABELS[name.rpartition("_")[0]]) for name in SIZES}


def test_every_piece_is_measured() -> None:
    """Here, in ``test_power_line``, ``test_site_objects`` or ``test_rural``."""
    rural = {"stone_wall_0", "stone_wall_1", "stone_wall_2", "trellis"}
    assert set(FURNITURE) == {*SIZES, "power_pole_0", "power_pole_1", "bollard", *rural}


def inside(collider: Collider, points: Float32Array, margin: float) -> Mask:
    """Return which points (n, 3) are within a margin [m] of the collider; colliders of furniture are not rotated."""
    assert collider.yaw_deg == 0.0
    x, y, z = (points - np.array(collider.position)).T
    tall = (z > -margin) & (z < collider.size[-1] + margin)
    if collider.shape == "cylinder":
        return np.asarray(tall & (np.hypot(x, y) < collider.size[0] + margin))
    return np.asarray(tall & (np.abs(x) < collider.size[0] / 2 + margin) & (np.abs(y) < collider.size[1] / 2 + margin))


@pytest.mark.parametrize("name", PIECES)
def test_dimensions_are_those_of_real_furniture(name: str) -> None:
    mesh, _ = PIECES[name]
    height, along, across = SIZES[name]
    assert mesh.name == name
    assert height[0] < mesh.vertices[:, 2].max() < height[1]
    assert along[0] < np.ptp(mesh.vertices[:, 0]) < along[1]
    assert across[0] < np.ptp(mesh.vertices[:, 1]) < across[1]
    assert 400 < len(mesh.faces) < 5_000
    # Bevels and rims may be up to 3 cm outside the footprint.
    assert mesh.footprint >= np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]).max() - 0.03


@pytest.mark.parametrize("name", PIECES)
def test_feet_are_in_the_ground(name: str) -> None:
    mesh, _ = PIECES[name]
    assert -0.11 < mesh.vertices[:, 2].min() <= -0.05


@pytest.mark.parametrize("name", PIECES)
def test_mesh_is_valid(name: str) -> None:
    mesh, _ = PIECES[name]
    count = len(mesh.vertices)
    assert_valid(mesh, least_area=0.0)
    np.testing.assert_array_equal(np.unique(mesh.faces), np.arange(count))
    assert (np.einsum("ij,ij->i", face_normals(mesh), mesh.normals[mesh.faces].sum(axis=1)) > 0).all()


@pytest.mark.parametrize("name", PIECES)
def test_every_material_has_the_class_of_the_object(name: str) -> None:
    mesh, label = PIECES[name]
    assert {MATERIALS[m].label for m in mesh.materials} == {label}
    assert set(np.unique(mesh.material)) == set(range(len(mesh.materials)))


@pytest.mark.parametrize("name", PIECES)
def test_colliders_enclose_vertices_up_to_one_metre(name: str) -> None:
    mesh, _ = PIECES[name]
    low = mesh.vertices[mesh.vertices[:, 2] < 1.0]
    enclosed = np.any([inside(c, low, 0.05) for c in mesh.colliders], axis=0)
    assert enclosed.all()


@pytest.mark.parametrize("name", PIECES)
def test_colliders_are_at_most_5_cm_larger_than_the_mesh(name: str) -> None:
    mesh, _ = PIECES[name]
    for c in mesh.colliders:
        half = np.array((c.size[0],) * 2 if c.shape == "cylinder" else (c.size[0] / 2, c.size[1] / 2))
        bottom, top = c.position[2], c.position[2] + c.size[-1]
        near = mesh.vertices[(mesh.vertices[:, 2] > bottom - 0.05) & (mesh.vertices[:, 2] < top + 0.05)]
        assert (np.array(c.position[:2]) + half < near[:, :2].max(axis=0) + 0.05).all()
        assert (np.array(c.position[:2]) - half > near[:, :2].min(axis=0) - 0.05).all()
        assert top < mesh.vertices[:, 2].max() + 0.05


@pytest.mark.parametrize(("name", "width"), [("bench_0", 1.7), ("bench_1", 1.7)])
def test_benches_face_forward(name: str, width: float) -> None:
    mesh, _ = PIECES[name]
    wood = mesh.vertices[mesh.faces[mesh.material == mesh.materials.index("bench_wood")]].reshape(-1, 3)
    seat, back = wood[wood[:, 2] < 0.47], wood[wood[:, 2] > 0.52]
    assert seat[:, 0].max() > 0.2
    assert back[:, 0].max() < -0.1
    assert 0.42 < seat[:, 2].max() < 0.47
    assert np.ptp(wood[:, 1]) == pytest.approx(width, abs=1e-3)


def test_unknown_furniture_is_rejected() -> None:
    with pytest.raises(ConfigurationError, match="unknown furniture 'bench_3'; did you mean 'bench_"):
        make_furniture("bench_3")

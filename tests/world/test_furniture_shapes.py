# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes have the volume in closed form, are closed, and have outward normals."""

import numpy as np
import pytest

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose
from fieldtruth.world.model import Mesh
from fieldtruth.world.solids import (
    TILE,
    at_length,
    bar_outline,
    make_box,
    make_extrusion,
    make_lathe,
    make_tube,
    path_length,
    placed,
    rounded,
    signed_area,
    triangulate,
)

L_SHAPE = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)], np.float64)
VASE = np.array([(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.5), (0, 0.5)], np.float64)


def corners(mesh: Mesh) -> Array:
    return mesh.vertices.astype(np.float64)[mesh.faces]


def volume(mesh: Mesh) -> float:
    a, b, c = corners(mesh).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def area(mesh: Mesh) -> float:
    a, b, c = corners(mesh).transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def open_edges(mesh: Mesh) -> int:
    """Number of edges that are not traversed once in each direction, with vertices merged by position."""
    _, same = np.unique(np.round(mesh.vertices, 5), axis=0, return_inverse=True)
    faces = same.ravel()[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = ({tuple(e) for e in some} for some in (edges.tolist(), edges[:, ::-1].tolist()))
    return len(there ^ back)


def frustum_sum(profile: Array) -> float:
    r, z = profile.T
    return float((np.diff(z) * (r[:-1] ** 2 + r[:-1] * r[1:] + r[1:] ** 2)).sum() / 3)


def ngon(sides: int) -> float:
    """Area of a regular polygon in a circle of radius 1."""
    return sides / 2 * float(np.sin(2 * np.pi / sides))


SHAPES = {
    "box": make_box("m", (1.0, 0.2, 0.1), bevel=0.01),
    "tube": make_tube("m", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1.5, 2)], 0.03),
    "lathe": make_lathe("m", VASE),
    "lantern": make_lathe("m", VASE, sides=4, faceted=True),
    "extrusion": make_extrusion("m", L_SHAPE, 0.5),
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_closed_and_normals_are_unit_and_outward(name: str) -> None:
    mesh = SHAPES[name]
    assert open_edges(mesh) == 0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
    a, b, c = corners(mesh).transpose(1, 0, 2)
    facing = np.cross(b - a, c - a)
    for k in range(3):
        assert np.einsum("ij,ij->i", facing, mesh.normals[mesh.faces[:, k]]).min() > 0
    assert volume(mesh) > 0


def test_bevelled_box_has_its_volume_and_size() -> None:
    length, width, height, cut = 1.0, 0.2, 0.1, 0.01
    edges = 4 * (cut**2 / 2) * (length + width + height - 6 * cut)
    expected = length * width * height - edges - 8 * (5 / 6) * cut**3
    box = SHAPES["box"]
    assert len(box.faces) == 44
    assert volume(box) == pytest.approx(expected, rel=1e-6)
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), (length, width, height), atol=1e-6)


def test_grain_runs_along_the_longest_side() -> None:
    box = make_box("m", (0.1, 1.5, 0.04))
    long_sides = np.abs(box.normals[:, 1]) < 0.5
    np.testing.assert_allclose(box.uv[long_sides, 0] * TILE, box.vertices[long_sides, 1], atol=1e-6)


@pytest.mark.parametrize("bevel", [0.0, 0.05])
def test_bevel_out_of_range_is_rejected(bevel: float) -> None:
    with pytest.raises(ValueError, match=r"between 0 and half the smallest side, 0\.05"):
        make_box("m", (1, 0.2, 0.1), bevel=bevel)


def test_bent_tube_keeps_its_cross_section() -> None:
    path = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1.5, 2)], np.float64)
    assert volume(SHAPES["tube"]) == pytest.approx(ngon(10) * 0.03**2 * path_length(path), rel=1e-5)
    straight = make_tube("m", [(0, 0, 1), (0, 0, 3)], 0.5, sides=6)
    assert area(straight) == pytest.approx(2 * ngon(6) * 0.25 + 6 * 0.5 * 2, rel=1e-6)


@pytest.mark.parametrize(("sides", "faceted"), [(24, False), (4, True), (8, True)])
def test_lathe_has_the_volume_of_its_frustums(sides: int, faceted: bool) -> None:
    assert volume(make_lathe("m", VASE, sides=sides, faceted=faceted)) == pytest.approx(
        ngon(sides) * frustum_sum(VASE), rel=1e-5
    )


def test_facets_have_flat_normals_and_round_sides_radial_ones() -> None:
    prism = [(0, 0), (1, 0), (1, 2), (0, 2)]
    a, b, c = corners(make_lathe("m", prism, sides=6, faceted=True)).transpose(1, 0, 2)
    faceted = make_lathe("m", prism, sides=6, faceted=True)
    facing = np.cross(b - a, c - a)
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    np.testing.assert_allclose(faceted.normals[faceted.faces[:, 1]], facing, atol=1e-6)
    smooth = make_lathe("m", prism, sides=6)
    side = np.abs(smooth.normals[:, 2]) < 0.5
    spoke = smooth.vertices[side] * (1, 1, 0)
    np.testing.assert_allclose(smooth.normals[side], spoke, atol=1e-6)


def test_extrusion_has_its_volume_and_area() -> None:
    mesh = SHAPES["extrusion"]
    assert volume(mesh) == pytest.approx(4 * 0.5, rel=1e-6)
    assert area(mesh) == pytest.approx(2 * 4 + 10 * 0.5, rel=1e-6)


def test_triangles_of_a_polygon_cover_its_area() -> None:
    ears = triangulate(L_SHAPE)
    assert len(ears) == len(L_SHAPE) - 2
    assert sum(signed_area(L_SHAPE[e]) for e in ears) == pytest.approx(signed_area(L_SHAPE)) == pytest.approx(4.0)
    assert min(signed_area(L_SHAPE[e]) for e in ears) > 0
    with pytest.raises(ValueError, match="anticlockwise"):
        triangulate(L_SHAPE[::-1])


def test_rounded_right_angle_is_a_quarter_circle() -> None:
    path = rounded([(0, 0), (1, 0), (1, 1)], 0.25, steps=200)
    assert path_length(path) == pytest.approx(2 - 2 * 0.25 + np.pi / 2 * 0.25, abs=1e-5)
    np.testing.assert_allclose(path[[0, -1]], [(0, 0), (1, 1)])


def test_bar_outline_has_its_thickness() -> None:
    path = np.array([(0, 0), (1, 0), (1, 1)], np.float64)
    outline = bar_outline(path, 0.1)
    assert signed_area(outline) == pytest.approx(2 * 0.1)  # mitred: the gain of one side is the loss of the other
    points, slopes = at_length(path, [0.5, 1.5])
    np.testing.assert_allclose(points, [(0.5, 0), (1, 0.5)])
    np.testing.assert_allclose(slopes, [0, np.pi / 2])


def test_placed_transforms_vertices_normals_and_uv() -> None:
    box = SHAPES["box"]
    turned = placed(box, pose((1, 2, 3), (0, 0, 90)), uv_shift=(0.5, 0.0))
    np.testing.assert_allclose(
        turned.vertices, box.vertices @ [(0, 1, 0), (-1, 0, 0), (0, 0, 1)] + (1, 2, 3), atol=1e-6
    )
    np.testing.assert_allclose(turned.normals, box.normals @ [(0, 1, 0), (-1, 0, 0), (0, 0, 1)], atol=1e-6)
    np.testing.assert_allclose(turned.uv, box.uv + np.array((0.5, 0)), atol=1e-6)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Skeletons and their surfaces: joints, tapers and normals for every species."""

from itertools import pairwise

import numpy as np
import pytest

from fieldtruth.world.plants import BUSHES, TREES, Species
from fieldtruth.world.plants.growth import Stems, grow_skeleton, trunk, tubes

PLANTS = [
    *[(s, h) for s in TREES.values() for h in (11.0, 3.6)],
    (BUSHES["box"], 1.0),
    (BUSHES["hazel"], 2.4),
]
plants = pytest.mark.parametrize(("species", "height"), PLANTS, ids=str)


def skeleton(species: Species, height: float, seed: int = 5) -> tuple[Stems, ...]:
    return grow_skeleton(species.habit(height), height, np.random.default_rng(seed))


@plants
def test_stems_taper_and_are_not_thicker_than_their_parent_at_the_joint(species: Species, height: float) -> None:
    orders = skeleton(species, height)
    for parents, stems in pairwise(orders):
        assert (np.diff(stems.radius, axis=1) <= 0).all()
        assert (stems.radius > 0).all()
        _, _, at_joint = parents.at(stems.parent, stems.joint)
        assert (stems.radius[:, 0] <= at_joint + 1e-12).all()
        assert (stems.length < parents.length[stems.parent]).mean() > 0.9


@plants
def test_stems_start_inside_their_parent(species: Species, height: float) -> None:
    orders = skeleton(species, height)
    for parents, stems in pairwise(orders):
        axis, _, radius = parents.at(stems.parent, stems.joint)
        gap = np.linalg.norm(stems.axis[:, 0] - axis, axis=1)
        # Shearing bends the parents; the chord of a segment is then a few millimetres off the arc.
        assert (gap <= radius + (0.015 if species.grown.sheared else 0)).all()


@plants
def test_orders_have_about_the_stated_number_of_stems(species: Species, height: float) -> None:
    habit = species.habit(height)
    orders = skeleton(species, height)
    assert len(orders) >= 3
    assert len(orders[0].length) == habit.stems
    for stems, order in zip(orders[1:], habit.orders, strict=True):
        assert 0.35 * order.number < len(stems.length) < 1.2 * order.number


@pytest.mark.parametrize("height", [9.0, 11.0, 15.0])
@pytest.mark.parametrize("name", TREES)
def test_highest_twig_is_at_the_requested_height(name: str, height: float) -> None:
    top = max(float(stems.axis[:, :, 2].max()) for stems in skeleton(TREES[name], height))
    assert top == pytest.approx(height, abs=1e-9)


def straight(radius: float, length: float, nodes: int = 5) -> Stems:
    axis = np.linspace([0, 0, -0.2], [0, 0, length - 0.2], nodes)[None]
    none = np.full(1, -1, np.intp)
    taper = np.linspace(radius, radius / 2, nodes)[None]
    return Stems(axis=axis, radius=taper, length=np.array([length]), parent=none, joint=np.zeros(1), limb=none)


def test_tube_around_a_straight_stem_is_a_cone() -> None:
    stems = straight(0.3, 4.0)
    vertices, normals, uv, faces = tubes(stems, 8)
    rings = vertices.reshape(5, 9, 3)
    for ring, radius in zip(rings[:-1], stems.radius[0], strict=False):
        np.testing.assert_allclose(np.hypot(ring[:, 0], ring[:, 1]), radius, atol=1e-12)
    np.testing.assert_array_equal(rings[:, 0], rings[:, -1])
    # slope of the side: 0.15 m over 4 m
    np.testing.assert_allclose(normals[:, 2], (0.15 / 4) / np.hypot(1, 0.15 / 4), atol=1e-12)
    # circumference 1.885 m: three repeats of 0.628 m around, same scale along the stem
    np.testing.assert_allclose(uv.reshape(5, 9, 2)[:, -1, 0] - uv.reshape(5, 9, 2)[:, 0, 0], 3)
    assert uv[:, 1].max() == pytest.approx(4.0 / (2 * np.pi * 0.3 / 3))
    assert len(faces) == 2 * 8 * 4 - 8


def test_trunk_widens_at_the_ground_by_its_flare() -> None:
    vertices, _, _, _ = trunk(straight(0.2, 6.0), 32, 0.5, np.random.default_rng(0))
    radius = np.hypot(vertices[:, 0], vertices[:, 1])
    ground = np.abs(vertices[:, 2]) < 0.05
    breast = np.abs(vertices[:, 2] - 1.3) < 0.3
    assert radius[ground].mean() == pytest.approx(0.2 * 1.5, rel=0.1)
    assert radius[breast].mean() == pytest.approx(0.2 * (1 - 0.5 * 1.5 / 6), rel=0.03)


@plants
def test_bark_normals_point_outwards(species: Species, height: float) -> None:
    habit = species.habit(height)
    orders = skeleton(species, height)
    surfaces = [(tubes(s, o.sides), s, o.sides) for s, o in zip(orders[1:], habit.orders, strict=True)]
    if habit.stems == 1:
        surfaces.append((trunk(orders[0], habit.trunk_sides, habit.flare, np.random.default_rng(0)), orders[0], 0))
    for (vertices, normals, uv, faces), stems, sides in surfaces:
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
        corner = vertices[faces]
        face_normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        agree = (face_normal * normals[faces].mean(1)).sum(1) > 0
        assert agree.mean() > 0.995  # a sharp bend of a thick stem may fold a few triangles on its inner side
        assert np.isfinite(uv).all()
        if sides:
            rings = stems.axis.shape[1]
            spoke = vertices.reshape(-1, rings, sides + 1, 3) - stems.axis[:, :, None]
            outward = (spoke * normals.reshape(spoke.shape)).sum(3)
            assert (outward[:, :-1] > 0).all()

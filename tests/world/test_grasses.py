# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tufts and clumps: triangle budgets, roots, tapered and bent blades, classes, and the same bytes from a seed."""

import numpy as np
import pytest
from mesh_checks import assert_same_bytes, assert_valid
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import GRASSES, GrassSpecies, grow_clump, grow_tuft
from fieldtruth.world.plants.grasses import STEPS, discs, kites, midribs, pinnae, spindles, strips
from fieldtruth.world.plants.growth import Surface

every_species = pytest.mark.parametrize("species", GRASSES.values(), ids=str)
SEEDS = (1, 2, 3)
WIDEST = {
    "dock": 0.12,
    "nettle": 0.12,
    "beech_seedling": 0.05,
    "fern": 0.45,
    "bracken": 0.7,
    "reed": 0.045,
    "cattail": 0.04,
    "maize": 0.14,
    "maize_young": 0.12,
    "maize_seedling": 0.06,
    "marsh_marigold": 0.15,
    "meadowsweet": 0.08,
    "wheat_green": 0.025,
}  # [m], else 0.02


BUDGET = {"fern": 800, "bracken": 450, "nettle": 450, "reed": 450}
"""Triangles: a fern has 7 fronds of 52 pinnae, nettle and reed 50 to 70 leaves of 6 triangles; else 320."""


def grow(species: GrassSpecies, *, share: float = 0.5, seed: int = 5, detail: float = 1.0) -> Mesh:
    height = species.height[0] + share * (species.height[1] - species.height[0])
    return grow_tuft(species, name="tuft", height=height, rng=np.random.default_rng(seed), detail=detail)


def areas(vertices: NDArray[np.floating], faces: NDArray[np.int32]) -> Array:
    corner = vertices[faces].astype(np.float64)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.asarray(0.5 * np.linalg.norm(normal, axis=1))


def blades(count: int, *, kite: bool = False, bend: float = 1.2, roll: float = 0.0) -> tuple[Array, Surface]:
    """Upright blades, 0.5 m long and 1 cm wide, that bend towards +x; their midribs and their surface."""
    path = midribs(np.zeros((count, 3)), *(np.full(count, v) for v in (0.0, 0.5, 0.0, bend, 0.0)))
    turn = np.full(count, roll)
    band = np.tile([0.1, 0.3], (count, 1))
    return path, strips(path, np.full(count, 0.01), np.full(count, 0.12), turn, 0 * turn, band, kite=kite)


def test_species_of_every_environment_exist() -> None:
    assert {"meadow", "dry", "reed", "sedge", "forest", "fern", "nettle", "daisy"} <= set(GRASSES)
    assert all(name == species.name for name, species in GRASSES.items())


@every_species
def test_mesh_is_valid_and_within_the_budget(species: GrassSpecies) -> None:
    for seed in SEEDS:
        mesh = grow(species, seed=seed)
        assert_valid(mesh, least_area=1e-7)
        assert 60 <= len(mesh.faces) <= BUDGET.get(species.name, 320)
        np.testing.assert_array_equal(np.unique(mesh.faces), np.arange(len(mesh.vertices)))  # every vertex is used
        assert not mesh.colliders


@every_species
def test_height_is_as_requested(species: GrassSpecies) -> None:
    for share in (0.0, 0.5, 1.0):
        mesh = grow(species, share=share)
        height = species.height[0] + share * (species.height[1] - species.height[0])
        assert height * 0.999 < mesh.vertices[:, 2].max() < 1.08 * height + 0.01


@every_species
def test_roots_are_in_the_soil_on_a_slope(species: GrassSpecies) -> None:
    """The lowest vertex of each blade is at least 0.1 m in the soil, even on a slope of 0.5."""
    for seed in SEEDS:
        mesh = grow(species, seed=seed)
        root = mesh.vertices[mesh.vertices[:, 2] < -0.05].astype(np.float64)
        off = np.hypot(root[:, 0], root[:, 1])
        assert (root[:, 2] < -0.1 - 0.5 * off).all()
        assert off.max() < 1.05 * mesh.footprint + 1e-6
        stems = sum(blades.number for blades in species.blades)
        assert len(root) == stems  # so no tip is below the soil


@every_species
def test_blades_are_not_wider_than_stated(species: GrassSpecies) -> None:
    mesh = grow(species, share=1.0)
    widest = WIDEST.get(species.name, 0.02)
    disc = [row for row, name in enumerate(mesh.materials) if name.startswith(("petal", "blade_seed", "blade_plume"))]
    faces = mesh.faces[~np.isin(mesh.material, disc)]
    corner = mesh.vertices[faces].astype(np.float64)
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    across = 2 * areas(mesh.vertices, faces) / sides.max(axis=1)  # the least height of each triangle
    assert across.max() < widest


@every_species
def test_all_materials_are_high_grass(species: GrassSpecies) -> None:
    mesh = grow(species)
    assert {MATERIALS[name].label for name in mesh.materials} == {Label.HIGH_GRASS}
    assert set(np.unique(mesh.material)) == set(range(len(mesh.materials)))


@every_species
def test_blade_has_one_shade(species: GrassSpecies) -> None:
    """Cameras vary the shade by groups of four vertices, by a triangle's first: it is in its shape's first four."""
    mesh = grow(species)
    thin = [MATERIALS[name].translucency > 0 for name in mesh.materials]
    for face in mesh.faces[np.array(thin)[mesh.material]]:
        assert face[0] // 4 <= face.min() // 4


@every_species
def test_less_detail_gives_fewer_and_wider_blades(species: GrassSpecies) -> None:
    full, coarse = grow(species), grow(species, detail=0.4)
    assert len(coarse.faces) < 0.65 * len(full.faces)
    assert areas(coarse.vertices, coarse.faces).sum() > 0.4 * areas(full.vertices, full.faces).sum()
    assert coarse.vertices[:, 2].max() == pytest.approx(full.vertices[:, 2].max(), rel=0.08)


@every_species
def test_same_seed_gives_same_bytes_and_another_seed_another_tuft(species: GrassSpecies) -> None:
    first, again, other = (grow(species, seed=s) for s in (8, 8, 9))
    assert_same_bytes(first, again)
    assert first.vertices.tobytes() != other.vertices.tobytes()


@pytest.mark.parametrize("name", ["meadow", "dry", "forest", "sedge"])
def test_blades_differ_in_height_and_direction(name: str) -> None:
    mesh = grow(GRASSES[name])
    tips = mesh.vertices[mesh.uv[:, 1] == 1].astype(np.float64)
    assert tips[:, 2].std() > 0.15 * mesh.vertices[:, 2].max()
    turn = np.arctan2(tips[:, 1], tips[:, 0])
    assert np.abs(np.exp(1j * turn).mean()) < 0.8  # in all directions, although the tuft leans
    assert (mesh.normals[:, 2] > 0.3).mean() > 0.95  # lit from above


@pytest.mark.parametrize("height", [-1.0, 0.1, 1.0, float("nan")])
def test_height_outside_the_range_of_the_species_is_rejected(height: float) -> None:
    with pytest.raises(ValueError, match=r"height of meadow must be between 0\.15 and 0\.9 m, got"):
        grow_tuft(GRASSES["meadow"], name="tuft", height=height, rng=np.random.default_rng(0))


@pytest.mark.parametrize("detail", [0.0, -1.0, 5.0, float("nan")])
def test_detail_out_of_range_is_rejected(detail: float) -> None:
    with pytest.raises(ValueError, match=r"detail of meadow must be above 0 and at most 4, got"):
        grow(GRASSES["meadow"], detail=detail)


def test_midrib_has_the_requested_length_and_bends_by_the_formula() -> None:
    path, _ = blades(1)
    steps = np.diff(path[0], axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(0.5, rel=1e-12)
    tilt = np.arctan2(steps[:, 0], steps[:, 2])
    np.testing.assert_allclose(tilt, 1.2 * ((np.arange(STEPS) + 0.5) / STEPS) ** 1.5, atol=1e-12)
    assert np.abs(path[0, :, 1]).max() == 0


def test_blade_tapers_and_is_rooted() -> None:
    path, (vertices, normals, uv, faces) = blades(2)
    blade = vertices[:8]
    np.testing.assert_allclose(blade[0], [0, 0, -0.12])
    np.testing.assert_allclose(blade[7], path[0, -1])
    width = np.linalg.norm(blade[1:4] - blade[4:7], axis=1)
    np.testing.assert_allclose(width, 0.01 * np.array([1.0, 0.86, 0.5]), atol=1e-12)
    np.testing.assert_allclose(np.abs(blade[1:4, 1]), width / 2)  # across the plane in which it bends
    assert len(faces) == 12
    np.testing.assert_allclose(uv[0], [0.2, 0])
    np.testing.assert_allclose(uv[7], [0.2, 1])
    assert (normals[:, 2] > 0.5).all()


@pytest.mark.parametrize("kite", [False, True])
def test_bent_blade_has_no_triangle_from_root_to_tip(kite: bool) -> None:
    """A bent blade has the area of the straight strip; no edge connects root and tip."""
    _, (straight, _, _, faces) = blades(1, kite=kite, bend=0.0)
    _, (bent, _, _, _) = blades(1, kite=kite, bend=2.2)
    assert areas(bent, faces).sum() < 1.02 * areas(straight, faces).sum()
    edges = {tuple(sorted(e)) for f in faces.tolist() for e in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))}
    assert (0, len(bent) - 1 if not kite else 2) not in edges


def test_triangles_face_the_side_of_their_normals() -> None:
    rng = np.random.default_rng(0)
    path, _ = blades(3)
    straight_up = np.tile([0.0, 0.0, 1.0], (3, 1))
    low, high = np.zeros((3, 3)), straight_up * 0.2
    sideways = np.tile([1.0, 0.0, 0.0], (3, 1))
    surfaces = {
        "blade": blades(3)[1],
        "kite": blades(3, kite=True)[1],
        "leaf": kites(low, sideways, straight_up, np.full(3, 0.1), np.full(3, 0.04), 0.4),
        "disc": discs(high, straight_up, np.full(3, 0.02)),
        "spindle": spindles(low, high, np.full(3, 0.01)),
        "frond": pinnae(
            midribs(low, *(np.full(3, v) for v in (0.3, 0.5, 1.2, 0.3, 0.0))), 8, np.full(3, 0.1), 0.1, rng
        ),
    }
    assert len(path) == 3
    for name, (vertices, normals, _, faces) in surfaces.items():
        corner = vertices[faces]
        own = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        assert ((own * normals[faces].mean(1)).sum(1) > 0).all(), name
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)


def test_disc_and_spindle_have_the_requested_size() -> None:
    vertices, _, _, faces = discs(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.full(1, 0.02))
    assert areas(vertices, faces).sum() == pytest.approx(2 * np.sqrt(2) * 0.02**2)  # regular octagon
    vertices, _, _, faces = spindles(np.zeros((1, 3)), np.array([[0.0, 0.0, 0.2]]), np.full(1, 0.01))
    assert np.hypot(*vertices[:, :2].T).max() == pytest.approx(0.01)
    corner = vertices[faces]
    volume = np.einsum("ij,ij->i", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum() / 6
    triangle = 3 * np.sqrt(3) / 4 * 0.01**2
    assert volume == pytest.approx(triangle * 0.2 * (0.88 + 2 * 0.06 / 3))  # closed: prism and two pyramids


def test_clump_mixes_species_at_the_requested_density() -> None:
    mixed = {GRASSES["meadow"]: 3.0, GRASSES["daisy"]: 1.0}
    mesh = grow_clump(mixed, name="clump", radius=0.6, per_m2=20, rng=np.random.default_rng(1))
    tufts = round(20 * np.pi * 0.36)
    mean = 0.75 * len(grow(GRASSES["meadow"]).faces) + 0.25 * len(grow(GRASSES["daisy"]).faces)
    assert len(mesh.faces) / tufts == pytest.approx(mean, rel=0.1)
    assert "petal_daisy" in mesh.materials
    assert mesh.footprint == 0.6
    root = mesh.vertices[mesh.vertices[:, 2] < -0.05]
    assert np.quantile(np.hypot(root[:, 0], root[:, 1]), 0.98) < 0.6 + 0.25
    deep = -root[:, 2] / np.maximum(np.hypot(root[:, 0], root[:, 1]), 0.3)
    assert deep.min() > 0.2
    again = grow_clump(mixed, name="clump", radius=0.6, per_m2=20, rng=np.random.default_rng(1))
    assert mesh.vertices.tobytes() == again.vertices.tobytes()
    assert not mesh.colliders


def test_clump_height_grows_with_size() -> None:
    heights = []
    for size in (0.0, 0.5, 1.0):
        rng = np.random.default_rng(2)
        mesh = grow_clump({GRASSES["dry"]: 1.0}, name="c", radius=0.5, per_m2=15, rng=rng, size=size)
        heights.append(mesh.vertices[:, 2].mean())
    assert heights[0] < 0.9 * heights[1] < 0.8 * heights[2]

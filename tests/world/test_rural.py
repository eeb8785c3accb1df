# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants and things of farmland, thickets and dry hills: rows along x, stages of growth, seasons, walls, classes."""

import numpy as np
import pytest
from mesh_checks import assert_same_bytes, assert_valid, face_normals

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_tree, grow_tuft
from fieldtruth.world.rocks import BATTER
from fieldtruth.world.seasons import albedo, changes
from fieldtruth.world.seasons.leaves import in_season

WALLS = {"stone_wall_0": (1.6, 0.6, 0.9), "stone_wall_1": (1.6, 0.62, 1.1), "stone_wall_2": (1.3, 0.6, 0.8)}
"""Length, thickness at the foot, and height [m], as their file states."""
STAGES = {
    "wheat_seedling": 0.1, "wheat_green": 0.5, "wheat_ripe": 0.9,
    "maize_seedling": 0.3, "maize_young": 1.0, "maize": 2.3,
}  # fmt: skip
"""Height [m] that each stage is made for."""


def plant(name: str, height: float, seed: int = 4) -> Mesh:
    rng = np.random.default_rng(seed)
    if name in BUSHES:
        return grow_bush(BUSHES[name], name=name, height=height, rng=rng)
    return grow_tree(TREES[name], name=name, height=height, rng=rng, detail=0.1)


def triangles(mesh: Mesh, material: str) -> int:
    """Count the triangles of a material and of its variants of other colours."""
    rows = [k for k, name in enumerate(mesh.materials) if name.startswith(material)]
    return int(np.isin(mesh.material, rows).sum())


def wood_at(mesh: Mesh, low: float, high: float) -> Array:
    """Vertices of the wood between two heights [m]."""
    vertices = mesh.vertices[np.unique(mesh.faces[mesh.material == 0])]
    return np.asarray(vertices[(vertices[:, 2] > low) & (vertices[:, 2] < high)], np.float64)


@pytest.mark.parametrize("seed", range(4))
def test_a_vine_is_a_wall_along_x(seed: int) -> None:
    """Cordon of 1.2 m along x, canopy from it up to 1.9 m that is narrower across, trunk below."""
    vine = plant("vine", 1.9, seed)
    trunk, cordon = wood_at(vine, 0.02, 0.5), wood_at(vine, 0.75, 1.05)
    assert np.ptp(trunk[:, :2], axis=0).max() < 0.4
    assert 0.9 < np.ptp(cordon[:, 0]) < 2.0
    assert np.median(cordon[:, 2]) == pytest.approx(0.85, abs=0.12)  # where the trellis has its lowest wire
    leaves = vine.vertices[np.unique(vine.faces[vine.material == 1])]
    along, across, high = leaves.std(axis=0)
    assert 1.5 * across < along
    assert across < high
    assert np.quantile(leaves[:, 2], 0.02) > 0.55
    assert np.quantile(leaves[:, 2], 0.98) < 2.0


@pytest.mark.parametrize(("name", "height"), [("apple", 3.4), ("vine", 1.9), ("blackthorn", 2.2)])
def test_leaves_fall_in_winter_and_pruned_vines_have_no_twigs(name: str, height: float) -> None:
    species = {**TREES, **BUSHES}[name]
    summer = plant(name, height)
    winter = in_season(summer, changes("winter"), 1)
    assert triangles(winter, species.foliage) <= 0.02 * triangles(summer, species.foliage)
    assert (triangles(winter, f"{species.wood}_twigs") == 0) == (name == "vine")


@pytest.mark.parametrize(
    "name", ["holm_oak", "olive", "aleppo_pine", "northern_spruce", "mastic", "rosemary", "cistus"]
)
@pytest.mark.parametrize("season", ["autumn", "winter"])
def test_evergreens_keep_their_leaves(name: str, season: str) -> None:
    species = {**TREES, **BUSHES}[name]
    summer = plant(name, species.grown.height)
    changed = in_season(summer, changes(season), 1)
    assert triangles(changed, species.foliage) == triangles(summer, species.foliage)


def test_crops_have_stages_that_grow_and_ripen() -> None:
    """What is green reflects most in the green, ripe straw in the red; ears are on top."""
    for name, height in STAGES.items():
        assert GRASSES[name].height[0] < height < GRASSES[name].height[1]
        red, green, blue = albedo(MATERIALS[GRASSES[name].blades[0].material])
        assert (red > green > blue) if name == "wheat_ripe" else (green > red > blue)
    ripe = grow_tuft(GRASSES["wheat_ripe"], name="t", height=0.9, rng=np.random.default_rng(2))
    ears = ripe.vertices[np.unique(ripe.faces[ripe.material == ripe.materials.index("ear_wheat")])]
    assert ears[:, 2].min() > 0.45


def test_straw_stands_all_year() -> None:
    tuft = grow_tuft(GRASSES["bluestem"], name="t", height=1.0, rng=np.random.default_rng(2))
    straw = triangles(tuft, "blade_straw") + triangles(tuft, "blade_bluestem")
    assert straw > 0.7 * len(tuft.faces)
    for season in ("spring", "autumn", "winter"):
        changed = in_season(tuft, changes(season), 1)
        assert triangles(changed, "blade_straw") + triangles(changed, "blade_bluestem") == straw
        assert changed.vertices[:, 2].max() == pytest.approx(1.0, abs=0.03)


def test_a_puddle_is_brown_water_that_mirrors() -> None:
    puddle, lake = MATERIALS["puddle"], MATERIALS["water"]
    assert (puddle.label, puddle.mirror) == (Label.WATER, lake.mirror)
    assert puddle.mirror == pytest.approx(((1.33 - 1) / (1.33 + 1)) ** 2, rel=0.02)  # Fresnel, normal incidence
    red, green, blue = albedo(puddle)
    assert red > green > blue
    assert red > albedo(lake)[0]


@pytest.mark.parametrize("name", WALLS)
def test_a_wall_of_stones_leans_inwards_and_fills_its_collider(name: str) -> None:
    wall, (length, thickness, height) = make_furniture(name), WALLS[name]
    assert_valid(wall, least_area=0.0)
    assert (np.einsum("ij,ij->i", face_normals(wall), wall.normals[wall.faces].sum(axis=1)) > 0).mean() > 0.99
    assert {MATERIALS[m].label for m in wall.materials} == {Label.ROCK}
    low, high = wall.vertices.min(axis=0), wall.vertices.max(axis=0)
    (box,) = wall.colliders
    assert box.shape == "box"
    np.testing.assert_allclose(high[:2] - low[:2], box.size[:2], atol=0.12)
    assert high[2] == pytest.approx(box.position[2] + box.size[2], abs=0.06)
    assert high[2] == pytest.approx(height, abs=0.06)
    assert -0.25 < low[2] < -0.1  # the first course is in the soil
    assert wall.footprint >= np.hypot(box.size[0] / 2, box.size[1] / 2) - 0.01
    across = np.abs(wall.vertices[:, 1])
    foot, top = across[wall.vertices[:, 2] < 0.1].max(), across[wall.vertices[:, 2] > 0.85 * height].max()
    assert foot == pytest.approx(thickness / 2, abs=0.06)
    assert top < (1 - 0.5 * BATTER) * foot + 0.03
    assert np.ptp(wall.vertices[:, 0]) == pytest.approx(length, abs=0.1)


def test_walls_differ_and_are_the_same_again() -> None:
    assert_same_bytes(make_furniture("stone_wall_0"), make_furniture("stone_wall_0"))
    first, second = make_furniture("stone_wall_0"), make_furniture("stone_wall_1")
    assert len(first.faces) != len(second.faces)


def test_a_trellis_has_a_post_of_two_metres_and_wires_on_both_sides_of_the_canopy() -> None:
    trellis = make_furniture("trellis")
    label = np.array([MATERIALS[name].label for name in trellis.materials])[trellis.material]
    assert set(label) == {Label.POST, Label.CABLE}
    post, wires = (trellis.vertices[np.unique(trellis.faces[label == each])] for each in (Label.POST, Label.CABLE))
    assert post[:, 2].max() == pytest.approx(2.0, abs=0.03)
    assert post[:, 2].min() < -0.3
    assert wires[:, 0].max() == pytest.approx(6.0, abs=0.01)  # five vines to a span
    assert wires[:, 2].min() == pytest.approx(0.85, abs=0.03)  # below the cordon
    assert 1.5 < wires[:, 2].max() < 1.9
    assert set(np.sign(wires[wires[:, 2] > 1.2, 1])) == {-1.0, 1.0}

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of a site without its files: heights of trees, widths of ways, water at the edge of the world."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fieldtruth.maps.osm import Feature
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.planting import HEIGHTS, plant_trees
from fieldtruth.world.environments.site.sources import Stem, read_stems
from fieldtruth.world.environments.site.surfaces import ways_of
from fieldtruth.world.environments.site.water import lay_water
from fieldtruth.world.model import Heightfield
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.solids import signed_area

SIZE = (24.0, 16.0)
CONFIG = Config(centre=(47.6, 11.3), size=SIZE, individuals=1)


def test_each_step_of_height_has_meshes_of_its_own() -> None:
    """So that a tree is as high as its map says: its pose has the scale of the mesh that was chosen for it."""
    ground = Heightfield(heights=np.zeros((25, 17), np.float32), spacing=1.0, x0=-12.0, y0=-8.0)
    builder = WorldBuilder(ground, SIZE, [], [])
    stems = [Stem(4.0 * step - 14.0, 0.0, HEIGHTS**step, np.nan, "birch") for step in range(2, 6)]
    plant_trees(builder, stems, CONFIG, np.random.default_rng(0), lambda _: None)
    tops = {}
    for tree in builder.instances:
        pose, vertices = tree.world_from_object, builder.meshes[tree.mesh].vertices
        tops[round(float(pose[0, 3]))] = float((vertices @ pose[2, :3]).max())
    assert [tops[round(stem.x)] for stem in stems] == pytest.approx([stem.height for stem in stems], rel=1e-3)
    assert len({tree.mesh for tree in builder.instances}) == len(stems)


@pytest.mark.parametrize(("height", "crown"), [(12.0, np.nan), (12.0, 3.6), (6.3, np.nan), (6.3, 2.4)])
def test_trunks_are_as_thick_as_the_map_says(height: float, crown: float) -> None:
    """At breast height, seen and as a collider, also where the crown is widened; crown and height do not follow."""
    ground = Heightfield(heights=np.zeros((25, 17), np.float32), spacing=1.0, x0=-12.0, y0=-8.0)
    seen, solid, crowns = [], [], []
    usual = 0.0
    for factor in (np.nan, 0.6, 1.4, 2.0):
        builder = WorldBuilder(ground, SIZE, [], [])
        stem = Stem(0.0, 0.0, height, crown, "beech", factor * usual if usual else np.nan)
        plant_trees(builder, [stem], CONFIG, np.random.default_rng(0), lambda _: None)
        [tree] = builder.instances
        mesh, scale = builder.meshes[tree.mesh], float(np.linalg.norm(tree.world_from_object[:3, 0]))
        wood = mesh.vertices[np.unique(mesh.faces[mesh.material == 0])].astype(np.float64) * scale
        collider = scale * mesh.colliders[0].size[0]
        low = wood[(np.hypot(*wood[:, :2].T) < 2.5 * collider) & (wood[:, 2] > 0.9) & (wood[:, 2] < 1.7), :2]
        seen.append(2.0 * float(np.median(np.hypot(*(low - np.median(low, axis=0)).T))))
        usual = usual or 2.0 * collider / 1.1
        solid.append(collider)
        assert mesh.footprint > mesh.colliders[0].size[0]
        crowns.append(float(np.quantile(np.hypot(*mesh.vertices[:, :2].T), 0.9) * scale))
        assert mesh.vertices[:, 2].max() * scale == pytest.approx(height, rel=1e-3)
    for sizes in (seen, solid):
        np.testing.assert_allclose(np.array(sizes[1:]) / sizes[0], [0.6, 1.4, 2.0], rtol=0.15)  # a step: 1.2
    assert max(crowns) / min(crowns) < 1.02


def test_a_tree_of_the_map_has_the_crown_and_the_girth_of_its_tags() -> None:
    tags = {"natural": "tree", "crown": "7.2 m", "circumference": "1.57", "species": "Quercus robur"}
    found = Feature("tree", np.array([(1.0, 2.0)]), False, tags, None, 11.0)
    bare = Feature("tree", np.array([(5.0, 2.0)]), False, {"natural": "tree"})
    first, second = read_stems(CONFIG, CONFIG.place, [found, bare], np.random.default_rng(0))
    assert first[:5] == Stem(1.0, 2.0, 11.0, 3.6, "oak")[:5]
    assert first.diameter == pytest.approx(0.5, abs=1e-3)
    assert np.isnan([second.crown, second.diameter]).all()


@pytest.mark.parametrize(("kind", "width"), [("path", 3.0), ("path", None), ("track", 2.5), ("road", None)])
def test_a_way_is_as_wide_as_the_map_says(kind: str, width: float | None) -> None:
    line = Feature(kind, np.array([(-9.0, 0.0), (9.0, 0.0)]), False, {"highway": kind}, width)
    (way,) = ways_of([line], CONFIG)
    assert way.trail.width == (width or CONFIG.trail_width)


@pytest.mark.parametrize(
    ("low", "east", "beyond"), [(-4.0, 8.0, 0.0), (-4.0, 12.0, 8.8 * 10.0), (-8.0, 12.0, (12.4 + 14.4 + 10.0) * 10.0)]
)
def test_water_goes_on_beyond_the_edge_only_where_it_reaches_it(low: float, east: float, beyond: float) -> None:
    """Area of its sheet outside: none, a strip of 10 m beside one side, or round a corner; 0.4 m is below its bank."""
    shore = np.array([(-2.0, low), (east, low), (east, 4.0), (-2.0, 4.0)])
    nodes = np.linspace(-12.0, 12.0, 97), np.linspace(-8.0, 8.0, 65)
    lake = Feature("water", shore, True, {"natural": "water"})
    ((sheet, _),) = lay_water([lake], np.zeros((97, 65)), nodes, SIZE, np.full((97, 65), 1e3)).sheets
    area = sum(abs(signed_area(corners)) for corners in sheet.vertices[sheet.faces][..., :2].astype(np.float64))
    within = (min(east + 0.4, 12.0) + 2.4) * (4.4 - max(low - 0.4, -8.0))
    assert area == pytest.approx(within + beyond, abs=0.3)


def test_joints_of_limbs_stay_in_the_trunk_where_a_crown_is_widened() -> None:
    """Else limbs would turn about points beside their tree."""
    ground = Heightfield(heights=np.zeros((25, 17), np.float32), spacing=1.0, x0=-12.0, y0=-8.0)
    gaps = []
    for crown in (np.nan, 12.0):
        builder = WorldBuilder(ground, SIZE, [], [])
        plant_trees(builder, [Stem(0.0, 0.0, 12.0, crown, "willow")], CONFIG, np.random.default_rng(0), lambda _: None)
        [mesh] = [builder.meshes[tree.mesh] for tree in builder.instances]
        assert mesh.limb is not None
        assert mesh.joints is not None
        trunk = mesh.vertices[np.unique(mesh.faces[mesh.limb == -1])]
        gaps.append(np.max(cKDTree(trunk).query(mesh.joints)[0]))
    assert "_w" in mesh.name
    assert gaps[1] < 1.3 * gaps[0]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of a site without its files: sizes of trees, widths of trails, water at the world's edge."""

import numpy as np
import pytest

from fieldtruth.maps.osm import Feature
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.planting import HEIGHTS, plant_trees
from fieldtruth.world.environments.site.sources import Stem
from fieldtruth.world.environments.site.surfaces import ways_of
from fieldtruth.world.model import Heightfield
from fieldtruth.world.placement import WorldBuilder

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


@pytest.mark.parametrize(("kind", "width"), [("path", 3.0), ("path", None), ("track", 2.5), ("road", None)])
def test_a_way_is_as_wide_as_the_map_says(kind: str, width: float | None) -> None:
    line = Feature(kind, np.array([(-9.0, 0.0), (9.0, 0.0)]), False, {"highway": kind}, width)
    (way,) = ways_of([line], CONFIG)
    assert way.trail.width == (width or CONFIG.trail_width)

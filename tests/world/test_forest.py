# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rules of the forest for several seeds: density, ages, free trails and routes."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from forest_worlds import forest_variant
from mesh_checks import scale_of
from numpy.typing import NDArray
from park_worlds import digest
from scipy.ndimage import gaussian_filter
from sense_worlds import without_textures

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.build import build_world, check_layout, layout_model, load_world, reserved_corridors
from fieldtruth.world.environments.layout import PLANTINGS
from fieldtruth.world.grids import Line
from fieldtruth.world.model import LITTER, Instance, World
from fieldtruth.world.plants import TREES

F8 = NDArray[np.float64]
CONIFERS = {"spruce", "pine"}


def routes() -> list[Line]:
    return reserved_corridors("forest")


FEW: dict[str, Any] = {
    "size": (50.0, 30.0), "old_trees": 62, "grown_trees": 30, "young_trees": 18, "snags": 4, "fallen_trunks": 4,
    "stumps": 5, "bushes": 10, "rocks": 10,
}  # fmt: skip
"""A third of the forest, as dense as the whole."""


@pytest.fixture(scope="module", params=["part", pytest.param("built_in", marks=pytest.mark.slow)])
def world(request: pytest.FixtureRequest) -> World:
    """A part of a forest of seed 1, quickly made, and the built-in forest of seed 0."""
    return load_world("forest") if request.param == "built_in" else forest_variant(1, **FEW)


def config_of(world: World) -> Any:
    return layout_model("forest").model_validate(world.layout)


def trees(world: World) -> list[Instance]:
    return [i for i in world.instances if i.kind in TREES]


def positions(objects: list[Instance]) -> F8:
    return np.array([i.world_from_object[:2, 3] for i in objects])


def test_counts_species_and_ages(world: World) -> None:
    living, share, config = trees(world), world.size[0] * world.size[1] / 5000.0, config_of(world)
    assert len(living) >= 350 * share
    kinds = Counter(i.kind for i in living)
    assert set(kinds) == set(config.species)
    assert set(kinds) > CONIFERS
    assert min(kinds.values()) >= 30 * share
    groups = PLANTINGS["forest"].groups
    ages = Counter(age for i in living for age in ("old", "grown", "young") if f"_{age}_" in i.mesh)
    assert ages == {"old": config.old_trees, "grown": config.grown_trees, "young": config.young_trees}
    for age in ages:
        low, high = np.atleast_1d(np.asarray(groups[age].heights, np.float64))
        heights = [scale_of(i) * world.meshes[i.mesh].vertices[:, 2].max() for i in living if f"_{age}_" in i.mesh]
        assert 0.8 * low < min(heights) < max(heights) < 1.25 * high
    others = Counter(i.kind for i in world.instances if i.kind not in TREES)
    assert others == {
        "snag": config.snags,
        "fallen_trunk": config.fallen_trunks,
        "stump": config.stumps,
        "bush": config.bushes,
        "rock": config.rocks,
    }


def test_far_trees_are_outside_the_world(world: World) -> None:
    far = [s for s in world.swarms if s.name.startswith("far_")]
    assert sum(len(s.mesh) for s in far) > 1.3 * sum(world.size)  # 200 about the built-in forest
    for swarm in far:
        x, y = np.abs(swarm.world_from_object[:, :2, 3]).T
        assert ((x > world.size[0] / 2) | (y > world.size[1] / 2)).all()


def test_trunks_do_not_intersect(world: World) -> None:
    """Neighbouring trunks do not overlap, neither do standing trees and fallen trunks."""
    living = trees(world)
    radius = np.array([scale_of(i) * world.meshes[i.mesh].colliders[0].size[0] for i in living])
    at = positions(living)
    apart = np.linalg.norm(at[:, None] - at, axis=2) - radius[:, None] - radius
    assert apart[~np.eye(len(at), dtype=bool)].min() > 0.3
    for log in (i for i in world.instances if i.kind == "fallen_trunk"):
        object_from_world = np.linalg.inv(log.world_from_object)
        beside = at @ object_from_world[:2, :2].T + object_from_world[:2, 3]
        for box in world.meshes[log.mesh].colliders:
            off = np.maximum(np.abs(beside - box.position[:2]) - np.array(box.size[:2]) / 2, 0.0)
            assert (np.hypot(*off.T) > radius).all()


def test_no_collider_on_trails_or_routes(world: World) -> None:
    for instance in world.instances:
        colliders = world.meshes[instance.mesh].colliders
        scale = scale_of(instance)
        for collider in colliders:
            position = (instance.world_from_object @ [*collider.position, 1.0])[None, :2]
            half = collider.size[0] if collider.shape == "cylinder" else min(collider.size[:2]) / 2
            for line in routes():
                assert line.distance(position)[0] > 0.9 + half * scale, instance.name
            assert world.terrain.trail_distance.at(*position[0]) > -0.3, instance.name


def test_ground_is_uneven_except_on_trails(world: World) -> None:
    field = world.terrain.field
    smooth = gaussian_filter(field.heights.astype(float), 0.3 / field.spacing)
    slope = np.degrees(np.arctan(np.hypot(*np.gradient(smooth, field.spacing))))
    x = field.x0 + field.spacing * np.arange(field.heights.shape[0])
    y = field.y0 + field.spacing * np.arange(field.heights.shape[1])
    off = world.terrain.trail_distance.at(*np.meshgrid(x, y, indexing="ij"))
    assert np.ptp(field.heights) > 1.5
    bumps = field.heights - gaussian_filter(field.heights.astype(float), 0.6 / field.spacing)
    assert bumps[off > 1.5].std() > 1.4 * bumps[off < -0.3].std()
    assert slope[off > 1.5].max() > 15.0
    assert np.percentile(slope[off < -0.3], 99) < 15.0
    assert 0.04 < (off < 0).mean() < 0.15  # two trails of 1.7 m


def test_objects_touch_the_ground(world: World) -> None:
    """The lowest vertices of an object are in the ground; a fallen trunk may span a hollow."""
    field = world.terrain.field
    for instance in world.instances:
        pose = instance.world_from_object
        vertices = world.meshes[instance.mesh].vertices @ pose[:3, :3].T + pose[:3, 3]
        vertices = vertices[vertices[:, 2] < vertices[:, 2].min() + 1.0]
        above = vertices[:, 2] - field.height_at(vertices[:, 0], vertices[:, 1])
        sole = vertices[:, 2] < vertices[:, 2].min() + 0.005
        assert above.min() < -0.02, instance.name
        if instance.kind != "fallen_trunk":
            assert above[sole].max() < 0.01, instance.name
    for swarm in (each for each in world.swarms if each.kind != LITTER):  # which lies on the layer, above the soil
        x, y, z = swarm.world_from_object[:, :3, 3].T
        inside = (np.abs(x) < world.size[0] / 2) & (np.abs(y) < world.size[1] / 2)
        assert (z - field.height_at(x, y))[inside].max(initial=-1.0) < 1e-6, swarm.name


def test_classes(world: World) -> None:
    labels = {m.label for m in world.materials.values()}
    assert labels == {Label.GROUND, Label.TRUNK, Label.TREETOP, Label.BUSH, Label.ROCK, Label.HIGH_GRASS, Label.TRAIL}
    for instance in world.instances:
        own = {world.materials[n].label for n in world.meshes[instance.mesh].materials}
        if instance.kind in TREES:
            assert own == {Label.TRUNK, Label.TREETOP}
        elif instance.kind in ("snag", "stump", "fallen_trunk"):
            assert own == {Label.TRUNK}


@pytest.mark.slow
def test_same_seed_same_forest_other_seed_another() -> None:
    first = forest_variant(1)
    forest_variant.cache_clear()
    assert digest(forest_variant(1)) == digest(first)
    assert not np.array_equal(load_world("forest").terrain.field.heights, first.terrain.field.heights)


@pytest.mark.slow
def test_layout_changes_only_its_keys() -> None:
    sparse = forest_variant(0, old_trees=10, fallen_trunks=0)
    with without_textures():
        birches = build_world("forest", 0, {"species": {"birch": 1.0}, "individuals": 1, "size": [40, 30]})
    assert {i.kind for i in trees(birches)} == {"birch"}
    dead = {name for i in birches.instances if i.kind in ("snag", "stump") for name in birches.meshes[i.mesh].species}
    assert dead == {"birch"}
    assert sum("old" in i.mesh for i in sparse.instances) == 10
    assert not any(i.kind == "fallen_trunk" for i in sparse.instances)


def test_unknown_species_are_errors() -> None:
    with pytest.raises(ConfigurationError, match=r"unknown species 'palm'.*Available: alder"):
        check_layout("forest", {"species": {"palm": 1.0}})

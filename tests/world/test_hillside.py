# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rules of the hillside for several seeds: slopes on and off the routes, rocks in the ground, free routes."""

from collections import Counter
from functools import cache

import numpy as np
import pytest
from mesh_checks import world_vertices
from numpy.typing import NDArray
from park_worlds import digest
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from sense_worlds import without_textures

from fieldtruth.core.classes import Label
from fieldtruth.drive.traversability import Blockage, Traversability
from fieldtruth.world.build import build_world, layout_model, load_world, reserved_corridors
from fieldtruth.world.environments.layered.build import build as build_layers
from fieldtruth.world.grids import Line
from fieldtruth.world.model import World
from fieldtruth.world.rocks import ROCK_TYPES, rim_vertices

pytestmark = pytest.mark.slow

F8 = NDArray[np.float64]
ROCKS = {"crag": 26, "boulder": 34, "rock": 44, "slab": 16}
TREES = {"pine": 6, "oak": 6, "snag": 3}
BUSHES = {"juniper": 18, "gorse": 40, "heather": 60}


def routes() -> list[Line]:
    return reserved_corridors("hillside")


@cache
def hillside(seed: int) -> World:
    """The hillside with one individual of each kind and without textures, which do not change its layout."""
    with without_textures():
        return build_world("hillside", seed, {"individuals": 1})


@pytest.fixture(scope="module")
def world() -> World:
    """The built-in hillside."""
    return load_world("hillside")


def slopes(world: World, smoothing: float) -> tuple[F8, F8]:
    """Slope [deg] of the ground after a Gaussian of a deviation [m], and distance [m] from the routes, up to 9 m."""
    field = world.terrain.field
    heights = gaussian_filter(field.heights.astype(float), smoothing / field.spacing)
    slope = np.degrees(np.arctan(np.hypot(*np.gradient(heights, field.spacing))))
    nodes = [o + field.spacing * np.arange(n) for o, n in zip((field.x0, field.y0), heights.shape, strict=True)]
    tree = cKDTree(np.concatenate([line.points for line in routes()]))
    xy = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1)[::2, ::2]  # 0.1 m apart
    return slope[::2, ::2], np.asarray(tree.query(xy, distance_upper_bound=9.0)[0])


def test_counts_and_budget(world: World) -> None:
    assert Counter(i.kind for i in world.instances) == {**ROCKS, **TREES, **BUSHES}
    assert len(world.instances) <= 480
    assert sum(ROCKS.values()) <= 120
    swarms = {s.name: len(s.mesh) for s in world.swarms}
    assert swarms["pebbles"] > 5000
    assert swarms["stones"] > 500
    assert 1500 < swarms["grass"] < 20_000
    for instance in world.instances:
        if instance.kind in ROCKS:
            assert len(world.meshes[instance.mesh].faces) <= 3000


def test_slopes_are_drivable_on_routes_and_steep_elsewhere(world: World) -> None:
    slope, away = slopes(world, 1.0)
    assert slope[away < 0.6].max() <= 15.0
    assert slope[away < 2.0].max() <= 16.0
    steep, _ = slopes(world, 0.2)
    assert (steep[away > 8.0] > 30.0).mean() > 0.1
    assert slope.max() <= 40.0


def test_bumps_on_the_routes_do_not_touch_the_chassis(world: World) -> None:
    """They are those of a rugged trail with its stones, several centimetres high; elsewhere there are higher ones."""
    ground = Traversability(world)
    for line in routes():
        headings = np.arctan2(line.tangents[:, 1], line.tangents[:, 0])
        bumps = ground.bumps_at(np.column_stack([line.points, headings]))
        assert 0.04 < bumps.max() < ground.robot.ground_clearance
    x, y = np.meshgrid(np.arange(-48.0, 48.0, 0.1), np.arange(-23.0, 23.0, 0.1))
    assert (ground.blockage_at(np.column_stack([x.ravel(), y.ravel()])) == Blockage.ROUGH).any()


def test_mountain_rises_across_the_world_and_beyond(world: World) -> None:
    heights = world.terrain.field.heights.astype(float)
    assert heights[:, -1].mean() - heights[:, 0].mean() > 7.0
    assert world.backdrop is not None
    x, y, z = world.backdrop.vertices.astype(float).T
    up, down = (y > 200) & (np.abs(x) < 300) & (y < 500), (y < -100) & (y > -200) & (np.abs(x) < 100)
    assert z[up].max() > 60.0
    assert z[down].mean() < -15.0


def test_rims_of_rocks_are_in_the_ground(world: World) -> None:
    for instance in world.instances:
        if instance.kind in ROCKS:
            pose = instance.world_from_object
            rim = rim_vertices(world.meshes[instance.mesh]) @ pose[:3, :3].T + pose[:3, 3]
            assert np.all(rim[:, 2] < world.terrain.field.height_at(rim[:, 0], rim[:, 1])), instance.name
            whole = world_vertices(world, instance)
            above = whole[:, 2] - world.terrain.field.height_at(whole[:, 0], whole[:, 1])
            assert above.max() > 0.04, instance.name


def test_stems_reach_into_the_ground(world: World) -> None:
    """Stems reach 5 to 90 cm into the ground; leaves may overhang a slope."""
    for instance in world.instances:
        if instance.kind in TREES | BUSHES:
            whole = world_vertices(world, instance)
            x, y, z = instance.world_from_object[:3, 3]
            near = whole[np.hypot(whole[:, 0] - x, whole[:, 1] - y) < 0.5]
            depth = world.terrain.field.height_at(near[:, 0], near[:, 1]) - near[:, 2]
            assert 0.05 < depth.max() < 0.9, instance.name
            assert world.terrain.field.height_at(x, y) > z - 1e-6, instance.name


def test_footprints_are_disjoint(world: World) -> None:
    """Circles of all footprints are disjoint, so that no rock intersects a trunk."""
    xy = np.array([i.world_from_object[:2, 3] for i in world.instances])
    scale = np.array([np.cbrt(np.linalg.det(i.world_from_object[:3, :3])) for i in world.instances])
    radius = scale * [world.meshes[i.mesh].footprint for i in world.instances]
    apart = np.linalg.norm(xy[:, None] - xy, axis=-1) - radius[:, None] - radius
    np.fill_diagonal(apart, np.inf)
    assert apart.min() > -1e-6
    assert np.all(np.abs(xy) + radius[:, None] < np.array([50.0, 25.0]))


def test_rock_is_granite_and_plants_avoid_lime(world: World) -> None:
    meshes = world.meshes.values()
    rocks = {n for mesh in meshes for n in mesh.materials if world.materials[n].label == Label.ROCK}
    assert rocks == {"rock_granite"}
    plants = {s for mesh in meshes for s in mesh.species if s not in ROCK_TYPES}
    assert plants == {"heather", "gorse", "juniper", "bent", "pine", "oak"}


def test_no_collider_near_routes(world: World) -> None:
    """No collider is within 0.6 m of a route, no larger stone of a swarm within 1.3 m."""
    tree = cKDTree(np.concatenate([line.points for line in routes()]))
    for instance in world.instances:
        for collider in world.meshes[instance.mesh].colliders:
            pose = instance.world_from_object
            middle = (pose @ [*collider.position, 1.0])[:2]
            half = collider.size[0] if collider.shape == "cylinder" else np.linalg.norm(collider.size[:2]) / 2
            reach = float(half * np.cbrt(np.linalg.det(pose[:3, :3])))
            assert float(tree.query(middle)[0]) - reach > 0.6, instance.name
    (stones,) = (s for s in world.swarms if s.name == "stones")
    assert np.min(tree.query(stones.world_from_object[:, :2, 3])[0]) > 1.3


def test_swarms_are_on_the_ground(world: World) -> None:
    """Stones and stems are on the soil, litter lies on its layer of short grass."""
    for swarm in world.swarms:
        x, y, z = swarm.world_from_object[:, :3, 3].T
        inside = (np.abs(x) <= 50) & (np.abs(y) <= 25)
        if inside.any():
            strewn = swarm.name == "ground_litter"
            ground = world.terrain.surface if strewn else world.terrain.field
            assert np.abs(z - ground.height_at(x, y))[inside].max() < (0.1 if strewn else 0.03)
        assert inside.all() != swarm.name.startswith("far_")


def test_classes_and_no_trail(world: World) -> None:
    assert world.terrain.trail_distance.values.min() > 0
    assert {int(v) for v in world.terrain.label_at([-49, 0, 49], [-24, 0, 24])} == {Label.GROUND}
    labels: dict[str, set[int]] = {"rocks": set(), "trees": set(), "bushes": set()}
    for instance in world.instances:
        group = "rocks" if instance.kind in ROCKS else "trees" if instance.kind in TREES else "bushes"
        labels[group] |= {world.materials[n].label for n in world.meshes[instance.mesh].materials}
    assert labels["rocks"] == {Label.ROCK}
    assert labels["trees"] == {Label.TRUNK, Label.TREETOP}
    assert labels["bushes"] == {Label.BUSH}
    cover = world.terrain.cover.values
    assert np.abs(cover.sum(axis=-1) - 1.0).max() <= 1e-5
    assert np.all(cover.mean(axis=(0, 1)) > 0.02)  # turf, soil, scree and rock


def test_same_seed_same_bytes_and_other_seed_another_world() -> None:
    assert digest(hillside.__wrapped__(1)) == digest(hillside(1))
    assert not np.array_equal(hillside(1).terrain.field.heights, load_world("hillside").terrain.field.heights)


def test_flank_without_corridors_is_steep_everywhere() -> None:
    rocks = {"crags": 2, "boulders": 2, "blocks": 2, "slabs": 1, "stones": 0, "pebbles": 0}
    plants = {"grass": 0, "junipers": 1, "gorse": 1, "cushions": 1, "pines": 1, "oaks": 1, "snags": 1}
    config = layout_model("hillside").model_validate({"individuals": 1, "grid": 0.2, **rocks, **plants})
    with without_textures():
        world = build_layers(3, [], config)
    assert len(world.instances) == 13
    slope, away = slopes(world, 1.0)
    assert slope[away < 2.0].max() > 15.0
    assert slope.max() <= 40.0

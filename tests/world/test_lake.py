# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rules of the lake's shore for several seeds: bank, irregular shore, dry routes, zones of plants."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from lake_worlds import lake_variant
from mesh_checks import world_vertices
from numpy.typing import NDArray

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.ground import mean_ground
from fieldtruth.world.build import load_world, reserved_corridors
from fieldtruth.world.grids import Line
from fieldtruth.world.model import LITTER, World

F8 = NDArray[np.float64]
COUNTS = {
    "waterside_tree": 13,
    "meadow_tree": 30,
    "waterside_bush": 12,
    "meadow_bush": 26,
    "power_pole": 2,
    "cable": 12,
    "water": 1,
}
IN_WATER = {"reed", "cattail"}


SEEDS = [1, pytest.param(0, marks=pytest.mark.slow)]


@pytest.fixture(scope="module", params=SEEDS, ids=lambda seed: f"seed_{seed}")
def world(request: pytest.FixtureRequest) -> World:
    """The built-in lake of seed 0 and a quick one of another seed."""
    return load_world("lake") if request.param == 0 else lake_variant(request.param)


def level(world: World) -> float:
    assert isinstance(world.water_level, float)
    return world.water_level


def above_water(world: World, xy: F8) -> F8:
    return world.terrain.field.height_at(xy[:, 0], xy[:, 1]) - level(world)


def test_counts_and_budget(world: World) -> None:
    assert Counter(i.kind for i in world.instances) == COUNTS
    assert 30 <= COUNTS["waterside_tree"] + COUNTS["meadow_tree"] <= 60
    assert len(world.object_names) <= 480


def test_species_of_trees_bushes_and_grass(world: World) -> None:
    trees = {i.mesh.split("_")[2] for i in world.instances if i.kind.endswith("tree")}
    bushes = {i.mesh.removeprefix("bush_")[:-2] for i in world.instances if i.kind.endswith("bush")}
    assert trees == {"alder", "willow", "birch", "pine", "oak"}
    assert len(bushes) >= 3
    grasses = {name for s in world.swarms for name in s.meshes if s.kind == "high_grass"}
    assert {name.split("_")[0] for name in grasses} >= {"reed", "cattail", "sedge", "meadow", "dry"}
    near_water = {i.mesh.split("_")[2] for i in world.instances if i.kind == "waterside_tree"}
    assert near_water == {"alder", "willow"}


def test_bank_height_and_slopes(world: World) -> None:
    field = world.terrain.field
    height = field.heights - level(world)
    assert (field.x0, field.y0) == (-50.0, -25.0)
    assert 2.0 < np.median(height[:, -100:]) < 5.0  # the western 20 m
    assert height.max() < 5.5
    assert -4.0 < height.min() < -2.0
    wet = float((height < 0).mean())
    assert 0.12 < wet < 0.35
    slope = np.degrees(np.arctan(np.hypot(*np.gradient(height.astype(float), field.spacing))))
    bank = (height > 0) & (height < 1.6)
    assert (slope[bank] > 30).mean() > 0.02  # scarps
    assert (slope[bank] < 8).mean() > 0.1  # and beaches


def shore_y(world: World) -> F8:
    """Largest y [m] of the water on each line of the terrain's grid across the shore."""
    field = world.terrain.field
    wet = field.heights < level(world)
    return np.asarray(field.y0 + field.spacing * (wet.shape[1] - 1 - np.argmax(wet[:, ::-1], axis=1)))


def test_shore_is_irregular(world: World) -> None:
    y = shore_y(world)
    assert np.ptp(y) > 3.0
    assert y.std() > 0.7
    bends = np.diff(np.sign(np.diff(y[::10])))
    assert np.count_nonzero(bends) >= 6  # points and coves, not one curve


def test_water_is_one_flat_sheet_up_to_the_far_shore(world: World) -> None:
    (lake,) = (i for i in world.instances if i.kind == "water")
    assert lake.name == "lake_1"
    mesh, sheet = world.meshes[lake.mesh], world_vertices(world, lake)
    assert np.ptp(sheet[:, 2]) == 0.0
    assert sheet[0, 2] == pytest.approx(level(world))
    assert {world.materials[n].label for n in mesh.materials} == {Label.WATER}
    assert all(world.materials[n].mirror == 0.02 for n in mesh.materials)
    assert mesh.colliders == ()
    low, high = sheet.min(axis=0), sheet.max(axis=0)
    assert world.backdrop is not None
    land = world.backdrop.vertices
    drowned = land[land[:, 2] < level(world)]
    assert (drowned[:, :2].min(axis=0) > low[:2]).all()
    assert (drowned[:, :2].max(axis=0) < high[:2]).all()
    assert drowned[:, 1].min() < -100.0
    across = land[(np.abs(land[:, 0]) < 100) & (land[:, 1] < -250.0)]
    assert across[:, 2].min() > level(world)  # the far shore


def test_objects_touch_the_ground(world: World) -> None:
    """The lowest vertices of objects are in the ground; so are the stems of grass."""
    field = world.terrain.field
    for instance in world.instances:
        if instance.kind in ("water", "cable"):
            continue
        vertices = world_vertices(world, instance)
        sole = vertices[vertices[:, 2] < vertices[:, 2].min() + 0.005]
        assert (sole[:, 2] - field.height_at(sole[:, 0], sole[:, 1])).max() < 0.001, instance.name
    for swarm in (each for each in world.swarms if each.kind != LITTER):
        x, y, z = swarm.world_from_object[:, :3, 3].T
        inside = (np.abs(x) < 50) & (np.abs(y) < 25)
        assert (z - field.height_at(x, y))[inside].max(initial=-1.0) < 1e-6, swarm.name


def test_only_reeds_and_cattails_are_in_the_water(world: World) -> None:
    for instance in world.instances:
        if instance.kind not in ("water", "cable"):
            assert above_water(world, instance.world_from_object[None, :2, 3])[0] > 0.02, instance.name
    for swarm in world.swarms:
        xy = swarm.world_from_object[:, :2, 3]
        inside = (np.abs(xy) < [50, 25]).all(axis=1)
        height = above_water(world, xy[inside])
        if IN_WATER & set(swarm.name.split("_")):
            assert height.min() > -0.6
            assert height.max() < 0.2
        elif inside.any():
            assert height.min() > -0.02, swarm.name


def test_routes_are_dry_and_even(world: World) -> None:
    step, raw = 0.3, world.terrain.field
    # The ground under a wheel base; the relief of centimetres, which no plan of a route can level, adds a degree.
    mean = replace(raw, heights=mean_ground(raw, 2 * step).astype(np.float32))
    for line in reserved_corridors("lake"):
        assert above_water(world, line.points).min() > 0.5
        side = np.column_stack([-line.tangents[:, 1], line.tangents[:, 0]])
        x, y = np.concatenate([line.points + off * side for off in (-0.4, 0.0, 0.4)]).T
        for field, limit in ((mean, 15.0), (raw, 16.0)):
            along = (field.height_at(x + step, y) - field.height_at(x - step, y)) / (2 * step)
            across = (field.height_at(x, y + step) - field.height_at(x, y - step)) / (2 * step)
            assert np.degrees(np.arctan(np.hypot(along, across))).max() < limit


def test_no_collider_near_routes(world: World) -> None:
    for line in reserved_corridors("lake"):
        for instance in world.instances:
            scale = float(np.cbrt(np.linalg.det(instance.world_from_object[:3, :3])))
            for collider in world.meshes[instance.mesh].colliders:
                middle = (instance.world_from_object @ [*collider.position, 1.0])[None, :2]
                assert line.distance(middle)[0] - collider.size[0] * scale > 0.6, instance.name


def test_footprints_are_disjoint(world: World) -> None:
    standing = [i for i in world.instances if i.kind.endswith(("tree", "bush", "pole"))]
    xy = np.array([i.world_from_object[:2, 3] for i in standing])
    radius = [
        0.8
        if i.kind == "power_pole"
        else world.meshes[i.mesh].footprint * np.cbrt(np.linalg.det(i.world_from_object[:3, :3]))
        for i in standing
    ]
    apart = np.linalg.norm(xy[:, None] - xy, axis=-1) - np.add.outer(radius, radius)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() > -1e-6


def test_wires_are_high_and_not_above_trunks(world: World) -> None:
    cables = [world_vertices(world, i) for i in world.instances if i.kind == "cable"]
    trunks = np.array([i.world_from_object[:2, 3] for i in world.instances if i.kind.endswith("tree")])
    for wire in cables:
        inside = wire[(np.abs(wire[:, 0]) < 50) & (np.abs(wire[:, 1]) < 25)]
        assert (inside[:, 2] - world.terrain.field.height_at(inside[:, 0], inside[:, 1])).min() > 4.5
        order = np.argsort(wire[:, 0])
        line = Line.through([(float(x), float(y)) for x, y in wire[order[:: len(order) // 8], :2]], smooth=False)
        assert line.distance(trunks).min() > 2.0
    assert min(wire[:, 0].min() for wire in cables) < -50.0  # to the world's edge and beyond
    assert max(wire[:, 0].max() for wire in cables) > 50.0


def test_ids_and_materials(world: World) -> None:
    ids = [i.object_id for i in world.instances] + [s.object_id for s in world.swarms]
    assert sorted(ids) == list(range(2, len(world.object_names)))
    assert all(world.object_names[i.object_id] == i.name for i in world.instances)
    assert all(world.object_names[s.object_id] == s.name for s in world.swarms)
    assert len(set(world.object_names)) == len(world.object_names)
    assert world.terrain.label_at([0.0, 10.0], [0.0, -20.0]).tolist() == [Label.GROUND, Label.GROUND]
    cover = world.terrain.cover.values
    assert cover.min() >= 0.0
    assert np.abs(cover.sum(axis=-1) - 1.0).max() < 1e-5
    used = {n for mesh in world.meshes.values() for n in mesh.materials}
    assert used <= set(world.materials)


def test_mud_or_pebbles_at_the_water_and_grass_above(world: World) -> None:
    terrain, y = world.terrain, shore_y(world)
    wet = [terrain.ground_materials.index(n) for n in ("mud", "pebbles")]
    green = [terrain.ground_materials.index(n) for n in ("rough_grass", "dry_grass")]
    x = np.linspace(-48.0, 48.0, 193)
    edge = np.interp(x, terrain.field.x0 + terrain.field.spacing * np.arange(len(y)), y)
    assert terrain.cover.at(x, edge - 1.0)[:, wet].sum(axis=1).min() > 0.9
    assert terrain.cover.at(x, np.full_like(x, 15.0))[:, green].sum(axis=1).mean() > 0.8


@pytest.mark.slow
def test_same_seed_same_lake_other_seed_another() -> None:
    again = lake_variant.__wrapped__(1)
    first, other = lake_variant(1), load_world("lake")
    assert np.array_equal(again.terrain.field.heights, first.terrain.field.heights)
    assert np.array_equal(again.terrain.cover.values, first.terrain.cover.values)
    assert again.object_names == first.object_names
    for a, b in zip(again.instances, first.instances, strict=True):
        assert (a.mesh, a.tint) == (b.mesh, b.tint)
        assert np.array_equal(a.world_from_object, b.world_from_object)
    for s, t in zip(again.swarms, first.swarms, strict=True):
        assert np.array_equal(s.world_from_object, t.world_from_object)
    for name, mesh in again.meshes.items():
        assert np.array_equal(mesh.vertices, first.meshes[name].vertices)
    assert not np.array_equal(other.terrain.field.heights, first.terrain.field.heights)


@pytest.mark.slow
def test_grass_density_moves_no_object_and_invalid_layouts_are_errors() -> None:
    """The grass density does not move trees; layouts that are not allowed raise errors."""
    few, many = lake_variant(1, grass=0.1), lake_variant(1)
    for a, b in zip(few.instances, many.instances, strict=True):
        assert np.array_equal(a.world_from_object, b.world_from_object)
    assert sum(len(s.mesh) for s in few.swarms) < sum(len(s.mesh) for s in many.swarms)
    with pytest.raises(ConfigurationError, match="bends must be a number between 0 and 6, got 20"):
        lake_variant(0, bends=20.0)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rules of the park for several seeds: counts, ground contact, spacing, free routes, names."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from mesh_checks import scale_of, world_vertices
from numpy.typing import NDArray
from park_worlds import digest, park_variant, real_park
from scipy.sparse.csgraph import connected_components

from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.world.backdrop import COARSER, NEAR_STEP
from fieldtruth.world.build import build_world
from fieldtruth.world.environments.layout import PLANTINGS
from fieldtruth.world.model import Instance, Mesh, Swarm, World
from fieldtruth.world.plants import TREES

F8 = NDArray[np.float64]
FURNITURE = {"bench": 16, "lamp_post": 15, "table": 11, "trash_bin": 11}
COUNTS = {"large_tree": 23, "small_tree": 15, "bush": 34, **FURNITURE}
FREE = 0.6  # [m] on either side of a route; the Husky is 0.67 m wide


SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 5))]


@pytest.fixture(scope="module")
def park() -> World:
    return real_park()


@pytest.fixture(scope="module", params=SEEDS, ids=lambda seed: f"seed_{seed}")
def world(request: pytest.FixtureRequest, park: World) -> World:
    """The real park of seed 0 and quick ones of other seeds; in 5 the spacing of the lamp posts eases."""
    return park if request.param == 0 else park_variant(request.param)


def position(instance: Instance) -> F8:
    return instance.world_from_object[:2, 3]


def distance_to_line(xy: F8, line: F8) -> F8:
    """Distance (n,) of positions (n, 2) to a line through corners (m, 2)."""
    a, b = line[:-1], line[1:]
    along = np.einsum("nmi,mi->nm", xy[:, None] - a, b - a) / ((b - a) ** 2).sum(axis=1)
    foot = a + np.clip(along, 0, 1)[..., None] * (b - a)
    return np.asarray(np.linalg.norm(xy[:, None] - foot, axis=-1).min(axis=1))


def test_counts(world: World) -> None:
    assert Counter(i.kind for i in world.instances) == COUNTS


def test_size_and_grid(world: World) -> None:
    assert world.size == (100.0, 50.0)
    field = world.terrain.field
    assert field.spacing <= 0.2
    assert (field.x0, field.y0) == (-50.0, -25.0)
    assert (np.array(field.heights.shape) - 1) * field.spacing == pytest.approx([100.0, 50.0])
    assert field.heights.dtype == np.float32
    assert 0.2 < np.ptp(field.heights) < 2.5
    half_metre = round(0.5 / field.spacing)
    slope = np.hypot(*np.gradient(field.heights[::half_metre, ::half_metre].astype(float), 0.5))
    assert np.degrees(np.arctan(slope)).max() < 9.0  # almost plane
    assert np.abs(np.degrees(np.arctan(slope))).mean() > 0.2  # and yet not flat


def test_objects_touch_the_ground(world: World) -> None:
    """The whole sole of each foot of an object is in the ground, or at most 1 mm above it."""
    floating = {}
    for instance in world.instances:
        vertices = world_vertices(world, instance)
        above = vertices[:, 2] - world.terrain.field.height_at(vertices[:, 0], vertices[:, 1])
        gap = max(float(above[sole].max()) for sole in soles(vertices))
        if gap > 0.001:
            floating[instance.name] = round(gap, 4)
    assert not floating, f"above the ground [m]: {floating}"


def soles(vertices: F8) -> list[NDArray[np.int64]]:
    """Lowest vertices, to 5 mm, of each foot: of groups of low vertices that are 15 cm or more apart."""
    low = np.flatnonzero(vertices[:, 2] < vertices[:, 2].min() + 0.02)
    apart = np.linalg.norm(vertices[low, None, :2] - vertices[low, :2], axis=-1)
    _, group = connected_components(apart < 0.15)
    feet = [low[group == k] for k in np.unique(group)]
    return [foot[vertices[foot, 2] < vertices[foot, 2].min() + 0.005] for foot in feet]


def test_soles_finds_each_foot(park: World) -> None:
    """Checks the helper: a bench has several feet, a tree one."""
    count = {i.kind: len(soles(world_vertices(park, i))) for i in park.instances}
    assert count["large_tree"] == count["small_tree"] == 1
    assert max(len(soles(world_vertices(park, i))) for i in park.instances if i.kind == "bench") >= 2
    assert max(len(soles(world_vertices(park, i))) for i in park.instances if i.kind == "table") >= 4


def test_origins_are_at_most_20_cm_below_the_ground(world: World) -> None:
    """An object's origin, its own ground level, is at most 20 cm below the real ground, and never above it."""
    for instance in world.instances:
        x, y, z = instance.world_from_object[:3, 3]
        assert -1e-6 < float(world.terrain.field.height_at(x, y)) - z < 0.20, instance.name


def test_footprints_are_disjoint(world: World) -> None:
    """Circles of the meshes' footprints are disjoint."""
    xy = np.array([position(i) for i in world.instances])
    radius = np.array([world.meshes[i.mesh].footprint * scale_of(i) for i in world.instances])
    apart = np.linalg.norm(xy[:, None] - xy, axis=-1) - radius[:, None] - radius
    np.fill_diagonal(apart, np.inf)
    assert apart.min() > -1e-6, [world.instances[k].name for k in np.unravel_index(apart.argmin(), apart.shape)]


def test_solid_parts_are_3_cm_apart(world: World) -> None:
    """Furniture and trunks below 1.5 m, sampled by their vertices: 3 cm or more between any two objects."""
    solid = [(i, world_vertices(world, i)) for i in world.instances if i.kind != "bush"]
    low = [v[v[:, 2] < i.world_from_object[2, 3] + 1.5] for i, v in solid]
    boxes = np.array([[v[:, :2].min(axis=0), v[:, :2].max(axis=0)] for v in low])
    for a in range(len(low)):
        for b in range(a):
            if np.all(boxes[a, 0] < boxes[b, 1] + 0.03) and np.all(boxes[b, 0] < boxes[a, 1] + 0.03):
                gap = np.linalg.norm(low[a][::3, None, :2] - low[b][None, ::3, :2], axis=-1).min()
                assert gap > 0.03, (solid[a][0].name, solid[b][0].name)


def test_objects_are_inside_the_world(world: World) -> None:
    xy = np.array([position(i) for i in world.instances])
    assert np.all(np.abs(xy) < [49.5, 24.5])


def test_trails_are_free_of_furniture_and_trunks(world: World) -> None:
    terrain = world.terrain
    for instance in world.instances:
        vertices = world_vertices(world, instance)
        low = vertices[vertices[:, 2] < instance.world_from_object[2, 3] + 1.0]
        if instance.kind in ("large_tree", "small_tree"):
            assert float(terrain.trail_distance.at(*position(instance))) > 1.5, instance.name
        else:
            assert terrain.trail_distance.at(low[:, 0], low[:, 1]).min() > 0.0, instance.name


def test_world_has_two_trails_with_a_border(world: World) -> None:
    distance = world.terrain.trail_distance
    x = np.linspace(-50, 50, 401)
    y = np.linspace(-25, 25, 201)
    inside = distance.at(*np.meshgrid(x, y, indexing="ij")) < 0
    assert 0.04 < inside.mean() < 0.12  # two trails of 2.4 m and about 100 m
    # On the world's southern and northern halves a line across meets two trails somewhere.
    bands = [np.count_nonzero(np.diff(column.astype(int)) == 1) for column in inside]
    assert max(bands) == 2
    assert world.terrain.border_width > 0
    assert world.materials[world.terrain.border_material].label == Label.TRAIL
    assert world.materials[world.terrain.trail_material].label == Label.TRAIL
    assert all(world.materials[name].label == Label.GROUND for name in world.terrain.ground_materials)
    cover = world.terrain.cover.values
    assert cover.shape[-1] == len(world.terrain.ground_materials)
    assert cover.min() >= 0
    assert np.abs(cover.sum(axis=-1) - 1.0).max() <= 1e-5


def test_no_collider_near_routes(world: World) -> None:
    """No collider comes within 0.6 m of a corridor's centre line."""
    for number, corners_of_line in enumerate(PLANTINGS["park"].corridors):
        line = np.array(corners_of_line)
        for instance in world.instances:
            pose, size = instance.world_from_object, scale_of(instance)
            for collider in world.meshes[instance.mesh].colliders:
                if collider.shape == "cylinder":
                    middle = np.array([[*collider.position, 1.0]]) @ pose.T
                    gap = distance_to_line(middle[:, :2], line)[0] - collider.size[0] * size
                else:
                    turn = np.radians(collider.yaw_deg)
                    u, v = (np.linspace(-0.5, 0.5, 21) * edge for edge in collider.size[:2])
                    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
                    grid = grid @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
                    points = np.column_stack([grid + collider.position[:2], np.zeros(len(grid)), np.ones(len(grid))])
                    gap = distance_to_line((points @ pose.T)[:, :2], line).min()
                assert gap > FREE, (number, instance.name)


def test_object_ids_are_rows_of_object_names(world: World) -> None:
    objects: list[Instance | Swarm] = [*world.instances, *world.swarms]
    ids = [i.object_id for i in objects]
    assert len(set(ids)) == len(ids)
    assert world.object_names[0] == "husky"
    assert "ground" in world.object_names[GROUND_ID]
    assert sorted(ids) == list(range(GROUND_ID + 1, len(world.object_names)))
    assert all(world.object_names[i.object_id] == i.name for i in objects)
    assert len(set(world.object_names)) == len(world.object_names)


def test_poses_are_upright_turns_with_one_scale(world: World) -> None:
    yaws = []
    for instance in world.instances:
        linear = instance.world_from_object[:3, :3] / scale_of(instance)
        assert linear @ linear.T == pytest.approx(np.eye(3), abs=1e-12)
        assert linear[2, 2] == pytest.approx(1.0)
        assert instance.world_from_object[3].tolist() == [0, 0, 0, 1]
        yaws.append(np.arctan2(linear[1, 0], linear[0, 0]))
    assert np.std(yaws) > 1.0


def test_benches_face_their_trail(world: World) -> None:
    """A step of 0.3 m ahead of the seat (+x) brings one nearer to the trail."""
    for instance in world.instances:
        if instance.kind == "bench":
            here, ahead = position(instance), (instance.world_from_object @ [0.3, 0, 0, 1])[:2]
            near, nearer = (float(world.terrain.trail_distance.at(*p)) for p in (here, ahead))
            assert nearer < near - 0.2, instance.name


def test_large_tree_has_20_000_triangles_of_two_classes(world: World) -> None:
    for mesh in {i.mesh: world.meshes[i.mesh] for i in world.instances if "tree" in i.kind}.values():
        labels = np.array([int(world.materials[n].label) for n in mesh.materials])[mesh.material]
        assert set(labels.tolist()) == {Label.TRUNK, Label.TREETOP}
        if mesh.name.startswith("large_tree"):
            assert len(mesh.faces) >= 20_000
            trunk = mesh.vertices[mesh.faces[labels == Label.TRUNK]].reshape(-1, 3)
            assert trunk[:, 2].min() <= 0.0
    heights = {
        kind: [np.ptp(world_vertices(world, i)[:, 2]) for i in world.instances if i.kind == kind]
        for kind in ("large_tree", "small_tree")
    }
    assert min(heights["large_tree"]) > 7.0
    assert max(heights["small_tree"]) < 6.5


def test_species_and_individuals_of_the_real_park(park: World) -> None:
    """At least two species with four individuals each are in the park, as shared meshes."""
    used = {i.mesh for i in park.instances if i.kind == "large_tree"}
    per_species = Counter(species for name in used for species in TREES if f"_{species}_" in name)
    assert sum(count >= 4 for count in per_species.values()) >= 2
    assert len(used) < COUNTS["large_tree"]
    assert {"beech", "spruce", "pine"} <= set(per_species)
    assert set(park.meshes) == {i.mesh for i in park.instances} | {m for s in park.swarms for m in s.meshes}


def test_classes_of_furniture_and_bushes(park: World) -> None:
    expected = {
        "bench": Label.BENCH,
        "lamp_post": Label.LAMP_POST,
        "table": Label.TABLE,
        "trash_bin": Label.TRASH_BIN,
        "bush": Label.BUSH,
    }
    for instance in park.instances:
        if instance.kind in expected:
            labels = {park.materials[name].label for name in park.meshes[instance.mesh].materials}
            assert labels == {expected[instance.kind]}, instance.name
    assert all(material.texture in park.textures for material in park.materials.values())


def test_backdrop_is_watertight_at_the_terrain_and_has_land_woods_and_trails(park: World) -> None:
    whole, field = park.backdrop, park.terrain.field
    assert whole is not None
    labels = {name: park.materials[name].label for name in whole.materials}
    assert labels == {
        "meadow": Label.GROUND,
        "canopy": Label.TREETOP,
        "gravel": Label.TRAIL,
        "setts": Label.TRAIL,
    }
    assert whole.materials[0] == "meadow"
    mesh = joined_land(whole)
    x, y, z = mesh.vertices.astype(float).T
    edge = (np.abs(x) < 50.001) & (np.abs(y) < 25.001)
    assert np.count_nonzero(edge) == 2 * sum(n - 1 for n in field.heights.shape)
    assert np.abs(z - field.height_at(x, y))[edge].max() < 1e-5
    assert np.hypot(x, y).max() > 900
    sides = mesh.vertices[mesh.faces].astype(float)
    up = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])[:, 2]
    assert np.all(up != 0)
    # Every edge inside the ring belongs to two triangles: no slit through which the sky would show.
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert set(counts.tolist()) == {1, 2}
    assert np.count_nonzero(counts == 1) == np.count_nonzero(edge) * (1 + field.spacing / (NEAR_STEP * COARSER))


def joined_land(backdrop: Mesh) -> Mesh:
    """The land without the trails on it, its materials' vertices joined where they meet."""
    faces = backdrop.faces[np.isin(backdrop.material, [backdrop.materials.index(n) for n in ("meadow", "canopy")])]
    _, first, joined = np.unique(backdrop.vertices, axis=0, return_index=True, return_inverse=True)
    used, rows = np.unique(first[joined.ravel()][faces], return_inverse=True)
    return replace(backdrop, vertices=backdrop.vertices[used], faces=rows.reshape(-1, 3).astype(np.int32))


@pytest.mark.slow
def test_same_seed_same_bytes(park: World) -> None:
    assert digest(build_world("park", 0)) == digest(park)


@pytest.mark.slow
def test_same_seed_same_world_and_other_seed_another(park: World) -> None:
    first = park_variant(1)
    assert digest(park_variant.__wrapped__(1)) == digest(first)
    other = park_variant(5)
    poses = [{i.name: i.world_from_object for i in w.instances} for w in (first, other)]
    assert all(not np.allclose(poses[0][name], poses[1][name]) for name in poses[0])
    assert not np.array_equal(first.terrain.field.heights, other.terrain.field.heights)
    trees = [w.meshes["large_tree_lime_0"].vertices for w in (first, other)]
    assert trees[0].shape != trees[1].shape or not np.array_equal(trees[0], trees[1])


@pytest.mark.slow
def test_number_of_bushes_does_not_move_other_objects() -> None:
    many, few = park_variant(1), park_variant(1, bushes=10)
    for name in {i.name for i in many.instances if i.kind != "bush"}:
        pair = [next(i for i in w.instances if i.name == name) for w in (many, few)]
        assert np.array_equal(pair[0].world_from_object, pair[1].world_from_object), name
        assert pair[0].tint == pair[1].tint
    assert Counter(i.kind for i in few.instances)["bush"] == 10
    assert np.array_equal(many.terrain.field.heights, few.terrain.field.heights)

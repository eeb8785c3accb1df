# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world that ends at its edge: no ray hits anything outside, and what is inside is as in the world that goes on."""

from dataclasses import replace

import numpy as np
import pytest
from sense_worlds import F8, box, make_world, quad, trace_rays, without_textures

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.sense.scene import Scene
from fieldtruth.world.assembly import cut_at_edge
from fieldtruth.world.build import build_world, layout_model, load_world
from fieldtruth.world.model import Mesh, Swarm, World


def in_world(world: World, row: int) -> F8:
    """Triangles (t, 3, 3) of an instance."""
    instance = world.instances[row]
    mesh, pose = world.meshes[instance.mesh], instance.world_from_object
    return np.asarray((mesh.vertices.astype(float) @ pose[:3, :3].T + pose[:3, 3])[mesh.faces])


def area_vector(triangles: F8) -> F8:
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(0.5 * across)


def with_swarm(world: World, mesh: Mesh, xy: list[tuple[float, float]]) -> World:
    poses = np.array([transforms.pose((x, y, 0.0), (0, 0, 0)) for x, y in xy])
    swarm = Swarm(
        name="swarm", kind="stone", object_id=len(world.object_names), meshes=(mesh.name,),
        mesh=np.zeros(len(xy), np.int32), world_from_object=poses, tint=np.ones((len(xy), 3), np.float32),
    )  # fmt: skip
    return replace(
        world, meshes={**world.meshes, mesh.name: mesh}, swarms=(*world.swarms, swarm),
        object_names=(*world.object_names, swarm.name),
    )  # fmt: skip


def test_a_box_is_cut_where_it_crosses_the_edge() -> None:
    """Half edge lengths 1, 2, 3 m, turned about z by 90 deg and scaled by 1/2: 2 x 1 x 3 m about (x, y, 0)."""
    turned = transforms.pose((0, 0, 0), (0, 0, 90))
    turned[:3, :3] *= 0.5
    poses = [turned.copy() for _ in range(3)]
    for pose, xy in zip(poses, ((0.0, 0.0), (19.7, 0.0), (-19.7, 19.8)), strict=True):
        pose[:2, 3] = xy
    mesh = box("box", (1, 2, 3), "bark")
    cut = cut_at_edge(make_world([(mesh, pose) for pose in poses]))
    assert cut.instances[0].mesh == "box"
    assert cut.meshes["box"] is mesh
    for row, (x, y) in ((1, (1.3, 1.0)), (2, (1.3, 0.7))):
        triangles = in_world(cut, row)
        assert np.abs(triangles[..., :2]).max() <= 20.0 + 1e-6
        faces = np.abs(area_vector(triangles)).sum(axis=0)
        sides = 1 if row == 2 else 2  # the other is outside
        assert faces == pytest.approx([y * 3.0, x * 3.0 * sides, 2 * x * y], rel=1e-6)


def test_normals_and_uv_are_those_of_the_point() -> None:
    sheet = quad("sheet", [[-40, -40, 0], [40, -40, 0], [40, 40, 0], [-40, 40, 0]], "water")
    bent = (sheet.vertices / 40 + np.array([0, 0, 1])).astype(np.float32)
    sheet = replace(sheet, normals=bent, uv=3 * sheet.vertices[:, :2] + 7)
    part = next(iter(cut_at_edge(make_world([(sheet, np.eye(4))])).meshes.values()))
    assert np.abs(area_vector(part.vertices[part.faces].astype(float))).sum() == pytest.approx(40.0**2)
    assert part.uv == pytest.approx(3 * part.vertices[:, :2] + 7, abs=1e-4)
    expected = part.vertices / 40 + np.array([0, 0, 1])
    assert part.normals == pytest.approx(expected / np.linalg.norm(expected, axis=1, keepdims=True), abs=1e-6)


def test_members_beyond_the_edge_and_empty_swarms_are_left_out() -> None:
    stone = box("stone", (0.5, 0.5, 0.5))
    near = with_swarm(make_world(), stone, [(1, 2), (30, 0), (19.9, 0), (20.1, 0)])
    cut = cut_at_edge(with_swarm(near, box("far", (1, 1, 1)), [(0, 25)]))
    assert [(s.name, len(s.mesh), s.object_id) for s in cut.swarms] == [("swarm", 2, 2)]
    assert cut.object_names == ("husky", "ground", "swarm")
    assert len(cut.meshes) == 2
    assert cut.backdrop is None


def check_rays(whole: World, bare: World, count: int) -> None:
    """Rays from inside in all directions: the bare world is hit inside only, and where the whole one is."""
    rng = np.random.default_rng(4)
    half = np.array(whole.size) / 2
    xy = rng.uniform(-0.98, 0.98, (count, 2)) * half
    z = whole.terrain.field.height_at(*xy.T) + rng.uniform(0.3, 12.0, count)
    origins, directions = np.column_stack([xy, z]), rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    scene, reference = Scene(bare), Scene(whole)
    seen, full = (trace_rays(s, origins, directions, max_range=3000.0) for s in (scene, reference))
    hit = seen.range_m > 0
    points = origins + seen.range_m[:, None] * directions
    assert (np.abs(points[hit, :2]) <= half + 1e-3).all()
    assert 0.3 < hit.mean() < 0.9  # the rest of the rays leave
    assert {Label.GROUND, Label.TREETOP, Label.TRUNK} <= set(seen.label[hit].tolist())
    names = np.array(whole.object_names)
    inside = (np.abs(origins + full.range_m[:, None] * directions)[:, :2] < half - 1e-3).all(axis=1)
    own = np.isin(names[full.instance], bare.object_names)
    same = (full.range_m > 0) & inside & own
    assert same.sum() > 0.25 * count
    np.testing.assert_allclose(seen.range_m[same], full.range_m[same], rtol=0.0, atol=2e-4)
    assert (np.array(bare.object_names)[seen.instance[same]] == names[full.instance[same]]).all()
    assert (seen.label[same] == full.label[same]).all()


@pytest.mark.slow
def test_nothing_of_the_lake_is_beyond_its_edge() -> None:
    whole = load_world("lake")
    bare = cut_at_edge(whole)
    assert [i.name for i in bare.instances] == [i.name for i in whole.instances]
    check_rays(whole, bare, 20_000)
    sheet = in_world(bare, [i.kind for i in bare.instances].index("water"))
    assert np.abs(area_vector(sheet)).sum() == pytest.approx(100.0 * 50.0)
    wires = np.concatenate(
        [in_world(bare, k).reshape(-1, 3) for k, i in enumerate(bare.instances) if i.kind == "cable"]
    )
    assert np.abs(wires[:, 0]).max() == pytest.approx(50.0)  # they are cut at the edge, not before it


@pytest.mark.slow
def test_nothing_of_the_park_is_beyond_its_edge() -> None:
    """Its avenues and beds cross the edge, and it has more kinds of swarms than the forest and the hillside."""
    with without_textures():
        bare = build_world("park", 0, {"beyond": False})
    assert bare.backdrop is None
    check_rays(load_world("park"), bare, 20_000)


def test_in_the_park_a_number_is_the_share_of_the_trees_beyond() -> None:
    model = layout_model("park")
    shares = [model.model_validate({"beyond": value}).model_dump()["beyond"] for value in (0, 0.2, True, False)]
    assert shares == [0.0, 0.2, 0.7, False]
    assert [type(share) for share in shares] == [float, float, float, bool]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Beds of the park, its trees, its swarms, and its surroundings."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from park_worlds import park_variant, real_park
from scipy.spatial import cKDTree

from fieldtruth.core.classes import Label
from fieldtruth.world.environments.layered.beds import Bed, Edging, bed_distance
from fieldtruth.world.environments.layered.fields import FAR
from fieldtruth.world.environments.layout import PLANTINGS
from fieldtruth.world.model import LITTER, Swarm, World

F8 = NDArray[np.float64]
LENGTH = Edging(name="stones").stone[0]  # [m]
TREES_BEYOND = ("avenues_near", "avenues_beyond", "woods_beyond", "trees_near", "trees_beyond")
BEYOND = (*TREES_BEYOND, "bushes_beyond", "high_grass_beyond")


SEEDS = [0, pytest.param(1, marks=pytest.mark.slow)]


@pytest.fixture(scope="module", params=SEEDS, ids=lambda seed: f"seed_{seed}")
def world(request: pytest.FixtureRequest) -> World:
    return real_park() if request.param == 0 else park_variant(request.param)


def swarm(world: World, name: str) -> Swarm:
    return next(s for s in world.swarms if s.name == name)


def positions(swarm: Swarm) -> F8:
    return swarm.world_from_object[:, :2, 3]


def nearest(others: F8, xy: F8) -> tuple[F8, NDArray[np.intp]]:
    """Distance (n,) of positions (n, 2) to the nearest of others (m, 2), and its row."""
    away, row = cKDTree(others).query(xy)
    return np.asarray(away), np.asarray(row)


def off_edge(world: World, xy: F8) -> F8:
    return np.asarray(np.hypot(*np.maximum(np.abs(xy) - np.array(world.size) / 2, 0.0).T))


def test_round_bed_has_the_distances_of_a_circle() -> None:
    bed = Bed((3.0, -2.0), (1.5, 1.5), 0.7, ())
    assert np.hypot(*(bed.outline(0.2) - bed.centre).T) == pytest.approx(1.5, abs=1e-4)
    assert bed.distance(np.array([[3.0, -2.0], [5.0, -2.0], [3.0, 0.0]])) == pytest.approx([-1.5, 0.5, 0.5])
    assert bed_distance([bed], np.array([[3.5, -2.0], [30.0, 0.0]])) == pytest.approx([-1.0, FAR])


def test_oblong_bed_is_rotated_and_has_distance_0_on_its_outline() -> None:
    bed = Bed((1.0, 1.0), (2.0, 1.0), np.pi / 2, ())  # two metres along y
    assert bed.distance(np.array([[1.0, 3.0], [2.0, 1.0], [1.0, 4.0]])) == pytest.approx([0.0, 0.0, 1.0])
    wavy = Bed((1.0, 1.0), (2.0, 1.2), 0.4, ((2, 0.1, 0.3), (3, 0.05, 1.0)))
    rim = wavy.outline(0.2)
    assert np.abs(wavy.distance(rim)).max() < 2e-3
    gaps = np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)
    assert gaps.min() > 0.19
    assert gaps.max() < 0.215
    assert np.hypot(*(rim - wavy.centre).T).max() < wavy.radius


def test_bushes_are_in_mulched_beds_with_closed_edges(world: World) -> None:
    """Each bush is on mulch; each stone has a neighbour at a stone's length on both sides."""
    mulch = world.terrain.cover.values[..., world.terrain.ground_materials.index("mulch")]
    cover = world.terrain.cover
    bushes = np.array([i.world_from_object[:2, 3] for i in world.instances if i.kind == "bush"])
    i, j = np.round((bushes - (cover.x0, cover.y0)) / cover.spacing).astype(int).T
    assert mulch[i, j].min() > 0.9
    stones = positions(swarm(world, "bed_edges"))
    away = np.asarray(cKDTree(stones).query(stones, k=3)[0])
    assert away[:, 1:].max() < LENGTH + 0.05
    assert away[:, 1].min() > LENGTH - 0.05
    assert nearest(stones, bushes)[0].max() < 4.0
    # Lawn outside, mulch inside: about half of the ground within 25 cm of the stones is mulch.
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    ring = (stones[:, None] + 0.25 * np.stack([np.cos(turn), np.sin(turn)], -1)).reshape(-1, 2)
    i, j = np.round((ring - (cover.x0, cover.y0)) / cover.spacing).astype(int).T
    assert 0.35 < mulch[i, j].mean() < 0.6


def test_bushes_are_of_four_species(world: World) -> None:
    kinds = {i.mesh.split("_")[1] for i in world.instances if i.kind == "bush"}
    assert kinds == {"box", "hazel", "heather", "juniper"}


def test_stones_of_edges_are_ground_and_flush_with_it(world: World) -> None:
    edge = swarm(world, "bed_edges")
    for name in edge.meshes:
        mesh = world.meshes[name]
        assert {world.materials[n].label for n in mesh.materials} == {Label.GROUND}
        assert mesh.vertices[:, 2].max() < 0.05  # a wheel rolls over it
        assert mesh.vertices[:, 2].min() < -0.1
        assert not mesh.colliders
        faces = mesh.vertices[mesh.faces].astype(float)
        out = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        assert np.all((out * (faces.mean(axis=1) - [0, 0, -0.05])).sum(axis=1) > 0)  # seen from outside
    x, y, z = edge.world_from_object[:, :3, 3].T
    assert np.abs(z - world.terrain.field.height_at(x, y)).max() < 0.02


def test_swarms_are_on_the_ground_off_trails_and_routes(world: World) -> None:
    inside = [s for s in world.swarms if s.name not in BEYOND and s.kind != LITTER]
    assert {s.name for s in inside} >= {"bed_edges", "rough_grass", "meadow_islands", "bed_grass", "bed_daisy"}
    for s in inside:
        xy = positions(s)
        assert np.all(np.abs(xy) <= np.array(world.size) / 2)
        trail = world.terrain.trail_distance.at(*xy.T)
        assert trail.min() > (0.35 if s.name == "bed_edges" else 0.0), s.name
        z = s.world_from_object[:, 2, 3]
        assert np.abs(z - world.terrain.field.height_at(*xy.T)).max() < 0.03, s.name
        if s.name in ("bed_edges", "meadow_islands"):
            for line in PLANTINGS["park"].corridors:
                steps = [np.linspace(a, b, 100) for a, b in pairwise(line)]
                assert nearest(np.concatenate(steps), xy)[0].min() > 1.1, s.name


def test_herbs_are_high_grass(world: World) -> None:
    for s in world.swarms:
        labels = {world.materials[n].label for m in s.meshes for n in world.meshes[m].materials}
        if s.name in ("rough_grass", "meadow_islands", "bed_grass", "high_grass_beyond") or s.kind == "flower":
            assert labels == {Label.HIGH_GRASS}, s.name
        elif s.kind == "tree":
            assert labels == {Label.TRUNK, Label.TREETOP}, s.name


def test_long_grass_grows_at_trunks_and_posts(world: World) -> None:
    tufts = positions(swarm(world, "rough_grass"))
    feet = np.array([i.world_from_object[:2, 3] for i in world.instances if i.kind in ("large_tree", "lamp_post")])
    assert np.mean(nearest(tufts, feet)[0] < 1.0) > 0.7


def test_nearest_trees_are_different_individuals() -> None:
    world = real_park()
    for kind in ("large_tree", "small_tree"):
        trees = [i for i in world.instances if i.kind == kind]
        xy = np.array([i.world_from_object[:2, 3] for i in trees])
        neighbour = np.asarray(cKDTree(xy).query(xy, k=2)[1])[:, 1]
        assert all(trees[k].mesh != trees[n].mesh for k, n in enumerate(neighbour)), kind


def test_far_swarms_are_outside_the_world_and_on_the_backdrop(world: World) -> None:
    assert world.backdrop is not None
    x, y, z = world.backdrop.vertices.astype(float).T
    for name in BEYOND:
        far = swarm(world, name)
        xy = positions(far)
        assert len(xy) > 3, name
        off = off_edge(world, xy)
        assert off.min() > 0.9, name
        if name == "woods_beyond":  # at the rims the nodes are roofs as well as ground
            continue
        away, near = nearest(np.column_stack([x, y]), xy)
        gap = far.world_from_object[:, 2, 3] - z[near]
        assert np.all(gap < 0.05 + 0.25 * away), name
        assert np.all(gap > -0.6 - 0.25 * away), name
    near_by = np.concatenate([positions(swarm(world, n)) for n in BEYOND if "trees" in n or "avenue" in n])
    assert 80 <= np.count_nonzero(off_edge(world, near_by) < 62.0) <= 300


def test_trails_continue_beyond_the_edge_without_a_step(world: World) -> None:
    """At the edge the ribbons are where the trails leave the world; no tree is on them."""
    land = world.backdrop
    assert land is not None
    rows = [land.materials.index(name) for name in ("gravel", "setts")]
    ribbon = land.vertices[np.unique(land.faces[np.isin(land.material, rows)])].astype(float)
    off = off_edge(world, ribbon[:, :2])
    assert off.max() > 55.0
    edge = ribbon[off < 1e-3]
    distance = world.terrain.trail_distance.at(edge[:, 0], edge[:, 1])
    assert distance.max() < 0.12
    assert np.abs(edge[:, 2] - world.terrain.field.height_at(edge[:, 0], edge[:, 1])).max() < 0.03
    assert np.all(off >= 0)
    inside = (np.abs(ribbon[:, :2]) < np.array(world.size) / 2 - 1e-4).all(axis=1)
    assert not inside.any()
    trees = np.concatenate([positions(swarm(world, n)) for n in BEYOND if n != "woods_beyond"])
    assert nearest(ribbon[:, :2], trees)[0].min() > 0.8


@pytest.mark.slow
def test_densities_of_0_remove_herbs_and_far_plants() -> None:
    bare = park_variant(1, herbs=0, beyond=0, litter=0)
    assert [s.name for s in bare.swarms] == ["bed_edges"]
    same = park_variant(1)
    assert [i.name for i in bare.instances] == [i.name for i in same.instances]
    assert all(
        np.array_equal(a.world_from_object, b.world_from_object)
        for a, b in zip(bare.instances, same.instances, strict=True)
    )

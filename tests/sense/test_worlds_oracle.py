# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Class, object and range of rays in the built worlds agree with an independent ray tracer."""

import numpy as np
import pytest
from kept_worlds import KEPT
from oracle import expected_hits
from sense_worlds import F8, box, built_scene, make_world, trace_rays

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.experiment.config import metres_from_route
from fieldtruth.experiment.files import load_experiment
from fieldtruth.sense.scene import Scene
from fieldtruth.validation.tracer import ReferenceTracer

RAYS = {"park": 1500, "lake": 900, "forest": 900, "hillside": 900}
CLASSES = {"park": 9, "lake": 7, "forest": 7, "hillside": 6}
"""Least number of classes that the rays must hit: nearly all of the world's."""


def unit(vectors: F8) -> F8:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def robot_rays(scene: Scene, count: int, rng: np.random.Generator) -> tuple[F8, F8]:
    """Rays from near the waypoints, 0.3 to 1.2 m above the ground, in all directions from 25 deg down to 35 deg up."""
    corners = np.concatenate(
        [metres_from_route(load_experiment(n).route) for n in (f"{scene.world.name}_1", f"{scene.world.name}_2")]
    )
    positions = corners[rng.integers(len(corners), size=count)] + rng.uniform(-0.5, 0.5, (count, 2))
    z = scene.world.terrain.field.height_at(*positions.T) + rng.uniform(0.3, 1.2, count)
    azimuth, elevation = rng.uniform(0, 2 * np.pi, count), np.radians(rng.uniform(-25, 35, count))
    flat = np.cos(elevation)
    directions = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)
    return np.column_stack([positions, z]), directions


def test_oracle_on_a_box() -> None:
    """It finds a rotated box with half edge lengths 1, 2, 3 m, and marks rays along its edges as doubtful."""
    pose = transforms.pose((10, 0, 5), (0, 0, 90))
    world = make_world([(box("box", (1, 2, 3), "bark"), pose)])
    origins = np.array([[0, 0.1, 5.2], [0, 1.5, 5.0], [0, 0.999999, 5.3], [3.1, 3.2, 2.0], [0, 0.5, 5.5]])
    directions = np.array([[1.0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, -1], [0, 0, 1]])
    found = expected_hits(ReferenceTracer(world), origins, directions)
    assert found.label[[0, 1, 3, 4]].tolist() == [Label.TRUNK, Label.SKY, Label.GROUND, Label.SKY]
    assert found.range_m[[0, 1, 3, 4]] == pytest.approx([8.0, 0.0, 2.0, 0.0])  # rotated by 90 deg: 2 m along x
    assert found.instance[[0, 1, 3, 4]].tolist() == [2, 0, 1, 0]
    assert found.doubtful.tolist() == [False, False, True, False, False]  # the third is 1 um inside an edge


@pytest.fixture(
    scope="module",
    params=["park", *(pytest.param(each, marks=pytest.mark.slow) for each in ("hillside", "lake", "forest"))],
)
def scene(request: pytest.FixtureRequest) -> Scene:
    return built_scene(request.param)


@pytest.fixture(scope="module")
def tracer(scene: Scene) -> ReferenceTracer:
    return KEPT.tracer(scene.world)


def test_oracle_has_every_triangle(scene: Scene, tracer: ReferenceTracer) -> None:
    world = scene.world
    nx, ny = world.terrain.field.heights.shape
    assert world.backdrop is not None
    objects = sum(len(world.meshes[i.mesh].faces) for i in world.instances)
    objects += sum(len(world.meshes[s.meshes[row]].faces) for s in world.swarms for row in s.mesh)
    expected = 2 * (nx - 1) * (ny - 1) + len(world.backdrop.faces) + objects
    assert tracer.triangles == expected > 1_000_000


def test_class_object_and_range_agree_with_the_oracle(scene: Scene, tracer: ReferenceTracer) -> None:
    count = RAYS[scene.world.name]
    origins, directions = robot_rays(scene, count, np.random.default_rng(20))
    seen = trace_rays(scene, origins, directions, max_range=3000.0)
    expected = expected_hits(tracer, origins, unit(directions))
    sure = ~expected.doubtful
    excluded = f"{np.count_nonzero(~sure)} of {count} rays graze a border and were excluded"
    assert np.count_nonzero(~sure) < 0.03 * count, excluded
    assert len(np.unique(expected.label[sure])) >= CLASSES[scene.world.name], "the rays must hit nearly every class"
    wet = expected.label == Label.WATER  # which returns no pulse
    expected.label[wet], expected.instance[wet], expected.range_m[wet] = Label.SKY, 0, 0.0
    label = np.where(seen.range_m > 0, seen.label, Label.SKY)
    wrong = np.flatnonzero(sure & ((label != expected.label) | (seen.instance != expected.instance)))
    assert len(wrong) == 0, f"class or object differ for rays {wrong.tolist()}; {excluded}"
    # Single precision rounds surfaces by about 10 um, which grows with the inverse cosine along a grazing ray.
    allowed = 2e-5 / expected.cosine + 1e-6 * expected.range_m
    off = np.flatnonzero(sure & (np.abs(seen.range_m - expected.range_m) > allowed))
    assert len(off) == 0, f"range differs for rays {off.tolist()}; {excluded}"

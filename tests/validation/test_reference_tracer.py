# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The second tracer: closed forms on a box, agreement with Embree in a built world, and no wrong reading passes."""

import dataclasses

import numpy as np
import pytest
from kept_worlds import KEPT
from numpy.typing import NDArray

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.kernels.lidar import Scan
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar, ray_directions
from fieldtruth.validation.rays import NOTHING, RayReading, mismatches
from fieldtruth.validation.tracer import ReferenceTracer
from fieldtruth.world.model import Heightfield, Instance, Mesh, Raster, World

F8 = NDArray[np.float64]

RAY = np.zeros(3), np.array([1.0, 0.0, 0.0])
"""In base_link, of sensors whose robot is not visible."""
HALF = np.array([1.0, 2.0, 3.0])
POSE = transforms.pose((10.0, 0.0, 20.0), (0.0, 0.0, 90.0))
CONFIG = LidarConfig(columns=32, rings=24, min_range=0.5, max_range=60.0)


def plain(park: SensorWorld, *, trail_edge_at: float = 1e3, shrunk: float = 1.0) -> World:
    """A box of bark, turned by 90 deg about z, above a plane at height 0; the trail begins at an x [m].

    The mesh is larger than the box by ``shrunk``, the pose makes it smaller again.
    """
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * HALF * shrunk
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)], np.int32)
    world = park.world
    bark = next(name for name, material in world.materials.items() if material.label == Label.TRUNK)
    box = Mesh(
        name="box",
        vertices=corners.astype(np.float32),
        normals=np.zeros((8, 3), np.float32),
        uv=np.zeros((8, 2), np.float32),
        faces=faces,
        material=np.zeros(12, np.int32),
        materials=(bark,),
    )
    field = Heightfield(heights=np.zeros((41, 41), np.float32), spacing=5.0, x0=-100.0, y0=-100.0)
    slope = np.array([[-100.0 - trail_edge_at] * 2, [100.0 - trail_edge_at] * 2], np.float32)
    terrain = dataclasses.replace(
        world.terrain,
        field=field,
        layer=None,
        trail_distance=Raster(values=-slope, spacing=200.0, x0=-100.0, y0=-100.0),
    )
    instance = Instance(
        name="box_1", kind="box", mesh="box", object_id=2, world_from_object=POSE @ np.diag([1 / shrunk] * 3 + [1])
    )
    return dataclasses.replace(
        world, terrain=terrain, meshes={"box": box}, instances=(instance,), swarms=(), backdrop=None,
        object_names=("husky", "ground", "box_1"),
    )  # fmt: skip


def reading(
    origin: tuple[float, ...], direction: tuple[float, ...], range_m: float, label: int, instance: int
) -> RayReading:
    unit = np.array(direction) / np.linalg.norm(direction)
    return RayReading("here", np.array(origin), unit, range_m, label, instance, 0.0, 100.0, pulsed=False, in_base=RAY)


def test_ranges_on_a_box_and_a_plane_match_the_closed_form(park: SensorWorld) -> None:
    world = plain(park)
    tracer = ReferenceTracer(world)
    origins = np.array([[0, 0.3, 20.4], [10.2, 0.1, 30], [10.2, -5.1, 20], [3, 4, 7.0], [0, 2.5, 20]])
    directions = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 0, -1], [1, 0, 0.0]])
    hits = tracer.hits(origins, directions, np.full(5, 50.0))
    firsts = np.searchsorted(hits.ray, range(4))
    assert hits.ray[firsts].tolist() == [0, 1, 2, 3]
    # Turned by 90 deg the box reaches 2 m along x, 1 m along y; it extends from 17 to 23 m.
    assert hits.range_m[firsts] == pytest.approx([8.0, 7.0, 4.1, 7.0])
    assert hits.instance[firsts].tolist() == [2, 2, 2, 1]
    assert hits.ray.tolist().count(0) == 2  # in and out
    assert hits.ray.tolist().count(1) == 3  # and the ground


RIGHT = reading((0, 0.3, 20.4), (1, 0, 0), 8.0, Label.TRUNK, 2)


def test_right_reading_passes_and_each_wrong_one_mismatches(park: SensorWorld) -> None:
    world = plain(park)
    wrong = [
        RIGHT._replace(label=Label.ROCK),
        RIGHT._replace(instance=1),
        RIGHT._replace(range_m=8.001),
        RIGHT._replace(range_m=7.999),
        RIGHT._replace(range_m=12.0),  # the far side, occluded by the near one
        RIGHT._replace(range_m=NOTHING, label=Label.SKY, instance=0),
        RIGHT._replace(far=7.9),
        RIGHT._replace(near=8.1),
        reading((0, 2.5, 20), (1, 0, 0), 8.0, Label.TRUNK, 2),  # passes the box by
    ]
    right = [
        RIGHT,
        RIGHT._replace(range_m=8.000_01),
        RIGHT._replace(range_m=float("nan")),
        RIGHT._replace(instance=-1),
        RIGHT._replace(far=7.9, range_m=NOTHING),
        RIGHT._replace(near=8.1, range_m=NOTHING),  # too near to be seen, it hides its own far side
        reading((0, 2.5, 20), (1, 0, 0), NOTHING, Label.SKY, 0),
        reading((3, 4, 7), (0, 0, -1), 7.0, Label.GROUND, 1),
    ]
    tracer = ReferenceTracer(world)
    assert mismatches(world, tracer, right) == [None] * len(right)
    assert None not in mismatches(world, tracer, wrong)
    assert mismatches(world, tracer, wrong[:1]) == ["there is trunk and branch of object 2 at 8.0000 m"]
    assert mismatches(world, tracer, []) == []


@pytest.mark.parametrize(("shrunk", "inside"), [(1.0, 1e-7), (1.0, 2.5e-5), (10.0, 2.5e-5), (0.1, 2.5e-5)])
def test_ray_that_grazes_an_edge_may_hit_or_miss(park: SensorWorld, shrunk: float, inside: float) -> None:
    """A ray just [m] inside the box's edge: single precision may fall on either side, whatever the mesh's scale."""
    world = plain(park, shrunk=shrunk)
    beside = 1.0 - inside
    readings = [
        reading((0, beside, 20.4), (1, 0, 0), 8.0, Label.TRUNK, 2),
        reading((0, beside, 20.4), (1, 0, 0), NOTHING, Label.SKY, 0),
        reading((0, beside, 20.4), (1, 0, 0), 8.0, Label.ROCK, 2),
    ]
    assert [answer is None for answer in mismatches(world, ReferenceTracer(world), readings)] == [True, True, False]


def test_ray_that_clips_a_sharp_edge_may_hit_or_miss(park: SensorWorld) -> None:
    """It enters and leaves within a micrometre, through two faces that both are behind their edge."""
    world, half = plain(park), float(np.sqrt(0.5))
    origin, far = (3.0, -4.0 - 3e-7, 20.4), float(np.sqrt(50.0))
    readings = [
        reading(origin, (half, half, 0), far, Label.TRUNK, 2),
        reading(origin, (half, half, 0), NOTHING, Label.SKY, 0),
        reading(origin, (half, half, 0), far, Label.ROCK, 2),
        reading((3.0, -4.0002, 20.4), (half, half, 0), NOTHING, Label.SKY, 0),
    ]
    answers = mismatches(world, ReferenceTracer(world), readings)
    assert [answer is None for answer in answers] == [True, True, False, False]


@pytest.mark.parametrize("shrunk", [1.0, 10.0, 0.1])
def test_ray_a_tenth_of_a_millimetre_from_an_edge_has_one_answer(park: SensorWorld, shrunk: float) -> None:
    world = plain(park, shrunk=shrunk)
    readings = [
        reading((0, 0.9999, 20.4), (1, 0, 0), NOTHING, Label.SKY, 0),
        reading((0, 1.0001, 20.4), (1, 0, 0), 8.0, Label.TRUNK, 2),
    ]
    assert None not in mismatches(world, ReferenceTracer(world), readings)


def test_trail_begins_where_its_distance_changes_sign(park: SensorWorld) -> None:
    world = plain(park, trail_edge_at=5.0)
    down = (0.0, 0.0, -1.0)
    readings = [
        reading((4.99, 4, 7), down, 7.0, Label.GROUND, 1),
        reading((5.01, 4, 7), down, 7.0, Label.TRAIL, 1),
        reading((5.000_001, 4, 7), down, 7.0, Label.GROUND, 1),
        reading((4.99, 4, 7), down, 7.0, Label.TRAIL, 1),
        reading((5.01, 4, 7), down, 7.0, Label.GROUND, 1),
    ]
    found = [answer is None for answer in mismatches(world, ReferenceTracer(world), readings)]
    assert found == [True, True, True, False, False]


@pytest.fixture(scope="module")
def scan(park: SensorWorld) -> Scan:
    return IdealLidar(CONFIG, park.scene).scan(lidar_pose(park))


def lidar_pose(park: SensorWorld) -> F8:
    height = float(park.world.terrain.field.height_at(-20.0, -3.0))
    return transforms.pose((-20.0, -3.0, height + 0.96), (3.0, -4.0, 70.0))


def readings_of(park: SensorWorld, scan: Scan) -> list[RayReading]:
    """The readings of all rays of a scan."""
    pose, directions = lidar_pose(park), ray_directions(CONFIG)
    returns = {(int(c), int(r)): k for k, (c, r) in enumerate(zip(scan.column, scan.ring, strict=True))}
    found = []
    for column, ring in np.ndindex(CONFIG.columns, CONFIG.rings):
        k = returns.get((column, ring))
        measured = (NOTHING, 0, 0) if k is None else (float(scan.range_m[k]), int(scan.label[k]), int(scan.instance[k]))
        ray = pose[:3, :3] @ directions[column, ring]
        limits = CONFIG.min_range, CONFIG.max_range
        found.append(RayReading("", pose[:3, 3], ray, *measured, *limits, pulsed=True, in_base=RAY))
    return found


def test_embree_and_the_second_tracer_agree_in_a_built_world(park: SensorWorld, scan: Scan) -> None:
    readings = readings_of(park, scan)
    assert len({c.label for c in readings}) > 5
    assert 0 < sum(c.range_m == NOTHING for c in readings) < len(readings) / 2
    assert mismatches(park.world, KEPT.tracer(park.world), readings) == [None] * len(readings)


def test_no_wrong_reading_in_a_built_world_passes(park: SensorWorld, scan: Scan) -> None:
    """Each ray with another class, object or range (by 2 mm and more where the ray skims), or nothing at all."""
    rng, wrong = np.random.default_rng(1), []
    for k, found in enumerate(readings_of(park, scan)):
        if found.range_m == NOTHING:
            wrong.append(found._replace(range_m=float(rng.uniform(1, 50)), label=Label.ROCK, instance=5))
        else:
            wrong.append([
                found._replace(label=found.label % 13 + 1),
                found._replace(instance=found.instance + 1),
                found._replace(range_m=found.range_m * (1 + 0.002 * rng.choice([-1, 1]))),
                found._replace(range_m=NOTHING, label=Label.SKY, instance=0),
            ][k % 4])  # fmt: skip
    assert None not in mismatches(park.world, KEPT.tracer(park.world), wrong)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The second tracer: closed forms on a box, agreement with the engine on a built world, and no wrong claim passes."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.core import frames
from fieldtruth.core.classes import Label
from fieldtruth.experiment.rig import LidarConfig
from fieldtruth.sense.lidar import Lidar, Scan, ray_directions
from fieldtruth.validation.claims import NOTHING, Claim, refuted
from fieldtruth.validation.exact import ExactTracer
from fieldtruth.validation.subject import Place
from fieldtruth.world.model import Heightfield, Instance, Mesh, Raster, World

F8 = NDArray[np.float64]

HALF = np.array([1.0, 2.0, 3.0])
POSE = frames.pose((10.0, 0.0, 20.0), (0.0, 0.0, 90.0))
CONFIG = LidarConfig(columns=32, rings=24, min_range=0.5, max_range=60.0)


def plain(place: Place, *, trail_edge_at: float = 1e3, shrunk: float = 1.0) -> World:
    """A box of bark, turned by 90 deg about z, above a plane at height 0; the trail begins at an x [m].

    The mesh is larger than the box by ``shrunk``, the pose makes it smaller again.
    """
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * HALF * shrunk
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)], np.int32)
    world = place.world
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
        trail_distance=Raster(values=-slope, spacing=200.0, x0=-100.0, y0=-100.0),
    )
    thing = Instance(
        name="box_1", kind="box", mesh="box", object_id=2, world_from_object=POSE @ np.diag([1 / shrunk] * 3 + [1])
    )
    return dataclasses.replace(
        world, terrain=terrain, meshes={"box": box}, instances=(thing,), swarms=(), backdrop=None,
        object_names=("husky", "ground", "box_1"),
    )  # fmt: skip


def claim(origin: tuple[float, ...], direction: tuple[float, ...], range_m: float, label: int, instance: int) -> Claim:
    unit = np.array(direction) / np.linalg.norm(direction)
    return Claim("here", np.array(origin), unit, range_m, label, instance, 0.0, 100.0, pulse=False)


def test_ranges_on_a_box_and_a_plane_are_those_of_the_closed_form(place: Place) -> None:
    world = plain(place)
    tracer = ExactTracer(world)
    origins = np.array([[0, 0.3, 20.4], [10.2, 0.1, 30], [10.2, -5.1, 20], [3, 4, 7.0], [0, 2.5, 20]])
    directions = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 0, -1], [1, 0, 0.0]])
    hits = tracer.hits(origins, directions, np.full(5, 50.0))
    firsts = np.searchsorted(hits.ray, range(4))
    assert hits.ray[firsts].tolist() == [0, 1, 2, 3]
    # Turned by 90 deg the box reaches 2 m along x, 1 m along y; it stands from 17 to 23 m.
    assert hits.reach[firsts] == pytest.approx([8.0, 7.0, 4.1, 7.0])
    assert hits.instance[firsts].tolist() == [2, 2, 2, 1]
    assert hits.ray.tolist().count(0) == 2  # in and out
    assert hits.ray.tolist().count(1) == 3  # and the ground


RIGHT = claim((0, 0.3, 20.4), (1, 0, 0), 8.0, Label.TRUNK, 2)


def test_a_true_claim_passes_and_each_untruth_is_refuted(place: Place) -> None:
    world = plain(place)
    wrong = [
        RIGHT._replace(label=Label.ROCK),
        RIGHT._replace(instance=1),
        RIGHT._replace(range_m=8.001),
        RIGHT._replace(range_m=7.999),
        RIGHT._replace(range_m=12.0),  # the far side, hidden by the near one
        RIGHT._replace(range_m=NOTHING, label=Label.SKY, instance=0),
        RIGHT._replace(most=7.9),
        RIGHT._replace(least=8.1),
        claim((0, 2.5, 20), (1, 0, 0), 8.0, Label.TRUNK, 2),  # passes the box by
    ]
    right = [
        RIGHT,
        RIGHT._replace(range_m=8.000_01),
        RIGHT._replace(range_m=float("nan")),
        RIGHT._replace(instance=-1),
        RIGHT._replace(most=7.9, range_m=NOTHING),
        RIGHT._replace(least=8.1, range_m=NOTHING),  # too near to be seen, it hides its own far side
        claim((0, 2.5, 20), (1, 0, 0), NOTHING, Label.SKY, 0),
        claim((3, 4, 7), (0, 0, -1), 7.0, Label.GROUND, 1),
    ]
    tracer = ExactTracer(world)
    assert refuted(world, tracer, right) == [None] * len(right)
    assert None not in refuted(world, tracer, wrong)
    assert refuted(world, tracer, wrong[:1]) == ["there is trunk and branch of object 2 at 8.0000 m"]
    assert refuted(world, tracer, []) == []


@pytest.mark.parametrize(("shrunk", "inside"), [(1.0, 1e-7), (1.0, 2.5e-5), (10.0, 2.5e-5), (0.1, 2.5e-5)])
def test_what_grazes_a_border_may_be_either(place: Place, shrunk: float, inside: float) -> None:
    """A ray a hair [m] inside the box's edge: single precision may fall on either side, whatever the mesh's scale."""
    world = plain(place, shrunk=shrunk)
    beside = 1.0 - inside
    claims = [
        claim((0, beside, 20.4), (1, 0, 0), 8.0, Label.TRUNK, 2),
        claim((0, beside, 20.4), (1, 0, 0), NOTHING, Label.SKY, 0),
        claim((0, beside, 20.4), (1, 0, 0), 8.0, Label.ROCK, 2),
    ]
    assert [answer is None for answer in refuted(world, ExactTracer(world), claims)] == [True, True, False]


@pytest.mark.parametrize("shrunk", [1.0, 10.0, 0.1])
def test_a_tenth_of_a_millimetre_from_a_border_there_is_no_doubt(place: Place, shrunk: float) -> None:
    world = plain(place, shrunk=shrunk)
    claims = [
        claim((0, 0.9999, 20.4), (1, 0, 0), NOTHING, Label.SKY, 0),
        claim((0, 1.0001, 20.4), (1, 0, 0), 8.0, Label.TRUNK, 2),
    ]
    assert None not in refuted(world, ExactTracer(world), claims)


def test_a_trail_begins_where_its_distance_changes_sign(place: Place) -> None:
    world = plain(place, trail_edge_at=5.0)
    down = (0.0, 0.0, -1.0)
    claims = [
        claim((4.99, 4, 7), down, 7.0, Label.GROUND, 1),
        claim((5.01, 4, 7), down, 7.0, Label.TRAIL, 1),
        claim((5.000_001, 4, 7), down, 7.0, Label.GROUND, 1),
        claim((4.99, 4, 7), down, 7.0, Label.TRAIL, 1),
        claim((5.01, 4, 7), down, 7.0, Label.GROUND, 1),
    ]
    told = [answer is None for answer in refuted(world, ExactTracer(world), claims)]
    assert told == [True, True, True, False, False]


@pytest.fixture(scope="module")
def scan(place: Place) -> Scan:
    return Lidar(CONFIG, place.scene).scan(lidar_pose(place))


def lidar_pose(place: Place) -> F8:
    height = float(place.world.terrain.field.height_at(-20.0, -3.0))
    return frames.pose((-20.0, -3.0, height + 0.96), (3.0, -4.0, 70.0))


def claims_of(place: Place, scan: Scan) -> list[Claim]:
    """What a scan says of all its rays."""
    pose, directions = lidar_pose(place), ray_directions(CONFIG)
    returns = {(int(c), int(r)): k for k, (c, r) in enumerate(zip(scan.column, scan.ring, strict=True))}
    found = []
    for column, ring in np.ndindex(CONFIG.columns, CONFIG.rings):
        k = returns.get((column, ring))
        told = (NOTHING, 0, 0) if k is None else (float(scan.range_m[k]), int(scan.label[k]), int(scan.instance[k]))
        ray = pose[:3, :3] @ directions[column, ring]
        found.append(Claim("", pose[:3, 3], ray, *told, CONFIG.min_range, CONFIG.max_range, pulse=True))
    return found


def test_the_engine_and_the_second_tracer_agree_on_a_built_world(place: Place, scan: Scan) -> None:
    claims = claims_of(place, scan)
    assert len({c.label for c in claims}) > 5
    assert 0 < sum(c.range_m == NOTHING for c in claims) < len(claims) / 2
    tracer = ExactTracer(place.world)
    assert refuted(place.world, tracer, claims) == [None] * len(claims)


def test_no_untruth_about_a_built_world_passes(place: Place, scan: Scan) -> None:
    """Each ray with another class, object or range (by 2 mm and more where the ray skims), or nothing at all."""
    rng, wrong = np.random.default_rng(1), []
    for k, told in enumerate(claims_of(place, scan)):
        if told.range_m == NOTHING:
            wrong.append(told._replace(range_m=float(rng.uniform(1, 50)), label=Label.ROCK, instance=5))
        else:
            wrong.append([
                told._replace(label=told.label % 13 + 1),
                told._replace(instance=told.instance + 1),
                told._replace(range_m=told.range_m * (1 + 0.002 * rng.choice([-1, 1]))),
                told._replace(range_m=NOTHING, label=Label.SKY, instance=0),
            ][k % 4])  # fmt: skip
    assert None not in refuted(place.world, ExactTracer(place.world), wrong)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ruts against the closed form of the soil law, the shape of a wheel, and the second ray tracer."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import box, make_world
from test_leaning import Rocking

from fieldtruth.core import transforms
from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.soil import RutSoil
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.leaning import LEAN_KNOT_NS, Leaning, plants_of
from fieldtruth.sense.moving import KNOT_NS, KnotPoses, MovingBody
from fieldtruth.sense.ruts import Ruts, Wheeled
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar, ray_directions, ray_times_ns
from fieldtruth.validation.tracer import ReferenceTracer
from fieldtruth.world.model import World

F8 = NDArray[np.float64]
RIG = Rig()
LOW = RIG.robot.ground_clearance
HALF_TRACK, HALF_BASE = RIG.wheels.half_track, RIG.wheels.half_wheelbase
RADIUS, HALF_TYRE = RIG.wheels.radius, RIG.wheels.width / 2
SINKAGE, SLOPE = 0.02, 0.5
SPEED, START = 1.0, -1.0
WAY = np.array([[-2.0, 0.0], [2.0, 0.0]])
LATE = 40 * LEAN_KNOT_NS


def given(x: F8, y: F8) -> F8:
    return np.tile([SINKAGE, SLOPE], (len(x), 1))


def driven(seconds: float, *, speed: float = SPEED, y: float = 0.0) -> KnotPoses:
    """Poses of a robot that drives along x on flat ground."""
    poses = KnotPoses()
    times = np.arange(0, seconds + 1e-9, KNOT_NS / 1e9)
    poses.add(np.array([transforms.pose((START + speed * t, y, LOW), (0.0, 0.0, 0.0)) for t in times]))
    return poses


def ruts_in(world: World, poses: KnotPoses, soil: object = given) -> Ruts:
    return Ruts(world, [Wheeled(RIG, poses, WAY, soil)])  # type: ignore[arg-type]


def gliding(start: F8, stamps_ns: NDArray[np.int64]) -> F8:
    poses = np.tile(start, (len(stamps_ns), 1, 1))
    poses[:, 0, 3] += 1e-9 * stamps_ns - 1.5
    return poses


def plain(seed: int | None = None) -> World:
    rng = np.random.default_rng(seed or 0)
    bumps = (lambda x, y: rng.normal(0.0, 0.004, x.shape)) if seed is not None else 0.0
    return make_world([], height=bumps, spacing=0.05, side=8.0)


@pytest.fixture(name="scene", scope="module")
def _scene() -> Scene:
    """A robot drove from -1 m to 1 m, on a plane at height 0."""
    world = plain()
    return Scene(world, Moving(ruts=ruts_in(world, driven(2.0))))


def below(scene: Scene, x: float, y: float, stamp_ns: int = LATE) -> float:
    """Height [m] of the ground that a ray of a LiDAR straight down meets."""
    lidar = IdealLidar(LidarConfig(columns=8, rings=1, min_range=0.0, max_range=10.0), scene)
    scan = lidar.scan(transforms.pose((x, y, 2.0), (0.0, 90.0, 0.0)), stamp_ns)
    assert scan.label[0] == Label.GROUND
    assert scan.instance[0] == GROUND_ID
    return 2.0 - float(np.linalg.norm(scan.xyz[0]))


def from_above(scene: Scene, x: float, y: float, stamp_ns: int = LATE) -> LabelImages:
    config = CameraConfig(width=65, height=49, horizontal_fov_deg=30, vertical_fov_deg=23, depth=True, normals=True)
    pose = transforms.pose((x, y, 1.0), (0.0, 90.0, 0.0)) @ OPTICAL
    return LabelCamera(config, scene).label(pose, stamp_ns=stamp_ns)


def test_the_depth_is_that_of_the_soil_law_by_hand() -> None:
    """Dry sand: (3 W / ((3 - n) (k_c + b k_phi) sqrt(D)))^(2 / (2 n + 1)), and its friction angle of 28 deg."""
    world, load = plain(), 50.0 * 9.81 / 4
    k_c, k_phi, n = 990.0, 1_528_430.0, 1.1
    depth = (3 * load / ((3 - n) * (k_c + 2 * HALF_TYRE * k_phi) * (2 * RADIUS) ** 0.5)) ** (2 / (2 * n + 1))
    found = RutSoil(world, RIG.robot, {"trodden_earth": "sand"})(np.zeros(3), np.arange(3.0))
    assert found == pytest.approx(np.tile([depth, 0.532], (3, 1)), rel=1e-6)
    assert 0.02 < depth < 0.03
    scene = Scene(world, Moving(ruts=ruts_in(world, driven(2.0), RutSoil(world, RIG.robot, {"trodden_earth": "sand"}))))
    assert below(scene, 0.0, HALF_TRACK) == pytest.approx(-depth, abs=1e-5)
    assert below(scene, 0.0, 0.0) == pytest.approx(0.0, abs=1e-5)
    with pytest.raises(ConfigurationError, match="no ground type 'mud'"):
        RutSoil(world, RIG.robot, {"mud": "sand"})


def test_ruts_are_as_wide_as_the_tyres_and_their_walls_have_the_slope_of_the_soil(scene: Scene) -> None:
    assert scene.ruts is not None
    ruts = scene.ruts.ruts
    nodes, depth = ruts.nodes(), ruts.depths(np.array([LATE]))[0]
    across = np.abs(nodes[..., 0]) < 0.4
    beside = np.abs(np.abs(nodes[across, 1]) - HALF_TRACK) - HALF_TYRE
    assert depth[across] == pytest.approx(np.maximum(SINKAGE - SLOPE * np.maximum(beside, 0.0), 0.0), abs=1e-6)
    assert (depth[across] > 0.0).sum() > 1000
    for side in (-1, 1):
        assert below(scene, 0.0, side * HALF_TRACK) == pytest.approx(-SINKAGE, abs=1e-6)
        assert below(scene, 0.3, side * (HALF_TRACK - HALF_TYRE - 0.02)) == pytest.approx(-0.01, abs=1e-4)


def test_no_rut_is_ahead_of_the_wheels_and_its_end_is_round(scene: Scene) -> None:
    """At 1.05 s the pose of the knot before, at 0.9 s and 1.0 s, decides in the middle between both."""
    ends = START + SPEED * np.array([0.9, 1.0]) + HALF_BASE
    chord = np.sqrt(2 * RADIUS * SINKAGE)
    for x in (ends[1] + chord + 0.0125, ends[1] + 0.3, 1.5):
        assert below(scene, x, HALF_TRACK, 1_050_000_000) == pytest.approx(0.0, abs=1e-6)
    x = np.round((ends[0] + 0.06) / 0.0125) * 0.0125
    ahead = np.maximum(x - ends, 0.0)
    depth = np.maximum(SINKAGE - RADIUS + np.sqrt(RADIUS**2 - ahead**2), 0.0)
    assert 0.002 < depth.mean() < 0.018
    assert below(scene, x, HALF_TRACK, 1_050_000_000) == pytest.approx(-depth.mean(), abs=5e-5)
    for stamp in (0, LEAN_KNOT_NS):
        assert below(scene, 0.0, HALF_TRACK, stamp) == pytest.approx(0.0, abs=1e-6)
    assert below(scene, -0.5, HALF_TRACK, 1_050_000_000) == pytest.approx(-SINKAGE, abs=1e-6)


def test_depths_do_not_depend_on_the_order_of_questions_and_end_with_the_drive() -> None:
    one, other = (ruts_in(plain(), driven(2.0)) for _ in range(2))
    stamps = np.arange(25) * LEAN_KNOT_NS
    forth = one.depths(stamps)
    back = np.stack([other.depths(stamps[k : k + 1])[0] for k in range(24, -1, -1)])[::-1]
    assert np.array_equal(forth, back)
    assert (np.diff(forth, axis=0) >= 0.0).all()
    assert np.array_equal(forth[24], one.depths(np.array([LATE]))[0])
    other.restart()
    other.end_ns = LEAN_KNOT_NS
    assert np.array_equal(other.depths(stamps)[24], forth[2])


def test_speed_does_not_scallop_and_a_second_pass_is_no_deeper() -> None:
    slow, fast = (ruts_in(plain(), driven(2.0 / speed, speed=speed)) for speed in (0.5, 4.0))
    late = np.array([100 * LEAN_KNOT_NS])
    assert fast.depths(late).max() == pytest.approx(SINKAGE, abs=1e-8)
    middle = np.abs(slow.nodes()[..., 0]) < 0.5
    assert slow.depths(late)[0][middle] == pytest.approx(fast.depths(late)[0][middle], abs=1e-7)


def test_cameras_see_depth_and_normals_of_walls(scene: Scene) -> None:
    images = from_above(scene, 0.0, HALF_TRACK)
    assert (images.label == Label.GROUND).all()
    assert images.depth[24, 32] == pytest.approx(1.0 + SINKAGE, abs=1e-5)
    assert images.normal[24, 32] == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    # The image's upper edge is towards +x and its left one towards +y: there the wall faces the rut, towards -y.
    right = OPTICAL[:3, :3].T @ transforms.pose((0, 0, 0), (0, 90, 0))[:3, :3].T @ np.array([0.0, 1.0, 0.0])
    wall = HALF_TYRE + 0.02
    column = 32 + round(right[0] * wall / (images.depth[24, 32] * np.tan(np.radians(15.0))) * 32.5)
    assert images.normal[24, column] @ right == pytest.approx(-SLOPE / np.hypot(1.0, SLOPE), abs=1e-4)
    far = from_above(scene, 0.0, 0.0)
    assert far.depth[24, 32] == pytest.approx(1.0, abs=1e-6)


def test_the_second_tracer_meets_the_same_ground_while_it_changes() -> None:
    world = plain(seed=3)
    ruts = ruts_in(world, driven(2.0))
    config = LidarConfig(columns=256, rings=32, max_range=20.0, spinning=True)
    pose = transforms.pose((0.8, 0.1, 0.5), (3.0, 2.0, 10.0))
    poses = np.tile(pose, (257, 1, 1))
    stamp = 870_000_000
    lidar = IdealLidar(config, Scene(world, Moving(ruts=ruts)))
    lidar.scan(poses, stamp)
    range_m = lidar._echoes.true_range
    rows = np.argwhere(range_m > 0)
    chosen = rows[np.random.default_rng(0).choice(len(rows), 500, replace=False)]
    directions = (ray_directions(config) @ pose[:3, :3].T)[chosen[:, 0], chosen[:, 1]]
    stamps = stamp + np.broadcast_to(ray_times_ns(config), range_m.shape)[chosen[:, 0], chosen[:, 1]]
    origins = np.tile(pose[:3, 3], (len(chosen), 1))
    limit = np.full(len(chosen), 20.0)
    for tracer, equal in (
        (ReferenceTracer(world, Moving(ruts=ruts)), True),
        (ReferenceTracer(world), False),
        (ReferenceTracer(world, Moving(ruts=ruts_in(world, driven(2.0, y=0.05)))), False),
    ):
        hits = tracer.hits(origins, directions, limit, stamps)
        first = np.flatnonzero(np.diff(hits.ray, prepend=-1))
        assert np.array_equal(hits.ray[first], np.arange(len(chosen)))
        error = np.abs(hits.range_m[first] - range_m[chosen[:, 0], chosen[:, 1]]) * hits.cosine[first]
        assert (error.max() < 5e-5) == equal  # a ray near an edge may meet either triangle


def test_bodies_plants_and_ruts_are_met_in_one_scan() -> None:
    """By their ids, and where the second tracer meets them; it may meet the other side of an edge."""
    poses = transforms.pose((0.6, -1.2, 0.4), (0.0, 0.0, 0.0)), transforms.pose((0.5, 1.0, 0.0), (0.0, 0.0, 0.0))
    hedge = replace(box("hedge", (0.2, 0.5, 0.6), "leaf"), species=("hazel",), footprint=0.1)
    world = make_world([(hedge, poses[1])], spacing=0.05, side=8.0)
    body = MovingBody(
        name="crate", object_id=9, mesh=box("crate", (0.2, 0.2, 0.2)), pose=lambda t: gliding(poses[0], t)
    )
    plants = plants_of(world)
    moving = Moving([body], Leaning(plants, [Rocking(np.arange(len(plants.top)))]), ruts_in(world, driven(2.0)))
    scene, stamp = Scene(world, moving), 1_530_000_000
    config = LidarConfig(columns=512, rings=64, max_range=8.0, spinning=True)
    pose = transforms.pose((-1.2, 0.1, 0.8), (0.0, 20.0, 0.0))
    scan = IdealLidar(config, scene).scan(np.tile(pose, (513, 1, 1)), stamp)
    height = (scan.xyz.astype(float) @ pose[:3, :3].T + pose[:3, 3])[:, 2]
    assert {(scan.instance == number).sum() > 50 for number in (body.object_id, 2)} == {True}
    assert (height < -0.5 * SINKAGE).sum() > 50
    directions = ray_directions(config)[scan.column, scan.ring] @ pose[:3, :3].T
    stamps = stamp + np.broadcast_to(ray_times_ns(config), (512, 64))[scan.column, scan.ring]
    chosen = np.random.default_rng(0).choice(len(scan.xyz), 1500, replace=False)
    origins, limit = np.tile(pose[:3, 3], (len(chosen), 1)), np.full(len(chosen), 8.0)
    for known, equal in ((moving, True), (replace(moving, ruts=None), False), (replace(moving, bodies=()), False)):
        hits = ReferenceTracer(world, known).hits(origins, directions[chosen], limit, stamps[chosen])
        first = np.flatnonzero(np.diff(hits.ray, prepend=-1))
        error = np.full(len(chosen), np.inf)
        found = np.linalg.norm(scan.xyz[chosen].astype(float), axis=1)[hits.ray[first]]
        error[hits.ray[first]] = np.abs(hits.range_m[first] - found) * hits.cosine[first]
        assert ((error > 1e-4).mean() <= 0.002) == equal


def test_ground_that_does_not_yield_is_the_same_without_a_gap() -> None:
    """Each ray meets the finer ground where it meets that of 5 cm, also along the borders of blocks."""
    world = plain(seed=4)
    hard = ruts_in(world, driven(2.0), lambda x, y: np.tile([0.0, SLOPE], (len(x), 1)))
    config = CameraConfig(width=1280, height=720, depth=True)
    pose = transforms.pose((-2.5, 0.2, 0.6), (0.0, 20.0, 5.0)) @ OPTICAL
    fine, coarse = (
        LabelCamera(config, each).label(pose, stamp_ns=LATE) for each in (Scene(world, Moving(ruts=hard)), Scene(world))
    )
    near = coarse.depth < 6.0
    assert np.array_equal(fine.label == Label.GROUND, coarse.label == Label.GROUND)
    assert np.abs(fine.depth - coarse.depth)[near & (coarse.depth > 0)].max() < 2e-4

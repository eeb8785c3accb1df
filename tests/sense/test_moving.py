# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies that move, seen by LiDARs and cameras at each ray's own instant: closed forms, and the second tracer."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from sense_worlds import F8, at, box, driven, make_mesh, make_world, scan_bytes

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.kernels.lidar import Scan
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.moving import KNOT_NS, MovingBody
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import IdealLidar, Lidar, ray_directions, ray_times_ns, sweep_times_ns
from fieldtruth.validation.tracer import ReferenceTracer

STAMP = 3_123_456_789
RADIUS, SPEED, BALL = 6.0, 2.5, 1.0  # [m] of the track, [rad/s] along it, [m] of the ball
BALL_ID, BOX_ID = 7, 9
Poses = Callable[[NDArray[np.int64]], F8]


def circling(phase: float, spin: float) -> Poses:
    """Poses on a circle about the origin, 1 m high, that also turn about the vertical [rad/s]."""

    def poses(stamps: NDArray[np.int64]) -> F8:
        turn = phase + SPEED * stamps / 1e9
        places = np.stack([RADIUS * np.cos(turn), RADIUS * np.sin(turn), np.ones(len(stamps))], axis=-1)
        turns = np.degrees(spin * stamps / 1e9)
        return np.stack([transforms.pose(xyz, (0, 0, yaw)) for xyz, yaw in zip(places, turns, strict=True)])

    return poses


def gliding(start: F8, velocity: tuple[float, float, float]) -> Poses:
    """Poses that leave ``start`` (4, 4) at STAMP with a velocity [m/s]."""

    def poses(stamps: NDArray[np.int64]) -> F8:
        found = np.tile(start, (len(stamps), 1, 1))
        found[:, :3, 3] += ((stamps - STAMP) / 1e9)[:, None] * velocity
        return found

    return poses


def ball_mesh(subdivisions: int = 4) -> trimesh.Trimesh:
    mesh: trimesh.Trimesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=BALL)
    return mesh


def body(name: str, number: int, pose: Poses, material: str = "wood") -> MovingBody:
    ball = ball_mesh()
    mesh = (
        make_mesh("ball", ball.vertices, ball.faces, material) if name == "ball" else box(name, (0.8, 0.4, 1), material)
    )
    return MovingBody(name=name, object_id=number, mesh=mesh, pose=pose)


BALL_BODY = body("ball", BALL_ID, circling(0.0, 1.0))
BOX_BODY = body("crate", BOX_ID, circling(2.0, 4.0), "bark")
SPINNING = LidarConfig(columns=512, rings=32, max_range=30.0, firing_offsets_ns=tuple(range(0, 64_000, 2_000)))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(make_world([(box("post", (0.2, 0.2, 2.0)), at(3, 0, 0))]), Moving([BALL_BODY, BOX_BODY]))


def traced_again(scene: Scene, scan: Scan, poses: F8, stamps: NDArray[np.int64]) -> tuple[F8, NDArray[np.int64]]:
    """Range and instance of the points of a scan by the second tracer, with rays that leave at stamps (n,)."""
    rows, since = scan.column.astype(int), scan.t_ns - sweep_times_ns(SPINNING)[scan.column]
    share = since / (1e9 / SPINNING.rate_hz / SPINNING.columns)
    own = poses[rows] + share[:, None, None] * (poses[rows + 1] - poses[rows])
    ahead = np.einsum("nij,nj->ni", own[:, :3, :3], ray_directions(SPINNING)[scan.column, scan.ring])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    tracer = ReferenceTracer(scene.world, Moving([each.body for each in scene.moving]))
    hits = tracer.hits(own[:, :3, 3], ahead, np.full(len(rows), 30.0), stamps)
    inside = np.flatnonzero(hits.margin > -1e-5)
    first = inside[np.unique(hits.ray[inside], return_index=True)[1]]
    range_m, instance = np.zeros(len(rows)), np.zeros(len(rows), np.int64)
    range_m[hits.ray[first]], instance[hits.ray[first]] = hits.range_m[first], hits.instance[first]
    return range_m, instance


def test_points_of_a_spinning_lidar_are_where_bodies_are_at_each_rays_own_instant(scene: Scene) -> None:
    poses = driven(SPINNING.columns)
    scan = IdealLidar(SPINNING, scene).scan(poses, STAMP)
    chosen = np.flatnonzero(np.isin(scan.instance, [BALL_ID, BOX_ID]))
    assert np.count_nonzero(scan.instance == BALL_ID) > 150
    assert np.count_nonzero(scan.instance == BOX_ID) > 80
    assert set(scan.label[scan.instance == BALL_ID]) == {Label.BENCH}
    assert set(scan.label[scan.instance == BOX_ID]) == {Label.TRUNK}
    chosen = np.concatenate([chosen[::3], np.flatnonzero(scan.instance <= 2)[::80]])
    own = Scan._make(values[chosen] for values in scan)
    range_m, instance = traced_again(scene, own, poses, STAMP + own.t_ns.astype(np.int64))
    sure = instance == own.instance
    assert sure.mean() > 0.99  # the others graze an edge
    assert np.abs(range_m - own.range_m)[sure].max() < 1e-4
    backwards, other = traced_again(scene, own, poses, STAMP + 100_000_000 - own.t_ns.astype(np.int64))
    assert np.median(np.abs(backwards - own.range_m)[own.instance == BALL_ID]) > 0.01
    assert (other == own.instance).mean() < 0.99


def test_ranges_of_a_ball_on_a_circular_track_match_the_closed_form() -> None:
    ball = body("ball", BALL_ID, circling(0.0, 0.0))
    scan = IdealLidar(SPINNING, Scene(make_world(height=-900.0), Moving([ball]))).scan(
        np.tile(at(0, 0, 1.0), (SPINNING.columns + 1, 1, 1)), STAMP
    )
    ahead = ray_directions(SPINNING)[scan.column, scan.ring]
    stamps = STAMP + ray_times_ns(SPINNING)[scan.column, scan.ring]
    centre = ball.pose(stamps)[:, :3, 3] - [0, 0, 1.0]  # the arc between two knots is 0.5 mm above its chord
    along = np.einsum("ni,ni->n", centre, ahead)
    closest2 = (centre**2).sum(axis=1) - along**2
    within = closest2 < (0.8 * BALL) ** 2
    expected = along - np.sqrt(BALL**2 - np.minimum(closest2, 0.99))
    sagitta = BALL - np.linalg.norm(ball_mesh().triangles_center, axis=1).min()
    knot = RADIUS * (SPEED * KNOT_NS / 1e9) ** 2 / 8
    assert within.sum() > 100
    assert set(scan.instance) == {BALL_ID}
    assert np.abs(scan.range_m - expected)[within].max() < (sagitta + knot) / 0.6 + 1e-4


def camera_of(scene: Scene, **values: Any) -> LabelCamera:
    given = {"name": "eye", "mount": {"xyz": (0.0, 0.0, 0.0)}, "width": 128, "height": 96, "far": 100.0}
    return LabelCamera(CameraConfig.model_validate(given | {"normals": True, "flow": True} | values), scene)


def test_a_body_at_rest_is_seen_as_an_object_of_the_world() -> None:
    """Class, id, depth, normal and brightness: of the same mesh, turned, as an object and as a body."""
    pose, mesh = transforms.pose((5.0, 0.4, 1.0), (20, -10, 35)), box("crate", (0.8, 0.4, 1.0), "wood")
    still = Scene(make_world([(mesh, pose)]))
    moving = Scene(
        make_world(), Moving([MovingBody(name="crate", object_id=2, mesh=mesh, pose=gliding(pose, (0, 0, 0)))])
    )
    eye = at(0, 0, 1.0) @ OPTICAL
    images = [camera_of(each).label(eye, stamp_ns=STAMP) for each in (still, moving)]
    assert np.count_nonzero(images[1].instance == 2) > 500
    same = images[0].instance == images[1].instance
    assert np.count_nonzero(~same) <= 2
    assert np.array_equal(images[0].label[same], images[1].label[same])
    assert images[1].depth[same] == pytest.approx(images[0].depth[same], abs=1e-5)
    assert images[1].normal[same] == pytest.approx(images[0].normal[same], abs=2e-5)
    config = LidarConfig(columns=512, rings=32, signal=LidarSignal(sub_rays=5, divergence_deg=0.1, pulse_length=1.0))
    echoes = [Lidar(config, each).echoes(np.tile(at(0, 0, 1.0), (513, 1, 1)), STAMP) for each in (still, moving)]
    alike = (echoes[0].instance == echoes[1].instance) & ~echoes[0].mixed & ~echoes[1].mixed
    assert np.count_nonzero(alike & (echoes[1].instance == 2)) > 100
    assert echoes[1].apparent[alike] == pytest.approx(echoes[0].apparent[alike], abs=1e-4)


def test_labels_and_depth_of_a_camera_are_those_of_its_stamp() -> None:
    """A box whose face comes closer with 3 m/s, from 8 m at STAMP."""
    crate = body("crate", BOX_ID, gliding(at(8.8, 0, 1.0), (-3, 0, 0)))
    camera = camera_of(Scene(make_world(), Moving([crate])))
    for since in (0, 100_000_000, 454_321_000):
        images = camera.label(at(0, 0, 1.0) @ OPTICAL, stamp_ns=STAMP + since)
        own = images.instance == BOX_ID
        assert set(images.label[own]) == {Label.BENCH}
        assert images.depth[own] == pytest.approx(8.0 - 3.0 * since / 1e9, abs=1e-4)
        per_m2 = camera.intrinsics.fx * camera.intrinsics.fy / images.depth[own][0] ** 2
        assert own.sum() == pytest.approx(0.8 * 2.0 * per_m2, rel=0.1)
        assert images.normal[own] == pytest.approx(np.tile([0.0, 0.0, -1.0], (own.sum(), 1)), abs=1e-6)


def test_flow_of_a_body_has_its_own_motion() -> None:
    """A box at 4 m that glides to the left with 2 m/s, before ground that stands still."""
    crate = body("crate", BOX_ID, gliding(at(4.8, 0, 1.0), (0, 2, 0)))
    camera = camera_of(Scene(make_world(), Moving([crate])))
    eye, stamps = at(0, 0, 1.0) @ OPTICAL, (STAMP, STAMP + 40_000_000)
    images = camera.label(eye, stamp_ns=stamps[0])
    flow = camera.flow(images, eye, eye, None, stamps)
    own, moved = images.instance == BOX_ID, camera.intrinsics.fx * 2.0 * 0.04 / 4.0
    assert moved > 1.5
    assert flow[own] == pytest.approx(np.tile([-moved, 0.0], (own.sum(), 1)), abs=2e-4)
    later = camera.label(eye, stamp_ns=stamps[1]).instance == BOX_ID
    hidden = later & ~own
    assert hidden.sum() > 20
    assert np.isnan(flow[hidden]).all()  # the box is in front of them then
    assert flow[~later & ~own & (images.depth > 0)] == pytest.approx(0.0, abs=1e-3)


def test_flow_of_a_turning_body_carries_each_pixel_to_the_same_triangle() -> None:
    camera = camera_of(Scene(make_world(), Moving([BOX_BODY])))
    stamps = STAMP, STAMP + 33_000_000
    eye = transforms.pose(tuple(2.0 * BOX_BODY.at([STAMP])[0, :3, 3] / RADIUS * [1, 1, 0] + [0, 0, 1]), (0, 0, 0))
    ahead = BOX_BODY.at([STAMP])[0, :3, 3] - eye[:3, 3]
    eye = transforms.pose(tuple(eye[:3, 3]), (0, 0, float(np.degrees(np.arctan2(ahead[1], ahead[0]))))) @ OPTICAL
    images = camera.label(eye, stamp_ns=stamps[0])
    flow = camera.flow(images, eye, eye, None, stamps)
    own = (images.instance == BOX_ID) & np.isfinite(flow[..., 0])
    v, u = np.nonzero(own)
    assert len(u) > 500
    lens, depth = camera.intrinsics, images.depth[own].astype(np.float64)
    points = np.stack([(u - lens.cx) / lens.fx * depth, (v - lens.cy) / lens.fy * depth, depth], axis=-1)
    in_body = transforms.transform(transforms.inverse(BOX_BODY.at([stamps[0]])[0]) @ eye, points)
    assert np.abs(np.abs(in_body) / [0.8, 0.4, 1.0]).max() < 1.001
    seen = transforms.transform(transforms.inverse(eye) @ BOX_BODY.at([stamps[1]])[0], in_body)
    to = np.stack([lens.fx * seen[:, 0] / seen[:, 2] + lens.cx, lens.fy * seen[:, 1] / seen[:, 2] + lens.cy], axis=-1)
    assert flow[own] == pytest.approx(to - np.stack([u, v], axis=-1), abs=1e-2)
    assert np.abs(flow[own]).max() > 1.0


def test_readings_depend_neither_on_threads_nor_on_their_order(scene: Scene) -> None:
    poses, stamps = driven(SPINNING.columns), [STAMP + k * 100_000_000 for k in range(6)]

    def scans(some: list[int]) -> list[bytes]:
        return scan_bytes(SPINNING, scene, poses, some)

    alone = scans(stamps)
    assert len(set(alone)) == len(stamps)
    assert scans(stamps[::-1])[::-1] == alone
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(scans, [stamps] * 4)) == [alone] * 4


def test_bodies_beyond_the_range_are_not_seen_and_change_nothing() -> None:
    far = body("ball", BALL_ID, gliding(at(45, 0, 1.0), (0, 0, 0)))
    config = SPINNING.model_copy(update={"max_range": 12.0})
    plain = IdealLidar(config, Scene(make_world())).scan(at(0, 0, 1.2), STAMP)
    seen = IdealLidar(config, Scene(make_world(), Moving([far]))).scan(at(0, 0, 1.2), STAMP)
    for one, other in zip(plain, seen, strict=True):
        np.testing.assert_array_equal(one, other)


def test_what_bodies_cannot_be_is_refused_in_one_line() -> None:
    world = make_world([(box("post", (0.2, 0.2, 2.0)), at(3, 0, 0))])
    with pytest.raises(ConfigurationError, match="another mesh has the name 'post'"):
        Scene(world, Moving([replace(BOX_BODY, mesh=box("post", (1, 1, 1)))]))
    with pytest.raises(ConfigurationError, match="the world has no material 'gold'"):
        Scene(world, Moving([replace(BOX_BODY, mesh=box("other", (1, 1, 1), "gold"))]))
    with pytest.raises(ConfigurationError, match="'leaf' is of leaves or water"):
        Scene(world, Moving([replace(BOX_BODY, mesh=box("other", (1, 1, 1), "leaf"))]))
    slow = LidarConfig(columns=64, rings=4, rate_hz=0.5)
    with pytest.raises(ConfigurationError, match=r"at most 1\.27 s"):
        IdealLidar(slow, Scene(world, Moving([BOX_BODY]))).scan(np.tile(at(0, 0, 1.0), (65, 1, 1)), STAMP)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants that lean, seen by LiDARs and cameras at each ray's own instant: closed forms, and the second tracer."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import F8, at, box, driven, make_world, scan_bytes

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.kernels.lidar import Scan
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.leaning import LEAN_KNOT_NS, WHOLE, Leaning, bunches_of, plants_of
from fieldtruth.sense.moving import MovingBody
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import IdealLidar, Lidar, ray_directions, sweep_times_ns
from fieldtruth.validation.tracer import ReferenceTracer
from fieldtruth.world.model import Mesh, World, merge_meshes

STAMP = 3_123_456_789
SPINNING = LidarConfig(columns=512, rings=32, max_range=30.0, firing_offsets_ns=tuple(range(0, 64_000, 2_000)))
HEDGE, CLUMP, POST = 2, 3, 4
"""Instance ids."""


class Rocking:
    """Plants that rock about both axes, each in its own phase."""

    def __init__(self, rows: NDArray[np.intp], sign: float = 1.0) -> None:
        self.rows, self.sign = rows, sign

    def __call__(self, rows: NDArray[np.intp], knots_ns: NDArray[np.int64]) -> F8:
        turn = 5.0 * knots_ns[:, None] / 1e9 + rows
        return self.sign * np.stack([0.2 * np.sin(turn), 0.3 * np.cos(turn)], axis=-1)


def leaf(name: str, half: tuple[float, float, float], low: float, middle: tuple[float, float] = (0.0, 0.0)) -> Mesh:
    """An upright box of leaves from a height on, without a collider."""
    made = box(name, half, "leaf")
    shifted = made.vertices + np.array([*middle, low + half[2]], np.float32)
    return replace(made, vertices=shifted.astype(np.float32), species=("hazel",), footprint=0.1)


def clump() -> Mesh:
    """Stems in two rows 1 m long, 0.5 m apart; those of one bunch are 0.1 m apart."""
    stems = [
        replace(leaf(f"stem_{k}", (0.01, 0.01, 0.4), -0.1, (0.2 * (k // 8) - 0.5, 0.1 * (k % 2) + 0.5 * (k // 2 % 4))))
        for k in range(40)
    ]
    return replace(merge_meshes("clump", [_joined(stem) for stem in stems], footprint=1.0), species=("reed",))


def _joined(mesh: Mesh) -> Mesh:
    """The mesh with one vertex for each corner, so that its faces are connected."""
    vertices, row = np.unique(mesh.vertices, axis=0, return_inverse=True)
    first = np.unique(row.ravel(), return_index=True)[1]
    faces = row.ravel()[mesh.faces].astype(np.int32)
    return replace(mesh, vertices=vertices, normals=mesh.normals[first], uv=mesh.uv[first], faces=faces)


@pytest.fixture(scope="module")
def world() -> World:
    turned = transforms.pose((5.0, 1.0, 0.2), (0, 0, 30))
    turned[:3, :3] *= 1.2
    hedge = leaf("hedge", (0.2, 1.5, 1.25), -0.5)
    return make_world([(hedge, turned), (clump(), at(-4, 2, 0)), (box("post", (0.2, 0.2, 2.0)), at(0, -4, 0))])


def leaning(world: World, sign: float = 1.0, every: int = 1) -> Leaning:
    plants = plants_of(world)
    return Leaning(plants, [Rocking(np.arange(0, len(plants.top), every), sign)])


@pytest.fixture(scope="module")
def scene(world: World) -> Scene:
    return Scene(world, Moving(leaning=leaning(world)))


def test_a_clump_is_bunches_of_whole_tufts_and_anything_else_is_whole(world: World) -> None:
    plants, bunch = plants_of(world), bunches_of(world.meshes["clump"])
    assert plants.top.tolist() == [1] + [2] * (len(plants.top) - 1)  # the post is no plant
    assert plants.bunch.tolist() == [WHOLE, *range(20)]
    stem = np.arange(40).repeat(12)
    assert len({(a, b) for a, b in zip(stem // 2, bunch, strict=True)}) == 20  # each pair of stems is one bunch
    feet = plants.foot[1:] - [-4, 2, 0]
    expected = {(0.2 * (k // 4) - 0.5, 0.05 + 0.5 * (k % 4), 0.0) for k in range(20)}
    assert {tuple(foot) for foot in feet.round(6).tolist()} == {tuple(np.round(each, 6).tolist()) for each in expected}
    np.testing.assert_allclose(plants.height, [2.4, *[0.7] * 20], rtol=1e-6)
    np.testing.assert_allclose(plants.foot[0], [5.0, 1.0, 0.2])


def test_a_plant_that_leans_towards_x_turns_about_y(world: World) -> None:
    class Steady(Rocking):
        def __call__(self, rows: NDArray[np.intp], knots_ns: NDArray[np.int64]) -> F8:
            return np.tile([0.0, 0.1], (len(knots_ns), len(rows), 1))

    plants = plants_of(world)
    pose = Leaning(plants, [Steady(np.arange(21))]).poses(np.array([0]), np.array([0]))[0, 0]
    top = np.linalg.inv(plants.world_from_object[0]) @ np.append(plants.foot[0] + [0, 0, 2.0], 1.0)
    np.testing.assert_allclose(pose @ top - plants.foot[0], [2 * np.sin(0.1), 0.0, 2 * np.cos(0.1)], atol=1e-12)
    foot = np.linalg.inv(plants.world_from_object[0]) @ np.append(plants.foot[0], 1.0)
    np.testing.assert_allclose(pose @ foot, plants.foot[0], atol=1e-12)


def test_without_any_lean_all_sensors_see_the_still_world(world: World) -> None:
    still, upright = Scene(world), Scene(world, Moving(leaning=leaning(world, 0.0, 2)))
    config = CameraConfig(width=96, height=64, normals=True)
    pose = transforms.pose((0.0, 1.0, 1.0), (0, 5, 0)) @ OPTICAL
    for turn in (0, 180):
        towards = transforms.pose((0, 0, 0), (0, 0, turn)) @ pose
        mine = LabelCamera(config, upright).label(towards, stamp_ns=STAMP)
        theirs = LabelCamera(config, still).label(towards)
        same = mine.instance == theirs.instance
        assert same.mean() > 0.998
        assert set(np.unique(mine.instance)) == set(np.unique(theirs.instance))
        assert (mine.label == theirs.label)[same].all()
        np.testing.assert_allclose(mine.depth[same], theirs.depth[same], atol=2e-5)
        assert np.abs(mine.normal - theirs.normal)[same].max() < 1e-4
    signal = LidarConfig(columns=128, rings=16, max_range=30.0, signal=LidarSignal())
    echoes = [Lidar(signal, each).echoes(at(0, 1, 1), STAMP) for each in (upright, still)]
    same = echoes[0].instance[0] == echoes[1].instance[0]
    assert same.mean() > 0.995
    np.testing.assert_allclose(echoes[0].apparent[0][same], echoes[1].apparent[0][same], rtol=1e-4, atol=1e-6)


def test_a_scan_meets_the_plane_of_a_hedge_where_it_is_at_each_rays_own_instant(world: World, scene: Scene) -> None:
    poses, lidar = driven(SPINNING.columns), IdealLidar(SPINNING, scene)
    scan = lidar.scan(poses, STAMP)
    own = np.flatnonzero(scan.instance == HEDGE)
    assert len(own) > 100
    assert set(scan.label[own]) == {Label.TREETOP}
    errors = {sign: np.abs(_range_of_hedge(world, scan, own, poses, sign) - scan.range_m[own]) for sign in (1.0, -1.0)}
    front = errors[1.0] < 0.1  # its other sides have other planes
    assert front.mean() > 0.7
    assert errors[1.0][front].max() < 1e-4
    assert np.median(errors[-1.0]) > 0.02  # leaning the other way


def _range_of_hedge(world: World, scan: Scan, own: NDArray[np.intp], poses: F8, sign: float) -> F8:
    """Ranges on the plane of the hedge's face, whose matrix changes linearly between two knots."""
    plants = plants_of(world)

    def pose_at(k: int) -> F8:
        a, b = sign * np.array([0.2 * np.sin(0.5 * k), 0.3 * np.cos(0.5 * k)])
        return np.asarray(about(plants.foot[0], np.array([a, b, 0.0])) @ plants.world_from_object[0])

    return ranges_on(scan, own, poses, pose_at, np.array([-0.2, 0.0, 0.0, 1.0]))


def ranges_on(scan: Scan, own: NDArray[np.intp], poses: F8, pose_at: Callable[[int], F8], corner: F8) -> F8:
    """Ranges of points on the plane through a corner, across x, of a body with a pose at each knot."""
    low, rest = np.divmod(STAMP + scan.t_ns[own].astype(np.int64), LEAN_KNOT_NS)
    known = {int(k): pose_at(int(k)) for k in np.unique(np.append(low, low + 1))}
    found = np.empty(len(own))
    since = (scan.t_ns[own] - sweep_times_ns(SPINNING)[scan.column[own]]) / (1e9 / SPINNING.rate_hz / SPINNING.columns)
    for n, point in enumerate(own):
        share = rest[n] / LEAN_KNOT_NS
        pose = (1 - share) * known[low[n]] + share * known[low[n] + 1]
        column = int(scan.column[point])
        lidar = poses[column] + since[n] * (poses[column + 1] - poses[column])
        ahead = lidar[:3, :3] @ ray_directions(SPINNING)[column, scan.ring[point]]
        ahead /= np.linalg.norm(ahead)
        normal = np.cross(pose[:3, 1], pose[:3, 2])
        found[n] = normal @ ((pose @ corner)[:3] - lidar[:3, 3]) / (normal @ ahead)
    return found


def about(foot: F8, vector: F8) -> F8:
    """Turn (4, 4) about a point by a rotation vector: the matrix exponential, by its series."""
    a, b, c = vector
    cross, matrix, term = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0.0]]), np.eye(4), np.eye(3)
    for k in range(1, 20):
        term = term @ cross / k
        matrix[:3, :3] += term
    matrix[:3, 3] = foot - matrix[:3, :3] @ foot
    return matrix


def traced_again(tracer: ReferenceTracer, scan: Scan, poses: F8, stamps: NDArray[np.int64]) -> tuple[F8, F8]:
    """Range and instance of the points of a scan by the second tracer, with rays that leave at stamps (n,)."""
    rows, since = scan.column.astype(int), scan.t_ns - sweep_times_ns(SPINNING)[scan.column]
    share = since / (1e9 / SPINNING.rate_hz / SPINNING.columns)
    own = poses[rows] + share[:, None, None] * (poses[rows + 1] - poses[rows])
    ahead = np.einsum("nij,nj->ni", own[:, :3, :3], ray_directions(SPINNING)[scan.column, scan.ring])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    hits = tracer.hits(own[:, :3, 3], ahead, np.full(len(rows), 30.0), stamps)
    inside = np.flatnonzero(hits.margin > -1e-5)
    first = inside[np.unique(hits.ray[inside], return_index=True)[1]]
    range_m, instance = np.zeros(len(rows)), np.zeros(len(rows))
    range_m[hits.ray[first]], instance[hits.ray[first]] = hits.range_m[first], hits.instance[first]
    return range_m, instance


def test_the_second_tracer_sees_the_same_plants_and_bodies_in_a_spinning_scan(world: World) -> None:
    """Only every second bunch leans, beside a body; with the opposite sign the second tracer disagrees."""
    crate = MovingBody(
        name="crate",
        object_id=9,
        mesh=box("crate", (0.5, 0.3, 0.6), "wood"),
        pose=lambda stamps: np.stack([at(-2.5, 3.0 * (t - STAMP) / 1e9, 1.0) for t in stamps.tolist()]),
    )
    moving, again = (Moving([crate], leaning(world, every=2)) for _ in range(2))
    scene = Scene(world, moving)
    poses = driven(SPINNING.columns)
    scan = IdealLidar(SPINNING, scene).scan(poses, STAMP)
    assert {1, HEDGE, CLUMP, POST, 9} == set(scan.instance.tolist())
    assert set(scan.label[scan.instance == 9]) == {Label.BENCH}
    chosen = np.concatenate(
        [np.flatnonzero(np.isin(scan.instance, [HEDGE, CLUMP, 9])), np.flatnonzero(scan.instance == 1)[::150]]
    )
    own = Scan._make(values[chosen] if len(values) else values for values in scan)
    stamps = STAMP + own.t_ns.astype(np.int64)
    range_m, instance = traced_again(ReferenceTracer(world, again), own, poses, stamps)
    sure = instance == own.instance
    assert sure.mean() > 0.98  # the others graze an edge
    assert (np.abs(range_m - own.range_m)[sure] < 1e-4).mean() > 0.99
    grass = own.instance == CLUMP
    for wrong in (leaning(world, -1.0, 2), leaning(world), None):
        other, ids = traced_again(ReferenceTracer(world, Moving([crate], wrong)), own, poses, stamps)
        assert ((np.abs(other - own.range_m) > 0.01) | (ids != own.instance))[grass].mean() > 0.3
    other, _ = traced_again(ReferenceTracer(world, again), own, poses, stamps + 50_000_000)
    assert np.median(np.abs(other - own.range_m)[own.instance == HEDGE]) > 0.01


def test_flow_carries_each_pixel_of_a_plant_to_where_its_point_is_in_the_next_image(world: World, scene: Scene) -> None:
    camera, stamps = LabelCamera(CameraConfig(width=160, height=120), scene), (STAMP, STAMP + 70_000_000)
    eye = at(0.0, 1.0, 1.0) @ OPTICAL
    later = transforms.pose((0.1, 1.05, 1.0), (0, 1, 2)) @ OPTICAL
    images = camera.label(eye, stamp_ns=stamps[0])
    flow = camera.flow(images, eye, later, None, stamps)
    own = (images.instance == HEDGE) & np.isfinite(flow[..., 0])
    v, u = np.nonzero(own)
    assert len(u) > 300
    lens, depth = camera.intrinsics, images.depth[own].astype(np.float64)
    points = np.stack([(u - lens.cx) / lens.fx * depth, (v - lens.cy) / lens.fy * depth, depth], axis=-1)
    plants, rock = leaning(world), []
    for stamp in stamps:
        rock.append(np.vstack([plants.at(np.array([0]), np.array([stamp]))[0, 0], [0, 0, 0, 1]]))
    in_hedge = transforms.transform(np.linalg.inv(rock[0]) @ eye, points)
    assert np.abs(in_hedge - [0, 0, 0.75]).max(axis=0) == pytest.approx([0.2, 1.5, 1.25], abs=0.1)
    seen = transforms.transform(transforms.inverse(later) @ rock[1], in_hedge)
    to = np.stack([lens.fx * seen[:, 0] / seen[:, 2] + lens.cx, lens.fy * seen[:, 1] / seen[:, 2] + lens.cy], axis=-1)
    assert flow[own] == pytest.approx(to - np.stack([u, v], axis=-1), abs=2e-3)
    still = LabelCamera(CameraConfig(width=160, height=120), Scene(world))
    assert np.nanmax(np.abs(still.flow(images, eye, later, None, stamps)[own] - flow[own])) > 1.0
    upright = still.flow(images, eye, later)
    ground = (images.instance == 1) & np.isfinite(flow[..., 0]) & np.isfinite(upright[..., 0])
    np.testing.assert_array_equal(upright[ground], flow[ground])


def test_readings_depend_neither_on_their_order_nor_on_scenes_that_are_kept(scene: Scene) -> None:
    poses, stamps = driven(SPINNING.columns), [STAMP + k * 100_000_000 for k in range(12)]

    def scans(some: list[int]) -> list[bytes]:
        return scan_bytes(SPINNING, scene, poses, some)

    alone = scans(stamps)
    assert len(set(alone)) == len(stamps)
    assert scans(stamps[::-1])[::-1] == alone


def test_rays_of_a_user_meet_the_world_without_any_lean(world: World, scene: Scene) -> None:
    origins = np.random.default_rng(0).uniform([-8, -8, 3], [8, 8, 4], (500, 3))
    down = np.array([0.1, 0.2, -1.0])
    for mine, theirs in zip(scene.cast(origins, down), Scene(world).cast(origins, down), strict=True):
        np.testing.assert_array_equal(mine, theirs)

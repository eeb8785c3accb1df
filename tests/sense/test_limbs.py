# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Limbs of trees that move on their own: groups, closed forms on a rocking tree, joints, spectrum, second tracer."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from sense_worlds import F8, at, driven, limbed_tree, make_world
from test_leaning import SPINNING, STAMP, about, ranges_on, traced_again

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label, PlantPart
from fieldtruth.core.random import rng_of
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.wind_config import WindConfig
from fieldtruth.kernels.lidar import Scan
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.leaning import LEAN_KNOT_NS, WHOLE, Leaning, plants_of, square
from fieldtruth.sense.limbs import LEVELS, STEM, limbs_of, pieces_of, with_limbs
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.wind import SPREAD, Wind, leaning_of, oscillators
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.validation.tracer import ReferenceTracer
from fieldtruth.world.build import load_world
from fieldtruth.world.model import Mesh, World, merge_meshes
from fieldtruth.world.plants import TREES, grow_tree
from fieldtruth.world.seasons import changes
from fieldtruth.world.seasons.leaves import in_season

BLOWING = WindConfig(speed_m_s=10.0, direction_deg=270.0, gusts=0.2)
TREE = 2
"""Instance id."""
RIGHT, LEFT = 1, 2
"""Rows of the limbs: the lower one comes first."""


class Rocking:
    """A tree that rocks, and limbs that rock on it about all axes, each in its own phase."""

    def __init__(self, rows: NDArray[np.intp], size: float = 1.0) -> None:
        self.rows, self.size = rows, size

    def __call__(self, rows: NDArray[np.intp], knots_ns: NDArray[np.int64]) -> F8:
        return np.array([[self.of(int(row), knot / LEAN_KNOT_NS) for row in rows] for knot in knots_ns.tolist()])

    def of(self, row: int, k: float) -> F8:
        """Return the vector (3,) of a row at a knot."""
        turn = 0.5 * k + 2.0 * row
        return self.size * np.array([0.1 * np.sin(turn), 0.15 * np.cos(turn), 0.2 * np.sin(turn + 1.0) * (row > 0)])


@pytest.fixture(scope="module")
def world() -> World:
    turned = transforms.pose((6.0, 0.5, 0.0), (0, 0, 15))
    turned[:3, :3] *= 1.1
    return make_world([(limbed_tree(), turned)])


@pytest.fixture(scope="module")
def oak() -> Mesh:
    tree = grow_tree(TREES["oak"], name="oak", height=9.0, rng=np.random.default_rng(1), detail=0.2)
    return replace(tree, materials=("bark", "leaf"))


def leaning(world: World, size: float = 1.0) -> Leaning:
    return Leaning(with_limbs(world, plants_of(world)), [Rocking(np.arange(3), size)])


def pose_of(world: World, row: int, order: tuple[int, ...] = (0, 1), sign: float = 1.0) -> Callable[[int], F8]:
    """Return the pose of a limb at a knot; turns are those of tree and limb, about their feet at rest."""
    plants, cause = with_limbs(world, plants_of(world)), Rocking(np.arange(3))

    def pose_at(k: int) -> F8:
        turns = [about(plants.foot[each], side * cause.of(each, k)) for each, side in ((0, 1.0), (row, sign))]
        return np.asarray(turns[order[0]] @ turns[order[1]] @ plants.world_from_object[row])

    return pose_at


def test_a_grown_tree_knows_the_limb_of_each_face_and_where_it_leaves_the_trunk(oak: Mesh) -> None:
    assert oak.limb is not None
    assert oak.joints is not None
    limb = oak.limb
    assert (limb[oak.face_parts == PlantPart.STEM] == -1).all()
    assert (limb[oak.face_parts == PlantPart.LEAF] >= 0).all()
    wood = {k: oak.vertices[oak.faces[(limb == k) & (oak.face_parts == PlantPart.BRANCH)]] for k in range(limb.max())}
    gaps = {k: [_gap(points, oak.joints[j]) for j in (k, k - 1)] for k, points in wood.items() if len(points)}
    assert len(gaps) > 10
    assert max(own for own, _ in gaps.values()) < 0.15
    assert np.median([other for _, other in gaps.values()]) > 0.15
    own = limb == -1  # from a joint, rays in all directions meet the trunk from inside
    trunk = replace(oak, faces=oak.faces[own], material=oak.material[own], limb=None, part=None)
    around = np.arange(8) * np.pi / 4
    ahead = np.tile(np.stack([np.cos(around), np.sin(around), 0.0 * around], axis=-1), (len(wood), 1))
    hits = Scene(make_world([(trunk, at(0, 0, 0))])).cast(oak.joints[list(wood)].repeat(8, axis=0), ahead, 0.4)
    assert np.isfinite(hits.range_m).mean() > 0.97


def _gap(points: F8, joint: F8) -> float:
    return float(np.linalg.norm(points.reshape(-1, 3) - joint, axis=1).min())


def test_twigs_of_a_bare_crown_are_on_the_limbs_of_their_leaves() -> None:
    grown = grow_tree(TREES["beech"], name="beech", height=9.0, rng=np.random.default_rng(1), detail=0.1)
    bare = in_season(grown, changes("winter"), 1)
    assert bare.limb is not None
    assert grown.limb is not None
    assert len(bare.limb) == len(bare.faces)
    leaf, twig = grown.material == 1, bare.material == bare.materials.index("bark_beech_twigs")
    tips, middles = bare.vertices[bare.faces[twig].max(axis=1)], grown.vertices[grown.faces[leaf]].mean(axis=1)
    away, nearest = cKDTree(middles).query(tips)
    near = away < 0.05
    assert np.count_nonzero(near) > 50
    assert (bare.limb[twig][near] == grown.limb[leaf][nearest][near]).mean() > 0.9
    both = merge_meshes("two", [grown, grown], footprint=1.0)
    assert both.limb is not None
    assert both.joints is not None
    second = both.limb[len(grown.faces) :]
    assert (both.joints[second[second >= 0]] == grown.joints[grown.limb[grown.limb >= 0]]).all()  # type: ignore[index]
    assert ((second == -1) == (grown.limb == -1)).all()


def test_groups_are_flat_and_one_sided_and_have_all_limbs(oak: Mesh) -> None:
    limbs = limbs_of(oak)
    assert limbs is not None
    assert oak.limb is not None
    assert oak.joints is not None
    assert LEVELS < len(limbs.foot) <= 2 * LEVELS
    assert ((limbs.group == STEM) == (oak.limb == -1)).all()
    used = np.unique(oak.limb[oak.limb >= 0])
    depth = np.ptp(oak.joints[used, 2])
    for number in range(len(limbs.foot)):
        own = np.unique(oak.limb[limbs.group == number])
        assert np.ptp(oak.joints[own, 2]) <= depth / LEVELS + 1e-5
        np.testing.assert_allclose(limbs.foot[number], oak.joints[own].mean(axis=0), atol=1e-5)
        corners = oak.vertices[oak.faces[np.isin(oak.limb, own)]].reshape(-1, 3)
        assert limbs.reach[number] == pytest.approx(
            np.linalg.norm(corners - limbs.foot[number], axis=1).max(), rel=1e-5
        )
    assert np.median(np.hypot(*limbs.middle[:, :2].T)) > 0.3  # a group all around would have its middle at the trunk


def test_only_high_trees_inside_the_world_have_limbs_and_only_in_wind(world: World) -> None:
    low = at(0, 0, 0)
    low[:3, :3] *= 0.5
    some = make_world([(limbed_tree(), at(5, 0, 0)), (limbed_tree(), low), (limbed_tree(), at(900, 0, 0))])
    plants = with_limbs(some, plants_of(some))
    assert plants.bunch.tolist() == [STEM, WHOLE, WHOLE, 0, 1]
    assert plants.parent.tolist() == [-1, -1, -1, 0, 0]
    np.testing.assert_allclose(np.abs(plants.ahead[3:, 1]), 1.0, atol=0.02)
    blown, calm = (leaning_of(each, world, 1, Rocking(np.arange(1))) for each in (BLOWING, None))
    assert blown is not None
    assert calm is not None
    assert len(blown.plants.top) == 3
    assert len(calm.plants.top) == 1


def test_a_scan_meets_the_plane_of_a_limb_that_rocks_on_a_rocking_tree(world: World) -> None:
    poses = driven(SPINNING.columns)
    scan = IdealLidar(SPINNING, Scene(world, Moving(leaning=leaning(world)))).scan(poses, STAMP)
    leaves = np.flatnonzero((scan.instance == TREE) & (scan.label == Label.TREETOP))
    corner = np.array([-0.05, 0.0, 0.0, 1.0])

    def errors(row: int, **wrong: object) -> F8:
        own = leaves[(scan.xyz[leaves, 1] > 0.9) if row == LEFT else (scan.xyz[leaves, 1] < 0.0)]
        found = ranges_on(scan, own, poses, pose_of(world, row, **wrong), corner)  # type: ignore[arg-type]
        return np.asarray(np.abs(found - scan.range_m[own]))

    for row in (LEFT, RIGHT):
        right = errors(row)
        front = right < 0.05
        assert np.count_nonzero(front) > 60
        assert front.mean() > 0.8
        assert right[front].max() < 1e-4
        assert np.median(errors(row, order=(1, 0))) > 2e-3
        assert np.median(errors(row, sign=-1.0)) > 0.02


def test_flow_carries_each_pixel_of_a_limb_to_where_its_point_is_in_the_next_image(world: World) -> None:
    config, stamps = CameraConfig(width=160, height=120), (30 * LEAN_KNOT_NS, 31 * LEAN_KNOT_NS)
    camera, eye = (
        LabelCamera(config, Scene(world, Moving(leaning=leaning(world)))),
        transforms.pose((0, 0.5, 2.5)) @ OPTICAL,
    )
    images = camera.label(eye, stamp_ns=stamps[0])
    flow = camera.flow(images, eye, eye, None, stamps)
    for row, side in ((LEFT, -1), (RIGHT, 1)):
        here, there = (pose_of(world, row)(k) for k in (30, 31))
        lens, own = camera.intrinsics, (images.label == Label.TREETOP) & np.isfinite(flow[..., 0])
        own[:, ::1] &= side * (np.arange(160) - lens.cx) > 12.0
        v, u = np.nonzero(own)
        assert len(u) > 100
        depth = images.depth[own].astype(np.float64)
        points = np.stack([(u - lens.cx) / lens.fx * depth, (v - lens.cy) / lens.fy * depth, depth], axis=-1)
        still = transforms.transform(np.linalg.inv(here) @ eye, points)
        assert np.abs(still[:, 0]).max() < 0.051  # a point of the plate
        seen = transforms.transform(transforms.inverse(eye) @ there, still)
        to = np.stack(
            [lens.fx * seen[:, 0] / seen[:, 2] + lens.cx, lens.fy * seen[:, 1] / seen[:, 2] + lens.cy], axis=-1
        )
        assert flow[own] == pytest.approx(to - np.stack([u, v], axis=-1), abs=2e-3)
        assert np.abs(flow[own]).max() > 1.0


def test_limbs_that_do_not_turn_are_seen_as_in_the_still_world(world: World) -> None:
    scans = [
        IdealLidar(SPINNING, Scene(world, Moving(leaning=each))).scan(driven(SPINNING.columns), STAMP)
        for each in (leaning(world, 0.0), None)
    ]
    for name in ("column", "ring", "instance", "label"):
        np.testing.assert_array_equal(getattr(scans[0], name), getattr(scans[1], name))
    np.testing.assert_allclose(scans[0].range_m, scans[1].range_m, atol=2e-5)


def test_limbs_hang_at_the_trunk_and_differ_from_each_other_in_wind(oak: Mesh) -> None:
    """In 10 m/s what is nearest to a foot moves by at most 15 mm against the trunk, and its ends by far more."""
    world = make_world([(oak, at(0, 0, 0))])
    blown, limbs = leaning_of(BLOWING, world, 1), limbs_of(oak)
    assert blown is not None
    assert limbs is not None
    poses = square(blown.poses(blown.rows, np.arange(200) * LEAN_KNOT_NS))
    against = np.linalg.inv(poses[:, :1]) @ poses[:, 1:]  # limbs in the trunk's frame, from their place at rest
    turns = list[F8]()
    for number, foot in enumerate(limbs.foot):
        points = np.unique(oak.vertices[oak.faces[limbs.group == number]].reshape(-1, 3), axis=0)
        away = np.linalg.norm(points - foot, axis=1)
        for point, low, high in (
            (foot, 0.0, 1e-6),
            (points[np.argmin(away)], 0.0, 0.015),
            (points[np.argmax(away)], 0.03, 1.0),
        ):
            moved = (against[:, number] @ np.append(point, 1.0))[:, :3] - point
            assert low <= np.linalg.norm(moved, axis=1).max() <= high
        turns.append(blown.vectors(blown.rows, np.arange(200) * LEAN_KNOT_NS)[:, 1 + number].ravel())
    alike = np.corrcoef(turns) - np.eye(len(turns))
    assert alike.max() < 0.98
    hertz = oscillators(world, blown.plants, rng_of(1, "wind", "limbs")).hertz
    assert len(set(hertz.tolist())) == len(hertz)


def test_a_limb_sways_at_its_own_frequency_above_the_trees(oak: Mesh) -> None:
    world = make_world([(oak, at(0, 0, 0))])
    plants = with_limbs(world, plants_of(world))
    kinds = oscillators(world, plants, rng_of(0, "wind", "limbs"))
    law = kinds.hertz[0] * np.sqrt(plants.height[0] / plants.height[1:])
    assert (np.abs(kinds.hertz[1:] / law - 1.0) <= SPREAD + 1e-9).all()
    assert (kinds.hertz[1:] > 1.1 * kinds.hertz[0]).all()
    row, power, count = int(np.argmax(kinds.hertz)), np.zeros(2049), 1 << 12
    for seed in range(6):
        blown = leaning_of(BLOWING, world, seed)
        assert blown is not None
        turn = blown.vectors(np.array([row]), np.arange(count) * LEAN_KNOT_NS)[:, 0]
        assert np.abs(turn.mean(axis=0)).max() < 2e-3  # it stands as it has grown
        power = power + (np.abs(np.fft.rfft(turn * np.hanning(count)[:, None], axis=0)) ** 2).sum(axis=1)
    hertz, bands = np.fft.rfftfreq(count, LEAN_KNOT_NS / 1e9), np.geomspace(0.1, 3.0, 16)
    energy = [power[(hertz >= a) & (hertz < b)].sum() for a, b in pairwise(bands)]
    peak = int(np.argmax(energy))
    assert bands[peak] / 1.2 < kinds.hertz[row] < bands[peak + 1] * 1.2


def test_limbs_swing_about_the_axis_across_drag_and_arm() -> None:
    """Limbs along y turn about z alone: by the gusts along a wind from the north, and across one from the west."""
    world, deviation = make_world([(limbed_tree(), at(6, 0, 0))]), list[F8]()
    for degrees in (0.0, 270.0):
        blown = leaning_of(WindConfig(speed_m_s=10.0, direction_deg=degrees, gusts=0.2), world, 3)
        assert blown is not None
        turn = blown.vectors(blown.rows, np.arange(3000) * LEAN_KNOT_NS)[:, 1:]
        np.testing.assert_allclose(turn[..., :2], 0.0, atol=1e-8)
        if degrees == 0.0:  # a gust to -x takes the limb at +y to -x, counter-clockwise, and that at -y clockwise
            gust = Wind(BLOWING.model_copy(update={"direction_deg": 0.0}), 3).at(
                np.array([[6.0, 0.0]]), np.arange(3000) / 10
            )
            assert np.corrcoef(-gust[:, 0, 0], turn[:, LEFT - 1, 2])[0, 1] > 0.7
            assert np.corrcoef(-gust[:, 0, 0], turn[:, RIGHT - 1, 2])[0, 1] < -0.7
        deviation.append(turn[..., 2].std(axis=0))
    assert (deviation[0] > 1.3 * deviation[1]).all()
    assert (deviation[1] > 0.004).all()


def test_limbs_are_held_with_their_tree(world: World) -> None:
    class Holding:
        holds, rows = 1.0, np.zeros(1, np.intp)

        def __call__(self, rows: NDArray[np.intp], knots_ns: NDArray[np.int64]) -> F8:
            assert rows.tolist() == [0]
            return np.tile([0.0, 0.5, 0.0], (len(knots_ns), 1, 1))

    knots, plants = np.arange(3) * LEAN_KNOT_NS, with_limbs(world, plants_of(world))
    held, free = Leaning(plants, [Holding(), Rocking(np.arange(3))]), leaning(world)
    np.testing.assert_allclose(held.vectors(held.rows, knots)[:, 1:], 0.5 * free.vectors(free.rows, knots)[:, 1:])
    np.testing.assert_allclose(
        held.vectors(held.rows, knots)[:, 0, 1], 0.5 + 0.5 * free.vectors(free.rows, knots)[:, 0, 1]
    )
    alone = Leaning(plants, [Holding()])
    assert alone.rows.tolist() == [0, 1, 2]
    poses = alone.poses(alone.rows, knots)
    np.testing.assert_allclose(poses[:, 1:], poses[:, :1].repeat(2, axis=1), atol=1e-12)
    np.testing.assert_allclose(poses[:, [2]], alone.poses(np.array([2]), knots), atol=1e-12)


def test_the_second_tracer_sees_the_same_tree_in_wind(oak: Mesh) -> None:
    world = make_world([(oak, at(6, 0, 0))])
    blown, poses = leaning_of(BLOWING, world, 1), driven(SPINNING.columns)
    scan = IdealLidar(SPINNING, Scene(world, Moving(leaning=blown))).scan(poses, STAMP)
    chosen = np.flatnonzero(scan.instance == TREE)[::2]
    own = Scan._make(values[chosen] if len(values) else values for values in scan)
    stamps = STAMP + own.t_ns.astype(np.int64)
    assert len(chosen) > 150
    wrong = {
        seed: traced_again(ReferenceTracer(world, Moving(leaning=leaning_of(BLOWING, world, seed))), own, poses, stamps)
        for seed in (1, 2)
    }
    off = {
        seed: (np.abs(range_m - own.range_m) > 1e-3) | (ids != own.instance) for seed, (range_m, ids) in wrong.items()
    }
    assert off[1].mean() < 0.03  # the others graze an edge
    assert off[2].mean() > 0.3


def test_pieces_of_a_tree_are_all_its_faces(oak: Mesh) -> None:
    pieces = pieces_of(oak)
    assert set(pieces.tolist()) == {STEM, *range(int(pieces.max()) + 1)}
    assert (pieces_of(replace(oak, limb=None, joints=None)) == WHOLE).all()


@pytest.mark.slow
@pytest.mark.parametrize("environment", ["park", "lake", "forest", "hillside"])
def test_each_plant_of_a_world_in_wind_has_faces_which_the_second_tracer_takes(environment: str) -> None:
    """A tree or clump is its pieces: each face is of one of them."""
    world = load_world(environment)
    blown = leaning_of(BLOWING, world, 1)
    assert blown is not None
    pieces: dict[str, set[int]] = {}
    for mesh, piece in zip(blown.plants.mesh.tolist(), blown.plants.bunch.tolist(), strict=True):
        pieces.setdefault(mesh, set()).add(piece)
    for name, own in pieces.items():
        found = np.unique(pieces_of(world.meshes[name]))
        assert own - {WHOLE} in (set(found.tolist()) - {WHOLE}, set())
    ReferenceTracer(world, Moving(leaning=blown))

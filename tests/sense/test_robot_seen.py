# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot in the clouds and images of its own sensors, against closed forms on the box and the wheels of a Husky."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, box, floating, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.lenses import FLAT, directions
from fieldtruth.experiment.rig import Box, Cylinder, Rig, visible_parts
from fieldtruth.kernels.lidar import Scan
from fieldtruth.kernels.robot import NO_FACE, RIM
from fieldtruth.report.rig.picture import ground_coverage
from fieldtruth.sense.robot import (
    METAL,
    PAINT,
    RUBBER,
    RobotView,
    material_of,
    meet,
    part_table,
    robot_view,
    robot_views,
)
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.lidar.config import LidarSignal
from fieldtruth.sensors.lidar.sensing import IdealLidar, Lidar, ray_directions

F8 = NDArray[np.float64]
HUSKY = Rig()
DECK = HUSKY.robot.chassis_top  # [m] above base_link
FOOT = -HUSKY.robot.footprint.xyz[2]  # [m] of base_link above flat ground
WORLD_FROM_BASE = transforms.pose((3.0, -2.0, FOOT), (0.0, 0.0, 30.0))
ROBOT = int(Label.ROBOT)


def rig_of(*sensors: dict[str, Any]) -> Rig:
    return Rig.model_validate({"visible": True, "sensors": list(sensors)})


def lidar_at(xyz: tuple[float, ...], rpy: tuple[float, ...] = (0.0, 0.0, 0.0), **values: Any) -> Rig:
    usual = {"columns": 360, "rings": 46, "vertical_fov_deg": 90.0, "min_range": 0.1}
    return rig_of({"kind": "lidar", "mount": {"xyz": xyz, "rpy_deg": rpy}, **usual, **values})


def camera_at(xyz: tuple[float, ...], rpy: tuple[float, ...], **values: Any) -> Rig:
    return rig_of({"kind": "camera", "mount": {"xyz": xyz, "rpy_deg": rpy}, **values})


def scan_of(rig: Rig, scene: Scene, pose: F8 = WORLD_FROM_BASE, *, visible: bool = True) -> Scan:
    config = rig.lidar
    parts = visible_parts(rig) if visible else ()
    return IdealLidar(config, scene, parts).scan(pose @ config.mount.base_from_sensor)


def in_base(rig: Rig, scan: Scan) -> F8:
    return transforms.transform(rig.lidar.mount.base_from_sensor, scan.xyz.astype(np.float64))


@pytest.fixture(scope="module")
def flat() -> Scene:
    return Scene(make_world())


# ---------------------------------------------------------------------------------------------------------------------
# Rays


def test_a_ray_meets_each_face_of_a_box_at_its_distance() -> None:
    table = part_table([Box(np.array([2.0, 4.0, 6.0]), np.array([10.0, 20.0, 30.0]))])
    for axis, half in enumerate((1.0, 2.0, 3.0)):
        for sign in (-1.0, 1.0):
            side = np.eye(3)[axis] * sign
            found = meet(table, np.array([10.0, 20.0, 30.0]) + 9.0 * side, np.array([-side, side]))
            assert found.range_m.tolist() == [9.0 - half, np.inf]
            assert found.normal[0].tolist() == side.tolist()
            assert found.face.tolist() == [2 * axis + (sign > 0), NO_FACE]


def test_a_ray_meets_tread_side_and_rim_of_a_wheel() -> None:
    table = part_table([Cylinder("wheel", np.array([1.0, 2.0, 3.0]), 0.5, 0.2)])
    ahead, left, down = np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, -1.0])
    rows: list[tuple[Any, ...]] = [  # origin, direction, range, normal, material
        ((-1.0, 2.05, 3.0), ahead, 1.5, -ahead, RUBBER),
        ((1.3, 2.0, 5.0), down, 2.0 - 0.4, (0.6, 0.0, 0.8), RUBBER),  # the tread at the angle of 3 : 4 : 5
        ((1.4, 0.0, 3.0), left, 1.9, -left, RUBBER),
        ((1.0 + 0.9 * RIM * 0.5, 0.0, 3.0), left, 1.9, -left, METAL),
        ((1.0, 4.0, 3.0), -left, 1.9, left, METAL),
    ]
    for origin, direction, range_m, normal, material in rows:
        found = meet(table, origin, direction[None])
        assert found.range_m[0] == pytest.approx(range_m, abs=1e-12)
        np.testing.assert_allclose(found.normal[0], normal, atol=1e-12)
        assert material_of(table, found.face).tolist() == [material]
    assert not np.isfinite(meet(table, (1.4, 0.0, 3.4), left[None]).range_m).any()  # beside the round, in its box
    hull = meet(part_table([Box(np.ones(3), np.zeros(3))]), (0.0, 0.0, 2.0), down[None])
    assert material_of(part_table([Box(np.ones(3), np.zeros(3))]), hull.face).tolist() == [PAINT]


def test_a_part_is_not_seen_from_inside_nor_from_its_skin() -> None:
    parts: list[Box | Cylinder] = [
        Box(np.array([2.0, 2.0, 2.0]), np.zeros(3)),
        Cylinder("wheel", np.array([0.0, 3.0, 0.0]), 1.0, 1.0),
    ]
    table, left = part_table(parts), np.array([[0.0, 1.0, 0.0]])
    assert meet(table, (0.0, 0.0, 0.0), left).range_m[0] == 2.5  # through its own wall, to the wheel
    assert meet(table, (0.0, -1.0005, 0.0), left).range_m[0] == pytest.approx(3.5005)
    assert meet(table, (0.0, -1.0015, 0.0), left).range_m[0] == pytest.approx(0.0015)
    assert meet(table, (0.0, 3.0, 0.0), -left).range_m[0] == 2.0


# ---------------------------------------------------------------------------------------------------------------------
# LiDARs


def test_a_lidar_sees_the_deck_at_its_height_over_the_sine_of_the_elevation(flat: Scene) -> None:
    height = 0.5
    rig = lidar_at((0.0, 0.0, DECK + height))
    scan = scan_of(rig, flat)
    own = scan.label == ROBOT
    elevation = np.radians(45.0 - 2.0 * scan.ring[own])
    x, y, z = in_base(rig, scan)[own].T
    assert (elevation < 0.0).all()
    assert (scan.instance[own] == 0).all()
    np.testing.assert_allclose(scan.range_m[own], height / np.sin(-elevation), rtol=1e-6)
    np.testing.assert_allclose(z, DECK, atol=1e-6)
    length, width = HUSKY.robot.outline[0], HUSKY.robot.chassis_width
    assert (np.abs(x) <= length / 2 + 1e-6).all()
    assert (np.abs(y) <= width / 2 + 1e-6).all()
    # Every ray that would reach the deck does.
    rays = ray_directions(rig.lidar)
    with np.errstate(divide="ignore"):
        at_deck = rays[..., :2] * (height / -rays[..., 2:])
    inside = (rays[..., 2] < 0) & (np.abs(at_deck) < (length / 2, width / 2)).all(axis=-1)
    assert own.sum() == inside.sum() > 100


def test_all_other_returns_are_those_without_the_robot(flat: Scene) -> None:
    rig = lidar_at((0.1, 0.05, 0.7), (3.0, 10.0, 20.0))
    plain, seen = scan_of(rig, flat, visible=False), scan_of(rig, flat)
    number = [scan.column.astype(int) * 46 + scan.ring for scan in (plain, seen)]
    own = seen.label == ROBOT
    assert own.sum() > 100
    kept = np.isin(number[0], number[1][~own])
    for name in plain._fields:
        before, after = getattr(plain, name), getattr(seen, name)
        np.testing.assert_array_equal(before[kept], after[~own])
    assert np.isin(number[0][~kept], number[1][own]).all()  # what is missing is behind the robot


def test_the_blind_ground_is_that_of_the_rig_command(flat: Scene) -> None:
    rig = lidar_at((0.1, 0.05, 0.7), rings=181, columns=720)
    coverage = ground_coverage(rig, half=2.0, step=0.02)
    hidden = coverage.hidden[0]
    plain, seen = scan_of(rig, flat, visible=False), scan_of(rig, flat)
    number = [scan.column.astype(int) * 181 + scan.ring for scan in (plain, seen)]
    points = in_base(rig, plain)[:, :2]
    near = (np.abs(points) < 1.9).all(axis=1)
    cell = np.rint((points[near] + 2.0) / 0.02).astype(int)
    blind = ~np.isin(number[0][near], number[1][seen.label != ROBOT])
    agree = blind == hidden[cell[:, 1], cell[:, 0]]
    assert 0.05 < blind.mean() < 0.9
    assert agree.mean() > 0.97  # the others are in cells at the border
    mirrored = blind == hidden[cell[:, 1], ::-1][np.arange(len(cell)), cell[:, 0]]
    assert mirrored.mean() < 0.95


def test_a_wheel_on_the_left_is_seen_on_the_left(flat: Scene) -> None:
    left = Cylinder("front_left_wheel", np.array([0.3, 0.6, 0.0]), 0.2, 0.1)
    rig = lidar_at((0.0, 0.0, 0.4), spinning=False)
    scan = IdealLidar(rig.lidar, flat, [left]).scan(WORLD_FROM_BASE @ rig.lidar.mount.base_from_sensor)
    own = scan.label == ROBOT
    assert own.sum() > 20
    assert (scan.xyz[own, 0] > 0.05).all()
    assert (scan.xyz[own, 1] > 0.5).all()


def test_a_mount_that_is_turned_sees_the_same_robot(flat: Scene) -> None:
    for rpy in ((0.0, 40.0, 0.0), (25.0, 10.0, 130.0), (180.0, 0.0, 0.0)):
        rig = lidar_at((0.05, -0.1, 0.8), rpy)
        scan = scan_of(rig, flat)
        points = in_base(rig, scan)[scan.label == ROBOT]
        assert len(points) > 50
        outside = np.maximum(np.abs(points) - [0.495, 0.28545, np.inf], 0.0).max(axis=1)
        on_deck = np.abs(points[:, 2] - DECK) < 1e-5
        assert on_deck.mean() > 0.5
        assert (outside[on_deck] < 1e-5).all()
        assert (points[:, 2] < DECK + 1e-5).all()


def test_nearer_than_the_least_range_the_robot_hides_without_a_return(flat: Scene) -> None:
    far, near = (lidar_at((0.0, 0.0, DECK + 0.5), min_range=least) for least in (0.1, 0.72))
    with_all, without_near = scan_of(far, flat), scan_of(near, flat)
    own = with_all.label == ROBOT
    lost = own & (with_all.range_m < 0.72)
    assert 50 < lost.sum() < own.sum()
    for name in with_all._fields:
        np.testing.assert_array_equal(getattr(with_all, name)[~lost], getattr(without_near, name))


def test_what_is_in_front_of_the_robot_hides_it() -> None:
    """A board and a sheet of water between LiDAR and deck: one returns, the other does not; both hide the deck."""
    half, height = 0.2, 0.2
    rig = lidar_at((0.0, 0.0, DECK + 2 * height))
    pose = transforms.pose((0.0, 0.0, 5.0))
    board = box("board", (half, half, 0.01), "wood"), at(half, 0.0, 5.0 + DECK + height)
    sheet = quad("sheet", [[-half, -half, 0], [0, -half, 0], [0, half, 0], [-half, half, 0]], "water")
    lake = sheet, at(0.0, 0.0, 5.0 + DECK + height)
    bare, covered = (scan_of(rig, floating(*objects), pose) for objects in ((), (board, lake)))
    assert set(bare.label.tolist()) == {ROBOT}
    assert set(covered.label.tolist()) == {ROBOT, int(Label.BENCH)}
    x, y, _ = in_base(rig, bare).T
    behind_lake = (x < -0.001) & (x > -2 * half + 0.001) & (np.abs(y) < 2 * half - 0.001)
    number = [scan.column.astype(int) * 46 + scan.ring for scan in (bare, covered)]
    assert behind_lake.sum() > 20
    assert not np.isin(number[0][behind_lake], number[1]).any()


def test_a_spinning_lidar_on_a_moving_robot_sees_it_as_one_that_stands(flat: Scene) -> None:
    rig = lidar_at((0.05, -0.1, 0.7), spinning=True)
    config = rig.lidar
    still = scan_of(rig, flat)
    poses = np.array([
        transforms.pose((0.002 * k, 0.0, FOOT), (0.0, 0.0, 0.1 * k)) @ config.mount.base_from_sensor
        for k in range(config.columns + 1)
    ])  # fmt: skip
    moving = IdealLidar(config, flat, visible_parts(rig)).scan(poses)
    first, second = (scan.label == ROBOT for scan in (still, moving))
    np.testing.assert_array_equal(still.xyz[first], moving.xyz[second])
    np.testing.assert_array_equal(still.ring[first], moving.ring[second])


def test_a_pattern_is_aimed_again_in_each_scan(flat: Scene) -> None:
    mount = {"xyz": [0.0, 0.0, 0.8], "rpy_deg": [0.0, 50.0, 0.0]}
    rig = rig_of({"kind": "lidar", "model": "mid_360", "mount": mount})
    lidar = IdealLidar(rig.lidar, flat, visible_parts(rig))
    pose = WORLD_FROM_BASE @ rig.lidar.mount.base_from_sensor
    seen = [lidar.scan(pose, stamp) for stamp in (0, 700_000_000)]
    for scan in seen:
        points = in_base(rig, scan)[scan.label == ROBOT]
        assert len(points) > 100
        assert (np.abs(points[:, 2] - DECK) < 1e-5).mean() > 0.5
    assert not np.array_equal(seen[0].column, seen[1].column) or not np.array_equal(seen[0].xyz, seen[1].xyz)


# ---------------------------------------------------------------------------------------------------------------------
# Cameras


def view_of(rig: Rig) -> RobotView:
    (view,) = robot_views(rig).values()
    return view


def test_a_camera_above_the_deck_sees_its_known_outline(flat: Scene) -> None:
    """Looking straight down, the deck is a rectangle; the wheels reach out of it on the left and on the right."""
    height = 1.0
    rig = camera_at((0.1, 0.02, DECK + height), (0.0, 90.0, 0.0), width=400, height=400, depth=True)
    (imager,) = rig.imagers
    lens = imager.config.projection
    images = LabelCamera(imager.config, flat).label(WORLD_FROM_BASE @ imager.base_from_optical, view_of(rig))
    v, u = np.mgrid[:400, :400]
    x, y = (
        0.1 - (v - lens.cy) / lens.fy * height,
        0.02 - (u - lens.cx) / lens.fx * height,
    )  # of the deck's plane: up in the image is ahead
    deck = (np.abs(x) < 0.495) & (np.abs(y) < 0.28545)
    border = (np.abs(np.abs(x) - 0.495) < 1e-3) | (np.abs(np.abs(y) - 0.28545) < 1e-3)
    own = images.label == ROBOT
    assert own[deck & ~border].all()
    np.testing.assert_allclose(images.depth[deck & ~border], height, rtol=1e-6)
    assert (images.instance[own] == 0).all()
    beside = own & ~deck & ~border
    assert beside.sum() > 100
    assert (np.abs(y[beside]) > 0.28545).all()  # wheels, and nothing ahead or behind
    assert (images.label[~own] == int(Label.GROUND)).all()


def test_left_and_right_are_not_swapped_in_images(flat: Scene) -> None:
    rig = camera_at((-0.6, 0.0, 0.8), (0.0, 30.0, 0.0), width=320, height=200)
    (imager,) = rig.imagers
    post = Box(np.array([0.1, 0.1, 0.5]), np.array([0.5, 0.4, 0.25]))
    view = robot_view(part_table([post]), imager)
    label = LabelCamera(imager.config, flat).label(WORLD_FROM_BASE @ imager.base_from_optical, view).label
    columns = np.nonzero(label == ROBOT)[1]
    assert len(columns) > 100
    assert columns.max() < 160


LENSES: list[dict[str, Any]] = [
    {"model": "pinhole"},
    {"model": "plumb_bob", "coefficients": [-0.2, 0.05, 0.001, -0.002, 0.0]},
    {"model": "equidistant", "fx": 90.0, "fy": 90.0, "coefficients": [0.0, 0.01, 0.0, 0.0]},
    {"model": "equirectangular"},
]


@pytest.mark.parametrize("lens", LENSES, ids=[str(lens["model"]) for lens in LENSES])
def test_depth_of_every_lens_leads_to_the_surface_of_the_robot(lens: dict[str, Any], flat: Scene) -> None:
    rig = camera_at((0.0, 0.05, 0.9), (4.0, 70.0, 15.0), width=320, height=240, lens=lens)
    (imager,) = rig.imagers
    view = view_of(rig)
    images = LabelCamera(imager.config, flat).label(WORLD_FROM_BASE @ imager.base_from_optical, view)
    plain = LabelCamera(imager.config, flat).label(WORLD_FROM_BASE @ imager.base_from_optical)
    own = images.label == ROBOT
    for after, before in ((images.label, plain.label), (images.instance, plain.instance), (images.depth, plain.depth)):
        np.testing.assert_array_equal(after[~own], before[~own])
    v, u = np.nonzero(own)
    assert len(u) > 500
    rays = directions(imager.config.projection, u, v)
    if imager.config.projection.model in FLAT:
        rays = rays / rays[:, 2:]
    points = transforms.transform(imager.base_from_optical, rays * images.depth[own][:, None])
    assert (np.abs(points[:, 2] - DECK) < 1e-5).mean() > 0.5
    assert (points[:, 2] < DECK + 1e-5).all()
    assert (np.abs(points) < [0.495 + 1e-5, 0.335 + 1e-5, np.inf]).all()


def test_samples_of_a_pixel_cover_it_as_far_as_the_robot_does() -> None:
    rig = camera_at((0.1, 0.02, DECK + 1.3), (0.0, 90.0, 0.0), width=200, height=200)
    view = view_of(rig)
    cover = np.bincount(view.samples.pixel, view.samples.share, 200 * 200).reshape(200, 200)
    lens = rig.imagers[0].config.projection
    assert cover.max() == pytest.approx(1.0)
    assert ((cover > 0.01) & (cover < 0.99)).sum() > 100
    # The front edge of the deck, 0.395 m ahead of the camera: what it covers of the column between the wheels.
    assert cover[:100, 100].sum() == pytest.approx(lens.fy * 0.395 / 1.3 + 99.5 - lens.cy, abs=0.13)
    assert (np.diff(view.samples.pixel) >= 0).all()


def test_a_robot_that_is_not_visible_has_no_views() -> None:
    rig = camera_at((0.1, 0.02, 1.0), (0.0, 90.0, 0.0))
    assert robot_views(rig.model_copy(update={"visible": False})) == {}
    assert visible_parts(Rig()) == ()
    assert len(visible_parts(rig)) == 5
    caster = Rig.model_validate({"robot": "generic_differential", "visible": True})
    assert len(visible_parts(caster)) == 4


def test_a_lidar_with_a_signal_sees_the_same_robot(flat: Scene) -> None:
    rig = lidar_at((0.0, 0.0, DECK + 0.5))
    plain = scan_of(rig, flat)
    config = rig.lidar.model_copy(update={"signal": LidarSignal()})
    pose = WORLD_FROM_BASE @ config.mount.base_from_sensor
    found = Lidar(config, flat, robot=visible_parts(rig)).measured(pose)
    for name in ("xyz", "label", "instance", "ring", "column"):
        np.testing.assert_array_equal(getattr(found, name), getattr(plain, name))
    np.testing.assert_array_equal(found.true_range, plain.range_m)
    assert (found.label == ROBOT).sum() > 100

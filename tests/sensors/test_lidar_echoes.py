# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Beams with a width at edges whose echoes are known in closed form; and clouds of LiDARs with a signal."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore
from sense_worlds import at, box, floating, quad

from fieldtruth.bag import decode
from fieldtruth.bag.readings import cloud_of, reflectivity
from fieldtruth.experiment.catalogue import datasheet_of
from fieldtruth.experiment.rig import Rig
from fieldtruth.exporters.kitti import xyz_and_reflectance
from fieldtruth.kernels.lidar import TURNS
from fieldtruth.kernels.lidar_noise import Reading
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import At, Movement, SensorWorld
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import IdealLidar, Lidar, sub_rays_of
from fieldtruth.sensors.lidar.sensor import LidarSensor

signal_of = LidarSignal.model_validate

WIDTH = 0.4  # [deg], FWHM
RADIUS = 2.0 * WIDTH / np.sqrt(8.0 * np.log(2.0))  # [deg] of the ring of rays
SPACING = 360.0 / 8192


def scan(scene: Scene, **signal: Any) -> Reading:
    """Scan of beams 0.04 deg apart along each ring."""
    figures = {"divergence_deg": WIDTH, "pulse_length": 1.0, "sub_rays": 7, **signal}
    config = LidarConfig(columns=8192, rings=16, vertical_fov_deg=1.0, signal=signal_of(figures), min_range=0.1)
    return Lidar(config, scene).measured(at(0, 0, 0))


def upright(name: str, x: float, left: float, right: float, material: str) -> Any:
    """A wall across the x axis between two y [m]."""
    return quad(name, [[x, right, -9], [x, left, -9], [x, left, 9], [x, right, 9]], material), at(0, 0, 0)


def edge(near: float, far: float) -> Scene:
    """A wall of bark on the left at ``near``, which ends straight ahead, and one of stone behind it at ``far``."""
    return floating(upright("front", near, 3.0, 0.0, "bark"), upright("back", far, 3.0, -3.0, "stone"))


def about(found: Reading, degrees: float) -> NDArray[np.bool_]:
    """Points of beams within an angle of the x axis."""
    columns = np.minimum(found.column.astype(int), 8192 - found.column.astype(int))
    return np.asarray(columns * SPACING < degrees)


@pytest.mark.parametrize("count", [3, 5, 7, 9])
def test_rays_have_the_moments_of_a_gaussian_beam(count: int) -> None:
    rays = sub_rays_of(LidarSignal(sub_rays=count, divergence_deg=WIDTH, pulse_length=1.0))
    sigma = np.radians(WIDTH) / np.sqrt(8.0 * np.log(2.0))
    squared = (rays.offset**2).sum(axis=-1)
    assert rays.weight.sum() == pytest.approx(1.0)
    assert squared @ rays.weight == pytest.approx(2.0 * sigma**2)
    assert squared**2 @ rays.weight == pytest.approx(8.0 * sigma**4)
    assert np.abs(rays.weight @ rays.offset).max() < 1e-12
    across = (rays.offset[..., 0] ** 2 @ rays.weight).reshape(TURNS)
    assert across.mean() == pytest.approx(sigma**2)
    assert (np.ptp(across) < 1e-12) == (count > 3)


def test_share_of_mixed_echoes_at_an_edge() -> None:
    """A beam is mixed if its rays are on both sides: the ring's width, cos averaged over 60 deg, over the spacing."""
    found = scan(edge(10.0, 10.5))
    mixed = about(found, 3.0) & (found.mixed == 1)
    expected = 16 * 2.0 * RADIUS * (3.0 / np.pi) / SPACING
    assert np.count_nonzero(mixed) == pytest.approx(expected, rel=0.05)
    assert not found.mixed[~about(found, 1.0) & about(found, 12.0)].any()


def test_range_and_label_of_mixed_echoes() -> None:
    """The mean of both ranges by power: twelfths of the beam times reflectance over squared range."""
    found = scan(edge(10.0, 10.5))
    mixed = about(found, 3.0) & (found.mixed == 1)
    front, back = 0.34 / 10.0**2, 0.28 / 10.5**2
    twelfths = np.arange(1, 12)[:, None] / 12.0
    power = np.concatenate([twelfths * front, (1.0 - twelfths) * back], axis=1)
    ranges = power @ [10.0, 10.5] / power.sum(axis=1)
    off = np.abs(found.range_m[mixed][:, None] - ranges)
    assert off.min(axis=1).max() < 2e-3
    assert len(np.unique(off.argmin(axis=1))) >= 6
    of_front = (power[:, 0] > power[:, 1])[off.argmin(axis=1)]
    assert np.array_equal(found.label[mixed] == 2, of_front)
    total = (power.sum(axis=1) * ranges**2)[off.argmin(axis=1)]
    assert found.reflectivity[mixed] == pytest.approx(total, rel=2e-3)


def test_two_returns_are_ordered() -> None:
    scene = edge(10.0, 14.0)
    two = scan(scene, returns="two")
    ray = two.column.astype(int) * 16 + two.ring
    second = np.flatnonzero(np.diff(ray) == 0) + 1
    assert np.array_equal(np.flatnonzero(two.echo == 1), second)
    assert len(second) == pytest.approx(16 * 2.0 * RADIUS * (3.0 / np.pi) / SPACING, rel=0.05)
    assert two.range_m[second - 1] == pytest.approx(10.0, abs=0.01)
    assert two.range_m[second] == pytest.approx(14.0, abs=0.01)
    assert set(two.label[second - 1]) == {2}
    assert set(two.label[second]) == {5}
    shares = two.reflectivity[second - 1] / 0.34 + two.reflectivity[second] / 0.28
    assert shares == pytest.approx(1.0, abs=2e-3)
    assert not two.mixed.any()


@pytest.mark.parametrize(("returns", "choice"), [("strongest", "max"), ("last", "far")])
def test_one_return_of_two_echoes(returns: str, choice: str) -> None:
    scene = edge(10.0, 14.0)
    two, one = scan(scene, returns="two"), scan(scene, returns=returns)
    second = np.flatnonzero(two.echo == 1)
    power = two.reflectivity / two.range_m**2
    wanted = second if choice == "far" else np.where(power[second] > power[second - 1], second, second - 1)
    key = two.column.astype(int) * 16 + two.ring
    rows = np.searchsorted(one.column.astype(int) * 16 + one.ring, key[wanted])
    assert np.array_equal(one.range_m[rows], two.range_m[wanted])
    assert np.array_equal(one.label[rows], two.label[wanted])
    assert len(one.label) == len(two.label) - len(second)


def test_a_last_echo_too_weak_for_the_receiver_is_not_reported() -> None:
    """The far wall returns where half a beam or more meets it; the twelfth of a beam does not reach the threshold."""
    figures = {"reach": [[0.28, 21.0]], "signal_at_reach": 1e4}  # a beam on it at 14 m has 2.25 times the threshold
    found = scan(edge(10.0, 14.0), returns="last", **figures)
    far = found.range_m > 12.0
    edges = far & (found.reflectivity < 0.27)
    assert edges.any()
    assert found.signal[edges].min() > 1e4
    assert found.reflectivity[edges].min() > 0.28 * 5 / 12 * 0.97  # twelfths: 6 of 12 are enough, 5 are not
    assert (found.range_m[~far] < 10.5).all()


def test_true_range_is_that_of_the_middle() -> None:
    scene = edge(10.0, 14.0)
    found = scan(scene, range_noise=[[1.0, 0.05]])
    ideal = IdealLidar(LidarConfig(columns=8192, rings=16, vertical_fov_deg=1.0, min_range=0.1), scene).scan(
        at(0, 0, 0)
    )
    exact = np.zeros((8192, 16), np.float32)
    exact[ideal.column, ideal.ring] = ideal.range_m
    assert exact[found.column, found.ring].tobytes() == found.true_range.tobytes()
    assert np.count_nonzero(found.true_range == 0.0) > 0  # beams whose middle passes by the far wall


def cloud(scene: Scene, config: LidarConfig, number: int = 3) -> tuple[Any, NDArray[np.void]]:
    """Message of a stream and its points."""
    sensor_world, (output,) = SensorWorld(scene.world, Rig()), config.outputs()
    sensor = LidarSensor(config, sensor_world)
    at = At(number, number * 100_000_000, number * 100_000_000, Movement(lambda _: np.eye(4)))
    (raw,) = sensor.messages(output, number, sensor.read(output, at))
    message: Any = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(raw, "sensor_msgs/msg/PointCloud2")
    return message, decode.points(message)


ROOM = (box("room", (30, 25, 12)), at(0, 0, 0)), (box("pillar", (0.4, 0.3, 9.0), "bark"), at(6, 3, 0))
SHEET = {**datasheet_of("lidar", "os1_64_gen1"), "reach": [[0.3, 45.0]]}


def test_fields_of_a_cloud_with_a_signal() -> None:
    scene = floating(*ROOM)
    config = LidarConfig(columns=128, signal=signal_of(SHEET))
    message, points = cloud(scene, config)
    plain, ideal = cloud(scene, LidarConfig(columns=128))
    scan = Lidar(config, scene).measured(config.mount.base_from_sensor, number=3)
    assert plain.point_step == 24
    assert [field.name for field in message.fields[: len(plain.fields)]] == [field.name for field in plain.fields]
    for name in ("true_range", "signal", "reflectivity", "echo", "mixed", "label", "instance", "ring", "column"):
        assert np.array_equal(points[name], getattr(scan, name)), name
    assert np.array_equal(points["intensity"], scan.label)
    assert np.array_equal(np.stack([points[axis] for axis in "xyz"], axis=-1), scan.xyz)
    ranges = np.linalg.norm(np.stack([ideal[axis] for axis in "xyz"], axis=-1), axis=1)
    rows = np.searchsorted(ideal["column"].astype(int) * 64 + ideal["ring"], scan.column.astype(int) * 64 + scan.ring)
    assert points["true_range"] == pytest.approx(ranges[rows], rel=2e-7)
    assert not np.array_equal(cloud(scene, config, 2)[1]["signal"][:1000], points["signal"][:1000])


def test_intensity_and_an_ousters_fields() -> None:
    scene = floating(*ROOM)
    _, points = cloud(
        scene,
        LidarConfig(columns=128, signal=signal_of(SHEET), intensity="reflectivity", point_fields="ouster"),
    )
    config = LidarConfig(columns=128, signal=signal_of(SHEET))
    scan = Lidar(config, scene).measured(config.mount.base_from_sensor, number=3)
    assert np.array_equal(points["intensity"], scan.reflectivity)
    assert points["reflectivity"].dtype == np.uint16
    assert np.array_equal(points["reflectivity"], np.rint(100.0 * scan.reflectivity))
    assert points["range"] == pytest.approx(1000.0 * scan.range_m, abs=0.51)
    assert 5 < np.median(points["reflectivity"]) < 30


@pytest.mark.parametrize("signal", [None, signal_of(SHEET)])
def test_organised_clouds(signal: LidarSignal | None) -> None:
    """A row for each ring, a point for each column; the returns are those of the plain cloud."""
    scene = floating(ROOM[1])
    _, plain = cloud(scene, LidarConfig(columns=256, signal=signal))
    message, points = cloud(scene, LidarConfig(columns=256, signal=signal, organised=True))
    assert (message.height, message.width, message.is_dense) == (64, 256, False)
    assert message.row_step == 256 * message.point_step
    grid = points.reshape(64, 256)
    assert np.array_equal(grid["ring"], np.repeat(np.arange(64)[:, None], 256, axis=1))
    assert np.array_equal(grid["column"], np.repeat(np.arange(256)[None], 64, axis=0))
    finite = np.isfinite(grid["x"])
    assert 0 < np.count_nonzero(finite) == len(plain) < finite.size
    assert np.isnan(grid["z"][~finite]).all()
    assert not grid["label"][~finite].any()
    assert grid.T[finite.T].tobytes() == plain.tobytes()


def test_reflectivity_of_clouds() -> None:
    """Of a signal as in the cloud, of an Ouster from percent; an ideal Ouster's is the class and is not passed on."""
    scene = floating(*ROOM)
    configs = (
        LidarConfig(columns=128, signal=signal_of(SHEET)),
        LidarConfig(columns=128, signal=signal_of(SHEET), point_fields="ouster"),
        LidarConfig(columns=128, point_fields="ouster"),
    )
    own, ouster, ideal = (cloud_of(cloud(scene, config)[0]) for config in configs)
    assert np.array_equal(reflectivity(own), own.others["reflectivity"])
    assert reflectivity(ouster) == pytest.approx(own.others["reflectivity"], abs=0.0051)
    assert ideal.others["reflectivity"].any()
    assert not reflectivity(ideal).any()
    assert np.array_equal(xyz_and_reflectance(own)[:, 3], own.others["reflectivity"])
    assert np.array_equal(xyz_and_reflectance(own)[:, :3], own.xyz)
    assert not xyz_and_reflectance(ideal)[:, 3].any()

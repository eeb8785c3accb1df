# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Power and noise of a LiDAR against closed forms, and the truth that noise leaves as it is."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm
from sense_worlds import at, box, floating, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.catalogue import datasheet_of, list_models
from fieldtruth.experiment.files import parse_experiment
from fieldtruth.kernels.lidar import EchoBuffers, brightness
from fieldtruth.kernels.lidar_noise import Reading
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import Lidar, Reflectance, limit_of, reflectance_of
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Material

signal_of = LidarSignal.model_validate

F8 = NDArray[np.float64]
SHEET = datasheet_of("lidar", "os1_64_gen1")
STONE = 0.28
"""Reflectance of the class rock, which the material "stone" of the small worlds falls back to."""


def narrow(signal: dict[str, Any], **values: Any) -> LidarConfig:
    """A pencil of 32 x 64 beams about +x of the LiDAR, 0.01 deg apart, twice around: column 0 and its neighbours."""
    return LidarConfig(columns=8192, rings=64, vertical_fov_deg=0.5, min_range=0.1, signal=signal_of(signal), **values)


def wall(distance: float, tilt_deg: float = 0.0, *, side: float = 60.0) -> Scene:
    """A square wall that column 0 meets at a distance [m], turned about the vertical."""
    turn = np.radians(tilt_deg)
    across = np.array([-np.sin(turn), np.cos(turn), 0.0]) * side
    up = np.array([0.0, 0.0, side])
    middle = np.array([distance, 0.0, 0.0])
    return floating(
        (
            quad("wall", [middle - across - up, middle + across - up, middle + across + up, middle - across + up]),
            at(0, 0, 0),
        )
    )


def ahead(reading: Reading, columns: int = 64) -> NDArray[np.bool_]:
    """Points of the columns about the x axis."""
    return np.asarray(np.minimum(reading.column.astype(int), 8192 - reading.column.astype(int)) <= columns)


def median_signal(scene: Scene, signal: dict[str, Any]) -> float:
    """Median signal of the points straight ahead."""
    reading = Lidar(narrow(signal), scene).measured(at(0, 0, 0))
    return float(np.median(reading.signal[ahead(reading, 8)]))


BRIGHT = {"reach": [[1.0, 1000.0]], "signal_at_reach": 100.0}


def test_power_falls_with_the_square_of_the_range() -> None:
    near, far = (median_signal(wall(r), BRIGHT) for r in (10.0, 30.0))
    assert near / far == pytest.approx(9.0, rel=0.01)
    assert near == pytest.approx(100.0 * STONE * 1000.0**2 / 10.0**2, rel=0.01)


@pytest.mark.parametrize("tilt", [30.0, 60.0])
def test_power_falls_with_the_cosine_of_incidence(tilt: float) -> None:
    assert median_signal(wall(20.0, tilt), BRIGHT) / median_signal(wall(20.0), BRIGHT) == pytest.approx(
        np.cos(np.radians(tilt)), rel=0.01
    )


@pytest.mark.parametrize("rpy", [(0.0, 0.0, 50.0), (35.0, 20.0, -70.0)])
def test_incidence_on_a_turned_and_scaled_object(rpy: tuple[float, float, float]) -> None:
    """A wall that is an object turned about all axes: its normal is not that of its mesh."""
    flat = quad("wall", [[0, -9, -9], [0, 9, -9], [0, 9, 9], [0, -9, 9]])
    pose = transforms.pose((20.0, 0.0, 0.0), rpy)
    normal = pose[:3, 0].copy()
    pose[:3, :3] *= 3.0
    upright = median_signal(wall(20.0), BRIGHT)
    assert median_signal(floating((flat, pose)), BRIGHT) / upright == pytest.approx(abs(normal[0]), rel=0.01)


def test_brightness_of_a_lobe() -> None:
    """Jutzi and Gross (2009): upright all of it; at 45 deg the lobe is gone; matt surfaces follow Lambert's law."""
    law = getattr(brightness, "py_func", brightness)
    for cosine in np.linspace(0.0, 1.0, 11):
        assert law(0.4, 0.0, 1.0, cosine) == 0.4 * cosine
        twice = 2.0 * cosine**2 - 1.0
        assert law(0.4, 0.3, 8.0, cosine) == pytest.approx(0.4 * (0.7 * cosine + 0.3 * max(twice, 0.0) ** 8))
    assert law(0.4, 0.3, 8.0, 1.0) == pytest.approx(0.4)


def test_air_takes_its_share_twice() -> None:
    alpha = 0.01

    def in_air(echoes: EchoBuffers, key: np.uint64, _poses: Array, _directions: Array) -> None:
        echoes.apparent[:] *= np.exp(-2.0 * alpha * echoes.depth)

    scene = wall(40.0)
    clear = Lidar(narrow(BRIGHT), scene).measured(at(0, 0, 0))
    foggy = Lidar(narrow(BRIGHT), scene, in_air=in_air).measured(at(0, 0, 0))
    ratio = np.median(foggy.signal[ahead(foggy, 8)]) / np.median(clear.signal[ahead(clear, 8)])
    assert ratio == pytest.approx(np.exp(-2.0 * alpha * 40.0), rel=0.01)


def test_reach_of_the_data_sheet() -> None:
    """Half of the pulses return at the reach; both pairs of the sheet are within 3 % in range of the fit."""
    signal = LidarSignal(**SHEET)
    for rho, reach in signal.reach:
        assert np.sqrt(rho / limit_of(signal)) == pytest.approx(reach, rel=0.035)
    at_end = float(np.sqrt(STONE / limit_of(signal)))
    for r, share in ((at_end, 0.5), (0.9 * at_end, None), (1.1 * at_end, None)):
        expected = 12.0 * (at_end / r) ** 2
        share = float(norm.cdf((expected - 12.0) / np.sqrt(expected)))
        found = Lidar(narrow(SHEET, max_range=200.0), wall(r)).measured(at(0, 0, 0))
        rays = (2 * 64 + 1) * 64
        assert np.count_nonzero(ahead(found)) / rays == pytest.approx(share, abs=3 * np.sqrt(0.25 / rays) + 0.01)


def test_range_noise_by_signal() -> None:
    """Ten thousand rays on a wall: deviation by the table, between its points linear in both logarithms; no bias."""
    signal = {**BRIGHT, "range_noise": [[100.0, 0.2], [1e4, 0.02], [1e6, 0.01]]}
    for r in (30.0, 150.0, 400.0):
        expected_signal = 100.0 * STONE * (1000.0 / r) ** 2
        expected = np.exp(np.interp(np.log(expected_signal), np.log([100, 1e4, 1e6]), np.log([0.2, 0.02, 0.01])))
        found = Lidar(narrow(signal, max_range=2000.0), wall(r, side=100.0)).measured(at(0, 0, 0))
        error = (found.range_m - found.true_range)[ahead(found, 80)]
        count = len(error)
        assert count > 10_000
        assert np.std(error) == pytest.approx(expected, rel=4 / np.sqrt(2 * count) + 0.002)
        assert abs(np.mean(error)) < 4 * expected / np.sqrt(count)
        assert norm.fit(error / expected)[1] == pytest.approx(1.0, abs=0.04)
        assert np.mean(np.abs(error) > 2 * expected) == pytest.approx(0.0455, abs=0.01)


def test_signal_varies_as_photons_do_and_gives_the_reflectivity() -> None:
    found = Lidar(narrow({"reach": [[1.0, 100.0]], "signal_at_reach": 1.0}), wall(10.0)).measured(at(0, 0, 0))
    signal, bright = found.signal[ahead(found, 40)], found.reflectivity[ahead(found, 40)]
    assert np.mean(signal) == pytest.approx(STONE * 100.0, rel=0.01)
    assert np.std(signal) == pytest.approx(np.sqrt(STONE * 100.0), rel=0.03)
    assert np.mean(bright) == pytest.approx(STONE, rel=0.01)


def test_resolution_and_angles() -> None:
    signal = {"range_noise": [[1.0, 0.05]], "resolution": 0.012, "angle_noise_deg": 0.05}
    config = narrow(signal)
    found = Lidar(config, wall(20.0)).measured(at(0, 0, 0))
    steps = found.range_m.astype(np.float64) / 0.012
    assert np.abs(steps - np.rint(steps)).max() < 1e-3
    assert len(np.unique(np.rint(steps[ahead(found)]))) > 20
    ideal = Lidar(config.model_copy(update={"signal": None}), wall(20.0)).scan(at(0, 0, 0))
    rays = found.xyz / np.linalg.norm(found.xyz, axis=1, keepdims=True)
    off = np.degrees(rays - ideal.xyz / np.linalg.norm(ideal.xyz, axis=1, keepdims=True))[ahead(found)]
    assert np.std(off[:, 1]) == pytest.approx(0.05, rel=0.03)
    assert np.std(off[:, 2]) == pytest.approx(0.05, rel=0.03)
    assert abs(np.corrcoef(off[:, 1], off[:, 2])[0, 1]) < 0.04
    assert np.abs(np.mean(off, axis=0)).max() < 0.003


def room() -> Scene:
    """A room with a pillar."""
    return floating((box("room", (30, 25, 12)), at(0, 0, 0)), (box("pillar", (0.4, 0.3, 9.0), "bark"), at(6, 3, 0)))


@pytest.mark.parametrize("moving", [False, True])
def test_truth_is_that_of_the_ideal_lidar(moving: bool) -> None:
    """Labels, ids and true ranges of the points are the same bytes; none of a ray that does not return."""
    values: dict[str, Any] = {"columns": 256, "spinning": moving, "max_range": 60.0}
    poses = at(1, 2, 0.5)
    if moving:
        poses = np.stack([transforms.pose((0.01 * k, 0, 0.5), (0, 0, 0.1 * k)) for k in range(257)])
    signal = {**SHEET, "reach": [[0.3, 45.0]]}
    ideal = Lidar(LidarConfig(**values), room()).scan(poses)
    found = Lidar(LidarConfig(**values, signal=signal_of(signal)), room()).measured(poses)
    assert 0.3 < len(found.label) / len(ideal.label) < 0.99
    rows = np.searchsorted(ideal.column.astype(int) * 64 + ideal.ring, found.column.astype(int) * 64 + found.ring)
    for name, own in (("label", "label"), ("instance", "instance"), ("range_m", "true_range"), ("t_ns", "t_ns")):
        assert getattr(ideal, name)[rows].tobytes() == getattr(found, own).tobytes(), name
    assert (found.range_m != found.true_range).mean() > 0.99
    quiet = Lidar(LidarConfig(**values, signal=LidarSignal()), room()).measured(poses)
    assert all(getattr(quiet, name).tobytes() == getattr(ideal, name).tobytes() for name in ideal._fields)


def test_a_scan_depends_on_seed_name_and_number_alone() -> None:
    scene = room()
    config = LidarConfig(columns=256, signal=signal_of({**SHEET, "reach": [[1.0, 1000.0]]}))
    lidar = Lidar(config, scene)
    scans = [lidar.measured(at(0, 0, 0), number=k) for k in (0, 1, 2)]
    again = Lidar(config, scene).measured(at(0, 0, 0), number=1)
    assert all(getattr(again, name).tobytes() == getattr(scans[1], name).tobytes() for name in again._fields)
    other = Lidar(config.model_copy(update={"name": "top"}), scene).measured(at(0, 0, 0), number=1)
    noises = [scan.range_m - scan.true_range for scan in (*scans, other)]
    assert all(len(noise) == len(noises[0]) for noise in noises)
    assert np.abs(np.corrcoef(noises) - np.eye(4)).max() < 0.04


def test_reflectance_of_every_material() -> None:
    found = {name: reflectance_of(material) for name, material in MATERIALS.items()}
    assert all(0.0 < each.value <= 1.0 for each in found.values())
    assert found["lawn"].value == 0.50
    assert found["dry_grass"].value == 0.58
    assert found["mud"].value < 0.6 * found["soil"].value
    assert found["bench_iron"].value < found["bench_concrete"].value < found["bench_wood"].value
    of_no_file = Material(name="x", label=MATERIALS["bark_oak"].label, texture="y")
    assert reflectance_of(of_no_file) == Reflectance(0.34)


def test_ground_has_the_mixture_of_its_cover() -> None:
    scene = Scene(make_world(side=80.0))
    found = Lidar(LidarConfig(signal=LidarSignal(), max_range=30.0), scene).measured(at(0, 0, 1.2))
    elevation = np.radians(22.5 - 45.0 * found.ring / 63)
    np.testing.assert_allclose(found.reflectivity, 0.35 * np.sin(-elevation), rtol=1e-3)


def test_data_sheets_are_signals() -> None:
    for name in list_models("lidar"):
        figures = datasheet_of("lidar", name)
        signal = LidarSignal(**figures)
        assert signal.reach, name
        assert signal.range_noise, name
        assert signal.divergence_deg > 0, name


@pytest.mark.parametrize(
    ("signal", "line"),
    [
        ("{sub_rays: 2, divergence_deg: 0.1}", r"sub_rays must be an odd number, got 2"),
        ("{sub_rays: 3, divergence_deg: 0.1}", r"pulse_length must be above 0 with 3 sub_rays, got 0"),
        ("{sub_rays: 3}", r"divergence_deg must be above 0 with 3 sub_rays, got 0"),
        ("{range_noise: [[10.0, 0.1], [10.0, 0.2]]}", r"range_noise must have rising signals, got 10, 10"),
        ("{range_noise: [[10.0, 0.0]]}", r"range_noise must have deviations above 0; leave it out"),
        ("{returns: first}", r"signal\.returns must be"),
        ("{reach: 5}", r"signal\.reach must be a list of pairs"),
        ("ideal, intensity: reflectivity", r"intensity must be class without a signal, got reflectivity"),
        ("{returns: two}, organised: true", r"organised must be false with two returns"),
    ],
)
def test_what_is_refused_is_one_line(signal: str, line: str) -> None:
    text = (
        "name: a\nenvironment: park\nroute: {metres: {start: [0, 0], waypoints: [[5, 0]]}}\n"
        f"rig: {{sensors: [{{kind: lidar, signal: {signal}}}]}}\n"
    )
    with pytest.raises(ConfigurationError, match=line) as error:
        parse_experiment(text)
    assert "\n" not in str(error.value)

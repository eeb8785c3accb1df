# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Validation of clouds with noise: the stated distribution passes, another one fails."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, box, floating

from fieldtruth.experiment.catalogue import datasheet_of
from fieldtruth.sensors.lidar.check import NoiseTally, ideal_points
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import IdealLidar, Lidar, ray_directions
from fieldtruth.validation.check import Check

signal_of = LidarSignal.model_validate

SCENE = floating((box("room", (30, 25, 12)), at(0, 0, 0)), (box("pillar", (0.4, 0.3, 9.0), "bark"), at(6, 3, 0)))
SHEET: dict[str, Any] = {**datasheet_of("lidar", "os1_64_gen1"), "reach": [[0.3, 45.0]]}
WIDE = {"sub_rays": 3, "divergence_deg": 0.3, "returns": "two"}


def points(config: LidarConfig, number: int = 0) -> NDArray[np.void]:
    """Points of a scan as a cloud has them."""
    scan = Lidar(config, SCENE).measured(at(0, 0, 0), number=number)
    own = {name: values for name, values in scan._asdict().items() if values.ndim == 1} | dict(
        zip("xyz", scan.xyz.T, strict=True)
    )
    rows = np.zeros(len(scan.label), [(name, values.dtype) for name, values in own.items()])
    for name, values in own.items():
        rows[name] = values
    return rows


def check(stated: LidarConfig, cloud: NDArray[np.void]) -> Check:
    """Result of the check of a cloud against what its configuration states."""
    tally = NoiseTally()
    tally.add(stated, cloud, Lidar(stated, SCENE).echoes(at(0, 0, 0)), stated.columns)
    return tally.result()


@pytest.mark.parametrize("more", [{}, WIDE])
def test_the_stated_noise_passes(more: dict[str, Any]) -> None:
    config = LidarConfig(columns=512, signal=signal_of({**SHEET, **more}))
    result = check(config, points(config))
    assert result.passed, result.text


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"range_noise": [[12.0, 0.11], [100.0, 0.0143], [360.0, 0.004]]}, "range_noise"),
        ({"range_noise": [[12.0, 0.09], [100.0, 0.0117], [360.0, 0.0032]]}, "range_noise"),
        ({"reach": [[0.3, 44.0]]}, "reach"),
        ({"reach": [[0.3, 46.0]]}, "reach"),
    ],
)
def test_another_noise_than_stated_fails(change: dict[str, Any], rule: str) -> None:
    """A tenth more or less of the deviation, 2 % of the reach."""
    cloud = points(LidarConfig(columns=512, signal=signal_of({**SHEET, **change})))
    result = check(LidarConfig(columns=512, signal=signal_of(SHEET)), cloud)
    assert result.passed is False
    assert rule in result.text


@pytest.mark.parametrize("bias", [-0.004, 0.004])
def test_a_bias_of_4_mm_fails(bias: float) -> None:
    config = LidarConfig(columns=512, signal=signal_of(SHEET))
    cloud = points(config)
    for axis in "xyz":
        cloud[axis] *= 1.0 + bias / cloud["range_m"]
    result = check(config, cloud)
    assert result.passed is False
    assert "bias" in result.text


@pytest.mark.parametrize("more", [{}, WIDE])
def test_points_at_their_true_ranges(more: dict[str, Any]) -> None:
    """The ideal points of the rays that return, to the last bit, one of a ray."""
    config = LidarConfig(columns=512, signal=signal_of({**SHEET, **more}))
    directions = ray_directions(config).reshape(-1, 3)
    found = ideal_points(points(config), config, directions)
    ideal = IdealLidar(LidarConfig(columns=512), SCENE).scan(at(0, 0, 0))
    ray = found["column"].astype(int) * 64 + found["ring"]
    assert (np.diff(ray) > 0).all()
    rows = np.searchsorted(ideal.column.astype(int) * 64 + ideal.ring, ray)
    assert np.stack([found[axis] for axis in "xyz"], axis=-1).tobytes() == ideal.xyz[rows].tobytes()
    assert len(found) > 20_000


@pytest.mark.parametrize("signal", [None, {**SHEET, **WIDE}])
def test_threads_change_no_bit_of_a_scan(signal: dict[str, Any] | None) -> None:
    """Each traces a span of columns, here of 509, with poses of a LiDAR that moves."""
    config = LidarConfig(columns=509, signal=None if signal is None else signal_of(signal))
    poses = np.stack([at(0.001 * k, 0.0005 * k, 0.0) for k in range(510)])
    one, many = Lidar(config, SCENE), Lidar(config, SCENE)
    many.workers = 3
    for number in range(2):
        for ours, theirs in zip(one.scan(poses, 0, number), many.scan(poses, 0, number), strict=True):
            np.testing.assert_array_equal(ours, theirs)
        assert len(one.scan(poses).xyz) > 2_000

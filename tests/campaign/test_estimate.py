# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Estimates follow from figures by known sums."""

from typing import Any

import pytest
from record_fakes import make_experiment

from fieldtruth.campaign.draw import simulated_s
from fieldtruth.campaign.estimate import Figures, combined, grouped
from fieldtruth.campaign.state import clock, size
from fieldtruth.experiment.config import Experiment, random_route
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.sensors.lidar.config import LidarConfig

FIGURES = Figures(world_s=100, fixed_s=10, drive_s_per_s=0.5, sense_s_per_s=4, bytes_once=7, bytes_per_s=1000, memory=3)


def experiment(seconds: float | None = 20, **values: Any) -> Experiment:
    return make_experiment().model_copy(update={"seconds": seconds} | values)


def test_time_bytes_and_memory_are_sums() -> None:
    group = [experiment(20), experiment(30, seed=1), experiment(10)]
    found = combined([group], [FIGURES], jobs=1, workers=2)
    # one world apart from the measured one, three runs with 7 B of their own, 60 s at 0.5 + 4 / 2
    assert found == (100 + 3 * 10 + 60 * 2.5, 60_021, 3, 0)
    assert combined([group], [FIGURES], jobs=2, workers=2) == (280 / 2, 60_021, 6, 0)
    assert combined([group], [FIGURES], jobs=8, workers=2) == (280 / 3, 60_021, 9, 0)


def test_runs_that_cannot_be_measured_are_counted() -> None:
    assert combined([[experiment()] * 3, [experiment()]], [None, FIGURES], jobs=1, workers=1).unknown == 3


def test_groups_are_environments_and_few_rigs() -> None:
    rigs = [paper_rig(lidar=LidarConfig(rings=8 + k)) for k in range(9)]
    few = [experiment(environment=e, rig=rig) for e in ("park", "lake") for rig in rigs[:2]]
    assert [len(group) for group in grouped(few * 3)] == [3] * 4
    many = [experiment(environment=e, rig=rig) for e in ("park", "lake") for rig in rigs]
    assert [len(group) for group in grouped(many)] == [9, 9]


def test_random_routes_and_given_ones_are_measured_apart() -> None:
    planned = experiment(route=random_route(50, 1))
    assert grouped([experiment(), planned, experiment(3)]) == [[experiment(), experiment(3)], [planned]]


def test_simulated_time_ends_with_the_route_or_earlier() -> None:
    speed = experiment().control.speed
    assert simulated_s(experiment(None)) == pytest.approx(10 / speed, rel=1e-5)
    assert simulated_s(experiment(3)) == 3
    assert simulated_s(experiment(None, route=random_route(150, 1))) == pytest.approx(150 / speed)


def test_times_and_sizes_are_short() -> None:
    assert [clock(t) for t in (0.4, 89, 91, 5340, 19_200)] == ["0 s", "89 s", "2 min", "89 min", "5 h 20 min"]
    assert [size(count) for count in (0, 3_440_000, 999e6, 212.4e9)] == ["0.0 MB", "3.4 MB", "999.0 MB", "212.4 GB"]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The time left, from manifests with given times: worlds and their light count once."""

import pytest

from fieldtruth.campaign.draw import PlannedRun
from fieldtruth.campaign.state import Kind, Manifest, State, time_left_s
from fieldtruth.experiment.config import Experiment


def planned(environment: str, seed: int, seconds: float, **light: float) -> PlannedRun:
    frames = {"count": round(seconds * 10)}  # 0.1 s each
    values = {"name": "x", "environment": environment, "seed": seed, "frames": frames, "light": light}
    return PlannedRun("", Experiment.model_validate(values))


def done(run: PlannedRun, seconds: float, took_s: float, world_s: float) -> State:
    manifest = Manifest(
        fieldtruth="1",
        experiment="0" * 64,
        bag="x.bag",
        bytes=1,
        sha256="0" * 64,
        messages={},
        simulated_s=seconds,
        took_s=took_s,
        world_s=world_s,
    )
    return State(run, Kind.DONE, manifest=manifest)


def left(*runs: PlannedRun) -> list[State]:
    return [State(run, Kind.MISSING) for run in runs]


def test_a_first_run_that_built_its_world_does_not_stand_for_the_others() -> None:
    first = done(planned("park", 0, 2.0), seconds=2.0, took_s=104.0, world_s=100.0)  # 2 s per second
    rest = [planned("park", 0, 10.0)] * 5
    assert time_left_s([first, *left(*rest)], jobs=1) == pytest.approx(5 * 10 * 2)
    assert time_left_s([first, *left(*rest)], jobs=4) == pytest.approx(5 * 10 * 2 / 4)
    assert time_left_s([first, *left(rest[0])], jobs=4) == pytest.approx(10 * 2)


def test_each_new_world_and_each_new_light_is_built_once() -> None:
    first = done(planned("park", 0, 2.0), seconds=2.0, took_s=104.0, world_s=100.0)
    rest = [planned("park", seed, 1.0) for seed in (0, 1, 1)] + [planned("park", 0, 1.0, sun_elevation_deg=20.0)]
    assert time_left_s([first, *left(*rest)], jobs=1) == pytest.approx(4 * 1 * 2 + 2 * 100)


def test_reading_a_world_again_is_part_of_a_run() -> None:
    runs = [planned("park", 0, 2.0)] * 2
    made = [done(runs[0], 2.0, took_s=104.0, world_s=100.0), done(runs[1], 2.0, took_s=6.0, world_s=2.0)]
    assert time_left_s([*made, *left(runs[0])], jobs=1) == pytest.approx(2 * (4 + 6) / 4)


def test_a_run_that_was_found_finished_says_nothing() -> None:
    run = planned("park", 0, 2.0)
    found = done(run, 2.0, took_s=0.1, world_s=0.0)
    assert time_left_s([found, *left(run)], jobs=1) is None
    made = done(run, 2.0, took_s=14.0, world_s=10.0)
    assert time_left_s([found, made, *left(run)], jobs=1) == pytest.approx(4)


def test_environments_have_their_own_speed_and_one_without_a_run_that_of_all() -> None:
    made = [
        done(planned("park", 0, 1.0), 1.0, took_s=12.0, world_s=10.0),
        done(planned("lake", 0, 1.0), 1.0, took_s=34.0, world_s=30.0),
    ]
    assert time_left_s([*made, *left(planned("park", 0, 1.0))], jobs=1) == pytest.approx(2)
    assert time_left_s([*made, *left(planned("lake", 1, 1.0))], jobs=1) == pytest.approx(4 + 30)
    assert time_left_s([*made, *left(planned("forest", 0, 1.0))], jobs=1) == pytest.approx(3 + 20)
    assert time_left_s(left(planned("park", 0, 1.0)), jobs=1) is None
    assert time_left_s(made, jobs=1) == 0

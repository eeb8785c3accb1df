# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds of a simulation that is stepped, and their comparison with a bag of the same experiment."""

import pickle
from pathlib import Path

import numpy as np

from fieldtruth.bag.run import open_run
from fieldtruth.core.readings import Cloud
from fieldtruth.simulation.stepped import Simulation


def clouds_of(simulation: Simulation, steps: list[float], sensor: str = "lidar") -> list[Cloud]:
    simulation.reset()
    return [cloud for seconds in steps for cloud in simulation.step(seconds).all.get(sensor, ())]


def alike(one: Cloud, other: Cloud) -> bool:
    return all(np.array_equal(getattr(one, key), getattr(other, key)) for key in ("xyz", "label", "instance"))


def check_steps(simulation: Simulation, run: Path) -> list[Cloud]:
    """Check 1.25 s in uneven steps against a run, and that going back to a pickled state changes nothing.

    Returns the clouds.
    """
    recorded = open_run(run)["lidar"]
    one = clouds_of(simulation, [0.003, 0.4, 0.117, 0.73])
    assert len(one) == len(recorded) == 12
    assert all(alike(each, recorded[k]) for k, each in enumerate(one))
    clouds_of(simulation, [0.615])
    state = pickle.loads(pickle.dumps(simulation.save()))
    after = simulation.step(0.3).all["lidar"]
    simulation.restore(state)
    assert all(map(alike, simulation.step(0.3).all["lidar"], after))
    return one

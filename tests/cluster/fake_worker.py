# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Preloaded by the tests' workers: fake worlds and sensors, and what a test asks for in the environment.

``FAKE_PAUSE`` is the time [s] of a camera image, ``FAKE_GATE`` a file for which the sensors wait, ``FAKE_VERSION``
another version of the package, ``FAKE_OBJECTS`` the number of objects in the world, and ``FAKE_ERROR`` the text of a
RouteError instead of a drive.
"""

import os
import time
from pathlib import Path

import pytest
import record_fakes
from distributed import Worker

import fieldtruth
from fieldtruth.cluster import worker as tasks
from fieldtruth.core.errors import RouteError
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.world.model import World


def dask_setup(worker: Worker) -> None:
    """Called by Dask when the worker starts."""
    patch = pytest.MonkeyPatch()
    record_fakes.use_fakes(patch)
    objects = int(os.environ.get("FAKE_OBJECTS", "5"))
    patch.setattr(tasks, "world_of", lambda e: record_fakes.make_world(e.environment, e.seed, objects))
    patch.setattr(record_fakes.FakeCamera, "pause", float(os.environ.get("FAKE_PAUSE", "0")))
    patch.setattr(fieldtruth, "__version__", os.environ.get("FAKE_VERSION", fieldtruth.__version__))
    if "FAKE_GATE" in os.environ:
        patch.setattr(record_fakes.FakeScene, "__init__", wait_for_gate)
    if "FAKE_ERROR" in os.environ:
        patch.setattr("fieldtruth.simulation.motion.plan_and_drive", refuse)


def wait_for_gate(scene: record_fakes.FakeScene, world: World, *_: object) -> None:
    scene.world = world
    while not Path(os.environ["FAKE_GATE"]).exists():
        time.sleep(0.05)


def refuse(world: World, experiment: Experiment, _: object) -> Track:
    raise RouteError(os.environ["FAKE_ERROR"])


def opened_runs() -> int:
    """Number of runs of which this worker made slices."""
    return len(tasks._slices._values)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What many tests read and none may change, made once."""

from pathlib import Path

import pytest

from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.world.model import World


@pytest.fixture(scope="session")
def small_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of 1.2 s of park_1 with depth and instances, images of 320 x 184. Copy what you want to change."""
    from fieldtruth.pipeline import generate

    values = load_experiment("park_1").model_dump()
    values["seconds"] = 1.2
    values["rig"]["cameras"] |= {"width": 320, "height": 184, "depth": True, "instances": True}
    return generate(Experiment.model_validate(values), tmp_path_factory.mktemp("small_run")).parent


@pytest.fixture(scope="session")
def flat_world() -> World:
    """Nothing but level ground."""
    from drive_worlds import make_world

    return make_world()


@pytest.fixture(scope="session")
def winding_track() -> Track:
    """A drive with turns both ways over rolling ground."""
    from drive_worlds import hills, make_experiment, make_world

    from fieldtruth.drive.simulate import drive

    route = make_experiment([(5.0, 2.0), (9.0, -3.0), (5.0, -7.0), (0.0, -4.0)], start=(0.0, 0.0))
    return drive(make_world(hills), route)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
import pytest
from drive_worlds import hills, make_experiment, make_world

from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Track
from fieldtruth.world.model import World


@pytest.fixture(scope="session")
def flat_world() -> World:
    return make_world()


@pytest.fixture(scope="session")
def winding_track() -> Track:
    """A drive with turns both ways over rolling ground."""
    route = make_experiment([(5.0, 2.0), (9.0, -3.0), (5.0, -7.0), (0.0, -4.0)], start=(0.0, 0.0))
    return drive(make_world(hills), route)

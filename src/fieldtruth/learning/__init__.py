# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Environments of Gymnasium in which a robot learns to drive; to import this package registers them.

Raises:
    ConfigurationError: Gymnasium is not installed.
"""

from fieldtruth.world.build import needed_libraries

with needed_libraries():
    import gymnasium

from fieldtruth.learning.environment import TEST_WORLDS as TEST_WORLDS
from fieldtruth.learning.environment import Explore, Follow, Reach
from fieldtruth.learning.rewards import WEIGHTS as WEIGHTS
from fieldtruth.learning.senses import OBSERVATIONS as OBSERVATIONS

for _task in (Reach, Follow, Explore):
    gymnasium.register(
        id=f"fieldtruth/{_task.__name__}-v0",
        entry_point=f"{_task.__module__}:{_task.__name__}",
        nondeterministic=False,
    )

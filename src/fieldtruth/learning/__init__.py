# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Environments of Gymnasium in which a robot learns to drive; to import this package registers them.

Raises:
    ConfigurationError: Gymnasium is not installed.
"""

from fieldtruth.core.errors import ConfigurationError

try:
    import gymnasium
except ModuleNotFoundError as error:
    text = "the library gymnasium is not installed; run: pip install 'fieldtruth[rl]'"
    raise ConfigurationError(text) from error

from fieldtruth.learning.config import LearningConfig as LearningConfig
from fieldtruth.learning.environment import Explore, Follow, Reach

for _task in (Reach, Follow, Explore):
    gymnasium.register(id=f"fieldtruth/{_task.__name__}-v0", entry_point=f"{_task.__module__}:{_task.__name__}")

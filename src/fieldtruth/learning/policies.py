# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Policies: functions from an observation to an action. Two followers without sensors, and those of users."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.user_code import named_function
from fieldtruth.learning.config import LearningConfig

Act = Callable[[Any], Any]
_SPEED: Final = 0.8
"""Share of the greatest speed at which the followers drive."""


def _towards(ahead: float, left: float) -> NDArray[np.float32]:
    """Action that drives to a point in the robot's frame, and first turns to it where it stands."""
    angle = float(np.arctan2(left, ahead))
    return np.array([_SPEED * max(0.0, 1.0 - abs(angle)), np.clip(angle, -1.0, 1.0)], np.float32)


def straight_follower(state: NDArray[np.float32]) -> NDArray[np.float32]:
    """Drive to the goal of ``state`` in a straight line, as the paper's follower does between waypoints."""
    return _towards(float(state[0]), float(state[1]))


def path_follower(privileged: NDArray[np.float32]) -> NDArray[np.float32]:
    """Drive along the planner's path of ``privileged`` on the true map; an upper bound for what sensors allow."""
    along = privileged[15:17]  # behind the state of a robot with four wheels, and its position
    return straight_follower(privileged) if not along.any() else _towards(float(along[0]), float(along[1]))


BUILT_IN: Final = {"straight": (straight_follower, "state"), "path": (path_follower, "privileged")}
"""Followers by name, each with what it observes."""


@dataclass(frozen=True)
class Policy:
    """A policy by its name, which another process can load.

    Attributes:
        name: a follower's name, or ``FILE.py:NAME`` or ``MODULE:NAME`` of a function or a class; a class is made anew
            for each episode, and is called.
        observation: what it observes: a name makes a Box, several a Dict.
    """

    name: str
    observation: str | tuple[str, ...]

    def load(self) -> Callable[[], Act]:
        """Return what makes the function for an episode.

        Raises:
            UnknownNameError, ConfigurationError: it does not exist, or cannot be loaded.
        """
        if self.name in BUILT_IN:
            return lambda: BUILT_IN[self.name][0]
        found = _loaded(self.name)
        return found if isinstance(found, type) else lambda: found

    def begin(self, env: object) -> Act:
        """Return the function for an episode that has begun; raises as ``load``."""
        return self.load()()

    @property
    def digest(self) -> str:
        """First twelve digits of the SHA-256 digest of its file; empty if no file is named."""
        path = Path(self.name.rpartition(":")[0])
        return hashlib.sha256(path.read_bytes()).hexdigest()[:12] if path.suffix == ".py" else ""


def policy_of(name: str, observation: Sequence[str] | None = None) -> Policy:
    """Return a policy that can be loaded; it observes ``observation``, or what its attribute of this name says.

    Raises:
        UnknownNameError, ConfigurationError: policy or observation do not exist.
    """
    said: Any = BUILT_IN[name][1] if name in BUILT_IN else getattr(_loaded(name), "observation", "state")
    if observation is not None:
        said = observation[0] if len(observation) == 1 else tuple(observation)
    return Policy(name, LearningConfig.of({"observation": said}).observation)


def call(name: str, act: Act, observation: Any) -> Any:
    """Return the action of the policy of a name; raises ConfigurationError with its name if it fails."""
    try:
        return act(observation)
    except Exception as error:  # it is the user's code
        raise ConfigurationError(f"policy {name}: {type(error).__name__}: {error}") from error


def _loaded(name: str) -> Any:
    """Return what FILE.py:NAME or MODULE:NAME is; raises as ``Policy.load``."""
    return named_function("policy", name, BUILT_IN)

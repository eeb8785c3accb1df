# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes that a policy drives, one after another: what was seen, done and got."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.learning.config import LearningConfig
from fieldtruth.learning.policies import Policy, call

Env = gymnasium.Env[Any, Any]


class Episode(NamedTuple):
    """An episode of n steps of control."""

    seed: int | None  # given to ``reset``
    seen: Mapping[str, NDArray[Any]]  # (n + 1, ...) by name: before each step, and after the last one
    actions: Float32Array  # (n, 2)
    rewards: list[float]
    terminated: list[bool]
    truncated: list[bool]
    success: bool


@dataclass(frozen=True)
class Drives:
    """Episodes that a policy is to drive.

    Attributes:
        policy: what drives; it may observe what is not recorded.
        task: Reach, Follow or Explore.
        episodes: their number.
        seed: of the episodes.
        arguments: those of the environment; ``observation`` is what is recorded.
    """

    policy: Policy
    task: str = "Reach"
    episodes: int = 100
    seed: int = 0
    arguments: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def config(self) -> LearningConfig:
        """Arguments of the environment but ``world``; raises ConfigurationError or UnknownNameError."""
        return LearningConfig.of({key: value for key, value in self.arguments.items() if key != "world"})

    @property
    def parts(self) -> tuple[str, ...]:
        """Environment, task, policy and split, as parts of names of files."""
        driver = "".join(each if each.isalnum() else "_" for each in self.policy.name)
        return Path(self.config.environment).stem, self.task.lower(), driver, self.config.split

    @property
    def about(self) -> str:
        """Say what it is."""
        where = f"{self.config.environment}, {self.config.split}"
        return f"{self.episodes} episodes of {self.task} in {where}, seed {self.seed}"

    def environment(self) -> Env:
        """Return an environment that observes what is recorded and what the policy sees, as a Dict."""
        seen = LearningConfig.of({"observation": self.policy.observation}).names
        both = tuple(dict.fromkeys(self.config.names + seen))
        return gymnasium.make(f"fieldtruth/{self.task}-v0", **{**self.arguments, "observation": both})

    def drive(self, env: Env, progress: Progress | None = None) -> Iterator[Episode]:
        """Drive the episodes, which have what is recorded; raises ConfigurationError if the policy fails."""
        with (progress or Silent()).stage(f"drive {self.episodes} episodes", float(self.episodes)) as advance:
            for number in range(self.episodes):
                yield self._drive(env, self.seed if number == 0 else None)
                advance(1.0)

    def _drive(self, env: Env, seed: int | None) -> Episode:
        act, (seen, info) = self.policy.load()(), env.reset(seed=seed)
        observations, actions = [seen], list[Any]()
        rewards, ends = list[float](), list[tuple[bool, bool]]()
        while not (ends and any(ends[-1])):
            actions.append(np.asarray(call(self.policy.name, act, part_of(seen, self.policy.observation)), np.float32))
            seen, reward, terminated, truncated, info = env.step(actions[-1])
            observations.append(seen)
            rewards.append(float(reward))
            ends.append((terminated, truncated))
        terminations, truncations = zip(*ends, strict=True)
        columns = {name: np.stack([each[name] for each in observations]) for name in self.config.names}
        success = bool(info["metrics"]["success"])
        return Episode(seed, columns, np.stack(actions), rewards, [*terminations], [*truncations], success)


def part_of(observation: Mapping[str, Any], names: str | tuple[str, ...]) -> Any:
    """Return an observation: that of one name, or a mapping of several."""
    return observation[names] if isinstance(names, str) else {name: observation[name] for name in names}

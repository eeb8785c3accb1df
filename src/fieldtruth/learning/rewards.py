# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The reward of a step and the metrics of an episode: docs/learning.md has the formulas."""

from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.fields import Frozen, Number
from fieldtruth.learning.robot import Happened, Now


class Weights(Frozen):
    """Weights of the reward's terms."""

    progress: Number = 1.0  # per metre of the planner's path that is left; Explore: per square metre that is seen first
    straight: Number = 0.0  # per metre of the straight line to the goal that is left
    time: Number = -0.1  # per second
    hit: Number = -0.2  # per joule of the hardest hit in the step
    tilt: Number = -0.02  # per degree above LEVEL_DEG and second
    change: Number = -0.05  # per squared change of the action, each part as a share of its range
    reached: Number = 10.0  # once
    failed: Number = -10.0  # once, if the episode ends otherwise than by the goal or by the time


LEVEL_DEG: Final = 15.0
"""Tilt [deg] without a cost."""


class Step(NamedTuple):
    """What a step of control is rewarded for."""

    seconds: float
    progress: float  # [m], or [m^2]
    straight: float  # [m]
    change: Array  # (2,) of the action, shares of its range
    happened: Happened
    now: Now
    reached: bool
    failed: bool


def reward_terms(step: Step, weights: Weights) -> dict[str, float]:
    """Return the terms of the reward, which is their sum."""
    values = {
        "progress": step.progress,
        "straight": step.straight,
        "time": step.seconds,
        "hit": step.happened.hit,
        "tilt": max(0.0, step.now.tilt_deg - LEVEL_DEG) * step.seconds,
        "change": float(step.change @ step.change),
        "reached": float(step.reached),
        "failed": float(step.failed),
    }
    return {name: getattr(weights, name) * value for name, value in values.items()}


class EpisodeMetrics:
    """Sums of an episode whose shortest path is ``shortest`` [m]."""

    def __init__(self, start: Array, shortest: float) -> None:
        self._at, self._shortest = np.array(start), shortest
        self._steps, self._reward, self._length, self._work, self._touches = 0, 0.0, 0.0, 0.0, 0
        self._tilt, self._tilts, self._change, self._hit = 0.0, 0.0, 0.0, 0.0

    def add(self, step: Step, reward: float) -> None:
        """Take a step into account."""
        self._steps += 1
        self._reward += reward
        self._length += float(np.linalg.norm(step.now.xy - self._at))
        self._at = step.now.xy.copy()
        self._work += step.happened.work
        self._touches += step.happened.touches
        self._hit = max(self._hit, step.happened.hit)
        tilt = step.now.tilt_deg
        self._tilt, self._tilts = max(self._tilt, tilt), self._tilts + tilt
        self._change += float(np.abs(step.change).mean())

    def result(self, seconds: float, *, success: bool) -> dict[str, Any]:
        """Return the metrics of the whole episode; ``spl`` is success weighted by path length (Anderson 2018)."""
        steps = max(self._steps, 1)
        longer = max(self._length, self._shortest)
        return {
            "success": success,
            "spl": success * (self._shortest / longer if longer and self._shortest else 1.0),
            "seconds": seconds,
            "length_m": self._length,
            "shortest_m": self._shortest,
            "energy_j": self._work,
            "max_tilt_deg": self._tilt,
            "mean_tilt_deg": self._tilts / steps,
            "smoothness": 1.0 - self._change / steps,
            "collisions": self._touches,
            "hardest_hit_j": self._hit,
            "reward": self._reward,
        }

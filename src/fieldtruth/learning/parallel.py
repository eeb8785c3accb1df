# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Several robots in one world, each with a goal of its own, as a parallel environment of PettingZoo.

Each robot has a physics of its own, in which the others are obstacles that are moved. A step of control is made in
parts of ``PART_MS``: at the start of each, every robot meets the others where they are then, so that no order matters.
"""

import math
from collections.abc import Mapping
from itertools import combinations
from typing import Any, ClassVar, Final

import gymnasium
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, RouteError, UnknownNameError
from fieldtruth.learning import tasks
from fieldtruth.learning.environment import OPTIONS, PLACES, Reach, check_options
from fieldtruth.world.model import World

try:
    from pettingzoo import ParallelEnv
except ModuleNotFoundError as error:
    text = "the library pettingzoo is not installed; run: pip install 'fieldtruth[rl]'"
    raise ConfigurationError(text) from error

MOST: Final = 8
"""Robots in a world."""
PART_MS: Final = 10
"""Time [ms] for which the other robots stand still."""


class _Agent(Reach):
    """One of several robots, which observes the others where they are in ``poses`` (world_from_base by name)."""

    def __init__(self, name: str, poses: Mapping[str, Array], names: list[str], **values: Any) -> None:
        super().__init__(**values)
        self._name, self._together, self._poses = name, tuple(names), poses

    def observed(self) -> Any:
        """Return the observation."""
        self._place()
        return super().observed()

    def render(self) -> NDArray[Any] | None:
        """Return the photograph from behind the robot."""
        self._place()
        return super().render()

    def _place(self) -> None:
        self.senses.others = {name: pose for name, pose in self._poses.items() if name != self._name}


class ReachTogether(ParallelEnv):  # type: ignore[misc]
    """Robots that drive to goals of their own on ways that cross; docs/learning.md says what is as in ``Reach``.

    Args:
        robots: how many, from 2 to ``MOST``; they are robot_0, robot_1 and so on.
        environment: a name from ``list_environments``, or an environment's file.
        world: a world that replaces those of the environment.
        render_mode: as of ``Reach``, of robot_0.
        arguments: those of ``LearningConfig``.

    Raises:
        ConfigurationError, UnknownNameError: a value that is not allowed.
        OutputError: there is no viewer.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "fieldtruth_reach_together_v0",
        "is_parallelizable": True,
        **Reach.metadata,
    }

    def __init__(
        self,
        robots: int = 3,
        environment: str = "park",
        *,
        world: World | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        if isinstance(robots, bool) or not isinstance(robots, int) or not 2 <= robots <= MOST:
            raise ConfigurationError(f"robots must be a whole number from 2 to {MOST}, got {robots!r:.60}")
        self.possible_agents = [f"robot_{number}" for number in range(robots)]
        self.agents: list[str] = []
        self.render_mode = render_mode
        self._poses: dict[str, Array] = {}
        values = {**arguments, "environment": environment, "world": world}
        self.robots: dict[str, Reach] = {
            name: _Agent(name, self._poses, self.possible_agents, **values, render_mode=None if number else render_mode)
            for number, name in enumerate(self.possible_agents)
        }
        """Environment of each robot."""
        self._first = self.robots[self.possible_agents[0]]
        config = self._first.config
        part = max(1, PART_MS // config.physics_ms)
        self._parts = [min(part, config.steps - done) for done in range(0, config.steps, part)]

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of a robot's observations."""
        return self._robot(agent).observation_space

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of a robot's actions."""
        return self._robot(agent).action_space

    def _robot(self, name: str) -> Reach:
        if name not in self.robots:
            raise UnknownNameError("agent", str(name), self.possible_agents)
        return self.robots[name]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin an episode of all robots.

        Args:
            seed: of what is drawn from now on, as of ``Reach``.
            options: ``difficulty``, ``world`` (a seed), and ``start``, ``goal``, ``heading`` of single robots:
                ``{"robot_0": {"start": (0.0, 0.0), "heading": 0.0}}``.

        Raises:
            UnknownNameError, ConfigurationError: an option that is not allowed.
            RouteError: no starts and goals in this world, or given ones that are blocked, not connected or too near.
        """
        chosen = {name: value for name, value in (options or {}).items() if name != "options"}  # of parallel_api_test
        check_options(chosen, [*(name for name in OPTIONS if name not in PLACES), *self.possible_agents])
        for name in self.possible_agents:
            check_options(chosen.setdefault(name, {}), PLACES)
        made, difficulty = self._first.draw(seed, chosen)
        drawn = tasks.crossing_tasks(made, difficulty, len(self.robots), self._first.np_random)
        for (name, robot), task in zip(self.robots.items(), drawn, strict=True):
            robot.begin(made, robot.with_given(made, task, chosen[name]))
        self._check_starts(2.0 * math.hypot(*made.rig.robot.outline[:2]))
        self.agents = [*self.possible_agents]
        self._locate()
        return (
            {name: robot.observed() for name, robot in self.robots.items()},
            {name: robot.begun(difficulty) for name, robot in self.robots.items()},
        )

    def _check_starts(self, least: float) -> None:
        for (name, one), (other_name, other) in combinations(self.robots.items(), 2):
            if (gap := math.dist(one.task.start, other.task.start)) < least:
                raise RouteError(
                    f"{name} and {other_name} start {gap:.2f} m from each other; allowed are {least:.2f} m"
                )

    def _locate(self) -> None:
        self._poses.update({name: robot.robot.physics.world_from_base for name, robot in self.robots.items()})

    def _meet(self) -> None:
        """Put all robots where they are, for each other; those that have ended stand there."""
        self._locate()
        twists = {name: self.robots[name].robot.physics.twist for name in self.agents}
        for name in self.agents:
            others = {other: pose for other, pose in self._poses.items() if other != name}
            self.robots[name].robot.physics.meet(others, twists)

    def step(
        self, actions: Mapping[str, ArrayLike]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive all robots for a step of control; ``info`` of each is as in ``Reach``.

        A robot that has ended is an obstacle, where it is, and is no longer in ``agents``.

        Args:
            actions: of each robot in ``agents``.

        Raises:
            UnknownNameError, ConfigurationError: an action is missing, of a robot that has none, or is not allowed.
        """
        if not self._poses:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        for name in {**actions, **dict.fromkeys(self.agents)}:
            if name not in self.agents or name not in actions:
                known = ", ".join(self.agents) or "none, as all have ended: call reset()"
                raise ConfigurationError(
                    f"actions must be those of {known}; got those of {', '.join(actions) or 'none'}"
                )
        driving = {name: self.robots[name] for name in self.agents}
        for name, env in driving.items():
            env.robot.head_for(env.command(actions[name]))
        for count in self._parts:
            self._meet()
            for env in driving.values():
                env.robot.physics.drive(count)
        happened = {name: env.robot.happened() for name, env in driving.items()}
        self._locate()
        found = {name: env.outcome(happened[name]) for name, env in driving.items()}
        self.agents = [
            name for name, (_, _, terminated, truncated, _) in found.items() if not (terminated or truncated)
        ]
        by_kind: Any = [dict(zip(found, values, strict=True)) for values in zip(*found.values(), strict=True)]
        return tuple(by_kind or [{}] * 5)

    def render(self) -> NDArray[Any] | None:
        """Return the photograph (270, 480, 3) from behind robot_0."""
        return self._first.render()

    def close(self) -> None:
        """End the viewer's recording."""
        self._first.close()


parallel_env: Final = ReachTogether
"""As PettingZoo's modules name it."""

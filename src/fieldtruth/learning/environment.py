# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The environments: a task, a robot that is driven for a step of control, observation, reward and end."""

import json
from abc import abstractmethod
from collections.abc import Collection, Mapping
from typing import Any, ClassVar, Final

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, RouteError, UnknownNameError
from fieldtruth.drive.physics import Command, skid_compensation
from fieldtruth.drive.routes import NODE
from fieldtruth.drive.track import STEP_NS
from fieldtruth.kernels.height_maps import mark_seen
from fieldtruth.learning import tasks
from fieldtruth.learning.config import LearningConfig
from fieldtruth.learning.rewards import EpisodeMetrics, Step, reward_terms
from fieldtruth.learning.robot import EpisodeRobot, Happened
from fieldtruth.learning.senses import Senses, rigs_of
from fieldtruth.learning.task_world import TaskWorld, kept
from fieldtruth.learning.tasks import Task
from fieldtruth.learning.viewer import Viewer
from fieldtruth.world.build import check_experiment, load_world
from fieldtruth.world.model import World

REACHED: Final = "reached"
TIME: Final = "time"
OFF_TRAIL: Final = "off the trail"
ARRIVAL: Final = 1.0
"""Distance [m] from the goal, or length of path to it, at which it is reached."""
_OFF: Final = 3.0  # [m] from the trail's edge
_SEEN: Final = 0.8  # share of the free ground that Explore asks for
PLACES: Final = ("start", "goal", "heading")
OPTIONS: Final = ("difficulty", *PLACES, "world")
"""Of ``reset``."""


class FieldEnv(gymnasium.Env[Any, Any]):
    """A robot with a task in one of our worlds; docs/learning.md says what its observations and rewards are.

    Args:
        environment: a name from ``list_environments``, or an environment's file.
        world: a world that replaces those of the environment.
        render_mode: ``rgb_array``, a photograph from behind the robot, ``human``, the rerun viewer, or None.
        arguments: those of ``LearningConfig``.

    Raises:
        ConfigurationError, UnknownNameError: a value that is not allowed.
        OutputError: there is no viewer.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 10}  # noqa: RUF012 (Gymnasium's name)
    has_goal: ClassVar[bool] = False

    def __init__(
        self,
        environment: str = "park",
        *,
        world: World | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        self.config = LearningConfig.of({"environment": environment, **arguments})
        self._given, self._experiment = world, self.config.experiment()
        if world is None:
            check_experiment(self._experiment)
        self.senses = Senses(self.config, rigs_of(self._experiment.rig, self.config.sensors), has_goal=self.has_goal)
        """What it observes."""
        self.observation_space = self.senses.space
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise UnknownNameError("render_mode", str(render_mode), self.metadata["render_modes"])
        self.render_mode = render_mode
        self._viewer = Viewer() if render_mode == "human" else None
        self.metadata = {**self.metadata, "render_fps": self.config.control_hz}
        self._seeds = (0,) if world is not None else self.config.seeds
        self._seed, self._episodes = self._seeds[0], 0
        self._robots: tuple[TaskWorld, EpisodeRobot] | None = None
        self._task: Task | None = None
        self._left = 0.0
        self._name, self._together = "", tuple[str, ...]()  # of several robots in a world

    @abstractmethod
    def _new_task(self, made: TaskWorld, difficulty: float) -> Task:
        """Choose start and goal."""

    def _progress(self) -> float:
        """Return what was gained in a step: by default metres of the planner's path."""
        left = self._current.left(self.robot.now.xy)
        gained = self._left - left if np.isfinite(left) else 0.0
        self._left = left if np.isfinite(left) else self._left
        return gained

    def _reached(self) -> bool:
        """Return whether the task is done."""
        return self._left < ARRIVAL

    def _own_cause(self) -> str:
        """Return why the task alone ends here; empty if it does not."""
        return ""

    @property
    def task(self) -> Task:
        """Start, goal, path lengths and hazard of the episode."""
        return self._current

    @property
    def _current(self) -> Task:
        if self._task is None:
            raise gymnasium.error.ResetNeeded("call reset() before step() or render()")
        return self._task

    @property
    def robot(self) -> EpisodeRobot:
        """The robot of the episode."""
        assert self._robots is not None
        return self._robots[1]

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of what is drawn from now on: worlds, tasks; equal seeds and actions give equal observations.
            options: ``difficulty``, ``world`` (a seed), ``start`` and ``goal`` (x, y [m]), ``heading`` [rad].

        Raises:
            UnknownNameError, ConfigurationError: an option that is not allowed.
            RouteError: no start and goal in this world, or given ones that are blocked or not connected.
        """
        chosen = dict(options or {})
        check_options(chosen, OPTIONS)
        made, difficulty = self.draw(seed, chosen)
        self.begin(made, self.with_given(made, self._new_task(made, difficulty), chosen))
        return self.observed(), self.begun(difficulty)

    def draw(self, seed: int | None, chosen: Mapping[str, Any]) -> tuple[TaskWorld, float]:
        """Draw the world and the difficulty of an episode; arguments as ``reset``, with a mapping."""
        super().reset(seed=seed)
        if seed is not None:
            self._episodes = 0
        if self._episodes % self.config.episodes_per_world == 0:
            self._seed = self._seeds[int(self.np_random.integers(len(self._seeds)))]
        self._episodes += 1
        made = self._world(int(chosen.get("world", self._seed)))
        given = self.config if "difficulty" not in chosen else LearningConfig.of({"difficulty": chosen["difficulty"]})
        return made, float(self.np_random.uniform(*given.range))

    def begun(self, difficulty: float) -> dict[str, Any]:
        """Return what is known of an episode that begins."""
        task = self._current
        return {
            "world": self.senses.world.seed,
            "difficulty": difficulty,
            "hazard": task.hazard,
            "shortest_m": task.shortest,
        }

    def with_given(self, made: TaskWorld, task: Task, chosen: Mapping[str, Any]) -> Task:
        """Return the task with what the options say."""
        if not {*PLACES} & {*chosen}:
            return task
        start, heading = _point("start", chosen, task.start), float(chosen.get("heading", task.heading))
        goal = _point("goal", chosen, task.start if task.goal is None else task.goal)
        if {"start", "goal"} & {*chosen}:
            found = tasks.given_task(made, start, goal, heading)
            return found if self.has_goal else tasks.changed(task, start=start, heading=heading)
        return tasks.changed(task, heading=heading)

    def begin(self, made: TaskWorld, task: Task) -> None:
        """Put the robot down in a world, and forget the episode before."""
        self._enter(made)
        self._task = task
        cause = self.robot.put_down(task.start, task.heading)
        if cause:
            raise RouteError(f"the robot cannot stand at x {task.start[0]:.1f} m, y {task.start[1]:.1f} m: {cause}")
        self.senses.begin(made, self.robot, task)
        self._left, self._action = task.left(self.robot.now.xy), np.zeros(2)
        self._straight = self._to_goal()
        robot = self._experiment.rig.robot
        usual = 20.0 + 4.0 * (task.shortest or 60.0) / robot.max_speed
        self._limit = self.config.time_limit or usual
        self._metrics = EpisodeMetrics(self.robot.now.xy, task.shortest)
        if self._viewer is not None:
            self._viewer.begin(made, task)

    def _world(self, seed: int) -> TaskWorld:
        experiment, given = self._experiment, self._given
        key = (id(given) if given is not None else (experiment.environment, json.dumps(dict(experiment.layout)), seed),
               experiment.rig.model_dump_json(), experiment.light.model_dump_json(), self._together)  # fmt: skip

        def make() -> TaskWorld:
            world = given if given is not None else load_world(experiment.environment, seed, experiment.layout)
            return TaskWorld(world, experiment.rig, experiment.light, self._together)

        return kept(key, make)

    def _enter(self, made: TaskWorld) -> None:
        if self._robots is None or self._robots[0] is not made:
            self._robots = None  # one in memory
            step_ns = self.config.physics_ms * STEP_NS
            others = [name for name in self._together if name != self._name]
            robot = EpisodeRobot(made.world, made.rig, step_ns, self.config.steps, others)
            self._robots = made, robot

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for a step of control; ``info["reward"]`` has the terms, at the end ``info["metrics"]`` the episode's.

        Args:
            action: as ``action_space``; cut at its limits.

        Raises:
            ConfigurationError: another number of values, or one that is not finite.
        """
        return self.outcome(self.robot.drive(self.command(action)))

    def outcome(self, happened: Happened) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Return what ``step`` returns, after the robot has driven."""
        progress, before = self._progress(), self._straight
        self._straight = self._to_goal()
        reached = self._reached()
        cause = happened.cause or (REACHED if reached else self._own_cause())
        done = self._step_of(happened, progress, before - self._straight, cause)
        terms = reward_terms(done, self.config.reward)
        reward = float(sum(terms.values()))
        self._metrics.add(done, reward)
        seconds = self.robot.seconds
        truncated = not cause and seconds >= self._limit - 1e-9
        info: dict[str, Any] = {"reward": terms, "cause": cause or (TIME if truncated else "")}
        if cause or truncated:
            info["metrics"] = self._metrics.result(seconds, success=cause == REACHED)
        return self.observed(), reward, bool(cause), truncated, info

    def observed(self) -> Any:
        """Return the observation, after it was shown."""
        seen = self.senses.read()
        if self._viewer is not None:
            named = seen if isinstance(seen, dict) else {self.config.names[0]: seen}
            self._viewer.show(self.robot.seconds, self.robot.now, self.senses.scan, named)
        return seen

    def _step_of(self, happened: Happened, progress: float, straight: float, cause: str) -> Step:
        return Step(
            seconds=self.config.steps * self.config.physics_ms / 1e3,
            progress=progress,
            straight=straight,
            change=self._change,
            happened=happened,
            now=self.robot.now,
            reached=cause == REACHED,
            failed=cause not in ("", REACHED),
        )

    def command(self, action: ArrayLike) -> Command:
        """Return the command of an action, and note its change as a share of its range."""
        shares = np.asarray(action, np.float64)
        if shares.shape != (2,) or not np.isfinite(shares).all():
            raise ConfigurationError(f"action must be two finite numbers, got {action!r:.60}")
        shares = np.clip(shares, -1.0, 1.0)
        self._change, self._action = (shares - self._action) / 2.0, shares
        robot, (first, second) = self._experiment.rig.robot, shares.tolist()
        if self.config.action == "speed":
            return Command(first * robot.max_speed, second * robot.max_turn_rate)
        turning = (second - first) / (2 * robot.wheels.half_track * skid_compensation(robot.wheels))
        return Command((first + second) / 2 * robot.max_speed, turning * robot.max_speed)

    def _to_goal(self) -> float:
        goal = self._current.goal
        return 0.0 if goal is None else float(np.linalg.norm(goal - self.robot.now.xy))

    def render(self) -> NDArray[np.uint8] | None:
        """Return the photograph (270, 480, 3) from behind the robot; the first one bakes the world's light."""
        return self.senses.rendered() if self.render_mode == "rgb_array" and self._current else None

    def close(self) -> None:
        """End the viewer's recording."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None


class Reach(FieldEnv):
    """Drive to a goal 10 to 60 m away, through obstacles, slopes and soft soil."""

    has_goal = True

    def _new_task(self, made: TaskWorld, difficulty: float) -> Task:
        return tasks.reach_task(made, difficulty, self.np_random)

    def _reached(self) -> bool:
        return self._straight < ARRIVAL


class Follow(FieldEnv):
    """Follow a trail that only the sensors show, to a point 10 to 60 m along it."""

    def _reached(self) -> bool:
        return self._left < 2.0 * ARRIVAL  # a trail is metres wide

    def _new_task(self, made: TaskWorld, difficulty: float) -> Task:
        return tasks.follow_task(made, difficulty, self.np_random)

    def _own_cause(self) -> str:
        assert self._robots is not None
        x, y = self.robot.now.xy
        return OFF_TRAIL if self._robots[0].world.terrain.trail_distance.at(x, y) > _OFF else ""


class Explore(FieldEnv):
    """See the free ground around the start, with the LiDAR, as soon as possible."""

    def _new_task(self, made: TaskWorld, difficulty: float) -> Task:
        return tasks.explore_task(made, difficulty, self.np_random)

    def begin(self, made: TaskWorld, task: Task) -> None:
        """Begin to see."""
        super().begin(made, task)
        assert task.wanted is not None
        self._unseen = task.wanted.copy()
        self._count = self._rest = int(task.wanted.sum())

    def _progress(self) -> float:
        seen = mark_seen(
            self._unseen, self._current.corner, NODE, self.senses.world_from_scanner, self.senses.cloud.xyz
        )
        self._rest -= seen
        return seen * NODE**2

    def _reached(self) -> bool:
        return self._rest <= (1.0 - _SEEN) * self._count


def check_options(chosen: Mapping[str, Any], known: Collection[str]) -> None:
    """Refuse options of other names with an UnknownNameError."""
    for name in chosen:
        if name not in known:
            raise UnknownNameError("option", name, known)


def _point(name: str, chosen: Mapping[str, Any], usual: Array) -> Array:
    point = np.asarray(chosen.get(name, usual), np.float64)
    if point.shape != (2,) or not np.isfinite(point).all():
        raise ConfigurationError(f"{name} must be x, y [m], got {chosen[name]!r:.60}")
    return point

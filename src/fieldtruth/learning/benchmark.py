# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A fixed benchmark of Reach: 400 tasks in 40 unseen worlds at three difficulties, and a policy's score on them.

``reach_v1.csv`` lists the tasks; benchmarks/reach_tasks.py drew them. A task is checked when it begins: the planner's
path must be as long as it was then, or the world is not the one of the list.
"""

import csv
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from itertools import groupby
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.errors import ConfigurationError, OutputError
from fieldtruth.core.files import output_errors, output_path, write_atomically
from fieldtruth.core.processes import as_done
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.learning.environment import TIME, Reach
from fieldtruth.learning.policies import Act, call

NAME: Final = "reach_v1"
_LIST: Final = resources.files("fieldtruth.learning") / f"{NAME}.csv"
_SAME_M: Final = 0.05
"""Greatest difference [m] of a path's length from that of the list."""
_NORMAL: Final = 1.959964
"""Quantile of the normal distribution for an interval of 95 %."""
Result = dict[str, Any]


class BenchmarkTask(NamedTuple):
    """A task of the list."""

    number: int
    environment: str
    world: int  # its seed
    difficulty: float
    start: tuple[float, float]  # [m]
    heading: float  # [rad]
    goal: tuple[float, float]  # [m]
    shortest: float  # [m] of the planner's path


class Driver(Protocol):
    """What drives the tasks, such as a ``Policy``."""

    @property
    def name(self) -> str:
        """Name in the results."""

    @property
    def observation(self) -> str | tuple[str, ...]:
        """What it observes, as in ``Policy``."""

    @property
    def digest(self) -> str:
        """Of its file; empty without one."""

    def begin(self, env: Reach) -> Act:
        """Return the function from observation to action for the task that has begun in an environment."""


def benchmark_tasks() -> list[BenchmarkTask]:
    """Return the tasks; those of a world follow each other."""
    rows = csv.DictReader(_LIST.read_text(encoding="utf-8").splitlines())
    return [_task_of(row) for row in rows]


def _task_of(row: Mapping[str, str]) -> BenchmarkTask:
    start, goal = (row["start_x"], row["start_y"]), (row["goal_x"], row["goal_y"])
    return BenchmarkTask(
        int(row["task"]),
        row["environment"],
        int(row["world"]),
        float(row["difficulty"]),
        (float(start[0]), float(start[1])),
        float(row["heading"]),
        (float(goal[0]), float(goal[1])),
        float(row["shortest_m"]),
    )


def list_digest() -> str:
    """Return the first twelve digits of the SHA-256 digest of the list."""
    return hashlib.sha256(_LIST.read_bytes()).hexdigest()[:12]


def drive_task(env: Reach, task: BenchmarkTask, driver: Driver) -> Result:
    """Drive a task in its world; the metrics of the episode, its number and the cause of its end.

    Raises:
        ConfigurationError: the world is not that of the list, or the policy fails.
    """
    options = {"start": task.start, "goal": task.goal, "heading": task.heading}
    seen, info = env.reset(seed=task.number, options=options)
    if abs(info["shortest_m"] - task.shortest) > _SAME_M:
        raise ConfigurationError(
            f"task {task.number} of {NAME}: the shortest path in {task.environment} (seed {task.world}) has "
            f"{info['shortest_m']:.2f} m instead of {task.shortest:.2f} m, so this is not the world of the list"
        )
    act = driver.begin(env)
    while True:
        seen, _, terminated, truncated, info = env.step(call(driver.name, act, seen))
        if terminated or truncated:
            metrics = {name: float(value) for name, value in info["metrics"].items()}
            return {"task": task.number, "cause": info["cause"], **metrics}


def _driven(tasks: Sequence[BenchmarkTask], driver: Driver) -> Iterator[Result]:
    """Drive tasks of one world."""
    env = Reach(tasks[0].environment, worlds=(tasks[0].world,), observation=driver.observation)
    yield from (drive_task(env, task, driver) for task in tasks)


def _drive_in_world(tasks: Sequence[BenchmarkTask], driver: Driver) -> list[Result]:
    """Drive tasks of one world, in a process of its own."""
    return [*_driven(tasks, driver)]


def score(
    driver: Driver,
    out: Path,
    *,
    worlds: int = 40,
    workers: int = 1,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> list[Result]:
    """Drive the tasks of the first ``worlds`` worlds and return their results, in their order.

    Args:
        driver: what drives.
        out: file with a line of JSON for each task; tasks that it has are not driven again, unless the driver's file
            has changed, which is an error.
        worlds: number of worlds.
        workers: number of processes; each has one world in memory. 0: drive in this process, one task after another.
        overwrite: begin anew.
        progress: receives it.

    Raises:
        OutputError: the file has results of something else, or cannot be written.
        ConfigurationError: as ``drive_task``.
    """
    out = output_path(out, single=True, parents=False, overwrite=True)  # what is there is looked at below
    seen = driver.observation if isinstance(driver.observation, str) else [*driver.observation]
    head: Result = {"benchmark": NAME, "digest": list_digest(), "policy": driver.name, "observation": seen}
    head["file"] = driver.digest
    groups = [[*tasks] for _, tasks in groupby(benchmark_tasks(), lambda task: (task.environment, task.world))][:worlds]
    found = {} if overwrite else _read(out, head)
    left = [rest for tasks in groups if (rest := [task for task in tasks if task.number not in found])]
    total = sum(map(len, left))
    with (progress or Silent()).stage(f"drive {total} tasks", float(total)) as advance:
        for results in _results(left, driver, workers):
            found |= {result["task"]: result for result in results}
            lines = [json.dumps(row) for row in (head, *found.values())]
            with output_errors(out, resumes=True):
                write_atomically(out, "\n".join((*lines, "")))
            advance(float(len(results)))
    return [found[task.number] for tasks in groups for task in tasks]


def _results(groups: Sequence[Sequence[BenchmarkTask]], driver: Driver, workers: int) -> Iterator[list[Result]]:
    """Yield the results of each world as it is done; a process drives one world, whose memory ends with it.

    Without processes, yield the result of each task.
    """
    if not groups or not workers:
        yield from ([result] for tasks in groups for result in _driven(tasks, driver))
        return
    yield from as_done(_drive_in_world, [(tasks, driver) for tasks in groups], workers, tasks_per_process=1)


def _read(path: Path, head: Mapping[str, Any]) -> dict[int, Result]:
    """Return results of a file by the number of the task.

    Raises:
        OutputError: they are of something else.
    """
    if not path.exists():
        return {}
    try:
        known, *rows = map(json.loads, path.read_text(encoding="utf-8").splitlines())
        differs = [key for key in head if known.get(key) != head[key]]
        found = {int(row["task"]): row for row in rows}
    except (OSError, ValueError, AttributeError, KeyError, TypeError) as error:
        raise OutputError(f"{path} has other content than results; choose another file, or --overwrite") from error
    if differs:
        raise OutputError(f"{path} has results of another {', '.join(differs)}; choose another file, or --overwrite")
    return found


# ---------------------------------------------------------------------------------------------------------------------
# Table


class Interval(NamedTuple):
    """A mean with the interval that holds the true one with a probability of 95 %."""

    mean: float
    low: float
    high: float


def share_interval(hits: int, count: int) -> Interval:
    """Wilson's interval of a share (1927), which holds for few tasks and at 0 and 1, too."""
    share, z2 = hits / count, _NORMAL**2
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = _NORMAL * np.sqrt(share * (1 - share) / count + z2 / (4 * count**2)) / (1 + z2 / count)
    return Interval(share, max(0.0, float(middle - half)), min(1.0, float(middle + half)))


def mean_interval(values: NDArray[np.float64]) -> Interval:
    """Normal interval of a mean of values that are not negative."""
    mean = float(values.mean())
    half = _NORMAL * float(values.std(ddof=1)) / np.sqrt(len(values)) if len(values) > 1 else float("nan")
    return Interval(mean, max(0.0, mean - half), mean + half)


def table(results: Sequence[Result]) -> str:
    """Return the score as a table in Markdown: a row for each difficulty, and one for all tasks."""
    difficulty = {task.number: task.difficulty for task in benchmark_tasks()}
    levels: list[float | None] = [*sorted({difficulty[each["task"]] for each in results}), None]
    lines = [
        "| difficulty | tasks | success | SPL | m/s towards the goal | collisions a task | ends otherwise |",
        "|---|---|---|---|---|---|---|",
    ]
    for level in levels:
        rows = [each for each in results if level is None or difficulty[each["task"]] == level]
        name = "all" if level is None else f"{level:g}"
        lines.append(f"| {name} | {len(rows)} | {_cells(rows)} |")
    return "\n".join(lines)


def _cells(rows: Sequence[Result]) -> str:
    """Return the figures of a row."""
    done = [each for each in rows if each["success"]]
    success = share_interval(len(done), len(rows))
    spl = mean_interval(np.array([each["spl"] for each in rows]))
    speed = f"{np.median([each['shortest_m'] / each['seconds'] for each in done]):.2f}" if done else "-"
    hits = mean_interval(np.array([each["collisions"] for each in rows]))
    causes = [each["cause"] for each in rows if not each["success"]]
    others = ", ".join(f"{causes.count(each)} {each}" for each in sorted({*causes}, key=lambda c: (c == TIME, c)))
    return " | ".join(
        f"{value.mean:.2f} ({value.low:.2f} to {value.high:.2f})" if isinstance(value, Interval) else value
        for value in (success, spl, speed, hits, others or "-")
    )

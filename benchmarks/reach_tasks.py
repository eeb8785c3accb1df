# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Draw the tasks of the fixed benchmark of Reach: python benchmarks/reach_tasks.py > reach_v1.csv.

It builds 40 worlds, which takes about ten minutes. Each task has been begun: the robot comes to rest at its start.
"""

import csv
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Final

from fieldtruth.core.errors import RouteError
from fieldtruth.core.parallel import cpu_count
from fieldtruth.learning.config import TEST_WORLDS
from fieldtruth.learning.environment import Reach

ENVIRONMENTS: Final = (
    "park", "forest", "hillside", "lake", "boreal", "forest_road", "quarry", "orchard", "scrub", "wet_meadow",
)  # fmt: skip
WORLDS: Final = 40
TASKS: Final = 10
"""In each world."""
MOST_DRAWS: Final = 200
"""In a world."""
DIFFICULTIES: Final = (0.2, 0.5, 0.8)
COLUMNS: Final = (
    "task", "environment", "world", "difficulty", "start_x", "start_y", "heading", "goal_x", "goal_y", "shortest_m",
)  # fmt: skip


def tasks_of(world: int) -> list[list[str]]:
    """Rows of a world: of the tasks that are drawn, those whose rounded start and goal the planner connects, too."""
    environment, seed = ENVIRONMENTS[world % len(ENVIRONMENTS)], TEST_WORLDS + world // len(ENVIRONMENTS)
    env, rows, draw = Reach(environment, worlds=(seed,)), list[list[str]](), 0
    while len(rows) < TASKS:
        number = world * TASKS + len(rows)
        difficulty = DIFFICULTIES[number % len(DIFFICULTIES)]
        draw += 1
        if draw > MOST_DRAWS:
            raise RouteError(f"{environment} (seed {seed}) has no {TASKS} tasks")
        try:
            env.reset(seed=world * 1000 + draw, options={"difficulty": difficulty})
            task = env.task
            assert task.goal is not None
            values = [round(float(each), 3) for each in (*task.start, task.heading, *task.goal)]
            options = {"start": values[:2], "heading": values[2], "goal": values[3:]}
            _, info = env.reset(seed=number, options=options)
        except RouteError as error:
            print(f"{environment} {seed}: {error}", file=sys.stderr)
            continue
        texts = [f"{each:.3f}" for each in (*values, info["shortest_m"])]
        rows.append([str(number), environment, str(seed), f"{difficulty:g}", *texts])
    print(f"{environment} {seed}: {draw} draws", file=sys.stderr)
    return rows


def main() -> None:
    """Print the list."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(COLUMNS)
    with ProcessPoolExecutor(cpu_count(), get_context("spawn"), max_tasks_per_child=1) as pool:
        for rows in pool.map(tasks_of, range(WORLDS)):
            writer.writerows(rows)


if __name__ == "__main__":
    main()

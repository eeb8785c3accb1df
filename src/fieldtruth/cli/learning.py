# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands score, a policy on the fixed benchmark of Reach, and episodes, what one saw and did as data."""

import argparse
import re
from pathlib import Path
from typing import Final

from fieldtruth.core.errors import UnknownNameError
from fieldtruth.core.progress import show_progress

TASKS: Final = ("Reach", "Follow", "Explore")
"""Environments."""


def _score(options: argparse.Namespace) -> None:
    from fieldtruth.learning.benchmark import NAME, list_digest, score, table
    from fieldtruth.learning.policies import policy_of

    policy = policy_of(options.policy, options.observation)
    out = options.out or Path(f"{NAME}_{re.sub(r'[^A-Za-z0-9]+', '_', policy.name).strip('_')}.jsonl")
    with show_progress() as progress:
        results = score(
            policy,
            out,
            worlds=options.worlds,
            workers=options.workers,
            overwrite=options.overwrite,
            progress=progress,
        )
    seen = policy.observation if isinstance(policy.observation, str) else ", ".join(policy.observation)
    print(f"{NAME} (digest {list_digest()}), {policy.name}, observes {seen}:\n")
    print(table(results))


def _episodes(options: argparse.Namespace) -> None:
    from fieldtruth.learning.driven import Drives
    from fieldtruth.learning.episodes import record_episodes
    from fieldtruth.learning.policies import policy_of

    given = {
        "environment": options.environment,
        "worlds": options.worlds,
        "split": options.split,
        "difficulty": options.difficulty,
        "observation": options.record[0] if len(options.record) == 1 else tuple(options.record),
    }
    policy = policy_of(options.policy, options.observation)
    if options.task not in TASKS:
        raise UnknownNameError("task", options.task, TASKS)
    arguments = {key: value for key, value in given.items() if value is not None}
    drives = Drives(policy, options.task, options.episodes, options.seed, arguments)
    with show_progress() as progress:
        name = record_episodes(drives, options.out, to=options.to, overwrite=options.overwrite, progress=progress)
    path = options.out / name
    if options.to == "lerobot":
        print(f"{path}: LeRobotDataset({name!r}, root={str(path)!r})")
    else:
        print(f"{path}: minari.load_dataset({name!r}) with MINARI_DATASETS_PATH={options.out}")


COMMANDS: Final = {"score": _score, "episodes": _episodes}
"""Sub-commands by name."""

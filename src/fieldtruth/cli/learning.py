# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands score, of a policy or a node on the fixed benchmark of Reach, and episodes, of one as data."""

import argparse
import re
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldtruth.cli.arguments import UsageError
from fieldtruth.cli.live import check_pace_and_host, sink_of
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.core.progress import show_progress

if TYPE_CHECKING:
    from fieldtruth.learning.benchmark import Driver

TASKS: Final = ("Reach", "Follow", "Explore")
"""Environments."""


def _score(options: argparse.Namespace) -> None:
    if not (options.ros2 or options.ros1):
        from fieldtruth.learning.policies import policy_of

        if options.policy is None:
            raise UsageError("give POLICY, --ros2 or --ros1")
        if options.name is not None:
            raise UsageError("--name is for --ros2 and --ros1: a POLICY has its own")
        _print_score(policy_of(options.policy, options.observation), options, options.workers)
        return
    if options.observation is not None:
        raise UsageError("--observation is for a POLICY: nodes hear topics")
    check_pace_and_host(options)
    from fieldtruth.experiment.rig import Rig
    from fieldtruth.live.commands import Inbox
    from fieldtruth.live.score import NodeDriver

    name = " ".join(filter(None, ["ros2" if options.ros2 else "ros1", options.name]))
    inbox = Inbox(Rig().robot, _say)
    with closing(sink_of(options, inbox)) as sink:
        _say(f"{name} at {sink.where}")
        _print_score(NodeDriver(name, sink, inbox, options.rate, _say), options, workers=0)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)  # standard output has the table


def _print_score(policy: "Driver", options: argparse.Namespace, workers: int) -> None:
    from fieldtruth.learning.benchmark import NAME, list_digest, score, table

    out = options.out or Path(f"{NAME}_{re.sub(r'[^A-Za-z0-9]+', '_', policy.name).strip('_')}.jsonl")
    with show_progress() as progress:
        results = score(
            policy,
            out,
            worlds=options.worlds,
            workers=workers,
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

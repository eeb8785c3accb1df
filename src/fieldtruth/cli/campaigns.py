# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Campaigns on the command line: generate of a campaign, and status."""

import argparse
import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldtruth.cli.arguments import AddCommand, Parser, UsageError, changes, count
from fieldtruth.cli.streams import print_line
from fieldtruth.core.errors import FieldtruthWarning, UnknownNameError

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from fieldtruth.campaign.state import State
    from fieldtruth.cluster.engine import ClusterEngine

FAILED: Final = 1
"""Exit code of a campaign with runs that failed."""
FORMATS: Final = ("text", "json", "lines", "slurm")
_ONLY_CAMPAIGNS: Final = {"jobs": None, "shard": None, "no_estimate": False}


def add_arguments(generate: Parser) -> None:
    """Add the options of ``generate`` that are for campaigns only."""
    group = generate.add_argument_group("campaigns")
    group.add_argument(
        "--jobs", metavar="N", type=count, help="runs side by side, each in a process (1), or on a cluster"
    )
    group.add_argument("--shard", metavar="I/N", help="only part I of N, counted from 1")
    group.add_argument("--no-estimate", action="store_true", help="start without measuring time, bytes and memory")


def refuse_options(options: argparse.Namespace) -> None:
    """Refuse the options of campaigns; raises UsageError."""
    for name, default in _ONLY_CAMPAIGNS.items():
        if getattr(options, name) != default:
            raise UsageError(f"--{name.replace('_', '-')} is for campaigns; {options.experiment} is one experiment")


def generate(options: argparse.Namespace, cluster: "AbstractContextManager[ClusterEngine | None]") -> int:
    """Make a campaign, or what is left of it, on a cluster if it is one; the exit code says whether runs failed."""
    from functools import partial

    from fieldtruth.campaign.check import check_campaign
    from fieldtruth.campaign.files import load_campaign, with_changes
    from fieldtruth.campaign.shard import Shard, parse_shard

    campaign = with_changes(load_campaign(options.experiment), **changes(options))
    check_campaign(campaign, options.experiment)
    shard = Shard(1, 1) if options.shard is None else parse_shard(options.shard)
    # After the checks: compiled kernels and physics take a second to load.
    from fieldtruth import pipeline
    from fieldtruth.campaign.state import Kind
    from fieldtruth.campaign.task import Options, generate_campaign
    from fieldtruth.core.outputs import output_folder
    from fieldtruth.core.progress import show_progress

    out = Path("data") / campaign.name if options.out is None else output_folder(options.out)
    with cluster as engine:
        task = Options(
            jobs=options.jobs or (1 if engine is None else engine.runs_at_once()),
            workers=options.workers,
            shard=shard,
            overwrite=options.overwrite,
            measure=not options.no_estimate and engine is None,
            generate=None if engine is None else partial(pipeline.generate_by, engine),
        )
        states = generate_campaign(campaign, out, task, source=options.experiment, shows=show_progress, say=print_line)
    return FAILED if any(state.kind is Kind.FAILED for state in states) else 0


def _status(options: argparse.Namespace) -> None:
    from fieldtruth.campaign.draw import draw
    from fieldtruth.campaign.files import CAMPAIGN, load_campaign
    from fieldtruth.campaign.shard import Shard
    from fieldtruth.campaign.state import state_of

    known = FORMATS if options.missing else FORMATS[:2]
    if options.format not in known:
        raise UnknownNameError("format" if options.missing else "format without --missing", options.format, known)
    runs = draw(load_campaign(options.folder / CAMPAIGN))
    states = [state_of(run, options.folder, checksums=options.checksums) for run in runs]
    parts = len(runs) if options.shards is None else options.shards
    shards = [next(i for i in range(1, parts + 1) if Shard(i, parts).has(k)) for k in range(len(runs))]
    shown = [(state, i) for state, i in zip(states, shards, strict=True) if state.is_left or not options.missing]
    print(_TEXTS[options.format](options.folder, [state for state, _ in shown], [i for _, i in shown]))


def warn_of_missing(folder: Path) -> None:
    """Warn if a folder is that of a campaign whose runs are not all done; do nothing for other folders."""
    from fieldtruth.campaign.draw import draw
    from fieldtruth.campaign.files import CAMPAIGN, load_campaign
    from fieldtruth.campaign.state import Kind, state_of

    if not (folder / CAMPAIGN).is_file():
        return
    states = [state_of(run, folder) for run in draw(load_campaign(folder / CAMPAIGN))]
    if left := sum(state.kind is not Kind.DONE for state in states):
        text = f"{left} of {len(states)} runs of {folder} are not done, see `fieldtruth status {folder}`"
        warnings.warn(text, FieldtruthWarning, stacklevel=2)


def _text(folder: Path, states: "Sequence[State]", _: Sequence[int]) -> str:
    from fieldtruth.campaign.amounts import clock, size
    from fieldtruth.campaign.state import Kind, counts, time_left_s

    running = sum(state.kind is Kind.RUNNING for state in states)
    left_s = time_left_s(states, running)
    left = f"; about {clock(left_s)} left with {max(1, running)} at a time" if left_s else ""
    made = sum(state.manifest.bytes for state in states if state.manifest is not None)
    head = f"{folder}: {counts(states)}; {size(made)}{left}"
    rows = [f"  {s.kind:<7}  {s.run.name}{': ' * bool(s.reason)}{s.reason}" for s in states if s.kind is not Kind.DONE]
    return "\n".join([head, *rows])


def _json(folder: Path, states: "Sequence[State]", _: Sequence[int]) -> str:
    return json.dumps([{"run": s.run.name, "state": s.kind, "reason": s.reason} for s in states])


def _lines(folder: Path, states: "Sequence[State]", _: Sequence[int]) -> str:
    return "\n".join(state.run.name for state in states)


def _slurm(folder: Path, states: "Sequence[State]", shards: Sequence[int]) -> str:
    from fieldtruth.campaign.shard import ranges

    return ranges(shards)


_TEXTS: Final = {"text": _text, "json": _json, "lines": _lines, "slurm": _slurm}


def add_commands(command: AddCommand) -> None:
    """Add the sub-command."""
    status = command("status", _status, "Show what of a campaign is done.")
    status.add_argument("folder", metavar="DIR", type=Path, help="folder of the campaign")
    status.add_argument("--missing", action="store_true", help="only runs that the same command would make")
    status.add_argument(
        "--format", metavar="NAME", default="text", help="text or json; with --missing also lines or slurm"
    )
    status.add_argument(
        "--shards", metavar="N", type=count, help="number of shards to which slurm's array refers (one per run)"
    )
    status.add_argument("--checksums", action="store_true", help="read all bags instead of their size and index")

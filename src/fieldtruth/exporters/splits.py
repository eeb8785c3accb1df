# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of a published data set: each belongs to a split and has a name of its own. No world is in two splits."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.datasets import bags_in

SPLITS: Final = ("train", "val", "test")

_UNSAFE: Final = re.compile(r"[^A-Za-z0-9_-]")


class Member(NamedTuple):
    """A run of a data set."""

    run: Run
    split: str
    name: str
    """Unique in the data set; letters, digits, _ and -."""


def find_members(paths: Sequence[Path], split: str) -> list[Member]:
    """Open runs, folders of runs such as a campaign's, or bags.

    A run in a folder ``train``, ``val`` or ``test``, as in ``OUT/val/lake_7``, belongs to that split.

    Args:
        paths: of runs, bags or folders of runs; of a folder all runs are taken, sorted by path.
        split: of runs in other folders.

    Raises:
        UnknownNameError: unknown split.
        BagError: a path without a run, or an unreadable run.
        OutputError: a run is given twice, or runs of one world are in two splits.
    """
    if split not in SPLITS:
        raise UnknownNameError("split", split, SPLITS)
    bags = [bag for path in paths for bag in _bags(path)]
    if twice := next((bag for bag, n in Counter(bag.resolve() for bag in bags).items() if n > 1), None):
        raise OutputError(f"{twice} is given twice; each run can be in a data set once")
    bags.sort(key=lambda bag: SPLITS.index(_split_of(bag, split)))
    splits = [_split_of(bag, split) for bag in bags]
    runs = [open_run(bag) for bag in bags]
    _check_worlds(runs, splits)
    return [Member(*row) for row in zip(runs, splits, _names(runs), strict=True)]


def _bags(path: Path) -> list[Path]:
    """Return the bag of a run, or the bags in a folder of runs."""
    if not path.exists():
        raise BagError(f"{path} does not exist; it must be the folder of a run, a folder of runs, or a bag")
    return [bag for _, bag in bags_in(path)] if path.is_dir() else [path]


def _split_of(bag: Path, default: str) -> str:
    """Return the split whose folder holds the bag or the folder of its run."""
    above = [folder.name for folder in bag.absolute().parents[:2]]
    return next((name for name in above if name in SPLITS), default)


def _check_worlds(runs: Sequence[Run], splits: Sequence[str]) -> None:
    """Check that each world is in one split; the world of a bag from elsewhere is unknown."""
    first: dict[str, tuple[Run, str]] = {}
    for run, split in zip(runs, splits, strict=True):
        if run.world is not None and run.experiment is not None:
            other, taken = first.setdefault(run.world, (run, split))
            if taken != split:
                world = f"{run.experiment.environment} with seed {run.experiment.seed}"
                raise OutputError(
                    f"{other.bag} in split {taken!r} and {run.bag} in split {split!r} are of the same world ({world}); "
                    "a world must be in one split"
                )


def _names(runs: Sequence[Run]) -> list[str]:
    """Return the runs' names, made unique by a number."""
    names: list[str] = []
    for run in runs:
        base = _UNSAFE.sub("_", run.name)[:64]
        tried = (base if k == 1 else f"{base}-{k}" for k in range(1, len(runs) + 1))
        names.append(next(name for name in tried if name not in names))
    return names

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All runs in a folder as one data set."""

import os
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, SupportsIndex, TypedDict, Unpack

import numpy as np

from fieldtruth.bag.bag_file import BAG_ENDINGS
from fieldtruth.bag.reader import BagError
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.datasets.items import Sensor
from fieldtruth.datasets.run import DEFAULT_ITEMS, RunDataset, Transform, checked_index
from fieldtruth.ontology import LabelMap


class Options(TypedDict, total=False):
    """Keyword arguments of ``RunDataset`` that apply to all runs."""

    camera: str | None
    lidar: str | None
    anchor: Sensor | None
    tolerance_s: float
    label_map: str | LabelMap | None
    transform: Transform | None


class Runs:
    """Several runs as one data set: their frames one run after the other.

    Raises:
        ConfigurationError: no runs, or runs whose masks have different classes.
    """

    def __init__(self, runs: Sequence[RunDataset]) -> None:
        if not runs or any(run.classes != runs[0].classes for run in runs):
            raise ConfigurationError("runs must be at least one, and all must have the same classes")
        self.runs = tuple(runs)
        self._ends = np.cumsum([len(run) for run in self.runs], dtype=np.int64)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.name for run in self.runs)

    @property
    def classes(self) -> dict[int, str]:
        """Names of the classes by id."""
        return self.runs[0].classes

    def locate(self, index: SupportsIndex) -> tuple[RunDataset, int]:
        """Return the run of a frame, and its index there.

        Raises:
            IndexError: the index is out of range.
        """
        frame = checked_index(index, len(self))
        k = int(np.searchsorted(self._ends, frame, side="right"))
        return self.runs[k], frame - int(self._ends[k]) + len(self.runs[k])

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: SupportsIndex) -> Any:
        """Return a sample, as ``RunDataset`` does."""
        run, frame = self.locate(index)
        return run[frame]

    def __iter__(self) -> Iterator[Any]:
        return (frame for run in self.runs for frame in run)

    def __repr__(self) -> str:
        return f"Runs({len(self)} frames of {', '.join(self.names)})"


def open_runs(folder: Path | str, items: Sequence[str] = DEFAULT_ITEMS, **options: Unpack[Options]) -> Runs:
    """Open every run in a folder and its subfolders, sorted by name.

    A run's name is its path in the folder: ``park_1``, or ``seed_3/park_1``. If a folder has a bag with the folder's
    name, its other bags are copies (annotated, say) and are skipped. So are names that begin with a dot.

    Args:
        folder: the folder of runs.
        items: as for ``RunDataset``, like ``options``.

    Raises:
        BagError: no runs, an unreadable run, one that lacks a requested item, or two with the same name.
    """
    root = Path(folder)
    if not root.is_dir():
        raise BagError(f"{root} is not a folder; runs are opened from the folder that contains them")
    bags = bags_in(root)
    for (name, bag), (following, other) in pairwise(bags):
        if name == following:
            raise BagError(f"{bag} and {other} have the same name {name!r}; rename one")
    runs = [RunDataset(bag, items, **options) for _, bag in bags]
    for run, (name, _) in zip(runs, bags, strict=True):
        run.name = name
    return Runs(runs)


def bags_in(root: Path) -> list[tuple[str, Path]]:
    """Return name and bag of each run in a folder and its subfolders, as ``open_runs`` finds them, sorted.

    Raises:
        BagError: the folder has no bag.
    """
    bags = sorted(_bags(root))
    if not bags:
        raise BagError(f"{root} has no runs: no bag in it or its subfolders")
    return bags


def _bags(root: Path) -> Iterator[tuple[str, Path]]:
    """Yield name and bag of each run; links to folders are followed, each folder once."""
    seen: set[str] = set()
    for path, folders, files in os.walk(root, followlinks=True):
        real = os.path.realpath(path)
        if real in seen:
            folders.clear()
            continue
        seen.add(real)
        folders[:] = [name for name in folders if not name.startswith(".")]
        here, bags = Path(path), list[str]()
        for ending in BAG_ENDINGS:
            bags = bags or [name for name in files if name.endswith(ending) and not name.startswith(".")]
        own = Path(real).name + (Path(bags[0]).suffix if bags else "")
        for name in [own] if own in bags else bags:
            called = here if name == own and here != root else (here / name).with_suffix("")
            yield called.relative_to(root).as_posix(), here / name

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All runs in a folder as one data set."""

import os
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, SupportsIndex, TypedDict, Unpack

import numpy as np

from fieldtruth.bag.reader import BagError
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.datasets.items import Sensor
from fieldtruth.datasets.run import DEFAULT_ITEMS, RunDataset, Transform, position
from fieldtruth.ontology.label_map import LabelMap


class Options(TypedDict, total=False):
    """The keyword arguments of ``RunDataset`` that hold for all runs alike."""

    camera: Literal["left", "right"]
    anchor: Sensor | None
    tolerance_s: float
    label_map: str | LabelMap | None
    transform: Transform | None


class Runs:
    """Several runs as one data set: the frames of the first, then those of the second, and so on.

    Raises:
        ConfigurationError: there is none, or their masks have different classes.
    """

    def __init__(self, runs: Sequence[RunDataset]) -> None:
        if not runs or any(run.classes != runs[0].classes for run in runs):
            raise ConfigurationError("runs make a data set if there is one at least, and if all have the same classes")
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
        """Return the run of a frame, and its number there.

        Raises:
            IndexError: there is no such frame.
        """
        place = position(index, len(self))
        k = int(np.searchsorted(self._ends, place, side="right"))
        return self.runs[k], place - int(self._ends[k]) + len(self.runs[k])

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: SupportsIndex) -> Any:
        """Read a frame as ``RunDataset`` does."""
        run, frame = self.locate(index)
        return run[frame]

    def __iter__(self) -> Iterator[Any]:
        return (frame for run in self.runs for frame in run)

    def __repr__(self) -> str:
        return f"Runs({len(self)} frames of {', '.join(self.names)})"


def open_runs(folder: Path | str, items: Sequence[str] = DEFAULT_ITEMS, **options: Unpack[Options]) -> Runs:
    """Open every run in a folder and below, sorted by name.

    A run's name is its way from the folder: ``park_1``, or ``seed_3/park_1``. Where a folder holds the bag that is
    named after it, other bags there are copies of it (annotated, say) and are left out. So is what begins with a dot.

    Args:
        folder: of runs.
        items: as in ``RunDataset``, and so are ``options``.

    Raises:
        BagError: there is no run, or one cannot be read or lacks what was asked for, or two have the same name.
    """
    root = Path(folder)
    if not root.is_dir():
        raise BagError(f"there is no folder {root}; needed is one that holds runs")
    bags = sorted(_bags(root))
    if not bags:
        raise BagError(f"{root} holds no run: there is no bag in it or below")
    for (name, bag), (following, other) in pairwise(bags):
        if name == following:
            raise BagError(f"{bag} and {other} would both be called {name!r}; rename one")
    return Runs([RunDataset(bag, items, name=name, **options) for name, bag in bags])


def _bags(root: Path) -> Iterator[tuple[str, Path]]:
    """Name and bag of each run; linked folders count, each once."""
    seen: set[str] = set()
    for path, folders, files in os.walk(root, followlinks=True):
        real = os.path.realpath(path)
        if real in seen:
            folders.clear()
            continue
        seen.add(real)
        folders[:] = [name for name in folders if not name.startswith(".")]
        bags = [name for name in files if name.endswith(".bag") and not name.startswith(".")]
        here, own = Path(path), f"{Path(real).name}.bag"
        for name in [own] if own in bags else bags:
            called = here if name == own and here != root else (here / name).with_suffix("")
            yield called.relative_to(root).as_posix(), here / name

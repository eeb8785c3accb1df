# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What each part of a training set is worth on frames that the network never saw: one table, each row one change.

Run: python benchmarks/ablation.py SETS --cache FOLDER [--real REAL] [--from N] [--to N] [--without-signal SETS]
         [--rows WORD ...] [--steps N] [--seeds N] [--width W --height H] [--processes N] [--json FILE]

SETS is the folder of a campaign of images with splits, as `fieldtruth generate standard-images` makes it. Each row
trains the U-Net of examples/train_images.py on a part of the training frames, equally long, and scores it on worlds of
the campaign's splits val and test, and on the pairs of REAL. WORDs choose rows by a part of their name. Docs:
docs/baselines.md.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from real_frames import frames_of
from transfer import Row as RealRow
from transfer import check_outputs
from transfer import score as real_score

from fieldtruth.core.errors import ConfigurationError, FieldtruthError

sys.path.append(str(Path(__file__).resolve().parents[1] / "examples"))

PAPER: Final = ("park", "lake", "forest", "hillside")
ROADS: Final = ("forest_road", "quarry")
FEW: Final = 12
"""Least number of worlds of a learning curve."""


class Conditions(NamedTuple):
    """Conditions of a run, which select its frames."""

    environment: str
    along: bool
    season: str
    clouds: str


@dataclass(frozen=True)
class Frames:
    """Frames of the runs of a split."""

    images: NDArray[np.uint8]
    masks: NDArray[np.uint8]
    worlds: tuple[Conditions, ...]
    """Of each run."""
    run: NDArray[np.int64]
    """(n,) row of ``worlds`` of each frame."""

    def of(self, keep: Callable[[Conditions], bool]) -> NDArray[np.int64]:
        """Return the frames of runs that are kept."""
        kept = np.array([keep(world) for world in self.worlds])
        return np.flatnonzero(kept[self.run])


class Change(NamedTuple):
    """A row of the table: its name, and what the network is trained on."""

    name: str
    frames: NDArray[np.int64]
    signal: bool = True
    augmented: bool = True


def read(folder: Path, cache: Path, size: tuple[int, int], workers: int) -> dict[str, Frames]:
    """Read the frames of the training split, and those of the others as one; from files if they are there."""
    import frame_arrays
    from train_images import Shrink

    from fieldtruth.ontology import label_map_of

    shrink = Shrink(*size, frame_arrays.classes_of(label_map_of("offroad")))
    parts: dict[str, list[Frames]] = {}
    for name, runs in frame_arrays.splits_of(folder, 0, items=("image", "mask"), label_map="offroad").items():
        arrays = frame_arrays.read(runs, shrink, len(runs), cache / name, {"size": list(size)}, workers)
        worlds = tuple(_conditions(run.run.experiment) for run in runs.runs)
        rows = np.repeat(np.arange(len(worlds)), [len(run) for run in runs.runs])
        parts.setdefault("train" if name == "train" else "test", []).append(Frames(*arrays, worlds, rows))
    return {name: _joined(each) for name, each in parts.items()}


def _joined(parts: Sequence[Frames]) -> Frames:
    if len(parts) == 1:
        return parts[0]
    before = np.cumsum([0, *(len(part.worlds) for part in parts)])
    return Frames(
        np.concatenate([part.images for part in parts]),
        np.concatenate([part.masks for part in parts]),
        tuple(world for part in parts for world in part.worlds),
        np.concatenate([part.run + first for part, first in zip(parts, before, strict=False)]),
    )


def _conditions(experiment: Any) -> Conditions:
    light = experiment.light
    return Conditions(
        experiment.environment,
        experiment.frames is not None and experiment.frames.along is not None,
        str(experiment.layout.get("season", "summer")),
        light.values.clouds,
    )


def changes(train: Frames, *, has_ideal: bool) -> Iterator[Change]:
    """Yield the rows: the whole set, parts of it by one property, and learning curves."""
    everything = train.of(lambda world: True)
    yield Change("everything", everything)
    yield Change("augmentation: none", everything, augmented=False)
    if has_ideal:
        yield Change("signal: none", everything, signal=False)
        yield Change("signal and augmentation: none", everything, signal=False, augmented=False)
    for name, keep in _kept().items():
        yield Change(name, train.of(keep))
    for one in sorted({world.environment for world in train.worlds}):
        yield Change(f"only {one}", train.of(_is_in(one)))
    order = np.random.default_rng(0).permutation(len(train.worlds))
    count = len(order)
    while count >= FEW:
        chosen = np.flatnonzero(np.isin(train.run, order[:count]))
        if count < len(order):  # with all it is the first row
            yield Change(f"curve: {count} worlds", chosen)
        yield Change(f"curve: {count} worlds, each fourth frame", _each(train.run, chosen, 4))
        yield Change(f"curve: {count} worlds, each fifteenth frame", _each(train.run, chosen, 15))
        count //= 2


def _is_in(environment: str) -> Callable[[Conditions], bool]:
    return lambda world: world.environment == environment


def _kept() -> dict[str, Callable[[Conditions], bool]]:
    return {
        "worlds: those of the paper": lambda world: world.environment in PAPER,
        "worlds: no roads, no quarries": lambda world: world.environment not in ROADS,
        "worlds: roads and quarries": lambda world: world.environment in ROADS,
        "viewpoints: along trails": lambda world: world.along,
        "viewpoints: at random": lambda world: not world.along,
        "season: summer": lambda world: world.season == "summer",
        "season: others": lambda world: world.season != "summer",
        "light: overcast": lambda world: world.clouds in ("overcast", "stratus"),
        "light: the sun shines": lambda world: world.clouds not in ("overcast", "stratus"),
    }


def _each(run: NDArray[np.int64], chosen: NDArray[np.int64], step: int) -> NDArray[np.int64]:
    """Return each ``step``-th of the chosen frames of a run."""
    first = np.searchsorted(run[chosen], run[chosen])  # frames of a run follow one another
    rows: NDArray[np.int64] = chosen[(np.arange(len(chosen)) - first) % step == 0]
    return rows


@dataclass(frozen=True)
class Tried:
    """A row's scores, each by seed [%]."""

    name: str
    worlds: int
    frames: int
    scores: dict[str, list[float]]

    def line(self) -> str:
        """Return a row of a Markdown table: means, and from two seeds on half the range."""
        cells = []
        for each in self.scores.values():
            spread = f" ± {(max(each) - min(each)) / 2.0:.1f}" if len(each) > 1 else ""
            cells.append(f"{np.mean(each):.1f}{spread}")
        return f"| {self.name} | {self.worlds} | {self.frames} | " + " | ".join(cells) + " |"

    def head(self) -> str:
        """Return the table's head."""
        return f"| trained on | worlds | frames | {' | '.join(self.scores)} |\n|---|" + "---:|" * (2 + len(self.scores))


def tried(change: Change, train: Frames, test: Frames, real: Any, options: argparse.Namespace) -> Tried:
    """Train and score a row, once for each seed; ``real`` are labelled frames, or None."""
    import augmentation
    import frame_arrays
    import scoring
    import segmentation

    from fieldtruth.ontology import label_map_of

    classes = frame_arrays.classes_of(label_map_of("offroad")).names
    scores: dict[str, list[float]] = {}
    for seed in range(options.seeds):
        settings = segmentation.Settings(classes, options.height, options.width, seed=seed)
        network = segmentation.make_network(settings)
        augment = augmentation.photos if change.augmented else None
        images, masks = train.images[change.frames], train.masks[change.frames]
        segmentation.fit(network, settings, images, masks, steps=options.steps, augment=augment, log=lambda line: None)
        own = scoring.score(network, test.images, test.masks, len(classes))
        found = {"unseen worlds, mean of 6": float(np.nanmean(segmentation.iou(own.confusion)))}
        if real is not None:
            row = RealRow("", "", real.layout, real_score(network, settings, real)[0])
            found |= {f"real, {name}": value for name, value in row.figures().items() if name != "right"}
        for name, value in found.items():
            scores.setdefault(name, []).append(100.0 * value)
    return Tried(change.name, len(np.unique(train.run[change.frames])), len(change.frames), scores)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print each row when it is there; a user's mistake is one line and exit code 2."""
    options = _parser().parse_args(arguments)
    try:
        _run(options)
    except FieldtruthError as error:
        print(f"ablation.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _run(options: argparse.Namespace) -> None:
    _check(options)
    rows = _Rows(options)
    if not rows.chosen:
        names = ", ".join(row.name for row in rows.every)
        raise ConfigurationError(f"no row has one of the words {', '.join(options.rows)}; the rows are {names}")
    done = list[Tried]()
    processes, spawn = min(options.processes, len(rows.chosen)), get_context("spawn")
    with ProcessPoolExecutor(processes, spawn, initializer=_begin, initargs=(options,)) as pool:
        for k, row in enumerate(pool.map(_row, range(len(rows.chosen)))):
            if row is None:
                print(f"no frames: {rows.chosen[k].name}", file=sys.stderr)
                continue
            print(*([] if done else [row.head()]), row.line(), sep="\n", flush=True)
            done.append(row)
            if options.json:
                options.json.write_text(json.dumps([vars(each) for each in done], indent=1) + "\n", encoding="utf-8")


class _Rows:
    """Frames, and the rows that train on them; every process reads them from the files of the cache."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.real = frames_of(options.real).between(options.start, options.end) if options.real else None
        size = options.height, options.width
        frames = read(options.sets, options.cache / "frames", size, options.workers)
        self.train, self.test, self.ideal = frames["train"], frames["test"], None
        if options.without_signal:
            self.ideal = read(options.without_signal, options.cache / "ideal", size, options.workers)["train"]
            if not np.array_equal(self.ideal.run, self.train.run):
                raise ConfigurationError(f"{options.without_signal} must have the runs and frames of {options.sets}")
        self.every = list(changes(self.train, has_ideal=self.ideal is not None))
        self.chosen = [row for row in self.every if not options.rows or any(word in row.name for word in options.rows)]

    def tried(self, k: int) -> Tried | None:
        """Train and score a chosen row; None without a frame."""
        change = self.chosen[k]
        if not len(change.frames):
            return None
        source = self.train if change.signal or self.ideal is None else self.ideal
        return tried(change, source, self.test, self.real, self.options)


_rows: _Rows | None = None
"""Of this process."""


def _begin(options: argparse.Namespace) -> None:
    """Prepare a process: a thread for itself, because two threads train hardly faster than one."""
    global _rows
    import torch

    torch.set_num_threads(1)
    _rows = _Rows(options)


def _row(k: int) -> Tried | None:
    assert _rows is not None
    return _rows.tried(k)


def _check(options: argparse.Namespace) -> None:
    for name, least in (("steps", 1), ("seeds", 1), ("width", 32), ("height", 32), ("workers", 0), ("processes", 1)):
        if getattr(options, name) < least:
            raise ConfigurationError(f"--{name} must be at least {least}, got {getattr(options, name)}")
    check_outputs(options.json, options.cache)
    if options.cache.is_file():
        raise ConfigurationError(f"--cache must be a folder, but {options.cache} is a file")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", type=Path, metavar="SETS", help="folder of a campaign of images")
    parser.add_argument("--cache", type=Path, required=True, metavar="FOLDER", help="keeps the frames, made smaller")
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="real frames")
    parser.add_argument("--from", dest="start", type=int, default=0, metavar="N", help="first pair that is scored (0)")
    parser.add_argument("--to", dest="end", type=int, default=sys.maxsize, metavar="N", help="pair after the last one")
    parser.add_argument("--without-signal", type=Path, metavar="SETS", help="the same campaign with an ideal camera")
    parser.add_argument("--rows", nargs="+", metavar="WORD", help="rows whose name has one of the words (all)")
    parser.add_argument("--steps", type=int, default=600, help="of each training (600)")
    parser.add_argument("--seeds", type=int, default=1, help="trainings of each row (1)")
    parser.add_argument("--width", type=int, default=128, help="of the images [pixel] (128)")
    parser.add_argument("--height", type=int, default=72, help="of the images [pixel] (72)")
    parser.add_argument("--workers", type=int, default=2, help="processes that read frames (2)")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="that train a row each (all cores)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="gets all figures")
    return parser


if __name__ == "__main__":
    main()

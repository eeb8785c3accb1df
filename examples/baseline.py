# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The way of both baselines: read frames, train, score. ``train_images`` and ``train_clouds`` say what a frame is."""

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import frame_arrays
import scoring
import segmentation
from torch import nn

import fieldtruth as ft
from fieldtruth.ontology import label_map_of

WATCHED = 96  # frames of val that are scored in the middle of the training


@dataclass(frozen=True)
class Task:
    """Frames that a baseline trains on.

    Attributes:
        items: of a sample that ``shrink`` takes.
        sensor: options of ``ft.open_runs`` that select it.
        shrink: makes image and mask of a sample.
        size: height, width and channels of these images.
        augment: changes batches in the training.
        shown: makes a picture, (h, w, 3), of an image.
    """

    items: tuple[str, ...]
    sensor: dict[str, Any]
    shrink: frame_arrays.Shrink
    size: tuple[int, int, int]
    augment: segmentation.Augment
    shown: Callable[[Any], Any]


def parser(description: str | None, network: str, others: str, count: int) -> argparse.ArgumentParser:
    """Return a parser of the options that both baselines have; ``count`` is the default of ``--frames``."""
    made = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("data", type=Path, metavar="DATA", help="folder of runs")
    made.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="folder of the results")
    made.add_argument("--minutes", type=float, default=50.0, help="time of the training; reading comes on top (50)")
    made.add_argument("--steps", type=int, help="of the training, in place of a time: the same on every machine")
    made.add_argument("--label-map", default="offroad", help="classes, from `fieldtruth list label-maps` (offroad)")
    made.add_argument("--network", default=network, help=f"{network}{others} ({network})")
    made.add_argument("--frames", type=int, default=count, help=f"most frames of train; a quarter in others ({count})")
    made.add_argument("--batch", type=int, default=16, help="images in a step (16)")
    made.add_argument("--learning-rate", type=float, default=3e-3, help="the highest (0.003)")
    made.add_argument("--seed", type=int, default=0, help="of first weights, order and augmentation (0)")
    made.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes that read (all cores)")
    return made


def run(task: Task, options: argparse.Namespace) -> None:
    """Read frames, train, and write scores of the test split, else of val."""
    _check(options)
    classes = frame_arrays.classes_of(label_map_of(options.label_map))
    settings = segmentation.Settings(classes.names, *task.size, options.network, options.seed)
    network = segmentation.make_network(settings)
    arrays = _arrays(task, options)
    segmentation.fit(
        network,
        settings,
        *arrays["train"],
        out=options.out,
        minutes=options.minutes,
        steps=options.steps,
        batch=options.batch,
        learning_rate=options.learning_rate,
        data=(options.out / "frames" / "train.json").read_text("utf-8"),
        augment=task.augment,
        watch=_watch(arrays["val"] if "val" in arrays else arrays["test"], classes.names),
    )
    split = "test" if "test" in arrays else "val"
    images, masks = arrays[split]
    scores = scoring.score(network, images, masks, len(classes.names))
    found = scoring.write(options.out, scores, classes.names, split=split, frames=len(images))
    pictures = scoring.Pictures(classes.colours, task.shown)
    scoring.write_sheet(options.out / "predictions.png", network, images, masks, pictures)
    print(f"{split}, {len(images)} frames:\n{scoring.table(found)}")


def call(main: Callable[[list[str]], None]) -> None:
    """Call the main function of a script with its arguments; an error that a user can correct is one line."""
    try:
        main(sys.argv[1:])
    except ft.FieldtruthError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def _check(options: argparse.Namespace) -> None:
    for name in ("minutes", "learning_rate", "frames", "batch", *(("steps",) if options.steps is not None else ())):
        if not getattr(options, name) > 0:
            raise ft.ConfigurationError(f"--{name.replace('_', '-')} must be above 0, got {getattr(options, name)}")
    for name, least in (("width", 32), ("height", 32), ("workers", 0), ("seed", 0)):
        if getattr(options, name, least) < least:
            raise ft.ConfigurationError(f"--{name} must be at least {least}, got {getattr(options, name)}")
    if options.out.is_file():
        raise ft.ConfigurationError(f"--out must be a folder, but {options.out} is a file")


def _arrays(task: Task, options: argparse.Namespace) -> dict[str, frame_arrays.Arrays]:
    """Return images and masks of each split."""
    opened = {"items": task.items, "label_map": options.label_map, **task.sensor}
    key = {"data": str(options.data.resolve()), "size": list(task.size), "label_map": options.label_map, **task.sensor}
    counts = {"train": options.frames}
    return {
        name: frame_arrays.read(
            runs,
            task.shrink,
            counts.get(name, max(1, options.frames // 4)),
            options.out / "frames" / name,
            key,
            options.workers,
        )
        for name, runs in frame_arrays.splits_of(options.data, options.seed, **opened).items()
    }


def _watch(val: frame_arrays.Arrays, classes: tuple[str, ...]) -> Callable[[nn.Module], dict[str, float]]:
    """Return a function that scores a network on some frames."""
    step = max(1, len(val[0]) // WATCHED)
    images, masks = val[0][::step], val[1][::step]

    def watch(network: nn.Module) -> dict[str, float]:
        found = scoring.figures(scoring.score(network, images, masks, len(classes)), classes)
        return {"mean IoU of val": found["mean_iou"]}

    return watch

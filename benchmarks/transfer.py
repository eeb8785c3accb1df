# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Scores on real frames of networks that were trained on our synthetic ones, on real ones, or on both.

Run: python benchmarks/transfer.py REAL [REAL ...] --checkpoint FILE [--from N] [--to N] [--sheet FILE]
         [--real-only N ...] [--fine-tune N ...] [--joint N ...] [--train-from N --train-to N] [--minutes M]
         [--clouds FILE]
     python benchmarks/transfer.py statistics FOLDER [FOLDER ...] [--count N] [--from N] [--to N]

REAL is a folder in one of the layouts of benchmarks/real_frames.py. ``--from`` and ``--to`` select the pairs that are
scored, ``--train-from`` and ``--train-to`` those of the first REAL that are trained on: N of them, or all. Both are
blocks of consecutive pairs, because neighbours of a drive show the same scene. ``--real-only`` trains on them from the
start, ``--fine-tune`` from the checkpoint, and so does ``--joint``, with as many synthetic frames of the checkpoint's
folder between them.
``statistics`` prints figures of labelled images, real ones or runs of ours. Docs: docs/baselines.md.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from real_frames import IGNORED, IMAGE_CLASSES, LAYOUTS, MERGED_CLOUD, MERGED_IMAGE, Frames, Layout, frames_of, of_names

from fieldtruth.core.errors import ConfigurationError, FieldtruthError

sys.path.append(str(Path(__file__).resolve().parents[1] / "examples"))

OTHER: Final = len(IMAGE_CLASSES)  # index of what a network predicts that no real frame is labelled with
FIRST_RATE, FINE_RATE = 3e-3, 1e-3  # learning rates of a first training and of one that goes on
DEFAULT_SIZE: Final = (136, 256)  # height and width without a checkpoint: those of examples/train_images.py
TILE: Final = 384  # [pixel] width of an image on the sheet
COLOURS: Final = np.array(
    [(1, 88, 255), (178, 176, 153), (128, 255, 0), (40, 80, 0), (255, 0, 0), (255, 0, 255)], np.uint8
)


class Row(NamedTuple):
    """A row of a table: pixels or points by true and predicted class of a network on some frames."""

    network: str
    frames: str
    layout: Layout
    matrix: NDArray[np.int64]
    """Rows are true: the classes of the layout, and others."""

    def figures(self) -> dict[str, float]:
        """Compute the intersection over union of each class and its means, and the share of all that is right."""
        from segmentation import iou

        classes, groups = self.layout.coarse_classes, MERGED_CLOUD if self.layout.is_cloud else MERGED_IMAGE
        right = dict(zip(classes, iou(self.matrix), strict=False))
        if self.layout.is_merged:
            right = dict.fromkeys(classes, np.float64("nan"))
        found = {name: float(value) for name, value in right.items()}
        of_groups = iou(merged(self.matrix, classes, groups))[:-1]
        found |= {"mean": _mean(list(found.values())), f"mean of {len(groups)}": _mean(list(of_groups))}
        counted = merged(self.matrix, classes, groups) if self.layout.is_merged else self.matrix
        return found | {"right": float(np.trace(counted) / max(counted.sum(), 1))}


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def merged(matrix: NDArray[np.int64], classes: Sequence[str], groups: Mapping[str, Sequence[str]]) -> NDArray[np.int64]:
    """Return a confusion of groups of classes and others; pixels whose true class is in no group do not count."""
    group = np.full(len(matrix), len(groups))
    for k, names in enumerate(groups.values()):
        group[[classes.index(name) for name in names]] = k
    found = np.zeros((len(groups) + 1, len(groups) + 1), np.int64)
    np.add.at(found, (group[:, None], group[None, :]), matrix)
    found[-1] = 0
    return found


def predicted(network: Any, settings: Any, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the class (h, w) of ``IMAGE_CLASSES``, or ``OTHER``, of each pixel of an image."""
    from segmentation import predict

    height, width = image.shape[:2]
    shares = predict(network, resized(image, settings.width)[None])[0]
    of = _of_network(settings)
    sums = np.stack([shares[of == k].sum(axis=0) for k in (*range(OTHER), IGNORED)], axis=-1)
    return np.asarray(cv2.resize(sums, (width, height)).argmax(axis=-1), np.uint8)


def _of_network(settings: Any) -> NDArray[np.uint8]:
    """Class of ``IMAGE_CLASSES`` by a network's; its water is trail, because real frames' puddles are."""
    of = of_names(settings.classes)
    return np.where(np.array(settings.classes) == "water", np.uint8(IMAGE_CLASSES.index("trail")), of)


def resized(image: NDArray[np.uint8], width: int, height: int | None = None) -> NDArray[np.uint8]:
    """Make an image, or a mask, ``width`` pixels wide; it keeps its shape unless ``height`` is given."""
    size = width, height or round(width / image.shape[1] * image.shape[0])
    method = cv2.INTER_NEAREST if image.ndim == 2 else cv2.INTER_AREA
    return np.asarray(cv2.resize(image, size, interpolation=method), np.uint8)


def score(network: Any, settings: Any, frames: Frames) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Count pixels by true and predicted class, (6, 6), and the share of right ones of each frame."""
    from segmentation import confusion

    each = []
    for k in range(len(frames)):
        image, truth = frames[k]
        each.append(confusion(truth, predicted(network, settings, image), OTHER + 1))
    right = [np.trace(matrix) / max(matrix.sum(), 1) for matrix in each]
    return np.sum(each, axis=0), np.array(right)


def training_set(frames: Frames, settings: Any) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Read images (n, h, w, 3) and masks (n, h, w) of a network's classes, of the size that it was made for."""
    from frame_arrays import small_image, small_mask

    of = list(_of_network(settings))
    index = np.full(256, IGNORED, np.uint8)
    index[: len(IMAGE_CLASSES)] = [of.index(k) if k in of else IGNORED for k in range(len(IMAGE_CLASSES))]
    images, masks = list[NDArray[np.uint8]](), list[NDArray[np.uint8]]()
    for k in range(len(frames)):
        image, mask = frames[k]
        images.append(small_image(image, settings.height, settings.width))
        masks.append(index[small_mask(mask, settings.height, settings.width)])
    return np.stack(images), np.stack(masks)


def trained(options: argparse.Namespace, count: str, *, goes_on: bool, joint: bool = False) -> tuple[Any, Any, int]:
    """Train a network on real pairs, from the checkpoint or from the start; return its settings and the pairs, too.

    If ``joint``, as many synthetic frames are between them, so that what these taught is not forgotten.
    """
    from augmentation import photos
    from segmentation import Settings, fit, load, make_network

    if options.checkpoint:
        network, settings = load(options.checkpoint)
    else:
        settings = Settings(IMAGE_CLASSES, *DEFAULT_SIZE)
    if not goes_on:
        network = make_network(settings)
    block = frames_of(options.real[0], options.layout).between(options.train_from, options.train_to)
    chosen = block if count == "all" else block.spread(int(count))
    images, masks = training_set(chosen, settings)
    if joint:
        own = synthetic_frames(options.checkpoint, settings)
        rows = np.arange(max(len(own[0]), len(images)))  # both equally often, and each frame about as often as another
        images, masks = (
            np.concatenate([each[rows % len(each)] for each in both]) for both in zip(own, (images, masks), strict=True)
        )
    budget: dict[str, Any] = {"steps": options.steps} if options.steps else {"minutes": options.minutes}
    rate = FINE_RATE if goes_on else FIRST_RATE
    fit(network, settings, images, masks, augment=photos, learning_rate=rate, **budget)
    return network, settings, len(chosen)


def synthetic_frames(checkpoint: Path, settings: Any) -> list[NDArray[np.uint8]]:
    """Return images and masks that a network was trained on, which ``train_images.py`` keeps beside its checkpoint.

    Raises:
        ConfigurationError: they are not there, or have another size.
    """
    files = [checkpoint.parent / "frames" / f"train.{name}.npy" for name in ("images", "masks")]
    if missing := [str(file) for file in files if not file.is_file()]:
        raise ConfigurationError(
            f"--joint needs the frames of the training beside {checkpoint}; there is no {missing[0]}"
        )
    try:
        found = [np.load(file, mmap_mode="r") for file in files]
    except ValueError as error:
        raise ConfigurationError(f"{files[0].parent} has no frames that can be read: {error}") from error
    if found[0].shape[1:3] != (settings.height, settings.width):
        size = "x".join(map(str, found[0].shape[2:0:-1]))
        raise ConfigurationError(
            f"{files[0]} has frames of {size}, {checkpoint} takes {settings.width}x{settings.height}"
        )
    return found


def networks(options: argparse.Namespace) -> Iterator[tuple[str, Any, Any]]:
    """Yield the networks that are asked for, with their names and settings."""
    from segmentation import load

    if options.checkpoint:
        network, settings = load(options.checkpoint)
        if settings.channels != 3:
            raise ConfigurationError(f"{options.checkpoint} is a network of clouds; --clouds scores those")
        if options.joint:
            synthetic_frames(options.checkpoint, settings)  # a mistake is found before the first network is scored
        yield "synthetic", network, settings
    for count in options.real_only:
        network, settings, pairs = trained(options, count, goes_on=False)
        yield f"real, {pairs} pairs", network, settings
    for count in options.fine_tune:
        network, settings, pairs = trained(options, count, goes_on=True)
        yield f"synthetic, then real, {pairs} pairs", network, settings
    for count in options.joint:
        network, settings, pairs = trained(options, count, goes_on=True, joint=True)
        yield f"synthetic, then both, {pairs} pairs", network, settings


def rows_of(options: argparse.Namespace) -> Iterator[Row]:
    """Score each network on each folder; write the sheet of the first on the first."""
    folders = [frames_of(folder, options.layout).between(options.start, options.end) for folder in options.real]
    for k, (name, network, settings) in enumerate(networks(options)):
        for folder, frames in zip(options.real, folders, strict=True):
            matrix, right = score(network, settings, frames)
            if options.sheet and k == 0 and folder == options.real[0]:
                worst = [int(n) for n in np.argsort(right)[: options.worst]]
                write_sheet(options.sheet, frames, worst, [predicted(network, settings, frames[n][0]) for n in worst])
            numbers = f"{frames.pairs[0].number} to {frames.pairs[-1].number}"
            yield Row(name, f"{frames.layout.name} {numbers} ({len(frames)})", frames.layout, matrix)


def rows_of_clouds(options: argparse.Namespace) -> Iterator[Row]:
    """Score a network of clouds on the clouds of each folder.

    The reflectivity is 0, which the augmentation has shown to the network: data sets have no common scale of it.
    """
    from frame_arrays import range_image
    from segmentation import confusion, load, predict

    network, settings = load(options.clouds)
    if settings.channels != 5:
        raise ConfigurationError(f"{options.clouds} is a network of images; --clouds needs one of train_clouds.py")
    for folder in options.real:
        frames = frames_of(folder, options.layout, clouds=True).between(options.start, options.end)
        other = len(frames.layout.coarse_classes)
        of = np.minimum(of_names(settings.classes, clouds=True), other)
        matrix = np.zeros((other + 1, other + 1), np.int64)
        for k in range(len(frames)):
            points, truth = frames[k]
            image, pixels = range_image(points[:, :3], np.zeros(len(points)), (settings.height, settings.width))
            found = predict(network, image[None])[0].argmax(axis=0)
            matrix += confusion(truth, of[found[pixels]], other + 1)
        yield Row("synthetic", f"{frames.layout.name} ({len(frames)})", frames.layout, matrix)


def write_sheet(path: Path, frames: Frames, chosen: Sequence[int], masks: Sequence[NDArray[np.uint8]]) -> None:
    """Write a picture with a row for each chosen frame: its number and image, its truth, and a prediction."""
    colours = np.zeros((256, 3), np.uint8)
    colours[: len(COLOURS)] = COLOURS
    rows = []
    for n, mask in zip(chosen, masks, strict=True):
        image, truth = frames[n]
        tile = resized(image, TILE)
        cv2.putText(tile, str(frames.pairs[n].number), (6, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (255, 0, 255), 2)
        height = len(tile)
        tiles = [tile, *(colours[resized(each, TILE, height)] for each in (truth, mask))]
        rows.append(np.hstack(tiles))
    if not cv2.imwrite(str(path), cv2.cvtColor(np.vstack(rows), cv2.COLOR_RGB2BGR)):
        raise ConfigurationError(f"{path} cannot be written")


def table(rows: Sequence[Row]) -> str:
    """Markdown table of intersections over union [%]."""
    names = list(rows[0].figures())
    lines = ["| network | frames | " + " | ".join(names) + " |", "|---|---|" + "---:|" * len(names)]
    for row in rows:
        cells = ["-" if np.isnan(value) else f"{100.0 * value:.1f}" for value in row.figures().values()]
        lines.append(f"| {row.network} | {row.frames} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table; a user's mistake is one line and exit code 2."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if given[:1] == ["statistics"]:
            _statistics(given[1:])
        else:
            _scores(given)
    except FieldtruthError as error:
        print(f"transfer.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _scores(given: Sequence[str]) -> None:
    options = _parser().parse_args(given)
    if not (options.checkpoint or options.real_only or options.clouds):
        raise ConfigurationError("--checkpoint, --real-only or --clouds is needed: there is no network to score")
    for name in ("fine_tune", "joint"):
        if getattr(options, name) and not options.checkpoint:
            raise ConfigurationError(f"--{name.replace('_', '-')} needs --checkpoint, from which it goes on")
    if options.real_only or options.fine_tune or options.joint:
        _check_blocks(options)
    check_outputs(options.sheet, options.json)
    if options.sheet is not None and options.sheet.suffix.lower() not in (".png", ".jpg"):
        raise ConfigurationError(f"--sheet must end with .png or .jpg, got {options.sheet}")
    written = list[Row]()
    for rows in (
        rows_of(options) if options.checkpoint or options.real_only else (),
        rows_of_clouds(options) if options.clouds else (),
    ):
        for k, row in enumerate(rows):  # each when it is there, because the next one may take an hour
            print(table([row]) if k == 0 else table([row]).splitlines()[-1], flush=True)
            written.append(row)
            if options.json:
                _write_json(options.json, written)


def check_outputs(*paths: Path | None) -> None:
    """Raise ``ConfigurationError`` if the folder of a file that is to be written does not exist."""
    for path in paths:
        if path is not None and not path.absolute().parent.is_dir():
            raise ConfigurationError(f"{path} cannot be written: {path.absolute().parent} is not a folder")


def _write_json(path: Path, rows: Sequence[Row]) -> None:
    """Write figures, null in place of NaN, and confusions to a file that is whole at any time."""
    found = [
        {
            "network": row.network,
            "frames": row.frames,
            "figures": {name: None if np.isnan(value) else value for name, value in row.figures().items()},
            "matrix": row.matrix.tolist(),
        }
        for row in rows
    ]
    part = path.with_name(f"{path.name}.part")
    part.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    part.replace(path)


def _check_blocks(options: argparse.Namespace) -> None:
    """Check the block to train on.

    Raises:
        ConfigurationError: it is missing, or has pairs that are scored.
    """
    if options.train_to is None:
        raise ConfigurationError(
            "--real-only, --fine-tune and --joint need --train-from and --train-to, the pairs to train on"
        )
    if options.train_from < options.end and options.start < options.train_to:
        text = f"{options.train_from} to {options.train_to} and {options.start} to {options.end} overlap"
        raise ConfigurationError(f"pairs to train on and pairs to score must be apart: {text}")


def _statistics(given: Sequence[str]) -> None:
    from scene_statistics import images_of, statistics, table

    parser = argparse.ArgumentParser(prog="transfer.py statistics", description=images_of.__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="runs of ours, or real pairs")
    parser.add_argument("--count", type=_number, default=200, help="images of each folder, evenly spaced")
    parser.add_argument("--from", dest="start", type=int, default=0, help="number of the first pair, of real ones")
    parser.add_argument("--to", dest="end", type=int, default=sys.maxsize, help="number after the last one")
    options = parser.parse_args(given)
    found = {str(folder): images_of(folder, options.start, options.end) for folder in options.folders}
    print(table({name: statistics(images, options.count) for name, images in found.items()}))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="transfer.py", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("real", nargs="+", type=Path, metavar="REAL", help="folder of real pairs")
    names = ", ".join(layout.name for layout in LAYOUTS)
    parser.add_argument("--layout", default="", help=f"{names}; by default the first that has pairs there")
    parser.add_argument("--from", dest="start", type=int, default=0, help="number of the first pair that is scored")
    parser.add_argument("--to", dest="end", type=int, default=sys.maxsize, help="number after the last one")
    parser.add_argument("--checkpoint", type=Path, help="network trained by examples/train_images.py")
    parser.add_argument("--clouds", type=Path, help="network trained by examples/train_clouds.py, scored on clouds")
    parser.add_argument("--real-only", nargs="+", type=_count, default=[], metavar="N", help="pairs, or all")
    parser.add_argument("--fine-tune", nargs="+", type=_count, default=[], metavar="N", help="pairs, or all")
    parser.add_argument(
        "--joint", nargs="+", type=_count, default=[], metavar="N", help="pairs, or all, between synthetic ones"
    )
    parser.add_argument("--train-from", type=int, default=0, help="number of the first pair to train on")
    parser.add_argument("--train-to", type=int, help="number after the last one")
    parser.add_argument("--minutes", type=_positive, default=5.0, help="of each training")
    parser.add_argument("--steps", type=_number, help="of each training, in place of minutes")
    parser.add_argument("--sheet", type=Path, help="picture of the worst frames: image, truth, prediction")
    parser.add_argument("--worst", type=_number, default=8, help="frames on the sheet")
    parser.add_argument("--json", type=Path, help="file for figures and confusions")
    return parser


def _count(text: str) -> str:
    if text != "all" and not (text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"must be a number of pairs, at least 1, or all; got {text!r}")
    return text


def _number(text: str) -> int:
    if not (text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"must be at least 1, got {text!r}")
    return int(text)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not 0.0 < value < np.inf:
        raise argparse.ArgumentTypeError(f"must be a time above 0, got {text!r}")
    return value


if __name__ == "__main__":
    main()

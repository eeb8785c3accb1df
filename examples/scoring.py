# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Scores of a trained network as files: figures, confusion, calibration, and a sheet of predictions."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import segmentation
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from torch import nn

BINS = 15
SHEET_ROWS = 12
GAP = 4  # pixels between the pictures of a sheet
CHUNK = 64


class Scores(NamedTuple):
    """Counts over all pixels of a set of frames."""

    confusion: NDArray[np.int64]
    """(classes, classes): true class by row, predicted class by column."""
    reliability: NDArray[np.float64]
    """(3, BINS): pixels, sum of their confidence and number of right ones, by confidence."""


class Pictures(NamedTuple):
    """How a sheet shows frames and classes."""

    colours: NDArray[np.uint8]
    """(classes, 3) RGB."""
    shown: Callable[[NDArray[Any]], NDArray[np.uint8]]
    """Returns a picture, (h, w, 3), of an image as the network takes it."""


def score(network: nn.Module, images: NDArray[Any], masks: NDArray[np.uint8], classes: int) -> Scores:
    """Predict all frames, some at a time, and count."""
    matrix, bins = np.zeros((classes, classes), np.int64), np.zeros((3, BINS))
    for first in range(0, len(images), CHUNK):
        truth = np.asarray(masks[first : first + CHUNK])
        found = segmentation.predict(network, images[first : first + CHUNK])
        predicted, confidence = found.argmax(axis=1), found.max(axis=1)
        matrix += segmentation.confusion(truth, predicted, classes)
        counted = truth < classes
        bins += reliability(confidence[counted], (predicted == truth)[counted])
    return Scores(matrix, bins)


def reliability(confidence: NDArray[np.float32], is_right: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return (3, BINS): number of predictions, sum of their confidence, and number of right ones, by confidence."""
    rows = np.minimum((confidence * BINS).astype(np.int64), BINS - 1)
    sums = [np.bincount(rows, weights, minlength=BINS) for weights in (None, confidence, is_right)]
    return np.array(sums, np.float64)


def calibration_error(bins: NDArray[np.float64]) -> float:
    """Return the expected calibration error: mean difference of confidence and share of right ones, over pixels."""
    return float(np.abs(bins[1] - bins[2]).sum() / max(1.0, bins[0].sum()))


def figures(scores: Scores, classes: tuple[str, ...]) -> dict[str, Any]:
    """Return what ``scores.json`` has; the mean is over classes that have a true pixel."""
    matrix = scores.confusion
    each, right, pixels = segmentation.iou(matrix), int(np.trace(matrix)), int(matrix.sum())
    return {
        "mean_iou": round(float(np.nanmean(each)), 4),
        "iou": {name: None if np.isnan(x) else round(float(x), 4) for name, x in zip(classes, each, strict=True)},
        "accuracy": round(right / max(1, pixels), 4),
        "calibration_error": round(calibration_error(scores.reliability), 4),
        "majority_iou": round(majority_iou(matrix), 4),
        "share": {name: round(n / max(1, pixels), 5) for name, n in zip(classes, matrix.sum(axis=1), strict=True)},
        "pixels": pixels,
    }


def majority_iou(matrix: NDArray[np.int64]) -> float:
    """Return the mean IoU of the answer that is the most frequent class everywhere."""
    true = matrix.sum(axis=1)
    return float(true.max() / max(1, true.sum()) / max(1, (true > 0).sum()))


def write(folder: Path, scores: Scores, classes: tuple[str, ...], **more: Any) -> dict[str, Any]:
    """Write ``scores.json`` with the figures and ``more``, ``confusion.csv`` and ``.png``, and ``calibration.png``."""
    found = figures(scores, classes) | more
    (folder / "scores.json").write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    with (folder / "confusion.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["true \\ predicted", *classes])
        rows.writerows([name, *row] for name, row in zip(classes, scores.confusion.tolist(), strict=True))
    _draw_confusion(folder / "confusion.png", scores.confusion, classes)
    _draw_reliability(folder / "calibration.png", scores.reliability)
    return found


def table(found: dict[str, Any]) -> str:
    """Return figures as lines."""
    shown = found["iou"] | {name: found[name] for name in ("mean_iou", "accuracy", "calibration_error")}
    texts = {name: "-" if value is None else f"{value:.3f}" for name, value in shown.items()}
    return "\n".join(f"{name.replace('_', ' '):<32}{text:>6}" for name, text in texts.items())


def write_sheet(
    path: Path, network: nn.Module, images: NDArray[Any], masks: NDArray[np.uint8], pictures: Pictures
) -> None:
    """Write a sheet of some frames, evenly taken: image, truth and prediction beside each other.

    Pixels that do not count are black in the truth.
    """
    rows = np.unique(np.linspace(0, len(images) - 1, SHEET_ROWS).round().astype(int))
    chosen, truth = np.asarray(images[rows]), np.asarray(masks[rows])
    predicted = segmentation.predict(network, chosen).argmax(axis=1)
    colours = np.zeros((256, 3), np.uint8)
    colours[: len(pictures.colours)] = pictures.colours
    cells = [
        np.stack([pictures.shown(image), colours[true], colours[own]])
        for image, true, own in zip(chosen, truth, predicted, strict=True)
    ]
    n, (_, h, w, _) = len(cells), cells[0].shape
    beside = w < 3 * h  # wide pictures, as of a LiDAR, stand below each other
    sheet = np.full((n, 3, h + GAP, w + GAP, 3), 255, np.uint8)
    sheet[:, :, :h, :w] = cells
    sheet = sheet.transpose((0, 2, 1, 3, 4)) if beside else sheet
    height = n * (h + GAP) * (1 if beside else 3)
    Image.fromarray(np.ascontiguousarray(sheet).reshape(height, -1, 3)).save(path)


def _draw_confusion(path: Path, matrix: NDArray[np.int64], classes: tuple[str, ...]) -> None:
    shares = matrix / np.maximum(1, matrix.sum(axis=1, keepdims=True))
    size = 2.5 + 0.55 * len(classes)
    figure = Figure(figsize=(size + 0.6, size), layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    for (i, j), share in np.ndenumerate(shares):
        colour = "white" if share > 0.5 else "black"
        axes.text(j, i, f"{100 * share:.0f}", ha="center", va="center", color=colour, fontsize=8)
    axes.set_xticks(range(len(classes)), classes, rotation=60, ha="right")
    axes.set_yticks(range(len(classes)), classes)
    axes.set(xlabel="predicted", ylabel="true", title="share of each true class [%]")
    figure.savefig(path, dpi=120)


def _draw_reliability(path: Path, bins: NDArray[np.float64]) -> None:
    count, confidence, right = bins[:, bins[0] > 0]
    figure = Figure(figsize=(4.5, 4.5), layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    axes.scatter(
        confidence / count, right / count, s=4 + 200 * count / count.sum(), color=mpl.color_sequences["tab10"][0]
    )
    axes.set(xlabel="confidence", ylabel="share that is right", xlim=(0, 1), ylim=(0, 1))
    axes.set_title(f"expected calibration error {calibration_error(bins):.3f}")
    figure.savefig(path, dpi=120)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of labelled images that say how scenes are composed and coloured, for real frames and for our own."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray
from photo_figures import LUMINANCE
from real_frames import IGNORED, IMAGE_CLASSES, frames_of, of_own_classes

import fieldtruth as ft
from fieldtruth.core.arrays import Array

WIDTH: Final = 512
_SKY, _TRAIL, _GRASS, _VEGETATION = (IMAGE_CLASSES.index(name) for name in ("sky", "trail", "grass", "vegetation"))
_FEW: Final = 50  # [pixel] of a class, below which an image says nothing of it
PERCENTILES: Final = (10, 50, 90)


class LabelledImages(Protocol):
    """Images (h, w, 3) uint8 with masks (h, w) uint8 of ``IMAGE_CLASSES``, by index."""

    def __len__(self) -> int:
        """Return the number of images."""

    def __getitem__(self, index: int) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Return image and mask."""


class OwnFrames:
    """Labelled images of a folder of our runs.

    Raises:
        ft.ConfigurationError: it has no runs.
    """

    def __init__(self, folder: Path) -> None:
        self.runs = ft.open_runs(folder, items=("image", "mask"))
        self.classes = of_own_classes()

    def __len__(self) -> int:
        """Return the number of images."""
        return len(self.runs)

    def __getitem__(self, index: int) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Return image and mask; classes of the users' own are ignored."""
        sample = self.runs[index]
        mask = np.minimum(sample["mask"], len(self.classes))
        return sample["image"].transpose(1, 2, 0), np.append(self.classes, np.uint8(IGNORED))[mask]


def images_of(folder: Path, start: int = 0, end: int = sys.maxsize) -> LabelledImages:
    """Find labelled images: our runs, or those of a layout of a data set, of these numbers.

    Raises:
        ft.ConfigurationError: there are neither.
    """
    if folder.is_dir() and any(next(folder.rglob(name), None) for name in ("*.bag", "*.mcap", "*.db3")):
        return OwnFrames(folder)
    return frames_of(folder).between(start, end)


def figures(image: NDArray[np.uint8], mask: NDArray[np.uint8]) -> dict[str, float]:
    """Compute the figures of one image, made ``WIDTH`` pixels wide; NaN where it has too little of a class."""
    size = WIDTH, round(WIDTH / mask.shape[1] * mask.shape[0])
    image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    mask = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    known = mask != IGNORED
    found = {"without a class [%]": 100.0 * float((~known).mean())}
    for k, name in enumerate(IMAGE_CLASSES):
        found[f"{name} [%]"] = 100.0 * float((mask == k).sum() / max(known.sum(), 1))
    return found | _places(mask) | _light(image) | _colours(image, mask)


def _places(mask: NDArray[np.uint8]) -> dict[str, float]:
    """Where classes are in an image."""
    height, width = mask.shape
    sky, ground = mask == _SKY, (mask == _TRAIL) | (mask == _GRASS)
    with_sky, with_ground = sky.any(axis=0), ground.any(axis=0)
    sky_ends = (height - np.argmax(sky[::-1], axis=0))[with_sky] / height
    ground_begins = np.argmax(ground, axis=0)[with_ground] / height
    centre = mask[:, round(0.475 * width) : round(0.525 * width)]
    at_feet, ahead = mask[round(0.95 * height) :], mask[round(0.7 * height) : round(0.75 * height)]
    beside = (mask[:, 1:] != IGNORED) & (mask[:, :-1] != IGNORED)
    return {
        "row where the sky ends [% of height]": 100.0 * _median(sky_ends),
        "row where the ground begins [% of height]": 100.0 * _median(ground_begins),
        "vegetation in the middle columns [%]": 100.0 * float((centre == _VEGETATION).mean()),
        "middle column with vegetation [% of frames]": 100.0 * float((centre == _VEGETATION).any()),
        "trail in the lowest rows [%]": 100.0 * float((at_feet == _TRAIL).mean()),
        "trail at 0.7 of the height [%]": 100.0 * float((ahead == _TRAIL).mean()),
        "borders of classes per row": float(((mask[:, 1:] != mask[:, :-1]) & beside).sum() / height),
    }


def _light(image: NDArray[np.uint8]) -> dict[str, float]:
    """Luminance of an image, from 0 to 1, and its extremes."""
    luminance = image @ LUMINANCE / 255.0
    return {
        "luminance": float(luminance.mean()),
        "clipped to white [%]": 100.0 * float((image.min(axis=-1) >= 250).mean()),
        "a channel clipped [%]": 100.0 * float((image.max(axis=-1) >= 250).mean()),
        "darker than 3 % [%]": 100.0 * float((luminance < 0.03).mean()),
    }


def _colours(image: NDArray[np.uint8], mask: NDArray[np.uint8]) -> dict[str, float]:
    """Colour and texture of each class."""
    luminance = image @ LUMINANCE / 255.0
    step, same = np.abs(np.diff(luminance, axis=1)), mask[:, 1:] == mask[:, :-1]
    found: dict[str, float] = {}
    for k, name in enumerate(IMAGE_CLASSES):
        at = mask == k
        enough = at.sum() >= _FEW
        rgb = image[at].mean(axis=0) if enough else np.full(3, np.nan)
        hue, saturation = hue_and_saturation(rgb)
        found |= {
            f"{name}: red": float(rgb[0]),
            f"{name}: green": float(rgb[1]),
            f"{name}: blue": float(rgb[2]),
            f"{name}: hue [degree]": hue,
            f"{name}: saturation": saturation,
            f"{name}: luminance, 10th percentile": float(np.percentile(luminance[at], 10)) if enough else np.nan,
            f"{name}: luminance, 90th percentile": float(np.percentile(luminance[at], 90)) if enough else np.nan,
            f"{name}: contrast of neighbours [%]": 100.0 * float(step[same & at[:, 1:]].mean()) if enough else np.nan,
        }
    return found


def hue_and_saturation(rgb: Array) -> tuple[float, float]:
    """Hue [degree], from -90 to 270 so that reds and browns are beside each other, and saturation of a mean colour."""
    hue, saturation, _ = cv2.cvtColor((rgb / 255.0).astype(np.float32).reshape(1, 1, 3), cv2.COLOR_RGB2HSV)[0, 0]
    return float((hue + 90.0) % 360.0 - 90.0), float(saturation)


def _median(values: NDArray[Any]) -> float:
    return float(np.median(values)) if values.size else float("nan")


def statistics(images: LabelledImages, count: int) -> dict[str, Array]:
    """Mean and ``PERCENTILES`` over images, by name of the figure.

    Args:
        images: of which to take figures.
        count: of images, evenly spaced; all if there are fewer.
    """
    at = np.unique(np.round(np.linspace(0, len(images) - 1, min(count, len(images)))).astype(int))
    rows = [figures(*images[int(k)]) for k in at]
    found = {}
    for name in rows[0]:
        values = np.array([row[name] for row in rows])
        values = values[np.isfinite(values)]
        found[name] = (
            np.array([values.mean(), *np.percentile(values, PERCENTILES)]) if values.size else np.full(4, np.nan)
        )
    return found


def table(columns: Mapping[str, Mapping[str, Array]]) -> str:
    """Markdown table of statistics by name of the set: mean, and percentiles in brackets."""
    names: Sequence[str] = list(next(iter(columns.values())))
    head = f"| mean ({PERCENTILES[0]}th, median, {PERCENTILES[-1]}th percentile) | " + " | ".join(columns) + " |"
    lines = [head, "|---" * (len(columns) + 1) + "|"]
    for name in names:
        cells = [_cell(column[name]) for column in columns.values()]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(values: Array) -> str:
    if np.isnan(values).all():
        return "none"
    return f"{values[0]:.3g} ({', '.join(f'{value:.3g}' for value in values[1:])})"

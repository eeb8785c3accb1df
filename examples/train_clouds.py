# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Train a network that gives a class to each point of a cloud: train_clouds.py DATA --out FOLDER.

The cloud of a LiDAR that turns is an image: a row for each ring, a column for each direction, with x, y, z,
reflectivity and whether there is a return. DATA and FOLDER are those of train_images.py. See docs/baselines.md.
"""

from dataclasses import dataclass
from typing import Any

import augmentation
import baseline
import frame_arrays
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

import fieldtruth as ft
from fieldtruth.ontology import label_map_of

CHANNELS = 5
SHOWN_M = 40.0  # range of the brightest pixels of a picture


@dataclass(frozen=True)
class RangeImage:
    """Makes the range image of a sample, and its mask.

    Attributes:
        rings: of the LiDAR.
        columns: of the LiDAR.
        width: columns of the image; where it has fewer, the nearest return counts.
        classes: of the mask.
    """

    rings: int
    columns: int
    width: int
    classes: frame_arrays.Classes

    def __call__(self, sample: Any) -> tuple[NDArray[np.float16], NDArray[np.uint8]]:
        """Return (rings, width, 5): x, y, z [m], reflectivity, and 1 where there is a return; and (rings, width)."""
        xyz = sample["cloud"]
        far_first = np.argsort(-np.linalg.norm(xyz, axis=1), kind="stable")
        ring, column = sample["rays"][far_first, 0], sample["rays"][far_first, 1] * self.width // self.columns
        inside = (ring < self.rings) & (column < self.width)
        rows, pixels = far_first[inside], (ring[inside], column[inside])
        image = np.zeros((self.rings, self.width, CHANNELS), np.float16)
        image[pixels] = np.column_stack([xyz[rows], sample["reflectivity"][rows], np.ones(len(rows))])
        mask = np.full((self.rings, self.width), frame_arrays.IGNORED, np.uint8)
        mask[pixels] = self.classes.index[sample["labels"][rows]]
        return image, mask


def shown(image: NDArray[np.float16]) -> NDArray[np.uint8]:
    """Return a picture of the ranges."""
    ranges = np.linalg.norm(image[..., :3].astype(np.float32), axis=-1)
    colours = mpl.colormaps["viridis"](np.sqrt(ranges / SHOWN_M), bytes=True)[..., :3]
    return np.where(image[..., 4:] > 0, colours, 0).astype(np.uint8)


def pattern_of(runs: ft.Runs) -> tuple[int, int]:
    """Return the numbers of rings and columns, by the returns of the first frames of each run, in multiples of 8."""
    rays = [run[k]["rays"][:, :2].max(axis=0) for run in runs.runs for k in range(min(3, len(run)))]
    rings, columns = (int(8 * np.ceil((most + 1) / 8)) for most in np.max(rays, axis=0))
    return rings, columns


def main(arguments: list[str]) -> None:
    """Read frames, train, score."""
    parser = baseline.parser(__doc__, "range", "", 4000)
    parser.add_argument("--width", type=int, default=512, help="columns of the range image (512, or the LiDAR's)")
    parser.add_argument("--lidar", help="a LiDAR of the rig (the first)")
    options = parser.parse_args(arguments)
    rays = frame_arrays.splits_of(options.data, options.seed, items=("rays",), lidar=options.lidar)["train"]
    rings, columns = pattern_of(rays)
    width = min(options.width, columns)
    task = baseline.Task(
        items=("cloud", "labels", "reflectivity", "rays"),
        sensor={"lidar": options.lidar},
        shrink=RangeImage(rings, columns, width, frame_arrays.classes_of(label_map_of(options.label_map))),
        size=(rings, width, CHANNELS),
        augment=augmentation.clouds,
        shown=shown,
    )
    baseline.run(task, options)


if __name__ == "__main__":
    baseline.call(main)

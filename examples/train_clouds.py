# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Train a network that gives a class to each point of a cloud: train_clouds.py DATA --out FOLDER.

A cloud becomes an image: rows by elevation, columns by azimuth, with x, y, z, reflectivity and whether there is a
return. DATA and FOLDER are those of train_images.py. See docs/baselines.md.
"""

from dataclasses import dataclass
from typing import Any

import augmentation
import baseline
import frame_arrays
import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from fieldtruth.ontology import label_map_of

CHANNELS = 5
SHOWN_M = 40.0  # range of the brightest pixels of a picture


@dataclass(frozen=True)
class RangeImage:
    """Makes the range image of a sample, and its mask.

    Attributes:
        shape: rows and columns of the image.
        classes: of the mask.
    """

    shape: tuple[int, int]
    classes: frame_arrays.Classes

    def __call__(self, sample: Any) -> tuple[NDArray[np.float16], NDArray[np.uint8]]:
        """Return (rows, columns, 5): x, y, z [m], reflectivity, and 1 where there is a return; and (rows, columns)."""
        image, (row, column) = frame_arrays.range_image(sample["cloud"], sample["reflectivity"], self.shape)
        mask = np.full(self.shape, frame_arrays.IGNORED, np.uint8)
        far_first = frame_arrays.far_first(sample["cloud"])
        mask[row[far_first], column[far_first]] = self.classes.index[sample["labels"][far_first]]
        return image.astype(np.float16), mask


def shown(image: NDArray[np.float16]) -> NDArray[np.uint8]:
    """Return a picture of the ranges."""
    ranges = np.linalg.norm(image[..., :3].astype(np.float32), axis=-1)
    colours = mpl.colormaps["viridis"](np.sqrt(ranges / SHOWN_M), bytes=True)[..., :3]
    return np.where(image[..., 4:] > 0, colours, 0).astype(np.uint8)


def main(arguments: list[str]) -> None:
    """Read frames, train, score."""
    parser = baseline.parser(__doc__, "range", "", 4000)
    parser.add_argument("--width", type=int, default=512, help="columns of the range image (512)")
    parser.add_argument("--height", type=int, default=64, help="rows of it (64)")
    parser.add_argument("--lidar", help="a LiDAR of the rig (the first)")
    options = parser.parse_args(arguments)
    shape = options.height, options.width
    task = baseline.Task(
        items=("cloud", "labels", "reflectivity"),
        sensor={"lidar": options.lidar},
        shrink=RangeImage(shape, frame_arrays.classes_of(label_map_of(options.label_map))),
        size=(*shape, CHANNELS),
        augment=augmentation.clouds,
        shown=shown,
    )
    baseline.run(task, options)


if __name__ == "__main__":
    baseline.call(main)

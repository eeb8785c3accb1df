# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Train a network that gives a class to each pixel of a photograph: train_images.py DATA --out FOLDER.

DATA is the folder of a campaign, with train, val and test; of another folder of runs, worlds are drawn for these. The
same command goes on after an interruption. In FOLDER are then network.pt, scores.json, confusion.csv and .png,
calibration.png, predictions.png and tensorboard. See docs/baselines.md.
"""

from dataclasses import dataclass
from typing import Any

import augmentation
import baseline
import frame_arrays
import numpy as np
from numpy.typing import NDArray

from fieldtruth.ontology import label_map_of


@dataclass(frozen=True)
class Shrink:
    """Makes image and mask of a sample, of the size of the network."""

    height: int
    width: int
    classes: frame_arrays.Classes

    def __call__(self, sample: Any) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return (h, w, 3) and (h, w)."""
        image = frame_arrays.small_image(sample["image"].transpose(1, 2, 0), self.height, self.width)
        return image, frame_arrays.small_mask(self.classes.index[sample["mask"]], self.height, self.width)


def main(arguments: list[str]) -> None:
    """Read frames, train, score."""
    parser = baseline.parser(__doc__, "unet", ", or efficientnet-lite0 with weights of ImageNet", 6000)
    parser.add_argument("--width", type=int, default=256, help="of the images of the network [pixel] (256)")
    parser.add_argument("--height", type=int, default=136, help="of them [pixel] (136)")
    parser.add_argument("--camera", help="a camera of the rig (the first)")
    options = parser.parse_args(arguments)
    task = baseline.Task(
        items=("image", "mask"),
        sensor={"camera": options.camera},
        shrink=Shrink(options.height, options.width, frame_arrays.classes_of(label_map_of(options.label_map))),
        size=(options.height, options.width, 3),
        augment=augmentation.photos,
        shown=lambda image: image,
    )
    baseline.run(task, options)


if __name__ == "__main__":
    baseline.call(main)

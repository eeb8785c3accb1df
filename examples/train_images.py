# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Train a network that gives a class to each pixel of a photograph: train_images.py DATA --out FOLDER.

DATA is the folder of a campaign, with train, val and test; of another folder of runs, worlds are drawn for these. The
same command goes on after an interruption. In FOLDER are then network.pt, scores.json, confusion.csv and .png,
calibration.png, predictions.png and tensorboard. See docs/baselines.md.
"""

import argparse
import os
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import augmentation
import frames
import numpy as np
import scoring
import segmentation
from numpy.typing import NDArray
from torch import nn

import fieldtruth as ft
from fieldtruth.ontology import label_map_of

WATCHED = 96  # frames of val that are scored in the middle of the training


def parsed(arguments: list[str]) -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of runs")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="folder of the results")
    parser.add_argument("--minutes", type=float, default=50.0, help="time of the training; reading comes on top (50)")
    parser.add_argument("--label-map", default="offroad", help="classes, from `fieldtruth list label-maps` (offroad)")
    parser.add_argument("--network", default="unet", help="unet, or efficientnet-lite0 with weights of ImageNet (unet)")
    parser.add_argument("--width", type=int, default=256, help="of the images of the network [pixel] (256)")
    parser.add_argument("--height", type=int, default=136, help="of them [pixel] (136)")
    parser.add_argument("--camera", help="a camera of the rig (the first)")
    parser.add_argument("--frames", type=int, default=6000, help="most frames of train; a quarter in others (6000)")
    parser.add_argument("--batch", type=int, default=16, help="images in a step (16)")
    parser.add_argument("--learning-rate", type=float, default=3e-3, help="the highest (0.003)")
    parser.add_argument("--seed", type=int, default=0, help="of first weights, order and augmentation (0)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes that read (all cores)")
    return parser.parse_args(arguments)


@dataclass(frozen=True)
class Shrink:
    """Makes image and mask of a sample, of the size of the network."""

    height: int
    width: int
    classes: frames.Classes

    def __call__(self, sample: Any) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return (h, w, 3) and (h, w)."""
        image = frames.small_image(sample["image"].transpose(1, 2, 0), self.height, self.width)
        mask = self.classes.index[sample["mask"]]
        return image, frames.small_mask(mask, self.height, self.width)


def watched(
    images: NDArray[np.uint8], masks: NDArray[np.uint8], classes: tuple[str, ...], network: nn.Module
) -> dict[str, float]:
    """Return figures in the middle of the training."""
    found = scoring.figures(scoring.score(network, images, masks, len(classes)), classes)
    return {"mean IoU of val": found["mean_iou"]}


def main(arguments: list[str]) -> None:
    """Read frames, train, score."""
    options = parsed(arguments)
    classes = frames.classes_of(label_map_of(options.label_map))
    settings = segmentation.Settings(classes.names, options.height, options.width, 3, options.network, options.seed)
    network = segmentation.make_network(settings)
    opened = {"items": ("image", "mask"), "label_map": options.label_map, "camera": options.camera}
    shrink = Shrink(options.height, options.width, classes)
    key = opened | {"size": [options.height, options.width], "data": str(options.data.resolve())}
    arrays = {
        name: frames.read(
            runs,
            shrink,
            options.frames // (1 if name == "train" else 4),
            options.out / "frames" / name,
            key,
            options.workers,
        )
        for name, runs in frames.splits_of(options.data, options.seed, **opened).items()
    }
    val = arrays["val"] if "val" in arrays else arrays["test"]
    step = max(1, len(val[0]) // WATCHED)
    segmentation.fit(
        network,
        settings,
        *arrays["train"],
        out=options.out,
        minutes=options.minutes,
        batch=options.batch,
        learning_rate=options.learning_rate,
        augment=augmentation.photos,
        watch=partial(watched, val[0][::step], val[1][::step], classes.names),
    )
    split = "test" if "test" in arrays else "val"
    images, masks = arrays[split]
    scores = scoring.score(network, images, masks, len(classes.names))
    found = scoring.write(options.out, scores, classes.names, split=split, frames=len(images))
    pictures = scoring.Pictures(classes.colours, lambda image: np.asarray(image, np.uint8))
    scoring.write_sheet(options.out / "predictions.png", network, images, masks, pictures)
    print(f"{split}:\n{scoring.table(found)}")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except ft.FieldtruthError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)

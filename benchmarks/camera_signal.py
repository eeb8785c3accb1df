# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of each effect of a camera's signal, and figures of the photographs of real and ideal cameras.

Run: python benchmarks/camera_signal.py [--save FOLDER] [park_1 ...]. Times are of one thread, beside the ideal
photograph of the same pose; the least of a few. Docs: docs/camera_signal.md.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from photo_figures import kurtosis, local_contrast, spectrum_slope
from views import poses_on_route

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.catalogue import datasheet_of, preset_of
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig, CameraSignal, StereoConfig
from fieldtruth.sensors.camera.photo import LUMINANCE
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.sensors.camera.sensor import camera_jpeg
from fieldtruth.world.build import world_of

YAW_RATE = 0.5  # [rad/s] of the robot that turns
STAMP_NS = 1_000_000_000

EFFECTS: dict[str, dict[str, Any]] = {
    "vignetting": {"vignetting_power": 4.0},
    "glare": {"glare": 0.03},
    "lens blur": {"lens_blur_px": 0.5},
    "automatic exposure": {"exposure": "automatic", "metering_time_s": 0.3},
    "grey world": {"gray_world": 0.3},
    "photon and read noise": {"photon_noise": True, "full_well_e": 6300.0, "read_noise_e": 2.5, "bits": 10},
    "pattern noise": {"full_well_e": 6300.0, "prnu": 0.01, "dsnu_e": 1.0},
    "mosaic": {"mosaic": "rggb"},
    "mosaic with noise": {"mosaic": "rggb", "photon_noise": True, "full_well_e": 6300.0, "read_noise_e": 2.5},
    "response sRGB": {"response": "srgb"},
    "rolling shutter, 18 ms": {"readout_ms": 18.0},
    **{f"blur, {n} sub-frames": {"exposure_time_ms": 50.0, "blur_samples": n} for n in (2, 4, 8)},
    "rolling shutter and 4 sub-frames": {"readout_ms": 18.0, "exposure_time_ms": 50.0, "blur_samples": 4},
    "bloom": {"bloom": 0.05},
    "chromatic aberration": {"chromatic_px": (0.9, -0.7)},
    "fringes": {"fringe_px": (0.8, 1.2)},
    "colour matrix": {"colour_matrix": preset_of("camera", "robot")["colour_matrix"]},
    "sharpening": {"sharpening": 0.9, "sharpening_px": 1.6},
    "20 drops on the glass": {"lens_drops": 20},
    "20 specks of dust on it": {"lens_dust": 20},
    "preset robot": preset_of("camera", "robot"),
    "datasheet of the ZED 2": datasheet_of("camera", "zed_2"),
}


def turning(pose: Array) -> Callable[[Any], Array]:
    """Poses world_from_base of a robot that turns on the spot, and has a pose at the stamp."""

    def at(stamps: Any) -> Array:
        angles = np.degrees(YAW_RATE * (np.atleast_1d(stamps) - STAMP_NS) / 1e9)
        poses = pose @ np.stack([transforms.pose((0, 0, 0), (0, 0, float(angle))) for angle in angles])
        return np.asarray(poses if isinstance(stamps, np.ndarray) else poses[0])

    return at


def least(work: Callable[[], object], tries: int) -> float:
    """CPU time [ms] of a thread."""
    work()
    times = []
    for _ in range(tries):
        start = thread_time()
        work()
        times.append(1e3 * (thread_time() - start))
    return min(times)


def costs(config: CameraConfig, baked: BakedScene, pose: Array, tries: int) -> None:
    """Print the time of each effect."""
    imager = config.imagers()[0]

    def time_of(values: dict[str, Any]) -> float:
        camera = Camera(config.model_copy(update={"signal": CameraSignal(**values)}), baked, seed=0, reuse=True)
        return least(lambda: camera.capture(imager, 0, STAMP_NS, turning(pose)), tries)

    ideal = time_of({})
    print(f"{'ideal photograph':34s} {ideal:7.1f} ms   1.00")
    camera = Camera(config.model_copy(update={"signal": CameraSignal()}), baked, seed=0, reuse=True)
    labels = least(lambda: camera.label(pose @ imager.base_from_optical), tries)
    print(f"{'labels alone':34s} {labels:7.1f} ms   {labels / ideal:.2f}")
    for name, values in EFFECTS.items():
        took = time_of(values)
        print(f"{name:34s} {took:7.1f} ms   {took / ideal:.2f}", flush=True)


def figures(photo: NDArray[np.uint8]) -> dict[str, float]:
    """Figures of a photograph (h, w, 3), as in docs/camera_signal.md."""
    values = photo.astype(np.float64)
    luminance = values @ LUMINANCE / 255.0
    most, least_ = values.max(axis=-1), values.min(axis=-1)
    lower = luminance[luminance.shape[0] * 2 // 3 :]
    # Twice-differenced along the diagonals: noise of a pixel without that of the scene (Immerkaer 1996).
    kernel = luminance[:-2, :-2] + luminance[2:, 2:] + luminance[:-2, 2:] + luminance[2:, :-2]
    kernel -= 2.0 * (luminance[1:-1, :-2] + luminance[1:-1, 2:] + luminance[:-2, 1:-1] + luminance[2:, 1:-1])
    kernel += 4.0 * luminance[1:-1, 1:-1]
    return {
        "mean luminance": float(luminance.mean()),
        "white": float((least_ >= 250).mean()),
        "dark": float((luminance < 0.03).mean()),
        "saturation": float(((most - least_) / np.maximum(most, 1.0)).mean()),
        "ground contrast": local_contrast(lower),
        "kurtosis": kurtosis(np.diff(lower, axis=1)),
        "noise": float(1.4826 * np.median(np.abs(kernel)) / 6.0),
        "slope": spectrum_slope(luminance),
    }


def compare(config: CameraConfig, baked: BakedScene, poses: list[Array], folder: Path | None, name: str) -> None:
    """Print figures of the photographs, as files have them: ideal, of the data sheet, of the preset robot."""
    imager, sheet = config.imagers()[0], datasheet_of("camera", config.model or "zed_2")
    for kind, values in {"ideal": {}, "datasheet": sheet, "robot": preset_of("camera", "robot")}.items():
        own = config.model_copy(update={"signal": CameraSignal(**values)})
        camera = Camera(own, baked, seed=0)
        packed = [
            camera_jpeg(camera.capture(imager, k, STAMP_NS, turning(pose)).photo, own) for k, pose in enumerate(poses)
        ]
        photos = [simplejpeg.decode_jpeg(each, "RGB") for each in packed]
        found = [figures(photo) for photo in photos]
        print(f"{name} {kind:10s}", {key: round(float(np.median([f[key] for f in found])), 4) for key in found[0]})
        for k, photo in enumerate(packed if folder else []):
            assert folder is not None
            (folder / f"{name}_{k}_{kind}.jpg").write_bytes(photo)


def main() -> None:
    """Print times of the first experiment and figures of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("experiments", nargs="*", default=["park_1"])
    parser.add_argument("--model", default="zed_2")
    parser.add_argument("--tries", type=int, default=5)
    parser.add_argument("--save", type=Path, help="folder for the photographs")
    options = parser.parse_args()
    for k, name in enumerate(options.experiments):
        experiment = with_overrides(load_experiment(name), lidar=False)
        world = world_of(experiment)
        baked = bake(Scene(world), experiment.light)
        config = StereoConfig(model=options.model)
        poses = poses_on_route(experiment.route, world, experiment.rig, 4)
        if not k and options.tries:
            costs(config, baked, poses[1], options.tries)
        compare(config, baked, poses, options.save, name)


if __name__ == "__main__":
    main()

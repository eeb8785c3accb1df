# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Make the sheets of docs/gallery: ten views of each environment, at three lights and in two seasons.

Run: python docs/gallery_sheets.py FOLDER [--lights clear_morning overcast low_sun] [--seasons summer autumn] [ENV ...]
Without lights and seasons: a sheet of the default, which is how the sheets of the first version were made.
"""

import argparse
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from fieldtruth.drive.plan import expected_path, pose_on_ground
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, load_experiment, parse_experiment
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.world.build import world_of

VIEWS, COLUMNS = 10, 5
WIDTH, HEIGHT = 384, 216  # [pixel] of a view in the sheet


def experiment_of(environment: str, light: str | None, season: str | None) -> Experiment:
    """The environment's first experiment with another light and season."""
    values: dict[str, Any] = yaml.safe_load(dump_experiment(load_experiment(f"{environment}_1")))
    if light is not None:
        values["light"] = {"preset": light}
    if season is not None:
        values["layout"] = (values.get("layout") or {}) | {"season": season}
    return parse_experiment(yaml.safe_dump(values))


def sheet(experiment: Experiment) -> NDArray[np.uint8]:
    """Ten views of the left camera along the route, in two rows."""
    world = world_of(experiment)
    baked = bake(Scene(world), experiment.light)
    config = experiment.rig.enabled(CameraConfig)[0]
    camera, imager = Camera(config, baked), config.imagers()[0]
    views = []
    path = expected_path(experiment, world)
    for viewpoint in path[np.linspace(0, len(path) - 1, VIEWS).astype(int)]:
        pose = pose_on_ground(world.terrain.field, viewpoint, experiment.rig)
        photo = camera.render(pose @ imager.base_from_optical).photo
        views.append(cv2.resize(photo, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA))
    rows = [np.hstack(views[k : k + COLUMNS]) for k in range(0, VIEWS, COLUMNS)]
    return np.asarray(np.vstack(rows), np.uint8)


def main() -> None:
    """Write ENV.jpg or ENV_LIGHT_SEASON.jpg into the folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("environments", nargs="*", default=["park", "lake", "forest", "hillside"])
    parser.add_argument("--lights", nargs="+", default=[None])
    parser.add_argument("--seasons", nargs="+", default=[None])
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    for environment in options.environments:
        for season in options.seasons:
            for light in options.lights:
                made = sheet(experiment_of(environment, light, season))
                name = "_".join(word for word in (environment, light, season) if word)
                quality = [cv2.IMWRITE_JPEG_QUALITY, 72]
                cv2.imwrite(str(options.folder / f"{name}.jpg"), made[..., ::-1], quality)
                print(name, flush=True)


if __name__ == "__main__":
    main()

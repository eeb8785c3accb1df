# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Make the pictures of the pages on seasons and light: one view of an environment under several conditions.

Run: python docs/condition_pictures.py [docs]
"""

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

import fieldtruth as ft
from fieldtruth.drive.plan import expected_path, pose_on_ground
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.world.build import world_of

SHARES = {"park": 0.02, "forest": 0.3, "lake": 0.35, "hillside": 0.3}
"""Position of the view on the route of the environment's first experiment, from 0 to 1."""
SEASONS = ("spring", "summer", "autumn", "winter")
SNOW_M = 0.1
LIGHTS = ("summer_day", "clear_morning", "noon", "low_sun", "dusk", "overcast")


def view(environment: str, width: int, light: str = "summer_day", **layout: Any) -> NDArray[np.uint8]:
    """Photograph of the left camera, (h, w, 3) RGB."""
    values = yaml.safe_load(dump_experiment(ft.load_experiment(f"{environment}_1")))
    values |= {"light": {"preset": light}, "layout": (values.get("layout") or {}) | layout}
    made = parse_experiment(yaml.safe_dump(values))
    world = world_of(made)
    config = made.rig.enabled(ft.CameraConfig)[0]
    path = expected_path(made, world)
    pose = pose_on_ground(world.terrain.field, path[int(SHARES[environment] * (len(path) - 1))], made.rig)
    camera = ft.Camera(config, ft.bake(ft.Scene(world), made.light))
    photo = camera.render(pose @ config.imagers()[0].base_from_optical).photo
    print(environment, light, layout, flush=True)
    return np.asarray(cv2.resize(photo, (width, width * 9 // 16), interpolation=cv2.INTER_AREA), np.uint8)


def seasons() -> NDArray[np.uint8]:
    """Environments in rows, their seasons in columns; below them three in snow."""
    rows = [np.hstack([view(name, 300, season=season) for season in SEASONS]) for name in SHARES]
    names = ("park", "forest", "hillside")
    return np.vstack([*rows, np.hstack([view(n, 400, season="winter", snow_depth=SNOW_M) for n in names])])


def lights() -> NDArray[np.uint8]:
    """The hillside in six lights with their names, in two columns."""
    found = []
    for light in LIGHTS:
        image = view("hillside", 560, light)
        at = 12, image.shape[0] - 12
        found.append(cv2.putText(image, light, at, cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 1, cv2.LINE_AA))
    return np.vstack([np.hstack(found[k : k + 2]) for k in range(0, len(found), 2)])


def main(folder: Path) -> None:
    """Write both."""
    for name, image in (("sheet_light", lights()), ("seasons", seasons())):
        cv2.imwrite(str(folder / f"{name}.jpg"), image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 84])


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs"))

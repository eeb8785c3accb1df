# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Make the documents' image: the left camera's view after 55 s of park_1, our photograph above Blender's.

Run: BLENDER_PYTHON=<a Python with bpy> python docs/blender_picture.py [docs/blender.jpg]
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import simplejpeg
from matplotlib.image import imread

import fieldtruth as ft
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import state_at
from fieldtruth.interchange import write_scene

SCRIPT = Path(__file__).parents[1] / "tests/interchange/blender_render.py"
SECONDS = 55.0


def main(path: Path) -> None:
    """Render twice, join, write."""
    experiment = ft.with_overrides(ft.load_experiment("park_1"), seconds=SECONDS)
    world = ft.load_world("park", seed=experiment.seed)
    cameras = experiment.rig.enabled(ft.CameraConfig)[0].model_copy(update={"width": 1024, "height": 576})
    state = state_at(drive(world, experiment).motion, round(SECONDS * 1e9))
    pose = state.world_from_base @ cameras.imagers()[0].base_from_optical
    camera = ft.Camera(cameras, ft.bake(ft.Scene(world)))
    with tempfile.TemporaryDirectory() as folder:
        job = {
            "scene": str(write_scene(world, Path(folder) / "park.glb", to="gltf")),
            "picture": f"{folder}/picture.png",
            "samples": 16,
            "azimuth_deg": experiment.light.values.azimuth_deg,
            "elevation_deg": experiment.light.values.elevation_deg,
            "world_from_optical": pose.tolist(),
            "fx": camera.intrinsics.fx,
            "fy": camera.intrinsics.fy,
            "width": cameras.width,
            "height": cameras.height,
            "far": cameras.far,
        }
        (Path(folder) / "job.json").write_text(json.dumps(job))
        subprocess.run([os.environ["BLENDER_PYTHON"], SCRIPT, f"{folder}/job.json"], check=True)
        theirs = np.rint(imread(job["picture"])[..., :3] * 255).astype(np.uint8)
    both = np.concatenate([camera.render(pose).photo, theirs])
    path.write_bytes(simplejpeg.encode_jpeg(np.ascontiguousarray(both), quality=75, colorspace="RGB"))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "blender.jpg"))

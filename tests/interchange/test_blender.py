# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Blender sees the same pixels in our glTF scenes as our label camera: a judge of geometry, ids and intrinsics.

Needs a Python with bpy, which asks for another version of NumPy: CONTRIBUTING says how to make one. Set
``BLENDER_PYTHON`` to its path.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import state_at
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.interchange import write_scene
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages
from fieldtruth.world.build import load_world

pytestmark = pytest.mark.usefixtures("small_ground_images")

SCRIPT: Final = Path(__file__).with_name("blender_render.py")
LARGEST_SHARE: Final = 2e-4
"""Share of pixels that may differ, all at silhouettes. Measured: 2e-5 to 1e-4."""


class Case(NamedTuple):
    experiment: str
    seconds: float
    form: str
    width: int
    height: int


CASES: Final = (
    Case("park_1", 55.0, "gltf-plain", 640, 360),
    Case("forest_1", 40.0, "gltf", 640, 360),
)
"""The park in parts, as it is without instances; and a forest, whose twigs and needles are the finest."""

FINE: Final = 4

Ids = NDArray[np.int64]


class Views(NamedTuple):
    """The same view, rendered here and by Blender; Blender's are instance id, class id (0: sky) and depth [m]."""

    ours: LabelImages
    fine: LabelImages
    """Ours with ``FINE`` times as many pixels along each side: a twig may pass between the centres of pixels."""
    instance: Ids
    label: Ids
    depth: NDArray[np.float32]


def blender_python() -> str:
    """Path of a Python that imports bpy; skips the test without one."""
    python = os.environ.get("BLENDER_PYTHON", sys.executable)
    found = subprocess.run([python, "-c", "import bpy"], capture_output=True, text=True, check=False)
    if found.returncode:
        reason = (found.stderr.strip().splitlines() or [f"exit code {found.returncode}"])[-1]
        pytest.skip(f"{python} cannot import bpy ({reason}); set BLENDER_PYTHON")
    return python


def views(case: Case, folder: Path) -> Views:
    """Render the left camera's view some seconds after the start of an experiment, here and in Blender."""
    python = blender_python()
    experiment = with_overrides(load_experiment(case.experiment), seconds=case.seconds)
    world = load_world(experiment.environment, seed=experiment.seed)
    config = StereoConfig(width=case.width, height=case.height)
    state = state_at(drive(world, experiment).motion, round(case.seconds * 1e9))
    pose = state.world_from_base @ config.left.base_from_sensor @ CAMERA_FROM_OPTICAL
    camera = LabelCamera(config, Scene(world))
    job = {
        "scene": str(write_scene(world, folder / "scene.glb", to=case.form)),
        "ids": str(folder / "ids.npy"),
        "world_from_optical": pose.tolist(),
        "fx": camera.intrinsics.fx,
        "fy": camera.intrinsics.fy,
        "width": case.width,
        "height": case.height,
        "far": config.far,
    }
    (folder / "job.json").write_text(json.dumps(job))
    done = subprocess.run([python, SCRIPT, folder / "job.json"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    ids = np.load(folder / "ids.npy")
    assert np.array_equal(ids[..., :2], np.rint(ids[..., :2])), "a pixel mixes ids: more than its centre was sampled"
    finer = StereoConfig(width=FINE * case.width, height=FINE * case.height)
    fine = LabelCamera(finer, camera.scene).label(pose)
    return Views(camera.label(pose), fine, ids[..., 0].astype(np.int64), ids[..., 1].astype(np.int64), ids[..., 2])


@pytest.fixture(scope="module", params=CASES, ids=lambda case: f"{case.experiment}-{case.form}")
def both(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Views:
    case: Case = request.param
    return views(case, tmp_path_factory.mktemp("blender"))


def distance_to_edge(fine: NDArray[np.integer]) -> Array:
    """Distance [pixel] of each pixel to the nearest edge in the finer image."""
    edge = np.zeros(fine.shape, bool)
    across, down = fine[:, 1:] != fine[:, :-1], fine[1:] != fine[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    height, width = fine.shape
    distance = np.asarray(distance_transform_edt(~edge)) / FINE
    return np.asarray(distance.reshape(height // FINE, FINE, width // FINE, FINE).min(axis=(1, 3)))


def assert_same_except_at_silhouettes(ours: NDArray[np.integer], theirs: Ids, fine: NDArray[np.integer]) -> None:
    wrong = ours != theirs
    distances = distance_to_edge(fine)[wrong]
    share, farthest = wrong.mean(), distances.max(initial=0)
    print(f"{wrong.sum()} of {wrong.size} pixels differ ({share:.2g}), at most {farthest} pixels from an edge")
    assert share < LARGEST_SHARE
    assert farthest <= 2
    # One pixel to the side is far more than the tolerance: the comparison would show it.
    for axis in (0, 1):
        assert (ours != np.roll(theirs, 1, axis)).mean() > 50 * LARGEST_SHARE


@pytest.mark.slow
def test_blender_sees_the_same_instances(both: Views) -> None:
    assert len(np.unique(both.instance)) > 30
    assert_same_except_at_silhouettes(both.ours.instance, both.instance, both.fine.instance)


@pytest.mark.slow
def test_blender_sees_the_same_classes(both: Views) -> None:
    assert len(np.unique(both.label)) > 5
    theirs = np.where(both.label == 0, int(Label.SKY), both.label)
    assert_same_except_at_silhouettes(both.ours.label, theirs, both.fine.label)


@pytest.mark.slow
def test_blender_sees_the_same_depth(both: Views) -> None:
    same = (both.instance == both.ours.instance) & (both.instance > 0)
    error = np.abs(both.depth - both.ours.depth)[same] / both.ours.depth[same]
    assert np.median(error) < 1e-6
    assert (error > 1e-3).mean() < 0.002, "one leaf or the next at silhouettes inside a tree"

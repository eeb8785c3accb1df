# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as KITTI's object detection: photographs, clouds, calibration and boxes of all visible objects.

Frames and sensors are those of the format ``kitti``. The world is built again for the boxes of its objects, which are
exact: those of the meshes' vertices (Geiger et al., "Are we ready for Autonomous Driving?", 2012, and its devkit).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.png import encode_png
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.amodal import WholeObjects, area, clipped, visible_pixels, world_of_run
from fieldtruth.exporters.frames import first_of_clouds
from fieldtruth.exporters.kitti import (
    CLOUDS,
    Geometry,
    Pair,
    calib_text,
    paired,
    read_geometry,
    rectified_views,
    row_text,
    write_cloud,
)
from fieldtruth.world.boxes import box_around, outermost

_LARGELY, _PARTLY = 0.4, 0.8
"""Visible shares of a silhouette below which an object is largely (2) or partly (1) occluded."""
_TEXTS: Final = package_data("fieldtruth.exporters", "kitti_object.yaml")


class KittiBox(NamedTuple):
    """A box in KITTI's convention: ``location`` (3,) [m] is the middle of its bottom, y down."""

    location: Array
    height: float
    width: float
    length: float
    rotation_y: float


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder.

    Raises:
        BagError: the bag lacks clouds, photographs, instance images, calibration or poses, its cameras are no
            pinholes, or its world is not known.
    """
    (run,) = runs
    view = rectified_views(run)[0]
    run.require(view.topics["photo"])
    run.require_instances(view.topics["instance"])
    with options.progress.stage("build the world"):
        world = world_of_run(run)
    clouds = run.readings(first_of_clouds(run).name, labelled=False)
    images = run.readings(view.name, ["photo", "instance"])
    whole, geometry, trajectory = WholeObjects(world, view.config), read_geometry(run), run.trajectory
    folder = target / "training"
    for name in ("image_2", CLOUDS, "calib", "label_2", "visibility"):
        (folder / name).mkdir(parents=True)
    if not (pairs := paired(clouds.stamps_ns, [images.stamps_ns])):
        raise BagError(f"{run.bag} has no cloud with a photograph and an instance image")

    def save(numbered: tuple[int, Pair]) -> int:
        number, pair = f"{numbered[0]:06d}", numbered[1]
        image = images.read(pair.images[0])
        (folder / "image_2" / f"{number}.png").write_bytes(encode_png(image.photo))
        write_cloud(folder / CLOUDS / f"{number}.bin", clouds.read(pair.cloud))
        (folder / "calib" / f"{number}.txt").write_text(_calib(geometry), encoding="ascii")
        world_from_cam0 = trajectory.world_from_base(pair.stamp_ns) @ geometry.base_from_cam0
        labels, shares = _lines(whole, image.instance, world_from_cam0)
        (folder / "label_2" / f"{number}.txt").write_text(labels, encoding="utf-8")
        (folder / "visibility" / f"{number}.txt").write_text(shares, encoding="utf-8")
        return pair.stamp_ns

    stamps = list(options.each("frames and boxes", run, list(enumerate(pairs)), save))
    numbers = [f"{k:06d}\n" for k in range(len(stamps))]
    (target / "ImageSets").mkdir()
    (target / "ImageSets" / "train.txt").write_text("".join(numbers), encoding="ascii")
    lines = [f"{k:06d} {stamp}\n" for k, stamp in enumerate(stamps)]
    (target / "stamps.txt").write_text("".join(lines), encoding="ascii")
    (target / "README.md").write_text(_TEXTS["readme"], encoding="utf-8")


def _calib(geometry: Geometry) -> str:
    """Calibration of a frame: names and rotations that the devkit of objects has instead of those of odometry."""
    own = calib_text(geometry).replace("Tr:", "Tr_velo_to_cam:")
    return f"{own}R0_rect: {row_text(np.eye(3))}\nTr_imu_to_velo: {row_text(np.eye(3, 4))}\n"


def _lines(whole: WholeObjects, ids: Any, world_from_optical: Array) -> tuple[str, str]:
    """Lines of ``label_2`` and of ``visibility``."""
    config, labels, shares = whole.config, [], []
    for object_id, pixels in visible_pixels(ids, whole.objects.keys()).items():
        bounds = whole.bounds(object_id, world_from_optical)
        if bounds is None:
            continue
        instance = whole.objects[object_id]
        inside, alone = clipped(bounds, config.width, config.height), whole.silhouette(object_id, world_from_optical)
        share = pixels / max(alone.pixels, pixels)
        box = kitti_box(whole, object_id, world_from_optical)
        alpha = _wrapped(box.rotation_y - float(np.arctan2(box.location[0], box.location[2])))
        occluded = 0 if share >= _PARTLY else 1 if share >= _LARGELY else 2
        numbers = [*inside, box.height, box.width, box.length, *box.location, box.rotation_y]
        head = f"{instance.kind.replace(' ', '_')} {1.0 - area(inside) / area(bounds):.3f} {occluded} {alpha:.4f}"
        labels.append(f"{head} {' '.join(f'{number:.4f}' for number in numbers)}\n")
        shares.append(f"{object_id} {share:.4f} {pixels} {instance.name}\n")
    return "".join(labels), "".join(shares)


def kitti_box(whole: WholeObjects, object_id: int, world_from_optical: Array) -> KittiBox:
    """Smallest box of an object that is upright in the optical frame and has the object's heading there."""
    instance = whole.objects[object_id]
    optical_from_object = transforms.inverse(world_from_optical) @ instance.world_from_object
    ahead = optical_from_object[:3, 0]
    angle = -float(np.arctan2(ahead[2], ahead[0]))
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    points = transforms.transform(optical_from_object, outermost(whole.world.meshes[instance.mesh]))
    box = box_around(points, turned)
    length, height, width = box.size.tolist()
    return KittiBox(box.centre + np.array([0.0, height / 2, 0.0]), height, width, length, angle)


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as KITTI's object detection: photographs, clouds, calibration and boxes of all visible objects.

Frames and sensors are those of the format ``kitti``. The world is built again for the boxes of its objects, which are
exact: those of the meshes' vertices; of what moves, the constant one of the object (Geiger et al., "Are we ready for
Autonomous Driving?", 2012, and its devkit).
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.png import encode_png
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.amodal import Silhouette, WholeObjects, area, clipped, moving_world_of_run, visible_pixels
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
T = TypeVar("T")


class KittiBox(NamedTuple):
    """A box in KITTI's convention: ``location`` (3,) [m] is the middle of its bottom, y down."""

    location: Array
    height: float
    width: float
    length: float
    rotation_y: float


class KittiRow(NamedTuple):
    """An object in an image."""

    object_id: int
    name: str
    kind: str
    alone: Silhouette
    pixels: int
    """Visible ones."""
    points: int
    """Of the cloud."""
    whole: Array
    """Box (4,) of the whole object [pixel], beyond the image, too."""
    inside: Array
    """Box (4,) [pixel], cut at the borders of the image."""
    box: KittiBox
    velocity: Array
    """(3,) [m/s] of the middle of the box over the ground, along the axes of the optical frame."""

    @property
    def truncated(self) -> float:
        """Share of the area of its box that is outside the image."""
        return 1.0 - area(self.inside) / area(self.whole)

    @property
    def visibility(self) -> float:
        """Share of the pixels of its silhouette that is visible."""
        return self.pixels / max(self.alone.pixels, self.pixels)

    def label(self, kind: str, truncated: str) -> str:
        """Columns of a line of labels, from the type on."""
        share, box = self.visibility, self.box
        occluded = 0 if share >= _PARTLY else 1 if share >= _LARGELY else 2 if self.pixels else 3
        alpha = _wrapped(box.rotation_y - float(np.arctan2(box.location[0], box.location[2])))
        numbers = [*self.inside, box.height, box.width, box.length, *box.location, box.rotation_y]
        return f"{kind} {truncated} {occluded} {alpha:.4f} {' '.join(f'{number:.4f}' for number in numbers)}\n"

    def extra(self) -> str:
        """Columns of a line beside the label."""
        velocity = " ".join(f"{value:.4f}" for value in self.velocity + 0.0)
        return f"{self.object_id} {self.visibility:.4f} {self.pixels} {self.name} {self.points} {velocity}\n"


class KittiObjects:
    """The objects of a run, those that move included, in the images of a view. Threads may share it."""

    def __init__(self, run: Run, view: Source) -> None:
        world, moving = moving_world_of_run(run)
        self._whole, self._movers = WholeObjects(world, view.config, moving), run.movers

    def rows(
        self, image: Image, cloud: Cloud, world_from_optical: Array, *, moving: bool = False
    ) -> Iterator[KittiRow]:
        """Yield the objects with visible pixels; with ``moving`` of movers only, also those that are hidden."""
        whole, stamp = self._whole, image.stamp_ns
        known = [] if moving else list(whole.objects)
        visible = visible_pixels(image.instance, {*known, *self._movers.by_id})
        points = visible_pixels(cloud.instance, visible)
        states, optical_from_world = self._movers.at(stamp), transforms.inverse(world_from_optical)
        for object_id in dict.fromkeys([*visible, *(self._movers.by_id if moving else ())]):
            bounds = whole.bounds(object_id, world_from_optical, stamp_ns=stamp)
            alone = whole.silhouette(object_id, world_from_optical, stamp_ns=stamp)
            pixels = visible.get(object_id, 0)
            if bounds is None or not (pixels or alone.pixels):
                continue
            if object_id in states:
                mover, state = self._movers.by_id[object_id], states[object_id]
                name, kind, velocity = mover.name, mover.kind, optical_from_world[:3, :3] @ mover.velocity(state)
                box = upright_box(optical_from_world @ state.pose, mover.corners)
            else:
                instance, velocity = whole.objects[object_id], np.zeros(3)
                name, kind = instance.name, instance.kind.replace(" ", "_")
                box = kitti_box(whole, object_id, world_from_optical)
            inside = clipped(bounds, whole.config.width, whole.config.height)
            count = points.get(object_id, 0)
            yield KittiRow(object_id, name, kind, alone, pixels, count, bounds, inside, box, velocity)


class Written(NamedTuple, Generic[T]):
    """A frame whose photograph and cloud were written."""

    stamp_ns: int
    world_from_cam0: Array
    text: T
    """What the caller makes of its rows."""


def write_frames(
    run: Run, folders: tuple[Path, Path], options: Options, text: Callable[[int, list[KittiRow]], T], *, moving: bool
) -> list[Written[T]]:
    """Write photographs and clouds of a run to two folders; ``text`` gets the number and the rows of each frame.

    Raises:
        BagError: no cloud has a photograph and an instance image, or the world of the run is not known.
    """
    view = rectified_views(run)[0]
    with options.progress.stage("build the world"):
        objects = KittiObjects(run, view)
    clouds = run.readings(first_of_clouds(run).name, labelled=False)
    images = run.readings(view.name, ["photo", "instance"])
    geometry, trajectory = read_geometry(run), run.trajectory
    for folder in folders:
        folder.mkdir(parents=True)
    if not (pairs := paired(clouds.stamps_ns, [images.stamps_ns])):
        raise BagError(f"{run.bag} has no cloud with a photograph and an instance image")

    def save(numbered: tuple[int, Pair]) -> Written[T]:
        number, pair = numbered
        image, cloud = images.read(pair.images[0]), clouds.read(pair.cloud)
        (folders[0] / f"{number:06d}.png").write_bytes(encode_png(image.photo))
        write_cloud(folders[1] / f"{number:06d}.bin", cloud)
        world_from_cam0 = trajectory.world_from_base(pair.stamp_ns) @ geometry.base_from_cam0
        rows = list(objects.rows(image, cloud, world_from_cam0, moving=moving))
        return Written(pair.stamp_ns, world_from_cam0, text(number, rows))

    return list(options.each(f"{run.name}: frames and boxes", run, list(enumerate(pairs)), save))


def require_instances(run: Run) -> None:
    """Check that a run has the photographs and instance images of a view as KITTI's; raises as ``rectified_views``."""
    view = rectified_views(run)[0]
    run.require(view.topics["photo"])
    run.require_instances(view.topics["instance"])


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder.

    Raises:
        BagError: the bag lacks clouds, photographs, instance images, calibration or poses, its cameras are no
            pinholes, or its world is not known.
    """
    (run,) = runs
    require_instances(run)
    calib, folder = _calib(read_geometry(run)), target / "training"
    for name in ("calib", "label_2", "visibility"):
        (folder / name).mkdir(parents=True)

    def texts(number: int, rows: list[KittiRow]) -> None:
        labels = "".join(row.label(row.kind, f"{row.truncated:.3f}") for row in rows)
        extras = "".join(row.extra() for row in rows)
        for name, text in (("calib", calib), ("label_2", labels), ("visibility", extras)):
            (folder / name / f"{number:06d}.txt").write_text(text, encoding="utf-8")

    frames = write_frames(run, (folder / "image_2", folder / CLOUDS), options, texts, moving=False)
    (target / "ImageSets").mkdir()
    (target / "ImageSets" / "train.txt").write_text("".join(f"{k:06d}\n" for k in range(len(frames))), encoding="ascii")
    lines = [f"{k:06d} {frame.stamp_ns}\n" for k, frame in enumerate(frames)]
    (target / "stamps.txt").write_text("".join(lines), encoding="ascii")
    (target / "README.md").write_text(_TEXTS["readme"], encoding="utf-8")


def _calib(geometry: Geometry) -> str:
    """Calibration of a frame: names and rotations that the devkit of objects has instead of those of odometry."""
    own = calib_text(geometry).replace("Tr:", "Tr_velo_to_cam:")
    return f"{own}R0_rect: {row_text(np.eye(3))}\nTr_imu_to_velo: {row_text(np.eye(3, 4))}\n"


def kitti_box(whole: WholeObjects, object_id: int, world_from_optical: Array) -> KittiBox:
    """Smallest box of an object of the world that is upright in the optical frame and has its heading there."""
    instance = whole.objects[object_id]
    optical_from_object = transforms.inverse(world_from_optical) @ instance.world_from_object
    return upright_box(optical_from_object, outermost(whole.world.meshes[instance.mesh]))


def upright_box(optical_from_object: Array, corners: Array) -> KittiBox:
    """Smallest box around points (n, 3) [m] of an object, upright in the optical frame, with the object's heading."""
    ahead = optical_from_object[:3, 0]
    angle = -float(np.arctan2(ahead[2], ahead[0]))
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    box = box_around(transforms.transform(optical_from_object, corners), turned)
    length, height, width = box.size.tolist()
    return KittiBox(box.centre + np.array([0.0, height / 2, 0.0]), height, width, length, angle)


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)

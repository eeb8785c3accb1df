# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as COCO: panoptic and detection annotations of the photographs of all cameras with instance ids.

``images/CAMERA/NS.jpg`` are the photographs, byte for byte as in the bag; ``panoptic.json`` with
``panoptic/CAMERA/NS.png`` holds the segment of each pixel, ``instances.json`` a mask for each countable object and each
crowd.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import Trajectory, read_objects
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core.arrays import Array
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import ids_png
from fieldtruth.core.progress import counted
from fieldtruth.core.readings import Image
from fieldtruth.exporters import Options
from fieldtruth.exporters.coco_boxes import CocoBoxes
from fieldtruth.exporters.coco_json import Picture, coco_files
from fieldtruth.exporters.coco_segments import Numbering, categories_of, segments_of
from fieldtruth.exporters.frames import with_jpeg

_PARTS: Final = ("photo", "label", "instance")


class Camera(NamedTuple):
    """What all images of a camera share."""

    about: Mapping[str, Any]
    """Keys and values of each image's row: frame and calibration."""
    base_from_optical: Array


class _Source(NamedTuple):
    """What is needed to export a frame."""

    cameras: Mapping[str, Camera]
    images: Mapping[str, Readings]
    trajectory: Trajectory
    numbering: Numbering
    boxes: CocoBoxes | None


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder.

    Raises:
        BagError: photographs, tag images, instance images, calibration or poses are missing, or the bag is damaged.
    """
    (run,) = runs
    views = _views_of(run)
    run.require(table.MODEL_STATES, table.TF_STATIC, *(view.info for view in views))
    categories = categories_of(options.label_map)
    for view in views:
        (target / "images" / view.label).mkdir(parents=True)
        (target / "panoptic" / view.label).mkdir(parents=True)
    names, _ = read_objects(run)
    numbering = Numbering(categories, options.label_map, names)
    boxes = CocoBoxes(run, options.label_map, names) if options.boxes else None
    run.streams([view.topics[part] for view in views for part in _PARTS])
    images = {view.label: run.readings(view.name, _PARTS) for view in views}
    source = _Source({view.label: _camera(run, view) for view in views}, images, run.trajectory, numbering, boxes)
    about = {} if boxes is None else boxes.objects()
    jobs = [(stamp, k, name) for k, (name, each) in enumerate(images.items()) for stamp in each.stamps_ns.tolist()]
    with (
        options.progress.stage("images", run.duration_s) as advance,
        coco_files(run, target, options.label_map, categories, names, about) as files,
    ):
        pictures = in_order(sorted(jobs), partial(_write_frame, target, source), options.workers)
        for picture in counted(pictures, advance, run.duration_s, len(jobs)):
            files.add(picture)
    if not jobs:
        raise BagError(f"{run.bag}: no photograph has a tag image and an instance image with the same stamp")


def _views_of(run: Run) -> list[Source]:
    """Views that took photographs, of the cameras with instance images.

    Raises:
        BagError: the rig has no camera, or a view lacks tag or instance images; the text states how to make those.
    """
    every, found = run.of(Image, recorded=False), run.of(Image, "photo")
    if not every:
        raise BagError(f"the rig of {run.bag} has no camera, and COCO is made of photographs")
    cameras = {view.device for view in found if view.has(run.counts, "instance")}
    views = [view for view in found if not cameras or view.device in cameras]
    run.require(*(view.topics[part] for part in ("photo", "label") for view in views or every))
    run.require_instances(*(view.topics["instance"] for view in views))
    return views


def _write_frame(target: Path, source: _Source, job: tuple[int, int, str]) -> Picture:
    """Write the image files of a frame, of a stamp and a camera; on any thread."""
    stamp, _, camera = job
    name = f"{camera}/{stamp}"
    image, photo = with_jpeg(source.images[camera], stamp)
    try:
        ids = source.numbering.number(image.label, image.instance)
    except BagError as error:
        raise BagError(f"{camera} camera at {stamp} ns: {error}") from error
    height, width = ids.shape
    (target / "images" / f"{name}.jpg").write_bytes(photo)
    (target / "panoptic" / f"{name}.png").write_bytes(ids_png(ids))
    world_from_optical = source.trajectory.world_from_base(stamp) @ source.cameras[camera].base_from_optical
    row = {
        "file_name": f"{name}.jpg",
        "width": width,
        "height": height,
        "stamp_ns": stamp,
        "camera": camera,
        **source.cameras[camera].about,
        "world_from_camera": world_from_optical.tolist(),
    }
    segments = segments_of(ids)
    boxes = {} if source.boxes is None else source.boxes.of(camera, segments, world_from_optical)
    return Picture(stamp, row, f"{name}.png", segments, boxes)


def _camera(run: Run, view: Source) -> Camera:
    lens = run.calibration.lens(view.name)
    about = {
        "frame_id": lens.frame,
        "camera_matrix": lens.K.tolist(),
        "distortion_model": lens.model,
        "distortion": lens.D.tolist(),
    }
    return Camera(about, run.calibration.base_from(view.name))

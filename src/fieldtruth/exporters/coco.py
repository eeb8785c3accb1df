# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as COCO: panoptic and detection annotations of the photographs of all cameras with instance ids.

``images/CAMERA/NS.jpg`` are the photographs, byte for byte as in the bag; ``panoptic.json`` with
``panoptic/CAMERA/NS.png`` holds the segment of each pixel, ``instances.json`` a mask for each countable object and each
crowd.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import first_message, read_static_frames
from fieldtruth.bag.model_states import read_objects
from fieldtruth.bag.reader import BagError, BagReader, Decoder, RawMessage, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory, read_trajectory
from fieldtruth.core.arrays import Array
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import ids_png
from fieldtruth.core.progress import timed
from fieldtruth.exporters import Options
from fieldtruth.exporters.coco_boxes import CocoBoxes
from fieldtruth.exporters.coco_json import Picture, coco_files
from fieldtruth.exporters.coco_segments import Numbering, categories_of, segments_of
from fieldtruth.exporters.frames import checked_jpeg
from fieldtruth.sensors.camera.config import Imager

_STREAMS: Final = ("photograph", "tag", "instances")
_MOST_WAITING: Final = 100
"""Incomplete stamps per camera; cameras that publish in step need one."""


class Camera(NamedTuple):
    """What all images of a camera share."""

    about: Mapping[str, Any]
    """Keys and values of each image's row: frame and calibration."""
    base_from_optical: Array


class Frame(NamedTuple):
    """Messages of one camera with the same stamp [ns] in their headers."""

    camera: str
    stamp_ns: int
    photo: RawMessage
    tag: RawMessage
    instances: RawMessage


class _Source(NamedTuple):
    """What is needed to export a frame."""

    cameras: Mapping[str, Camera]
    trajectory: Trajectory
    numbering: Numbering
    decode: Decoder
    boxes: CocoBoxes | None


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder.

    Raises:
        BagError: photographs, tag images, instance images, calibration or poses are missing, or the bag is damaged.
    """
    (run,) = runs
    imagers = _imagers_of(run)
    run.require(table.MODEL_STATES, table.TF_STATIC, *(imager.topic_of("camera_info") for imager in imagers))
    categories = categories_of(options.label_map)
    for imager in imagers:
        (target / "images" / imager.name).mkdir(parents=True)
        (target / "panoptic" / imager.name).mkdir(parents=True)
    with open_bag(run.bag, true_stamps=run.clocked) as bag, options.progress.stage("images", run.duration_s) as advance:
        names, _ = read_objects(run)
        numbering = Numbering(categories, options.label_map, names)
        boxes = CocoBoxes(run, options.label_map, names) if options.boxes else None
        source = _Source(_cameras(run, imagers), read_trajectory(run), numbering, decoder(bag), boxes)
        about = {} if boxes is None else boxes.objects()
        with coco_files(run, target, options.label_map, categories, names, about) as files:
            pictures = in_order(_frames_of(bag, imagers), partial(_write_frame, target, source), options.workers)
            for picture in timed(pictures, advance, run.start_ns):
                files.add(picture)
    if not files.image_count:
        raise BagError(f"{run.bag}: no photograph has a tag image and an instance image with the same stamp")


def _imagers_of(run: Run) -> list[Imager]:
    """Views that took photographs, of the cameras with instance images.

    Raises:
        BagError: the rig has no camera, or a view lacks tag or instance images; the text states how to make those.
    """
    if not run.rig.imagers:
        raise BagError(f"the rig of {run.bag} has no camera, and COCO is made of photographs")
    found = [imager for imager in run.rig.imagers if imager.topic_of("photograph") in run.counts]
    cameras = {imager.config.name for imager in found if imager.topic_of("instances") in run.counts}
    imagers = [imager for imager in found if not cameras or imager.config.name in cameras]
    run.require(*(each.topic_of(stream) for stream in ("photograph", "tag") for each in imagers or run.rig.imagers))
    run.require_instances(*(imager.topic_of("instances") for imager in imagers))
    return imagers


def _frames_of(bag: BagReader, imagers: Sequence[Imager]) -> Iterator[Frame]:
    """Complete frames, in the order in which they become complete; stamps without one of the images are skipped.

    Raises:
        BagError: the bag is damaged, or a camera's stamps do not rise or never agree.
    """
    topics = {imager.name: [imager.topic_of(stream) for stream in _STREAMS] for imager in imagers}
    kind_of = {topic: (camera, i) for camera, own in topics.items() for i, topic in enumerate(own)}
    waiting: dict[str, dict[int, dict[int, RawMessage]]] = {camera: {} for camera in topics}
    newest = dict.fromkeys(topics, -1)
    for raw in bag.messages([*kind_of]):
        camera, kind = kind_of[raw.topic]
        stamp = _header_stamp_ns(bag, raw)
        if stamp <= newest[camera]:
            raise BagError(f"{bag.path}: stamps of {raw.topic} do not rise: {stamp} ns comes after {newest[camera]} ns")
        parts = waiting[camera].setdefault(stamp, {})
        parts[kind] = raw
        if len(parts) == len(_STREAMS):
            yield Frame(camera, stamp, parts[0], parts[1], parts[2])
            newest[camera] = stamp
            waiting[camera] = {later: rest for later, rest in waiting[camera].items() if later > stamp}
        elif len(waiting[camera]) > _MOST_WAITING:
            these = ", ".join(topics[camera])
            raise BagError(f"{bag.path}: {these} have no stamps in common, so photographs have no labels")


def _header_stamp_ns(bag: BagReader, raw: RawMessage) -> int:
    """Stamp [ns] in the header, with which these messages begin: ``seq``, then seconds and nanoseconds."""
    if len(raw.data) < 12:
        raise BagError(f"cannot read {bag.path}: the message of {raw.topic} at {raw.stamp_ns} ns is damaged")
    seconds, nanoseconds = struct.unpack_from("<LL", raw.data, 4)
    return int(seconds) * 10**9 + int(nanoseconds)


def _write_frame(target: Path, source: _Source, frame: Frame) -> Picture:
    """Write the image files of a frame; on any thread."""
    camera = source.cameras[frame.camera]
    name = f"{frame.camera}/{frame.stamp_ns}"
    try:
        label = read.labels(read.image(source.decode(frame.tag)))
        ids = source.numbering.number(label, read.instances(source.decode(frame.instances)))
        photo = checked_jpeg(source.decode(frame.photo), ids.shape)
    except BagError as error:
        raise BagError(f"{frame.camera} camera at {frame.stamp_ns} ns: {error}") from error
    height, width = ids.shape
    (target / "images" / f"{name}.jpg").write_bytes(photo)
    (target / "panoptic" / f"{name}.png").write_bytes(ids_png(ids))
    world_from_optical = source.trajectory.world_from_base(frame.stamp_ns) @ camera.base_from_optical
    row = {
        "file_name": f"{name}.jpg",
        "width": width,
        "height": height,
        "stamp_ns": frame.stamp_ns,
        "camera": frame.camera,
        **camera.about,
        "world_from_camera": world_from_optical.tolist(),
    }
    segments = segments_of(ids)
    boxes = {} if source.boxes is None else source.boxes.of(frame.camera, segments, world_from_optical)
    return Picture(frame.stamp_ns, row, f"{name}.png", segments, boxes)


def _cameras(run: Run, imagers: Sequence[Imager]) -> dict[str, Camera]:
    static = read_static_frames(run)
    cameras = {}
    for imager in imagers:
        info = first_message(run, imager.topic_of("camera_info"))
        frame = info.header.frame_id
        about = {
            "frame_id": frame,
            "camera_matrix": np.asarray(info.K, np.float64).reshape(3, 3).tolist(),
            "distortion_model": info.distortion_model,
            "distortion": np.asarray(info.D, np.float64).tolist(),
        }
        cameras[imager.name] = Camera(about, static.base_from(frame))
    return cameras

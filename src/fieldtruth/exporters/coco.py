# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A run in COCO's form: panoptic and detection annotations of the photographs of both cameras.

``images/SIDE/NS.jpg`` are the photographs, byte for byte as in the bag; ``panoptic.json`` with ``panoptic/SIDE/NS.png``
says of each pixel to which segment it belongs, ``instances.json`` holds a mask for each thing and each crowd.
"""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import first_message, read_static_frames
from fieldtruth.bag.reader import BagError, BagReader, Decoder, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory, read_trajectory
from fieldtruth.bag.types import F8
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import encode_png
from fieldtruth.exporters import Options
from fieldtruth.exporters.coco_categories import Category, Numbering, categories_of
from fieldtruth.exporters.coco_frames import Frame, frames_of, sides_of
from fieldtruth.exporters.coco_json import LICENCE, Rows, document, head_of
from fieldtruth.exporters.coco_segments import Segment, segments_of


class Camera(NamedTuple):
    """What all pictures of a camera share."""

    about: Mapping[str, Any]
    """Keys and values for each image: frame and calibration."""
    base_from_optical: F8


class Picture(NamedTuple):
    """A frame that is written."""

    stamp_ns: int
    image: dict[str, Any]
    """All of its row but the id."""
    panoptic: str
    segments: list[Segment]


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder.

    Raises:
        BagError: the bag lacks photographs, tags, objects, calibration or poses, or is damaged.
    """
    (run,) = runs
    sides = sides_of(run)
    run.require(table.MODEL_STATES, table.TF_STATIC, *map(table.camera_info, sides))
    categories = categories_of(options.label_map)
    for side in sides:
        (target / "images" / side).mkdir(parents=True)
        (target / "panoptic" / side).mkdir(parents=True)
    with (
        open_bag(run.bag) as bag,
        options.progress.stage("pictures", run.duration_s) as advance,
        ExitStack() as files,
    ):
        names = _object_names(bag)
        numbering = Numbering(categories, options.label_map, names)
        trajectory, cameras = read_trajectory(run), _cameras(run, sides)
        work = partial(_picture, target, cameras, trajectory, numbering, decoder(bag))
        output = _Output(run, target, options, categories, names, files)
        done_ns = run.start_ns
        for picture in in_order(frames_of(bag, sides), work, options.workers):
            output.add(picture)
            advance((picture.stamp_ns - done_ns) / 1e9)
            done_ns = picture.stamp_ns
        output.check()


class _Output:
    """The two files."""

    def __init__(
        self,
        run: Run,
        target: Path,
        options: Options,
        categories: list[Category],
        names: Sequence[str],
        files: ExitStack,
    ) -> None:
        self._run = run
        self._things = {category.id for category in categories if category.isthing}
        self._images_made = self._annotations_made = 0
        rows = target / "images.part"
        files.callback(rows.unlink, missing_ok=True)
        head = head_of(run, options.label_map)
        objects = [{"id": number, "name": name} for number, name in enumerate(names)]
        everything = head | {"categories": [c.row() for c in categories], "objects": objects}
        things = everything | {"categories": [c.row() for c in categories if c.isthing]}
        self._panoptic = files.enter_context(document(target / "panoptic.json", everything, rows))
        self._instances = files.enter_context(document(target / "instances.json", things, rows))
        self._images = Rows(files.enter_context(rows.open("w", encoding="utf-8")))

    def add(self, picture: Picture) -> None:
        """Add a picture, its segments, and those of them that are things as annotations."""
        self._images_made += 1
        image_id = self._images_made
        licence = {} if self._run.experiment is None else {"license": LICENCE["id"]}
        self._images.add({"id": image_id} | picture.image | licence)
        segments = []
        size = [picture.image["height"], picture.image["width"]]
        for segment in picture.segments:
            category, single = divmod(segment.id, 1 << 16)
            known = {
                "category_id": category,
                "area": segment.area,
                "bbox": segment.bbox,
                "iscrowd": int(category in self._things and not single),
                "object_id": single,
            }
            segments.append({"id": segment.id} | known)
            if category in self._things:
                self._annotations_made += 1
                mask = {"size": size, "counts": segment.counts}
                row = {"id": self._annotations_made, "image_id": image_id} | known | {"segmentation": mask}
                self._instances.add(row)
        self._panoptic.add({"image_id": image_id, "file_name": picture.panoptic, "segments_info": segments})

    def check(self) -> None:
        """Make sure that there was anything."""
        if not self._images_made:
            raise BagError(f"{self._run.bag}: no photograph has classes and objects of the same stamp")


def _picture(
    target: Path,
    cameras: Mapping[str, Camera],
    trajectory: Trajectory,
    numbering: Numbering,
    decode: Decoder,
    frame: Frame,
) -> Picture:
    """Write the files of a frame; on any thread."""
    camera = cameras[frame.side]
    name = f"{frame.side}/{frame.stamp_ns}"
    try:
        label = read.labels(read.image(decode(frame.tag)))
        numbers = numbering.number(label, read.instances(decode(frame.instances)))
    except BagError as error:
        raise BagError(f"{frame.side} camera at {frame.stamp_ns} ns: {error}") from error
    height, width = numbers.shape
    photo = bytes(decode(frame.photo).data)
    if (size := _jpeg_size(photo)) != (width, height):
        found = "no JPEG" if size is None else f"a JPEG of {size[0]} x {size[1]} pixels"
        raise BagError(f"the message of {frame.photo.topic} at {frame.stamp_ns} ns is {found}, its tags are of "
                       f"{width} x {height}")  # fmt: skip
    world_from_optical = trajectory.world_from_base(frame.stamp_ns) @ camera.base_from_optical
    (target / "images" / f"{name}.jpg").write_bytes(photo)
    (target / "panoptic" / f"{name}.png").write_bytes(encode_png(_colours(numbers)))
    image = {
        "file_name": f"{name}.jpg",
        "width": width,
        "height": height,
        "stamp_ns": frame.stamp_ns,
        "camera": frame.side,
        **camera.about,
        "world_from_camera": world_from_optical.tolist(),
    }
    return Picture(frame.stamp_ns, image, f"{name}.png", segments_of(numbers))


def _colours(numbers: NDArray[np.uint32]) -> NDArray[np.uint8]:
    """Numbers (h, w) as COCO's panoptic images write them: R + 256 G + 65536 B."""
    return np.ascontiguousarray(numbers.astype("<u4", copy=False)).view(np.uint8).reshape(*numbers.shape, 4)[..., :3]


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Width and height of a JPEG; None if it is none."""
    try:
        height, width, *_ = simplejpeg.decode_jpeg_header(data)
    except ValueError:
        return None
    return int(width), int(height)


def _object_names(bag: BagReader) -> list[str]:
    """Names of the objects, by id."""
    first = next(bag.messages([table.MODEL_STATES]))
    return [*decoder(bag)(first).name]


def _cameras(run: Run, sides: Sequence[str]) -> dict[str, Camera]:
    static = read_static_frames(run)
    cameras = {}
    for side in sides:
        info = first_message(run, table.camera_info(side))
        frame = info.header.frame_id
        about = {
            "frame_id": frame,
            "camera_matrix": np.asarray(info.K, np.float64).reshape(3, 3).tolist(),
            "distortion_model": info.distortion_model,
            "distortion": np.asarray(info.D, np.float64).tolist(),
        }
        cameras[side] = Camera(about, static.base_from(frame))
    return cameras

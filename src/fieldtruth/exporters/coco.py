# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as COCO: panoptic and detection annotations of the photographs of all cameras with instance ids.

``images/CAMERA/NS.jpg`` (or .png) are the photographs, byte for byte as in the bag; ``panoptic.json`` with
``panoptic/CAMERA/NS.png`` holds the segment of each pixel, ``instances.json`` a mask for each countable object and each
crowd. A segment of a countable class (COCO's ``isthing``) is one object. All other classes have one segment per image.
So have the objects of a countable class that have no ids of their own: a crowd, like the trees of the backdrop, or
pebbles. Both JSON files are written row by row: the annotations of a long drive may exceed the memory.
"""

import json
import re
import shutil
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray
from pycocotools import mask as coco_mask

import fieldtruth
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import read_objects
from fieldtruth.bag.movers import Movers
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import NOT_OF_WORLDS, Label
from fieldtruth.core.png import ids_png
from fieldtruth.core.readings import Image
from fieldtruth.core.yaml_io import package_data
from fieldtruth.datasets.items import ROLES
from fieldtruth.exporters import Options
from fieldtruth.exporters.amodal import WholeObjects, moving_world_of_run
from fieldtruth.exporters.frames import Frames
from fieldtruth.ontology import LabelMap, own_labels
from fieldtruth.world.boxes import named_objects, object_box

_PARTS: Final = ("photo", "label", "instance")
_LICENCE: Final = {"id": 1, "name": "CC BY 4.0", "url": "https://creativecommons.org/licenses/by/4.0/"}
_SUPERCATEGORIES: Final = {
    int(Label[label]): above
    for above, labels in package_data("fieldtruth.exporters", "coco.yaml")["supercategories"].items()
    for label in labels
}
_OTHER: Final = "object"
"""Supercategory of a user's classes."""
STUFF: Final = frozenset({Label.GROUND, Label.TRAIL, Label.HIGH_GRASS, Label.WATER, Label.SKY}) | NOT_OF_WORLDS
"""Classes that are not countable. A class of another ontology is countable if all of ours that it holds are."""
_BITS: Final = 24
"""Bits of a segment id in a panoptic image."""
_SINGLE: Final = re.compile(r"_\d+$")
"""Names of single objects end in a number (``bench_3``); those of the ground and of countable swarms do not."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder.

    Raises:
        BagError: photographs, tag images, instance images, calibration or poses are missing, or the bag is damaged.
    """
    (run,) = runs
    views = _views_of(run)
    run.require(table.MODEL_STATES, table.TF_STATIC, *(view.info for view in views))
    movers = run.movers
    categories = categories_of(options.labels, {mover.label for mover in movers})
    for view in views:
        (target / "images" / view.label).mkdir(parents=True)
        (target / "panoptic" / view.label).mkdir(parents=True)
    names, _ = read_objects(run)
    numbering = Numbering(categories, options.labels, names, movers.by_id)
    boxes = CocoBoxes(run, options.labels, names) if options.boxes else None
    run.streams([view.topics[part] for view in views for part in _PARTS])
    frames = [(view.label, Frames(run, own_labels(options.classes), [view], extras=("instance",))) for view in views]
    about = {} if boxes is None else boxes.objects()
    jobs = sorted(
        (stamp, k, i) for k, (_, each) in enumerate(frames) for i, stamp in enumerate(each.stamps_ns.tolist())
    )
    work = partial(_write_frame, target, frames, numbering, boxes, movers)
    with CocoFiles(run, target, options.labels, categories, names, about) as files:
        for picture in options.each("images", run, jobs, work):
            files.add(picture)
        files.finish()


def _views_of(run: Run) -> list[Source]:
    """Views that took photographs, of the cameras with instance images.

    Raises:
        BagError: the rig has no camera, or a view lacks tag or instance images; the text states how to make those.
    """
    every, found = run.of(Image, recorded=False), run.of(Image, "photo")
    if not every:
        raise BagError(f"the rig of {run.bag} has no camera, and COCO is made of photographs")
    devices = {view.device for view in found if view.has(run.counts, "instance")}
    views = [view for view in found if not devices or view.device in devices]
    run.require(*(view.topics[part] for part in ("photo", "label") for view in views or every))
    run.require_instances(*(view.topics["instance"] for view in views))
    return views


def _write_frame(
    target: Path,
    frames: Sequence[tuple[str, Frames]],
    numbering: "Numbering",
    boxes: "CocoBoxes | None",
    movers: Movers,
    job: tuple[int, int, int],
) -> "Picture":
    """Write the image files of a frame, of a stamp, a view and a row; on any thread."""
    stamp, k, i = job
    label, frame = frames[k][0], frames[k][1][i]
    view, about, name = frame.views[label], frame.about[f"{ROLES[Image].key}s"][label], f"{label}/{stamp}"
    try:
        ids = numbering.number(view.mask, view.extras["instances"])
    except BagError as error:
        raise BagError(f"{label} camera at {stamp} ns: {error}") from error
    height, width = ids.shape
    (target / "images" / f"{name}{view.suffix}").write_bytes(view.photo)
    (target / "panoptic" / f"{name}.png").write_bytes(ids_png(ids))
    row = {
        "file_name": f"{name}{view.suffix}",
        "width": width,
        "height": height,
        "stamp_ns": stamp,
        "camera": label,
        "frame_id": about["frame_id"],
        "camera_matrix": about["K"],
        "distortion_model": about["distortion_model"],
        "distortion": about["D"],
        "world_from_camera": about["world_from_camera"],
    }
    segments = segments_of(ids)
    found = {} if boxes is None else boxes.of(label, segments, np.array(about["world_from_camera"]), stamp)
    moving = [number for number, state in movers.at(stamp).items() if movers.by_id[number].is_moving(state)]
    return Picture(row, f"{name}.png", segments, found, moving)


# ---------------------------------------------------------------------------------------------------------------------
# Categories and segments


class Category(NamedTuple):
    """A row of COCO's categories."""

    id: int
    name: str
    supercategory: str
    isthing: bool
    color: tuple[int, int, int]

    def row(self) -> dict[str, Any]:
        """Return it as JSON."""
        return self._asdict() | {"isthing": int(self.isthing)}


class Segment(NamedTuple):
    """All pixels with one id."""

    id: int
    area: int
    """Pixels."""
    bbox: list[int]
    """x, y of the upper left pixel, width, height."""
    counts: str
    """Run lengths down the columns, in COCO's compressed encoding."""


def categories_of(labels: LabelMap, movers: Collection[int] = ()) -> list[Category]:
    """Categories that pixels can have, by id: our classes, or those of another ontology to which ours are mapped.

    Classes of movers are countable.
    """
    ids = labels.ids
    result: list[Category] = []
    for number in sorted(labels.classes.keys() & {*ids.tolist()} - {int(ids[Label.VOID])}):
        ours = np.flatnonzero(ids == number).tolist()
        name, rgb = labels.classes[number]
        above = {_SUPERCATEGORIES.get(label, _OTHER) for label in ours}
        countable = (STUFF - {*movers}).isdisjoint(ours)
        result.append(Category(number, name, above.pop() if len(above) == 1 else name, countable, rgb))
    return result


def object_bits(names: Sequence[str]) -> int:
    """Bits of a segment id that hold the object; the higher ones hold the category."""
    return max(16, (len(names) - 1).bit_length())


class Numbering:
    """Segment ids: 65536 times the category, plus the instance id where the segment is a single object.

    An id has the same meaning in all images of a run. 0 is void: pixels without a class, in some ontologies only. Ids
    have 24 bits. With more than 65,536 objects the factor is a higher power of two, if the categories leave its bits.

    Raises:
        BagError: 24 bits do not hold categories and objects.
    """

    def __init__(
        self, categories: Sequence[Category], labels: LabelMap, names: Sequence[str], movers: Collection[int] = ()
    ) -> None:
        ids = labels.ids.astype(np.int64)
        known = {category.id: category for category in categories}
        countable = [int(number) in known and known[int(number)].isthing for number in ids]
        bits = object_bits(names)
        if (most := _BITS - max(known, default=0).bit_length()) < bits:
            raise BagError(
                f"COCO's panoptic images hold at most {1 << most} objects with these classes, got {len(names)}"
            )
        self._base = np.array([int(number) << bits if int(number) in known else 0 for number in ids], np.uint32)
        self._mask = np.where(countable, (1 << bits) - 1, 0).astype(np.uint32)
        single = [number if number in movers or _SINGLE.search(name) else 0 for number, name in enumerate(names)]
        self._single = np.array(single, np.uint32)

    def number(self, label: NDArray[np.uint8], instance: NDArray[np.uint16] | NDArray[np.uint32]) -> NDArray[np.uint32]:
        """Return the segment id of each pixel (h, w).

        Raises:
            BagError: labels and instance ids differ in shape, or an instance id is that of no object.
        """
        if label.shape != instance.shape:
            raise BagError(f"the tag image has {_size(label)} pixels, but the instance image {_size(instance)}")
        if (largest := int(instance.max(initial=0))) >= len(self._single):
            raise BagError(f"instance id {largest} must be below {len(self._single)}, the number of objects")
        objects = np.take(self._mask, label) & np.take(self._single, instance)
        numbers: NDArray[np.uint32] = np.take(self._base, label) | objects
        return numbers


def segments_of(ids: NDArray[np.uint32]) -> list[Segment]:
    """Segments of an image (h, w) of segment ids, by ascending id; 0 is not a segment.

    The run lengths of all segments are found in one pass. Encoding mask by mask takes five times as long.
    """
    flat = np.ascontiguousarray(ids.T).reshape(-1)
    starts = np.append(0, np.flatnonzero(flat[1:] != flat[:-1]) + 1)
    owners = flat[starts]
    order = np.argsort(owners, kind="stable")
    runs = np.stack([starts, np.append(starts[1:], flat.size)], axis=1)[order]
    numbers, sizes = np.unique(owners, return_counts=True)
    masks = [{"size": ids.shape, "counts": _counts(own, flat.size)} for own in np.split(runs, np.cumsum(sizes)[:-1])]
    encoded = coco_mask.frPyObjects(masks, *ids.shape)
    areas, boxes = coco_mask.area(encoded).tolist(), coco_mask.toBbox(encoded).astype(int).tolist()
    rows = zip(numbers.tolist(), areas, boxes, encoded, strict=True)
    return [Segment(number, area, box, rle["counts"].decode()) for number, area, box, rle in rows if number]


def _counts(runs: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Alternating lengths outside and inside of runs (n, 2) of start and end; nothing after a run at the end."""
    counts = np.diff(runs.reshape(-1), prepend=0, append=size)
    return counts if counts[-1] else counts[:-1]


def _size(image: NDArray[Any]) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"


# ---------------------------------------------------------------------------------------------------------------------
# Boxes of whole objects


class CocoBoxes:
    """Boxes of the segments that are a single object, or its part of one class; may be used by several threads.

    Raises:
        BagError: the world of the run is not known.
    """

    def __init__(self, run: Run, labels: LabelMap, names: Sequence[str]) -> None:
        (self._world, moving), self._bits = moving_world_of_run(run), object_bits(names)
        self._movers = run.movers
        views = run.of(Image, "photo", "instance")
        self._whole = {view.label: WholeObjects(self._world, view.config, moving) for view in views}
        self._ids = labels.ids
        self._boxes = {number: object_box(self._world, each) for number, each in named_objects(self._world).items()}

    def objects(self) -> dict[int, dict[str, Any]]:
        """Boxes in the world frame by instance id."""
        return {number: {"box_3d": box.as_json()} for number, box in self._boxes.items()}

    def of(
        self, view: str, segments: Sequence[Segment], world_from_optical: Array, stamp_ns: int
    ) -> dict[int, dict[str, Any]]:
        """Keys by id of the segment, for an image of a view from a pose (4, 4) at a stamp [ns]."""
        whole, found, optical_from_world = self._whole[view], {}, transforms.inverse(world_from_optical)
        boxes, states = dict(self._boxes), self._movers.at(stamp_ns)
        velocities = {number: self._movers.by_id[number].velocity(state) for number, state in states.items()}
        boxes |= {number: self._movers.by_id[number].box(state) for number, state in states.items()}
        for segment in segments:
            category, number = divmod(segment.id, 1 << self._bits)
            if number not in boxes:
                continue
            labels = frozenset(int(label) for label in np.flatnonzero(self._ids == category))
            alone = whole.silhouette(number, world_from_optical, labels, stamp_ns)
            keys: dict[str, Any] = {
                "amodal_bbox": alone.bbox,
                "amodal_area": alone.pixels,
                "visibility": round(segment.area / max(alone.pixels, segment.area), 6),
            }
            if whole.config.lens.model == "pinhole":
                bounds = whole.bounds(number, world_from_optical, labels, stamp_ns)
                if bounds is not None:  # from pixel centres to COCO's pixel borders
                    left, top, right, bottom = (bounds + 0.5).tolist()
                    keys["amodal_bbox_full"] = [left, top, right - left, bottom - top]
            box = boxes[number].in_frame(optical_from_world).as_json()
            if number in velocities:
                box["velocity"] = (optical_from_world[:3, :3] @ velocities[number]).tolist()
            found[segment.id] = keys | {"box_3d": box}
        return found


# ---------------------------------------------------------------------------------------------------------------------
# JSON files


class Picture(NamedTuple):
    """An exported image."""

    row: dict[str, Any]
    """Its row in ``images``, without id and licence."""
    panoptic: str
    """File name of its panoptic PNG."""
    segments: list[Segment]
    boxes: Mapping[int, dict[str, Any]] = MappingProxyType({})
    """Further keys of the annotations, by id of the segment."""
    moving: Collection[int] = ()
    """Instance ids of the objects that move at its stamp."""


class CocoFiles(ExitStack):
    """``panoptic.json`` and ``instances.json`` as a context, written image by image; ``finish`` ends them.

    Args:
        run: the run.
        folder: of the files.
        labels: ontology of the categories.
        categories: of the pixels; those of countable objects are in instances.json, too.
        names: of the objects, by instance id.
        about: further keys of objects, by instance id.
    """

    def __init__(
        self,
        run: Run,
        folder: Path,
        labels: LabelMap,
        categories: Sequence[Category],
        names: Sequence[str],
        about: Mapping[int, Mapping[str, Any]],
    ) -> None:
        super().__init__()
        countable = [category for category in categories if category.isthing]
        self._countable, self._bits = {category.id for category in countable}, object_bits(names)
        self._licence = {} if run.experiment is None else {"license": _LICENCE["id"]}
        objects = [{"id": number, "name": name, **about.get(number, {})} for number, name in enumerate(names)]
        self._streams: dict[str, TextIO] = {}
        self._counts = {"images": 0, "panoptic": 0, "instances": 0}
        for name, chosen in (("panoptic", categories), ("instances", countable)):
            stream = self.enter_context((folder / f"{name}.json").open("w", encoding="utf-8"))
            head = _head(run, labels) | {"categories": [c.row() for c in chosen], "objects": objects}
            lines = (f"{json.dumps(key)}:{json.dumps(value, ensure_ascii=False)},\n" for key, value in head.items())
            stream.write("{" + "".join(lines) + '"annotations":[')
            self._streams[name] = stream
        images = TemporaryFile("w+", encoding="utf-8", dir=folder)  # noqa: SIM115
        self._streams["images"] = self.enter_context(images)

    def add(self, picture: Picture) -> None:
        """Add an image and its segments; segments of countable classes become annotations, too."""
        image_id = self._counts["images"] + 1
        self._write("images", {"id": image_id} | picture.row | self._licence)
        segments = []
        size = [picture.row["height"], picture.row["width"]]
        for segment in picture.segments:
            category, object_id = divmod(segment.id, 1 << self._bits)
            countable = category in self._countable
            known = {
                "category_id": category,
                "area": segment.area,
                "bbox": segment.bbox,
                "iscrowd": int(countable and not object_id),
                "object_id": object_id,
            }
            if countable and object_id:
                known |= {"track_id": object_id, "attributes": {"moving": object_id in picture.moving}}
            known |= picture.boxes.get(segment.id, {})
            segments.append({"id": segment.id} | known)
            if countable:
                row = {"id": self._counts["instances"] + 1, "image_id": image_id} | known
                self._write("instances", row | {"segmentation": {"size": size, "counts": segment.counts}})
        self._write("panoptic", {"image_id": image_id, "file_name": picture.panoptic, "segments_info": segments})

    def finish(self) -> None:
        """Write the images behind the annotations."""
        images = self._streams.pop("images")
        for stream in self._streams.values():
            stream.write('\n],\n"images":[')
            images.seek(0)
            shutil.copyfileobj(images, stream)
            stream.write("\n]}\n")

    def _write(self, name: str, row: Mapping[str, Any]) -> None:
        """Add an object to a list."""
        separator = ",\n" if self._counts[name] else "\n"
        self._streams[name].write(separator + json.dumps(row, separators=(",", ":")))
        self._counts[name] += 1


def _head(run: Run, labels: LabelMap) -> dict[str, Any]:
    """``info`` and ``licenses`` of both files; the licence is known only for bags that fieldtruth generated."""
    info: dict[str, Any] = {
        "description": f"{run.name}: images with the true class and object of each pixel",
        "version": fieldtruth.__version__,
        "contributor": "fieldtruth",
        "run": run.name,
        "labels": labels.name,
    }
    if run.experiment is not None:
        info |= {"environment": run.experiment.world_name, "seed": run.experiment.seed}
    return {"info": info, "licenses": [] if run.experiment is None else [_LICENCE]}

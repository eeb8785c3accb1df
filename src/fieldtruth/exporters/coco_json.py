# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""COCO's two JSON files, written row by row: the annotations of a long drive may exceed the memory."""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TextIO

import fieldtruth
from fieldtruth.bag.run import Run
from fieldtruth.exporters.coco_segments import Category, Segment, object_bits
from fieldtruth.ontology.label_map import LabelMap

_LICENCE: Final = {"id": 1, "name": "CC BY 4.0", "url": "https://creativecommons.org/licenses/by/4.0/"}


class Picture(NamedTuple):
    """An exported image."""

    stamp_ns: int
    row: dict[str, Any]
    """Its row in ``images``, without id and licence."""
    panoptic: str
    """File name of its panoptic PNG."""
    segments: list[Segment]
    boxes: Mapping[int, dict[str, Any]] = MappingProxyType({})
    """Further keys of the annotations, by id of the segment."""


class _Rows:
    """A JSON array that grows in a text file."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._separator = "\n"

    def add(self, row: Mapping[str, Any]) -> None:
        """Add an object."""
        self._stream.write(self._separator + json.dumps(row, separators=(",", ":")))
        self._separator = ",\n"


class CocoFiles:
    """The rows of ``panoptic.json`` and ``instances.json``, by image; a segment id has ``bits`` for the object."""

    def __init__(
        self, images: _Rows, panoptic: _Rows, instances: _Rows, countable: Set[int], bits: int, *, own: bool
    ) -> None:
        self._images, self._panoptic, self._instances = images, panoptic, instances
        self._countable, self._bits = countable, bits
        self._licence = {"license": _LICENCE["id"]} if own else {}
        self.image_count = self._annotation_count = 0

    def add(self, picture: Picture) -> None:
        """Add an image and its segments; segments of countable classes become annotations, too."""
        self.image_count += 1
        self._images.add({"id": self.image_count} | picture.row | self._licence)
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
            } | picture.boxes.get(segment.id, {})
            segments.append({"id": segment.id} | known)
            if countable:
                self._annotation_count += 1
                row = {"id": self._annotation_count, "image_id": self.image_count} | known
                self._instances.add(row | {"segmentation": {"size": size, "counts": segment.counts}})
        self._panoptic.add({"image_id": self.image_count, "file_name": picture.panoptic, "segments_info": segments})


@contextmanager
def coco_files(
    run: Run,
    folder: Path,
    label_map: LabelMap | None,
    categories: Sequence[Category],
    names: Sequence[str],
    about: Mapping[int, Mapping[str, Any]] = MappingProxyType({}),
) -> Iterator[CocoFiles]:
    """Open both files; they are complete when the context ends. ``names`` are those of the objects, by instance id.

    ``about`` has further keys of objects by instance id.
    """
    rows = folder / "images.part"
    head = _head(run, label_map)
    objects = [{"id": number, "name": name, **about.get(number, {})} for number, name in enumerate(names)]
    countable = [category for category in categories if category.isthing]
    with ExitStack() as stack:
        stack.callback(rows.unlink, missing_ok=True)
        panoptic, instances = (
            stack.enter_context(
                _document(folder / name, head | {"categories": [c.row() for c in chosen], "objects": objects}, rows)
            )
            for name, chosen in (("panoptic.json", categories), ("instances.json", countable))
        )
        images = _Rows(stack.enter_context(rows.open("w", encoding="utf-8")))
        yield CocoFiles(
            images, panoptic, instances, {c.id for c in countable}, object_bits(names), own=run.experiment is not None
        )


@contextmanager
def _document(path: Path, head: Mapping[str, Any], images: Path) -> Iterator[_Rows]:
    """Write the keys of ``head``, the annotations that are added, and the images, whose rows are in a file."""
    with path.open("w", encoding="utf-8") as stream:
        stream.write("{")
        for key, value in head.items():
            stream.write(f"{json.dumps(key)}:{json.dumps(value, ensure_ascii=False)},\n")
        stream.write('"annotations":[')
        yield _Rows(stream)
        stream.write('\n],\n"images":[')
        with images.open(encoding="utf-8") as rows:
            shutil.copyfileobj(rows, stream)
        stream.write("\n]}\n")


def _head(run: Run, label_map: LabelMap | None) -> dict[str, Any]:
    """``info`` and ``licenses`` of both files; the licence is known only for bags that fieldtruth generated."""
    info: dict[str, Any] = {
        "description": f"{run.name}: images with the true class and object of each pixel",
        "version": fieldtruth.__version__,
        "contributor": "fieldtruth",
        "run": run.name,
        "labels": "fieldtruth" if label_map is None else label_map.name,
    }
    if run.experiment is not None:
        info |= {"environment": run.experiment.environment, "seed": run.experiment.seed}
    return {"info": info, "licenses": [] if run.experiment is None else [_LICENCE]}

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as a folder for Hugging Face's ``datasets``: Parquet files, a card, and Croissant metadata.

There are two tables, configurations in the words of that library: ``images``, a row per photograph, and ``clouds``, a
row per cloud. Both have a split each.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from fieldtruth.bag.decode import MEASURED
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import EXTRAS, PARTS, Source
from fieldtruth.core.png import encode_png, ids_png
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import LIDAR, SPLITS, Frame, Frames, Member, cameras_of, require_frames
from fieldtruth.exporters.huggingface_card import CARD, CROISSANT, Column, Table, Written, card_text, croissant_text
from fieldtruth.exporters.image_files import encode_tiff
from fieldtruth.ontology import LabelMap

_Row = tuple[dict[str, Any], int]
"""Values by column, and their size [byte]."""
_GROUP_BYTES: Final = 32 * 10**6
"""Rows are written together up to this size, which is in memory."""
_IMAGE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
_CLASSES: Final = Column("classes", "classes", "the classes that occur")
_RUN: Final = Column("run", "string", "name of the run")
_STAMP: Final = Column("stamp_ns", "int64", "simulated time [ns]")

_IMAGE_COLUMNS: Final = (
    Column("image", "image", "photograph, {formats}, byte for byte as recorded"),
    Column("mask", "image", "class id of each pixel, PNG, grey, 8 bits"),
    _CLASSES,
    _RUN,
    Column("camera", "string", "{cameras}"),
    _STAMP,
    Column("K", "float64[]", "pinhole matrix (3, 3) [pixel], row by row"),
    Column("world_from_camera", "float64[]", "true pose (4, 4) of the optical frame, row by row"),
    Column("base_from_camera", "float64[]", "mount (4, 4) of the optical frame, row by row"),
)
_LENS_COLUMNS: Final = (
    Column("distortion_model", "string", "model of the lens, as in ROS's CameraInfo"),
    Column("D", "float64[]", "coefficients of the lens, as in ROS's CameraInfo"),
)
_EXTRA_COLUMNS: Final = {
    "depth": Column("depth", "image", "depth [m] along the optical axis, TIFF, 32-bit float; infinite in the sky"),
    "instances": Column(
        "instances",
        "image",
        "instance id of each pixel, PNG, grey, 16 bits (beyond id 65,535: R + 256 G + 65536 B); 0: sky, robot",
    ),
    "normals": Column(
        "normals",
        "float32[]",
        "unit normals (h, w, 3) towards the camera in its optical frame, row by row; 0 in the sky",
    ),
    "flow": Column(
        "flow",
        "float32[]",
        "optical flow (h, w, 2) [pixel] to the camera's next image, row by row; NaN: not seen there",
    ),
}
_CLOUD_COLUMNS: Final = (
    *(Column(axis, "float32[]", f"{axis} [m] of the returns in the LiDAR's frame") for axis in "xyz"),
    Column("label", "uint8[]", "class id of each return"),
    _CLASSES,
    _RUN,
    _STAMP,
    Column("world_from_lidar", "float64[]", "true pose (4, 4) of the LiDAR's frame, row by row"),
    Column("base_from_lidar", "float64[]", "mount (4, 4) of the LiDAR's frame, row by row"),
)
_FIELD_COLUMNS: Final = {
    "instance": Column("instance", "int32[]", "instance id of each return, as in the images"),
    "ring": Column("ring", "int32[]", "row of the LiDAR's ray"),
    "column": Column("column", "int32[]", "column of the LiDAR's ray"),
    "t": Column("t", "int64[]", "time [ns] of each return after stamp_ns"),
    "true_range": Column("true_range", "float32[]", "exact range [m] along the middle of each return's beam"),
    "signal": Column("signal", "float32[]", "photons of each return"),
    "reflectivity": Column("reflectivity", "float32[]", "reflectivity of each return, 1 for a white surface"),
    "echo": Column("echo", "int32[]", "number of the echo of its beam, 0 for the nearest"),
    "mixed": Column("mixed", "int32[]", "1 if surfaces of several classes or objects made the echo"),
}


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder: ``images/``, ``clouds/``, README.md and croissant.json.

    Raises:
        BagError: a run has neither images with labels nor clouds, or is damaged.
    """
    target.mkdir(parents=True)
    labels, members = options.labels, options.members
    names = class_names(labels)
    for member in members:
        run = member.run
        require_frames(run, clouds=True)
        sources = [*run.of(Image), *run.of(Cloud)]
        run.streams([topic for each in sources for topic in each.topics.values() if topic in run.counts])  # in one pass
    tables = []
    for name, columns, rows in (
        ("images", _image_columns(members), _images),
        ("clouds", _cloud_columns(members), _clouds),
    ):
        splits: dict[str, Written] = {}
        for split in SPLITS if columns else ():
            with ParquetFiles(target / name, split, columns, names, options.shard_bytes) as files:
                for member in members:
                    if member.split == split:
                        for row, size in rows(member, options):
                            files.add(row, size)
            if files.written.rows:
                splits[split] = files.written
        if splits:
            tables.append(Table(name, columns, splits))
    (target / CARD).write_text(card_text(tables, members, labels, names), encoding="utf-8")
    with options.progress.stage("checksums"):
        (target / CROISSANT).write_text(croissant_text(target, tables, members, labels), encoding="utf-8")


def class_names(labels: LabelMap) -> list[str]:
    """Names by class id from 0 without gaps, as ``ClassLabel`` needs them."""
    return [labels.classes[k].name if k in labels.classes else f"unused {k}" for k in range(max(labels.classes) + 1)]


def _image_columns(members: Sequence[Member]) -> tuple[Column, ...]:
    """Columns of the images: those of ``EXTRAS``, if any run has them; nothing without photographs."""
    views = [(member.run, v) for member in members for views in cameras_of(member.run).values() for v in views]
    found = [_EXTRA_COLUMNS[PARTS[part]] for part in EXTRAS if any(view.has(run.counts, part) for run, view in views)]
    names = " or ".join(dict.fromkeys(view.label for _, view in views))
    columns = (*_IMAGE_COLUMNS[:2], *found, *_IMAGE_COLUMNS[2:]) if views else ()
    columns += _LENS_COLUMNS * any(_is_distorted(run, view) for run, view in views)
    formats = " or ".join(sorted({_format_of(run, view) for run, view in views}))
    return tuple(column._replace(about=column.about.format(cameras=names, formats=formats)) for column in columns)


def _format_of(run: Run, view: Source) -> str:
    """Return the format of a view's photographs, as the first one has it."""
    start = bytes(run.readings(view.name, ["photo"]).message(0).data[:4])
    return "PNG" if start == b"\x89PNG" else "JPEG"


def _is_distorted(run: Run, view: Source) -> bool:
    """Return True if K alone does not describe a camera."""
    return run.calibration.has_lens(view.name) and not run.calibration.lens(view.name).is_pinhole


def _cloud_columns(members: Sequence[Member]) -> tuple[Column, ...]:
    """Columns of the clouds: further fields of the points, if any run has them; nothing without clouds.

    The LiDAR's name is a column, unless there is only the paper's.
    """
    lidars = [(member.run, lidar) for member in members for lidar in member.run.of(Cloud)]
    fields = {field.name for run, lidar in lidars for field in run[lidar.name].message(0).fields}
    fields -= set() if "true_range" in fields else set(MEASURED)  # an ideal Ouster's reflectivity is the class
    found = [column for name, column in _FIELD_COLUMNS.items() if name in fields]
    names = list(dict.fromkeys(lidar.name for _, lidar in lidars))
    lidar = [Column("lidar", "string", " or ".join(names))] if names != [LIDAR] else []
    return (*_CLOUD_COLUMNS[:4], *found, *_CLOUD_COLUMNS[4:6], *lidar, *_CLOUD_COLUMNS[6:]) if lidars else ()


def _images(member: Member, options: Options) -> Iterator[_Row]:
    """Rows of a run's images, camera by camera in time order."""
    for views in cameras_of(member.run).values():
        yield from _rows(member, "images", Frames(member.run, options.labels, views), _image_rows, options)


def _clouds(member: Member, options: Options) -> Iterator[_Row]:
    """Rows of a run's clouds, LiDAR by LiDAR in time order."""
    for lidar in member.run.of(Cloud):
        yield from _rows(member, "clouds", Frames(member.run, options.labels, [], [lidar]), _cloud_rows, options)


def _rows(
    member: Member, what: str, frames: Frames, rows_of: Callable[[Member, Frame], list[_Row]], options: Options
) -> Iterator[_Row]:
    made = options.each(f"{member.name}: {what}", member.run, range(len(frames)), lambda i: rows_of(member, frames[i]))
    return (row for rows in made for row in rows)


def _image_rows(member: Member, frame: Frame) -> list[_Row]:
    rows = []
    for camera, view in frame.views.items():
        name = f"{member.name}_{camera}_{frame.stamp_ns:019d}"
        images = {"image": (view.photo, view.suffix), "mask": (encode_png(view.mask), ".png")}
        if "depth" in view.extras:
            images["depth"] = encode_tiff(view.extras["depth"]), ".tif"
        if "instances" in view.extras:
            images["instances"] = ids_png(view.extras["instances"]), ".png"
        about = frame.about["cameras"].get(camera, {})
        row: dict[str, Any] = {key: {"bytes": data, "path": name + end} for key, (data, end) in images.items()}
        row |= {"classes": np.unique(view.mask).tolist(), "run": member.name, "camera": camera}
        row |= {"stamp_ns": frame.stamp_ns} | _flat(about, "K", "world_from_camera", "base_from_camera", "D")
        flat: dict[str, NDArray[Any]] = {
            key: view.extras[key].ravel() for key in ("normals", "flow") if key in view.extras
        }
        row |= flat
        row["distortion_model"] = about.get("distortion_model")
        size = sum(len(data) for data, _ in images.values()) + sum(values.nbytes for values in flat.values())
        rows.append((row, size))
    return rows


def _cloud_rows(member: Member, frame: Frame) -> list[_Row]:
    ((lidar, cloud),) = frame.clouds.items()
    row: dict[str, Any] = {axis: cloud["xyz"][:, k] for k, axis in enumerate("xyz")}
    row |= {name: values for name, values in cloud.items() if name != "xyz"}
    size = sum(values.nbytes for values in row.values())
    row |= {"classes": np.unique(cloud["label"]).tolist(), "run": member.name, "lidar": lidar}
    about = frame.about[LIDAR] if lidar == LIDAR else frame.about["lidars"][lidar]
    return [(row | {"stamp_ns": frame.stamp_ns} | _flat(about, "world_from_lidar", "base_from_lidar"), size)]


def _flat(sensor: Mapping[str, Any], *keys: str) -> dict[str, list[float]]:
    """Matrices row by row, as far as they are known."""
    return {key: np.ravel(sensor[key]).tolist() for key in keys if key in sensor}


# ---------------------------------------------------------------------------------------------------------------------
# Parquet


def _arrow_type(column: Column) -> Any:
    if column.kind == "image":
        return _IMAGE
    value = getattr(pa, column.dtype)()
    return pa.list_(value) if column.is_list else value


class ParquetFiles:
    """Files ``SPLIT-00000-of-00003.parquet`` of a split, as a context; ``written`` is known at its end."""

    def __init__(self, folder: Path, split: str, columns: Sequence[Column], names: Sequence[str], most: int) -> None:
        self._folder, self._split, self._most = folder, split, most
        features = {column.name: column.feature(names) for column in columns}
        metadata = {"huggingface": json.dumps({"info": {"features": features}})}
        self._schema = pa.schema([(column.name, _arrow_type(column)) for column in columns], metadata=metadata)
        self._rows: list[Mapping[str, Any]] = []
        self._waiting = self._size = self._count = self._total = 0
        self._writer: pq.ParquetWriter | None = None
        self._parts: list[Path] = []
        self.written = Written((), 0, 0)

    def __enter__(self) -> "ParquetFiles":
        return self

    def add(self, row: Mapping[str, Any], size: int) -> None:
        """Add a row that has ``size`` bytes; missing columns are null."""
        if self._waiting and self._waiting + size > min(_GROUP_BYTES, self._most):
            self._flush()
        self._rows.append(row)
        self._waiting += size

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if kind is None and self._rows:
            self._flush()
        if self._writer is not None:
            self._writer.close()
        if kind is None:
            self.written = Written(tuple(self._numbered()), self._count, self._total)

    def _flush(self) -> None:
        columns = [pa.array([row.get(field.name) for row in self._rows], field.type) for field in self._schema]
        table = pa.Table.from_arrays(columns, schema=self._schema)
        if self._writer is None or self._size + table.nbytes > self._most:
            self._writer = self._next_file()
        self._writer.write_table(table, row_group_size=len(table))
        self._count += len(table)
        self._size += table.nbytes
        self._total += table.nbytes
        self._rows, self._waiting = [], 0

    def _next_file(self) -> pq.ParquetWriter:
        if self._writer is not None:
            self._writer.close()
        self._folder.mkdir(exist_ok=True)
        path = self._folder / f"{self._split}.{len(self._parts)}"
        self._parts.append(path)
        self._size = 0
        return pq.ParquetWriter(path, self._schema, compression="zstd", use_dictionary=["run", "camera", "lidar"])

    def _numbered(self) -> list[Path]:
        """Rename the files, whose number is now known."""
        count = len(self._parts)
        return [
            part.rename(self._folder / f"{self._split}-{k:05d}-of-{count:05d}.parquet")
            for k, part in enumerate(self._parts)
        ]

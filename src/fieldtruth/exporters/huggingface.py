# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as a folder for Hugging Face's ``datasets``: Parquet files, a card, and Croissant metadata.

Tables, configurations in the words of that library, are ``images``, a row per photograph, ``clouds``, a row per cloud,
and with options of maps ``maps``, a row per map around the robot. Each has its splits.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from fieldtruth.bag.decode import MEASURED
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import EXTRAS, Source
from fieldtruth.core.png import encode_png, ids_png
from fieldtruth.core.readings import Cloud, Image, Reading
from fieldtruth.core.yaml_io import package_data
from fieldtruth.datasets.items import ROLES
from fieldtruth.experiment.image_topics import IMAGES
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import (
    PAPER,
    SPLITS,
    Frames,
    Member,
    cloud_about,
    format_of,
    noun_of,
    require_frames,
    views_of,
)
from fieldtruth.exporters.huggingface_card import CARD, CROISSANT, Column, Table, Written, card_text, croissant_text
from fieldtruth.exporters.image_files import encode_tiff
from fieldtruth.exporters.local_maps import local_maps_of
from fieldtruth.local_maps import layers_of
from fieldtruth.ontology import LabelMap
from fieldtruth.world_maps.layers import Layer

_Row = tuple[dict[str, Any], int]
"""Values by column, and their size [byte]."""
_NAMES: Final = ["run", *(role.key for role in ROLES.values())]
"""Columns of names, which repeat."""
_GROUP_BYTES: Final = 32 * 10**6
"""Rows are written together up to this size, which is in memory."""
_IMAGE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
_COLUMNS: Final = {
    table: tuple(Column(**row) for row in rows)
    for table, rows in package_data("fieldtruth.exporters", "huggingface.yaml").items()
}
_EXTRAS, _FIELDS = ({column.name: column for column in _COLUMNS[table]} for table in ("extra", "field"))


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
    tables: list[Table] = []
    contents: list[tuple[str, tuple[Column, ...], Callable[[Member], Iterator[_Row]]]] = [
        ("images", _image_columns(members), lambda member: _rows(member, "images", Image, options)),
        ("clouds", _cloud_columns(members), lambda member: _rows(member, "clouds", Cloud, options)),
        ("maps", _map_columns(options), lambda member: _map_rows(member, options)),
    ]
    for name, columns, rows_of in contents:
        splits: dict[str, Written] = {}
        for split in SPLITS if columns else ():
            with ParquetFiles(target / name, split, columns, names, options.shard_bytes) as files:
                for member in members:
                    for row, size in rows_of(member) if member.split == split else ():
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
    views = [(member.run, v) for member in members for views in views_of(member.run).values() for v in views]
    found = [_EXTRAS[IMAGES[part]] for part in EXTRAS if any(view.has(run.counts, part) for run, view in views)]
    names = " or ".join(dict.fromkeys(view.label for _, view in views))
    columns = (*_COLUMNS["image"][:2], *found, *_COLUMNS["image"][2:]) if views else ()
    columns += _COLUMNS["lens"] * any(_is_distorted(run, view) for run, view in views)
    formats = " or ".join(sorted({format_of(run, view) for run, view in views}))
    return tuple(column._replace(about=column.about.format(views=names, formats=formats)) for column in columns)


def _is_distorted(run: Run, view: Source) -> bool:
    """Return True if K alone does not describe a camera."""
    return run.calibration.has_lens(view.name) and not run.calibration.lens(view.name).is_pinhole


def _cloud_columns(members: Sequence[Member]) -> tuple[Column, ...]:
    """Columns of the clouds: further fields of the points, if any run has them; nothing without clouds.

    The sensor's name is a column, unless there is only the paper's.
    """
    sensors = [(member.run, sensor) for member in members for sensor in member.run.of(Cloud)]
    fields = {field.name for run, sensor in sensors for field in run[sensor.name].message(0).fields}
    fields -= set() if "true_range" in fields else set(MEASURED)  # an ideal Ouster's reflectivity is the class
    found = [column for name, column in _FIELDS.items() if name in fields]
    names = list(dict.fromkeys(sensor.name for _, sensor in sensors))
    named = [Column(ROLES[Cloud].key, "string", " or ".join(names))] if names != [PAPER] else []
    columns = (*_COLUMNS["cloud"][:4], *found, *_COLUMNS["cloud"][4:6], *named, *_COLUMNS["cloud"][6:])
    noun = noun_of(sensor for _, sensor in sensors)
    return tuple(each._replace(about=each.about.format(noun=noun)) for each in columns) if sensors else ()


def _rows(member: Member, what: str, kind: type[Reading], options: Options) -> Iterator[_Row]:
    """Rows of a run's images or clouds, sensor by sensor in time order."""
    run, rows_of = member.run, _image_rows if kind is Image else _cloud_rows
    chosen: list[tuple[list[Source], list[Source]]] = [([], [sensor]) for sensor in run.of(Cloud)]
    if kind is Image:
        chosen = [(views, []) for views in views_of(run).values()]
    for views, clouds in chosen:
        frames = Frames(run, options.labels, views, clouds)
        work = partial(rows_of, member, frames)
        for rows in options.each(f"{member.name}: {what}", run, range(len(frames)), work):
            yield from rows


def _image_rows(member: Member, frames: Frames, i: int) -> list[_Row]:
    rows, frame, named = [], frames[i], ROLES[Image].key
    for label, view in frame.views.items():
        name = f"{member.name}_{label}_{frame.stamp_ns:019d}"
        images = {"image": (view.photo, view.suffix), "mask": (encode_png(view.mask), ".png")}
        if "depth" in view.extras:
            images["depth"] = encode_tiff(view.extras["depth"]), ".tif"
        if "instances" in view.extras:
            images["instances"] = ids_png(view.extras["instances"]), ".png"
        if "parts" in view.extras:
            images["parts"] = encode_png(view.extras["parts"]), ".png"
        about = frame.about[f"{named}s"].get(label, {})
        row: dict[str, Any] = {key: {"bytes": data, "path": name + end} for key, (data, end) in images.items()}
        row |= {"classes": np.unique(view.mask).tolist(), "run": member.name, named: label}
        row |= {"stamp_ns": frame.stamp_ns} | _flat(about, "image", "lens")
        flat: dict[str, NDArray[Any]] = {
            key: view.extras[key].ravel() for key in ("normals", "flow", "passability") if key in view.extras
        }
        row |= flat
        row["distortion_model"] = about.get("distortion_model")
        size = sum(len(data) for data, _ in images.values()) + sum(values.nbytes for values in flat.values())
        rows.append((row, size))
    return rows


def _cloud_rows(member: Member, frames: Frames, i: int) -> list[_Row]:
    frame = frames[i]
    ((sensor, cloud),) = frame.clouds.items()
    row: dict[str, Any] = {axis: cloud["xyz"][:, k] for k, axis in enumerate("xyz")}
    row |= {name: values for name, values in cloud.items() if name != "xyz"}
    size = sum(values.nbytes for values in row.values())
    row |= {"classes": np.unique(cloud["label"]).tolist(), "run": member.name, ROLES[Cloud].key: sensor}
    return [(row | {"stamp_ns": frame.stamp_ns} | _flat(cloud_about(frame, sensor), "cloud"), size)]


def _map_columns(options: Options) -> tuple[Column, ...]:
    """Columns of maps around the robot; nothing without maps."""
    given, rows = options.maps.given(), dict[str, Layer]()
    for member in options.members if given else ():
        rows |= layers_of(member.run, **given)
    kinds = {name: f"{np.dtype(row.dtype).name}[]" for name, row in rows.items()}
    units = {name: f" [{row.unit}]" if row.unit else "" for name, row in rows.items()}
    abouts = {name: f"{row.description}{units[name]}; (n, n), row by row" for name, row in rows.items()}
    return (*(Column(name, kinds[name], abouts[name]) for name in rows), *(_COLUMNS["map"] if rows else ()))


def _map_rows(member: Member, options: Options) -> Iterator[_Row]:
    """Rows of a run's maps around the robot, in time order; the maps of one run are in memory at a time."""
    maps = local_maps_of(member.run, options)
    assert maps is not None

    def encode(i: int) -> _Row:
        made = maps[i].arrays
        row = {name: values.ravel() if values.ndim else values.item() for name, values in made.items()}
        return {**row, "run": member.name}, sum(values.nbytes for values in made.values())

    return options.each(f"{member.name}: maps", member.run, range(len(maps)), encode)


def _flat(about: Mapping[str, Any], *tables: str) -> dict[str, list[float]]:
    """Matrices row by row, as far as they are known."""
    names = [column.name for table in tables for column in _COLUMNS[table] if column.kind == "float64[]"]
    return {name: np.ravel(about[name]).tolist() for name in names if name in about}


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
        return pq.ParquetWriter(path, self._schema, compression="zstd", use_dictionary=_NAMES)

    def _numbered(self) -> list[Path]:
        """Rename the files, whose number is now known."""
        count = len(self._parts)
        return [
            part.rename(self._folder / f"{self._split}-{k:05d}-of-{count:05d}.parquet")
            for k, part in enumerate(self._parts)
        ]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The two descriptions of a data set for Hugging Face: its card and its Croissant metadata.

The card, README.md, has a header in YAML that ``datasets`` and the hub read, and text. croissant.json states files with
checksums, record sets and responsible-AI properties; the vocabularies are Croissant 1.0 and Croissant RAI 1.0 of
MLCommons (docs.mlcommons.org/croissant).
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml

import fieldtruth
from fieldtruth.bag.provenance import sha256_of
from fieldtruth.bag.topics import Source
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.core.templates import templates
from fieldtruth.core.yaml_io import filled, package_data
from fieldtruth.datasets.items import ROLES
from fieldtruth.exporters.frames import Member, noun_of
from fieldtruth.ontology import LabelMap
from fieldtruth.report.card import card_part, collection_of, conditions_of

CARD: Final = "README.md"
CROISSANT: Final = "croissant.json"
LICENCE: Final = "cc-by-4.0"
"""Licence of what fieldtruth generated; that of other bags is not known."""
_KEYS: Final = ("run", *(role.key for role in ROLES.values()), "stamp_ns")
"""Columns that identify a row."""
_FIXED: Final = package_data("fieldtruth.exporters", "croissant.yaml")


class Column(NamedTuple):
    """A column of a table."""

    name: str
    kind: str
    """``image``, ``classes``, or an Arrow type by name, with ``[]`` for a list of it: ``int64``, ``float32[]``."""
    about: str

    @property
    def is_list(self) -> bool:
        """True if a cell has several values."""
        return self.kind.endswith("[]") or self.kind == "classes"

    @property
    def dtype(self) -> str:
        """Name of the type of a value."""
        return "int64" if self.kind == "classes" else self.kind.removesuffix("[]")

    def feature(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the feature as ``datasets`` stores it in a file; ``names`` are those of the classes."""
        if self.kind == "image":
            return {"_type": "Image"}
        value: dict[str, Any] = {"dtype": self.dtype, "_type": "Value"}
        if self.kind == "classes":
            value = {"names": list(names), "_type": "ClassLabel"}
        return {"feature": value, "_type": "Sequence"} if self.is_list else value

    def card(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the feature as it is written in the card's header."""
        if self.kind == "classes":
            named = {str(number): name for number, name in enumerate(names)}
            return {"name": self.name, "sequence": {"class_label": {"names": named}}}
        return {"name": self.name, "sequence" if self.is_list else "dtype": self.dtype}


class Written(NamedTuple):
    """Size of the files of a split."""

    files: tuple[Path, ...]
    rows: int
    memory_bytes: int

    @property
    def file_bytes(self) -> int:
        """Bytes on disk."""
        return sum(path.stat().st_size for path in self.files)


class Table(NamedTuple):
    """A configuration of a data set for Hugging Face."""

    name: str
    columns: tuple[Column, ...]
    splits: Mapping[str, Written]


def title_of(members: Sequence[Member]) -> str:
    """Name of the data set: its runs, or if there are many the environments."""
    names = [member.name for member in members]
    if len(names) > 3:
        environments = sorted({m.run.experiment.world_name for m in members if m.run.experiment is not None})
        names = [f"{len(names)} runs", *environments]
    return f"fieldtruth: {', '.join(names)}"


def is_own(members: Sequence[Member]) -> bool:
    """Return True if fieldtruth generated all runs."""
    return all(member.run.experiment is not None for member in members)


def content_of(members: Sequence[Member]) -> tuple[str, list[str]]:
    """Return the kinds of readings of a data set, for its description, and the units with labels: pixel, point."""
    views = [view for member in members for view in member.run.of(Image, "photo", "label")]
    clouds = _cloud_sensors(members)
    kinds = {
        "pixel": "Stereo photographs" if any(view.side for view in views) else "Photographs" if views else "",
        "point": f"{noun_of(clouds)} clouds" if clouds else "",
    }
    return " and ".join(filter(None, kinds.values())), [unit for unit, kind in kinds.items() if kind]


def _cloud_sensors(members: Sequence[Member]) -> list[Source]:
    return [sensor for member in members for sensor in member.run.of(Cloud)]


def _tags(members: Sequence[Member]) -> list[str]:
    """Kinds of the sensors of clouds, by which data sets are found."""
    return list(dict.fromkeys(sensor.config.kind for sensor in _cloud_sensors(members)))


def card_text(tables: Sequence[Table], members: Sequence[Member], labels: LabelMap, names: Sequence[str]) -> str:
    """Return the card.

    Args:
        tables: the configurations, the default one first.
        members: the runs.
        labels: the classes.
        names: of the classes by id, without gaps.
    """
    content, units = content_of(members)
    made = [member.run.experiment for member in members if member.run.experiment is not None]
    header = yaml.safe_dump(_header(tables, members, names), sort_keys=False, allow_unicode=True, width=1000)
    template = templates("fieldtruth.exporters").get_template("huggingface.md.jinja")
    return template.render(
        header=header,
        title=title_of(members),
        content=content,
        units=units,
        version=fieldtruth.__version__,
        tables=tables,
        members=members,
        classes=sorted(labels.classes.items()),
        noun=noun_of(_cloud_sensors(members)) or ROLES[Cloud].noun,
        own=is_own(members),
        collection=collection_of(made) if made else "",
        conditions=conditions_of(made) if made else "",
        limits=card_part("limits", made),
        licence=card_part("licence", made),
    )


def _header(tables: Sequence[Table], members: Sequence[Member], names: Sequence[str]) -> dict[str, Any]:
    columns = {column.name for table in tables for column in table.columns}
    tasks = ["image-segmentation"] * ("mask" in columns) + ["depth-estimation"] * ("depth" in columns) + ["robotics"]
    rows = sum(written.rows for table in tables[:1] for written in table.splits.values())
    shown = [{"images": "image", "clouds": "3d", "maps": "geospatial"}[table.name] for table in tables]
    return {
        "license": LICENCE if is_own(members) else "unknown",
        "pretty_name": title_of(members),
        "size_categories": [next(text for text, most in _FIXED["sizes"] if rows < most)],
        "task_categories": tasks,
        "tags": ["synthetic", *_tags(members), "off-road", "semantic-segmentation", *shown],
        "configs": [_configuration(table, default=table is tables[0]) for table in tables],
        "dataset_info": [_info(table, names) for table in tables],
    }


def _configuration(table: Table, *, default: bool) -> dict[str, Any]:
    files = [{"split": split, "path": f"{table.name}/{split}-*"} for split in table.splits]
    return {"config_name": table.name} | ({"default": True} if default else {}) | {"data_files": files}


def _info(table: Table, names: Sequence[str]) -> dict[str, Any]:
    splits = [
        {"name": split, "num_bytes": written.memory_bytes, "num_examples": written.rows}
        for split, written in table.splits.items()
    ]
    return {
        "config_name": table.name,
        "features": [column.card(names) for column in table.columns],
        "splits": splits,
        "download_size": sum(written.file_bytes for written in table.splits.values()),
        "dataset_size": sum(written.memory_bytes for written in table.splits.values()),
    }


# ---------------------------------------------------------------------------------------------------------------------
# croissant.json


def croissant_text(folder: Path, tables: Sequence[Table], members: Sequence[Member], labels: LabelMap) -> str:
    """Return the content of croissant.json for the Parquet files in ``folder``.

    Licence and responsible-AI properties are known only if fieldtruth generated all runs.
    """
    content, units = content_of(members)
    every = " and ".join(units)
    description = f"{content} of a ground robot in natural environments, with the class of every {every}. "
    terms = {term: f"cr:{term}" for term in _FIXED["terms"]}
    values = {
        "context": _FIXED["context"] | terms | _FIXED["context_after_terms"],
        "title": title_of(members),
        "description": f"{description}Written by fieldtruth {fieldtruth.__version__}.",
        "keywords": ["robotics", *_tags(members), "semantic segmentation", "off-road", "synthetic"],
        "distribution": [node for table in tables for node in _files(table, folder)],
        "records": [_classes(labels), *map(_records, tables)],
    }
    own = _responsible(members) if is_own(members) else {}
    document = filled(_FIXED["head"], values) | own | filled(_FIXED["content"], values)
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _responsible(members: Sequence[Member]) -> dict[str, Any]:
    """Return licence, citation and responsible-AI properties of runs that fieldtruth generated."""
    made = [member.run.experiment for member in members if member.run.experiment is not None]
    limits = [" ".join(item.split()) for item in card_part("limits", made).removeprefix("- ").split("\n- ")]
    collection = f"Simulated by fieldtruth: {collection_of(made)}; images and clouds are ray traced."
    biases = [conditions_of(made), *_FIXED["rai"]["dataBiases"]]
    values = _FIXED["rai"] | {"dataCollection": collection, "dataBiases": biases, "dataLimitations": limits}
    own: dict[str, Any] = _FIXED["licence"] | {f"rai:{key}": value for key, value in values.items()}
    return own


def _files(table: Table, folder: Path) -> Iterator[Any]:
    """Nodes of the files of a table, and of their set."""
    for path in (path for written in table.splits.values() for path in written.files):
        size, name = f"{path.stat().st_size} B", path.relative_to(folder).as_posix()
        yield filled(_FIXED["file"], {"name": name, "size": size, "sha256": sha256_of(path)})
    about, pattern = f"The Parquet files of {table.name}, of all splits.", f"{table.name}/*.parquet"
    yield filled(_FIXED["files"], {"name": f"{table.name}-files", "about": about, "pattern": pattern})


def _classes(labels: LabelMap) -> Any:
    """The record set of the classes, whose records are in the metadata."""
    data = [
        {"classes/id": number, "classes/name": name, "classes/rgb": " ".join(map(str, rgb))}
        for number, (name, rgb) in sorted(labels.classes.items())
    ]
    about = f"Id, name and colour of each class of {labels.name}."
    return filled(_FIXED["classes"], {"about": about, "data": data})


def _records(table: Table) -> Any:
    """The record set of a table: a field for its split, and one for each column."""
    keys = [column.name for column in table.columns if column.name in _KEYS]
    split = filled(_FIXED["split"], {"id": f"{table.name}/split", "files": f"{table.name}-files"})
    fields = [split, *(_field(table.name, column) for column in table.columns)]
    values = {"name": table.name, "keys": [{"@id": f"{table.name}/{name}"} for name in keys], "fields": fields}
    return filled(_FIXED["records"], values)


def _field(table: str, column: Column) -> Any:
    values = {
        "id": f"{table}/{column.name}",
        "column": column,
        "type": _FIXED["types"].get(column.dtype, "sc:Integer"),
        "files": f"{table}-files",
    }
    source = filled(_FIXED["source"], values)
    if column.kind == "image":
        source |= {"transform": {"jsonPath": "bytes"}}
    field = filled(_FIXED["field"], values)
    return field | ({"repeated": True} if column.is_list else {}) | {"source": source}

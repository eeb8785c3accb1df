# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The two descriptions of a data set for Hugging Face: its card and its Croissant metadata.

The card, README.md, has a header in YAML that ``datasets`` and the hub read, and text. croissant.json states files with
checksums, record sets and responsible-AI properties; the vocabularies are Croissant 1.0 and Croissant RAI 1.0 of
MLCommons (docs.mlcommons.org/croissant).
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined

import fieldtruth
from fieldtruth.bag.provenance import sha256_of
from fieldtruth.bag.topics import Source
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.core.yaml_io import package_data
from fieldtruth.datasets import ROLES
from fieldtruth.exporters.frames import SPLITS, Member, noun_of
from fieldtruth.ontology import LabelMap
from fieldtruth.report.card import card_part, collection_of, conditions_of

CARD: Final = "README.md"
LICENCE: Final = "cc-by-4.0"
"""Of what fieldtruth generated; the licence of other bags is not known."""

_TEMPLATES: Final = Environment(
    loader=PackageLoader("fieldtruth.exporters", "."),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
_SIZES: Final = {1_000: "n<1K", 10_000: "1K<n<10K", 100_000: "10K<n<100K", 1_000_000: "100K<n<1M"}
_LARGEST: Final = "1M<n<10M"
CROISSANT: Final = "croissant.json"

_PARQUET: Final = "application/x-parquet"
_CC_BY: Final = "https://creativecommons.org/licenses/by/4.0/"
_TYPES: Final = {
    "image": "sc:ImageObject",
    "string": "sc:Text",
    "float32": "sc:Float",
    "float64": "sc:Float",
}
"""Data type by that of the column; all others are integers."""


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
        environments = sorted({m.run.experiment.environment for m in members if m.run.experiment is not None})
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
    return _TEMPLATES.get_template("huggingface.md.jinja").render(
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
        limits=card_part("limits"),
        licence=card_part("licence"),
    )


def _header(tables: Sequence[Table], members: Sequence[Member], names: Sequence[str]) -> dict[str, Any]:
    columns = {column.name for table in tables for column in table.columns}
    tasks = ["image-segmentation"] * ("mask" in columns) + ["depth-estimation"] * ("depth" in columns) + ["robotics"]
    rows = sum(written.rows for table in tables[:1] for written in table.splits.values())
    shown = [{"images": "image", "clouds": "3d"}[table.name] for table in tables]
    return {
        "license": LICENCE if is_own(members) else "unknown",
        "pretty_name": title_of(members),
        "size_categories": [next((text for most, text in _SIZES.items() if rows < most), _LARGEST)],
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
    fixed = package_data("fieldtruth.exporters", "croissant.yaml")
    distribution: list[dict[str, Any]] = []
    for table in tables:
        paths = [path for written in table.splits.values() for path in written.files]
        distribution += [_file_object(path, folder) for path in paths]
        distribution.append(_file_set(table))
    content, units = content_of(members)
    limits = [" ".join(item.split()) for item in card_part("limits").removeprefix("- ").split("\n- ")]
    own = {}
    if is_own(members):
        own = {"license": _CC_BY, "citeAs": fixed["citeAs"]} | _responsible(members, fixed["rai"], limits)
    document = {
        "@context": fixed["context"] | {term: f"cr:{term}" for term in fixed["terms"]} | fixed["context_after_terms"],
        "@type": "sc:Dataset",
        "conformsTo": ["http://mlcommons.org/croissant/1.0", "http://mlcommons.org/croissant/RAI/1.0"],
        "name": title_of(members),
        "description": (
            f"{content} of a ground robot in natural environments, with the class of every "
            f"{' and '.join(units)}. Written by fieldtruth {fieldtruth.__version__}."
        ),
        "version": "1.0.0",
        "keywords": ["robotics", *_tags(members), "semantic segmentation", "off-road", "synthetic"],
        **own,
        "creator": {"@type": "sc:Organization", "name": "fieldtruth"},
        "isLiveDataset": False,
        "distribution": distribution,
        "recordSet": [_classes(labels), *map(_record_set, tables)],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _responsible(members: Sequence[Member], fixed: Mapping[str, Any], limits: Sequence[str]) -> dict[str, Any]:
    """Return the responsible-AI properties of runs that fieldtruth generated."""
    made = [member.run.experiment for member in members if member.run.experiment is not None]
    collection = f"Simulated by fieldtruth: {collection_of(made)}; images and clouds are ray traced."
    biases = [conditions_of(made), *fixed["dataBiases"]]
    values = {**fixed} | {"dataCollection": collection, "dataBiases": biases, "dataLimitations": limits}
    return {f"rai:{key}": value for key, value in values.items()}


def _node(kind: str, identifier: str, **values: Any) -> dict[str, Any]:
    """Return a node of Croissant; its name is the identifier, unless ``name`` is another."""
    return {"@type": f"cr:{kind}", "@id": identifier, "name": identifier} | values


def _file_object(path: Path, folder: Path) -> dict[str, Any]:
    name = path.relative_to(folder).as_posix()
    size, digest = f"{path.stat().st_size} B", sha256_of(path)
    return _node("FileObject", name, contentUrl=name, contentSize=size, encodingFormat=_PARQUET, sha256=digest)


def _file_set(table: Table) -> dict[str, Any]:
    about, files = f"The Parquet files of {table.name}, of all splits.", f"{table.name}/*.parquet"
    return _node("FileSet", f"{table.name}-files", description=about, encodingFormat=_PARQUET, includes=files)


def _classes(labels: LabelMap) -> dict[str, Any]:
    """The record set of the classes, whose records are in the metadata."""
    fields = {"id": "sc:Integer", "name": "sc:Text", "rgb": "sc:Text"}
    return _node(
        "RecordSet",
        "classes",
        description=f"Id, name and colour of each class of {labels.name}.",
        dataType="sc:Enumeration",
        key={"@id": "classes/id"},
        field=[_node("Field", f"classes/{name}", name=name, dataType=kind) for name, kind in fields.items()],
        data=[
            {"classes/id": number, "classes/name": name, "classes/rgb": " ".join(map(str, rgb))}
            for number, (name, rgb) in sorted(labels.classes.items())
        ],
    )


def _record_set(table: Table) -> dict[str, Any]:
    files = {"fileSet": {"@id": f"{table.name}-files"}}
    split = _node(
        "Field",
        f"{table.name}/split",
        name="split",
        description="train, val or test",
        dataType="sc:Text",
        source=files | {"extract": {"fileProperty": "filename"}, "transform": {"regex": f"^({'|'.join(SPLITS)})-.*$"}},
    )
    key_columns = ("run", *(role.key for role in ROLES.values()), "stamp_ns")
    keys = [column.name for column in table.columns if column.name in key_columns]
    fields = [split, *(_field(table.name, column, files) for column in table.columns)]
    return _node("RecordSet", table.name, key=[{"@id": f"{table.name}/{name}"} for name in keys], field=fields)


def _field(table: str, column: Column, files: dict[str, Any]) -> dict[str, Any]:
    source = files | {"extract": {"column": column.name}}
    if column.kind == "image":
        source |= {"transform": {"jsonPath": "bytes"}}
    values = {"name": column.name, "description": column.about, "dataType": _TYPES.get(column.dtype, "sc:Integer")}
    repeated = {"repeated": True} if column.is_list else {}
    return _node("Field", f"{table}/{column.name}", **values, **repeated, source=source)

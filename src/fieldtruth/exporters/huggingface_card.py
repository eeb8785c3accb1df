# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The card of a data set for Hugging Face, README.md: a header in YAML that the library and the hub read, and text."""

from collections.abc import Sequence
from importlib import resources
from string import Template
from typing import TYPE_CHECKING, Any, Final

import yaml

import fieldtruth
from fieldtruth.core.readings import Image
from fieldtruth.exporters.frames import Member
from fieldtruth.ontology import LabelMap
from fieldtruth.report.card import card_part, collection_of, conditions_of

if TYPE_CHECKING:
    from fieldtruth.exporters.parquet import Table

CARD: Final = "README.md"
LICENCE: Final = "cc-by-4.0"
"""Of what fieldtruth generated; the licence of other bags is not known."""

_SIZES: Final = {1_000: "n<1K", 10_000: "1K<n<10K", 100_000: "10K<n<100K", 1_000_000: "100K<n<1M"}
_LARGEST: Final = "1M<n<10M"


def title_of(members: Sequence[Member]) -> str:
    """Name of the data set: its runs, or if there are many the environments."""
    names = [member.name for member in members]
    if len(names) > 3:
        environments = sorted({m.run.experiment.environment for m in members if m.run.experiment is not None})
        names = [f"{len(names)} runs", *environments]
    return f"fieldtruth: {', '.join(names)}"


def is_own(members: Sequence[Member]) -> bool:
    """Whether fieldtruth generated all runs."""
    return all(member.run.experiment is not None for member in members)


def content_of(members: Sequence[Member]) -> str:
    """What the data set has, for its description."""
    views = [view for member in members for view in member.run.of(Image, recorded=False)]
    stereo = not views or any(view.side for view in views)
    return f"{'Stereo photographs' if stereo else 'Photographs'} and LiDAR clouds"


def card_text(tables: Sequence["Table"], members: Sequence[Member], labels: LabelMap, names: Sequence[str]) -> str:
    """Return the card.

    Args:
        tables: the configurations, the default one first.
        members: the runs.
        labels: the classes.
        names: of the classes by id, without gaps.
    """
    header = yaml.safe_dump(_header(tables, members, names), sort_keys=False, allow_unicode=True, width=1000)
    text = resources.files("fieldtruth.exporters").joinpath("huggingface.md").read_text(encoding="utf-8")
    body = Template(text).substitute(
        title=title_of(members),
        content=content_of(members),
        version=fieldtruth.__version__,
        runs=f"{len(members)} run{'s' * (len(members) != 1)}",
        splits=_table(("table", "split", "rows", "MB"), _split_rows(tables)),
        use="\n".join(_use(table.name, next(iter(table.splits))) for table in tables),
        columns="\n\n".join(_columns(table) for table in tables),
        classes=_table(
            ("id", "class", "RGB"), [(k, c.name, " ".join(map(str, c.rgb))) for k, c in sorted(labels.classes.items())]
        ),
        members=_table(("run", "split", "environment", "seed", "time [s]"), map(_member_row, members)),
        origin=_origin(members) if is_own(members) else "Runs that fieldtruth did not generate are among them.",
        limits=f"## Known limits\n\n{card_part('limits')}\n\n" if is_own(members) else "",
        licence=card_part("licence") if is_own(members) else "The licence is that of the recorded bags.",
    )
    return f"---\n{header}---\n\n{body}"


def _origin(members: Sequence[Member]) -> str:
    made = [member.run.experiment for member in members if member.run.experiment is not None]
    return (
        f"All is simulated: {collection_of(made)}. {conditions_of(made)}\n"
        "Labels and measurements are from the same ray, so no label is an estimate."
    )


def _header(tables: Sequence["Table"], members: Sequence[Member], names: Sequence[str]) -> dict[str, Any]:
    columns = {column.name for table in tables for column in table.columns}
    tasks = ["image-segmentation"] * ("mask" in columns) + ["depth-estimation"] * ("depth" in columns) + ["robotics"]
    rows = sum(written.rows for table in tables[:1] for written in table.splits.values())
    kinds = {"images": "image", "clouds": "3d"}
    return {
        "license": LICENCE if is_own(members) else "unknown",
        "pretty_name": title_of(members),
        "size_categories": [next((text for most, text in _SIZES.items() if rows < most), _LARGEST)],
        "task_categories": tasks,
        "tags": ["synthetic", "lidar", "off-road", "semantic-segmentation", *(kinds[table.name] for table in tables)],
        "configs": [_configuration(table, default=table is tables[0]) for table in tables],
        "dataset_info": [_info(table, names) for table in tables],
    }


def _configuration(table: "Table", *, default: bool) -> dict[str, Any]:
    files = [{"split": split, "path": f"{table.name}/{split}-*"} for split in table.splits]
    return {"config_name": table.name} | ({"default": True} if default else {}) | {"data_files": files}


def _info(table: "Table", names: Sequence[str]) -> dict[str, Any]:
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


def _use(name: str, split: str) -> str:
    return f'{name} = load_dataset("FOLDER", "{name}", split="{split}")'


def _split_rows(tables: Sequence["Table"]) -> list[Sequence[object]]:
    return [
        (f"`{table.name}`", split, written.rows, f"{written.file_bytes / 1e6:.1f}")
        for table in tables
        for split, written in table.splits.items()
    ]


def _columns(table: "Table") -> str:
    return f"### {table.name}\n\n" + _table(("column", ""), [(f"`{c.name}`", c.about) for c in table.columns])


def _member_row(member: Member) -> Sequence[object]:
    made_by = member.run.experiment
    known = ("", "") if made_by is None else (made_by.environment, made_by.seed)
    return (member.name, member.split, *known, f"{member.run.duration_s:.1f}")


def _table(head: Sequence[str], rows: Any) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)

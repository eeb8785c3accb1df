# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What tags of OpenStreetMap mean (``osm.yaml``), and the lengths in them."""

import re
from collections.abc import Mapping
from functools import cache
from typing import Any, Literal, NamedTuple

from fieldtruth.core.yaml_io import package_data
from fieldtruth.maps.units import METRES

Shape = Literal["point", "line", "area"]


class Kind(NamedTuple):
    """A row of the table."""

    name: str
    shapes: tuple[Shape, ...]
    tags: dict[str, Any]
    """Values by key, one of which makes an object this kind; "*" is any but "no"."""
    widths: dict[str, float]
    """Width [m] of a line by the value of that tag."""
    width: float | None
    """Width [m] of other lines."""


@cache
def table() -> dict[str, Any]:
    """The mapping in ``osm.yaml``: ``kinds`` as ``Kind``, and by key, each with its place in it, in ``keys``."""
    rows = package_data("fieldtruth.maps", "osm.yaml")
    kinds = [
        Kind(name, tuple(row["shapes"]), row["tags"], row.get("widths", {}), row.get("width"))
        for name, row in rows["kinds"].items()
    ]
    keys: dict[str, list[tuple[int, Kind]]] = {}
    for rank, kind in enumerate(kinds):
        for key in kind.tags:
            keys.setdefault(key, []).append((rank, kind))
    return rows | {"kinds": kinds, "keys": keys}


def kinds() -> tuple[str, ...]:
    """Names of all kinds of features."""
    return tuple(kind.name for kind in table()["kinds"])


def has_tag(tags: Mapping[str, str], key: str, values: Any) -> bool:
    """Whether the first value of a key is one of some values, or any but "no" if they are "*"."""
    value = tags.get(key, "no").split(";")[0].strip()
    return value != "no" and (values == "*" or value in values)


def kind_of(tags: Mapping[str, str], shape: Shape, loop: bool = False) -> tuple[Kind, str] | None:
    """First kind of a shape that one of the tags makes, and its key; ``loop``: of a way that ends where it begins."""
    found = [
        (rank, key, kind)
        for key in tags.keys() & table()["keys"].keys()
        for rank, kind in table()["keys"][key]
        if has_tag(tags, key, kind.tags[key]) and shape in _shapes(kind, loop, tags.get("area") == "yes")
    ]
    if not found:
        return None
    _, key, kind = min(found)
    return kind, key


def _shapes(kind: Kind, loop: bool, area: bool) -> tuple[Shape, ...]:
    if loop and "line" in kind.shapes and "area" in kind.shapes:
        return ("area",) if area else ("line",)
    return kind.shapes


def number(text: str | None) -> float | None:
    """A count in a tag; None for other text."""
    return float(text) if text and re.fullmatch(r"\d{1,3}(\.\d+)?", text) else None


def metres(text: str | None) -> float | None:
    """Length [m] in a tag: metres, with a unit, or feet and inches as in 16'3"; None for other text, and for 0."""
    if feet := re.fullmatch(r"(\d{1,4})' ?(\d{1,2})\"", text or ""):
        return (int(feet[1]) * 12 + int(feet[2])) * 0.0254 or None
    found = re.fullmatch(r"(\d{1,5}(?:[.,]\d+)?) ?(m|cm|mm|km|ft|'|in|\")?", (text or "").strip())
    return float(found[1].replace(",", ".")) * METRES[found[2] or "m"] or None if found else None

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The class shares of a run as an Excel workbook: a table, the bar chart of the paper's Figure 21, and an explanation.

All dates in the file are fixed, so that the same counts give the same bytes.
"""

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import xlsxwriter

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import CLASSES, NOT_OF_WORLDS, ClassTable
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.core.yaml_io import package_data
from fieldtruth.datasets.items import ROLES
from fieldtruth.ontology import LabelMap
from fieldtruth.report.drawing.style import HAIRLINE, PIXELS, POINTS

SHARES: Final = "class shares"
FIGURE: Final = "figure 21"
EXPLANATION: Final = "explanation"
_CREATED: Final = datetime(1980, 1, 1)
_FIRST_ROW: Final = 2
"""First row of classes, below two rows of headings."""
_WIDTHS: Final = (6, 24, 10)
"""Widths [characters] of the columns id, class and colour."""


class _Class(NamedTuple):
    number: int
    name: str
    rgb: tuple[int, int, int] | None


class _Column(NamedTuple):
    """Counts by class id under a heading."""

    what: str
    """pixels or points."""
    title: str
    counts: Counts

    @property
    def shares(self) -> Array:
        """Share of each class in the total; 0 if nothing was counted."""
        share: Array = self.counts / max(int(self.counts.sum()), 1)
        return share


def write_sheet(
    path: Path,
    name: str,
    pixels: Mapping[str, Counts],
    points: Mapping[str, Counts],
    label_map: LabelMap | None = None,
    *,
    by_intensity: bool = True,
    noun: str = ROLES[Cloud].noun,
    classes: ClassTable = CLASSES,
) -> None:
    """Write the workbook of a run.

    Args:
        path: the .xlsx file.
        name: of the run.
        pixels: (classes,) by class id, of each view by name (``left``, ``right``).
        points: (classes,) by class id, of each sensor of clouds by name.
        label_map: adds a table in the classes of this ontology.
        by_intensity: whether the class of a point is its intensity, as in the paper.
        noun: what a sensor of clouds is called.
        classes: of the run.
    """
    viewer = ROLES[Image].noun
    columns = [*_columns("pixels", viewer, pixels), *_columns("points", noun, points)]
    usual = [row.label for row in classes.coloured if row.label not in NOT_OF_WORLDS]
    rows = [_Class(*row) for row in classes if row.label in usual or _occurs(row.label, columns)]
    with xlsxwriter.Workbook(str(path), {"in_memory": True}) as book:
        book.set_properties({"title": f"{name}: share of each class in pixels and points", "created": _CREATED})
        _write_table(book, SHARES, rows, columns)
        _write_figure(book, [row for row in rows if _occurs(row.number, columns)], columns)
        if label_map is not None:
            named = [(int(number), label_map.classes[int(number)]) for number in np.unique(label_map.ids)]
            others = [_Class(number, other.name, other.rgb) for number, other in named]
            mapped = [column._replace(counts=_mapped(column.counts, label_map)) for column in columns]
            _write_table(book, f"{label_map.name} classes", others, mapped)
        sensors = _sensors(viewer, len(pixels), "pixels"), _sensors(noun, len(points), "points")
        first = f"Share of each class in {' and '.join(filter(None, sensors))} of {name}."
        point = "reflectivity" if by_intensity else "label"
        _write_explanation(book, [first, *_explanation(columns, point)], label_map)


def _columns(what: str, sensor: str, counts: Mapping[str, Counts]) -> Iterator[_Column]:
    """A column per sensor, and their sum last; the points of a single one need no name."""
    if what == "points" and len(counts) == 1:
        yield _Column(what, what, *counts.values())
        return
    for name, own in counts.items():
        yield _Column(what, f"{what}, {name} {sensor}", own)
    if len(counts) > 1:
        total: Counts = np.sum([*counts.values()], axis=0)
        yield _Column(what, f"{what}, {'both' if len(counts) == 2 else 'all'} {sensor}s", total)


def _occurs(number: int, columns: Sequence[_Column]) -> bool:
    return any(column.counts[number] for column in columns)


def _mapped(counts: Counts, label_map: LabelMap) -> Counts:
    found = np.zeros(256, np.int64)
    np.add.at(found, label_map.ids, counts)
    return found


def _write_table(book: Any, title: str, rows: Sequence[_Class], columns: Sequence[_Column]) -> None:
    sheet = _add_sheet(book, title)
    bold, right, middle = (book.add_format({"bold": True, "align": align}) for align in ("left", "right", "center"))
    number = book.add_format({"align": "left"})
    total, count = book.add_format({"bold": True, "top": 1, "num_format": "#,##0"}), _number(book, "#,##0")
    share, whole = _number(book, "0.0000%"), book.add_format({"bold": True, "top": 1, "num_format": "0.0000%"})
    for k, (heading, width) in enumerate(zip(("id", "class", "colour"), _WIDTHS, strict=True)):
        sheet.set_column(k, k, width)
        sheet.write_string(1, k, heading, bold)
    for at, row in enumerate(rows, start=_FIRST_ROW):
        sheet.write_number(at, 0, row.number, number)
        sheet.write_string(at, 1, row.name)
        sheet.write_blank(at, 2, None, book.add_format({"bg_color": _hex(row.rgb), "border": 1}))
    end = _FIRST_ROW + len(rows)
    for k in range(3):
        sheet.write_string(end, k, "all" if k == 1 else "", total)
    for k, column in enumerate(columns):
        left = 3 + 2 * k
        sheet.set_column(left, left + 1, 17)
        sheet.merge_range(0, left, 0, left + 1, column.title, middle)
        sheet.write_string(1, left, "count", right)
        sheet.write_string(1, left + 1, "share", right)
        for at, row in enumerate(rows, start=_FIRST_ROW):
            sheet.write_number(at, left, int(column.counts[row.number]), count)
            sheet.write_number(at, left + 1, float(column.shares[row.number]), share)
        sheet.write_number(end, left, int(column.counts.sum()), total)
        sheet.write_number(end, left + 1, float(column.shares.sum()), whole)
    sheet.freeze_panes(_FIRST_ROW, 3)


def _write_figure(book: Any, rows: Sequence[_Class], columns: Sequence[_Column]) -> None:
    """Shares per unit, as in the paper: classes that occur, in the pixels of all cameras and in all points."""
    sheet = _add_sheet(book, FIGURE)
    bold, right = (book.add_format({"bold": True, "align": align}) for align in ("left", "right"))
    share = _number(book, "0.000000")
    sums = {column.what: column for column in columns}  # the last of each kind
    colours = {"pixels": PIXELS, "points": POINTS}
    bars = [(what, colour, sums[what]) for what, colour in colours.items() if what in sums]
    sheet.set_column(0, 0, _WIDTHS[1])
    sheet.set_column(1, 2, 12)
    sheet.write_string(0, 0, "class", bold)
    for at, row in enumerate(rows, start=1):
        sheet.write_string(at, 0, row.name)
    chart = book.add_chart({"type": "column"})
    for k, (title, colour, column) in enumerate(bars, start=1):
        sheet.write_string(0, k, title, right)
        for at, row in enumerate(rows, start=1):
            sheet.write_number(at, k, float(column.shares[row.number]), share)
        chart.add_series(
            {
                "name": [FIGURE, 0, k],
                "categories": [FIGURE, 1, 0, len(rows), 0],
                "values": [FIGURE, 1, k, len(rows), k],
                "fill": {"color": colour},
                "gap": 60,
                "overlap": 0,
            }
        )
    chart.set_title({"name": "Share of each class in pixels and points", "name_font": {"size": 13}})
    lines = {"visible": True, "line": {"color": HAIRLINE}}
    chart.set_y_axis({"name": "per unit", "num_format": "0.00", "min": 0, "major_gridlines": lines})
    chart.set_legend({"position": "top"})
    chart.set_size({"width": 900, "height": 460})
    sheet.insert_chart(0, 4, chart)


def _sensors(what: str, count: int, units: str) -> str:
    return f"all {units} of the {what}{'s' * (count > 1)}" if count else ""


def _explanation(columns: Sequence[_Column], point: str) -> list[str]:
    counts = "; ".join(f"{column.title}: {int(column.counts.sum()):,}" for column in columns)
    words = {"counts": counts, "shares": SHARES, "figure": FIGURE, "point": point}
    return [text.format(**words) for text in package_data("fieldtruth.exporters", "files_sheet.yaml")["explanation"]]


def _write_explanation(book: Any, lines: list[str], label_map: LabelMap | None) -> None:
    sheet = _add_sheet(book, EXPLANATION)
    sheet.set_column(0, 0, 110, book.add_format({"text_wrap": True, "valign": "top"}))
    if label_map is not None:
        lines.insert(4, f"Sheet '{label_map.name} classes': the same counts by the classes of {label_map.name}.")
    for at, text in enumerate(lines):
        sheet.write_string(at, 0, text)


def _add_sheet(book: Any, title: str) -> Any:
    """Add a sheet that prints on one landscape page."""
    sheet = book.add_worksheet(title)
    sheet.set_landscape()
    sheet.set_paper(9)  # A4
    sheet.fit_to_pages(1, 1)
    return sheet


def _number(book: Any, number_format: str) -> Any:
    return book.add_format({"num_format": number_format})


def _hex(rgb: tuple[int, int, int] | None) -> str:
    return "#{:02X}{:02X}{:02X}".format(*(rgb or (0, 0, 0)))

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The workbook of class shares read by openpyxl, against counts of the messages in the bag."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_bags import without
from openpyxl import load_workbook
from rosbags.highlevel import AnyReader

from fieldtruth.core.classes import CLASSES
from fieldtruth.exporters import export
from fieldtruth.exporters.files_sheet import write_sheet
from fieldtruth.ontology import LabelMap, OntologyClass

TAGS = {side: f"/stereo/camera/{side}/tag/img_raw" for side in ("left", "right")}
POINTS = "/os1_cloud_node/points"
CLASS_OF_COLOUR = {row.rgb: int(row.label) for row in CLASSES if row.rgb is not None}
COLUMNS = ("pixels, left camera", "pixels, right camera", "pixels, both cameras", "points")
SHEETS = ["class shares", "figure 21", "explanation"]

Table = dict[str, dict[int, tuple[int, float]]]
"""Count and share, by heading and class id."""


def table_of(sheet: Any) -> Table:
    found: Table = {}
    for column in range(4, sheet.max_column, 2):
        rows = range(3, sheet.max_row)
        found[sheet.cell(1, column).value] = {
            sheet.cell(row, 1).value: (sheet.cell(row, column).value, sheet.cell(row, column + 1).value) for row in rows
        }
        assert [sheet.cell(2, k).value for k in (column, column + 1)] == ["count", "share"]
    return found


def counts_of(bag: Path) -> dict[str, dict[int, int]]:
    """Counts by class id of the colours and intensities in the messages."""
    found: dict[str, dict[int, int]] = {heading: {} for heading in COLUMNS}

    def add(heading: str, values: Any, numbers: Any) -> None:
        for value, number in zip(values, numbers, strict=True):
            found[heading][value] = found[heading].get(value, 0) + int(number)

    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages(
            [c for c in reader.connections if c.topic in {*TAGS.values(), POINTS}]
        ):
            message: Any = reader.deserialize(raw, connection.msgtype)
            if connection.topic == POINTS:
                at = next(field.offset for field in message.fields if field.name == "intensity")
                bytes_of = message.data.reshape(-1, message.point_step)[:, at : at + 4]
                values, numbers = np.unique(np.ascontiguousarray(bytes_of).view("<f4"), return_counts=True)
                add("points", values.astype(int).tolist(), numbers)
                continue
            codes = message.data.reshape(-1, 3).astype(np.int64) @ [65536, 256, 1]
            colours, numbers = np.unique(codes, return_counts=True)
            classes = [CLASS_OF_COLOUR[code >> 16, code >> 8 & 255, code & 255] for code in colours.tolist()]
            side = next(side for side, topic in TAGS.items() if topic == connection.topic)
            add(f"pixels, {side} camera", classes, numbers)
            add("pixels, both cameras", classes, numbers)
    return found


@pytest.fixture(scope="module")
def book(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    made = export(small_run, "files", out=tmp_path_factory.mktemp("sheet") / "park_1")
    return load_workbook(made / "data_proportion.xlsx")


def test_counts_are_exact_and_shares_are_counts_over_their_sum(book: Any, small_run: Path) -> None:
    found, expected = table_of(book["class shares"]), counts_of(small_run / "park_1.bag")
    assert tuple(found) == COLUMNS
    for heading, rows in found.items():
        assert list(rows) == list(range(1, 16))
        assert {number: count for number, (count, _) in rows.items() if count} == expected[heading]
        total = sum(expected[heading].values())
        assert [share for _, share in rows.values()] == pytest.approx([n / total for n, _ in rows.values()], rel=1e-15)
        assert sum(share for _, share in rows.values()) == pytest.approx(1.0, abs=1e-12)
    assert sum(expected["pixels, left camera"].values()) == 30 * 160 * 92


def test_last_row_is_the_total(book: Any) -> None:
    sheet = book["class shares"]
    assert sheet.cell(sheet.max_row, 2).value == "all"
    for column, rows in zip(range(4, sheet.max_column, 2), table_of(sheet).values(), strict=True):
        assert sheet.cell(sheet.max_row, column).value == sum(count for count, _ in rows.values())
        assert sheet.cell(sheet.max_row, column + 1).value == pytest.approx(1.0, abs=1e-12)


def test_classes_have_names_and_colours(book: Any) -> None:
    sheet = book["class shares"]
    for row, expected in enumerate(CLASSES[1:16], start=3):
        assert sheet.cell(row, 2).value == expected.name
        assert sheet.cell(row, 3).fill.start_color.rgb == "FF{:02X}{:02X}{:02X}".format(*(expected.rgb or ()))


def test_chart_shows_classes_that_occur(book: Any) -> None:
    sheet = book["figure 21"]
    table = table_of(book["class shares"])
    rows = list(sheet.iter_rows(min_row=2, max_col=3, values_only=True))
    pixels, points = table["pixels, both cameras"], table["points"]
    expected = [
        (c.name, pixels[c.label][1], points[c.label][1])
        for c in CLASSES[1:16]
        if pixels[c.label][0] or points[c.label][0]
    ]
    assert rows == expected
    assert 5 < len(rows) < 15
    (chart,) = sheet._charts
    assert chart.tagname == "barChart"
    assert [series.tx.strRef.f for series in chart.series] == ["'figure 21'!$B$1", "'figure 21'!$C$1"]
    assert [sheet[cell].value for cell in ("B1", "C1")] == ["pixels", "points"]
    for series, column in zip(chart.series, "BC", strict=True):
        assert series.cat.strRef.f == f"'figure 21'!$A$2:$A${len(rows) + 1}"
        assert series.val.numRef.f == f"'figure 21'!${column}$2:${column}${len(rows) + 1}"
    blue, red = (series.spPr.solidFill.srgbClr for series in chart.series)
    assert (int(blue, 16) & 255, int(red, 16) >> 16) == (0xDE, 0xDC)
    assert (blue, red) == ("2F6FDE", "DC3F36")


def test_explanation_states_run_and_counts(book: Any) -> None:
    assert book.sheetnames == SHEETS
    text = " ".join(row[0] for row in book["explanation"].iter_rows(values_only=True))
    assert "park_1" in text
    points = table_of(book["class shares"])["points"].values()
    assert f"points: {sum(count for count, _ in points):,}" in text


def test_run_without_cameras_has_only_points(small_run: Path, tmp_path: Path) -> None:
    bag = without(small_run / "park_1.bag", tmp_path / "b.bag", *TAGS.values())
    found = load_workbook(export(bag, "files") / "data_proportion.xlsx")
    assert tuple(table_of(found["class shares"])) == ("points",)
    (chart,) = found["figure 21"]._charts
    assert [series.spPr.solidFill.srgbClr for series in chart.series] == ["DC3F36"]


def counts_like(**numbers: dict[int, int]) -> dict[str, Any]:
    """Counts (classes,) from the nonzero ones."""
    return {key: np.array([rows.get(k, 0) for k in range(len(CLASSES))], np.int64) for key, rows in numbers.items()}


def test_label_map_adds_a_sheet(tmp_path: Path) -> None:
    ids = np.full(len(CLASSES), 7, np.uint8)
    ids[[2, 3]], ids[0] = 40, 0
    classes = {0: ("void", (0, 0, 0)), 7: ("rest", (1, 2, 3)), 9: ("never", (9, 9, 9)), 40: ("tree", (250, 0, 16))}
    other = LabelMap("test", ids, {number: OntologyClass(*row) for number, row in classes.items()})
    pixels, points = counts_like(left={1: 5, 2: 10, 3: 25}), counts_like(lidar={3: 4, 15: 12})
    write_sheet(tmp_path / "s.xlsx", "run", pixels, points, other)
    found = load_workbook(tmp_path / "s.xlsx")
    assert found.sheetnames == ["class shares", "figure 21", "test classes", "explanation"]
    assert table_of(found["test classes"]) == {
        "pixels, left camera": {0: (0, 0.0), 7: (5, 0.125), 40: (35, 0.875)},
        "points": {0: (0, 0.0), 7: (12, 0.75), 40: (4, 0.25)},
    }
    sheet = found["test classes"]
    assert [sheet.cell(row, 2).value for row in (3, 4, 5)] == ["void", "rest", "tree"]
    assert sheet.cell(5, 3).fill.start_color.rgb == "FFFA0010"


def test_large_counts_are_exact(tmp_path: Path) -> None:
    pixels = counts_like(left={1: 9_007_199_254_740_991}, right={1: 1, 15: 14_254_617_600})
    write_sheet(tmp_path / "s.xlsx", "run", pixels, counts_like(lidar={1: 1}))
    found = table_of(load_workbook(tmp_path / "s.xlsx")["class shares"])
    assert found["pixels, left camera"][1] == (9_007_199_254_740_991, 1.0)
    assert found["pixels, right camera"][15][0] == 14_254_617_600


def test_void_points_have_a_row(tmp_path: Path) -> None:
    write_sheet(tmp_path / "s.xlsx", "run", {}, counts_like(lidar={0: 3, 1: 1}))
    found = table_of(load_workbook(tmp_path / "s.xlsx")["class shares"])["points"]
    assert (found[0], found[1]) == ((3, 0.75), (1, 0.25))


def test_bytes_do_not_depend_on_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = counts_like(left={1: 5, 2: 10}), counts_like(lidar={3: 4})
    write_sheet(tmp_path / "a.xlsx", "run", *counts)
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    monkeypatch.setattr("time.time", lambda: 2_000_000_000.0)
    write_sheet(tmp_path / "b.xlsx", "run", *counts)
    assert (tmp_path / "a.xlsx").read_bytes() == (tmp_path / "b.xlsx").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.xlsx") as archive:
        assert {info.date_time for info in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert b"1980-01-01T00:00:00Z" in archive.read("docProps/core.xml")

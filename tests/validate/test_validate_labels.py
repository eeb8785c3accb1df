# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A changed label, object or place of a single point is found, though checksums and index fit."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from validate_bags import Edit, each, failures, first_message, only, points_in, quick_failures, rewritten

from fieldtruth.bag import topics as table
from fieldtruth.bag.sensor_messages import POINT, SWEPT_POINT
from fieldtruth.core.classes import Label
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.pipeline import generate
from fieldtruth.validation import Check

Validate = Callable[..., list[Check]]
Points = NDArray[np.void]


def setting(row: int, **values: float) -> Edit:
    """Set fields of one point."""

    def edit(data: bytearray) -> None:
        for name, value in values.items():
            points_in(data)[name][row] = value

    return edit


@pytest.fixture(scope="module")
def cloud(lean_run: Path) -> Points:
    """Points of the first cloud."""
    return points_in(bytearray(first_message(lean_run, table.POINTS).data)).copy()


def other(label: int) -> int:
    """A class that the ground and a tree have neither."""
    return Label.BENCH if label != Label.BENCH else Label.TABLE


def test_the_points_are_found_in_the_message(cloud: Points) -> None:
    """The guard of all tests here: the view on the bytes holds what a reader would find."""
    assert set(np.unique(cloud["label"])) <= set(range(1, 14))
    assert (cloud["label"] == cloud["intensity"]).all()
    assert cloud["ring"].max() == 63


@pytest.mark.parametrize(
    ("row", "fields"), [(0, ("label",)), (9999, ("intensity",)), (5555, ("label", "intensity")), (-1, ("label",))]
)
def test_one_label_of_one_point_is_found(
    lean_run: Path, tmp_path: Path, cloud: Points, row: int, fields: tuple[str, ...]
) -> None:
    """In the label alone, in the intensity alone, or in both, where the class is none of the object's."""
    edit = setting(row, **{name: other(int(cloud["label"][row])) for name in fields})
    texts = quick_failures(rewritten(lean_run, tmp_path, only(table.POINTS, 0, edit)))
    where = f"100000000 ns, row {row % len(cloud)}"
    assert ("labels" in texts) == (len(fields) == 1)
    assert ("objects" in texts) == ("label" in fields)
    assert all(where in text for text in texts.values())


def test_classes_that_return_no_pulse_or_are_none_are_found(lean_run: Path, tmp_path: Path) -> None:
    """Void, water, sky, the first number beyond the table, and one that is none of a byte's."""
    wrong = [setting(7, label=label, intensity=label) for label in (0, 14, 15, 16, 300)]
    change = each({(table.POINTS, k): edit for k, edit in enumerate(wrong)})
    text = quick_failures(rewritten(lean_run, tmp_path, change))["labels"]
    assert text.startswith("classes are known and return a pulse: 5 of")
    assert "row 7: class 0" in text


def test_what_no_beam_can_have_measured_is_found(lean_run: Path, tmp_path: Path) -> None:
    def twice(data: bytearray) -> None:
        for name in ("ring", "column"):
            points_in(data)[name][500] = points_in(data)[name][499]

    def shifted(data: bytearray) -> None:
        points_in(data)["z"][500] += 1e-3

    def too_far(data: bytearray) -> None:
        points = points_in(data)
        reach = np.sqrt(sum(float(points[axis][500]) ** 2 for axis in "xyz"))
        for axis in "xyz":
            points[axis][500] *= 121 / reach

    wrong: list[tuple[str, Edit]] = [  # a law that a later one breaks as well stands before it
        ("on the rays of", shifted),
        ("none twice", twice),
        ("ring and column are", setting(500, ring=64)),
        ("ranges are", too_far),
    ]
    folder = rewritten(lean_run, tmp_path, each({(table.POINTS, k): edit for k, (_, edit) in enumerate(wrong)}))
    texts = quick_failures(folder)["beams"].split("; ")
    for k, (law, _) in enumerate(wrong):
        told = next(text for text in texts if law in text)
        assert f"first {table.POINTS} at {k + 1}00000000 ns, row 500" in told


def test_a_wrong_time_of_a_point_of_a_spinning_lidar_is_found(tmp_path: Path) -> None:
    values = load_experiment("park_1").model_dump()
    values["seconds"] = 0.15
    values["rig"]["cameras"]["enabled"], values["rig"]["lidar"]["spinning"] = False, True
    run = generate(Experiment.model_validate(values), tmp_path).parent

    def late(data: bytearray) -> None:
        points_in(data, SWEPT_POINT)["t"][500] += 1

    assert "beams" not in quick_failures(run)
    text = quick_failures(rewritten(run, tmp_path / "late", only(table.POINTS, 0, late)))["beams"]
    assert "t is the time at which the column's rays leave: 1 of" in text
    assert f"first {table.POINTS} at 100000000 ns, row 500" in text


def test_points_that_are_nowhere_are_found(lean_run: Path, tmp_path: Path) -> None:
    edits: dict[tuple[str, int], Edit] = {
        (table.POINTS, 0): setting(5, x=np.nan),
        (table.POINTS, 3): setting(6, y=np.inf),
    }
    texts = quick_failures(rewritten(lean_run, tmp_path, each(edits)))
    assert "points are finite: 2 of" in texts["labels"]


def swapped(data: bytearray, one: int, another: int) -> None:
    """Give a point of one class, if the cloud has any, another that its object can have as well."""
    points = points_in(data)
    row = np.flatnonzero(points["label"] == one)[0]
    points["label"][row] = points["intensity"][row] = another


def nearer(data: bytearray) -> None:
    """Move a point by 2 mm along its ray."""
    points = points_in(data)
    row = len(points) // 2
    reach = np.sqrt(sum(float(points[axis][row]) ** 2 for axis in "xyz"))
    for axis in "xyz":
        points[axis][row] *= 1.0 - 2e-3 / reach


def another_tree(data: bytearray) -> None:
    """Give a leaf to another tree."""
    points = points_in(data)
    row = np.flatnonzero(points["label"] == Label.TREETOP)[3]
    points["instance"][row] = next(
        thing for thing in points["instance"][points["label"] == Label.TREETOP] if thing != points["instance"][row]
    )


def vanish(data: bytearray) -> None:
    """Take a point out of the middle of a cloud."""
    points = points_in(data)
    start, row = len(data) - 1 - points.nbytes, 1234
    del points
    del data[start + row * POINT.itemsize : start + (row + 1) * POINT.itemsize]
    at = bytes(data).index(b"os1_lidar") + len(b"os1_lidar") + 4  # behind height: width
    struct.pack_into("<L", data, at, struct.unpack_from("<L", data, at)[0] - 1)
    for offset in (start - 4, start - 8):  # length of the data, row_step
        struct.pack_into("<L", data, offset, struct.unpack_from("<L", data, offset)[0] - POINT.itemsize)


def test_what_only_the_world_can_tell_is_found_by_the_retrace(
    lean_run: Path, tmp_path: Path, with_world: Validate
) -> None:
    """One ray in each of the five clouds. Nothing else is wrong with any of them."""
    edits: list[Edit] = [
        lambda data: swapped(data, Label.TREETOP, Label.TRUNK),
        lambda data: swapped(data, Label.GROUND, Label.TRAIL),
        nearer,
        another_tree,
        vanish,
    ]
    folder = rewritten(lean_run, tmp_path, each({(table.POINTS, k): edit for k, edit in enumerate(edits)}))
    assert quick_failures(folder) == {}
    texts = failures(with_world(folder, samples=1))
    assert list(texts) == ["retraced clouds"]
    assert f"5 of {5 * 512 * 64:,} break this" in texts["retraced clouds"]
    assert "class 2 of object" in texts["retraced clouds"]
    assert "but there is treetop" in texts["retraced clouds"]


def test_a_single_digit_is_found_where_all_other_clouds_are_equal(
    small_run: Path, tmp_path: Path, with_world: Validate
) -> None:
    """Half a micrometre along the ray: far below what another processor may do, but eleven clouds are equal."""

    def next_number(data: bytearray) -> None:
        points = points_in(data)
        for axis in "xyz":
            points[axis][77] = np.nextafter(points[axis][77], np.float32(0))

    texts = failures(with_world(rewritten(small_run, tmp_path, only(table.POINTS, 6, next_number)), samples=1))
    assert list(texts) == ["retraced clouds"]
    assert (
        f"equal to the last digit: 1 of 12 breaks this, first {table.POINTS} at 700000000 ns"
        in texts["retraced clouds"]
    )

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A changed label, instance id or coordinate of a single point is found, though checksums and index fit."""

import struct
from pathlib import Path

import numpy as np
import pytest
from changed_bags import POINTS, Edit, Edits, edited, failures, failures_of, first_message, points_in, rewritten
from numpy.typing import NDArray

from fieldtruth.core.classes import Label
from fieldtruth.validation.runner import validate

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
    return points_in(bytearray(first_message(lean_run, POINTS).data)).copy()


def other(label: int) -> int:
    """A class that neither the ground nor a tree has."""
    return Label.BENCH if label != Label.BENCH else Label.TABLE


def test_points_are_found_in_the_message(cloud: Points) -> None:
    """Guard of all tests here: the view on the bytes has the values that a reader finds."""
    assert set(np.unique(cloud["label"])) <= set(range(1, 14))
    assert (cloud["label"] == cloud["intensity"]).all()
    assert cloud["ring"].max() == 63


@pytest.mark.parametrize(
    ("row", "fields"), [(0, ("label",)), (9999, ("intensity",)), (5555, ("label", "intensity")), (-1, ("label",))]
)
def test_label_of_one_point_is_found(
    lean_run: Path, tmp_path: Path, cloud: Points, row: int, fields: tuple[str, ...]
) -> None:
    """In the label alone, in the intensity alone, or in both, where the object does not have the class."""
    edit = setting(row, **{name: other(int(cloud["label"][row])) for name in fields})
    texts = failures_of(lean_run, tmp_path, {(POINTS, 0): edit})
    expected = ["labels"] * (len(fields) == 1) + ["object classes"] * ("label" in fields)
    assert list(texts) == expected
    assert all(f"100000000 ns, row {row % len(cloud)}" in text for text in texts.values())


@pytest.fixture(scope="module")
def impossible(lean_run: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Failed checks of five clouds with values that no LiDAR measures."""

    def twice(data: bytearray) -> None:
        for name in ("ring", "column"):
            points_in(data)[name][500] = points_in(data)[name][499]

    def shifted(data: bytearray) -> None:
        points_in(data)["z"][500] += 1e-3

    def too_far(data: bytearray) -> None:
        points = points_in(data)
        range_m = np.sqrt(sum(float(points[axis][500]) ** 2 for axis in "xyz"))
        for axis in "xyz":
            points[axis][500] *= 121 / range_m

    def classes(label: int, edit: Edit) -> Edit:
        return lambda data: [edit(data), setting(7, label=label, intensity=label)(data)]

    # A rule that a later edit breaks as well comes first, as only the first mismatch is described.
    edits = [shifted, twice, setting(500, ring=64), setting(500, x=np.nan), too_far]
    labels = [0, 14, 15, 18, 300]  # void, water, sky, and two that do not exist
    pairs = enumerate(zip(labels, edits, strict=True))
    changes: Edits = {(POINTS, k): classes(label, edit) for k, (label, edit) in pairs}
    return failures_of(lean_run, tmp_path_factory.mktemp("impossible"), changes)


def test_classes_that_return_no_pulse_or_do_not_exist_are_found(impossible: dict[str, str]) -> None:
    finite, classes = impossible["labels"].split("; ")
    assert classes.startswith("classes exist and return a pulse: 5 of")
    assert "row 7: class 0" in classes
    assert finite.startswith("points are finite: 1 of")
    assert "400000000 ns, row 500" in finite


@pytest.mark.parametrize(
    ("rule", "cloud_number"),
    [("on the rays of", 1), ("without repetition", 2), ("ring and column exist", 3), ("ranges are", 4)],
)
def test_points_that_no_ray_measures_are_found(impossible: dict[str, str], rule: str, cloud_number: int) -> None:
    text = next(text for text in impossible["rays"].split("; ") if rule in text)
    assert f"first {POINTS} at {cloud_number}00000000 ns, row 500" in text
    assert rule != "ranges are" or ": 2 of" in text  # NaN, and too far


@pytest.mark.parametrize("label", [Label.ROBOT, Label.PARTICLE])
def test_robot_and_particles_are_found_in_a_run_that_has_none(label: Label, lean_run: Path, tmp_path: Path) -> None:
    edit = setting(7, label=int(label), intensity=int(label), instance=0)
    assert list(failures_of(lean_run, tmp_path, {(POINTS, 0): edit})) == ["object classes"]


def swapped(one: int, another: int) -> Edit:
    """Change the first point of one class to another that its object can have as well."""

    def edit(data: bytearray) -> None:
        points = points_in(data)
        row = np.flatnonzero(points["label"] == one)[0]
        points["label"][row] = points["intensity"][row] = another

    return edit


def nearer(data: bytearray) -> None:
    """Move a point by 2 mm along its ray."""
    points = points_in(data)
    row = len(points) // 2
    range_m = np.sqrt(sum(float(points[axis][row]) ** 2 for axis in "xyz"))
    for axis in "xyz":
        points[axis][row] *= 1.0 - 2e-3 / range_m


def another_tree(data: bytearray) -> None:
    """Assign a leaf to another tree."""
    points = points_in(data)
    leaves = np.flatnonzero(points["label"] == Label.TREETOP)
    own = points["instance"][leaves[3]]
    points["instance"][leaves[3]] = next(number for number in points["instance"][leaves] if number != own)


def vanish(data: bytearray) -> None:
    """Remove a point from the middle of a cloud."""
    points = points_in(data)
    size, start, row = points.dtype.itemsize, len(data) - 1 - points.nbytes, 1234
    del points
    del data[start + row * size : start + (row + 1) * size]
    at = bytes(data).index(b"os1_lidar") + len(b"os1_lidar") + 4  # behind height: width
    struct.pack_into("<L", data, at, struct.unpack_from("<L", data, at)[0] - 1)
    for offset in (start - 4, start - 8):  # length of the data, row_step
        struct.pack_into("<L", data, offset, struct.unpack_from("<L", data, offset)[0] - size)


@pytest.mark.usefixtures("in_park")
def test_points_that_only_the_world_contradicts_are_found_by_retracing(lean_run: Path, tmp_path: Path) -> None:
    """One ray in each of the five clouds, that no other check detects."""
    edits = [swapped(Label.TREETOP, Label.TRUNK), swapped(Label.GROUND, Label.TRAIL), nearer, another_tree, vanish]
    folder = rewritten(lean_run, tmp_path, edited({(POINTS, k): edit for k, edit in enumerate(edits)}))
    assert failures(validate(folder, quick=True)) == {}
    texts = failures(validate(folder, samples=1))
    assert list(texts) == ["retraced clouds"]
    assert f"5 of {5 * 512 * 64:,} mismatch" in texts["retraced clouds"]
    assert "class 2 of object" in texts["retraced clouds"]
    assert "but there is treetop" in texts["retraced clouds"]


@pytest.mark.usefixtures("in_park")
def test_one_last_digit_is_found_where_all_other_clouds_are_equal(small_run: Path, tmp_path: Path) -> None:
    """Half a micrometre along the ray: another processor may differ by more, but eleven clouds are equal."""

    def next_number(data: bytearray) -> None:
        points = points_in(data)
        for axis in "xyz":
            points[axis][77] = np.nextafter(points[axis][77], np.float32(0))

    folder = rewritten(small_run, tmp_path, edited({(POINTS, 6): next_number}))
    texts = failures(validate(folder, samples=1))
    assert list(texts) == ["retraced clouds"]
    expected = f"equal to the last digit: 1 of 12 mismatch, first {POINTS} at 700000000 ns"
    assert expected in texts["retraced clouds"]

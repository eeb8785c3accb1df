# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A changed stamp, a message too few and one too many are found, though checksums and index fit."""

import struct
from pathlib import Path

import pytest
from validate_bags import Change, each, quick_failures, rewritten

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage

WAYS = [(True, False), (False, True), (True, True)]  # in the header, in the bag
STAMPED = [(table.POINTS, *way) for way in WAYS] + [(table.photograph("right"), *WAYS[2])]


def moved(topic: str, number: int, by_ns: int, *, header: bool, bag: bool) -> Change:
    """Move the stamp of one message, in its header, in the bag, or in both."""

    def change(raw: RawMessage, k: int) -> RawMessage:
        if raw.topic != topic or k != number:
            return raw
        data = bytearray(raw.data)
        if header:
            struct.pack_into("<LL", data, 4, *divmod(raw.stamp_ns + by_ns, 10**9))
        return raw._replace(data=bytes(data), stamp_ns=raw.stamp_ns + by_ns * bag)

    return change


@pytest.mark.parametrize(("topic", "header", "bag"), STAMPED)
def test_a_stamp_that_is_one_nanosecond_off_is_found(
    lean_run: Path, tmp_path: Path, topic: str, header: bool, bag: bool
) -> None:
    found = quick_failures(rewritten(lean_run, tmp_path, moved(topic, 1, 1, header=header, bag=bag)))
    assert topic in found["stamps"]


@pytest.mark.parametrize("topic", [table.WHEEL_SPEEDS[2], table.CLOCK])
def test_a_stamp_of_what_has_no_header_is_found(lean_run: Path, tmp_path: Path, topic: str) -> None:
    found = quick_failures(rewritten(lean_run, tmp_path, moved(topic, 3, -1, header=False, bag=True)))
    assert topic in found["stamps"]
    assert "in step" in found


def test_a_stamp_inside_a_transform_and_a_clock_that_tells_another_time_are_found(
    lean_run: Path, tmp_path: Path
) -> None:
    """/tf has a list of headers and none of its own; /clock is a stamp."""

    def transform(data: bytearray) -> None:
        struct.pack_into("<L", data, 12, struct.unpack_from("<L", data, 12)[0] + 1)

    def clock(data: bytearray) -> None:
        struct.pack_into("<LL", data, 0, 0, 400_000_001)

    change = each({(table.TF, 7): transform, (table.CLOCK, 399): clock})
    found = quick_failures(rewritten(lean_run, tmp_path, change))
    assert set(found) == {"stamps", "clock"}
    assert f"{table.TF} at 160000000 ns: header 160000001 ns" in found["stamps"]
    assert "400000001 ns" in found["clock"]


@pytest.mark.parametrize("number", [0, 2, 4])
@pytest.mark.parametrize("topic", [table.POINTS])
def test_a_message_that_is_missing_is_found(lean_run: Path, tmp_path: Path, topic: str, number: int) -> None:
    """The first, one in the middle, the last of five."""

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        return None if raw.topic == topic and k == number else raw

    assert topic in quick_failures(rewritten(lean_run, tmp_path, change))["stamps"]


def test_a_topic_of_which_half_is_missing_fails_the_counts(lean_run: Path, tmp_path: Path) -> None:
    def change(raw: RawMessage, k: int) -> RawMessage | None:
        return None if raw.topic == table.IMU and k % 2 else raw

    found = quick_failures(rewritten(lean_run, tmp_path, change))
    assert f"{table.IMU}: 13 messages" in found["counts"]
    assert "make 26" in found["counts"]


def test_a_topic_that_is_missing_is_found(lean_run: Path, tmp_path: Path) -> None:
    def change(raw: RawMessage, k: int) -> RawMessage | None:
        return None if raw.topic == table.instances("right") else raw

    assert table.instances("right") in quick_failures(rewritten(lean_run, tmp_path, change))["topics"]

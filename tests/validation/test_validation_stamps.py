# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A changed stamp and a missing message are found, though checksums and index fit."""

import struct
from pathlib import Path

import pytest
from changed_bags import IMU, POINTS, RIGHT, failures_of

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.sensors.wheel_odometry.config import WHEEL_SPEEDS

PHOTOGRAPH = RIGHT.topic_of("photograph")
MOVED: dict[tuple[str, int], tuple[int, bool, bool]] = {  # by [ns], in the header, in the bag
    (POINTS, 1): (1, True, False),
    (IMU, 4): (1, False, True),
    (PHOTOGRAPH, 3): (-1, True, True),
    (WHEEL_SPEEDS[2], 3): (-1, False, True),
    (table.CLOCK, 33): (1, False, True),
}


@pytest.fixture(scope="module")
def moved(lean_run: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Failed checks of a bag in which each of some stamps is off by a nanosecond."""

    def change(raw: RawMessage, k: int) -> RawMessage:
        by_ns, header, bag = MOVED.get((raw.topic, k), (0, False, False))
        data = bytearray(raw.data)
        if header:
            struct.pack_into("<LL", data, 4, *divmod(raw.stamp_ns + by_ns, 10**9))
        return raw._replace(data=bytes(data), stamp_ns=raw.stamp_ns + by_ns * bag)

    return failures_of(lean_run, tmp_path_factory.mktemp("moved"), change)


def test_stamp_off_by_a_nanosecond_in_header_or_bag_is_found(moved: dict[str, str]) -> None:
    header, *off_rate = moved["stamps"].split("; ")
    assert header.startswith("the stamp in a header is the stamp in the bag: 2 of")
    late = [f"{topic} are k" for topic, _ in MOVED if topic != POINTS]
    found = {topic: text for topic in late for text in off_rate if topic in text}
    assert set(found) == set(late)
    assert all(": 1 of" in text for text in found.values())


def test_stamp_off_by_a_nanosecond_breaks_synchronisation(moved: dict[str, str]) -> None:
    """The camera's, the wheels' and the clock's stamps and their former partners, twice each."""
    assert moved["synchronisation"].split(": ")[1].startswith("6 of")


def test_clock_that_differs_from_its_stamp_is_found(moved: dict[str, str]) -> None:
    assert f"1 of 520 mismatch, first {table.CLOCK} at 34000001 ns: 34000000 ns in 8 bytes" in moved["clock"]


def test_stamp_inside_a_transform_is_found(lean_run: Path, tmp_path: Path) -> None:
    """/tf has a list of headers and none of its own."""

    def transform(data: bytearray) -> None:
        struct.pack_into("<L", data, 12, struct.unpack_from("<L", data, 12)[0] + 1)

    found = failures_of(lean_run, tmp_path, {(table.TF, 7): transform})
    assert list(found) == ["stamps"]
    assert f"{table.TF} at 160000000 ns: header 160000001 ns" in found["stamps"]


def test_missing_messages_and_a_missing_topic_are_found(lean_run: Path, tmp_path: Path) -> None:
    """The first cloud, an odometry in the middle, the last IMU reading; every other wheel speed; a whole topic."""
    missing = {(POINTS, 0), (table.ODOMETRY, 11), (IMU, 25)}
    topics = (RIGHT.topic_of("instances"), WHEEL_SPEEDS[0])

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        half = raw.topic == topics[1] and k % 2
        return None if (raw.topic, k) in missing or raw.topic == topics[0] or half else raw

    found = failures_of(lean_run, tmp_path, change)
    wheels = 2  # of five readings
    assert f"no reading is missing: {len(missing) + wheels} of" in found["stamps"]
    assert f"{topics[1]}: 3 messages, 0.520 s at 10 Hz make 5: 2 message, tolerance 1" in found["counts"]
    assert f"{topics[0]} is missing" in found["topics"]


@pytest.mark.parametrize(("topic", "number"), [(POINTS, 0), (table.ODOMETRY, 11), (IMU, 25)])
def test_a_single_missing_message_is_found(lean_run: Path, tmp_path: Path, topic: str, number: int) -> None:
    found = failures_of(lean_run, tmp_path, lambda raw, k: None if (raw.topic, k) == (topic, number) else raw)
    assert "no reading is missing: 1 of" in found["stamps"]
    assert topic in found["stamps"]

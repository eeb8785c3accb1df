# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Reader

from fieldtruth.bag.decode import read_bag
from fieldtruth.bag.messages import clocks
from fieldtruth.bag.topics import CLOCK
from fieldtruth.bag.topics import PAPER_TOPICS as TOPICS
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.errors import OutputError
from fieldtruth.sensors.wheel_odometry.config import WHEEL_SPEEDS
from fieldtruth.sensors.wheel_odometry.sensor import wheel_speeds

TOPIC = WHEEL_SPEEDS[0]


def clock(stamp: int) -> bytes:
    return clocks(np.array([stamp]))[0]


def wheel_speed(speed: float) -> bytes:
    return wheel_speeds(np.array([speed]))[0]


def write(path: Path, stamps: range) -> Path:
    with BagWriter(path, TOPICS) as bag:
        for stamp in stamps:
            bag.write(CLOCK, stamp, clock(stamp))
            bag.write(TOPIC, stamp, wheel_speed(stamp))
    return path


def test_joined_bags_read_as_one(tmp_path: Path) -> None:
    first, second = write(tmp_path / "a.bag", range(1, 300)), write(tmp_path / "b.bag", range(300, 700))
    with BagWriter(tmp_path / "c.bag", TOPICS) as bag:
        bag.append(first)
        bag.append(second)
    whole = [(r.stamp_ns, r.topic) for r in read_bag(tmp_path / "c.bag")]
    assert whole == [(stamp, topic) for stamp in range(1, 700) for topic in (CLOCK, TOPIC)]
    with Reader(tmp_path / "c.bag") as reader:
        assert (reader.start_time, reader.end_time) == (1, 700)


def test_messages_may_be_written_before_and_after_a_joined_bag(tmp_path: Path) -> None:
    middle = write(tmp_path / "m.bag", range(10, 20))
    with BagWriter(tmp_path / "c.bag", TOPICS) as bag:
        for stamp in range(1, 10):
            bag.write(TOPIC, stamp, wheel_speed(stamp))
        bag.append(middle)
        for stamp in range(20, 30):
            bag.write(TOPIC, stamp, wheel_speed(stamp))
    values = [r.message.data for r in read_bag(tmp_path / "c.bag", [TOPIC])]
    assert values == list(range(1, 30))


def test_records_are_contiguous(tmp_path: Path) -> None:
    # required for reading a bag from front to back, without its index
    with BagWriter(tmp_path / "c.bag", TOPICS) as bag:
        bag.append(write(tmp_path / "a.bag", range(1, 300)))
        bag.append(write(tmp_path / "b.bag", range(300, 700)))
    data = (tmp_path / "c.bag").read_bytes()
    kinds, at = [], len(b"#ROSBAG V2.0\n")
    while at < len(data):
        for part in ("header", "body"):
            size = int.from_bytes(data[at : at + 4], "little")
            if part == "header":
                kinds.append(data[data.index(b"op=", at, at + 4 + size) + 3])
            at += 4 + size
    assert at == len(data)
    assert kinds == [
        3,
        5,
        4,
        4,
        5,
        4,
        4,
        *[7] * len(TOPICS),
        6,
        6,
    ]  # file, 2 x (chunk, indices), topics, chunk infos


def test_an_aborted_recording_leaves_no_bag(tmp_path: Path) -> None:
    def crash() -> None:
        with BagWriter(tmp_path / "c.bag", TOPICS) as bag:
            bag.write(TOPIC, 1, wheel_speed(1.0))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        crash()
    assert not list(tmp_path.iterdir())


def test_a_bag_is_not_overwritten(tmp_path: Path) -> None:
    path = write(tmp_path / "a.bag", range(1, 3))
    before = path.read_bytes()
    with pytest.raises(OutputError, match=r"a\.bag already exists"):
        write(path, range(5, 9))
    assert path.read_bytes() == before

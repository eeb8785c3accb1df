# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of a bag without some messages or with other stamps, written by rosbags; and a strict comparison of frames."""

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Reader, Writer


def rewrite(
    run: Path,
    path: Path,
    keep: Callable[[str, int], bool] = lambda topic, k: True,
    delay: Callable[[int], int] = lambda k: 0,
) -> Path:
    """Copy a run's bag.

    Args:
        run: its folder.
        path: the new bag.
        keep: whether the k-th message of a topic is copied.
        delay: time [ns] by which the bag's stamp of the k-th message of the bag falls behind.
    """
    counts: Counter[str] = Counter()
    rows = []
    with Reader(run / f"{run.name}.bag") as reader, Writer(path) as writer:
        connections = {
            c.topic: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest)
            for c in reader.connections
        }
        for number, (connection, stamp, data) in enumerate(reader.messages()):
            if keep(connection.topic, counts[connection.topic]):
                rows.append((stamp + delay(number), number, connection.topic, data))
            counts[connection.topic] += 1
        for stamp, _, topic, data in sorted(rows):
            writer.write(connections[topic], stamp, data)
    return path


def equal(frame: Mapping[str, Any], other: Mapping[str, Any]) -> None:
    """Two frames are the same, value by value, types included."""
    assert frame.keys() == other.keys()
    for key, value in frame.items():
        if isinstance(value, np.ndarray):
            assert value.dtype == other[key].dtype, key
            assert np.array_equal(value, other[key]), key
        else:
            assert value == other[key], key

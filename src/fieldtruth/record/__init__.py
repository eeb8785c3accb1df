# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The bag: messages from a drive and its sensors, written in time slices, joined, and read back."""

from fieldtruth.record.bag import BagWriter
from fieldtruth.record.read import (
    Reading,
    count_messages,
    image,
    matrix,
    points,
    pose_matrix,
    read_bag,
    stamp_ns,
    static_transforms,
)
from fieldtruth.record.slices import Slices
from fieldtruth.record.stored import BagError
from fieldtruth.record.streams import Sensors, Stream, streams_of
from fieldtruth.record.topics import TOPICS, Topic, topics_of

__all__ = [
    "TOPICS",
    "BagError",
    "BagWriter",
    "Reading",
    "Sensors",
    "Slices",
    "Stream",
    "Topic",
    "count_messages",
    "image",
    "matrix",
    "points",
    "pose_matrix",
    "read_bag",
    "stamp_ns",
    "static_transforms",
    "streams_of",
    "topics_of",
]

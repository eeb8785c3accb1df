# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The bag: messages from a drive and its sensors, written in time slices, joined, and read back.

Here are the names for reading. What writes brings the physics along, which a reader should not have to wait for.
"""

from fieldtruth.bag.decode import (
    Reading,
    count_messages,
    depth,
    image,
    instances,
    labels,
    matrix,
    points,
    pose_matrix,
    read_bag,
    stamp_ns,
    static_transforms,
)
from fieldtruth.bag.errors import BagError

__all__ = [
    "BagError",
    "Reading",
    "count_messages",
    "depth",
    "image",
    "instances",
    "labels",
    "matrix",
    "points",
    "pose_matrix",
    "read_bag",
    "stamp_ns",
    "static_transforms",
]

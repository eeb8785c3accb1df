# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bags: topics and message types, reading and writing, tf and calibration, the true trajectory.

These are the public names for reading (``ft.bag.points``).
"""

from fieldtruth.bag.decode import (
    Reading,
    count_messages,
    depth,
    flow,
    image,
    instances,
    labels,
    matrix,
    normals,
    points,
    pose_matrix,
    read_bag,
    stamp_ns,
    static_transforms,
)
from fieldtruth.bag.file import BagError

__all__ = [
    "BagError",
    "Reading",
    "count_messages",
    "depth",
    "flow",
    "image",
    "instances",
    "labels",
    "matrix",
    "normals",
    "points",
    "pose_matrix",
    "read_bag",
    "stamp_ns",
    "static_transforms",
]

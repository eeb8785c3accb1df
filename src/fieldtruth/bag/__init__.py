# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bags: topics and message types, reading and writing, tf and calibration, the true trajectory.

These are the public names for reading (``ft.bag.points``).
"""

from fieldtruth.bag.decode import Reading as Reading
from fieldtruth.bag.decode import count_messages as count_messages
from fieldtruth.bag.decode import depth as depth
from fieldtruth.bag.decode import flow as flow
from fieldtruth.bag.decode import image as image
from fieldtruth.bag.decode import instances as instances
from fieldtruth.bag.decode import labels as labels
from fieldtruth.bag.decode import matrix as matrix
from fieldtruth.bag.decode import normals as normals
from fieldtruth.bag.decode import parts as parts
from fieldtruth.bag.decode import passability as passability
from fieldtruth.bag.decode import points as points
from fieldtruth.bag.decode import pose_matrix as pose_matrix
from fieldtruth.bag.decode import read_bag as read_bag
from fieldtruth.bag.decode import stamp_ns as stamp_ns
from fieldtruth.bag.decode import static_transforms as static_transforms
from fieldtruth.bag.file import BagError as BagError

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rigid transforms and conversions of orientations, as the public ``fieldtruth.transforms``; see ``core.frames``."""

from fieldtruth.core.frames import inverse as inverse
from fieldtruth.core.frames import pose as pose
from fieldtruth.core.frames import pose_from_quaternion_wxyz as pose_from_quaternion_wxyz
from fieldtruth.core.frames import quaternion_wxyz_from_rotation as quaternion_wxyz_from_rotation
from fieldtruth.core.frames import rotation_from_quaternion_wxyz as rotation_from_quaternion_wxyz
from fieldtruth.core.frames import rpy_deg_from_rotation as rpy_deg_from_rotation
from fieldtruth.core.frames import transform as transform
from fieldtruth.core.frames import wxyz_from_xyzw as wxyz_from_xyzw
from fieldtruth.core.frames import xyzw_from_wxyz as xyzw_from_wxyz
from fieldtruth.core.frames import yaw_from_rotation as yaw_from_rotation

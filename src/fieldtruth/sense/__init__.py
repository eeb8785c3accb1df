# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Labelled sensing: one ray scene, and the sensors that trace rays in it. It knows no bag and no robot."""

from fieldtruth.sense.lidar import Lidar, Scan
from fieldtruth.sense.scene import Scene

__all__ = ["Lidar", "Scan", "Scene"]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Labelled sensing: one ray scene, and the LiDAR and cameras that look into it. It knows no bag and no robot."""

from fieldtruth.sense.camera import Camera, LabelImage, Picture, tag_image
from fieldtruth.sense.lidar import Lidar, Scan
from fieldtruth.sense.scene import Scene

__all__ = ["Camera", "LabelImage", "Lidar", "Picture", "Scan", "Scene", "tag_image"]

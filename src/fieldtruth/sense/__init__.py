# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ray tracing and the sensors that need no light: LiDAR, and label, instance and depth images."""

from fieldtruth.sense.label_camera import LabelCamera, LabelImages, tag_image
from fieldtruth.sense.lidar import Lidar, Scan
from fieldtruth.sense.scene import Scene

__all__ = ["LabelCamera", "LabelImages", "Lidar", "Scan", "Scene", "tag_image"]

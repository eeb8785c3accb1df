# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Intrinsics of the pinhole camera."""

from fieldtruth.kernels.camera_rays import Pinhole
from fieldtruth.sensors.camera.config import CameraConfig


def pinhole(config: CameraConfig) -> Pinhole:
    """Intrinsics of a camera, whatever its lens: ``lenses.Lens`` states what they mean for each model."""
    lens = config.projection
    return Pinhole(lens.fx, lens.fy, lens.cx, lens.cy)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Intrinsics of the pinhole camera."""

from typing import NamedTuple

from fieldtruth.sensors.camera.config import CameraConfig


class Pinhole(NamedTuple):
    """Intrinsics [pixel] in ROS's convention: the centre of the upper left pixel is (0, 0)."""

    fx: float
    fy: float
    cx: float
    cy: float


def pinhole(config: CameraConfig) -> Pinhole:
    """Intrinsics of a camera, whatever its lens: ``lenses.Lens`` states what they mean for each model."""
    lens = config.projection
    return Pinhole(lens.fx, lens.fy, lens.cx, lens.cy)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Intrinsics of the pinhole camera."""

from typing import NamedTuple

import numpy as np

from fieldtruth.experiment.rig import CameraConfig


class Pinhole(NamedTuple):
    """Intrinsics [pixel] in ROS's convention: the centre of the upper left pixel is (0, 0)."""

    fx: float
    fy: float
    cx: float
    cy: float


def pinhole(config: CameraConfig) -> Pinhole:
    """Intrinsics of a camera whose fields of view end at the outer borders of the outermost pixels."""
    return Pinhole(
        fx=float(config.width / 2.0 / np.tan(np.radians(config.horizontal_fov_deg) / 2.0)),
        fy=float(config.height / 2.0 / np.tan(np.radians(config.vertical_fov_deg) / 2.0)),
        cx=config.width / 2.0 - 0.5,
        cy=config.height / 2.0 - 0.5,
    )

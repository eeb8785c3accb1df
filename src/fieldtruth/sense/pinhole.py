# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The pinhole: which ray belongs to which pixel."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fieldtruth.experiment.rig import CameraConfig
from fieldtruth.sense.packets import Packet, set_ray


class Pinhole(NamedTuple):
    """Intrinsics [pixel] in ROS's convention: the centre of the upper left pixel is (0, 0)."""

    fx: float
    fy: float
    cx: float
    cy: float


def pinhole(config: CameraConfig) -> Pinhole:
    """Intrinsics of a camera whose outermost pixels' outer borders span the fields of view."""
    return Pinhole(
        fx=float(config.width / 2.0 / np.tan(np.radians(config.horizontal_fov_deg) / 2.0)),
        fy=float(config.height / 2.0 / np.tan(np.radians(config.vertical_fov_deg) / 2.0)),
        cx=config.width / 2.0 - 0.5,
        cy=config.height / 2.0 - 0.5,
    )


@njit(error_model="numpy", nogil=True, cache=True, inline="always")
def set_pixel_ray(
    packet: Packet, lane: int, pose: NDArray[np.float64], lens: Pinhole, u: float, v: float, far: float
) -> float:
    """Put the ray through image point (u, v) [pixel] into a lane; return the cosine of its angle to the axis."""
    a, b = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy
    cosine = float(1.0 / np.sqrt(1.0 + a * a + b * b))
    set_ray(
        packet, lane, pose[0, 3], pose[1, 3], pose[2, 3],
        (pose[0, 0] * a + pose[0, 1] * b + pose[0, 2]) * cosine,
        (pose[1, 0] * a + pose[1, 1] * b + pose[1, 2]) * cosine,
        (pose[2, 0] * a + pose[2, 1] * b + pose[2, 2]) * cosine,
        0.0, far,
    )  # fmt: skip
    return cosine

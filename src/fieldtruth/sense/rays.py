# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Single rays in a scene, for sensors that are neither a LiDAR nor a camera."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.lidar import Beams, trace_beams
from fieldtruth.kernels.packets import LabelBuffers, new_packet
from fieldtruth.sense.scene import Scene


class Hits(NamedTuple):
    """First hits of n rays: ``range_m`` (n,) [m], infinite without a hit, with ``label`` and ``instance`` 0."""

    range_m: Float32Array
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]


def cast_rays(scene: Scene, origins: ArrayLike, directions: ArrayLike, max_range: float = np.inf) -> Hits:
    """Return the first surface that each ray hits, water included.

    Args:
        scene: shared by all sensors.
        origins: (n, 3) or (3,) [m] in the world frame.
        directions: (n, 3), of any length above 0, in the world frame.
        max_range: farther surfaces are not hit [m].

    Raises:
        ValueError: a direction without length, or that is not finite.
    """
    along = np.atleast_2d(np.asarray(directions, np.float64))
    length, count = np.linalg.norm(along, axis=1, keepdims=True), len(along)
    if not (np.isfinite(length) & (length > 0.0)).all():
        raise ValueError("directions must be finite and longer than 0")
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = origins
    beams = Beams(np.ascontiguousarray((along / length)[:, None]), np.zeros(1), 0.0, max_range, np.ones(256, np.bool_))
    shape = (count, 1)
    out = LabelBuffers(np.zeros(shape, np.uint8), np.zeros(shape, np.uint32), np.zeros(shape, np.float32))
    trace_beams(scene.rays.handle, scene.hits, new_packet(coherent=False), poses, beams, out)
    range_m = np.where(out.depth[:, 0] > 0.0, out.depth[:, 0], np.float32(np.inf))
    return Hits(range_m, out.label[:, 0], out.instance[:, 0])

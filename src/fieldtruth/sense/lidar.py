# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The LiDAR: a rotating multi-beam scanner whose every return carries the class and the id of the object it hit."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import NO_RETURN
from fieldtruth.experiment.rig import LidarConfig
from fieldtruth.sense import embree
from fieldtruth.sense.hits import HitTable, classify, hit_top
from fieldtruth.sense.kernel import kernel
from fieldtruth.sense.packets import Packet, new_packet, set_ray
from fieldtruth.sense.scene import Scene

_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.LANES // 2, 2  # measured: wide tiles with the coherent flag are fastest
_FAR, _PRIM = embree.TFAR, embree.PRIM_ID
_intersect: Any = embree.intersect


@dataclass(frozen=True, kw_only=True)
class Scan:
    """One turn of the LiDAR, returns only, ordered by column, then by ring.

    ``xyz`` (n, 3) float32 [m] in the LiDAR's frame; ``range_m`` (n,) [m]; ``label`` class ids; ``instance`` object ids;
    ``ring`` and ``column`` index the ray; ``t_ns`` is the time [ns] after the scan's stamp at which the ray left.
    """

    xyz: NDArray[np.float32]
    range_m: NDArray[np.float32]
    label: NDArray[np.uint8]
    instance: NDArray[np.uint16]
    ring: NDArray[np.uint16]
    column: NDArray[np.uint16]
    t_ns: NDArray[np.uint32]


def ray_directions(config: LidarConfig) -> NDArray[np.float64]:
    """Unit directions (columns, rings, 3) in the LiDAR's frame (x forward, y left, z up).

    Ring 0 is the highest beam and the last ring the lowest; they span the vertical field of view with both ends
    included (+22.5 and -22.5 deg). Column 0 looks along +x; columns follow each other clockwise seen from above, as the
    Ouster turns, 360 deg / columns apart.
    """
    azimuth = -2.0 * np.pi * np.arange(config.columns) / config.columns
    half = np.radians(config.vertical_fov_deg) / 2.0
    elevation = np.linspace(half, -half, config.rings) if config.rings > 1 else np.zeros(1)
    directions = np.empty((config.columns, config.rings, 3))
    directions[..., 0] = np.cos(azimuth)[:, None] * np.cos(elevation)
    directions[..., 1] = np.sin(azimuth)[:, None] * np.cos(elevation)
    directions[..., 2] = np.sin(elevation)
    return directions


class Lidar:
    """A LiDAR in a scene. One thread at a time may use it; make one per thread, they are cheap.

    The origin is the frame ``os1_lidar``. A ray returns the first surface it meets between ``min_range`` and
    ``max_range``; what is nearer hides what is behind it; water and sky return nothing. All rays of a scan leave at the
    scan's stamp unless poses by column are given. Range is exact: no noise, no beam width.
    """

    def __init__(self, config: LidarConfig, scene: Scene) -> None:
        self.config = config
        self.scene = scene
        self.directions = ray_directions(config)
        self._packet = new_packet(coherent=True)
        shape = (config.columns, config.rings)
        self._range = np.zeros(shape, np.float32)
        self._label = np.zeros(shape, np.uint8)
        self._instance = np.zeros(shape, np.uint16)
        returns = np.ones(256, np.bool_)
        returns[[int(label) for label in NO_RETURN]] = False
        self._returns = returns

    def scan(self, world_from_lidar: NDArray[np.float64]) -> Scan:
        """Scan once. ``world_from_lidar`` is (4, 4), or (columns, 4, 4) for a scanner that moves while it turns.

        With poses by column, ``t_ns`` spreads the columns evenly over one period and points stay in the frame of the
        column's own pose, as a real scanner reports them.
        """
        config = self.config
        moving = world_from_lidar.ndim == 3
        poses = np.ascontiguousarray(np.broadcast_to(world_from_lidar, (config.columns, 4, 4)))
        _scan(
            self.scene.rays.handle, self.scene.hits, self._packet, poses, self.directions,
            config.min_range, config.max_range, self._returns, self._range, self._label, self._instance,
        )  # fmt: skip
        column, ring = np.nonzero(self._range)
        distance = self._range[column, ring]
        period_ns = 1e9 / config.rate_hz
        t_ns = np.rint(column * (period_ns / config.columns)) if moving else np.zeros(len(column))
        return Scan(
            xyz=(self.directions[column, ring] * distance[:, None]).astype(np.float32),
            range_m=distance,
            label=self._label[column, ring],
            instance=self._instance[column, ring],
            ring=ring.astype(np.uint16),
            column=column.astype(np.uint16),
            t_ns=t_ns.astype(np.uint32),
        )


@kernel
def _scan(
    scene: np.uint64, hits: HitTable, packet: Packet, poses: NDArray[np.float64], directions: NDArray[np.float64],
    min_range: float, max_range: float, returns: NDArray[np.bool_],
    distance: NDArray[np.float32], label: NDArray[np.uint8], instance: NDArray[np.uint16],
) -> None:  # fmt: skip
    """Trace all rays in tiles of neighbouring columns and rings; ``distance`` is 0 where nothing comes back."""
    columns, rings = distance.shape
    for first_column in range(0, columns, _WIDTH):
        for first_ring in range(0, rings, _HEIGHT):
            for lane in range(_LANES):
                column, ring = first_column + lane % _WIDTH, first_ring + lane // _WIDTH
                if column >= columns or ring >= rings:
                    packet.valid[lane] = 0
                    continue
                pose, d = poses[column], directions[column, ring]
                set_ray(
                    packet, lane, pose[0, 3], pose[1, 3], pose[2, 3],
                    pose[0, 0] * d[0] + pose[0, 1] * d[1] + pose[0, 2] * d[2],
                    pose[1, 0] * d[0] + pose[1, 1] * d[1] + pose[1, 2] * d[2],
                    pose[2, 0] * d[0] + pose[2, 1] * d[1] + pose[2, 2] * d[2],
                    0.0, max_range,
                )  # fmt: skip
            _intersect(packet.valid.ctypes, scene, packet.ray.ctypes, packet.arguments.ctypes)
            for lane in range(_LANES):
                if packet.valid[lane] == 0:
                    continue
                column, ring = first_column + lane % _WIDTH, first_ring + lane // _WIDTH
                distance[column, ring] = 0.0
                top = hit_top(packet.words, lane)
                reach = packet.ray[_FAR + lane]
                if top < 0 or reach < min_range:
                    continue
                pose, d = poses[column], directions[column, ring]
                x = pose[0, 3] + reach * (pose[0, 0] * d[0] + pose[0, 1] * d[1] + pose[0, 2] * d[2])
                y = pose[1, 3] + reach * (pose[1, 0] * d[0] + pose[1, 1] * d[1] + pose[1, 2] * d[2])
                kind, thing = classify(hits, top, packet.words[_PRIM + lane], x, y)
                if returns[kind]:
                    distance[column, ring] = reach
                    label[column, ring] = kind
                    instance[column, ring] = thing

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A LiDAR with the signal of a real one."""

from collections.abc import Callable

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.random import rng_of
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.noise import Reading, measure, new_reading, receiver_of
from fieldtruth.sensors.lidar.sensing import Lidar
from fieldtruth.sensors.lidar.surfaces import EchoBuffers, echo_buffers, surface_table, trace_surfaces

InAir = Callable[[EchoBuffers, np.uint64], None]
"""Changes echoes as the air between LiDAR and surfaces does: ``apparent`` falls by exp(-2 alpha R), and a particle that
returns more takes the echo with its own ``depth``, ``apparent``, ``label`` and ``instance``. ``true_range`` stays. What
it draws depends on the key, which is that of the scan."""


class SignalLidar(Lidar):
    """A LiDAR in a scene, as ``Lidar``, that measures as its ``signal`` says. Use one per thread.

    Of a signal with one ray per beam, labels, instance ids and ``true_range`` of the points are those of the ideal
    LiDAR, to the last bit; some of its points are missing.
    """

    def __init__(self, config: LidarConfig, scene: Scene, in_air: InAir | None = None) -> None:
        super().__init__(config, scene)
        signal = config.signal
        assert signal is not None
        self._receiver, self._in_air = receiver_of(signal), in_air
        self._tables = scene.hits, surface_table(scene)
        self._echoes = echo_buffers(2 if signal.returns == "two" else 1, config.columns, config.rings)
        self._points = new_reading(self._echoes.depth.size)

    def scan(self, world_from_lidar: Array, stamp_ns: int = 0, number: int = 0) -> Reading:  # type: ignore[override]
        """Scan ``number`` of a drive, from poses as ``Lidar.scan`` takes them.

        Raises:
            ValueError: another number of poses.
        """
        poses, moving = self._poses(world_from_lidar, stamp_ns)
        key = np.uint64(
            rng_of(self.scene.world.seed, self.config.name, "scan", number).integers(1 << 64, dtype=np.uint64)
        )
        trace_surfaces(self.scene.rays.handle, self._tables, self._packet, poses, self._beams, self._echoes)
        if self._in_air is not None:
            self._in_air(self._echoes, key)
        count = measure(self._receiver, key, self._beams.directions, self._echoes, self._points)
        found = Reading._make(values[:count].copy() for values in self._points)
        if moving:
            found.t_ns[:] = self._times_ns[found.column, found.ring]
        return found

    def _key(self, number: int) -> np.uint64:
        """Key of what a scan draws: it depends on the experiment's seed, the LiDAR's name and the scan's number."""
        return rng_of(self.scene.world.seed, self.config.name, "scan", number).integers(1 << 64, dtype=np.uint64)


def new_lidar(config: LidarConfig, scene: Scene) -> Lidar:
    """Return a LiDAR in a scene, with the signal of its configuration if it has one."""
    return Lidar(config, scene) if config.signal is None else SignalLidar(config, scene)

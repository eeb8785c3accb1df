# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A LiDAR that measures as its configuration says: ideally, or with the signal of a real one."""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.random import rng_of
from fieldtruth.experiment.robot_body import Box, Cylinder
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.kernels.lidar import EchoBuffers, Scan, trace_beams, trace_echoes
from fieldtruth.kernels.lidar_noise import Reading, measure
from fieldtruth.kernels.packets import new_packet
from fieldtruth.sense.robot import RobotScan
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.echoes import sub_rays_of
from fieldtruth.sensors.lidar.in_air import WeatherInAir
from fieldtruth.sensors.lidar.noise import new_reading, receiver_of
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.sensors.lidar.surfaces import echo_buffers, surface_table
from fieldtruth.world.model import ROBOT_ID

_ROBOT: Final = np.array([0.05, 0.05, 0.20])
"""Reflectance of the robot's dark paint, rubber and steel, all matt: as ``iron`` and ``steel`` in reflectance.yaml, and
rubber as black as the paint (our choice)."""

InAir = Callable[[EchoBuffers, np.uint64, Array, Array], None]
"""Changes echoes as the air between LiDAR and surfaces does: ``apparent`` falls by exp(-2 alpha R), and a particle that
returns more takes the echo with its own ``depth``, ``apparent``, ``label`` and ``instance``. ``true_range`` stays. What
it draws depends on the key, which is that of the scan. The arrays are poses (columns + 1, 4, 4) and directions
(columns, rings, 3) of the beams."""


class Traced(NamedTuple):
    """Poses of a scan, and whether the sensor moves; its echoes are in the buffers of the LiDAR."""

    poses: Array
    moving: bool


class Lidar(IdealLidar):
    """A LiDAR in a scene, that measures as its configuration says. Use one per thread: each owns its buffers.

    Without a ``signal`` it is ideal (``IdealLidar``) and no weather reaches it. Of a signal with one ray per beam,
    labels, instance ids and ``true_range`` of the points are those of the ideal LiDAR, to the last bit; some of its
    points are missing. With more rays ``true_range`` still is, and class and id are those of the surface that makes the
    echo.

    Args:
        config: with or without a signal.
        scene: what it sees.
        robot: what it sees of the robot that carries it (``experiment.robot_body.visible_parts``).
        weather: what is in the air.
        in_air: instead of the weather, what the air does to echoes.
    """

    def __init__(
        self,
        config: LidarConfig,
        scene: Scene,
        robot: Sequence[Box | Cylinder] = (),
        weather: WeatherConfig | None = None,
        *,
        in_air: InAir | None = None,
    ) -> None:
        super().__init__(config, scene, robot)
        signal = config.signal
        if signal is None:
            return
        if in_air is None and weather is not None and not weather.is_clear:
            in_air = WeatherInAir(config, weather, float(scene.world.terrain.surface.heights.min()))
        self._receiver, self._in_air = receiver_of(signal), in_air
        self._sub_rays = sub_rays_of(signal) if signal.sub_rays > 1 else None
        self._coherent = new_packet(coherent=True)
        self._tables = scene.hits, surface_table(scene)
        self._echoes = echo_buffers(2 if signal.returns == "two" else 1, config.columns, config.rings)
        self._points = new_reading(self._echoes.depth.size)

    def scan(self, world_from_lidar: Array, stamp_ns: int = 0, number: int = 0) -> Scan | Reading:  # type: ignore[override]
        """Scan ``number`` of a drive, from poses as ``IdealLidar.scan`` takes them; with a signal, a ``Reading``.

        Raises:
            ValueError: another number of poses.
        """
        if self.config.signal is None:
            return super().scan(world_from_lidar, stamp_ns, number)
        return self.measured(world_from_lidar, stamp_ns, number)

    def measured(self, world_from_lidar: Array, stamp_ns: int = 0, number: int = 0) -> Reading:
        """Scan as ``scan`` does, with a LiDAR that has a signal."""
        return self.measure(self.trace(world_from_lidar, stamp_ns), number)

    def measure(self, traced: Traced, number: int) -> Reading:
        """Return what air and receiver make of the echoes that were traced last, in scan ``number`` of a drive."""
        key = self._key(number)
        if self._in_air is not None:
            self._in_air(self._echoes, key, traced.poses, self._beams.directions)
        count = measure(self._receiver, key, self._beams.directions, self._echoes, self._points)
        found = Reading._make(values[:count].copy() for values in self._points)
        if traced.moving:
            found.t_ns[:] = self._times_ns[found.column, found.ring]
        return found

    def echoes(self, world_from_lidar: Array, stamp_ns: int = 0) -> EchoBuffers:
        """Echoes before what the air and the receiver make of them; overwritten by the next scan."""
        self.trace(world_from_lidar, stamp_ns)
        return self._echoes

    def trace(self, world_from_lidar: Array, stamp_ns: int) -> Traced:
        """Fill the buffers of echoes from poses, as ``scan`` takes them; of a LiDAR with a signal."""
        poses, moving = self._poses(world_from_lidar, stamp_ns)
        rays, tables, packets = self.scene.rays.handle, self._tables, (self._packet, self._coherent)
        if self._sub_rays is None:
            trace_beams(rays, *tables, self._packet, poses, self._beams, self._echoes)
        else:
            trace_echoes(rays, tables, packets, poses, self._beams, self._receiver, self._sub_rays, self._echoes)
        if self._robot is not None:
            self._echo_of_robot(self._robot, poses)
        return Traced(poses, moving)

    def _echo_of_robot(self, robot: RobotScan, poses: Array) -> None:
        """Put the robot's echoes instead of those of what it hides."""
        seen, echoes = self._robot_before(robot, poses), self._echoes
        beam = slice(None), robot.column[seen], robot.ring[seen]
        echoes.depth[beam], echoes.mixed[beam] = 0.0, False
        first = 0, *beam[1:]
        echoes.depth[first] = echoes.true_range[beam[1:]] = self._returned(robot.range_m[seen])
        echoes.label[first], echoes.instance[first] = int(Label.ROBOT), ROBOT_ID
        echoes.apparent[first] = (_ROBOT[robot.material] * robot.cosine)[seen]

    def _key(self, number: int) -> np.uint64:
        """Key of what a scan draws: it depends on the experiment's seed, the LiDAR's name and the scan's number."""
        return rng_of(self.scene.world.seed, self.config.name, "scan", number).integers(1 << 64, dtype=np.uint64)

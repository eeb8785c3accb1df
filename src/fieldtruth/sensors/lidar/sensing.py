# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The LiDAR: a rotating multi-beam scanner that labels every return with class and instance id."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.core.classes import NO_RETURN, Label
from fieldtruth.experiment.robot_body import Box, Cylinder
from fieldtruth.kernels.lidar import Beams, Scan, collect_returns, only_ranges, trace_beams
from fieldtruth.kernels.packets import LabelBuffers, new_packet
from fieldtruth.sense.robot import RobotScan
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.beams import ray_times_ns
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.patterns import pattern_directions
from fieldtruth.world.model import ROBOT_ID


def ray_directions(config: LidarConfig, stamp_ns: int = 0) -> Array:
    """Unit directions (columns, rings, 3) in the LiDAR's frame (x forward, y left, z up).

    Column 0 points along +x; columns are 360 deg / columns apart and advance clockwise seen from above, as an Ouster
    rotates. A ring leaves its column by its azimuth offset, and by what the head turns until it fires. Those of a
    ``pattern`` are of the scan at ``stamp_ns``.
    """
    if config.pattern is not None:
        return pattern_directions(config, stamp_ns)
    ahead = np.radians(np.array(config.azimuth_offsets_deg or (0.0,)))  # (rings,) or (1,), clockwise
    ahead = ahead + 2.0 * np.pi * config.rate_hz * 1e-9 * np.array(config.firing_offsets_ns or (0,))
    azimuth = (-2.0 * np.pi * np.arange(config.columns) / config.columns)[:, None] - ahead
    elevation = config.ring_elevations
    directions = np.empty((config.columns, config.rings, 3))
    directions[..., 0] = np.cos(azimuth) * np.cos(elevation)
    directions[..., 1] = np.sin(azimuth) * np.cos(elevation)
    directions[..., 2] = np.sin(elevation)
    return directions


def _new_scan(count: int) -> Scan:
    return Scan(
        xyz=np.empty((count, 3), np.float32),
        range_m=np.empty(count, np.float32),
        label=np.empty(count, np.uint8),
        instance=np.empty(count, np.uint32),
        ring=np.empty(count, np.uint16),
        column=np.empty(count, np.uint16),
        t_ns=np.zeros(count, np.uint32),
    )


class IdealLidar:
    """An ideal LiDAR in a scene, whatever its configuration's signal. Use one per thread: each owns its buffers.

    The origin is the frame ``os1_lidar``. A ray returns the first surface between ``min_range`` and ``max_range``; a
    nearer surface occludes those behind it without a return; water and sky return nothing. All rays of a scan leave at
    the scan's stamp unless poses by column are given to ``scan``. Range is exact: no noise, no beam divergence.
    ``robot`` is what it sees of the robot that carries it (``experiment.robot_body.visible_parts``).
    """

    def __init__(self, config: LidarConfig, scene: Scene, robot: Sequence[Box | Cylinder] = ()) -> None:
        self.config = config
        self.scene = scene
        self._times_ns = ray_times_ns(config)
        returns = np.ones(256, np.bool_)
        returns[[int(label) for label in NO_RETURN]] = False
        lag = np.array(config.firing_offsets_ns or np.zeros(config.rings)) * (1e-9 * config.rate_hz * config.columns)
        self._beams = Beams(ray_directions(config), lag, config.min_range, config.max_range, returns)
        self._packet = new_packet(coherent=False)  # 12 % faster in the park, as fast in the forest
        shape = (config.columns, config.rings)
        self._out = LabelBuffers(np.zeros(shape, np.uint8), np.zeros(shape, np.uint32), np.zeros(shape, np.float32))
        self._robot = RobotScan(robot, config, self._beams.directions) if robot else None

    def scan(self, world_from_lidar: Array, stamp_ns: int = 0, number: int = 0) -> Scan:
        """Scan from a pose (4, 4), or of a sensor that moves from those at each column's beginning and at the end.

        With poses (columns + 1, 4, 4), ``t_ns`` spreads the columns evenly over one period, and each point is in the
        frame of the LiDAR when its ray leaves, as a real scanner reports it. Rings that fire later than their column
        begins have a pose between its pose and the next one, interpolated linearly. The stamp
        matters to a LiDAR with a ``pattern`` only, and the number of the scan to one with a signal.

        Raises:
            ValueError: another number of poses.
        """
        poses, moving = self._poses(world_from_lidar, stamp_ns)
        scene, out = self.scene, only_ranges(self._out)
        trace_beams(scene.rays.handle, scene.hits, None, self._packet, poses, self._beams, out)
        if self._robot is not None:
            seen = self._robot_before(self._robot, poses)
            rows = self._robot.column[seen], self._robot.ring[seen]
            self._out.depth[rows] = self._returned(self._robot.range_m[seen])
            self._out.label[rows], self._out.instance[rows] = int(Label.ROBOT), ROBOT_ID
        found = _new_scan(int(np.count_nonzero(self._out.depth)))
        collect_returns(self._beams.directions, self._out, found)
        if moving:
            found.t_ns[:] = self._times_ns[found.column, found.ring]
        return found

    def _poses(self, world_from_lidar: Array, stamp_ns: int) -> tuple[Array, bool]:
        """Return the poses (columns + 1, 4, 4) of a scan and whether the sensor moves, and aim the beams.

        Raises:
            ValueError: another number of poses.
        """
        config = self.config
        if config.pattern is not None:
            self._beams = self._beams._replace(directions=ray_directions(config, stamp_ns))
        moving = world_from_lidar.ndim == 3
        if moving and len(world_from_lidar) != config.columns + 1:
            raise ValueError(f"poses must be {config.columns + 1}, one more than columns, got {len(world_from_lidar)}")
        poses = np.ascontiguousarray(np.broadcast_to(world_from_lidar, (config.columns + 1, 4, 4)))
        return poses, moving

    def _robot_before(self, robot: RobotScan, poses: Array) -> Mask:
        """Whether nothing is before the robot on each of its rays (n,), which alone are traced again."""
        if self.config.pattern is not None:
            robot.aim(self._beams.directions)
        column, ring, range_m = robot.column, robot.ring, robot.range_m
        if not len(column):
            return np.zeros(0, np.bool_)
        own = poses[column] + self._beams.lag[ring][:, None, None] * (poses[column + 1] - poses[column])
        rays = np.ascontiguousarray(self._beams.directions[column, ring][:, None])
        beams = Beams(rays, np.zeros(1), 0.0, float(range_m.max()), np.ones(256, np.bool_))
        before = LabelBuffers(
            np.zeros((len(column), 1), np.uint8),
            np.zeros((len(column), 1), np.uint32),
            np.zeros((len(column), 1), np.float32),
        )
        scene, out = self.scene, only_ranges(before)
        trace_beams(scene.rays.handle, scene.hits, None, self._packet, own, beams, out)
        world_m = before.depth[:, 0]
        return np.asarray((world_m == 0.0) | (range_m < world_m))

    def _returned(self, range_m: Float32Array) -> Float32Array:
        """Ranges (n,) of the robot, 0 where it is too near for a return."""
        return np.where(range_m < self.config.min_range, np.float32(0.0), range_m)

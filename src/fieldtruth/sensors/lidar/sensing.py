# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The LiDAR: a rotating multi-beam scanner that labels every return with class and instance id."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.core.classes import NO_RETURN, Label
from fieldtruth.experiment.robot_body import Box, Cylinder
from fieldtruth.sense import embree
from fieldtruth.sense.hits import HitTable, LabelBuffers, classify, hit_top
from fieldtruth.sense.kernel import inlined, kernel
from fieldtruth.sense.packets import Packet, new_packet, set_ray
from fieldtruth.sense.robot_scan import RobotScan
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.beams import ray_times_ns, ring_elevations
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.patterns import pattern_directions
from fieldtruth.world.model import ROBOT_ID

_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.LANES // 4, 4
_OX, _OY, _OZ, _DX, _DY, _DZ = embree.ORG_X, embree.ORG_Y, embree.ORG_Z, embree.DIR_X, embree.DIR_Y, embree.DIR_Z
_FAR, _PRIM, _GEOM, _INST, _INST_PRIM = embree.TFAR, embree.PRIM_ID, embree.GEOM_ID, embree.INST_ID, embree.INST_PRIM_ID
_MISS = np.uint32(embree.MISS)
_intersect: Any = embree.intersect


class Scan(NamedTuple):
    """The returns of one revolution, ordered by column, then by ring.

    ``xyz`` (n, 3) [m] in the LiDAR's frame; ``range_m`` (n,) [m]; ``label`` class ids; ``instance`` instance ids;
    ``ring`` and ``column`` identify the ray; ``t_ns`` [ns] is the ray's time after the scan's stamp.
    """

    xyz: Float32Array
    range_m: Float32Array
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    ring: NDArray[np.uint16]
    column: NDArray[np.uint16]
    t_ns: NDArray[np.uint32]


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
    elevation = ring_elevations(config)
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


class Beams(NamedTuple):
    """Unit directions (columns, rings, 3), limits of range [m], and which classes return a pulse (256,).

    ``lag`` (rings,) is the share of a column's time after which a ring fires.
    """

    directions: Array
    lag: Array
    min_range: float
    max_range: float
    returns: Mask


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
        trace_beams(self.scene.rays.handle, self.scene.hits, self._packet, poses, self._beams, self._out)
        if self._robot is not None:
            seen = self._robot_before(self._robot, poses)
            rows = self._robot.column[seen], self._robot.ring[seen]
            self._out.depth[rows] = self._returned(self._robot.range_m[seen])
            self._out.label[rows], self._out.instance[rows] = int(Label.ROBOT), ROBOT_ID
        found = _new_scan(int(np.count_nonzero(self._out.depth)))
        _collect(self._beams.directions, self._out, found)
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
        trace_beams(self.scene.rays.handle, self.scene.hits, self._packet, own, beams, before)
        world_m = before.depth[:, 0]
        return np.asarray((world_m == 0.0) | (range_m < world_m))

    def _returned(self, range_m: Float32Array) -> Float32Array:
        """Ranges (n,) of the robot, 0 where it is too near for a return."""
        return np.where(range_m < self.config.min_range, np.float32(0.0), range_m)


@inlined
def entry(poses: Array, k: int, share: float, row: int, column: int) -> float:
    """Entry of a pose between poses ``k`` and ``k + 1``; with the share 0 exactly that of pose ``k``."""
    begin: float = poses[k, row, column]
    return begin if share == 0.0 else begin + share * (poses[k + 1, row, column] - begin)


@inlined
def aimed(poses: Array, k: int, share: float, beams: Beams, ring: int) -> tuple[float, float, float]:
    """Direction in the world of the beam of a ring that leaves ``share`` of a column's time after column ``k``."""
    a, b, c = beams.directions[k, ring, 0], beams.directions[k, ring, 1], beams.directions[k, ring, 2]
    return (
        entry(poses, k, share, 0, 0) * a + entry(poses, k, share, 0, 1) * b + entry(poses, k, share, 0, 2) * c,
        entry(poses, k, share, 1, 0) * a + entry(poses, k, share, 1, 1) * b + entry(poses, k, share, 1, 2) * c,
        entry(poses, k, share, 2, 0) * a + entry(poses, k, share, 2, 1) * b + entry(poses, k, share, 2, 2) * c,
    )


@inlined
def aim_tile(packet: Packet, poses: Array, beams: Beams, first_column: int, first_ring: int) -> None:
    """Set the rays of a tile of neighbouring columns and rings; what is beyond the last is not valid."""
    ray, words, valid, _ = packet
    directions, lag, _, max_range, _ = beams
    columns, rings, _ = directions.shape
    for lane in range(_LANES):
        column, ring = first_column + lane % _WIDTH, first_ring + lane // _WIDTH
        valid[lane] = -1 if column < columns and ring < rings else 0
        column, ring = min(column, columns - 1), min(ring, rings - 1)
        share = lag[ring]
        dx, dy, dz = aimed(poses, column, share, beams, ring)
        ray[_OX + lane] = entry(poses, column, share, 0, 3)
        ray[_OY + lane] = entry(poses, column, share, 1, 3)
        ray[_OZ + lane] = entry(poses, column, share, 2, 3)
        ray[_DX + lane], ray[_DY + lane], ray[_DZ + lane] = dx, dy, dz
        ray[_FAR + lane] = max_range
        words[_GEOM + lane], words[_INST + lane], words[_INST_PRIM + lane] = _MISS, _MISS, _MISS


@kernel
def trace_beams(
    scene: np.uint64, hits: HitTable, packet: Packet, poses: Array, beams: Beams, out: LabelBuffers
) -> None:
    """Trace all rays in tiles of neighbouring columns and rings; ``out.depth`` is the range, 0 without a return.

    Arrays are indexed and never sliced: Numba counts the references of each slice, which takes longer than its use.
    """
    label, instance, distance = out.label, out.instance, out.depth
    _, lag, min_range, max_range, returns = beams
    ray, words, valid, arguments = packet
    tops = hits.geometry_top
    columns, rings = distance.shape
    for lane in range(_LANES):
        set_ray(packet, lane, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, max_range)
    for first_column in range(0, columns, _WIDTH):
        for first_ring in range(0, rings, _HEIGHT):
            aim_tile(packet, poses, beams, first_column, first_ring)
            _intersect(valid.ctypes, scene, ray.ctypes, arguments.ctypes)
            for lane in range(_LANES):
                if valid[lane] == 0:
                    continue
                column, ring = first_column + lane % _WIDTH, first_ring + lane // _WIDTH
                distance[column, ring] = 0.0
                top = hit_top(tops, words, lane)
                range_m = ray[_FAR + lane]
                if top < 0 or range_m < min_range:
                    continue
                share = lag[ring]
                dx, dy, _ = aimed(poses, column, share, beams, ring)
                x = entry(poses, column, share, 0, 3) + range_m * dx
                y = entry(poses, column, share, 1, 3) + range_m * dy
                class_id, object_id = classify(hits, top, words[_PRIM + lane], x, y)
                if returns[class_id]:
                    distance[column, ring] = range_m
                    label[column, ring], instance[column, ring] = class_id, object_id


@kernel
def _collect(directions: Array, out: LabelBuffers, found: Scan) -> None:
    """List the returns by column, then by ring; NumPy's indexing takes eight times as long (1.3 ms of a scan of 25)."""
    labels, instances, distances = out.label, out.instance, out.depth
    xyz, range_m, label, instance, rings, columns, _ = found
    k = 0
    for column in range(distances.shape[0]):
        for ring in range(distances.shape[1]):
            distance = distances[column, ring]
            if distance == 0.0:
                continue
            for axis in range(3):
                xyz[k, axis] = directions[column, ring, axis] * distance
            range_m[k], label[k], instance[k] = distance, labels[column, ring], instances[column, ring]
            rings[k], columns[k] = ring, column
            k += 1

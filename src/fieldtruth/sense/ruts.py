# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ruts that wheels leave in soft soil: how deep they are at a time, and the ground with them in the ray tracer.

Around the ways of robots the ground is divided into blocks of finer cells, which lie in the triangles of the ground as
long as no wheel has passed. A wheel lowers their nodes, see ``kernels.ruts``; how deep, a soil says.

The depth at a knot, one each LEAN_KNOT_NS of simulated time, follows from the robots' poses until the knot before, and
changes linearly between two knots. So a rut is there 0.1 s to 0.2 s after the wheel. It is a pure function of poses.
"""

from collections.abc import Callable, Sequence
from threading import Lock
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from fieldtruth.core.arrays import Array, Float32Array, Index, Mask
from fieldtruth.experiment.rig import Rig, wheel_cylinders
from fieldtruth.kernels.ruts import CELLS, RutTable, press_ruts
from fieldtruth.sense.embree import Engine, RayScene
from fieldtruth.sense.leaning import LEAN_KNOT_NS, keep
from fieldtruth.sense.moving import KNOT_NS, KnotPoses
from fieldtruth.sense.pressed import beyond
from fieldtruth.world.model import Heightfield, World

FINEST: Final = 0.0125
"""Greatest side [m] of the cells, if those of the ground are at most CELLS times as large."""
ASIDE: Final = 1.75
"""Distance [m] from the planned tracks of wheels within which they leave ruts."""
_NEVER: Final = 1 << 62
_KNOTS: Final = LEAN_KNOT_NS // KNOT_NS

Soil = Callable[[Array, Array], Array]
"""Sinkage [m] of a wheel, and slope of the walls of its rut (n, 2), at x, y (n,) [m]."""


class Wheeled(NamedTuple):
    """A robot that leaves ruts: its rig, its poses at the knots of bodies, its way (m, 2) [m], and its soil."""

    rig: Rig
    poses: KnotPoses
    way: Array
    soil: Soil


class _Change(NamedTuple):
    """Nodes whose depth changes at a knot, and their depths [m] before and after."""

    node: Index
    before: Float32Array
    after: Float32Array


class Ruts:
    """Ruts in the ground of a world. Threads may share it.

    Args:
        world: the world.
        robots: what drives there.
    """

    version = 0
    """Number of drives that began."""

    def __init__(self, world: World, robots: Sequence[Wheeled]) -> None:
        self.field: Heightfield = world.terrain.surface
        self._robots = robots
        parts = 1
        while parts < CELLS and self.field.spacing / parts > FINEST:
            parts *= 2
        self.coarse = CELLS // parts
        """Cells of the ground on a side of a block."""
        self.cell = self.field.spacing / parts
        """Side [m] of a cell of a block."""
        block = np.full((np.array(self.field.heights.shape) - 1) // self.coarse, -1, np.int32)
        side = self.cell * CELLS
        middles = np.array([self.field.x0, self.field.y0]) + side * (np.argwhere(block < 0) + 0.5)
        own = np.zeros(block.size, np.bool_)
        for each in robots:
            tyre = each.rig.wheels
            reach = tyre.half_track + tyre.width / 2 + ASIDE + side
            own |= beyond(middles, [(each.way, reach)]) < 0.0
        block.ravel()[own] = np.arange(own.sum())
        self.removed: Mask = binary_erosion(block >= 0, np.ones((3, 3), np.bool_))
        """Blocks (i, j) that the ground has here alone: those at the border lie in its triangles, without a gap."""
        self.blocks = np.argwhere(block >= 0)
        """(blocks, 2) Column and row of each block."""
        shape = len(self.blocks), CELLS + 1, CELLS + 1
        self._table = RutTable(block, np.zeros(shape, np.float32), self.field.x0, self.field.y0, 1.0 / self.cell)
        self._lock = Lock()
        self.restart()

    def restart(self) -> None:
        """Forget all ruts, for other poses from time 0 on. Set ``end_ns`` to the stamp from which the robots stand."""
        self.version += 1
        self._changes: list[_Change] = []
        self._met: tuple[int, RutTable] | None = None
        self._knot, self._depth = 0, np.zeros_like(self._table.depth)
        self.end_ns = _NEVER

    def table(self, depth: Float32Array) -> RutTable:
        """Return the blocks with depths (blocks, CELLS + 1, CELLS + 1) [m]."""
        return self._table._replace(depth=depth)

    def nodes(self) -> Array:
        """Nodes (blocks, CELLS + 1, CELLS + 1, 3) [m] of the blocks without ruts."""
        at = self.blocks[:, None, None] * CELLS + np.moveaxis(np.indices((CELLS + 1, CELLS + 1)), 0, -1)
        nodes = np.empty((*at.shape[:-1], 3))
        # Nodes of the ground are at the same numbers as in the ground itself.
        nodes[..., :2] = (self.field.x0, self.field.y0) + self.field.spacing * (at * self.coarse / CELLS)
        nodes[..., 2] = self.field.height_at(nodes[..., 0], nodes[..., 1])
        return nodes

    def depths(self, stamps_ns: NDArray[np.int64]) -> Float32Array:
        """Depths (k, blocks, CELLS + 1, CELLS + 1) [m] at stamps (k,) [ns], which need not be knots."""
        low, rest = np.divmod(np.asarray(stamps_ns, np.int64), LEAN_KNOT_NS)
        knots, row = np.unique(np.concatenate([low, low + (rest > 0)]), return_inverse=True)
        with self._lock:
            known = [self._at(knot).copy() for knot in knots.tolist()]
        begin, end = np.split(row, 2)
        share = (rest / LEAN_KNOT_NS).astype(np.float32)
        return np.stack([known[a] + s * (known[b] - known[a]) for a, b, s in zip(begin, end, share, strict=True)])

    def at_knot(self, knot: int) -> RutTable:
        """Return the ruts at a knot, which are kept for the next calls: wheels meet them at each knot of bodies."""
        with self._lock:
            if self._met is None or self._met[0] != knot:
                self._met = knot, self.table(self._at(knot).copy())
            return self._met[1]

    def _at(self, knot: int) -> Float32Array:
        """Depths at a knot, valid until the next call."""
        while len(self._changes) < knot:
            self._advance(len(self._changes) + 1)
        for node, _, depth in self._changes[self._knot : knot]:
            self._depth.ravel()[node] = depth
        for node, depth, _ in reversed(self._changes[knot : self._knot]):
            self._depth.ravel()[node] = depth
        self._knot = knot
        return self._depth

    def _advance(self, knot: int) -> None:
        """Find what changes at the next knot: what wheels press from two knots before it to one before."""
        before = self._at(knot - 1)
        depth = before.copy()
        if knot > 1:
            for each in self._robots:
                # A bag has no pose at time 0: that of the first knot of bodies stands for it.
                stamps = (knot - 2) * LEAN_KNOT_NS + np.arange(_KNOTS + 1) * KNOT_NS
                wheels = _wheels(each, each.poses(np.clip(stamps, KNOT_NS, self.end_ns)))
                tyre = each.rig.wheels
                press_ruts(self.table(depth), wheels, tyre.width / 2, tyre.radius)
        node = np.flatnonzero(depth != before)
        self._changes.append(_Change(node, before.ravel()[node], depth.ravel()[node]))


def _wheels(robot: Wheeled, poses: Array) -> Array:
    """Wheels (n, 7) of a robot on its way through poses (k, 4, 4), as ``press_ruts`` takes them."""
    tyre = robot.rig.wheels
    local = np.array([wheel.centre for wheel in wheel_cylinders(robot.rig)]) - (0.0, 0.0, tyre.radius)
    at = np.einsum("kij,wj->kwi", poses[:, :2, :3], local) + poses[:, None, :2, 3]
    heading = poses[1:, None, :2, 0] / np.linalg.norm(poses[1:, None, :2, 0], axis=-1, keepdims=True)
    moved = ((at[1:] - at[:-1]) * heading).sum(axis=-1)
    x, y = at[1:].reshape(-1, 2).T
    along = np.broadcast_to(heading, at[1:].shape).reshape(-1, 2)
    return np.column_stack([x, y, along, moved.ravel(), robot.soil(x, y)])


class RuttedGround(NamedTuple):
    """The ground with ruts at knots, or at one stamp, as rays meet it, and as photographs shade it."""

    rays: RayScene
    table: RutTable


class TracedRuts:
    """Ruts in the ray tracer. Threads may share it. ``number`` is that of the ground's geometry.

    Each block is an Embree scene: that of a block is built again where its depth changes.
    """

    def __init__(self, ruts: Ruts, engine: Engine, number: int) -> None:
        self.ruts, self._engine, self._number = ruts, engine, number
        self._nodes = ruts.nodes()
        self._depth = np.full(self._nodes.shape[:-1], np.nan, np.float32)
        self._still: list[RayScene] = [RayScene(engine)] * len(self._nodes)
        self._made, self._lock = dict[tuple[int, ...], RuttedGround](), Lock()

    def at(self, stamps_ns: NDArray[np.int64]) -> RuttedGround:
        """Return the ground at knots (k,) [ns] that follow one another, or at one stamp."""
        key = self.ruts.version, *stamps_ns.tolist()
        with self._lock:
            if key not in self._made:
                keep(self._made, key, self._make(self.ruts.depths(stamps_ns)), most=3)
            return self._made[key]

    def _make(self, depths: Float32Array) -> RuttedGround:
        changes = (depths != depths[0]).any(axis=(0, 2, 3))
        for row in np.flatnonzero(~changes & (depths[0] != self._depth).any(axis=(1, 2))).tolist():
            self._still[row], self._depth[row] = self._block(row, depths[:1, row]), depths[0, row]
        scenes = self._still.copy()
        for row in np.flatnonzero(changes).tolist():
            scenes[row] = self._block(row, depths[:, row])
        rays, count = RayScene(self._engine), len(scenes)
        columns = np.tile(np.eye(4)[:, :3].ravel().astype(np.float32), (1, count, 1))
        rays.add_instances(scenes, np.arange(count, dtype=np.uint32), columns, number=self._number)
        return RuttedGround(rays.commit(), self.ruts.table(depths[0].copy()))

    def _block(self, row: int, depths: Float32Array) -> RayScene:
        """Build the Embree scene of a block with depths (k, CELLS + 1, CELLS + 1) [m] evenly from time 0 to 1."""
        nodes = np.repeat(self._nodes[None, row], len(depths), axis=0)
        nodes[..., 2] -= depths
        scene = RayScene(self._engine)
        scene.add_grids(nodes[:, None])
        return scene.commit()


def ground_tiles(ruts: Ruts, nodes: Float32Array) -> Float32Array:
    """Tiles (n, c + 1, c + 1, 3) of the nodes (nx, ny, 3) of the ground that the blocks do not replace."""
    nx, ny, _ = nodes.shape
    side = ruts.coarse
    left = np.ones((-(-(nx - 1) // side), -(-(ny - 1) // side)), np.bool_)
    left[: ruts.removed.shape[0], : ruts.removed.shape[1]] &= ~ruts.removed
    first, along = np.argwhere(left) * side, np.arange(side + 1)
    i, j = np.minimum(first[:, :1] + along, nx - 1), np.minimum(first[:, 1:] + along, ny - 1)
    return np.asarray(nodes[i[:, :, None], j[:, None, :]])

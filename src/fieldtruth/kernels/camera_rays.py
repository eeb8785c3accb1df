# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Batches of camera rays: a block of pixels is traced, then labelled and shaded in separate passes.

A pass over thousands of rays lets each kernel unpack its tables once, and lets shadow rays be packed densely.
"""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.packets import (
    HitTable,
    IntArray,
    LabelBuffers,
    NormalBuffers,
    Packet,
    SceneRays,
    classify,
    hit_mover,
    hit_top,
    set_ray,
    set_time,
    trace_packet,
)


class Intrinsics(NamedTuple):
    """Intrinsics [pixel] in ROS's convention: the centre of the upper left pixel is (0, 0)."""

    fx: float
    fy: float
    cx: float
    cy: float


NO_TABLE: Final[Float32Array] = np.zeros((0, 0, 4), np.float32)
"""Of a pinhole."""
BLOCK_WIDTH: Final = 128
BLOCK_HEIGHT: Final = 32
"""Pixels that are traced and shaded at once. What neighbours above and below need is still in the cache then: strips of
four whole rows were measured to take 7 % longer."""
BLOCK: Final = BLOCK_WIDTH * BLOCK_HEIGHT
_LANES, _WIDTH, _HEIGHT = packets.LANES, packets.TILE_WIDTH, packets.TILE_HEIGHT
_DX, _DY, _DZ, _GEOM, _INST = packets.DIR_X, packets.DIR_Y, packets.DIR_Z, packets.GEOM_ID, packets.INST_ID
_MISS = np.uint32(packets.MISS)
_TINY = np.float32(1e-9)
_NX, _NY, _NZ = packets.NG_X, packets.NG_Y, packets.NG_Z
_FAR, _PRIM, _U, _V = packets.TFAR, packets.PRIM_ID, packets.HIT_U, packets.HIT_V


class View(NamedTuple):
    """A camera at a pose, as kernels take it."""

    pose: Array  # (4, 4) world_from_optical
    intrinsics: Intrinsics
    far: float  # [m] along the ray
    table: Float32Array = NO_TABLE  # (h, w, 4) see ray_table; empty for a pinhole: ``intrinsics`` has it all
    time: float = 0.0  # of its rays, see SceneRays


class RayBatch(NamedTuple):
    """n rays through image points and what they hit. Where ``top`` is -1 they hit nothing."""

    image: Float32Array  # (2, n) image point (u, v) [pixel]
    direction: Float32Array  # (3, n) unit, world frame; 0 where the lens has no ray
    cosine: Array  # (n,) of the angle to the optical axis; for lenses whose depth is the range, 1
    top: IntArray  # (n,) row of the top-level geometry, see HitTable
    mover: IntArray  # (n,) number of the body or plant, see SceneRays; -1 for what stands still
    primitive: IntArray  # (n,) triangle of its mesh
    barycentric: Float32Array  # (2, n) weights of the triangle's second and third vertex
    foreshortening: Float32Array  # (n,) see seen_over_map
    distance: Float32Array  # (n,) [m] along the ray
    point: Float32Array  # (3, n) [m] world frame
    normal: Float32Array  # (3, n) of the triangle in its mesh's frame, of any length; (3, 0) if not wanted


def new_batch(count: int, *, normals: bool = False) -> RayBatch:
    """Allocate a batch of at least ``count`` rays. Threads must not share it."""
    n = -(-count // _LANES) * _LANES
    return RayBatch(
        image=np.zeros((2, n), np.float32),
        direction=np.zeros((3, n), np.float32),
        cosine=np.zeros(n),
        top=np.zeros(n, np.int32),
        mover=np.full(n, -1, np.int32),
        primitive=np.zeros(n, np.int32),
        barycentric=np.zeros((2, n), np.float32),
        foreshortening=np.zeros(n, np.float32),
        distance=np.zeros(n, np.float32),
        point=np.zeros((3, n), np.float32),
        normal=np.zeros((3, n if normals else 0), np.float32),
    )


@kernel
def set_pixel_block(top: int, left: int, height: int, width: int, image: Float32Array) -> int:
    """Set the image points to the pixel centres of a block, or of its part in the image, tile by tile.

    Returns their number. A tile at the right or lower border may have points outside the image.
    """
    k = 0
    for upper in range(top, min(top + BLOCK_HEIGHT, height), _HEIGHT):
        for first in range(left, min(left + BLOCK_WIDTH, width), _WIDTH):
            for lane in range(_LANES):
                image[0, k], image[1, k] = first + lane % _WIDTH, upper + lane // _WIDTH
                k += 1
    return k


@inlined
def seen_over_map(ray: Float32Array, lane: int) -> np.float32:
    """Area of a small piece of the surface that was hit as the ray sees it, over its area on the map."""
    nx, ny, nz = ray[_NX + lane], ray[_NY + lane], ray[_NZ + lane]
    facing = nx * ray[_DX + lane] + ny * ray[_DY + lane] + nz * ray[_DZ + lane]
    return abs(facing) / max(abs(nz), _TINY)  # type: ignore[no-any-return]


@inlined
def _slope(table: Float32Array, v: int, u: int, down: int, right: int) -> tuple[np.float32, np.float32, np.float32]:
    """Change of the direction from a pixel to the next one in a direction, or from the one before it.

    It is 0 where the lens has neither.
    """
    for sign in (1, -1):
        i, j = v + sign * down, u + sign * right
        if 0 <= i < table.shape[0] and 0 <= j < table.shape[1] and table[i, j, 3] != np.float32(0.0):
            x, y, z = table[i, j, 0] - table[v, u, 0], table[i, j, 1] - table[v, u, 1], table[i, j, 2] - table[v, u, 2]
            turn = np.float32(sign)
            return turn * x, turn * y, turn * z
    return np.float32(0.0), np.float32(0.0), np.float32(0.0)


@kernel
def set_directions(pose: Array, table: Float32Array, count: int, batch: RayBatch) -> None:
    """Set ``direction`` and ``cosine`` of a batch, in whole packets, from a table; 0 where the lens has no ray.

    Between pixel centres directions are interpolated linearly, with an error of at most an eighth of the second
    difference of the table along rows and columns, and a quarter of the mixed one.
    """
    image, cosine, direction = batch.image, batch.cosine, batch.direction
    height, width, _ = table.shape
    half, zero, n = np.float32(0.5), np.float32(0.0), -(-count // _LANES) * _LANES
    for k in range(n):
        u, v = min(max(int(image[0, k] + half), 0), width - 1), min(max(int(image[1, k] + half), 0), height - 1)
        x, y, z = table[v, u, 0], table[v, u, 1], table[v, u, 2]
        cosine[k] = table[v, u, 3]
        du, dv = image[0, k] - np.float32(u), image[1, k] - np.float32(v)
        if (du != zero or dv != zero) and table[v, u, 3] != zero:
            ax, ay, az = _slope(table, v, u, 0, 1 if du > zero else -1)
            bx, by, bz = _slope(table, v, u, 1 if dv > zero else -1, 0)
            du, dv = abs(du), abs(dv)
            x, y, z = x + du * ax + dv * bx, y + du * ay + dv * by, z + du * az + dv * bz
            scale = np.float32(1.0) / np.sqrt(x * x + y * y + z * z)
            x, y, z = x * scale, y * scale, z * scale
        direction[0, k], direction[1, k], direction[2, k] = x, y, z
    m00, m01, m02 = pose[0, 0], pose[0, 1], pose[0, 2]
    m10, m11, m12 = pose[1, 0], pose[1, 1], pose[1, 2]
    m20, m21, m22 = pose[2, 0], pose[2, 1], pose[2, 2]
    for k in range(n):
        a, b, c = np.float64(direction[0, k]), np.float64(direction[1, k]), np.float64(direction[2, k])
        direction[0, k] = m00 * a + m01 * b + m02 * c
        direction[1, k] = m10 * a + m11 * b + m12 * c
        direction[2, k] = m20 * a + m21 * b + m22 * c


@inlined
def gradients(view: View, batch: RayBatch, k: int, normal: tuple[float, float, float]) -> tuple[float, float]:
    """Change per pixel, along u and along v, of a ray's component along a unit normal to it in the world frame."""
    pose, table = view.pose, view.table
    x = normal[0] * pose[0, 0] + normal[1] * pose[1, 0] + normal[2] * pose[2, 0]
    y = normal[0] * pose[0, 1] + normal[1] * pose[1, 1] + normal[2] * pose[2, 1]
    if len(table) == 0:
        return x * batch.cosine[k] / view.intrinsics.fx, y * batch.cosine[k] / view.intrinsics.fy
    z = normal[0] * pose[0, 2] + normal[1] * pose[1, 2] + normal[2] * pose[2, 2]
    u = min(max(int(batch.image[0, k] + np.float32(0.5)), 0), table.shape[1] - 1)
    v = min(max(int(batch.image[1, k] + np.float32(0.5)), 0), table.shape[0] - 1)
    right, down = _slope(table, v, u, 0, 1), _slope(table, v, u, 1, 0)
    return x * right[0] + y * right[1] + z * right[2], x * down[0] + y * down[1] + z * down[2]


@inlined
def _aim(
    pose: Array, lens: Intrinsics, first: int, image: Float32Array, cosine: Array, direction: Float32Array
) -> None:
    """Set the directions of a packet of a pinhole's rays, and the cosines of their angles to its axis."""
    per_fx, per_fy, cx, cy = 1.0 / lens.fx, 1.0 / lens.fy, lens.cx, lens.cy
    m00, m01, m02 = pose[0, 0], pose[0, 1], pose[0, 2]
    m10, m11, m12 = pose[1, 0], pose[1, 1], pose[1, 2]
    m20, m21, m22 = pose[2, 0], pose[2, 1], pose[2, 2]
    for k in range(first, first + _LANES):
        a, b = (image[0, k] - cx) * per_fx, (image[1, k] - cy) * per_fy
        scale = 1.0 / np.sqrt(1.0 + a * a + b * b)
        cosine[k] = scale
        direction[0, k] = (m00 * a + m01 * b + m02) * scale
        direction[1, k] = (m10 * a + m11 * b + m12) * scale
        direction[2, k] = (m20 * a + m21 * b + m22) * scale


@kernel
def trace(scene: SceneRays, tops: IntArray, packet: Packet, view: View, batch: RayBatch, count: int) -> None:
    """Trace the rays through the first ``count`` image points of a batch, LANES neighbours at a time.

    ``tops`` is the ``geometry_top`` of a HitTable. Each inner loop writes few fields of the packet, so that it is
    vectorized; what all rays share is set once.
    """
    ray, words, valid = packet.ray, packet.words, packet.valid
    image, direction, cosine, top, mover, primitive, barycentric, foreshortening, distance, point, normal = batch
    pose, lens, far, table, time = view
    x0, y0, z0 = np.float32(pose[0, 3]), np.float32(pose[1, 3]), np.float32(pose[2, 3])
    has_table = len(table) > 0
    if has_table:
        set_directions(pose, table, count, batch)
    for lane in range(_LANES):
        set_ray(packet, lane, (x0, y0, z0), (0.0, 0.0, 1.0), 0.0, far)
    set_time(packet, time)
    for first in range(0, count, _LANES):
        if has_table:
            for lane in range(_LANES):
                valid[lane] = -1 if cosine[first + lane] != 0.0 else 0
        else:
            _aim(pose, lens, first, image, cosine, direction)
        for lane in range(_LANES):
            ray[_DX + lane] = direction[0, first + lane]
            ray[_DY + lane] = direction[1, first + lane]
            ray[_DZ + lane] = direction[2, first + lane]
            ray[_FAR + lane] = far
            words[_GEOM + lane], words[_INST + lane] = _MISS, _MISS
        for lane in range(count - first, _LANES):
            valid[lane] = 0
        trace_packet(scene, packet)
        for lane in range(_LANES):
            k = first + lane
            t = ray[_FAR + lane]
            distance[k] = t
            point[0, k], point[1, k] = x0 + t * direction[0, k], y0 + t * direction[1, k]
            point[2, k] = z0 + t * direction[2, k]
            barycentric[0, k], barycentric[1, k] = ray[_U + lane], ray[_V + lane]
            foreshortening[k], primitive[k] = seen_over_map(ray, lane), np.int32(words[_PRIM + lane])
            top[k], mover[k] = hit_top(tops, words, lane), hit_mover(scene, words, lane)
        if normal.shape[1] > 0:
            for lane in range(_LANES):
                normal[0, first + lane] = ray[_NX + lane]
                normal[1, first + lane] = ray[_NY + lane]
                normal[2, first + lane] = ray[_NZ + lane]


@kernel
def label_pixels(hits: HitTable, batch: RayBatch, count: int, out: LabelBuffers) -> None:
    """Write class, instance id and depth [m] of a batch of pixel centres into the images."""
    image, tops, primitive, point = batch.image, batch.top, batch.primitive, batch.point
    distance, cosine = batch.distance, batch.cosine
    label, instance, depth = out.label, out.instance, out.depth
    height, width = label.shape
    for k in range(count):
        u, v, top = int(image[0, k]), int(image[1, k]), tops[k]
        if u >= width or v >= height:
            continue
        label[v, u], instance[v, u] = classify(hits, top, primitive[k], point[0, k], point[1, k])
        depth[v, u] = distance[k] * cosine[k] if top >= 0 else 0.0


@kernel
def normal_pixels(pose: Array, batch: RayBatch, count: int, out: NormalBuffers) -> None:
    """Write unit normals towards the camera, in its frame, of a batch of pixel centres; 0 where nothing was hit.

    They are those of the triangles, without interpolation between vertices.
    """
    image, tops, direction, normal = batch.image, batch.top, batch.direction, batch.normal
    height, width, _ = out.image.shape
    for k in range(count):
        u, v, top = int(image[0, k]), int(image[1, k]), tops[k]
        if u >= width or v >= height:
            continue
        out.image[v, u, 0], out.image[v, u, 1], out.image[v, u, 2] = 0.0, 0.0, 0.0
        if top < 0:
            continue
        a, b, c = np.float64(normal[0, k]), np.float64(normal[1, k]), np.float64(normal[2, k])
        axes = out.axes[top]
        x = axes[0, 0] * a + axes[0, 1] * b + axes[0, 2] * c
        y = axes[1, 0] * a + axes[1, 1] * b + axes[1, 2] * c
        z = axes[2, 0] * a + axes[2, 1] * b + axes[2, 2] * c
        length = np.sqrt(x * x + y * y + z * z)
        away = x * direction[0, k] + y * direction[1, k] + z * direction[2, k] > 0.0
        scale = 0.0 if length == 0.0 else (-1.0 if away else 1.0) / length
        for axis in range(3):
            out.image[v, u, axis] = (pose[0, axis] * x + pose[1, axis] * y + pose[2, axis] * z) * scale


@kernel
def label_image(
    scene: SceneRays, hits: HitTable, packet: Packet, view: View, batch: RayBatch, out: LabelBuffers
) -> None:
    """Write class, instance id, depth and, if wanted, normal of the ray through every pixel's centre."""
    height, width = out.label.shape
    for upper in range(0, height, BLOCK_HEIGHT):
        for left in range(0, width, BLOCK_WIDTH):
            count = set_pixel_block(upper, left, height, width, batch.image)
            trace(scene, hits.geometry_top, packet, view, batch, count)
            label_pixels(hits, batch, count, out)
            if len(out.normal.image) > 0:
                normal_pixels(view.pose, batch, count, out.normal)

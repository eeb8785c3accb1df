# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images: labels and shading of the ray through each pixel's centre, wires by their width, more rays at edges.

A moving camera has a pose of its own for each strip of STRIP rows, and for each of the sub-frames that are averaged.
"""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.kernels import packets
from fieldtruth.kernels.camera_rays import (
    BLOCK,
    BLOCK_HEIGHT,
    BLOCK_WIDTH,
    View,
    label_pixels,
    normal_pixels,
    set_pixel_block,
    trace,
)
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.light import Shading
from fieldtruth.kernels.packets import IntArray, LabelBuffers, set_time
from fieldtruth.kernels.robot import place_robot
from fieldtruth.kernels.shading import ShadingBuffers, new_shading_buffers, shade_batch
from fieldtruth.kernels.wires import draw_wires, look_behind

_LANES = packets.LANES


@kernel(inner=True)
def shade_view(shading: Shading, buffers: ShadingBuffers, view: View, count: int) -> None:
    """Compute ``colour`` of the traced rays of a view and of wires; ``batch`` becomes that of what is behind them."""
    pixel = 1.0 / view.intrinsics.fx
    wires = len(shading.wires.top) > 0
    set_time(buffers.shadow, view.time)
    if len(shading.robot.parts) > 0:
        place_robot(shading.robot, view.pose, buffers.scratch.robot)
    if wires:
        look_behind(shading, buffers, view, count)
    shade_batch(shading, buffers, count, pixel)
    if wires:
        draw_wires(shading, buffers.batch, view, count, buffers.colour)


EDGE_CONTRAST: Final = 0.27
"""Difference of the square roots of neighbours' luminance above which a pixel at an edge is refined."""
EDGE_STEP: Final = 0.01
"""Relative step in depth that makes an edge."""
_CONTRAST, _STEP, _TILE = np.float32(EDGE_CONTRAST), np.float32(EDGE_STEP), 4


class EdgeBuffers(NamedTuple):
    """Memory for the edges of one image. Threads must not share it."""

    marked: Mask  # (h, w)
    pixels: IntArray  # (h * w, 2) row and column


def new_edge_buffers(height: int, width: int) -> EdgeBuffers:
    """Allocate memory for images of a size [pixel]."""
    return EdgeBuffers(np.zeros((height, width), np.bool_), np.zeros((height * width, 2), np.int32))


@kernel
def find_edges(linear: Float32Array, labels: LabelBuffers, out: EdgeBuffers, rows: int) -> int:
    """List pixels that differ in brightness from a neighbour on another surface; returns their number.

    Another surface is another instance, or a step in depth of more than EDGE_STEP: the contrast of a texture is no
    edge. The list is in tiles of blocks that are ``rows`` high, so that rays that are traced together are neighbours.
    """
    _mark_edges(linear, labels, out.marked)
    height, width = out.marked.shape
    count = 0
    for top in range(0, height, rows):
        for first in range(0, width, BLOCK_HEIGHT):
            for upper in range(top, min(top + rows, height), _TILE):
                for left in range(first, min(first + BLOCK_HEIGHT, width), _TILE):
                    count = _list_tile(out, upper, left, count)
    return count


@inlined
def _list_tile(out: EdgeBuffers, upper: int, left: int, count: int) -> int:
    """Append the marked pixels of a tile to the list; returns the number of all."""
    marked, pixels = out
    height, width = marked.shape
    for v in range(upper, min(upper + _TILE, height)):
        for u in range(left, min(left + _TILE, width)):
            if marked[v, u]:
                pixels[count, 0], pixels[count, 1] = v, u
                count += 1
    return count


@inlined
def _apart(instance: NDArray[np.uint32], depth: Float32Array, v: int, u: int, row: int, column: int) -> bool:
    """Return whether pixel (v, u) shows another surface than its neighbour."""
    here = depth[v, u]
    return instance[v, u] != instance[row, column] or abs(here - depth[row, column]) > _STEP * here  # type: ignore[no-any-return]


@kernel(allocates=True)
def _mark_edges(linear: Float32Array, labels: LabelBuffers, marked: Mask) -> None:
    instance, depth = labels.instance, labels.depth
    height, width = instance.shape
    bright, white = np.empty((2, width), np.float32), np.float32(1.0)
    marked[:] = False
    for v in range(height):
        row, above = v & 1, (v + 1) & 1
        for u in range(width):
            r, g, b = linear[v, u, 0], linear[v, u, 1], linear[v, u, 2]
            bright[row, u] = np.sqrt(min(np.float32(0.2) * r + np.float32(0.7) * g + np.float32(0.1) * b, white))
        for u in range(1, width):  # contrast is the rarer of the two conditions
            if abs(bright[row, u] - bright[row, u - 1]) > _CONTRAST and _apart(instance, depth, v, u, v, u - 1):
                marked[v, u], marked[v, u - 1] = True, True
        for u in range(width if v > 0 else 0):
            if abs(bright[row, u] - bright[above, u]) > _CONTRAST and _apart(instance, depth, v, u, v - 1, u):
                marked[v, u], marked[v - 1, u] = True, True


EXTRA_SAMPLES: Final = 2
"""Rays per pixel at edges, in addition to the one through the pixel's centre."""
_TURNS: Final = 12
_ANGLES = 2.0 * np.pi * np.arange(_TURNS) / _TURNS + 0.3
_OFFSETS = (0.38 * np.stack((np.cos(_ANGLES), np.sin(_ANGLES)), axis=-1)).astype(np.float32)  # [pixel]


class Framebuffer(NamedTuple):
    """Working memory for images of one size. Threads must not share it."""

    shading: ShadingBuffers
    linear: Float32Array  # (h, w, 3) linear and exposed
    edges: EdgeBuffers


def new_framebuffer(height: int, width: int) -> Framebuffer:
    """Allocate memory for images of a size [pixel]."""
    return Framebuffer(
        shading=new_shading_buffers(BLOCK),
        linear=np.zeros((height, width, 3), np.float32),
        edges=new_edge_buffers(height, width),
    )


@kernel
def render_linear(shading: Shading, framebuffer: Framebuffer, view: View, labels: LabelBuffers) -> None:
    """Render labels, and the light of the photograph, ``framebuffer.linear``."""
    buffers, linear, edges = framebuffer
    height, width, _ = linear.shape
    batch, colour = buffers.batch, buffers.colour
    for upper in range(0, height, BLOCK_HEIGHT):
        for left in range(0, width, BLOCK_WIDTH):
            count = set_pixel_block(upper, left, height, width, batch.image)
            trace(shading.scene, shading.hits.geometry_top, buffers.packet, view, batch, count)
            label_pixels(shading.hits, batch, count, labels)
            if len(labels.normal.image) > 0:
                normal_pixels(view.pose, batch, count, labels.normal)
            shade_view(shading, buffers, view, count)
            store(batch.image, colour, count, linear)
    refine(shading, framebuffer, view, 0, find_edges(linear, labels, edges, BLOCK_HEIGHT))


@kernel
def store(image: Float32Array, colour: Float32Array, count: int, linear: Float32Array) -> None:
    """Write the colours of a batch of pixel centres into ``linear`` (h, w, 3)."""
    height, width, _ = linear.shape
    for k in range(count):
        u, v = int(image[0, k]), int(image[1, k])
        if u >= width or v >= height:
            continue
        linear[v, u, 0], linear[v, u, 1], linear[v, u, 2] = colour[k, 0], colour[k, 1], colour[k, 2]


@kernel(inner=True)
def refine(shading: Shading, framebuffer: Framebuffer, view: View, start: int, end: int) -> None:
    """Average pixels ``start`` to ``end`` of those at edges over the ray through the centre and EXTRA_SAMPLES others.

    Samples are clipped at white first, so that one glint does not dominate its pixel.
    """
    buffers, linear, edges = framebuffer.shading, framebuffer.linear, framebuffer.edges.pixels
    image, colour = buffers.batch.image, buffers.colour
    white, share = np.float32(2.0), np.float32(1.0 / (EXTRA_SAMPLES + 1))
    at_once = image.shape[1] // EXTRA_SAMPLES
    for first in range(start, end, at_once):
        pixels = min(at_once, end - first)
        for k in range(pixels):
            v, u = edges[first + k, 0], edges[first + k, 1]
            turn = (3 * u + 5 * v) % _TURNS
            for s in range(EXTRA_SAMPLES):
                row = (turn + s * _TURNS // EXTRA_SAMPLES) % _TURNS
                image[0, k * EXTRA_SAMPLES + s] = u + _OFFSETS[row, 0]
                image[1, k * EXTRA_SAMPLES + s] = v + _OFFSETS[row, 1]
        trace(shading.scene, shading.hits.geometry_top, buffers.packet, view, buffers.batch, pixels * EXTRA_SAMPLES)
        shade_view(shading, buffers, view, pixels * EXTRA_SAMPLES)
        for k in range(pixels):
            v, u = edges[first + k, 0], edges[first + k, 1]
            for channel in range(3):
                total = min(linear[v, u, channel], white)
                for s in range(EXTRA_SAMPLES):
                    total += min(colour[k * EXTRA_SAMPLES + s, channel], white)
                linear[v, u, channel] = total * share


STRIP: Final = 4
"""Rows with the same pose, a packet of rays high: at 60 deg/s, 1000 pixels of focal length and 20 ms for 720 rows a
strip is 0.12 pixels from the next one."""
_COLUMNS: Final = BLOCK // STRIP
_TILE_WIDTH, _TILE_HEIGHT = packets.TILE_WIDTH, packets.TILE_HEIGHT
_BRIGHTEST: Final = 8.0
"""Light of a sample, so that one glint does not dominate its pixel; the ideal camera's curve is white from there."""


@kernel
def _set_strip(top: int, left: int, height: int, width: int, dx: float, dy: float, image: Float32Array) -> int:
    """Set the image points to the pixel centres of a strip's next columns, moved by dx, dy; returns their number."""
    k = 0
    for upper in range(top, min(top + STRIP, height), _TILE_HEIGHT):
        for first in range(left, min(left + _COLUMNS, width), _TILE_WIDTH):
            for lane in range(_LANES):
                image[0, k], image[1, k] = first + lane % _TILE_WIDTH + dx, upper + lane // _TILE_WIDTH + dy
                k += 1
    return k


@kernel
def render_strips(
    shading: Shading, framebuffer: Framebuffer, view: View, poses: Array, times: Array, labels: LabelBuffers
) -> None:
    """Render the light ``framebuffer.linear`` like ``render_linear``, with poses (strips, 4, 4) world_from_optical.

    ``times`` (strips,) are those of their rays.

    Labels are those that the moving camera sees; edges need them.
    """
    buffers, linear, edges = framebuffer
    height, width, _ = linear.shape
    batch = buffers.batch
    for upper in range(0, height, STRIP):
        own = View(poses[upper // STRIP], view.intrinsics, view.far, view.table, times[upper // STRIP])
        for left in range(0, width, _COLUMNS):
            count = _set_strip(upper, left, height, width, 0.0, 0.0, batch.image)
            trace(shading.scene, shading.hits.geometry_top, buffers.packet, own, batch, count)
            label_pixels(shading.hits, batch, count, labels)
            shade_view(shading, buffers, own, count)
            store(batch.image, buffers.colour, count, linear)
    count, start = find_edges(linear, labels, edges, STRIP), 0
    while start < count:
        strip, end = edges.pixels[start, 0] // STRIP, start
        while end < count and edges.pixels[end, 0] // STRIP == strip:
            end += 1
        own = View(poses[strip], view.intrinsics, view.far, view.table, times[strip])
        refine(shading, framebuffer, own, start, end)
        start = end


@kernel
def render_mean(
    shading: Shading, framebuffer: Framebuffer, view: View, poses: Array, times: Array, offsets: Array
) -> None:
    """Render the mean light ``framebuffer.linear`` of n sub-frames with poses (n, strips, 4, 4) world_from_optical.

    ``times`` (n, strips) are those of their rays.

    Sub-frame i has rays through points that are ``offsets[i]`` (n, 2) [pixel] from the pixel centres, which smooths
    edges instead of further rays there.
    """
    buffers, linear = framebuffer.shading, framebuffer.linear
    height, width, _ = linear.shape
    batch, colour = buffers.batch, buffers.colour
    share, brightest = np.float32(1.0 / len(poses)), np.float32(_BRIGHTEST)
    linear[:] = np.float32(0.0)
    for frame in range(len(poses)):
        dx, dy = offsets[frame, 0], offsets[frame, 1]
        for upper in range(0, height, STRIP):
            strip = upper // STRIP
            own = View(poses[frame, strip], view.intrinsics, view.far, view.table, times[frame, strip])
            for left in range(0, width, _COLUMNS):
                count = _set_strip(upper, left, height, width, dx, dy, batch.image)
                trace(shading.scene, shading.hits.geometry_top, buffers.packet, own, batch, count)
                shade_view(shading, buffers, own, count)
                _add(batch.image, colour, count, dx, dy, share, brightest, linear)


@kernel
def _add(
    image: Float32Array,
    colour: Float32Array,
    count: int,
    dx: float,
    dy: float,
    share: np.float32,
    brightest: np.float32,
    linear: Float32Array,
) -> None:
    height, width, _ = linear.shape
    for k in range(count):
        u, v = int(image[0, k] - dx + 0.5), int(image[1, k] - dy + 0.5)
        if u >= width or v >= height:
            continue
        for channel in range(3):
            linear[v, u, channel] += share * min(colour[k, channel], brightest)


@kernel
def render_points(shading: Shading, buffers: ShadingBuffers, view: View, count: int, pixel: float) -> None:
    """Compute ``buffers.colour`` of the first ``count`` image points of the batch, each ``pixel`` [rad] wide."""
    trace(shading.scene, shading.hits.geometry_top, buffers.packet, view, buffers.batch, count)
    set_time(buffers.shadow, view.time)
    shade_batch(shading, buffers, count, pixel)


_ORDERS: Final = 200


def strips_of(height: int) -> int:
    """Number of strips of an image."""
    return -(-height // STRIP)


@cache
def offsets_of(count: int) -> Array:
    """Points (n, 2) [pixel] of a pixel around its centre: one in each row and column of n x n (Latin hypercube).

    They are in the order that least correlates with time: if they drifted over the exposure, the blur would change.
    """
    rng, time, best = np.random.default_rng(count), np.arange(count), np.zeros((3, count))
    least = np.inf
    for _ in range(_ORDERS if count > 1 else 0):
        found = np.stack([time, rng.permutation(count), rng.permutation(count)])
        drift = float(np.abs(np.corrcoef(found)[np.triu_indices(3, 1)]).sum())
        if drift < least:
            best, least = found, drift
    return np.ascontiguousarray(((best[1:] + 0.5) / count - 0.5).T)

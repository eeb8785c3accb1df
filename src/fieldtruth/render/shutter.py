# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light of a moving camera: rows that are read one after the other, and means over the time of exposure.

The camera has a pose of its own for each strip of STRIP rows, and for each of the sub-frames that are averaged.
"""

from functools import cache
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.render.edges import find_edges
from fieldtruth.render.photograph import Framebuffer, refine, store
from fieldtruth.render.shading import ShadingBuffers, shade_batch
from fieldtruth.render.tables import Shading
from fieldtruth.render.wires import shade_view
from fieldtruth.sense import embree
from fieldtruth.sense.hits import LabelBuffers
from fieldtruth.sense.kernel import kernel
from fieldtruth.sense.ray_batch import BLOCK, View, label_pixels, trace

STRIP: Final = 4
"""Rows with the same pose, a packet of rays high: at 60 deg/s, 1000 pixels of focal length and 20 ms for 720 rows a
strip is 0.12 pixels from the next one."""
_COLUMNS: Final = BLOCK // STRIP
_ORDERS: Final = 200
_TILE_WIDTH, _TILE_HEIGHT, _LANES = embree.TILE_WIDTH, embree.TILE_HEIGHT, embree.LANES
_BRIGHTEST: Final = 8.0
"""Light of a sample, so that one glint does not dominate its pixel; the ideal camera's curve is white from there."""


def strips_of(height: int) -> int:
    """Number of strips of an image."""
    return -(-height // STRIP)


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
def render_strips(shading: Shading, framebuffer: Framebuffer, view: View, poses: Array, labels: LabelBuffers) -> None:
    """Render the light ``framebuffer.linear`` like ``render_linear``, with poses (strips, 4, 4) world_from_optical.

    Labels are those that the moving camera sees; edges need them.
    """
    buffers, linear, edges = framebuffer
    height, width, _ = linear.shape
    batch = buffers.batch
    for upper in range(0, height, STRIP):
        own = View(poses[upper // STRIP], view.pinhole, view.far, view.table)
        for left in range(0, width, _COLUMNS):
            count = _set_strip(upper, left, height, width, 0.0, 0.0, batch.image)
            trace(shading.scene, shading.hits.geometry_top, buffers.packet, own, batch, count)
            label_pixels(shading.hits, batch, count, labels)
            shade_view(shading, buffers, own, count)
            store(batch.image, buffers.colour, count, linear)
    count, start = find_edges(linear, labels, edges), 0
    while start < count:
        strip, end = edges.pixels[start, 0] // STRIP, start
        while end < count and edges.pixels[end, 0] // STRIP == strip:
            end += 1
        refine(shading, framebuffer, View(poses[strip], view.pinhole, view.far, view.table), start, end)
        start = end


@kernel
def render_mean(shading: Shading, framebuffer: Framebuffer, view: View, poses: Array, offsets: Array) -> None:
    """Render the mean light ``framebuffer.linear`` of n sub-frames with poses (n, strips, 4, 4) world_from_optical.

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
            own = View(poses[frame, upper // STRIP], view.pinhole, view.far, view.table)
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
    shade_batch(shading, buffers, count, pixel)


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

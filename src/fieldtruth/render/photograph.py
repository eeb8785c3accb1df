# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One image: labels and shading of the ray through each pixel's centre, more rays at edges, then tonemapping."""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.render.edges import EdgeBuffers, find_edges, new_edge_buffers
from fieldtruth.render.shading import ShadingBuffers, new_shading_buffers
from fieldtruth.render.tables import Shading
from fieldtruth.render.wires import shade_view
from fieldtruth.sense.hits import LabelBuffers
from fieldtruth.sense.kernel import kernel
from fieldtruth.sense.ray_batch import (
    BLOCK,
    BLOCK_HEIGHT,
    BLOCK_WIDTH,
    View,
    label_pixels,
    normal_pixels,
    set_pixel_block,
    trace,
)

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
    refine(shading, framebuffer, view, 0, find_edges(linear, labels, edges))


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

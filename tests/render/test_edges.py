# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Pixels at edges: bright beside dark on another surface; each is listed once, block by block."""

import numpy as np
import pytest

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.photograph import find_edges, new_edge_buffers

HEIGHT, WIDTH = 50, 70


def labels_of(depth: Float32Array) -> LabelBuffers:
    shape = depth.shape
    return LabelBuffers(np.zeros(shape, np.uint8), np.ones(shape, np.uint32), depth)


def test_an_edge_needs_contrast_and_another_surface() -> None:
    linear, depth = np.zeros((HEIGHT, WIDTH, 3), np.float32), np.full((HEIGHT, WIDTH), 5.0, np.float32)
    linear[:, 20:] = 0.5  # in front of it: the contrast of a texture
    linear[:, 40:] = 0.0
    depth[:, 40:] = 6.0
    depth[:, 60:] = 7.0  # without contrast
    out = new_edge_buffers(HEIGHT, WIDTH)
    count = find_edges(linear, labels_of(depth), out, 32)
    assert count == 2 * HEIGHT
    assert np.unique(out.pixels[:count, 1]).tolist() == [39, 40]


@pytest.mark.parametrize("rows", [4, 32])
def test_each_pixel_is_listed_once_and_blocks_follow_each_other(rows: int) -> None:
    rng = np.random.default_rng(0)
    linear = np.repeat(rng.integers(0, 2, (HEIGHT, WIDTH, 1)), 3, axis=2).astype(np.float32)
    out = new_edge_buffers(HEIGHT, WIDTH)
    count = find_edges(linear, labels_of(rng.random((HEIGHT, WIDTH)).astype(np.float32)), out, rows)
    found = out.pixels[:count]
    assert sorted(map(tuple, found.tolist())) == [tuple(at) for at in np.argwhere(out.marked).tolist()]
    assert count > 1000
    blocks = found[:, 0] // rows * 100 + found[:, 1] // 32
    assert np.count_nonzero(np.diff(blocks)) == len(np.unique(blocks)) - 1

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tonemapping at the ends of its range."""

import numpy as np

from fieldtruth.kernels.tone_curve import WHITE, tonemap


def test_light_just_below_zero_is_black_and_light_above_white_is_white() -> None:
    linear = np.full((4, 12, 3), -1e-11, np.float32)
    linear[:, 6:] = 100.0 * WHITE
    photo = np.full(linear.shape, 7, np.uint8)
    tonemap(linear, photo)
    assert (photo[:, :5] == 0).all()
    assert (photo[:, 7:] == 255).all()


def test_light_that_is_no_number_is_white_and_reads_no_foreign_memory() -> None:
    photo = np.zeros((2, 2, 3), np.uint8)
    tonemap(np.full((2, 2, 3), np.nan, np.float32), photo)
    assert (photo == 255).all()

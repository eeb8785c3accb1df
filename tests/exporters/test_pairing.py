# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds are paired with photographs by their stamps."""

import numpy as np

from fieldtruth.exporters.kitti import WINDOW_NS, paired

CLOUDS = np.arange(10**8, 20 * 10**9, 10**8)
PHOTOS = np.arange(4 * 10**7, 20 * 10**9, 4 * 10**7)


def test_clouds_are_paired_with_photographs_of_their_stamp() -> None:
    found = paired(CLOUDS, [PHOTOS, PHOTOS])
    assert [pair.stamp_ns for pair in found] == list(range(2 * 10**8, 20 * 10**9, 2 * 10**8))
    for pair in found:
        assert CLOUDS[pair.cloud] == PHOTOS[pair.images[0]] == PHOTOS[pair.images[1]] == pair.stamp_ns
        assert pair.apart_ns == 0


def test_without_common_stamps_the_nearest_photographs_are_used_once() -> None:
    found = paired(CLOUDS + 10**6, [PHOTOS, PHOTOS + 10**6])
    assert len(found) == len(CLOUDS)
    assert max(pair.apart_ns for pair in found) <= 21 * 10**6
    slow = np.arange(1, 4) * 10**9
    clouds = np.arange(9 * 10**8, 3 * 10**9, 3 * 10**8)
    pairs = paired(clouds, [slow, slow])
    assert [pair.stamp_ns for pair in pairs] == [10**9, 2 * 10**9, 3 * 10**9]
    assert all(pair.apart_ns <= WINDOW_NS for pair in pairs)


def test_a_camera_that_stops_or_is_silent_gives_no_pairs_then() -> None:
    stopped = PHOTOS[PHOTOS <= 5 * 10**9]
    stamps = [pair.stamp_ns for pair in paired(CLOUDS, [PHOTOS, stopped])]
    assert stamps == list(range(2 * 10**8, 5 * 10**9 + 1, 2 * 10**8))
    assert paired(CLOUDS, [PHOTOS, PHOTOS[:0]]) == []

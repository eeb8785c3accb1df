# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds are paired with photographs even if messages are late, as in recorded bags."""

from types import SimpleNamespace

import numpy as np
import pytest
from fieldtruth.bag.pairing import WINDOW_NS, _Item, _Pairing


def pairs(items: list[tuple[int, str | None, int]], *, exact: bool) -> list[tuple[int, int, int]]:
    """Stamps of cloud, left and right image of each frame; messages are arrival time, side and stamp."""
    pairing, frames = _Pairing(["left", "right"], exact=exact), []
    for bag_ns, side, stamp in sorted(items, key=lambda item: item[0]):
        frames += list(pairing.add(side, _Item(bag_ns, stamp, SimpleNamespace(stamp=stamp))))
        held = len(pairing._clouds) + sum(map(len, pairing._images.values()))
        assert held < 100
    frames += list(pairing.rest())
    return [(frame.cloud.stamp, *(image.stamp for image in frame.images)) for frame in frames]


def arrivals(seconds: int, latest_ns: int, seed: int = 0) -> list[tuple[int, str | None, int]]:
    """Clouds at 10 Hz and photographs at 25 Hz with random delays; messages of a topic keep their order."""
    rng, items = np.random.default_rng(seed), []
    for side, period in ((None, 10**8), ("left", 4 * 10**7), ("right", 4 * 10**7)):
        stamps = np.arange(period, seconds * 10**9, period)
        arrived = np.maximum.accumulate(stamps + rng.integers(0, latest_ns + 1, len(stamps)))
        items += [(int(bag_ns), side, int(stamp)) for bag_ns, stamp in zip(arrived, stamps, strict=True)]
    return items


@pytest.mark.parametrize("seed", range(5))
def test_late_messages_are_paired_by_stamp(seed: int) -> None:
    found = pairs(arrivals(20, WINDOW_NS, seed), exact=True)
    assert found == [(t, t, t) for t in range(2 * 10**8, 20 * 10**9, 2 * 10**8)]
    nearest = pairs(arrivals(20, WINDOW_NS, seed), exact=False)
    assert [cloud for cloud, _, _ in nearest] == list(range(10**8, 20 * 10**9, 10**8))
    assert {cloud - left for cloud, left, _ in nearest} == {0, 2 * 10**7}


def test_camera_that_stops_does_not_block_pairing() -> None:
    items = arrivals(20, 0)
    stopped = [item for item in items if item[1] != "right" or item[2] <= 5 * 10**9]
    assert pairs(stopped, exact=True) == [(t, t, t) for t in range(2 * 10**8, 5 * 10**9 + 1, 2 * 10**8)]


def test_nearest_photographs_are_used_once() -> None:
    slow = [(stamp, side, stamp) for stamp in range(10**9, 4 * 10**9, 10**9) for side in ("left", "right")]
    clouds = [(stamp, None, stamp) for stamp in range(10**9 - 10**8, 3 * 10**9, 3 * 10**8)]
    found = pairs([*slow, *clouds], exact=False)
    assert [left for _, left, _ in found] == [10**9, 2 * 10**9, 3 * 10**9]
    assert all(left == right and abs(cloud - left) <= WINDOW_NS for cloud, left, right in found)

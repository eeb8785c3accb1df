# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Single rays against closed forms, with the classes and ids of what they hit."""

import numpy as np
import pytest
from sense_worlds import at, box, floating, quad

from fieldtruth.core.classes import Label
from fieldtruth.sense.scene import cast_rays

ROOM = floating((box("room", (6.0, 5.0, 4.0)), at(0, 0, 0)))


def test_rays_from_different_points_meet_the_walls() -> None:
    origins = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -2.0, 1.0], [0.0, 0.0, 3.0]])
    directions = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.1]])  # of any length
    found = cast_rays(ROOM, origins, directions)
    assert found.range_m == pytest.approx([6.0, 7.0, 7.0, 1.0], abs=1e-5)
    assert (found.instance > 0).all()


def test_one_origin_serves_all_directions() -> None:
    diagonal = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0]])
    found = cast_rays(ROOM, (0.0, 0.0, 0.0), diagonal)
    assert found.range_m == pytest.approx([5.0 * 2**0.5, 4.0 * 2**0.5], abs=1e-5)


def test_what_is_farther_than_the_limit_is_not_hit() -> None:
    found = cast_rays(ROOM, (0.0, 0.0, 0.0), [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], max_range=5.0)
    assert found.range_m.tolist() == [np.inf, pytest.approx(4.0, abs=1e-5)]
    assert (found.label[0], found.instance[0]) == (0, 0)


def test_water_is_hit() -> None:
    lake = floating((quad("lake", [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "water"), at(0, 0, 0)))
    found = cast_rays(lake, (0.0, 0.0, 2.0), (0.0, 0.0, -1.0))
    assert found.range_m == pytest.approx([2.0], abs=1e-5)
    assert found.label.tolist() == [Label.WATER]


@pytest.mark.parametrize("direction", [(0.0, 0.0, 0.0), (np.nan, 0.0, 1.0), (np.inf, 0.0, 0.0)])
def test_a_direction_must_have_a_length(direction: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=r"^directions must be finite and longer than 0$"):
        cast_rays(ROOM, (0.0, 0.0, 0.0), direction)

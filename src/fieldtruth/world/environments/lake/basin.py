# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Heights of the lake and its land beyond the world's edge: the near shore continues; a far shore and hills."""

from collections.abc import Callable

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Land
from fieldtruth.world.environments.lake.config import Config


def basin_heights(config: Config, rng: np.random.Generator) -> Land:
    """Heights [m] of the land around the lake as a function of x, y [m] of any shape.

    The near shore runs along x at y = ``config.edge``. The far shore is 130 to 200 m away, the lake's ends 250 to
    350 m; hills rise behind the far shore. North and south of the world the lake bends towards the robot, so that water
    is visible ahead when it drives along the shore.
    """
    edge = config.edge
    far, ends = edge - rng.uniform(130.0, 170.0), (-rng.uniform(250.0, 330.0), rng.uniform(250.0, 330.0))
    near_bends, far_bends = _waves(rng, (70.0, 160.0, 420.0), 2.5), _waves(rng, (60.0, 140.0, 330.0), 13.0)
    bays = rng.uniform(9.0, 15.0, 2)
    along, across = _waves(rng, (340.0, 610.0, 1300.0), 0.26), _waves(rng, (420.0, 900.0), 0.2)
    rough = _waves(rng, (83.0, 121.0, 190.0), 1.0)

    def heights(x: Array, y: Array) -> Array:
        leaving = np.clip(np.abs(x) / 40.0 - 1.25, 0.0, 1.0) ** 2  # in front of the world the shore is straight
        bay = np.where(x < 0, bays[0], bays[1]) * np.clip(5.0 - np.abs(x) / 50.0, 0.0, 1.0)
        off_near = edge + leaving * (bay + near_bends(x)) - y
        off_far = y - far - far_bends(x)
        out = np.minimum(np.minimum(off_near, off_far), 0.6 * np.minimum(x - ends[0], ends[1] - x))
        depth, inland = np.maximum(out, 0.0), np.maximum(-out, 0.0)
        rise = config.bank * (1.0 - np.exp(-inland / 9.0))
        hilly = np.logaddexp(0.0, 3.0 * (1.0 + along(x + 0.4 * y) + across(y - 0.3 * x))) / 3.0
        beyond = np.where(y < edge, 44.0, 24.0)  # the robot's own side is flatter
        away = np.maximum(inland - 12.0, 0.0) / 400.0
        hills = (beyond * hilly + 2.2 * rough(x + 0.5 * y) * np.minimum(away, 1.0)) * away / np.hypot(1.0, away)
        return np.asarray(config.water_level + np.where(out > 0, -np.minimum(0.3 * depth, 6.0), rise + hills))

    return heights


def _waves(rng: np.random.Generator, lengths: tuple[float, ...], height: float) -> Callable[[Array], Array]:
    """Sum of sines of the given wavelengths [m] with random phases and deviation ``height``."""
    phases = rng.uniform(0.0, 2.0 * np.pi, len(lengths))
    scale = height * np.sqrt(2.0 / len(lengths))

    def at(x: Array) -> Array:
        return np.asarray(sum(scale * np.sin(2 * np.pi * x / w + p) for w, p in zip(lengths, phases, strict=True)))

    return at

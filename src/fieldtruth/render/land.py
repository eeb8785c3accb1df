# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Colour of the land beyond the world's edge: the world's ground, mirrored at the edge, fades into that of far land.

The backdrop has one material for all that is far away, in large texels. Near the edge, where cameras see it close, a
border of two colours would show.
"""

from typing import Final

import numpy as np

from fieldtruth.kernels.compile import inlined
from fieldtruth.render.atlas import sample
from fieldtruth.render.gbuffer import mip_level
from fieldtruth.render.tables import MaterialTable
from fieldtruth.render.weathering import Colour, flat_value

FADES: Final = np.float32(40.0)
"""Distance [m] from the edge at which the world's ground has faded."""
_KEPT: Final = np.float32(4.0)  # [m] up to which it has not begun to
_PER_TONGUE: Final = np.float32(1.0 / 9.0)  # per metre, of the fade's irregular border
_STEEP: Final = np.float32(0.8)  # cosine of the slope above which land shows its other texture
_PER_LEDGE, _PER_STREAK = np.float32(1.0 / 47.0), np.float32(1.0 / 13.0)


@inlined
def is_steep(x: np.float32, y: np.float32, up: np.float32) -> np.bool_:
    """Whether land at x, y [m], whose normal's z is ``up``, shows the texture of steep land, with a ragged border."""
    half = np.float32(0.5)
    ragged = flat_value(x * _PER_LEDGE, y * _PER_LEDGE) + flat_value(x * _PER_STREAK, y * _PER_STREAK) * half
    return up + np.float32(0.16) * (ragged - np.float32(0.75)) < _STEEP


@inlined
def _mirrored(at: np.float32, side: np.float32) -> np.float32:
    """Position on a side [m] of a rectangle, mirrored at both ends again and again."""
    turns = at / (np.float32(2.0) * side)
    share = np.float32(2.0) * abs(turns - np.floor(turns + np.float32(0.5)))
    return share * side  # type: ignore[no-any-return]


@inlined
def near_edge(
    materials: MaterialTable, colour: Colour, x: np.float32, y: np.float32, side: np.float32, noise: np.float32
) -> Colour:
    """Blend the world's ground over the ``colour`` of land at x, y [m]; ``side`` [m] is the width of a pixel there."""
    ground, grain, zero, one = materials.ground, materials.ground_material, np.float32(0.0), np.float32(1.0)
    per, finer = np.float32(materials.per_metre_rgb), np.float32(materials.per_metre_material / materials.per_metre_rgb)
    long, wide = np.float32(ground.shape[0] - 1), np.float32(ground.shape[1] - 1)
    u, v = (x - np.float32(materials.corner[0])) * per, (y - np.float32(materials.corner[1])) * per
    du, dv = max(max(-u, u - long), zero) / per, max(max(-v, v - wide), zero) / per
    off = np.sqrt(du * du + dv * dv)
    if off >= np.float32(1.4) * FADES:
        return colour
    off *= np.float32(0.7) + np.float32(0.6) * flat_value(x * _PER_TONGUE, y * _PER_TONGUE)
    share = one - min(max((off - _KEPT) / (FADES - _KEPT), zero), one)
    if share <= zero:
        return colour
    u, v = _mirrored(u, long), _mirrored(v, wide)
    i, j = np.uintp(min(u, long)), np.uintp(min(v, wide))
    row = np.uintp(grain[np.uintp(min(u, long) * finer), np.uintp(min(v, wide) * finer)])
    texture, repeat = np.uintp(materials.texture[row]), materials.repeat[row]
    level = mip_level(side / repeat * np.float32(materials.atlas.size[texture, 0]), noise)
    red, green, blue = sample(materials.atlas, texture, x / repeat, y / repeat, level)
    mean = materials.atlas.mean
    red = colour[0] + share * (ground[i, j, 0] * red / mean[texture, 0] - colour[0])
    green = colour[1] + share * (ground[i, j, 1] * green / mean[texture, 1] - colour[1])
    blue = colour[2] + share * (ground[i, j, 2] * blue / mean[texture, 2] - colour[2])
    return red, green, blue

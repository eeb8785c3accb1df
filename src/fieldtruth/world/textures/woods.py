# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Forest floor: needles and twigs, moss, trodden earth. A tile is 1.5 m."""

from typing import Final

import numpy as np

from fieldtruth.world.textures.canvas import (
    Image,
    Rng,
    crevices,
    drawing,
    even_out,
    halve,
    linear,
    mix,
    noise,
    settle,
    stamps,
    strokes,
)
from fieldtruth.world.textures.ground import FINE, dead_leaf, dome, strewn_stones

_HUMUS: Final = [(44, 34, 26), (78, 62, 48)]


@drawing
def needle_litter(rng: Rng) -> Image:
    """Fallen needles in every direction, twigs over them, some dead leaves, humus in the gaps."""
    count, twigs, leaves = 30_000, 260, 190
    fallen = strokes(rng, FINE, count, (6.0, 20.0), 1.7, 0.12)
    sticks = strokes(rng, FINE, twigs, (40.0, 150.0), 4.0, 0.3)
    length = rng.uniform(12, 24, leaves)
    dead = stamps(rng, FINE, length, length * rng.uniform(0.45, 0.7, leaves), dead_leaf, rng.uniform(0.3, 1, leaves))
    sticks = sticks._replace(owner=sticks.owner + np.int32(count), height=np.minimum(0.5 + 0.5 * sticks.height, 1.0))
    relief = settle(FINE, [fallen, sticks, dead._replace(owner=dead.owner + np.int32(count + twigs))])
    tone = np.concatenate([rng.beta(2, 2, count), rng.uniform(0.1, 0.7, twigs), rng.beta(2, 2, leaves)])
    shade = tone.astype(np.float32)[relief.owner]
    needle = mix([(74, 50, 34), (112, 78, 52), (140, 104, 74), (158, 128, 98)], shade)
    stick = mix([(66, 58, 50), (104, 94, 84), (132, 124, 114)], shade)
    leaf = mix([(86, 58, 36), (126, 90, 56), (150, 116, 76)], shade + 0.1 * noise(rng, FINE, 12, 200))
    sort = np.where(relief.owner >= count + twigs, 2, np.where(relief.owner >= count, 1, 0))[..., None]
    colour = np.where(sort == 2, leaf, np.where(sort == 1, stick, needle))
    humus = mix(_HUMUS, 0.5 + 0.25 * noise(rng, FINE, 20, 300, slope=0.6))
    colour = np.where((relief.owner < 0)[..., None], humus, colour)
    light = (0.5 + 0.5 * relief.height) * crevices(relief.height, 4.0, 0.7)
    return even_out(halve(colour * light[..., None]))


@drawing
def moss(rng: Rng) -> Image:
    """Cushions of moss: short shoots, brighter on top of a cushion, with scattered needles."""
    shoots, fallen = 42_000, 1_400
    cushion = noise(rng, FINE, 5, 40, slope=1.1)
    grown = strokes(rng, FINE, shoots, (3.0, 8.0), 2.6, 0.7)
    dead = strokes(rng, FINE, fallen, (8.0, 22.0), 1.8, 0.1)
    relief = settle(FINE, [grown, dead._replace(owner=dead.owner + np.int32(shoots), height=0.6 + 0.4 * dead.height)])
    tone = rng.random(shoots + fallen).astype(np.float32)[relief.owner]
    green = mix([(48, 58, 24), (78, 92, 36), (104, 118, 50), (132, 140, 66)], 0.7 * tone + 0.13 * cushion + 0.12)
    brown = mix([(92, 66, 44), (138, 106, 74)], tone)
    colour = np.where((relief.owner >= shoots)[..., None], brown, green)
    colour = np.where((relief.owner < 0)[..., None], linear((40, 44, 22)), colour)
    light = (0.5 + 0.5 * relief.height) * crevices(relief.height, 3.0, 0.5) * (1 + 0.07 * cushion)
    return even_out(halve(colour * light[..., None]))


@drawing
def trodden_earth(rng: Rng) -> Image:
    """Packed earth of a forest path with small stones and some needles."""
    stones, fallen = 1_500, 5_500
    pebbles = strewn_stones(rng, stones, (1.2, 9.0), power=2.2, rise=(0.4, 1.0))
    dead = strokes(rng, FINE, fallen, (5.0, 16.0), 1.6, 0.12)
    relief = settle(FINE, [pebbles, dead._replace(owner=dead.owner + np.int32(stones), height=0.7 * dead.height)])
    tone = rng.beta(2, 2, stones + fallen).astype(np.float32)[relief.owner]
    lumps = noise(rng, FINE, 8, 120, slope=0.8)
    earth = mix([(78, 62, 48), (112, 92, 72), (138, 116, 92)], 0.5 + 0.15 * lumps + 0.1 * noise(rng, FINE, 80, 500))
    stone = mix([(120, 112, 102), (158, 150, 138), (176, 168, 156)], tone) * (0.7 + 0.3 * dome(relief))[..., None]
    needle = mix([(84, 60, 42), (128, 96, 68)], tone)
    colour = np.where((relief.owner >= stones)[..., None], needle, stone)
    colour = np.where((relief.owner < 0)[..., None], earth, colour)
    return even_out(halve(colour * (crevices(relief.height, 2.5, 0.4) * (1 + 0.04 * lumps))[..., None]))

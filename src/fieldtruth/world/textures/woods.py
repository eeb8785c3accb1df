# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Forest floor: needles and twigs, moss, trodden earth. A tile is 1.5 m."""

from typing import Final

import numpy as np

from fieldtruth.world.textures.canvas import Image, Rng, drawing, linear, mix, noise, stamps, strokes
from fieldtruth.world.textures.ground import GREYS, LEAVES, THATCH, TWIGS, N, dead_leaf, strewn_stones
from fieldtruth.world.textures.strata import SIEVE, Kind, at_heights, layered

_HUMUS: Final = [(48, 41, 35), (80, 70, 60)]
_NEEDLES: Final = [(72, 56, 44), (108, 86, 66), (136, 112, 88), (162, 142, 118)]


def _leaves(rng: Rng, count: int, size: tuple[float, float], rise: tuple[float, float]) -> Kind:
    length = rng.uniform(*size, count)
    width = length * rng.uniform(0.4, 0.75, count)
    return Kind(stamps(rng, N, length, width, dead_leaf, rng.uniform(*rise, count)), LEAVES, (1.5, 1.6))


@drawing
def needle_litter(rng: Rng) -> Image:
    """Fallen needles in every direction, twigs over them, dead leaves, moss and humus in the gaps."""
    fallen = at_heights(strokes(rng, N, 34_000, (6.0, 22.0), 1.5, 0.12), 0.05, 0.7)
    sticks = at_heights(strokes(rng, N, 330, (24.0, 150.0), 3.6, 0.3), 0.35, 1.0)
    bark = at_heights(strokes(rng, N, 900, (5.0, 18.0), 5.0, 0.2), 0.2, 0.6)
    lumps = noise(rng, N, 8, 150, slope=0.8)
    humus = mix(_HUMUS, 0.5 + 0.25 * lumps)
    moss = np.clip(noise(rng, N, 4, 60, slope=0.7) - 0.9, 0, 0.8)[..., None]
    humus = humus * (1 - moss) + linear((78, 84, 50)) * moss
    kinds = [Kind(fallen, _NEEDLES), Kind(bark, TWIGS), _leaves(rng, 300, (9, 24), (0.3, 0.95)), Kind(sticks, TWIGS)]
    return layered(rng, humus, np.clip(0.14 + 0.08 * lumps, 0, 1), kinds, depth=1.1)


@drawing
def moss(rng: Rng) -> Image:
    """Cushions of moss: short shoots, higher and brighter on top of a cushion, with scattered needles and leaves."""
    shoots = 52_000
    cushion = noise(rng, N, 5, 40, slope=1.1)
    grown = strokes(rng, N, shoots, (3.0, 8.0), 2.4, 0.7)
    row, column = (np.floor(at).astype(np.intp) % N for at in (grown.y, grown.x))
    bed = np.clip(0.42 + 0.17 * cushion, 0, 0.75)
    grown = grown._replace(height=bed[row, column] + np.float32(0.25) * grown.height)
    dead = at_heights(strokes(rng, N, 1_800, (8.0, 22.0), 1.6, 0.1), 0.5, 0.95)
    green = [(54, 60, 36), (82, 90, 52), (106, 114, 68), (132, 138, 92)]
    ground = np.broadcast_to(linear((52, 54, 38)), (N, N, 3)).copy()
    kinds = [Kind(grown, green), Kind(dead, _NEEDLES), _leaves(rng, 60, (9, 22), (0.6, 1.0))]
    return layered(rng, ground, bed, kinds, depth=1.0)


@drawing
def trodden_earth(rng: Rng) -> Image:
    """Packed earth of a forest path: fines, grit and stones by a sieve curve, needles, leaves trodden into it."""
    lumps, fines = noise(rng, N, 5, 140, slope=0.9), noise(rng, N, 100, 500, slope=0.1)
    earth = mix([(80, 70, 60), (110, 99, 86), (138, 127, 113)], 0.5 + 0.17 * lumps + 0.12 * fines)
    grit = strewn_stones(rng, 26_000, (0.7, 2.2), power=SIEVE, rise=(0.42, 0.62))
    stones = strewn_stones(rng, 1_300, (2.0, 13.0), power=2.1, rise=(0.55, 1.0))
    fallen = at_heights(strokes(rng, N, 7_000, (5.0, 18.0), 1.5, 0.12), 0.35, 0.75)
    twigs = at_heights(strokes(rng, N, 90, (20.0, 90.0), 3.0, 0.3), 0.5, 0.9)
    kinds = [Kind(grit, GREYS, (1.3, 1.8)), Kind(fallen, _NEEDLES), _leaves(rng, 260, (4, 20), (0.5, 0.8))]
    kinds += [Kind(stones, GREYS, (1.4, 1.8)), Kind(twigs, THATCH)]
    return layered(rng, earth, np.clip(0.42 + 0.11 * lumps + 0.03 * fines, 0, 1), kinds, depth=1.0)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of a lake shore and a dry hillside, and distant land. A tile of ground is 1.5 m, of scree 2.5 m."""

import numpy as np

from fieldtruth.core.arrays import Index
from fieldtruth.world.textures.canvas import (
    Image,
    Rng,
    Samples,
    crevices,
    drawing,
    even_out,
    linear,
    mix,
    noise,
    settle,
    stamps,
    strokes,
)
from fieldtruth.world.textures.ground import (
    DRY_GREENS,
    GREYS,
    STRAW,
    THATCH,
    TWIGS,
    N,
    stone_profile,
    strewn_stones,
)
from fieldtruth.world.textures.strata import SIEVE, Kind, at_heights, layered

FAR = 512


@drawing
def rough_grass(rng: Rng) -> Image:
    """Unmown grass: long overlapping blades, straw that lies below them, stalks, dark gaps."""
    count, dead = 19_000, 6_000
    patches = noise(rng, N, 3, 24, slope=0.8)
    blades = strokes(rng, N, count, (14.0, 62.0), 2.6, 0.8)
    clumps = (0.85 + 0.25 * noise(rng, N, 10, 50, slope=0.5)).clip(0.35, 1.15)
    row, column = (np.floor(at).astype(np.intp) % N for at in (blades.y, blades.x))
    blades = blades._replace(height=blades.height * clumps[row, column])
    straw = at_heights(strokes(rng, N, dead, (16.0, 70.0), 2.0, 0.5), 0.1, 0.75)
    thatch = at_heights(strokes(rng, N, 9_000, (6.0, 24.0), 1.7, 0.6), 0.03, 0.2)
    stalks = at_heights(strokes(rng, N, 260, (40.0, 110.0), 2.2, 0.25), 0.4, 1.0)
    green = [(64, 70, 44), (88, 95, 60), (112, 117, 78), (138, 140, 102)]
    gaps = mix([(44, 40, 30), (76, 68, 52)], 0.5 + 0.2 * noise(rng, N, 20, 300))
    kinds = [Kind(thatch, THATCH), Kind(straw, STRAW), Kind(blades, green, (1.6, 1.7)), Kind(stalks, STRAW)]
    return layered(rng, gaps, np.clip(0.06 + 0.03 * patches, 0, 1), kinds, depth=1.2, clumps=0.17)


@drawing
def mud(rng: Rng) -> Image:
    """Wet mud at the water's edge: smooth silt with ripples, grit, bits of reed."""
    ripple, lumps = noise(rng, N, 10, 40, slope=0.6, stretch=0.35), noise(rng, N, 4, 200, slope=1.0)
    silt = mix(
        [(60, 55, 48), (82, 76, 67), (104, 97, 86), (124, 117, 106)],
        0.5 + 0.1 * ripple + 0.12 * lumps + 0.06 * noise(rng, N, 100, 500, slope=0.2),
    )
    grit = strewn_stones(rng, 5_000, (0.8, 4.0), power=SIEVE, rise=(0.5, 0.75))
    length = rng.gamma(1.2, 9.0, 260).clip(3, 60)
    reed = stamps(rng, N, length, rng.uniform(0.8, 2.0, 260), lambda a, b, _: 1 - b**2 - 0.2 * a**2, 0.9)
    kinds = [Kind(grit, GREYS), Kind(reed, [*THATCH, *STRAW], (1.2, 1.6))]
    return layered(rng, silt, (0.5 + 0.09 * ripple + 0.1 * lumps).clip(0, 1), kinds, depth=0.8)


@drawing
def pebbles(rng: Rng) -> Image:
    """A beach of coarse sand with rounded pebbles of 0.5 to 7 cm, by a sieve curve, and driftwood crumbs."""
    large = strewn_stones(rng, 5_200, (3.0, 24.0), power=1.8, rise=(0.45, 1.0))
    small = strewn_stones(rng, 22_000, (1.0, 3.2), power=SIEVE, rise=(0.28, 0.5))
    lumps, grains = noise(rng, N, 3, 40, slope=1.0), noise(rng, N, 120, 512, slope=0.0)
    sand = mix([(116, 108, 94), (148, 139, 124), (182, 173, 157)], 0.5 + 0.1 * lumps + 0.2 * grains)
    wood = at_heights(strokes(rng, N, 260, (5.0, 40.0), 2.4, 0.3), 0.45, 0.7)
    kinds = [Kind(small, GREYS, (1.2, 1.3)), Kind(large, GREYS, (1.3, 1.5)), Kind(wood, TWIGS)]
    return layered(rng, sand, (0.34 + 0.07 * lumps + 0.02 * grains).clip(0, 1), kinds, depth=1.0)


@drawing
def murky_water(rng: Rng) -> Image:
    """Light that a lake scatters back from below its surface: murky green and brown, slowly varying."""
    n = 128
    cloud = 0.5 + 0.12 * noise(rng, n, 2, 12, slope=0.8)
    return np.asarray(mix([(38, 44, 30), (46, 54, 38), (54, 60, 40)], cloud), np.float32)


@drawing
def dry_turf(rng: Rng) -> Image:
    """Turf of a dry mountain in summer: tufts of bleached blades, lying straw, soil and pebbles between them."""
    tufts = noise(rng, N, 6, 30, slope=0.6)
    blades = strokes(rng, N, 17_000, (10.0, 36.0), 2.0, 0.6)
    grown = np.clip(0.62 + 0.3 * tufts, 0.12, 1.1)
    row, column = (np.floor(at).astype(np.intp) % N for at in (blades.y, blades.x))
    blades = blades._replace(height=blades.height * grown[row, column])
    lying = at_heights(strokes(rng, N, 5_000, (12.0, 50.0), 1.6, 0.4), 0.14, 0.3)
    green = at_heights(strokes(rng, N, 1_500, (6.0, 20.0), 1.8, 0.5), 0.0, 0.7)
    grit = strewn_stones(rng, 9_000, (0.9, 3.0), power=SIEVE, rise=(0.16, 0.3))
    stones = strewn_stones(rng, 500, (2.0, 11.0), power=1.9, rise=(0.2, 0.6))
    lumps = noise(rng, N, 6, 200, slope=0.8)
    soil = mix([(96, 82, 66), (126, 111, 92), (152, 138, 118)], 0.5 + 0.16 * lumps)
    kinds = [Kind(grit, GREYS), Kind(lying, STRAW), Kind(stones, GREYS), Kind(green, DRY_GREENS)]
    return layered(rng, soil, 0.12 + 0.03 * lumps, [*kinds, Kind(blades, STRAW, (1.6, 1.5))], depth=1.1, clumps=0.15)


_GRUS = [(98, 88, 76), (132, 121, 106), (162, 151, 136)]
"""Soil of weathered granite: humus, coarse sand."""


@drawing
def stony_soil(rng: Rng) -> Image:
    """Thin dry soil of a hillside: coarse sand of granite with angular stones of up to 8 cm, straw, dry leaves."""
    stones, grit = 7_000, 30_000
    shards = _shards(rng, stones, (1.5, 26.0), power=1.95)
    small = strewn_stones(rng, grit, (0.8, 2.2), power=SIEVE, rise=(0.2, 0.4))
    lying = at_heights(strokes(rng, N, 1_400, (8.0, 44.0), 1.6, 0.4), 0.25, 0.5)
    lumps, fines = noise(rng, N, 4, 120, slope=0.9), noise(rng, N, 100, 500, slope=0.1)
    dust = mix(_GRUS, 0.5 + 0.16 * lumps + 0.16 * fines)
    kinds = [Kind(small, GREYS, (1.2, 1.4)), Kind(shards, GREYS, (1.4, 1.6)), Kind(lying, STRAW)]
    return layered(rng, dust, (0.25 + 0.07 * lumps + 0.02 * fines).clip(0, 1), kinds, depth=1.1)


@drawing
def scree(rng: Rng) -> Image:
    """Broken granite: overlapping pieces of 1 to 20 cm with grit between them."""
    pieces = _shards(rng, 30_000, (2.0, 42.0), power=1.9)
    grit = strewn_stones(rng, 20_000, (0.8, 2.0), power=SIEVE, rise=(0.1, 0.25))
    dust = mix(_GRUS, 0.35 + 0.2 * noise(rng, N, 4, 60, slope=0.9)) * np.float32(0.8)
    height = 0.1 + 0.02 * noise(rng, N, 6, 100, slope=0.8)
    return layered(rng, dust, height, [Kind(grit, GREYS), Kind(pieces, GREYS, (1.5, 1.7))], depth=1.0)


def _shards(rng: Rng, count: int, radius: tuple[float, float], *, power: float) -> Samples:
    """Splinters with straight sides, sizes as in `strewn_stones`; large ones are on top."""
    low, high = radius[0] ** -power, radius[1] ** -power
    size = (low + rng.random(count) * (high - low)) ** (-1 / power)
    turn = (np.arange(6) / 6 * 2 * np.pi + rng.uniform(-0.5, 0.5, (count, 6))).astype(np.float32)
    reach = rng.uniform(0.55, 0.95, (count, 6)).astype(np.float32)
    lean = rng.uniform(-0.35, 0.35, (count, 2)).astype(np.float32)

    def profile(a: Image, b: Image, rows: Index) -> Image:
        edge = np.full(a.shape, 1.0, np.float32)
        for k in range(6):
            edge = np.minimum(edge, 1 - (a * np.cos(turn[rows, k]) + b * np.sin(turn[rows, k])) / reach[rows, k])
        tilt = lean[rows, 0] * a + lean[rows, 1] * b
        return np.asarray(np.where(edge > 0, np.clip(0.35 + 3 * edge, 0, 0.8) + tilt, -1), np.float32)

    top = 0.25 + 0.7 * (size - radius[0]) / (radius[1] - radius[0]) + 0.25 * rng.random(count)
    return stamps(rng, N, size, size * rng.uniform(0.55, 0.95, count), profile, np.minimum(top, 1.0))


@drawing
def far_heath(rng: Rng) -> Image:
    """Distant heath of a mountain: brown heather and straw, gorse, grey rocks; one pixel is 8 cm."""
    patch, fine = noise(rng, FAR, 4, 50, slope=0.9), noise(rng, FAR, 40, 256, slope=0.3)
    colour = mix([(84, 66, 54), (116, 96, 70), (150, 132, 92), (172, 156, 114)], 0.5 + 0.16 * patch + 0.08 * fine)
    count = 1_500
    size = rng.gamma(3.0, 1.0, count).clip(1.2, 8)
    width, lumps = size * rng.uniform(0.7, 1, count), rng.uniform(0, 2 * np.pi, (count, 4)).astype(np.float32)
    shrubs = settle(FAR, [stamps(rng, FAR, size, width, stone_profile(lumps), rng.uniform(0.3, 1, count))])
    kind = rng.random(count).astype(np.float32)[shrubs.owner]
    green = mix([(50, 58, 34), (74, 84, 44), (112, 82, 84)], kind / 0.72) * (0.6 + 0.4 * shrubs.height)[..., None]
    stone = mix([(138, 132, 124), (178, 171, 162)], (kind - 0.72) / 0.28) * (0.7 + 0.3 * shrubs.height)[..., None]
    piece = np.where((kind < 0.72)[..., None], green, stone)
    colour = np.where((shrubs.owner >= 0)[..., None], piece, colour * crevices(shrubs.height, 2.0, 0.5)[..., None])
    return even_out(np.asarray(colour, np.float32), cycles=5)


@drawing
def far_crags(rng: Rng) -> Image:
    """Distant bare granite with joints and ledges; one pixel is 8 cm."""
    grain, patch = noise(rng, FAR, 20, 256, slope=0.6), noise(rng, FAR, 4, 60, slope=1.0)
    crack = sum(np.exp(-((noise(rng, FAR, low, 8 * low, slope=0.9) / 0.12) ** 2)) for low in (5, 12))
    rock = mix([(112, 106, 99), (150, 143, 134), (182, 175, 166)], 0.5 + 0.15 * grain + 0.15 * patch)
    rock *= (1 - 0.3 * np.minimum(crack, 1))[..., None]
    ledge = np.clip(noise(rng, FAR, 8, 90, slope=0.7) - 0.9, 0, 1)[..., None]
    return even_out(np.asarray(rock * (1 - ledge) + linear((122, 112, 74)) * ledge, np.float32), cycles=5)

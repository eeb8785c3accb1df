# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of a lake shore and a dry hillside, and distant land. A tile of ground is 1.5 m, of scree 2.5 m."""

import numpy as np

from fieldtruth.core.arrays import Index
from fieldtruth.world.textures.canvas import (
    Image,
    Relief,
    Rng,
    Samples,
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
from fieldtruth.world.textures.ground import (
    DRY_GREENS,
    FINE,
    STRAW,
    N,
    blades_over_soil,
    dome,
    stone_profile,
    strewn_stones,
)


@drawing
def rough_grass(rng: Rng) -> Image:
    """Unmown grass: long overlapping blades, straw, dark gaps."""
    count = 15_000
    patches = noise(rng, FINE, 3, 24, slope=0.8)
    relief = settle(FINE, [strokes(rng, FINE, count, (16.0, 60.0), 3.0, 0.9)])
    tone = rng.random(count).astype(np.float32)[relief.owner]
    dead = rng.random(count).astype(np.float32)[relief.owner] < 0.24 * np.exp(0.4 * patches)
    green = mix([(62, 76, 36), (88, 102, 48), (110, 120, 62), (136, 138, 82)], 0.8 * tone + 0.08 * patches + 0.1)
    colour = np.where(dead[..., None], mix(STRAW, tone), green)
    gaps = mix([(40, 36, 22), (72, 64, 40)], 0.5 + 0.2 * noise(rng, FINE, 20, 300))
    colour = np.where((relief.owner < 0)[..., None], gaps, colour)
    light = (0.32 + 0.72 * relief.height) * crevices(relief.height, 4.0, 0.8)
    return even_out(halve(colour * light[..., None]))


@drawing
def mud(rng: Rng) -> Image:
    """Wet mud at the water's edge: smooth silt with ripples and bits of reed."""
    ripple = noise(rng, N, 10, 40, slope=0.6, stretch=0.35)
    grain = noise(rng, N, 60, 256, slope=0.2)
    wet = noise(rng, N, 3, 30, slope=1.0)
    silt = mix(
        [(52, 46, 36), (76, 67, 52), (98, 87, 68), (118, 106, 84)], 0.5 + 0.12 * ripple + 0.1 * wet + 0.05 * grain
    )
    pieces = 240
    length = rng.gamma(2.0, 5.0, pieces).clip(3, 34)
    reed = stamps(rng, N, length, rng.uniform(0.7, 1.6, pieces), lambda a, b, _: 1 - b**2 - 0.2 * a**2, 1.0)
    relief = settle(N, [reed])
    straw = mix([(96, 82, 58), (140, 122, 88), (170, 154, 118)], rng.random(pieces).astype(np.float32)[relief.owner])
    colour = np.where((relief.owner < 0)[..., None], silt, straw * np.float32(0.8))
    return even_out(colour * crevices(0.12 * ripple + (relief.owner >= 0), 2.0, 0.5)[..., None])


@drawing
def pebbles(rng: Rng) -> Image:
    """A beach of rounded pebbles of 1 to 7 cm with coarse sand between them."""
    count = 9_000
    relief = settle(FINE, [strewn_stones(rng, count, (3.0, 24.0), power=1.5, rise=(0.2, 1.0))])
    sand = mix([(112, 100, 80), (150, 136, 112), (178, 164, 138)], 0.5 + 0.25 * noise(rng, FINE, 60, 500, slope=0.2))
    tones = linear([(150, 144, 134), (176, 168, 154), (118, 112, 106), (196, 188, 174), (150, 128, 106), (98, 94, 92)])
    kind, bright = (
        rng.choice(len(tones), count, p=[0.28, 0.22, 0.18, 0.1, 0.13, 0.09]),
        rng.normal(1, 0.14, count).clip(0.6, 1.5),
    )
    stone = (tones[kind] * bright[:, None]).astype(np.float32)[relief.owner]
    stone = stone * (0.62 + 0.38 * dome(relief) + 0.05 * noise(rng, FINE, 60, 400, slope=0.3))[..., None]
    colour = np.where((relief.owner < 0)[..., None], sand * np.float32(0.8), stone)
    return even_out(halve(colour * crevices(relief.height, 4.0, 0.8)[..., None]))


@drawing
def murky_water(rng: Rng) -> Image:
    """Light that a lake scatters back from below its surface: murky green and brown, slowly varying."""
    n = 128
    cloud = 0.5 + 0.12 * noise(rng, n, 2, 12, slope=0.8)
    return np.asarray(mix([(38, 44, 30), (46, 54, 38), (54, 60, 40)], cloud), np.float32)


@drawing
def dry_turf(rng: Rng) -> Image:
    """Turf of a dry mountain in summer: bleached blades with soil and pebbles between them."""
    grass = blades_over_soil(
        rng, blades=17_000, straw=0.93, clover=1, greens=DRY_GREENS, earth=((92, 70, 46), (150, 122, 86))
    )
    relief = settle(FINE, [strewn_stones(rng, 500, (2.0, 11.0), power=1.7, rise=(0.3, 0.9))])
    tone = rng.random(500).astype(np.float32)[relief.owner]
    stone = mix([(94, 88, 80), (130, 123, 114), (150, 143, 133)], tone) * (0.6 + 0.4 * dome(relief))[..., None]
    bare = np.clip(noise(rng, FINE, 3, 40, slope=0.8) * 1.5 - 0.2, 0, 1)
    shown = halve(((relief.owner >= 0) * bare)[..., None].astype(np.float32))
    return even_out(np.asarray(grass * (1 - shown) + halve(stone) * shown, np.float32))


_GRUS = [(88, 72, 55), (126, 108, 86), (160, 144, 122)]
"""Soil of weathered granite: humus, coarse sand."""


@drawing
def stony_soil(rng: Rng) -> Image:
    """Thin dry soil of a hillside: coarse sand of granite with many angular stones of up to 8 cm."""
    count = 9_000
    relief = settle(FINE, [_shards(rng, count, (1.5, 26.0), power=1.75)])
    dust = mix(_GRUS, 0.5 + 0.2 * noise(rng, FINE, 4, 60, slope=0.9) + 0.12 * noise(rng, FINE, 60, 500, slope=0.2))
    colour = np.where((relief.owner < 0)[..., None], dust, _shard_colour(rng, relief, count))
    return even_out(halve(np.asarray(colour * crevices(relief.height, 3.0, 0.6)[..., None], np.float32)))


@drawing
def scree(rng: Rng) -> Image:
    """Broken granite: overlapping pieces of 1 to 20 cm."""
    count = 30_000
    relief = settle(FINE, [_shards(rng, count, (2.0, 42.0), power=1.9)])
    dust = mix(_GRUS, 0.35 + 0.2 * noise(rng, FINE, 4, 60, slope=0.9)) * np.float32(0.7)
    colour = np.where((relief.owner < 0)[..., None], dust, _shard_colour(rng, relief, count))
    light = (0.55 + 0.45 * relief.height) * crevices(relief.height, 5.0, 0.7)
    return even_out(halve(np.asarray(colour * light[..., None], np.float32)))


def _shards(rng: Rng, count: int, radius: tuple[float, float], *, power: float) -> Samples:
    """Splinters with straight sides, sizes as in `strewn_stones`; large ones are on top."""
    low, high = radius[0] ** -power, radius[1] ** -power
    size = (low + rng.random(count) * (high - low)) ** (-1 / power)
    turn = (np.arange(6) / 6 * 2 * np.pi + rng.uniform(-0.5, 0.5, (count, 6))).astype(np.float32)
    reach = rng.uniform(0.55, 0.95, (count, 6)).astype(np.float32)

    def profile(a: Image, b: Image, rows: Index) -> Image:
        edge = np.full(a.shape, 1.0, np.float32)
        for k in range(6):
            edge = np.minimum(edge, 1 - (a * np.cos(turn[rows, k]) + b * np.sin(turn[rows, k])) / reach[rows, k])
        return np.asarray(np.where(edge > 0, np.minimum(1, 0.35 + 3 * edge), -1), np.float32)

    top = 0.25 + 0.7 * (size - radius[0]) / (radius[1] - radius[0]) + 0.25 * rng.random(count)
    return stamps(rng, FINE, size, size * rng.uniform(0.55, 0.95, count), profile, np.minimum(top, 1.0))


def _shard_colour(rng: Rng, relief: Relief, count: int) -> Image:
    """Colour of each splinter by its tone and the tilt of its face."""
    tone, lean, turn = rng.random(count), rng.uniform(0.05, 0.3, count), rng.uniform(0, 2 * np.pi, count)
    across = np.cos(turn)[relief.owner] * relief.a + np.sin(turn)[relief.owner] * relief.b
    light = 1 + lean[relief.owner] * across + 0.07 * noise(rng, FINE, 40, 400, slope=0.4)
    stone = mix(
        [(110, 103, 95), (150, 142, 132), (180, 171, 159), (160, 140, 120)], tone.astype(np.float32)[relief.owner]
    )
    return np.asarray(stone * light[..., None], np.float32)


@drawing
def far_hillslope(rng: Rng) -> Image:
    """Dry slope at some distance: straw on sandy soil, tufts, scattered stones; one pixel is 2.3 cm."""
    patch, fine = noise(rng, N, 3, 30, slope=0.8), noise(rng, N, 30, 256, slope=0.35)
    straw = mix([(126, 108, 72), (160, 142, 98), (182, 166, 122)], 0.5 + 0.2 * fine)
    soil = mix(_GRUS, 0.45 + 0.16 * fine)
    share = np.clip(0.55 + 0.9 * patch + 0.5 * fine, 0, 1)[..., None]
    count = 2_400
    size = (1.2**-1.8 + rng.random(count) * (13.0**-1.8 - 1.2**-1.8)) ** (-1 / 1.8)
    lumps = rng.uniform(0, 2 * np.pi, (count, 4)).astype(np.float32)
    pieces = settle(
        N, [stamps(rng, N, size, size * rng.uniform(0.6, 1, count), stone_profile(lumps), rng.uniform(0.3, 1, count))]
    )
    kind = rng.random(count).astype(np.float32)[pieces.owner]
    tuft = mix([(96, 92, 56), (136, 124, 78), (168, 150, 102)], kind / 0.5 + 0.1 * fine)
    stone = mix([(124, 117, 108), (160, 152, 141), (182, 174, 163)], (kind - 0.5) / 0.5)
    piece = np.where((kind < 0.5)[..., None], tuft, stone) * (0.66 + 0.34 * pieces.height)[..., None]
    ground = (straw * share + soil * (1 - share)) * crevices(pieces.height, 1.5, 0.45)[..., None]
    return even_out(np.asarray(np.where((pieces.owner >= 0)[..., None], piece, ground), np.float32), cycles=5)


@drawing
def far_heath(rng: Rng) -> Image:
    """Distant heath of a mountain: brown heather and straw, gorse, grey rocks; one pixel is 8 cm."""
    patch, fine = noise(rng, N, 4, 50, slope=0.9), noise(rng, N, 40, 256, slope=0.3)
    colour = mix([(84, 66, 54), (116, 96, 70), (150, 132, 92), (172, 156, 114)], 0.5 + 0.16 * patch + 0.08 * fine)
    count = 1_500
    size = rng.gamma(3.0, 1.0, count).clip(1.2, 8)
    width, lumps = size * rng.uniform(0.7, 1, count), rng.uniform(0, 2 * np.pi, (count, 4)).astype(np.float32)
    shrubs = settle(N, [stamps(rng, N, size, width, stone_profile(lumps), rng.uniform(0.3, 1, count))])
    kind = rng.random(count).astype(np.float32)[shrubs.owner]
    green = mix([(50, 58, 34), (74, 84, 44), (112, 82, 84)], kind / 0.72) * (0.6 + 0.4 * shrubs.height)[..., None]
    stone = mix([(138, 132, 124), (178, 171, 162)], (kind - 0.72) / 0.28) * (0.7 + 0.3 * shrubs.height)[..., None]
    piece = np.where((kind < 0.72)[..., None], green, stone)
    colour = np.where((shrubs.owner >= 0)[..., None], piece, colour * crevices(shrubs.height, 2.0, 0.5)[..., None])
    return even_out(np.asarray(colour, np.float32), cycles=5)


@drawing
def far_crags(rng: Rng) -> Image:
    """Distant bare granite with joints and ledges; one pixel is 8 cm."""
    grain, patch = noise(rng, N, 20, 256, slope=0.6), noise(rng, N, 4, 60, slope=1.0)
    crack = sum(np.exp(-((noise(rng, N, low, 8 * low, slope=0.9) / 0.12) ** 2)) for low in (5, 12))
    rock = mix([(112, 106, 99), (150, 143, 134), (182, 175, 166)], 0.5 + 0.15 * grain + 0.15 * patch)
    rock *= (1 - 0.3 * np.minimum(crack, 1))[..., None]
    ledge = np.clip(noise(rng, N, 8, 90, slope=0.7) - 0.9, 0, 1)[..., None]
    return even_out(np.asarray(rock * (1 - ledge) + linear((122, 112, 74)) * ledge, np.float32), cycles=5)

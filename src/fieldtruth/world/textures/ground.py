# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of a park from above: lawn, soil, mulch, leaf litter, gravel, setts; and a distant meadow.

A tile is 1.5 m of ground, with texels of 1.5 mm, 0.5 m of setts, or 40 m of distant land. What is near has heights.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Index
from fieldtruth.world.textures.canvas import (
    Image,
    Profile,
    Relief,
    Rng,
    Samples,
    Tones,
    blur,
    cells,
    drawing,
    even_out,
    linear,
    mix,
    noise,
    stamps,
    strokes,
)
from fieldtruth.world.textures.strata import SIEVE, Kind, at_heights, layered

N: Final = 1024
SETTS: Final = 512

DRY_GREENS: Final = [(82, 86, 58), (108, 110, 76), (130, 128, 94), (150, 146, 114)]
STRAW: Final = [(104, 94, 72), (142, 130, 102), (176, 164, 134), (200, 190, 164)]
THATCH: Final = [(64, 56, 44), (98, 88, 70), (132, 120, 98)]
CLOVER: Final = [(66, 76, 50), (92, 104, 70), (116, 126, 92)]
GREYS: Final = [(104, 98, 90), (136, 129, 119), (164, 157, 146), (188, 181, 169), (212, 206, 196)]
LEAVES: Final = [(60, 50, 42), (96, 80, 64), (126, 106, 82), (148, 128, 100), (172, 154, 126)]
TWIGS: Final = [(64, 58, 52), (100, 92, 84), (134, 127, 117)]


@drawing
def blades_over_soil(
    rng: Rng,
    *,
    blades: int,
    straw: float,
    clover: int,
    greens: Tones,
    earth: Tones = ((52, 46, 38), (94, 84, 70)),
) -> Image:
    """Mown blades of grass over soil: a share ``straw`` of them is dead, ``clover`` leaves grow among them.

    Dead stems lie below the blades, moss and crumbs show in the gaps.
    """
    dead, patches = round(blades * straw), noise(rng, N, 4, 50, slope=0.6)
    tall = (1.0 + 0.22 * patches).clip(0.45, 1.45)
    grass = strokes(rng, N, blades - dead, (8.0, 26.0), 1.9, 0.5)
    grass = grass._replace(height=grass.height * tall[_texel(grass.y), _texel(grass.x)] * np.float32(0.8))
    upright = at_heights(strokes(rng, N, dead // 2, (8.0, 28.0), 1.7, 0.3), 0.0, 0.9)
    lying = at_heights(strokes(rng, N, dead - dead // 2 + 1_500, (14.0, 48.0), 1.6, 0.25), 0.16, 0.34)
    size = rng.uniform(4, 8, clover)
    leaves = stamps(rng, N, size, size * rng.uniform(0.75, 1, clover), _clover_leaf, rng.uniform(0.35, 0.7, clover))
    thatch = at_heights(strokes(rng, N, blades // 5, (4.0, 16.0), 1.5, 0.6), 0.05, 0.2)
    lumps = noise(rng, N, 16, 300, slope=0.7)
    soil = mix(earth, 0.5 + 0.2 * lumps)
    moss = np.clip(noise(rng, N, 4, 50, slope=0.7) - 0.5, 0, 0.8)[..., None]
    soil = soil * (1 - moss) + linear((74, 78, 52)) * moss
    kinds = [Kind(thatch, THATCH), Kind(lying, STRAW), Kind(upright, STRAW), Kind(grass, greens, (1.6, 1.6))]
    return layered(rng, soil, 0.08 + 0.03 * lumps, [*kinds, Kind(leaves, CLOVER)], depth=1.1, clumps=0.17)


def _texel(at: Image) -> Index:
    return np.floor(at).astype(np.intp) % N


def _clover_leaf(a: Image, b: Image, _rows: Index) -> Image:
    turn = np.arctan2(b, a)
    return np.asarray(0.75 + 0.25 * np.cos(3 * turn) - np.hypot(a, b), np.float32)


def stone_profile(lumps: Image) -> Profile:
    """Profile of rounded pebbles; the phases ``lumps`` (k, 4) vary their outlines."""

    def profile(a: Image, b: Image, rows: Index) -> Image:
        turn, wave = np.arctan2(b, a), lumps[rows]
        rim = (
            0.86
            + 0.09 * np.sin(2 * turn + wave[:, 0])
            + 0.07 * np.sin(3 * turn + wave[:, 1])
            + 0.04 * np.sin(5 * turn + wave[:, 2])
        )
        inside = 1 - (np.hypot(a, b) / rim) ** 2
        return np.asarray(np.where(inside > 0, np.sqrt(np.maximum(inside, 0)), -1), np.float32)

    return profile


def strewn_stones(
    rng: Rng, count: int, radius: tuple[float, float], *, power: float, rise: tuple[float, float]
) -> Samples:
    """Scattered stones with radii [pixels] between two limits; the number above r falls as r^-power."""
    low, high = radius[0] ** -power, radius[1] ** -power
    size = (low + rng.random(count) * (high - low)) ** (-1 / power)
    lumps = rng.uniform(0, 2 * np.pi, (count, 4)).astype(np.float32)
    top = rise[0] + (rise[1] - rise[0]) * (size - radius[0]) / (radius[1] - radius[0])
    return stamps(
        rng, N, size, size * rng.uniform(0.6, 0.95, count), stone_profile(lumps), top * rng.uniform(0.8, 1, count)
    )


@drawing
def gravel(rng: Rng) -> Image:
    """Bound gravel of a park path: packed sand and fines with embedded stones of 3 to 25 mm, by a sieve curve."""
    stones, grit = 11_000, 60_000
    large = strewn_stones(rng, stones, (2.0, 9.0), power=SIEVE, rise=(0.45, 1.0))
    small = strewn_stones(rng, grit, (0.7, 2.0), power=SIEVE, rise=(0.3, 0.55))
    lumps, fines = noise(rng, N, 5, 60, slope=0.8), noise(rng, N, 100, 500, slope=0.1)
    sand = mix([(142, 132, 116), (172, 161, 143), (198, 188, 170)], 0.5 + 0.12 * lumps + 0.2 * fines)
    bits = at_heights(strokes(rng, N, 350, (4.0, 22.0), 1.6, 0.4), 0.5, 0.7)
    kinds = [Kind(small, GREYS, (1.3, 1.3)), Kind(large, GREYS, (1.4, 1.5)), Kind(bits, THATCH)]
    return layered(rng, sand, 0.36 + 0.10 * lumps + 0.04 * fines, kinds, depth=0.9)


def dome(relief: Relief) -> Image:
    """Height 0 to 1 of each piece as a hemisphere."""
    return np.asarray(np.sqrt(np.clip(1 - relief.a**2 - relief.b**2, 0, 1)), np.float32)


@drawing
def garden_soil(rng: Rng) -> Image:
    """Dark garden soil: crumbs of all sizes, a few small stones, rotten bits of leaves and stems."""
    crumbs = strewn_stones(rng, 16_000, (1.3, 14.0), power=1.8, rise=(0.3, 1.0))
    stones = strewn_stones(rng, 300, (2.0, 9.0), power=2.0, rise=(0.5, 0.9))
    bits = at_heights(strokes(rng, N, 1_200, (5.0, 30.0), 2.0, 0.4), 0.55, 0.8)
    lumps = noise(rng, N, 8, 200, slope=0.7)
    ground = mix([(58, 50, 42), (94, 84, 72)], 0.5 + 0.2 * lumps)
    earth = [(62, 54, 46), (92, 82, 70), (118, 106, 92)]
    kinds = [Kind(crumbs, earth), Kind(stones, GREYS), Kind(bits, THATCH)]
    return layered(rng, ground, 0.3 + 0.08 * lumps, kinds, depth=1.2)


@drawing
def bark_mulch(rng: Rng) -> Image:
    """Overlapping chips of conifer bark, 1 to 6 cm, weathered grey and brown."""
    count = 7_000
    length = rng.gamma(4.0, 3.2, count).clip(4, 36)
    chips = stamps(rng, N, length, length * rng.uniform(0.2, 0.6, count), _chip, rng.uniform(0.15, 1, count))
    fine = at_heights(strokes(rng, N, 9_000, (4.0, 16.0), 2.2, 0.2), 0.1, 0.7)
    tones = [(54, 45, 38), (92, 76, 62), (124, 104, 86), (156, 138, 118)]
    ground = mix([(44, 38, 32), (66, 58, 50)], 0.5 + 0.2 * noise(rng, N, 20, 300))
    kinds = [Kind(chips, tones, (1.6, 2.0)), Kind(fine, tones)]
    return layered(rng, ground, np.full((N, N), 0.08, np.float32), kinds, depth=1.1)


def _chip(a: Image, b: Image, rows: Index) -> Image:
    ends = 0.92 + 0.08 * np.sin(7 * b + rows)
    inside = np.minimum(ends - np.abs(a), 1 - np.abs(b) * (1 + 0.3 * np.abs(a)))
    return np.asarray(np.where(inside > 0, np.minimum(1, 4 * inside), -1), np.float32)


@drawing
def leaf_litter(rng: Rng) -> Image:
    """Dead leaves on the ground in layers, 3 to 9 cm long, curled, torn, brown to grey; twigs and crumbs of leaves."""
    count, crumbs = 1_900, 7_000
    length = rng.uniform(10, 30, count)
    leaves = stamps(rng, N, length, length * rng.uniform(0.4, 0.75, count), dead_leaf, rng.uniform(0.3, 1, count))
    size = rng.uniform(1.5, 5, crumbs)
    torn = stamps(rng, N, size, size * rng.uniform(0.4, 0.9, crumbs), _chip, rng.uniform(0.1, 0.8, crumbs))
    twigs = at_heights(strokes(rng, N, 160, (30.0, 130.0), 3.2, 0.3), 0.3, 1.0)
    ground = mix([(48, 42, 36), (80, 70, 60)], 0.5 + 0.25 * noise(rng, N, 20, 300, slope=0.6))
    kinds = [Kind(leaves, LEAVES, (1.4, 1.8)), Kind(torn, LEAVES), Kind(twigs, TWIGS)]
    return layered(rng, ground, 0.1 + 0.03 * noise(rng, N, 8, 100, slope=0.8), kinds, depth=1.0)


def dead_leaf(a: Image, b: Image, rows: Index) -> Image:
    """Profile of a leaf: a pointed oval with a wavy margin that differs between rows."""
    wave = 1 + 0.08 * np.sin(11 * a + rows)
    half = np.clip(1 - a**2, 0, 1) ** 0.8 * (1 - 0.25 * a) * wave
    return np.asarray(np.where(np.abs(b) < half, 0.7 + 0.3 * np.abs(b), -1), np.float32)


@drawing
def setts(rng: Rng) -> Image:
    """Granite cobbles, about 8 cm, in sand, without a direction, so that they fit a border of any orientation."""
    bend = [0.05 * noise(rng, SETTS, 4, 20, slope=1.6) for _ in range(2)]
    joint = cells(rng, SETTS, 6, 6, jitter=0.5, shift=bend)
    gap = joint.second - joint.nearest + 0.012 * noise(rng, SETTS, 20, 120)
    crown = np.clip((gap - 0.06) / 0.4, 0, 1) ** 0.5
    tone = rng.beta(4, 4, 36).astype(np.float32)[joint.owner]
    grain, hollow = noise(rng, SETTS, 60, 256, slope=0.0), noise(rng, SETTS, 8, 60)
    stone = mix([(104, 100, 96), (132, 128, 122), (156, 150, 142), (148, 137, 126)], tone)
    stone *= ((1 + 0.12 * grain) * (0.66 + 0.34 * crown + 0.06 * hollow))[..., None]
    sand = mix([(86, 76, 60), (128, 114, 92)], 0.5 + 0.25 * noise(rng, SETTS, 20, 250, slope=0.4)) * np.float32(0.7)
    moss = np.clip(noise(rng, SETTS, 3, 40) - 0.6, 0, 0.8)[..., None]
    sand = sand * (1 - moss) + linear((66, 70, 42)) * moss
    share = np.clip((gap - 0.06) / 0.06, 0, 1)[..., None]
    top = np.clip(share[..., 0] * (0.45 + 0.5 * crown) + 0.03 * grain, 0, 1)[..., None]
    return np.concatenate([sand * (1 - share) + stone * share, top], axis=-1).astype(np.float32)


@drawing
def far_meadow(rng: Rng) -> Image:
    """Distant rough grassland: tussocks, pale dry patches, dark weeds; one pixel is 8 cm."""
    tussock = noise(rng, SETTS, 30, 250, slope=0.3)
    patch = noise(rng, SETTS, 5, 60, slope=0.9)
    colour = mix([(70, 82, 46), (98, 108, 62), (122, 126, 78), (152, 146, 102)], 0.45 + 0.12 * patch + 0.07 * tussock)
    weeds = 0.5 * np.clip(noise(rng, SETTS, 12, 120, slope=0.6) - 1.3, 0, 1)[..., None]
    colour = colour * (1 - weeds) + linear((62, 72, 40)) * weeds
    return even_out(colour * (1 + 0.06 * blur(tussock, 0.7))[..., None], cycles=5)

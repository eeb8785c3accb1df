# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground from above: of a park, a forest, a lake shore and a dry hillside; and distant land.

Ground is pieces that lie on each other: their heights, their colours, and the light that reaches between them. A tile
is 1.5 m of ground, with texels of 1.5 mm, 2.5 m of scree, 0.5 m of setts, or 40 m of distant land. What is near has
heights.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

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

SIEVE: Final = 2.5
"""Number of grains above a radius r falls as r^-2.5: by Fuller's curve the mass that passes a sieve grows as the root
of its mesh (Fuller and Thompson 1907)."""


class Kind(NamedTuple):
    """Pieces of one kind: samples, colours from dark to light, and how the tones of pieces vary (beta distribution)."""

    pieces: Samples
    tones: Tones
    tone: tuple[float, float] = (2.0, 2.0)


def at_heights(pieces: Samples, low: float, high: float) -> Samples:
    """Pieces with heights 0 to 1 moved to ``low`` to ``high``."""
    return pieces._replace(height=(low + (high - low) * pieces.height).astype(np.float32))


def layered(
    rng: Rng, colour: Image, height: Image, kinds: Sequence[Kind], *, depth: float = 1.0, clumps: float = 0.1
) -> Image:
    """Soil of a ``colour`` (n, n, 3) and ``height`` (n, n) 0 to 1 with pieces on it: colour and height (n, n, 4).

    What lies below soil or other pieces is hidden. ``depth`` scales the darkness between pieces, ``clumps`` is the
    deviation of the tones that neighbours share, over 2 to 20 cm.
    """
    n, first = len(height), np.cumsum([0, *(int(k.pieces.owner.max()) + 1 for k in kinds)])
    relief = settle(
        n, [k.pieces._replace(owner=k.pieces.owner + np.int32(f)) for k, f in zip(kinds, first, strict=False)]
    )
    shown = (relief.owner >= 0) & (relief.height > height)
    grain = 0.06 * noise(rng, n, 20, 0.45 * n, slope=0.4) + clumps * noise(rng, n, 8, 60, slope=0.5)
    fleck = np.exp(np.float32(0.06) * noise(rng, n, n / 8, n / 2, slope=0.0))
    for kind, start, end in zip(kinds, first[:-1], first[1:], strict=True):
        own = shown & (relief.owner >= start) & (relief.owner < end)
        tone = rng.beta(*kind.tone, end - start).astype(np.float32)[relief.owner[own] - start]
        colour[own] = mix(kind.tones, (tone + grain[own])[None])[0]
    top = blur(np.where(shown, relief.height, height), 0.7)
    light = openness(top, depth)
    soft = blur(colour * (light * fleck)[..., None], 0.45)  # a piece covers a part of a texel
    return even_out(np.concatenate([soft, top[..., None]], axis=-1).astype(np.float32))


def openness(height: Image, depth: float = 1.0) -> Image:
    """Light from the sky between pieces, about 1: less below the surroundings at three widths [texel]."""
    lost = sum(
        weight * np.maximum(ndimage.uniform_filter(height, size, mode="wrap") - height, -0.15)
        for size, weight in ((5, 1.0), (13, 0.9), (31, 0.7))
    )
    return np.asarray(np.clip(np.exp(-np.float32(depth * 1.2) * lost), 0.2, 1.3), np.float32)


N: Final = 1024
SETTS: Final = 512
FAR: Final = 512
DRY_GREENS: Final = [(82, 86, 58), (108, 110, 76), (130, 128, 94), (150, 146, 114)]
STRAW: Final = [(104, 94, 72), (142, 130, 102), (176, 164, 134), (200, 190, 164)]
THATCH: Final = [(64, 56, 44), (98, 88, 70), (132, 120, 98)]
CLOVER: Final = [(66, 76, 50), (92, 104, 70), (116, 126, 92)]
GREYS: Final = [(104, 98, 90), (136, 129, 119), (164, 157, 146), (188, 181, 169), (212, 206, 196)]
LEAVES: Final = [(60, 50, 42), (96, 80, 64), (126, 106, 82), (148, 128, 100), (172, 154, 126)]
TWIGS: Final = [(64, 58, 52), (100, 92, 84), (134, 127, 117)]


@drawing
def blades_over_soil(
    rng: Rng, *, blades: int, straw: float, clover: int, greens: Tones, earth: Tones = ((52, 46, 38), (94, 84, 70))
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
    bed = np.clip(0.42 + 0.17 * cushion, 0, 0.75)
    grown = grown._replace(height=bed[_texel(grown.y), _texel(grown.x)] + np.float32(0.25) * grown.height)
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


@drawing
def rough_grass(rng: Rng) -> Image:
    """Unmown grass: long overlapping blades, straw that lies below them, stalks, dark gaps."""
    count, dead = 19_000, 6_000
    patches = noise(rng, N, 3, 24, slope=0.8)
    blades = strokes(rng, N, count, (14.0, 62.0), 2.6, 0.8)
    clumps = (0.85 + 0.25 * noise(rng, N, 10, 50, slope=0.5)).clip(0.35, 1.15)
    blades = blades._replace(height=blades.height * clumps[_texel(blades.y), _texel(blades.x)])
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
def dry_turf(rng: Rng) -> Image:
    """Turf of a dry mountain in summer: tufts of bleached blades, lying straw, soil and pebbles between them."""
    tufts = noise(rng, N, 6, 30, slope=0.6)
    blades = strokes(rng, N, 17_000, (10.0, 36.0), 2.0, 0.6)
    grown = np.clip(0.62 + 0.3 * tufts, 0.12, 1.1)
    blades = blades._replace(height=blades.height * grown[_texel(blades.y), _texel(blades.x)])
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

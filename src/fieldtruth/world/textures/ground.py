# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of a park from above: lawn, soil, mulch, leaf litter, gravel, setts; and a distant meadow.

A tile is 1.5 m of ground, 0.5 m of setts, or 40 m of distant land. Fine detail is drawn at twice the resolution and
averaged, so that a blade of grass covers part of a pixel.
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

N: Final = 512
FINE: Final = 2 * N


DRY_GREENS: Final = [(84, 90, 48), (110, 112, 64), (132, 128, 80), (148, 142, 96)]
STRAW: Final = [(116, 102, 64), (152, 138, 92), (176, 162, 116)]


@drawing
def blades_over_soil(
    rng: Rng,
    *,
    blades: int,
    straw: float,
    clover: int,
    greens: Tones,
    earth: Tones = ((48, 40, 28), (92, 78, 54)),
) -> Image:
    """Mown blades of grass over soil: a share ``straw`` of them is dead, ``clover`` leaves grow among them."""
    patches = noise(rng, FINE, 3, 24, slope=0.8)
    grass = strokes(rng, FINE, blades, (7.0, 24.0), 2.2, 0.5)
    leaves = stamps(
        rng, FINE, rng.uniform(5, 8, clover), rng.uniform(4, 6, clover), _clover_leaf, rng.uniform(0.4, 0.8, clover)
    )
    relief = settle(FINE, [grass, leaves._replace(owner=leaves.owner + np.int32(blades))])
    tone = np.concatenate([rng.random(blades), np.full(clover, 0.35)]).astype(np.float32)[relief.owner]
    dead = np.concatenate([rng.random(blades), np.ones(clover)]).astype(np.float32)[relief.owner]
    green = mix(greens, 0.75 * tone + 0.08 * patches + 0.1)
    colour = np.where((dead < straw * np.exp(0.35 * patches))[..., None], mix(STRAW, tone), green)
    soil = mix(earth, 0.5 + 0.2 * noise(rng, FINE, 20, 300))
    colour = np.where((relief.owner < 0)[..., None], soil, colour)
    light = (0.42 + 0.62 * relief.height) * crevices(relief.height, 3.0, 0.6)
    return even_out(halve(colour * light[..., None]))


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
        rng, FINE, size, size * rng.uniform(0.6, 0.95, count), stone_profile(lumps), top * rng.uniform(0.8, 1, count)
    )


@drawing
def gravel(rng: Rng) -> Image:
    """Bound gravel of a park path: packed sand with embedded stones of 3 to 25 mm."""
    count = 26_000
    relief = settle(FINE, [strewn_stones(rng, count, (1.3, 10.0), power=1.9, rise=(0.2, 1.0))])
    sand = mix([(150, 134, 108), (186, 170, 142), (206, 192, 166)], 0.5 + 0.25 * noise(rng, FINE, 60, 500, slope=0.2))
    sand *= (1 + 0.05 * noise(rng, FINE, 5, 40))[..., None]
    tones = linear(
        [(168, 158, 142), (190, 180, 160), (146, 138, 126), (200, 192, 176), (160, 142, 118), (126, 120, 112)]
    )
    kind, bright = (
        rng.choice(len(tones), count, p=[0.3, 0.25, 0.15, 0.1, 0.13, 0.07]),
        rng.normal(1, 0.16, count).clip(0.6, 1.5),
    )
    stone = (tones[kind] * bright[:, None]).astype(np.float32)[relief.owner]
    stone = stone * (0.70 + 0.30 * dome(relief) + 0.05 * noise(rng, FINE, 60, 400, slope=0.3))[..., None]
    colour = np.where((relief.owner < 0)[..., None], sand, stone)
    return even_out(halve(colour * crevices(relief.height, 2.5, 0.7)[..., None]))


def dome(relief: Relief) -> Image:
    """Height 0 to 1 of each piece as a hemisphere."""
    return np.asarray(np.sqrt(np.clip(1 - relief.a**2 - relief.b**2, 0, 1)), np.float32)


@drawing
def garden_soil(rng: Rng) -> Image:
    """Dark garden soil: crumbs of all sizes, a few small stones."""
    count = 16_000
    relief = settle(FINE, [strewn_stones(rng, count, (1.5, 14.0), power=1.8, rise=(0.3, 1.0))])
    ground = mix([(50, 40, 30), (92, 76, 58)], 0.5 + 0.25 * noise(rng, FINE, 20, 300, slope=0.6))
    tone = rng.random(count).astype(np.float32)[relief.owner]
    crumb = mix([(64, 52, 40), (96, 80, 62), (116, 98, 78)], tone + 0.15 * noise(rng, FINE, 30, 400, slope=0.4))
    crumb *= (0.6 + 0.4 * dome(relief))[..., None]
    colour = np.where((relief.owner < 0)[..., None], ground, crumb)
    return even_out(halve(colour * crevices(relief.height, 4.0, 0.8)[..., None]))


@drawing
def bark_mulch(rng: Rng) -> Image:
    """Overlapping chips of conifer bark, 1 to 6 cm."""
    count = 7_000
    length = rng.gamma(4.0, 3.2, count).clip(5, 36)
    chips = stamps(rng, FINE, length, length * rng.uniform(0.2, 0.6, count), _chip, rng.uniform(0.15, 1, count))
    relief = settle(FINE, [chips])
    tone = rng.beta(2, 2.5, count).astype(np.float32)[relief.owner]
    fibre = noise(rng, FINE, 20, 300, slope=0.6)
    chip = mix([(44, 32, 24), (86, 62, 44), (122, 90, 64), (158, 124, 92)], tone + 0.09 * fibre)
    chip *= (0.8 + 0.2 * np.sqrt(np.clip(1 - relief.b**2, 0, 1)) + 0.06 * np.sin(9 * relief.b + 6 * tone))[..., None]
    colour = np.where((relief.owner < 0)[..., None], linear((38, 30, 24)), chip)
    light = (0.4 + 0.6 * relief.height) * crevices(relief.height, 4.0, 0.7)
    return even_out(halve(colour * light[..., None]))


def _chip(a: Image, b: Image, rows: Index) -> Image:
    ends = 0.92 + 0.08 * np.sin(7 * b + rows)
    inside = np.minimum(ends - np.abs(a), 1 - np.abs(b) * (1 + 0.3 * np.abs(a)))
    return np.asarray(np.where(inside > 0, np.minimum(1, 4 * inside), -1), np.float32)


@drawing
def leaf_litter(rng: Rng) -> Image:
    """Dead leaves on the ground, 4 to 9 cm long, brown to yellow."""
    count = 1_500
    length = rng.uniform(14, 30, count)
    leaves = stamps(rng, FINE, length, length * rng.uniform(0.45, 0.75, count), dead_leaf, rng.uniform(0.1, 1, count))
    relief = settle(FINE, [leaves])
    tone = rng.beta(1.6, 2.0, count).astype(np.float32)[relief.owner]
    curl = np.cos(2.2 * relief.b + 5 * tone)
    leaf = mix([(70, 48, 32), (112, 78, 48), (146, 106, 64), (172, 138, 92)], tone + 0.12 * noise(rng, FINE, 12, 200))
    vein = np.exp(-((relief.b / 0.05) ** 2)) + 0.5 * np.exp(
        -((np.sin(10 * (relief.a - 0.8 * np.abs(relief.b))) / 0.3) ** 2)
    )
    leaf *= (0.86 + 0.14 * curl + 0.14 * vein)[..., None]
    ground = mix([(50, 40, 30), (86, 70, 52)], 0.5 + 0.25 * noise(rng, FINE, 20, 300, slope=0.6))
    colour = np.where((relief.owner < 0)[..., None], ground, leaf)
    light = (0.5 + 0.5 * relief.height) * crevices(relief.height, 5.0, 0.6)
    return even_out(halve(colour * light[..., None]))


def dead_leaf(a: Image, b: Image, rows: Index) -> Image:
    """Profile of a leaf: a pointed oval with a wavy margin that differs between rows."""
    wave = 1 + 0.08 * np.sin(11 * a + rows)
    half = np.clip(1 - a**2, 0, 1) ** 0.8 * (1 - 0.25 * a) * wave
    return np.asarray(np.where(np.abs(b) < half, 0.5 + 0.5 * np.abs(b), -1), np.float32)


@drawing
def setts(rng: Rng) -> Image:
    """Granite cobbles, about 8 cm, in sand, without a direction, so that they fit a border of any orientation."""
    bend = [0.05 * noise(rng, N, 4, 20, slope=1.6) for _ in range(2)]
    joint = cells(rng, N, 6, 6, jitter=0.5, shift=bend)
    gap = joint.second - joint.nearest + 0.012 * noise(rng, N, 20, 120)
    crown = np.clip((gap - 0.06) / 0.4, 0, 1) ** 0.5
    tone = rng.beta(4, 4, 36).astype(np.float32)[joint.owner]
    grain, hollow = noise(rng, N, 60, 256, slope=0.0), noise(rng, N, 8, 60)
    stone = mix([(104, 100, 96), (132, 128, 122), (156, 150, 142), (148, 137, 126)], tone)
    stone *= ((1 + 0.12 * grain) * (0.66 + 0.34 * crown + 0.06 * hollow))[..., None]
    sand = mix([(86, 76, 60), (128, 114, 92)], 0.5 + 0.25 * noise(rng, N, 20, 250, slope=0.4)) * np.float32(0.7)
    moss = np.clip(noise(rng, N, 3, 40) - 0.6, 0, 0.8)[..., None]
    sand = sand * (1 - moss) + linear((66, 70, 42)) * moss
    share = np.clip((gap - 0.06) / 0.06, 0, 1)[..., None]
    return np.asarray(sand * (1 - share) + stone * share, np.float32)


@drawing
def far_meadow(rng: Rng) -> Image:
    """Distant rough grassland: tussocks, pale dry patches, dark weeds; one pixel is 8 cm."""
    tussock = noise(rng, N, 30, 250, slope=0.3)
    patch = noise(rng, N, 5, 60, slope=0.9)
    colour = mix([(70, 82, 46), (98, 108, 62), (122, 126, 78), (152, 146, 102)], 0.45 + 0.12 * patch + 0.07 * tussock)
    weeds = 0.5 * np.clip(noise(rng, N, 12, 120, slope=0.6) - 1.3, 0, 1)[..., None]
    colour = colour * (1 - weeds) + linear((62, 72, 40)) * weeds
    return even_out(colour * (1 + 0.06 * blur(tussock, 0.7))[..., None], cycles=5)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grounds seen from above: lawns, soil, mulch, leaf litter, gravel, setts, dry turf, scree; and land from afar.

A tile is 1.5 m of ground near by (scree 2.5 m), 0.5 m of setts, 40 m of land from afar. Fine things are drawn at
twice the resolution and averaged, so that a blade of grass covers part of a pixel.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.world.textures.canvas import (
    Image,
    Profile,
    Recipe,
    Relief,
    Rng,
    Samples,
    blur,
    cells,
    crevices,
    even_out,
    halve,
    linear,
    mix,
    noise,
    settle,
    stamps,
    strokes,
)

N = 512
FINE = 2 * N


def lawn(rng: Rng) -> Image:
    """Mown grass in summer: green blades, a tenth of straw, clover leaves, soil in the gaps."""
    return _grass(rng, blades=36_000, straw=0.06, clover=260, greens=_FRESH)


def lawn_dry(rng: Rng) -> Image:
    """Mown grass after weeks without rain: half straw, more soil."""
    return _grass(rng, blades=34_000, straw=0.5, clover=60, greens=_TIRED)


_FRESH = [(70, 84, 40), (92, 108, 53), (110, 124, 64), (132, 140, 80)]
_TIRED = [(84, 90, 48), (110, 112, 64), (132, 128, 80), (148, 142, 96)]
_STRAW = [(116, 102, 64), (152, 138, 92), (176, 162, 116)]


def _grass(
    rng: Rng, *, blades: int, straw: float, clover: int, greens: list[tuple[int, int, int]],
    earth: tuple[tuple[int, int, int], tuple[int, int, int]] = ((48, 40, 28), (92, 78, 54)),
) -> Image:  # fmt: skip
    patches = noise(rng, FINE, 3, 24, slope=0.8)
    grass = strokes(rng, FINE, blades, (7.0, 24.0), 2.2, 0.5)
    leaves = stamps(
        rng, FINE, rng.uniform(5, 8, clover), rng.uniform(4, 6, clover), _clover_leaf, rng.uniform(0.4, 0.8, clover)
    )
    relief = settle(FINE, [grass, leaves._replace(owner=leaves.owner + np.int32(blades))])
    tone = np.concatenate([rng.random(blades), np.full(clover, 0.35)]).astype(np.float32)[relief.owner]
    dead = np.concatenate([rng.random(blades), np.ones(clover)]).astype(np.float32)[relief.owner]
    green = mix(greens, 0.75 * tone + 0.08 * patches + 0.1)
    colour = np.where((dead < straw * np.exp(0.35 * patches))[..., None], mix(_STRAW, tone), green)
    soil = mix(earth, 0.5 + 0.2 * noise(rng, FINE, 20, 300))
    colour = np.where((relief.owner < 0)[..., None], soil, colour)
    light = (0.42 + 0.62 * relief.height) * crevices(relief.height, 3.0, 0.6)
    return even_out(halve(colour * light[..., None]))


def _clover_leaf(a: Image, b: Image, _rows: NDArray[np.intp]) -> Image:
    turn = np.arctan2(b, a)
    return np.asarray(0.75 + 0.25 * np.cos(3 * turn) - np.hypot(a, b), np.float32)


def _stone(lumps: Image) -> Profile:
    """Rounded pebble; ``lumps`` (k, 4) makes each one's outline its own."""

    def profile(a: Image, b: Image, rows: NDArray[np.intp]) -> Image:
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


def _pebbles(rng: Rng, count: int, radius: tuple[float, float], *, power: float, rise: tuple[float, float]) -> Samples:
    """Stones between two radii [pixels], many small and few large: N(>r) falls as r^-power."""
    low, high = radius[0] ** -power, radius[1] ** -power
    size = (low + rng.random(count) * (high - low)) ** (-1 / power)
    lumps = rng.uniform(0, 2 * np.pi, (count, 4)).astype(np.float32)
    top = rise[0] + (rise[1] - rise[0]) * (size - radius[0]) / (radius[1] - radius[0])
    return stamps(
        rng, FINE, size, size * rng.uniform(0.6, 0.95, count), _stone(lumps), top * rng.uniform(0.8, 1, count)
    )


def gravel(rng: Rng) -> Image:
    """Bound gravel of a park's trail: packed sand with stones of 3 to 25 mm pressed into it."""
    count = 26_000
    relief = settle(FINE, [_pebbles(rng, count, (1.3, 10.0), power=1.9, rise=(0.2, 1.0))])
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
    stone = stone * (0.70 + 0.30 * _dome(relief) + 0.05 * noise(rng, FINE, 60, 400, slope=0.3))[..., None]
    colour = np.where((relief.owner < 0)[..., None], sand, stone)
    return even_out(halve(colour * crevices(relief.height, 2.5, 0.7)[..., None]))


def _dome(relief: Relief) -> Image:
    return np.asarray(np.sqrt(np.clip(1 - relief.a**2 - relief.b**2, 0, 1)), np.float32)


def soil(rng: Rng) -> Image:
    """Dark garden soil: crumbs of all sizes, a few small stones."""
    count = 16_000
    relief = settle(FINE, [_pebbles(rng, count, (1.5, 14.0), power=1.8, rise=(0.3, 1.0))])
    ground = mix([(50, 40, 30), (92, 76, 58)], 0.5 + 0.25 * noise(rng, FINE, 20, 300, slope=0.6))
    tone = rng.random(count).astype(np.float32)[relief.owner]
    crumb = mix([(64, 52, 40), (96, 80, 62), (116, 98, 78)], tone + 0.15 * noise(rng, FINE, 30, 400, slope=0.4))
    crumb *= (0.6 + 0.4 * _dome(relief))[..., None]
    colour = np.where((relief.owner < 0)[..., None], ground, crumb)
    return even_out(halve(colour * crevices(relief.height, 4.0, 0.8)[..., None]))


def mulch(rng: Rng) -> Image:
    """Chips of conifer bark, 1 to 6 cm, thrown over each other."""
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


def _chip(a: Image, b: Image, rows: NDArray[np.intp]) -> Image:
    ends = 0.92 + 0.08 * np.sin(7 * b + rows)
    inside = np.minimum(ends - np.abs(a), 1 - np.abs(b) * (1 + 0.3 * np.abs(a)))
    return np.asarray(np.where(inside > 0, np.minimum(1, 4 * inside), -1), np.float32)


def litter(rng: Rng) -> Image:
    """Last year's leaves on the ground, 4 to 9 cm long, brown to yellow."""
    count = 1_500
    length = rng.uniform(14, 30, count)
    leaves = stamps(rng, FINE, length, length * rng.uniform(0.45, 0.75, count), _dead_leaf, rng.uniform(0.1, 1, count))
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


def _dead_leaf(a: Image, b: Image, rows: NDArray[np.intp]) -> Image:
    """Pointed oval with a wavy margin; rows give each leaf its own waves."""
    wave = 1 + 0.08 * np.sin(11 * a + rows)
    half = np.clip(1 - a**2, 0, 1) ** 0.8 * (1 - 0.25 * a) * wave
    return np.asarray(np.where(np.abs(b) < half, 0.5 + 0.5 * np.abs(b), -1), np.float32)


def setts(rng: Rng) -> Image:
    """Cobbles of granite, about 8 cm, in sand; laid without a direction, so that a border may run any way."""
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


def meadow(rng: Rng) -> Image:
    """Rough grassland from afar: tussocks, paler dry patches, darker weeds; one pixel is 8 cm."""
    tussock = noise(rng, N, 30, 250, slope=0.3)
    patch = noise(rng, N, 5, 60, slope=0.9)
    colour = mix([(70, 82, 46), (98, 108, 62), (122, 126, 78), (152, 146, 102)], 0.45 + 0.12 * patch + 0.07 * tussock)
    weeds = 0.5 * np.clip(noise(rng, N, 12, 120, slope=0.6) - 1.3, 0, 1)[..., None]
    colour = colour * (1 - weeds) + linear((62, 72, 40)) * weeds
    return even_out(colour * (1 + 0.06 * blur(tussock, 0.7))[..., None], cycles=5)


def rough_grass(rng: Rng) -> Image:
    """Grass that nobody mows: long blades that lie over each other, last year's straw, herbs' leaves, dark gaps."""
    count = 15_000
    patches = noise(rng, FINE, 3, 24, slope=0.8)
    relief = settle(FINE, [strokes(rng, FINE, count, (16.0, 60.0), 3.0, 0.9)])
    tone = rng.random(count).astype(np.float32)[relief.owner]
    dead = rng.random(count).astype(np.float32)[relief.owner] < 0.24 * np.exp(0.4 * patches)
    green = mix([(62, 76, 36), (88, 102, 48), (110, 120, 62), (136, 138, 82)], 0.8 * tone + 0.08 * patches + 0.1)
    colour = np.where(dead[..., None], mix(_STRAW, tone), green)
    gaps = mix([(40, 36, 22), (72, 64, 40)], 0.5 + 0.2 * noise(rng, FINE, 20, 300))
    colour = np.where((relief.owner < 0)[..., None], gaps, colour)
    light = (0.32 + 0.72 * relief.height) * crevices(relief.height, 4.0, 0.8)
    return even_out(halve(colour * light[..., None]))


def mud(rng: Rng) -> Image:
    """Wet mud at the water's edge: smooth silt with ripples, worm casts, bits of reed and a few drowned pebbles."""
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


def pebbles(rng: Rng) -> Image:
    """A beach of rounded pebbles of 1 to 7 cm, washed, with coarse sand between them."""
    count = 9_000
    relief = settle(FINE, [_pebbles(rng, count, (3.0, 24.0), power=1.5, rise=(0.2, 1.0))])
    sand = mix([(112, 100, 80), (150, 136, 112), (178, 164, 138)], 0.5 + 0.25 * noise(rng, FINE, 60, 500, slope=0.2))
    tones = linear([(150, 144, 134), (176, 168, 154), (118, 112, 106), (196, 188, 174), (150, 128, 106), (98, 94, 92)])
    kind, bright = (
        rng.choice(len(tones), count, p=[0.28, 0.22, 0.18, 0.1, 0.13, 0.09]),
        rng.normal(1, 0.14, count).clip(0.6, 1.5),
    )
    stone = (tones[kind] * bright[:, None]).astype(np.float32)[relief.owner]
    stone = stone * (0.62 + 0.38 * _dome(relief) + 0.05 * noise(rng, FINE, 60, 400, slope=0.3))[..., None]
    colour = np.where((relief.owner < 0)[..., None], sand * np.float32(0.8), stone)
    return even_out(halve(colour * crevices(relief.height, 4.0, 0.8)[..., None]))


def water(rng: Rng) -> Image:
    """What a lake scatters back from below its surface: murky green and brown, in slow clouds."""
    n = 128
    cloud = 0.5 + 0.12 * noise(rng, n, 2, 12, slope=0.8)
    return np.asarray(mix([(38, 44, 30), (46, 54, 38), (54, 60, 40)], cloud), np.float32)


def turf_dry(rng: Rng) -> Image:
    """Turf of a dry mountain in summer: bleached stalks with soil and pebbles between them."""
    grass = _grass(rng, blades=17_000, straw=0.93, clover=1, greens=_TIRED, earth=((92, 70, 46), (150, 122, 86)))
    relief = settle(FINE, [_pebbles(rng, 500, (2.0, 11.0), power=1.7, rise=(0.3, 0.9))])
    tone = rng.random(500).astype(np.float32)[relief.owner]
    stone = mix([(96, 86, 72), (130, 120, 104), (148, 138, 122)], tone) * (0.6 + 0.4 * _dome(relief))[..., None]
    bare = np.clip(noise(rng, FINE, 3, 40, slope=0.8) * 1.5 - 0.2, 0, 1)
    shown = halve(((relief.owner >= 0) * bare)[..., None].astype(np.float32))
    return even_out(np.asarray(grass * (1 - shown) + halve(stone) * shown, np.float32))


_OCHRE = [(108, 84, 58), (148, 120, 86), (176, 148, 110)]


def soil_stony(rng: Rng) -> Image:
    """Thin dry soil of a hillside: ochre dust, full of angular stones up to 8 cm."""
    count = 9_000
    relief = settle(FINE, [_shards(rng, count, (1.5, 26.0), power=1.75)])
    dust = mix(_OCHRE, 0.5 + 0.2 * noise(rng, FINE, 4, 60, slope=0.9) + 0.12 * noise(rng, FINE, 60, 500, slope=0.2))
    colour = np.where((relief.owner < 0)[..., None], dust, _shard_colour(rng, relief, count))
    return even_out(halve(np.asarray(colour * crevices(relief.height, 3.0, 0.6)[..., None], np.float32)))


def scree(rng: Rng) -> Image:
    """Broken limestone that covers the ground, splinters of 1 to 20 cm one over the other."""
    count = 30_000
    relief = settle(FINE, [_shards(rng, count, (2.0, 42.0), power=1.9)])
    dust = mix(_OCHRE, 0.35 + 0.2 * noise(rng, FINE, 4, 60, slope=0.9)) * np.float32(0.7)
    colour = np.where((relief.owner < 0)[..., None], dust, _shard_colour(rng, relief, count))
    light = (0.55 + 0.45 * relief.height) * crevices(relief.height, 5.0, 0.7)
    return even_out(halve(np.asarray(colour * light[..., None], np.float32)))


def _shards(rng: Rng, count: int, radius: tuple[float, float], *, power: float) -> Samples:
    """Splinters with straight sides, N(>r) falling as r^-power; large ones lie on top."""
    low, high = radius[0] ** -power, radius[1] ** -power
    size = (low + rng.random(count) * (high - low)) ** (-1 / power)
    turn = (np.arange(6) / 6 * 2 * np.pi + rng.uniform(-0.5, 0.5, (count, 6))).astype(np.float32)
    reach = rng.uniform(0.55, 0.95, (count, 6)).astype(np.float32)

    def profile(a: Image, b: Image, rows: NDArray[np.intp]) -> Image:
        edge = np.full(a.shape, 1.0, np.float32)
        for k in range(6):
            edge = np.minimum(edge, 1 - (a * np.cos(turn[rows, k]) + b * np.sin(turn[rows, k])) / reach[rows, k])
        return np.asarray(np.where(edge > 0, np.minimum(1, 0.35 + 3 * edge), -1), np.float32)

    top = 0.25 + 0.7 * (size - radius[0]) / (radius[1] - radius[0]) + 0.25 * rng.random(count)
    return stamps(rng, FINE, size, size * rng.uniform(0.55, 0.95, count), profile, np.minimum(top, 1.0))


def _shard_colour(rng: Rng, relief: Relief, count: int) -> Image:
    """Each splinter's own tone, and its own light as its face leans."""
    tone, lean, turn = rng.random(count), rng.uniform(0.05, 0.3, count), rng.uniform(0, 2 * np.pi, count)
    across = np.cos(turn)[relief.owner] * relief.a + np.sin(turn)[relief.owner] * relief.b
    light = 1 + lean[relief.owner] * across + 0.07 * noise(rng, FINE, 40, 400, slope=0.4)
    stone = mix(
        [(118, 102, 82), (154, 138, 114), (182, 167, 142), (164, 132, 96)], tone.astype(np.float32)[relief.owner]
    )
    return np.asarray(stone * light[..., None], np.float32)


def hillslope(rng: Rng) -> Image:
    """Dry slope at some distance: straw on ochre soil, tufts, strewn stones; one pixel is 2.3 cm."""
    patch, fine = noise(rng, N, 3, 30, slope=0.8), noise(rng, N, 30, 256, slope=0.35)
    straw = mix([(126, 108, 72), (160, 142, 98), (182, 166, 122)], 0.5 + 0.2 * fine)
    soil = mix(_OCHRE, 0.45 + 0.16 * fine)
    share = np.clip(0.55 + 0.9 * patch + 0.5 * fine, 0, 1)[..., None]
    count = 2_400
    size = (1.2**-1.8 + rng.random(count) * (13.0**-1.8 - 1.2**-1.8)) ** (-1 / 1.8)
    lumps = rng.uniform(0, 2 * np.pi, (count, 4)).astype(np.float32)
    things = settle(
        N, [stamps(rng, N, size, size * rng.uniform(0.6, 1, count), _stone(lumps), rng.uniform(0.3, 1, count))]
    )
    kind = rng.random(count).astype(np.float32)[things.owner]
    tuft = mix([(96, 92, 56), (136, 124, 78), (168, 150, 102)], kind / 0.5 + 0.1 * fine)
    stone = mix([(130, 116, 96), (164, 150, 128), (184, 170, 148)], (kind - 0.5) / 0.5)
    thing = np.where((kind < 0.5)[..., None], tuft, stone) * (0.66 + 0.34 * things.height)[..., None]
    ground = (straw * share + soil * (1 - share)) * crevices(things.height, 1.5, 0.45)[..., None]
    return even_out(np.asarray(np.where((things.owner >= 0)[..., None], thing, ground), np.float32), cycles=5)


def garrigue(rng: Rng) -> Image:
    """Dry mountainside from afar: straw and bare ochre, pale rocks, dark dots of shrubs; one pixel is 8 cm."""
    patch, fine = noise(rng, N, 4, 50, slope=0.9), noise(rng, N, 40, 256, slope=0.3)
    colour = mix([(128, 108, 76), (160, 142, 100), (176, 160, 118), (188, 174, 138)], 0.5 + 0.16 * patch + 0.08 * fine)
    count = 1_500
    size = rng.gamma(3.0, 1.0, count).clip(1.2, 8)
    shrubs = settle(N, [stamps(rng, N, size, size * rng.uniform(0.7, 1, count), _stone(
        rng.uniform(0, 2 * np.pi, (count, 4)).astype(np.float32)), rng.uniform(0.3, 1, count))])  # fmt: skip
    kind = rng.random(count).astype(np.float32)[shrubs.owner]
    green = mix([(58, 64, 38), (84, 88, 52), (110, 108, 70)], kind / 0.72) * (0.6 + 0.4 * shrubs.height)[..., None]
    stone = mix([(150, 144, 132), (190, 184, 172)], (kind - 0.72) / 0.28) * (0.7 + 0.3 * shrubs.height)[..., None]
    thing = np.where((kind < 0.72)[..., None], green, stone)
    colour = np.where((shrubs.owner >= 0)[..., None], thing, colour * crevices(shrubs.height, 2.0, 0.5)[..., None])
    return even_out(np.asarray(colour, np.float32), cycles=5)


def crags(rng: Rng) -> Image:
    """Bare rock of a mountain from afar, broken by ledges and gullies; one pixel is 8 cm."""
    grain, patch = noise(rng, N, 20, 256, slope=0.6), noise(rng, N, 4, 60, slope=1.0)
    beds = noise(rng, N, 6, 120, slope=0.9, stretch=0.25)
    crack = sum(np.exp(-((noise(rng, N, low, 8 * low, slope=0.9) / 0.12) ** 2)) for low in (5, 12))
    rock = mix([(112, 104, 92), (150, 142, 128), (182, 174, 160)], 0.5 + 0.13 * grain + 0.13 * patch + 0.1 * beds)
    rock *= (1 - 0.3 * np.minimum(crack, 1))[..., None]
    ledge = np.clip(noise(rng, N, 8, 90, slope=0.7) - 0.9, 0, 1)[..., None]
    return even_out(np.asarray(rock * (1 - ledge) + linear((122, 112, 74)) * ledge, np.float32), cycles=5)


RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType(
    {
        "lawn": Recipe(lawn, (0.105, 0.126, 0.041)),
        "lawn_dry": Recipe(lawn_dry, (0.170, 0.155, 0.072)),
        "soil": Recipe(soil, (0.105, 0.075, 0.048)),
        "mulch": Recipe(mulch, (0.105, 0.060, 0.034)),
        "litter": Recipe(litter, (0.105, 0.075, 0.044)),
        "gravel": Recipe(gravel, (0.305, 0.270, 0.214)),
        "setts": Recipe(setts, (0.205, 0.192, 0.172)),
        "meadow": Recipe(meadow, (0.115, 0.130, 0.050)),
        "turf_dry": Recipe(turf_dry, (0.242, 0.200, 0.108)),
        "soil_stony": Recipe(soil_stony, (0.182, 0.136, 0.090)),
        "scree": Recipe(scree, (0.215, 0.186, 0.146)),
        "hillslope": Recipe(hillslope, (0.205, 0.163, 0.098)),
        "garrigue": Recipe(garrigue, (0.185, 0.153, 0.092)),
        "crags": Recipe(crags, (0.200, 0.175, 0.134)),
        "rough_grass": Recipe(rough_grass, (0.095, 0.110, 0.038)),
        "mud": Recipe(mud, (0.085, 0.068, 0.046)),
        "water": Recipe(water, (0.024, 0.031, 0.021)),
        "pebbles": Recipe(pebbles, (0.220, 0.195, 0.160)),
    }
)

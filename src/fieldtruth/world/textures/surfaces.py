# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Distant land; rocks; man-made materials.

A tile of distant woods is 24 m, a pixel 4.7 cm: crowns side by side; a pixel of other distant land is 8 cm. Rocks,
weathered and with lichen, have tiles of 1.2 m, planks (grain along u), painted iron, galvanised steel, concrete, setts
and glass of 0.5 m.

``tones`` are colours (k, 3) from dark to light, ``stain`` that of rust or soil, sRGB 0 to 255; ``lichen`` lists crusts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fieldtruth.world.textures.canvas import (
    Image,
    Rng,
    Tone,
    Tones,
    blur,
    cells,
    crevices,
    drawing,
    even_out,
    hollows,
    linear,
    mix,
    noise,
    ridges,
    settle,
    stamps,
    stone_profile,
)

N = 512
"""Pixels along each side."""


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
    top = np.clip(share[..., 0] * (0.45 + 0.5 * crown) + 0.03 * grain, 0, 1)[..., None]
    return np.concatenate([sand * (1 - share) + stone * share, top], axis=-1).astype(np.float32)


@drawing
def far_meadow(rng: Rng) -> Image:
    """Distant rough grassland: tussocks, pale dry patches, dark weeds; one pixel is 8 cm."""
    tussock = noise(rng, N, 30, 250, slope=0.3)
    patch = noise(rng, N, 5, 60, slope=0.9)
    colour = mix([(70, 82, 46), (98, 108, 62), (122, 126, 78), (152, 146, 102)], 0.45 + 0.12 * patch + 0.07 * tussock)
    weeds = 0.5 * np.clip(noise(rng, N, 12, 120, slope=0.6) - 1.3, 0, 1)[..., None]
    colour = colour * (1 - weeds) + linear((62, 72, 40)) * weeds
    return even_out(colour * (1 + 0.06 * blur(tussock, 0.7))[..., None], cycles=5)


@drawing
def far_heath(rng: Rng) -> Image:
    """Distant heath of a mountain: brown heather and straw, gorse, grey rocks; one pixel is 8 cm.

    Most shrubs are smaller than a pixel of a slope that is far away; those of 1 to 2 m are what is seen of it.
    """
    patch, fine = noise(rng, N, 4, 50, slope=0.9), noise(rng, N, 40, 256, slope=0.3)
    colour = mix([(84, 66, 54), (116, 96, 70), (150, 132, 92), (172, 156, 114)], 0.5 + 0.16 * patch + 0.08 * fine)
    count, large = 1_500, 120
    size = rng.gamma(3.0, 1.0, count).clip(1.2, 8)
    size[:large] = 5.0 * (14.0 / 5.0) ** (rng.random(large) ** 1.5)
    width, lumps = size * rng.uniform(0.7, 1, count), rng.uniform(0, 2 * np.pi, (count, 4)).astype(np.float32)
    shrubs = settle(N, [stamps(rng, N, size, width, stone_profile(lumps), rng.uniform(0.3, 1, count))])
    kinds = rng.random(count).astype(np.float32)
    kinds[:large] *= 0.12
    kind = kinds[shrubs.owner]
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


@drawing
def far_canopy(rng: Rng, *, tones: Tones) -> Image:
    """Crowns of several species and ages, each of bunches of leaves, with dark gaps between them."""
    bend = [0.16 * noise(rng, N, 4, 30, slope=0.9) for _ in range(2)]
    large, small = cells(rng, N, 5, 5, jitter=1.0, shift=bend), cells(rng, N, 11, 11, jitter=1.0, shift=bend)
    own = [rng.random((count, 3)).astype(np.float32) for count in (25, 121)]
    young = own[0][large.owner, 0] < 0.45  # crowns of half the size
    crown = np.where(young, small.nearest, large.nearest)
    kind, age = (np.where(young, own[1][small.owner, k], own[0][large.owner, k]) for k in (1, 2))
    bunch = noise(rng, N, 12, 50, slope=0.4) + 0.6 * noise(rng, N, 40, 110, slope=0.3)
    spray = noise(rng, N, 90, 256, slope=0.2)
    dome = np.sqrt(np.clip(1 - (crown / 0.66) ** 2, 0, 1)) * (0.6 + 0.5 * age)
    height = np.asarray(dome + 0.16 * bunch + 0.05 * spray, np.float32)
    colour = mix(tones, 0.05 + 0.75 * kind + 0.10 * bunch + 0.06 * spray)
    gap = np.clip(1.4 * (noise(rng, N, 10, 90, slope=0.6) - 1.0) + 1.6 * (0.32 - dome), 0, 0.85)[..., None]
    colour = colour * (1 - gap) + linear((22, 24, 16)) * gap
    light = hollows(height, 30.0, (2.0, 6.0, 16.0)) * (0.45 + 0.65 * dome)
    return even_out(np.asarray(colour * light[..., None], np.float32))


@dataclass(frozen=True, kw_only=True)
class Crust:
    """Lichen of one colour: about ``share`` of the image, ``patches`` per tile."""

    shade: Tone
    patches: float
    share: float


def _cracks(rng: Rng, across: int, *, width: float, share: float) -> Image:
    """Lines (n, n) between cells, 1 in a crack; about ``share`` of them are open."""
    bend = [0.16 * noise(rng, N, 3, 40, slope=1.2) for _ in range(2)]
    net = cells(rng, N, across, across, jitter=0.95, shift=bend)
    open_here = np.clip((noise(rng, N, 2, 12, slope=0.8) + 2.2 * (share - 0.5)) * 1.5, 0, 1)
    line = np.clip(1 - (net.second - net.nearest) / width, 0, 1)
    return np.asarray(line * open_here, np.float32)


def _joints(rng: Rng, count: float) -> Image:
    """Long cracks of two families at right angles (n, n), 1 in a joint, ``count`` per tile; some are closed."""
    lines = np.zeros((N, N), np.float32)
    for turned in (False, True):
        family = ridges(rng, N, count, stretch=1.5, spread=0.8)
        shut = np.clip(0.6 + 0.8 * noise(rng, N, 2, 12, slope=0.8), 0, 1)
        ragged = 0.002 * noise(rng, N, 30, 250, slope=0.5)
        line = np.clip(1 - (family + ragged) / 0.005, 0, 1) * shut
        lines = np.maximum(lines, line.T if turned else line)
    return lines


def _strata(rng: Rng, colour: Image, strength: float) -> Image:
    """The colour with beds along u, and runs of water stains across them."""
    bed = noise(rng, N, 4, 70, slope=0.9, stretch=0.12)
    run = np.clip(noise(rng, N, 3, 50, slope=1.0, stretch=6.0) - 0.6, 0, 1.5)
    return np.asarray(colour * (1 + strength * bed - 0.16 * run)[..., None], np.float32)


def _overgrown(rng: Rng, colour: Image, lichen: Sequence[Crust]) -> Image:
    """Cover the image with crusts that have ragged rims, one after another."""
    for crust in lichen:
        fine = 2 * crust.patches
        field = noise(rng, N, crust.patches / 3, fine, slope=0.6) + 0.55 * noise(rng, N, fine, 160, slope=0.9)
        level = np.float32(np.quantile(field, 1 - crust.share))
        covered = np.clip((field - level) * 3.0, 0, 1)[..., None] * np.float32(0.8)
        grain = (1 + 0.12 * noise(rng, N, 60, 256, slope=0.2))[..., None]
        colour = np.asarray(colour * (1 - covered) + linear(crust.shade) * grain * covered, np.float32)
    return colour


@drawing
def pitted_rock(rng: Rng, *, tones: Tones, stain: Tone, lichen: Sequence[Crust]) -> Image:
    """Limestone of dry mountains: pitted by rain, cracked, stained."""
    swell, grain = noise(rng, N, 3, 40, slope=1.1), noise(rng, N, 30, 256, slope=0.7)
    pits = np.clip(noise(rng, N, 25, 120, slope=0.4) - 1.0, 0, 1.5)
    cracks = _joints(rng, 2.5) + 0.6 * _cracks(rng, 14, width=0.1, share=0.35)
    height = 0.35 * swell + 0.16 * grain - 0.7 * pits - 1.4 * cracks
    colour = _strata(rng, mix(tones, 0.5 + 0.16 * swell + 0.1 * grain), 0.09)
    ochre = np.clip(0.45 * noise(rng, N, 3, 30, slope=1.0) - 0.25, 0, 0.6)[..., None]
    colour = colour * (1 - ochre) + linear(stain) * ochre
    colour = _overgrown(rng, colour, lichen)
    light = crevices(height, 3.0, 0.4) * (1 - np.float32(0.5) * np.clip(cracks, 0, 1))
    return even_out(np.asarray(colour * light[..., None], np.float32))


@drawing
def granular_rock(rng: Rng, *, tones: Tones, shares: Sequence[float], stain: Tone, lichen: Sequence[Crust]) -> Image:
    """Granite: mineral grains, each tone with its share, cracked, stained by rust."""
    mineral = cells(rng, N, 190, 190)
    kind = rng.choice(len(tones), 190 * 190, p=shares)[mineral.owner]
    swell, grain = noise(rng, N, 3, 40, slope=1.1), noise(rng, N, 40, 256, slope=0.5)
    cracks = _joints(rng, 2.0) + 0.5 * _cracks(rng, 9, width=0.05, share=0.3)
    pits = np.clip(noise(rng, N, 30, 140, slope=0.4) - 1.2, 0, 1.2)
    rust = np.clip(0.4 * noise(rng, N, 3, 24, slope=1.0) - 0.1, 0, 0.55)[..., None]
    colour = linear(tones)[kind] * (1 + 0.10 * swell + 0.06 * grain)[..., None]
    colour = _strata(rng, colour * (1 - rust) + linear(stain) * (1 + 0.08 * grain)[..., None] * rust, 0.07)
    colour = _overgrown(rng, colour, lichen)
    light = crevices(0.3 * swell + 0.15 * grain - 1.5 * cracks - 0.8 * pits, 3.0, 0.5) * (
        1 - 0.6 * np.clip(cracks, 0, 1)
    )
    return even_out(np.asarray(colour * light[..., None], np.float32))


@drawing
def smooth_rock(rng: Rng, *, tones: Tones, stain: Tone, lichen: Sequence[Crust]) -> Image:
    """Field stones: worn smooth, with soil in the hollows."""
    swell, grain = noise(rng, N, 3, 50, slope=1.0), noise(rng, N, 40, 256, slope=0.4)
    colour = mix(tones, 0.5 + 0.17 * swell + 0.09 * grain)
    pits = np.clip(noise(rng, N, 25, 120, slope=0.4) - 1.1, 0, 1.2)
    cracks = 0.7 * _joints(rng, 1.5) + 0.5 * _cracks(rng, 8, width=0.05, share=0.3)
    earth = np.clip(0.5 * noise(rng, N, 4, 60, slope=0.8) - 0.35, 0, 0.7)[..., None]
    colour = _strata(rng, colour * (1 - earth) + linear(stain) * earth, 0.06)
    colour = _overgrown(rng, colour, lichen)
    light = crevices(0.4 * swell + 0.25 * grain - pits - cracks, 2.5, 0.45) * (1 - 0.5 * np.clip(cracks, 0, 1))
    return even_out(np.asarray(colour * light[..., None], np.float32))


@drawing
def layered_rock(rng: Rng, *, tones: Tones, stain: Tone, lichen: Sequence[Crust]) -> Image:
    """Schist: fine parallel layers along u, stained by rust."""
    layers = noise(rng, N, 12, 200, slope=0.5, stretch=0.03)
    swell, grain = noise(rng, N, 3, 40, slope=1.1), noise(rng, N, 50, 256, slope=0.3)
    colour = mix(tones, 0.5 + 0.13 * layers + 0.09 * swell)
    rust = np.clip(0.45 * noise(rng, N, 3, 40, slope=0.9, stretch=0.3) - 0.15, 0, 0.6)[..., None]
    colour = colour * (1 - rust) + linear(stain) * rust
    colour *= (1 + 0.1 * grain)[..., None]
    colour = _overgrown(rng, colour, lichen)
    light = crevices(blur(0.7 * layers, 0.6) + 0.2 * swell, 2.5, 0.5) * (1 - 0.6 * _joints(rng, 2.5))
    return even_out(np.asarray(colour * light[..., None], np.float32))


@drawing
def planks(rng: Rng, *, tones: Tones, cracks: float) -> Image:
    """Planks with growth rings bent around two knots, fibres, and ``cracks`` (0 to 1) along the grain."""
    grid = (np.arange(N, dtype=np.float32) + 0.5) / N
    bend = 0.55 * noise(rng, N, 1, 12, slope=1.6, stretch=0.02)
    knot = np.zeros((N, N), np.float32)
    for _ in range(2):
        at_u, at_v = rng.random(2)
        du, dv = (grid - at_u + 0.5) % 1 - 0.5, ((grid - at_v + 0.5) % 1 - 0.5)[:, None]
        knot += np.exp(-((du / 0.05) ** 2 + (dv / 0.018) ** 2))
    rings = (22 * grid[:, None] + bend + 1.6 * knot) % 1
    late = rings**3 * (1 - np.clip((rings - 0.93) / 0.07, 0, 1))
    fibre = noise(rng, N, 20, 256, slope=0.3, stretch=0.008)
    board = noise(rng, N, 2, 10, stretch=0.05)
    colour = mix(tones, 0.62 - 0.38 * late + 0.11 * fibre + 0.07 * board - 0.5 * np.clip(knot - 0.45, 0, 1))
    split = np.clip(noise(rng, N, 12, 200, slope=0.2, stretch=0.004) - 2.0, 0, 0.8) * cracks
    return even_out(colour * (1 - split)[..., None])


@drawing
def weathered_pole(rng: Rng) -> Image:
    """An impregnated and weathered trunk: brown grey, split along the grain."""
    fibre = noise(rng, N, 12, 256, slope=0.3, stretch=0.006)
    bleached = noise(rng, N, 4, 40, slope=0.8, stretch=0.05)
    colour = mix([(84, 70, 54), (116, 100, 80), (138, 124, 104), (152, 141, 124)], 0.5 + 0.13 * fibre + 0.12 * bleached)
    split = np.clip(1.6 * noise(rng, N, 8, 120, slope=0.5, stretch=0.003) - 2.9, 0, 0.85)
    return even_out(colour * (1 - split)[..., None])


@drawing
def painted_iron(rng: Rng) -> Image:
    """Cast iron under dark green paint, with rust where it is chipped."""
    coat = mix(
        [(34, 48, 42), (42, 58, 50), (50, 66, 58)],
        0.5 + 0.1 * noise(rng, N, 8, 120) + 0.07 * noise(rng, N, 60, 256, slope=0),
    )
    chips = noise(rng, N, 10, 200, slope=0.9)
    rust = mix([(92, 54, 34), (128, 80, 50)], 0.5 + 0.3 * noise(rng, N, 30, 250, slope=0.3))
    edge = np.clip((chips - 2.3) / 0.25, 0, 1)[..., None]
    dust = 0.05 * np.clip(1 + 0.6 * noise(rng, N, 4, 250, slope=0.4), 0, 3)[..., None]
    coat = coat * (1 - dust) + linear((120, 116, 104)) * dust
    return even_out(coat * (1 - edge) + rust * edge)


@drawing
def galvanised_steel(rng: Rng) -> Image:
    """Hot-dip galvanised steel: spangles of zinc in different greys, dulled by weather."""
    n = 256
    bend = [0.2 * noise(rng, n, 4, 60) for _ in range(2)]
    spangle = cells(rng, n, 26, 26, jitter=1.0, shift=bend)
    tone = rng.random(26 * 26).astype(np.float32)[spangle.owner]
    dull = 0.5 + 0.35 * (tone - 0.5) + 0.07 * noise(rng, n, 3, 40) + 0.05 * noise(rng, n, 40, 128, slope=0)
    return even_out(mix([(140, 144, 148), (170, 173, 176), (196, 198, 200)], dull))


@drawing
def concrete(rng: Rng) -> Image:
    """Cast concrete: fine sand, pores, weather stains."""
    tone = 0.5 + 0.08 * noise(rng, N, 4, 60) + 0.07 * noise(rng, N, 80, 256, slope=0) + 0.06 * noise(rng, N, 20, 200)
    colour = mix([(132, 128, 120), (160, 156, 147), (184, 180, 170)], tone)
    size = rng.gamma(1.2, 0.6, 700).clip(0.6, 3)
    pores = settle(N, [stamps(rng, N, size, size * rng.uniform(0.7, 1, 700), lambda a, b, _: 1 - a**2 - b**2, 1.0)])
    return even_out(np.where((pores.owner >= 0)[..., None], colour * np.float32(0.62), colour))

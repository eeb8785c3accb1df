# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Barks and dead wood. u runs around the trunk and v along it; a tile is about 0.5 m.

``tones`` are colours (k, 3) from dark to light, sRGB 0 to 255.
"""

import numpy as np

from fieldtruth.core.arrays import Index
from fieldtruth.world.textures.canvas import (
    Image,
    Rng,
    Tone,
    Tones,
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
)

N = 512


@drawing
def furrowed_bark(rng: Rng, *, width: float, stretch: float, depth: float, cracks: float, tones: Tones) -> Image:
    """Furrows along the trunk between ridges that cracks divide into blocks.

    Furrows run where stretched noise changes sign, so they branch and meet like the splits of a growing trunk.
    ``width`` is the number of ridges per tile, ``depth`` the furrows' share, ``cracks`` the strength of those across.
    """
    main = np.abs(noise(rng, N, width / 4, 2.2 * width, slope=1.2, stretch=stretch))
    minor = np.abs(noise(rng, N, width, 5 * width, slope=1.0, stretch=stretch))
    across = np.abs(noise(rng, N, width, 4 * width, slope=1.0, stretch=0.2))
    rough = noise(rng, N, 20, 256, slope=0.6, stretch=2.0)
    ridge = np.clip((main + 0.06 * rough) / depth, 0, 1) ** 0.7
    split = 1 - (1 - np.clip(across / 0.22, 0, 1)) * cracks * np.clip(ridge * 2, 0, 1)
    height = (ridge * split * (0.75 + 0.25 * np.clip(minor / 0.4, 0, 1))).astype(np.float32)
    plate = noise(rng, N, 4, 60, slope=0.9, stretch=3.0)
    colour = mix(tones, 0.06 + 0.68 * height + 0.07 * plate + 0.07 * rough)
    # Green algae on the ridges, where rain runs down.
    algae = 0.22 * np.clip(noise(rng, N, 3, 20, stretch=3.0) - 0.3, 0, 1)[..., None] * height[..., None]
    colour = colour * (1 - algae) + linear((104, 110, 72)) * algae
    return even_out(colour * crevices(height, 4.0, 0.55)[..., None])


@drawing
def plated_bark(rng: Rng, *, across: int, along: int, gap: float, relief: float, tones: Tones) -> Image:
    """Plates or scales of bark: cells with ragged borders that peel in layers; ``gap`` between them is dark."""
    bend = [0.16 * noise(rng, N, 3, 14) + 0.035 * noise(rng, N, 16, 90, slope=0.8) for _ in range(2)]
    found = cells(rng, N, across, along, jitter=0.9, shift=bend)
    edge = np.clip((found.second - found.nearest) / gap, 0, 1)
    layer = noise(rng, N, 6, 120, slope=0.9, stretch=1.6)
    rough = noise(rng, N, 30, 256, slope=0.4, stretch=2.0)
    own = rng.uniform(-0.5, 0.5, across * along).astype(np.float32)[found.owner]
    height = (edge**0.6 * (0.8 + 0.1 * own + 0.1 * np.floor(layer * 1.5) / 1.5)).astype(np.float32)
    colour = mix(tones, 0.12 + 0.6 * height + 0.14 * own + 0.05 * layer + 0.05 * rough)
    return even_out(colour * crevices(height, 4.0, relief)[..., None])


@drawing
def birch_bark(rng: Rng, *, tones: Tones, marks: Tones) -> Image:
    """White bark that peels around the trunk, with lenticels and a few scars in the two colours of ``marks``."""
    n = 2 * N
    count, scars = 330, 4
    length, width = rng.gamma(2.0, 11.0, count).clip(5, 80), rng.uniform(1.6, 4.2, count)
    dashes = stamps(rng, n, length, width, _oval, np.full(count, 0.5), turn=0.05)
    sides = rng.uniform(28, 70, scars)
    rhombs = stamps(rng, n, sides, sides * rng.uniform(0.3, 0.5, scars), _rhombus, np.full(scars, 1.0), turn=0.15)
    relief = settle(n, [dashes, rhombs._replace(owner=rhombs.owner + np.int32(count))])
    torn = noise(rng, n, 20, 400, slope=0.6, stretch=0.3)
    depth = 1 - np.where(relief.owner < count, np.hypot(relief.a, relief.b), np.abs(relief.a) + np.abs(relief.b))
    lenticel = (relief.owner >= 0) & (relief.owner < count) & (depth + 0.12 * torn > 0.12)
    scar = (relief.owner >= count) & (depth + 0.22 * torn > 0.18)
    dark = halve(np.stack([lenticel, scar], axis=2).astype(np.float32))
    band = noise(rng, N, 3, 200, slope=0.8, stretch=0.08)
    sheet = noise(rng, N, 3, 60, slope=1.0, stretch=0.4)
    grain = noise(rng, N, 60, 256, slope=0.0)
    colour = mix(tones, 0.62 + 0.10 * band + 0.14 * sheet + 0.03 * grain)
    peel = np.clip(noise(rng, N, 3, 160, slope=0.6, stretch=0.03) - 1.9, 0, 0.5)[..., None]
    colour = colour * (1 - 0.8 * peel)
    for k, mark in enumerate(marks):
        share = dark[..., k : k + 1]
        colour = colour * (1 - share) + linear(mark) * (1 + 0.15 * grain)[..., None] * share
    return even_out(colour)


def _oval(a: Image, b: Image, _rows: Index) -> Image:
    return np.asarray(1 - a**2 - b**2, np.float32)


def _rhombus(a: Image, b: Image, _rows: Index) -> Image:
    return np.asarray(1 - np.abs(a) - np.abs(b), np.float32)


@drawing
def twig_bark(rng: Rng, *, tones: Tones) -> Image:
    """Smooth bark of thin stems with pale lenticels."""
    n = 256
    count = 260
    spots = stamps(rng, 2 * n, rng.uniform(2, 6, count), rng.uniform(1, 2.4, count), _oval, np.ones(count), turn=0.3)
    share = 0.7 * halve((settle(2 * n, [spots]).owner >= 0).astype(np.float32)[..., None])
    grain = noise(rng, n, 4, 120, slope=0.8, stretch=6.0)
    skin = mix(tones, 0.5 + 0.16 * grain)
    return even_out(skin * (1 - share) + linear((146, 132, 112)) * share)


@drawing
def flaking_bark(rng: Rng, *, tones: Tones, flake: Tone) -> Image:
    """Papery bark that peels off in small flakes, as on the upper trunk of pines."""
    sheet = noise(rng, N, 5, 90, slope=1.0, stretch=0.8)
    flakes = np.clip(noise(rng, N, 10, 160, slope=0.7, stretch=1.4) - 0.7, 0, 1)
    grain = noise(rng, N, 40, 256, slope=0.3)
    colour = mix(tones, 0.5 + 0.16 * sheet + 0.05 * grain)
    edge = np.clip(1 - np.abs(noise(rng, N, 6, 60, slope=1.1, stretch=0.7)) / 0.07, 0, 1)[..., None]
    colour = (colour * (1 - 0.45 * edge)).astype(np.float32)
    return even_out(colour * (1 - 0.6 * flakes[..., None]) + 0.6 * flakes[..., None] * linear(flake))


@drawing
def smooth_bark(rng: Rng, *, tones: Tones) -> Image:
    """Smooth bark with fine creases around the trunk, pale lichen and green algae."""
    blotch = noise(rng, N, 3, 24, slope=1.2, stretch=0.8)
    fine = noise(rng, N, 40, 256, slope=0.4)
    creases = np.clip(noise(rng, N, 12, 200, slope=0.8, stretch=0.08) - 1.1, 0, 1)[..., None]
    colour = mix(tones, 0.5 + 0.13 * blotch + 0.04 * fine)
    pale = np.clip(2.5 * (noise(rng, N, 4, 60, slope=1.0) - 1.1), 0, 0.6)[..., None]
    algae = 0.3 * np.clip(noise(rng, N, 3, 20, stretch=3.0) - 0.4, 0, 1)[..., None]
    colour = colour * (1 - 0.35 * creases)
    colour = colour * (1 - pale) + linear((190, 192, 182)) * pale
    return even_out(colour * (1 - algae) + linear((106, 116, 84)) * algae)


@drawing
def weathered_wood(rng: Rng) -> Image:
    """Bare weathered wood: silver grey, split along the grain, with the galleries of beetles."""
    grain = noise(rng, N, 20, 256, slope=0.6, stretch=24.0)
    bands = noise(rng, N, 4, 60, slope=1.0, stretch=14.0)
    split = np.clip(1 - np.abs(noise(rng, N, 5, 50, slope=1.0, stretch=22.0)) / 0.09, 0, 1)
    gallery = np.clip(1 - np.abs(noise(rng, N, 8, 60, slope=1.0, stretch=2.0)) / 0.03, 0, 1)
    colour = mix([(112, 100, 86), (150, 141, 128), (178, 172, 162)], 0.5 + 0.12 * grain + 0.15 * bands)
    dark = np.clip(1 - 0.75 * split - 0.12 * gallery, 0.1, 1).astype(np.float32)
    return even_out(colour * dark[..., None])


@drawing
def moss_on_bark(rng: Rng) -> Image:
    """Cushions of moss over bark."""
    cushion = noise(rng, N, 6, 60, slope=1.0)
    tufts = noise(rng, N, 40, 256, slope=0.2)
    height = (0.5 + 0.2 * cushion + 0.12 * tufts).astype(np.float32)
    colour = mix([(38, 44, 16), (74, 88, 28), (112, 124, 46)], height)
    bare = np.clip(1.6 * (noise(rng, N, 5, 80, slope=0.9) - 1.25), 0, 0.8)[..., None]
    return even_out((colour * (1 - bare) + linear((84, 70, 54)) * bare) * crevices(height, 5.0, 0.5)[..., None])

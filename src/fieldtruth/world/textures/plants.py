# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Barks and leaves. A bark's u runs around the trunk and v along it; a tile is about 0.5 m.

A leaf's image is its upper side without outline: u = 0.5 is the midrib, v runs from the stalk (0) to the tip (1).
"""

import numpy as np
from numpy.typing import NDArray

from fieldtruth.world.textures.canvas import (
    Image,
    Rng,
    cells,
    crevices,
    even_out,
    halve,
    linear,
    mix,
    noise,
    settle,
    stamps,
)

N = 512
LEAF = 256


def bark_oak(rng: Rng) -> Image:
    """Deep furrows along the trunk between long ridges, which cracks divide into blocks."""
    tones = [(30, 26, 22), (74, 65, 56), (116, 106, 93), (142, 133, 119)]
    return _furrowed(rng, width=7, stretch=5.0, depth=0.8, cracks=0.45, tones=tones)


def bark_lime(rng: Rng) -> Image:
    """Shallow, interlaced ridges."""
    tones = [(54, 47, 41), (92, 83, 73), (120, 111, 98), (142, 134, 121)]
    return _furrowed(rng, width=11, stretch=7.0, depth=0.9, cracks=0.2, tones=tones)


def _furrowed(
    rng: Rng, *, width: float, stretch: float, depth: float, cracks: float, tones: list[tuple[int, int, int]]
) -> Image:
    """Furrows run where long-drawn noise changes sign, so they branch and meet as the splits of a growing trunk do.

    ``width`` is the number of ridges a tile, ``depth`` the furrows' share, ``cracks`` the strength of those across.
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
    # Green algae live on the ridges where rain runs down.
    algae = 0.22 * np.clip(noise(rng, N, 3, 20, stretch=3.0) - 0.3, 0, 1)[..., None] * height[..., None]
    colour = colour * (1 - algae) + linear((104, 110, 72)) * algae
    return even_out(colour * crevices(height, 4.0, 0.55)[..., None])


def bark_birch(rng: Rng) -> Image:
    """White, peeling around the trunk, with dark lenticels and a few black scars."""
    n = 2 * N
    count, scars = 330, 4
    length, width = rng.gamma(2.0, 11.0, count).clip(5, 80), rng.uniform(1.6, 4.2, count)
    dashes = stamps(rng, n, length, width, _oval, np.full(count, 0.5), turn=0.05)
    sides = rng.uniform(28, 70, scars)
    rhombs = stamps(rng, n, sides, sides * rng.uniform(0.3, 0.5, scars), _rhomb, np.full(scars, 1.0), turn=0.15)
    marks = settle(n, [dashes, rhombs._replace(owner=rhombs.owner + np.int32(count))])
    torn = noise(rng, n, 20, 400, slope=0.6, stretch=0.3)
    depth = 1 - np.where(marks.owner < count, np.hypot(marks.a, marks.b), np.abs(marks.a) + np.abs(marks.b))
    lenticel = (marks.owner >= 0) & (marks.owner < count) & (depth + 0.12 * torn > 0.12)
    scar = (marks.owner >= count) & (depth + 0.22 * torn > 0.18)
    dark = halve(np.stack([lenticel, scar], axis=2).astype(np.float32))
    band = noise(rng, N, 3, 200, slope=0.8, stretch=0.08)
    sheet = noise(rng, N, 3, 60, slope=1.0, stretch=0.4)
    grain = noise(rng, N, 60, 256, slope=0.0)
    colour = mix([(176, 164, 150), (214, 207, 197), (231, 228, 221)], 0.62 + 0.10 * band + 0.14 * sheet + 0.03 * grain)
    peel = np.clip(noise(rng, N, 3, 160, slope=0.6, stretch=0.03) - 1.9, 0, 0.5)[..., None]
    colour = colour * (1 - 0.8 * peel)
    for k, tone in enumerate(((88, 77, 70), (44, 39, 36))):
        colour = (
            colour * (1 - dark[..., k : k + 1]) + linear(tone) * (1 + 0.15 * grain)[..., None] * dark[..., k : k + 1]
        )
    return even_out(colour)


def _oval(a: Image, b: Image, _rows: NDArray[np.intp]) -> Image:
    return np.asarray(1 - a**2 - b**2, np.float32)


def _rhomb(a: Image, b: Image, _rows: NDArray[np.intp]) -> Image:
    return np.asarray(1 - np.abs(a) - np.abs(b), np.float32)


def bark_bush(rng: Rng) -> Image:
    """Smooth grey-brown bark of thin stems with pale lenticels."""
    n = 256
    count = 260
    spots = stamps(rng, 2 * n, rng.uniform(2, 6, count), rng.uniform(1, 2.4, count), _oval, np.ones(count), turn=0.3)
    share = 0.7 * halve((settle(2 * n, [spots]).owner >= 0).astype(np.float32)[..., None])
    grain = noise(rng, n, 4, 120, slope=0.8, stretch=6.0)
    skin = mix([(78, 66, 54), (112, 98, 82), (132, 118, 100)], 0.5 + 0.16 * grain)
    return even_out(skin * (1 - share) + linear((146, 132, 112)) * share)


def leaf(rng: Rng, *, pairs: float, slope: float, vein: float, tones: list[tuple[int, int, int]]) -> Image:
    """Feather-veined leaf: ``pairs`` of side veins leave the midrib and climb by ``slope`` towards the margin."""
    u, v = _leaf_grid()
    side = np.abs(u - 0.5)
    phase = pairs * (v - slope * side - 0.5 * side**2) + np.where(u > 0.5, 0.12, 0.0)
    gap = np.abs(phase - np.round(phase)) / pairs
    ribs = np.exp(-((gap / (0.010 * (1.3 - 1.6 * side))) ** 2)) * (1 - 1.4 * side)
    return _blade(rng, np.maximum(ribs, _midrib(side, v)), gap * pairs, vein, tones)


def _leaf_grid() -> tuple[Image, Image]:
    grid = ((np.arange(LEAF) + 0.5) / LEAF).astype(np.float32)
    return np.broadcast_to(grid, (LEAF, LEAF)), np.broadcast_to(1 - grid[:, None], (LEAF, LEAF))


def _midrib(side: Image, v: Image) -> Image:
    return np.asarray(np.exp(-((side / (0.018 * (1.25 - v))) ** 2)), np.float32)


def _blade(rng: Rng, ribs: Image, gap: Image, vein: float, tones: list[tuple[int, int, int]]) -> Image:
    """Leaf surface between the veins: it bulges, and a fine net of veins divides it."""
    net = cells(rng, LEAF, 40, 40)
    mesh = np.clip((net.second - net.nearest) / 0.2, 0, 1)
    tone = 0.5 + 0.13 * noise(rng, LEAF, 1, 12) + 0.07 * noise(rng, LEAF, 20, 120, slope=0.4) + 0.25 * (gap - 0.25)
    colour = mix(tones, tone - 0.05 * mesh) * (1 + vein * ribs)[..., None]
    spots = np.clip(noise(rng, LEAF, 6, 60, slope=0.7) - 2.4, 0, 0.6)[..., None]
    return np.asarray(colour * (1 - spots) + linear((120, 96, 54)) * spots, np.float32)


def needles(rng: Rng, *, rows: int, slope: float, twig: float, tones: list[tuple[int, int, int]]) -> Image:
    """Twig with its needles: ``rows`` of them leave the axis (half width ``twig``) on each side and point forwards."""
    u, v = _leaf_grid()
    side = np.abs(u - 0.5)
    wave = 0.12 * noise(rng, LEAF, 2, 10)
    phase = rows * (v - slope * side) + np.where(u > 0.5, 0.5, 0.0) + wave
    row = np.floor(phase)
    across = np.abs(phase - row - 0.5) * 2
    shade = rng.uniform(-0.2, 0.2, 4096).astype(np.float32)[(row * 2 + (u > 0.5)).astype(np.int64) % 4096]
    needle = np.clip((0.8 - across) / 0.4, 0, 1)
    colour = mix(tones, 0.45 + shade + 0.12 * noise(rng, LEAF, 3, 30)) * (0.22 + 0.78 * needle)[..., None]
    wood = np.clip((twig * (1.2 - v) - side) / 0.012, 0, 1)[..., None]
    return np.asarray(colour * (1 - wood) + linear((112, 84, 58)) * wood, np.float32)


def _plates(
    rng: Rng, *, across: int, along: int, gap: float, relief: float, tones: list[tuple[int, int, int]]
) -> Image:
    """Plates of bark: cells with ragged borders that peel in layers; ``gap`` between them is dark."""
    bend = [0.16 * noise(rng, N, 3, 14) + 0.035 * noise(rng, N, 16, 90, slope=0.8) for _ in range(2)]
    found = cells(rng, N, across, along, jitter=0.9, shift=bend)
    edge = np.clip((found.second - found.nearest) / gap, 0, 1)
    layer = noise(rng, N, 6, 120, slope=0.9, stretch=1.6)
    rough = noise(rng, N, 30, 256, slope=0.4, stretch=2.0)
    own = rng.uniform(-0.5, 0.5, across * along).astype(np.float32)[found.owner]
    height = (edge**0.6 * (0.8 + 0.1 * own + 0.1 * np.floor(layer * 1.5) / 1.5)).astype(np.float32)
    colour = mix(tones, 0.12 + 0.6 * height + 0.14 * own + 0.05 * layer + 0.05 * rough)
    return even_out(colour * crevices(height, 4.0, relief)[..., None])


def bark_spruce(rng: Rng) -> Image:
    """Thin round scales, grey over brown."""
    tones = [(38, 30, 25), (84, 68, 57), (110, 96, 84), (128, 117, 106)]
    return _plates(rng, across=15, along=11, gap=0.28, relief=0.6, tones=tones)


def bark_pine(rng: Rng) -> Image:
    """Old bark of pines: thick long plates, grey outside and red-brown where layers have come off."""
    tones = [(26, 20, 17), (86, 60, 46), (124, 94, 76), (140, 118, 102)]
    return _plates(rng, across=7, along=2, gap=0.42, relief=0.8, tones=tones)


def bark_pine_upper(rng: Rng) -> Image:
    """Young bark of pines: orange paper that peels off in small flakes."""
    sheet = noise(rng, N, 5, 90, slope=1.0, stretch=0.8)
    flakes = np.clip(noise(rng, N, 10, 160, slope=0.7, stretch=1.4) - 0.7, 0, 1)
    grain = noise(rng, N, 40, 256, slope=0.3)
    tones = [(128, 74, 44), (178, 112, 68), (204, 142, 94)]
    colour = mix(tones, 0.5 + 0.16 * sheet + 0.05 * grain)
    edge = np.clip(1 - np.abs(noise(rng, N, 6, 60, slope=1.1, stretch=0.7)) / 0.07, 0, 1)[..., None]
    colour = (colour * (1 - 0.45 * edge)).astype(np.float32)
    return even_out(colour * (1 - 0.6 * flakes[..., None]) + 0.6 * flakes[..., None] * linear((150, 128, 108)))


def bark_beech(rng: Rng) -> Image:
    """Smooth and grey, with fine creases around the trunk, pale lichen blotches and darker damp ones."""
    blotch = noise(rng, N, 3, 24, slope=1.2, stretch=0.8)
    fine = noise(rng, N, 40, 256, slope=0.4)
    creases = np.clip(noise(rng, N, 12, 200, slope=0.8, stretch=0.08) - 1.1, 0, 1)[..., None]
    colour = mix([(112, 112, 104), (138, 137, 128), (160, 158, 148)], 0.5 + 0.13 * blotch + 0.04 * fine)
    pale = np.clip(2.5 * (noise(rng, N, 4, 60, slope=1.0) - 1.1), 0, 0.6)[..., None]
    algae = 0.3 * np.clip(noise(rng, N, 3, 20, stretch=3.0) - 0.4, 0, 1)[..., None]
    colour = colour * (1 - 0.35 * creases)
    colour = colour * (1 - pale) + linear((190, 192, 182)) * pale
    return even_out(colour * (1 - algae) + linear((106, 116, 84)) * algae)


def bark_alder(rng: Rng) -> Image:
    """Dark, cracked into small upright plates."""
    tones = [(30, 26, 23), (66, 57, 49), (98, 88, 77), (122, 112, 101)]
    return _plates(rng, across=12, along=5, gap=0.36, relief=0.7, tones=tones)


def bark_willow(rng: Rng) -> Image:
    """Coarse ridges that cross like a net."""
    tones = [(36, 31, 26), (84, 74, 62), (124, 113, 98), (148, 138, 122)]
    return _furrowed(rng, width=6, stretch=3.4, depth=0.7, cracks=0.25, tones=tones)


def bark_dead(rng: Rng) -> Image:
    """Bare weathered wood: silver grey, split along the grain, with the galleries of beetles."""
    grain = noise(rng, N, 20, 256, slope=0.6, stretch=24.0)
    bands = noise(rng, N, 4, 60, slope=1.0, stretch=14.0)
    split = np.clip(1 - np.abs(noise(rng, N, 5, 50, slope=1.0, stretch=22.0)) / 0.09, 0, 1)
    gallery = np.clip(1 - np.abs(noise(rng, N, 8, 60, slope=1.0, stretch=2.0)) / 0.03, 0, 1)
    colour = mix([(112, 100, 86), (150, 141, 128), (178, 172, 162)], 0.5 + 0.12 * grain + 0.15 * bands)
    dark = np.clip(1 - 0.75 * split - 0.12 * gallery, 0.1, 1).astype(np.float32)
    return even_out(colour * dark[..., None])


def bark_moss(rng: Rng) -> Image:
    """Cushions of moss over bark."""
    cushion = noise(rng, N, 6, 60, slope=1.0)
    tufts = noise(rng, N, 40, 256, slope=0.2)
    height = (0.5 + 0.2 * cushion + 0.12 * tufts).astype(np.float32)
    colour = mix([(38, 44, 16), (74, 88, 28), (112, 124, 46)], height)
    bare = np.clip(1.6 * (noise(rng, N, 5, 80, slope=0.9) - 1.25), 0, 0.8)[..., None]
    return even_out((colour * (1 - bare) + linear((84, 70, 54)) * bare) * crevices(height, 5.0, 0.5)[..., None])

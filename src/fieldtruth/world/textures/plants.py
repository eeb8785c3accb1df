# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Leaves, blades and flowers, without outline, as the mesh gives it; barks and dead wood.

A leaf's image is its upper side: u = 0.5 is the midrib, v runs from the stalk (0) to the tip (1). In a blade's image v
runs from the root (0) to the tip (1), and blades of all tones lie side by side along u, which tiles, so that each blade
takes its own band. In a frond's image u runs along the frond and v across it, from pinna tip to pinna tip.

On barks and dead wood u runs around the trunk and v along it; a tile is about 0.6 m, a pixel 0.8 to 1.6 mm. Light that
furrows lose is part of the image (see `hollows`); what grows on bark is added where it is shaded (see
`kernels.textures`). ``tones`` are colours (k, 3) from dark to light, sRGB 0 to 255.
"""

from collections.abc import Sequence

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
    hollows,
    linear,
    mix,
    noise,
    ridges,
    settle,
    stamps,
)

LEAF = 256
BLADE = 128
N = 512
"""Pixels along each side of barks."""
Wave = tuple[float, float, float, float, float]
"""Amplitude of a noise, and its ``low``, ``high``, ``slope`` and ``stretch``."""


def _grid(n: int) -> tuple[Image, Image]:
    """Coordinates u and v of each pixel (n, n); v is 0 in the last row, as in the sampling of textures."""
    grid = ((np.arange(n) + 0.5) / n).astype(np.float32)
    return np.broadcast_to(grid, (n, n)), np.broadcast_to(grid[::-1, None], (n, n))


@drawing
def veined_leaf(rng: Rng, *, pairs: float, slope: float, vein: float, tones: Tones) -> Image:
    """Pinnate leaf: ``pairs`` of side veins leave the midrib with ``slope`` towards the margin."""
    u, v = _grid(LEAF)
    side = np.abs(u - 0.5)
    phase = pairs * (v - slope * side - 0.5 * side**2) + np.where(u > 0.5, 0.12, 0.0)
    gap = np.abs(phase - np.round(phase)) / pairs
    ribs = np.exp(-((gap / (0.010 * (1.3 - 1.6 * side))) ** 2)) * (1 - 1.4 * side)
    return _between_veins(rng, np.maximum(ribs, _midrib(side, v)), gap * pairs, vein, tones)


def _midrib(side: Image, v: Image) -> Image:
    return np.asarray(np.exp(-((side / (0.018 * (1.25 - v))) ** 2)), np.float32)


def _between_veins(rng: Rng, ribs: Image, gap: Image, vein: float, tones: Tones) -> Image:
    """The leaf with bulges between the veins, a fine net of veins, a paler margin that withers, and brown spots."""
    net = cells(rng, LEAF, 40, 40)
    mesh = np.clip((net.second - net.nearest) / 0.2, 0, 1)
    tone = 0.5 + 0.13 * noise(rng, LEAF, 1, 12) + 0.07 * noise(rng, LEAF, 20, 120, slope=0.4) + 0.25 * (gap - 0.25)
    colour = mix(tones, tone - 0.05 * mesh) * (1 + vein * ribs)[..., None]
    u, v = _grid(LEAF)
    margin = np.clip(np.hypot(2 * (u - 0.5), 0.8 * np.maximum(v - 0.4, 0)) - 0.55, 0, 0.5)
    ragged = noise(rng, LEAF, 2, 40, slope=0.9)
    pale = np.clip(0.3 * margin + 0.10 * ragged, 0, 0.3)[..., None]  # between veins and towards the margin
    colour = colour * (1 - pale) + linear((112, 118, 66)) * pale
    spots = np.clip(noise(rng, LEAF, 6, 60, slope=0.7) - 2.2, 0, 0.6)
    dead = np.clip(spots + 1.8 * (margin + 0.14 * ragged - 0.5), 0, 0.8)[..., None]
    return np.asarray(colour * (1 - dead) + linear((112, 88, 54)) * dead, np.float32)


@drawing
def needle_twig(rng: Rng, *, rows: int, slope: float, twig: float, tones: Tones) -> Image:
    """Twig with its needles: ``rows`` on each side of the axis (half width ``twig``) that point forwards."""
    u, v = _grid(LEAF)
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


@drawing
def needle_shoot(rng: Rng, *, tones: Tones, count: int, spread: float, gap: float = 0.7) -> Image:
    """A shoot with ``count`` needles on each side at ``spread`` (rise per distance from the midrib), dark between."""
    n = 2 * BLADE
    u, v = _grid(n)
    side = np.abs(u - 0.5)
    phase = count * (v - spread * side) + np.where(u > 0.5, 0.5, 0.0) + 0.15 * noise(rng, n, 3, 20)
    ridge = np.abs((phase % 1) - 0.5) * 2
    dark = gap * np.clip((ridge - 0.45) / 0.35, 0, 1) * np.clip(side / 0.06, 0, 1)
    tone = 0.5 + 0.14 * noise(rng, n, 2, 16) + 0.12 * noise(rng, n, 20, 100, slope=0.3) - 0.2 * ridge
    return np.asarray(mix(tones, tone) * (1 - dark)[..., None], np.float32)


@drawing
def grass_blades(rng: Rng, *, tones: Tones, foot: Tone, tip: Tone, spots: float = 0.4) -> Image:
    """Parallel veins; ``foot`` and ``tip`` are the colours of the shaded root end and of the dry tip.

    ``spots`` is the share of brown specks. The image is darker at the root, where little light reaches a tuft.
    """
    _, v = _grid(BLADE)
    band = noise(rng, BLADE, 1, 5, slope=0.4, stretch=60.0)
    veins = noise(rng, BLADE, 14, 60, slope=0.2, stretch=400.0)
    fleck = noise(rng, BLADE, 3, 40, slope=0.7, stretch=6.0)
    colour = mix(tones, 0.5 + 0.17 * band + 0.07 * fleck) * (1 + 0.10 * veins)[..., None]
    low = np.clip(1 - v / 0.55 + 0.15 * band, 0, 1)[..., None]
    colour = colour * (1 - low) + linear(foot) * low
    high = 0.75 * np.clip((v - 0.80 + 0.07 * band) / 0.2, 0, 1)[..., None]
    colour = colour * (1 - high) + linear(tip) * high
    brown = spots * np.clip(fleck - 1.3, 0, 1)[..., None]
    colour = colour * (1 - brown) + linear((116, 92, 52)) * brown
    return np.asarray(colour * (0.4 + 0.6 * np.clip(v / 0.35, 0, 1))[..., None], np.float32)


@drawing
def husks(rng: Rng, *, tones: Tones) -> Image:
    """Spikelets and plumes: fine hairs along v, dark gaps between the husks."""
    return mottled(rng, tones=tones, waves=[(0.14, 8, 60, 0.3, 30.0), (0.14, 5, 30, 0.6, 2.0)])


@drawing
def mottled(rng: Rng, *, tones: Tones, waves: Sequence[Wave], middle: float = 0.5) -> Image:
    """Tones about the ``middle`` one, varied by noise: ``waves`` add up."""
    tone: Image | float = middle
    for amplitude, low, high, slope, stretch in waves:
        tone = tone + amplitude * noise(rng, BLADE, low, high, slope=slope, stretch=stretch)
    return mix(tones, np.asarray(tone, np.float32))


@drawing
def fern_frond(rng: Rng, *, tones: Tones) -> Image:
    """Pinnules: teeth along each pinna with dark gaps between them, paler along the midribs."""
    n = 2 * BLADE
    u, v = _grid(n)
    away = np.abs(v - 0.5) * 2
    teeth = np.abs(((away * 11 + 0.5 * np.abs((u * 16) % 1 - 0.5)) % 1) - 0.5) * 2
    gap = np.clip((0.42 - teeth) / 0.25, 0, 1) * np.clip(away / 0.2, 0, 1)
    tone = 0.5 + 0.12 * noise(rng, n, 2, 20) + 0.08 * noise(rng, n, 30, 120, slope=0.3)
    colour = mix(tones, tone) * (1 - 0.5 * gap)[..., None]
    rib = 0.35 * np.exp(-((away / 0.035) ** 2))[..., None]
    return np.asarray(colour * (1 - rib) + linear((138, 142, 84)) * rib, np.float32)


@drawing
def flower(rng: Rng, *, count: int, petal: Tone, heart: Tone, size: float) -> Image:
    """A flower from above in the middle of the square; ``size`` is the heart's radius relative to the flower's."""
    u, v = _grid(BLADE)
    x, y = (u - 0.5) * 2, (v - 0.5) * 2
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    fold = np.abs(((angle / (2 * np.pi) * count + 0.15 * noise(rng, BLADE, 1, 6)) % 1) - 0.5) * 2
    shade = 1 - 0.5 * np.clip((fold - 0.6) / 0.4, 0, 1) * np.clip(radius, 0, 1)
    colour = linear(petal) * (shade * (0.75 + 0.25 * np.clip(radius, 0, 1)))[..., None]
    grain = 1 + 0.15 * noise(rng, BLADE, 20, 60, slope=0.3)
    inside = np.clip((size - radius) / 0.05, 0, 1)[..., None]
    return np.asarray(colour * (1 - inside) + linear(heart) * grain[..., None] * inside, np.float32)


@drawing
def umbel(rng: Rng, *, floret: Tone, gap: Tone) -> Image:
    """Many tiny flowers side by side."""
    bunch = noise(rng, BLADE, 8, 24, slope=0.2)
    share = np.clip(0.75 + 0.6 * bunch, 0, 1)[..., None]
    return np.asarray(linear(floret) * share + linear(gap) * (1 - share), np.float32)


@drawing
def furrowed_bark(
    rng: Rng, *, count: float, stretch: float, furrow: float, depth: float, cracks: float, tones: Tones
) -> Image:
    """Interlaced ridges along the trunk, which fork and join, with furrows between them and splits across.

    ``count`` is the number of ridges per tile, ``furrow`` the furrows' share of the width, ``depth`` their depth
    [pixels], ``cracks`` the depth of the splits relative to the furrows'.
    """
    main = _bent(rng, ridges(rng, N, count, stretch=stretch, spread=0.55), 0.2 * N / count)
    second = ridges(rng, N, 2.6 * count, stretch=0.8 * stretch, spread=0.6)
    fibre = noise(rng, N, 40, 256, slope=0.3, stretch=9.0)
    rough = noise(rng, N, 12, 200, slope=0.7, stretch=2.5)
    uneven = noise(rng, N, 4, 40, slope=0.8, stretch=2.5)
    # Furrows differ in width and depth, and some close.
    crest = np.clip((main + 0.09 * uneven + 0.06 * rough - 0.22 * furrow) / furrow, 0, 1) ** 0.8
    across = _bent(rng, ridges(rng, N, 0.9 * count, stretch=1.2, spread=0.7).T, 6.0)
    split = np.clip((0.16 - across + 0.07 * rough) / 0.16, 0, 1) * cracks * crest
    minor = np.clip(second / 0.45, 0, 1)
    height = crest * (0.66 + 0.18 * minor + 0.07 * uneven + 0.07 * rough + 0.05 * fibre) * (1 - split)
    height = np.asarray(height, np.float32)
    patch = noise(rng, N, 3, 30, slope=1.0, stretch=2.0)
    colour = mix(tones, 0.12 + 0.52 * height + 0.08 * patch + 0.07 * rough + 0.06 * fibre)
    return even_out(colour * hollows(height, depth)[..., None])


def _bent(rng: Rng, image: Image, reach: float) -> Image:
    """The image with points moved along u by about ``reach`` [pixels], smoothly over the tile."""
    columns = np.arange(N)[None, :] + np.rint(reach * noise(rng, N, 3, 14, slope=1.4, stretch=2.0)).astype(np.int64)
    return np.asarray(image[np.arange(N)[:, None], columns % N])


@drawing
def plated_bark(
    rng: Rng, *, across: int, along: int, gap: float, relief: float, tones: Tones, flake: Tone = (0, 0, 0),
    flakes: float = 0.0,
) -> Image:  # fmt: skip
    """Plates or scales: cells with ragged rims whose thin layers peel; ``gap`` between them is dark.

    ``relief`` is their height [pixels]; layers that have just peeled off, ``flakes`` of the area, have the colour
    ``flake``.
    """
    bend = [0.15 * noise(rng, N, 3, 16, stretch=1.5) + 0.04 * noise(rng, N, 16, 120, slope=0.8) for _ in range(2)]
    found = cells(rng, N, across, along, jitter=1.0, shift=bend)
    edge = np.clip((found.second - found.nearest) / gap, 0, 1)
    own = rng.uniform(-0.5, 0.5, across * along).astype(np.float32)[found.owner]
    rough = noise(rng, N, 30, 256, slope=0.4, stretch=2.0)
    # Layers end along level lines of noise, a step of the height each.
    rise = 0.9 * noise(rng, N, 3, 60, slope=1.2, stretch=1.5) + 1.4 * edge + own
    step = np.floor(rise * 1.4)
    within = rise * 1.4 - step
    height = edge**0.55 * (0.66 + 0.09 * step.clip(-2, 3) + 0.05 * within + 0.04 * rough)
    height = height.astype(np.float32)
    colour = mix(tones, 0.08 + 0.55 * height + 0.16 * own + 0.06 * np.sin(2.3 * step) + 0.06 * rough)
    fresh = (np.clip(3 * (np.sin(3.1 * step + 5 * own) - 1 + 2 * flakes), 0, 1) * edge)[..., None]
    colour = colour * (1 - 0.75 * fresh) + 0.75 * fresh * linear(flake)
    rim = 1 - 0.35 * np.exp(-((within / 0.07) ** 2))  # the shadow below a layer's end
    return even_out(colour * (hollows(height, relief) * rim)[..., None])


@drawing
def birch_bark(rng: Rng, *, tones: Tones, marks: Tones) -> Image:
    """White bark that peels around the trunk, with lenticels, and scars in the two colours of ``marks``."""
    n = 2 * N
    count, scars = 420, 5
    length, width = rng.gamma(1.6, 16.0, count).clip(6, 120), rng.uniform(1.6, 5.5, count)
    dashes = stamps(rng, n, length, width, _oval, np.full(count, 0.5), turn=0.06)
    sides = rng.uniform(34, 96, scars)
    rhombs = stamps(rng, n, sides, sides * rng.uniform(0.35, 0.7, scars), _rhombus, np.full(scars, 1.0), turn=0.15)
    relief = settle(n, [dashes, rhombs._replace(owner=rhombs.owner + np.int32(count))])
    torn = noise(rng, n, 12, 400, slope=0.7, stretch=0.4)
    depth = 1 - np.where(relief.owner < count, np.hypot(relief.a, relief.b), np.abs(relief.a) + np.abs(relief.b))
    lenticel = (relief.owner >= 0) & (relief.owner < count) & (depth + 0.16 * torn > 0.14)
    scar = (relief.owner >= count) & (depth + 0.30 * torn > 0.2)
    dark = halve(np.stack([lenticel, scar], axis=2).astype(np.float32))
    band = noise(rng, N, 3, 200, slope=0.8, stretch=0.08)
    sheet = noise(rng, N, 3, 60, slope=1.0, stretch=0.4)
    grain = noise(rng, N, 60, 256, slope=0.0)
    colour = mix(tones, 0.55 + 0.12 * band + 0.17 * sheet + 0.05 * grain)
    # Sheets peel off in strips around the trunk and show the tan layer below.
    peel = np.clip(1.6 * (noise(rng, N, 3, 90, slope=0.8, stretch=0.12) - 1.2), 0, 0.85)[..., None]
    colour = colour * (1 - peel) + linear((168, 132, 104)) * peel
    curl = 1 - 0.4 * np.exp(-(((peel[..., 0] - 0.12) / 0.08) ** 2))
    for k, mark in enumerate(marks):
        share = dark[..., k : k + 1]
        colour = colour * (1 - share) + linear(mark) * (1 + 0.2 * grain)[..., None] * share
    return even_out(colour * curl[..., None])


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
    """Papery bark that peels off in small thin flakes, as on the upper trunk of pines."""
    rise = noise(rng, N, 6, 90, slope=0.9, stretch=0.8)
    within = (rise * 1.7) % 1.0
    layer = np.floor(rise * 1.7)
    grain = noise(rng, N, 40, 256, slope=0.3, stretch=3.0)
    broad = noise(rng, N, 3, 12, slope=0.8)
    colour = mix(tones, 0.48 + 0.13 * np.sin(2.1 * layer) + 0.12 * broad + 0.05 * grain)
    old = np.clip(noise(rng, N, 5, 60, slope=0.8, stretch=1.6) - 0.5, 0, 0.8)[..., None]
    colour = colour * (1 - old) + linear(flake) * old
    rim = 1 - 0.45 * np.exp(-((within / 0.06) ** 2))
    return even_out(colour * (rim * crevices(layer.astype(np.float32) * 0.2, 3.0, 0.5))[..., None])


@drawing
def smooth_bark(rng: Rng, *, tones: Tones) -> Image:
    """Smooth bark with lenticels and fine creases around the trunk, scars of branches, pale and green crusts."""
    blotch = noise(rng, N, 3, 24, slope=1.0, stretch=0.6)
    fine = noise(rng, N, 40, 256, slope=0.4)
    wrinkle = noise(rng, N, 10, 220, slope=0.7, stretch=0.06)
    creases = np.clip(wrinkle - 0.9, 0, 1.2)
    count = 700
    rows = stamps(rng, 2 * N, rng.uniform(2, 9, count), rng.uniform(1, 2.2, count), _oval, np.ones(count), turn=0.05)
    lenticel = halve((settle(2 * N, [rows]).owner >= 0).astype(np.float32)[..., None])
    eyes = stamps(rng, N, rng.uniform(16, 34, 3), rng.uniform(7, 14, 3), _oval, np.ones(3), turn=0.1)
    eye = settle(N, [eyes])
    ring = np.where(eye.owner >= 0, 0.5 + 0.5 * np.cos(9 * np.hypot(eye.a, eye.b)), 0.0)
    colour = mix(tones, 0.5 + 0.15 * blotch + 0.05 * fine)
    pale = np.clip(1.5 * (noise(rng, N, 3, 60, slope=1.2) - 0.7), 0, 0.65)[..., None]
    algae = np.clip(0.3 * noise(rng, N, 3, 30, stretch=3.0), 0, 0.45)[..., None]
    dark = np.clip(0.8 * (noise(rng, N, 3, 40, slope=1.2, stretch=3.0) - 0.8), 0, 0.5)[..., None]
    colour = colour * (1 - pale) + linear((178, 180, 168)) * (1 + 0.1 * fine)[..., None] * pale
    colour = colour * (1 - algae) + linear((98, 104, 78)) * algae
    colour = colour * (1 - dark) + linear((74, 72, 66)) * dark
    return even_out(colour * (1 - 0.4 * lenticel) * (1 - 0.35 * creases - 0.35 * ring)[..., None])


@drawing
def weathered_wood(rng: Rng) -> Image:
    """Bare weathered wood: silver grey, split along the grain, with the galleries of beetles."""
    grain = noise(rng, N, 20, 256, slope=0.6, stretch=24.0)
    bands = noise(rng, N, 4, 60, slope=1.0, stretch=14.0)
    split = np.clip(1 - np.abs(noise(rng, N, 5, 50, slope=1.0, stretch=22.0)) / 0.09, 0, 1)
    gallery = np.clip(1 - np.abs(noise(rng, N, 8, 60, slope=1.0, stretch=2.0)) / 0.03, 0, 1)
    colour = mix([(112, 100, 86), (150, 141, 128), (178, 172, 162)], 0.5 + 0.12 * grain + 0.15 * bands)
    stain = np.clip(0.5 * noise(rng, N, 3, 30, slope=1.0, stretch=5.0), 0, 0.6)[..., None]
    colour = colour * (1 - stain) + linear((96, 80, 62)) * stain
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

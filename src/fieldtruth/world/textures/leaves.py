# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Leaves, needles, blades, fronds and flowers, without outline: the mesh gives it.

A leaf's image is its upper side: u = 0.5 is the midrib, v runs from the stalk (0) to the tip (1). In a blade's image v
runs from the root (0) to the tip (1), and blades of all tones lie side by side along u, which tiles, so that each blade
takes its own band. In a frond's image u runs along the frond and v across it, from pinna tip to pinna tip.
``tones`` are colours (k, 3) from dark to light, sRGB 0 to 255.
"""

import numpy as np

from fieldtruth.world.textures.canvas import Image, Rng, Tone, Tones, cells, drawing, linear, mix, noise

LEAF = 256
BLADE = 128


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
    hair = noise(rng, BLADE, 8, 60, slope=0.3, stretch=30.0)
    husk = noise(rng, BLADE, 5, 30, slope=0.6, stretch=2.0)
    return np.asarray(mix(tones, 0.5 + 0.14 * hair + 0.14 * husk), np.float32)


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
def velvet(rng: Rng, *, tones: Tones) -> Image:
    """Dense fine hairs, as on a cattail's spike; tiles."""
    return np.asarray(mix(tones, 0.5 + 0.12 * noise(rng, BLADE, 2, 60, slope=0.5)), np.float32)

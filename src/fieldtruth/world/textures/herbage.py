# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drawings of blades, fronds, needles and petals.

A blade's image: v runs from the root (0) to the tip (1); along u, which tiles, lie blades of all tones side by side,
so that each takes a band of its own. A frond's image: u runs along the frond, v from pinna tip to pinna tip across it.
"""

import numpy as np

from fieldtruth.world.textures.canvas import Image, Rng, linear, mix, noise

N = 128
Tones = list[tuple[int, int, int]]


def _grid(n: int) -> tuple[Image, Image]:
    """Coordinates u and v of each pixel (n, n)."""
    grid = ((np.arange(n) + 0.5) / n).astype(np.float32)
    return np.broadcast_to(grid, (n, n)), np.broadcast_to(grid[:, None], (n, n))


def blade(
    rng: Rng, *, tones: Tones, foot: tuple[int, int, int], tip: tuple[int, int, int], spots: float = 0.4
) -> Image:
    """Parallel veins; the foot is pale or brown in the shade of its neighbours, the tip dries first.

    ``spots`` is the share of brown specks; light at the foot of a tuft is scarce, so the image darkens there.
    """
    _, v = _grid(N)
    band = noise(rng, N, 1, 5, slope=0.4, stretch=60.0)
    veins = noise(rng, N, 14, 60, slope=0.2, stretch=400.0)
    fleck = noise(rng, N, 3, 40, slope=0.7, stretch=6.0)
    colour = mix(tones, 0.5 + 0.17 * band + 0.07 * fleck) * (1 + 0.10 * veins)[..., None]
    low = np.clip(1 - v / 0.55 + 0.15 * band, 0, 1)[..., None]
    colour = colour * (1 - low) + linear(foot) * low
    high = 0.75 * np.clip((v - 0.80 + 0.07 * band) / 0.2, 0, 1)[..., None]
    colour = colour * (1 - high) + linear(tip) * high
    brown = spots * np.clip(fleck - 1.3, 0, 1)[..., None]
    colour = colour * (1 - brown) + linear((116, 92, 52)) * brown
    return np.asarray(colour * (0.5 + 0.5 * np.clip(v / 0.6, 0, 1))[..., None], np.float32)


def chaff(rng: Rng, *, tones: Tones) -> Image:
    """Spikelets and plumes: fine hairs along v, dark gaps between the husks."""
    hair = noise(rng, N, 8, 60, slope=0.3, stretch=30.0)
    husk = noise(rng, N, 5, 30, slope=0.6, stretch=2.0)
    return np.asarray(mix(tones, 0.5 + 0.14 * hair + 0.14 * husk), np.float32)


def frond(rng: Rng, *, tones: Tones) -> Image:
    """Pinnules: teeth along each pinna with dark gaps between them, paler along the midribs."""
    n = 2 * N
    u, v = _grid(n)
    away = np.abs(v - 0.5) * 2
    teeth = np.abs(((away * 11 + 0.5 * np.abs((u * 16) % 1 - 0.5)) % 1) - 0.5) * 2
    gap = np.clip((0.42 - teeth) / 0.25, 0, 1) * np.clip(away / 0.2, 0, 1)
    tone = 0.5 + 0.12 * noise(rng, n, 2, 20) + 0.08 * noise(rng, n, 30, 120, slope=0.3)
    colour = mix(tones, tone) * (1 - 0.5 * gap)[..., None]
    rib = 0.35 * np.exp(-((away / 0.035) ** 2))[..., None]
    return np.asarray(colour * (1 - rib) + linear((138, 142, 84)) * rib, np.float32)


def needles(rng: Rng, *, tones: Tones, count: int, spread: float, gap: float = 0.7) -> Image:
    """A shoot of ``count`` needles a side that leave the midrib at ``spread`` (rise per distance), dark between."""
    n = 2 * N
    u, v = _grid(n)
    side = np.abs(u - 0.5)
    phase = count * (v - spread * side) + np.where(u > 0.5, 0.5, 0.0) + 0.15 * noise(rng, n, 3, 20)
    ridge = np.abs((phase % 1) - 0.5) * 2
    dark = gap * np.clip((ridge - 0.45) / 0.35, 0, 1) * np.clip(side / 0.06, 0, 1)
    tone = 0.5 + 0.14 * noise(rng, n, 2, 16) + 0.12 * noise(rng, n, 20, 100, slope=0.3) - 0.2 * ridge
    return np.asarray(mix(tones, tone) * (1 - dark)[..., None], np.float32)


def petals(rng: Rng, *, count: int, petal: tuple[int, int, int], heart: tuple[int, int, int], size: float) -> Image:
    """A flower from above in the middle of the square; ``size`` is the heart's radius relative to the flower's."""
    u, v = _grid(N)
    x, y = (u - 0.5) * 2, (v - 0.5) * 2
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    fold = np.abs(((angle / (2 * np.pi) * count + 0.15 * noise(rng, N, 1, 6)) % 1) - 0.5) * 2
    shade = 1 - 0.5 * np.clip((fold - 0.6) / 0.4, 0, 1) * np.clip(radius, 0, 1)
    colour = linear(petal) * (shade * (0.75 + 0.25 * np.clip(radius, 0, 1)))[..., None]
    grain = 1 + 0.15 * noise(rng, N, 20, 60, slope=0.3)
    inside = np.clip((size - radius) / 0.05, 0, 1)[..., None]
    return np.asarray(colour * (1 - inside) + linear(heart) * grain[..., None] * inside, np.float32)


def umbel(rng: Rng, *, floret: tuple[int, int, int], gap: tuple[int, int, int]) -> Image:
    """Many tiny flowers side by side."""
    bunch = noise(rng, N, 8, 24, slope=0.2)
    share = np.clip(0.75 + 0.6 * bunch, 0, 1)[..., None]
    return np.asarray(linear(floret) * share + linear(gap) * (1 - share), np.float32)


def velvet(rng: Rng, *, tones: Tones) -> Image:
    """The close brown felt of a cattail's spike; tiles."""
    return np.asarray(mix(tones, 0.5 + 0.12 * noise(rng, N, 2, 60, slope=0.5)), np.float32)

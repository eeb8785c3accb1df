# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds with volume: where their droplets are, and the light that comes from them along a ray; and thin layers.

Density: an outline on a map, flat bases, and billows of cellular noise that grow with height (Schneider and Vos 2015).
Light: one march along the ray, and the optical depth towards the sun from a grid that is summed once. Higher orders of
scattering are octaves of weaker extinction and rounder phase functions (Wrenninge, Kulla and Lundqvist 2013). Lengths
are in metres.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.clouds import MAP, MAP_TEXEL, NOISE, SHADE_TEXEL, Clouds, Layer, Shade, fill_shade

SEEN: Final = 0.08
"""Amount from which on there is cloud to see."""
FULLEST: Final = 0.95
"""Greatest share of the sky that heaps cover."""
_AT_ONCE: Final = 60  # heaps between two measurements of the cover
_FALL: Final = 1.3  # of the number of heaps larger than a radius


def cumulus_map(rng: np.random.Generator, cover: float, thickness: float) -> Float32Array:
    """Amounts (MAP, MAP) of heaps of every size, in groups.

    The number of heaps larger than a radius falls with it to the power of -_FALL, as power laws describe fields of
    cumulus (Benner and Curry 1998; the exponent is ours), and each rises about as high as its radius.

    Args:
        rng: source of positions and sizes.
        cover: share of the area that is to be covered; above FULLEST it is FULLEST.
        thickness: height [m] at which the amount is 1.
    """
    groups = ranks(band_noise(rng, 5000.0, rough=3.0)).ravel() ** 2
    amount = np.zeros((MAP, MAP), np.float32)
    smallest, largest = 60.0, thickness
    low, high = smallest**-_FALL, largest**-_FALL
    covered = 0.0
    while covered < min(cover, FULLEST):
        # Between clouds only, once half is covered: else the last gaps would take for ever to meet.
        share = groups if covered < 0.5 else groups * (amount.ravel() <= SEEN)
        nodes = rng.choice(MAP * MAP, _AT_ONCE, p=share / share.sum())
        radii = (low + rng.random(_AT_ONCE) * (high - low)) ** (-1.0 / _FALL)
        for node, radius in zip(nodes, radii, strict=True):
            _heap(rng, amount, (node // MAP, node % MAP), float(radius), thickness)
        covered = float((amount > SEEN).mean())
    return amount


def _heap(
    rng: np.random.Generator, amount: Float32Array, node: tuple[int, int], radius: float, thickness: float
) -> None:
    """Raise the amount by a heap at a node of the map: a few domes, the smaller ones at its sides."""
    lobes = 3 + int(radius / 90.0)
    away, turn = radius * 0.75 * np.sqrt(rng.random(lobes)), rng.uniform(0.0, 2.0 * np.pi, lobes)
    away[0] = 0.0
    wide = radius * rng.uniform(0.3, 0.65, lobes) * (1.0 - 0.35 * away / radius)
    reach = int(1.6 * radius / MAP_TEXEL) + 2
    steps = np.arange(-reach, reach + 1)
    x, y = np.meshgrid(steps * MAP_TEXEL, steps * MAP_TEXEL, indexing="ij")
    raised = np.zeros(x.shape)
    for r, a, w in zip(away, turn, wide, strict=True):
        near = 1.0 - ((x - r * np.cos(a)) ** 2 + (y - r * np.sin(a)) ** 2) / (w * w)
        raised = np.maximum(raised, 1.5 * w / thickness * np.sqrt(np.maximum(near, 0.0)))
    rows, columns = np.ix_((node[0] + steps) % MAP, (node[1] + steps) % MAP)
    amount[rows, columns] = np.maximum(amount[rows, columns], np.minimum(raised, 1.0))


def band_noise(rng: np.random.Generator, size: float, stretch: float = 1.0, rough: float = 1.84) -> Array:
    """Repeating noise (MAP, MAP) with features of ``size`` [m], ``stretch`` times longer along x, and finer ones.

    Amplitudes fall with frequency to the power of ``rough``: 1 is rough, 3 smooth.
    """
    frequency = np.fft.fftfreq(MAP, MAP_TEXEL)
    squared = (frequency[:, None] * stretch) ** 2 + frequency[None, :] ** 2
    squared[0, 0] = np.inf
    gain = np.exp(-0.25 / (squared * size * size)) * squared ** (-0.5 * rough)
    return np.asarray(np.fft.ifft2(np.fft.fft2(rng.standard_normal((MAP, MAP))) * gain).real)


def ranks(values: Array) -> Array:
    """Replace values by their share of smaller ones: uniform in [0, 1)."""
    order = np.argsort(values, axis=None, kind="stable")
    result = np.empty(values.size)
    result[order] = np.arange(values.size) / values.size
    return result.reshape(values.shape)


@cache
def billows() -> Float32Array:
    """Three octaves of cellular noise (Worley 1996) on a repeating cube, 1 at the cells' centres."""
    nodes = np.arange(NOISE) / NOISE
    points = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1)
    total, rng = np.zeros((NOISE,) * 3), np.random.default_rng(3)
    for octave, weight in enumerate((0.6, 0.28, 0.12)):
        cells = 4 * 2**octave
        corners = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1)
        centres = (corners + rng.random(corners.shape)).reshape(-1, 3) / cells % 1.0
        total -= weight * cells * cKDTree(centres, boxsize=np.ones(3)).query(points)[0]
    total -= total.min()
    return np.asarray(total / total.max(), np.float32)


def shade_of(clouds: Clouds, sun: Array, pool: ThreadPoolExecutor) -> Shade:
    """Sum the depth towards the sun at the nodes of a grid."""
    nodes, layers = int(MAP * MAP_TEXEL / SHADE_TEXEL), int(np.ceil(clouds.thickness / SHADE_TEXEL)) + 1
    depth = np.zeros((nodes, nodes, layers), np.float32)
    list(pool.map(lambda i: fill_shade(clouds, sun, i, depth[i]), range(nodes)))
    return Shade(depth, sun)


def cirrus(rng: np.random.Generator, cover: float, height: float) -> Layer:
    """Fibres of ice, drawn out along the wind."""
    bands, fibres, fine = (
        band_noise(rng, *size) for size in ((2600.0, 2.0, 2.4), (420.0, 6.0, 1.4), (90.0, 14.0, 1.1))
    )
    streaks = np.exp(0.75 * fibres / fibres.std() + 0.45 * fine / fine.std())
    veil = np.clip((ranks(bands + 0.35 * fibres * bands.std() / fibres.std()) - (1.0 - cover)) / 0.75, 0.0, 1.0)
    depth = 0.32 * veil**1.6 * streaks
    return Layer(depth.astype(np.float32), height, 0.22, _shift(rng), False, 0.0, 0.0)


def thick_layer(rng: np.random.Generator, height: float, depth: float, size: float, structure: float) -> Layer:
    """A layer of mean optical depth ``depth`` whose depth changes over ``size`` [m]."""
    noise = band_noise(rng, size, 1.6)
    varied = depth * np.exp(0.45 * noise / noise.std())
    return Layer(varied.astype(np.float32), height, 1.0, _shift(rng), True, depth, structure)


def _shift(rng: np.random.Generator) -> tuple[float, float]:
    return float(rng.uniform(0.0, 5000.0)), float(rng.uniform(0.0, 5000.0))


def passed_by(depth: float) -> float:
    """Share of light that leaves a cloud of optical depth ``depth`` below: two streams, asymmetry 0.85.

    Bohren, "Multiple scattering of light and some of its observable consequences" (1987), equation 13.
    """
    return 1.0 / (1.0 + 0.75 * (1.0 - 0.85) * depth)

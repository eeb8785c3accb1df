# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds with volume: where their droplets are, and the light that comes from them along a ray.

Density: an outline on a map, flat bases, and billows of cellular noise that grow with height (Schneider and Vos 2015).
Light: one march along the ray, and the optical depth towards the sun from a grid that is summed once. Higher orders of
scattering are octaves of weaker extinction and rounder phase functions (Wrenninge, Kulla and Lundqvist 2013). Lengths
are in metres.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.render.sky.atmosphere import forward_phase

MAP: Final = 1024
MAP_TEXEL: Final = 12.0
"""The map repeats after 12.3 km."""
NOISE: Final = 64
"""Nodes of the repeating cube of noise along each axis."""
FARTHEST: Final = 45_000.0
SEEN: Final = 0.08
"""Amount from which on there is cloud to see."""
FULLEST: Final = 0.95
"""Greatest share of the sky that heaps cover."""
_AT_ONCE: Final = 60  # heaps between two measurements of the cover
_FALL: Final = 1.3  # of the number of heaps larger than a radius
_OCTAVES: Final = 4
_BOUNCE: Final = 0.15  # albedo of the ground below
_SUN_STEPS: Final = 6
SHADE_TEXEL: Final = 48.0
"""[m] between nodes of the grid of optical depths; a first step of half of that is taken exactly."""


class Clouds(NamedTuple):
    """A layer of clouds with volume."""

    amount: Float32Array  # (MAP, MAP) [0, 1]: 0 between clouds, greatest in the middle of a large one
    noise: Float32Array  # (NOISE, NOISE, NOISE) [0, 1], greatest in the middle of a billow
    base: float  # [m] above the ground
    thickness: float  # [m] of the tallest
    extinction: float  # [1/m] inside
    shift: tuple[float, float]  # [m] of the map; the world's origin is at this point of it


class Shade(NamedTuple):
    """Optical depth towards the sun on a grid that repeats with the map."""

    depth: Float32Array  # (MAP_TEXEL / SHADE_TEXEL * MAP, the same, layers)
    sun: Array  # (3,) unit vector


class CloudLight(NamedTuple):
    """What shines on clouds; linear sRGB."""

    sun: Array  # (3,) unit vector
    direct: Array  # (3,) irradiance by the sun at the height of clouds
    above: Array  # (3,) mean radiance of the sky
    below: Array  # (3,) irradiance of the ground below


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


@inlined
def read_map(values: Float32Array, x: float, y: float) -> float:
    """Bilinear value of a repeating map at x, y in texels."""
    fx, fy = np.floor(x), np.floor(y)
    i, j, u, v = int(fx) % MAP, int(fy) % MAP, x - fx, y - fy
    k, m = (i + 1) % MAP, (j + 1) % MAP
    near = values[i, j] * (1.0 - v) + values[i, m] * v
    return near + (values[k, j] * (1.0 - v) + values[k, m] * v - near) * u  # type: ignore[no-any-return]


@inlined
def _read_noise(values: Float32Array, x: float, y: float, z: float) -> float:
    """Trilinear value of the cube at x, y, z in periods."""
    x, y, z = x * NOISE, y * NOISE, z * NOISE
    fx, fy, fz = np.floor(x), np.floor(y), np.floor(z)
    i, j, k, u, v, w = int(fx) % NOISE, int(fy) % NOISE, int(fz) % NOISE, x - fx, y - fy, z - fz
    i1, j1, k1 = (i + 1) % NOISE, (j + 1) % NOISE, (k + 1) % NOISE
    a = values[i, j, k] * (1.0 - w) + values[i, j, k1] * w
    b = values[i, j1, k] * (1.0 - w) + values[i, j1, k1] * w
    c = values[i1, j, k] * (1.0 - w) + values[i1, j, k1] * w
    d = values[i1, j1, k] * (1.0 - w) + values[i1, j1, k1] * w
    a += (b - a) * v
    c += (d - c) * v
    return a + (c - a) * u  # type: ignore[no-any-return]


@kernel
def extinction_at(clouds: Clouds, x: float, y: float, z: float) -> float:
    """Extinction [1/m] at a point."""
    h = (z - clouds.base) / clouds.thickness
    if h <= 0.0 or h >= 1.0:
        return 0.0
    x, y = x + clouds.shift[0], y + clouds.shift[1]
    amount = read_map(clouds.amount, x / MAP_TEXEL, y / MAP_TEXEL)
    if amount <= 0.0:
        return 0.0
    inside = amount - h
    if inside <= 0.0:
        return 0.0
    coarse = 1.0 - _read_noise(clouds.noise, x / 1100.0, y / 1100.0, z / 1100.0)
    fine = 1.0 - _read_noise(clouds.noise, x / 430.0, z / 430.0, y / 430.0)
    finest = 1.0 - _read_noise(clouds.noise, z / 150.0, x / 150.0, y / 150.0)
    eaten = 0.42 * coarse + 0.38 * fine + 0.3 * finest
    inside -= min(amount, 0.6) * (0.7 + 0.4 * min(3.0 * h / amount, 1.0)) * eaten
    if inside <= 0.0:
        return 0.0
    return clouds.extinction * min(inside / 0.12, 1.0) * min(h / 0.06, 1.0)


@kernel
def _depth_towards(clouds: Clouds, x: float, y: float, z: float, sun: Array) -> float:
    """Optical depth from a point towards the sun, sampled ever more coarsely."""
    total, start, step = 0.0, 0.0, 25.0
    for _ in range(_SUN_STEPS):
        t = start + 0.5 * step
        total += step * extinction_at(clouds, x + t * sun[0], y + t * sun[1], z + t * sun[2])
        start += step
        step *= 1.7
    return total


def shade_of(clouds: Clouds, sun: Array, pool: ThreadPoolExecutor) -> Shade:
    """Sum the depth towards the sun at the nodes of a grid."""
    nodes, layers = int(MAP * MAP_TEXEL / SHADE_TEXEL), int(np.ceil(clouds.thickness / SHADE_TEXEL)) + 1
    depth = np.zeros((nodes, nodes, layers), np.float32)
    list(pool.map(lambda i: _fill_shade(clouds, sun, i, depth[i]), range(nodes)))
    return Shade(depth, sun)


@kernel
def _fill_shade(clouds: Clouds, sun: Array, row: int, depth: Float32Array) -> None:
    """Fill one row (nodes, layers) of the grid; without clouds nearby it stays 0."""
    x = row * SHADE_TEXEL - clouds.shift[0]
    for j in range(depth.shape[0]):
        for k in range(depth.shape[1]):
            y, z = j * SHADE_TEXEL - clouds.shift[1], clouds.base + k * SHADE_TEXEL
            depth[j, k] = _depth_towards(clouds, x, y, z, sun)


@inlined
def _shade_at(clouds: Clouds, depth: Float32Array, x: float, y: float, z: float) -> float:
    """Trilinear depth at a point."""
    x, y, z = (x + clouds.shift[0]) / SHADE_TEXEL, (y + clouds.shift[1]) / SHADE_TEXEL, (z - clouds.base) / SHADE_TEXEL
    nodes, top = depth.shape[0], depth.shape[2] - 1.001
    z = min(max(z, 0.0), top)
    fx, fy = np.floor(x), np.floor(y)
    i, j, k, u, v = int(fx) % nodes, int(fy) % nodes, int(z), x - fx, y - fy
    i1, j1, w = (i + 1) % nodes, (j + 1) % nodes, z - int(z)
    a = depth[i, j, k] * (1.0 - w) + depth[i, j, k + 1] * w
    b = depth[i, j1, k] * (1.0 - w) + depth[i, j1, k + 1] * w
    c = depth[i1, j, k] * (1.0 - w) + depth[i1, j, k + 1] * w
    d = depth[i1, j1, k] * (1.0 - w) + depth[i1, j1, k + 1] * w
    a += (b - a) * v
    c += (d - c) * v
    return a + (c - a) * u  # type: ignore[no-any-return]


@kernel
def march(clouds: Clouds, shade: Shade, light: CloudLight, ray: tuple[float, float, float], out: Array) -> float:
    """Add the light (3,) of clouds along a ray from the ground to ``out``; returns the share of light from beyond."""
    dx, dy, dz = ray
    (sx, sy, sz), first, depth = shade.sun, 0.5 * SHADE_TEXEL, shade.depth
    t, end = clouds.base / dz, min((clouds.base + clouds.thickness) / dz, FARTHEST)
    cosine = dx * light.sun[0] + dy * light.sun[1] + dz * light.sun[2]
    left, outside = 1.0, True
    while t < end and left > 0.01:
        step = min(max(0.006 * t, 20.0), 250.0)
        extinction = extinction_at(clouds, (t + step) * dx, (t + step) * dy, (t + step) * dz)
        if extinction <= 0.0:
            t, outside = t + step, True
            continue
        if outside:  # find the edge, so that steps do not show
            outside, near = False, step
            for _ in range(5):
                near *= 0.5
                s = t + near
                if extinction_at(clouds, s * dx, s * dy, s * dz) <= 0.0:
                    t = s
            step = max(0.4 * step, 12.0)
            extinction = extinction_at(clouds, (t + 0.5 * step) * dx, (t + 0.5 * step) * dy, (t + 0.5 * step) * dz)
        t += step
        x, y, z = t * dx, t * dy, t * dz
        middle, beyond = 0.5 * first, first
        towards_sun = first * extinction_at(clouds, x + middle * sx, y + middle * sy, z + middle * sz)
        towards_sun += _shade_at(clouds, depth, x + beyond * sx, y + beyond * sy, z + beyond * sz)
        direct, gain, thin, round_ = 0.0, 1.0, 1.0, 1.0
        for _ in range(_OCTAVES):
            phase = 0.75 * forward_phase(cosine, 0.80 * round_) + 0.25 * forward_phase(cosine, -0.25 * round_)
            direct += gain * np.exp(-thin * towards_sun) * phase
            gain, thin, round_ = 0.75 * gain, 0.38 * thin, 0.5 * round_
        h = (z - clouds.base) / clouds.thickness
        open_above, open_below = 0.35 + 0.65 * h, 0.6 * (1.0 - h) ** 2
        absorbed = left * (1.0 - np.exp(-extinction * step))
        for channel in range(3):
            radiance = direct * light.direct[channel] + open_above * light.above[channel]
            out[channel] += absorbed * (radiance + open_below * _BOUNCE / np.pi * light.below[channel])
        left *= np.exp(-extinction * step)
    return left


@kernel
def shadows(clouds: Clouds, sun: Array, points: Array, out: Float32Array) -> None:
    """Share (n,) of sunlight that reaches points (n, 2) at z = 0: half of what droplets scatter stays in the beam."""
    for k in range(len(points)):
        t, end, depth = clouds.base / sun[2], (clouds.base + clouds.thickness) / sun[2], 0.0
        step = (end - t) / 48.0
        for n in range(48):
            s = t + (n + 0.5) * step
            depth += step * extinction_at(clouds, points[k, 0] + s * sun[0], points[k, 1] + s * sun[1], s * sun[2])
        out[k] = np.exp(-0.5 * depth)

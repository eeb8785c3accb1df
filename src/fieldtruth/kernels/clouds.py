# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light that clouds scatter and stop: see ``render.daylight``."""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.atmosphere import forward_phase
from fieldtruth.kernels.compile import inlined, kernel

MAP: Final = 1024
MAP_TEXEL: Final = 12.0
"""The map repeats after 12.3 km."""
NOISE: Final = 64
"""Nodes of the repeating cube of noise along each axis."""
FARTHEST: Final = 45_000.0
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
    """Light that falls on clouds; linear sRGB."""

    sun: Array  # (3,) unit vector
    direct: Array  # (3,) irradiance by the sun at the height of clouds
    above: Array  # (3,) mean radiance of the sky
    below: Array  # (3,) irradiance of the ground below


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


@kernel
def fill_shade(clouds: Clouds, sun: Array, row: int, depth: Float32Array) -> None:
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


THICK_COLOUR: Final = np.array([0.985, 1.0, 1.02])
"""Of light that passed through water: red is absorbed first."""


class Layer(NamedTuple):
    """A layer of clouds without volume."""

    depth: Float32Array  # (MAP, MAP) vertical optical depth
    height: float  # [m]
    scale: float  # length on the map [m] per metre of the layer
    shift: tuple[float, float]  # [m] on the map
    thick: bool  # no direct light passes
    mean: float  # of depth
    structure: float  # of the light through a thick layer: 0 even, 1 as the two-stream law has it


@kernel
def depth_at(layer: Layer, x: float, y: float) -> float:
    """Optical depth above a point [m] of the layer."""
    scale = layer.scale / MAP_TEXEL
    return read_map(layer.depth, scale * x + layer.shift[0], scale * y + layer.shift[1])


@kernel
def layer_light(layer: Layer, light: CloudLight, level: Array, ray: tuple[float, float, float], out: Array) -> float:
    """Add the light (3,) of the layer along a ray to ``out``; returns the share of light from beyond.

    Under a thick layer the luminance is that of the CIE's overcast sky (Moon and Spencer 1942): three times as great
    overhead as at the horizon. ``level`` is the irradiance (3,) of level ground by the mean layer.
    """
    dx, dy, dz = ray
    distance = layer.height / max(dz + 0.02, 0.02)
    depth = depth_at(layer, distance * dx, distance * dy)
    if layer.thick:
        per_depth = 0.75 * 0.15
        varied = (1.0 + per_depth * layer.structure * layer.mean) / (1.0 + per_depth * layer.structure * depth)
        far = min(dz / 0.12, 1.0)  # towards the horizon many clouds share a pixel
        radiance = (1.0 + 2.0 * dz) / 3.0 * 9.0 / (7.0 * np.pi) * (1.0 + (varied - 1.0) * far)
        for channel in range(3):
            out[channel] += radiance * level[channel] * THICK_COLOUR[channel]
        return 0.0
    left = np.exp(-depth / max(dz, 0.08))
    cosine = dx * light.sun[0] + dy * light.sun[1] + dz * light.sun[2]
    phase = 0.35 * forward_phase(cosine, 0.9) + 0.45 * forward_phase(cosine, 0.5) + 0.2 / (4.0 * np.pi)
    for channel in range(3):
        out[channel] += (1.0 - left) * (1.6 * phase * light.direct[channel] + light.above[channel])
    return left  # type: ignore[no-any-return]

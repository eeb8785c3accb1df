# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds as a thin layer: cirrus, through which the sun shines, and stratus and overcast, through which it does not."""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import kernel
from fieldtruth.render.sky.atmosphere import forward_phase
from fieldtruth.render.sky.clouds import MAP_TEXEL, CloudLight, band_noise, ranks, read_map

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

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Short grass, litter, crumbs: what rays meet above the soil where no blade stands, and wheels press flat.

Its heights are normal numbers of the ground types' means and deviations, correlated over a few centimetres. It fades
out towards the edge of a trail from both sides, and where the cover changes to bare ground it changes with it.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.world.ground_types import GROUND_TYPES, Layer
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Terrain
from fieldtruth.world.relief.roughness import relief_axes, relief_spacing

EDGE: Final = 0.12
"""Distance [m] from a trail's edge, or from its border, at which the layer has its full height."""


def with_layer(terrain: Terrain, rng: np.random.Generator) -> Terrain:
    """Add the layers that belong to a terrain's cover and to its trails."""
    names = (*terrain.ground_materials, terrain.trail_material)
    layers = [GROUND_TYPES[MATERIALS[name].ground_type].layer for name in names]
    distance = terrain.trail_distance.at(*np.meshgrid(*_axes(terrain), indexing="ij", sparse=True))
    outside = np.clip(distance / EDGE, 0.0, 1.0)
    inside = np.clip(-(distance + terrain.border_width) / EDGE, 0.0, 1.0)
    height = np.zeros(terrain.field.heights.shape)
    for correlation in sorted({layer.correlation for layer in layers if layer is not None}):
        own = [layer if layer is not None and layer.correlation == correlation else Layer(0.0, 0.0) for layer in layers]
        mean, deviation = (
            outside * _on_nodes(terrain, terrain.cover.values @ np.array(values[:-1], np.float32)) + inside * values[-1]
            for values in ([layer.mean for layer in own], [layer.deviation for layer in own])
        )
        height += mean + deviation * _noise(terrain, correlation, rng)
    # A half-precision number, 15 um fine at 3 cm, is what a stored world keeps.
    return replace(terrain, layer=np.maximum(height, 0.0).astype(np.float16).astype(np.float32))


def _noise(terrain: Terrain, correlation: float, rng: np.random.Generator) -> Array:
    """Normal numbers of unit deviation whose correlation falls to 1/e over ``correlation`` [m] (Gaussian)."""
    x, y = _axes(terrain)
    own = relief_axes(x, y)
    width = correlation / relief_spacing(x, y) / 2.0
    kernel = np.zeros(2 * int(4 * width + 1) + 1)
    kernel[len(kernel) // 2] = 1.0
    gain = (gaussian_filter(kernel, width, mode="constant") ** 2).sum()  # along one axis; the square of the amplitude
    white = rng.standard_normal([len(axis) for axis in own], dtype=np.float32)
    return np.asarray(RectBivariateSpline(*own, gaussian_filter(white, width) / gain, kx=1, ky=1)(x, y))


def _axes(terrain: Terrain) -> tuple[Array, Array]:
    field, (nx, ny) = terrain.field, terrain.field.heights.shape
    x, y = field.spacing * np.arange(nx, dtype=np.float64), field.spacing * np.arange(ny, dtype=np.float64)
    return np.asarray(field.x0 + x), np.asarray(field.y0 + y)


def _on_nodes(terrain: Terrain, values: Float32Array) -> Array:
    """Values at the cover's nodes, at the nodes of the field."""
    cover, (nx, ny) = terrain.cover, values.shape
    x, y = cover.x0 + cover.spacing * np.arange(nx), cover.y0 + cover.spacing * np.arange(ny)
    return np.asarray(RectBivariateSpline(x, y, values, kx=1, ky=1)(*_axes(terrain)))

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The light volume: what sky, sunlit ground and leaves send through the air, as probes on a grid.

Each probe keeps, by channel, coefficients of the irradiance E on a surface with the unit normal n, over pi:
E(n) / pi = c0 + c1 . n + c2 max(nz, 0)^2, with c0 the mean radiance over all directions and c1 twice the mean of
radiance times direction (Ramamoorthi and Hanrahan 2001, the first two bands). For light from a half space, as over a
plane below an even sky, these are exact; below the CIE's overcast sky they give a level surface 7 % too little. So c2
is what a level surface receives in addition: exact for all that faces up. A leaf reads both of its sides with one
lookup, with n and with -n.

Probes are filled by shading what their rays hit as a photograph does, several times: each time adds a reflection, of
light that the volume of the time before brings.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np
from scipy.ndimage import convolve1d

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.light import AIR_BASE, AIR_LAYER, Shading
from fieldtruth.kernels.light_probes import PROBES, UP, gather_probes
from fieldtruth.kernels.shading import new_shading_buffers
from fieldtruth.render.sky.dome import soft_dome

LAYERS: Final = 14
COEFFICIENTS: Final = 16
"""Floats per probe, one cache line: 4 of each channel (c0, then c1 along x, y, z), c2 of each channel, 1 unused."""
RAYS: Final = (16, 16, 48)
"""Directions from each probe, for each reflection: light of the first ones is gathered again."""
_BLUR: Final = (0.25, 0.5, 0.25)
_SETS: Final = 4


def sphere(count: int, turn: float) -> Array:
    """Directions (count, 3) spread evenly over the sphere (spherical Fibonacci), turned about z by ``turn`` [rad]."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, k * np.pi * (3.0 - np.sqrt(5.0)) + turn
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)


def fill_volume(shading: Shading, veil: Float32Array, pool: ThreadPoolExecutor) -> Float32Array:
    """Fill the probes (nx, ny, LAYERS, COEFFICIENTS) of ``shading.light``, whose volume gives their number.

    ``veil`` (3,) is radiance of the air that comes from the whole sky in addition to that of the dome.
    """
    shading = shading._replace(light=shading.light._replace(dome=soft_dome(shading.light.dome)))  # rays are few
    for rays in RAYS:
        volume = _gathered(shading, veil, rays, pool)
        shading = shading._replace(light=shading.light._replace(volume=volume))
    return shading.light.volume


def _gathered(shading: Shading, veil: Float32Array, rays: int, pool: ThreadPoolExecutor) -> Float32Array:
    """Gather over all probes in ``rays`` directions, then blur; probes inside of solid objects have no weight."""
    light = shading.light
    nx, ny, nz, _ = light.volume.shape
    volume, inside = np.zeros_like(light.volume), np.zeros((nx, ny, nz), np.float32)
    x, y = (
        start + np.arange(n) / light.volume_per_metre for start, n in zip(light.volume_corner, (nx, ny), strict=True)
    )
    above = AIR_BASE + AIR_LAYER * np.arange(nz)
    sets = [sphere(rays, 2.0 * np.pi * k * 0.381966).astype(np.float32) for k in range(_SETS)]

    def column_row(i: int) -> None:
        buffers = new_shading_buffers(PROBES * rays)
        for parity in range(_SETS):
            j, k = np.nonzero((np.arange(ny)[:, None] + 2 * i + np.arange(nz)) % _SETS == parity)
            points = np.stack([np.full(len(j), x[i]), y[j], light.volume_base[i, j] + above[k]], axis=-1)
            found, behind = np.zeros((len(j), COEFFICIENTS), np.float32), np.zeros(len(j), np.float32)
            heights = above[k].astype(np.float32)
            gather_probes(shading, buffers, points.astype(np.float32), heights, sets[parity], veil, found, behind)
            found[:, UP : UP + 3] -= found[:, 0:UP:4] + found[:, 3:UP:4]
            volume[i, j, k], inside[i, j, k] = found, behind

    list(pool.map(column_row, range(nx)))
    weight = np.maximum(1.0 - 3.0 * inside, np.float32(1e-3))
    volume *= weight[..., None]
    for axis in (0, 1):
        volume, weight = (convolve1d(each, _BLUR, axis=axis, mode="nearest") for each in (volume, weight))
    return np.ascontiguousarray(volume / weight[..., None], np.float32)

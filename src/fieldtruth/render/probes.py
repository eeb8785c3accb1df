# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Reading the light volume in kernels; ``render.volume`` says what its coefficients are and fills it."""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import inlined
from fieldtruth.render.tables import AIR_BASE, AIR_LAYER

READ: Final = 15
"""Coefficients that are read: 4 of each channel, then one of each for what faces up."""
_PER_LAYER: Final = np.float32(1.0 / AIR_LAYER)
_BASE: Final = np.float32(AIR_BASE)


@inlined
def read_probes(
    volume: Float32Array, base: Float32Array, u: np.float32, v: np.float32, z: np.float32, out: Float32Array
) -> None:
    """Trilinear coefficients at node u, v of the volume and height z [m], into ``out`` (READ,)."""
    zero, one, end = np.float32(0.0), np.float32(1.0), np.float32(1.001)
    u = min(max(u, zero), np.float32(volume.shape[0]) - end)
    v = min(max(v, zero), np.float32(volume.shape[1]) - end)
    row, column = int(u), int(v)
    fu, fv = u - np.float32(row), v - np.float32(column)
    i, j, next_one = np.uintp(row), np.uintp(column), np.uintp(1)
    i1, j1 = i + next_one, j + next_one
    a, b, c, d = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
    ground = base[i, j] * a + base[i, j1] * b + base[i1, j] * c + base[i1, j1] * d
    w = min(max((z - ground - _BASE) * _PER_LAYER, zero), np.float32(volume.shape[2]) - end)
    layer = int(w)
    fw = w - np.float32(layer)
    k, low = np.uintp(layer), one - fw
    k1 = k + next_one
    a0, b0, c0, d0 = a * low, b * low, c * low, d * low
    a1, b1, c1, d1 = a * fw, b * fw, c * fw, d * fw
    for n in range(READ):
        out[n] = (
            volume[i, j, k, n] * a0 + volume[i, j, k1, n] * a1 + volume[i, j1, k, n] * b0 + volume[i, j1, k1, n] * b1
            + volume[i1, j, k, n] * c0 + volume[i1, j, k1, n] * c1
            + volume[i1, j1, k, n] * d0 + volume[i1, j1, k1, n] * d1
        )  # fmt: skip


@inlined
def read_lowest(volume: Float32Array, u: np.float32, v: np.float32, out: Float32Array) -> None:
    """Bilinear coefficients at node u, v of the lowest layer, into ``out`` (READ,)."""
    zero, one, end = np.float32(0.0), np.float32(1.0), np.float32(1.001)
    u = min(max(u, zero), np.float32(volume.shape[0]) - end)
    v = min(max(v, zero), np.float32(volume.shape[1]) - end)
    row, column = int(u), int(v)
    fu, fv = u - np.float32(row), v - np.float32(column)
    i, j, next_one, k = np.uintp(row), np.uintp(column), np.uintp(1), np.uintp(0)
    i1, j1 = i + next_one, j + next_one
    a, b, c, d = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
    for n in range(READ):
        out[n] = volume[i, j, k, n] * a + volume[i, j1, k, n] * b + volume[i1, j, k, n] * c + volume[i1, j1, k, n] * d


@inlined
def falling_on(probe: Float32Array, channel: int, nx: np.float32, ny: np.float32, nz: np.float32) -> np.float32:
    """Irradiance over pi on a surface with this normal: two bands, and what they lack on a level surface."""
    at, up = 4 * channel, max(nz, np.float32(0.0))
    value = probe[at] + probe[at + 1] * nx + probe[at + 2] * ny + probe[at + 3] * nz + probe[12 + channel] * up * up
    return max(value, np.float32(0.0))


@inlined
def among(open_share: np.float32, reflectance: np.float32) -> np.float32:
    """Share of the light from afar at a point of which ``open_share`` of the directions are open.

    The others end on near surfaces, which are as bright as this one: with the reflectance r and the share s of the
    light L, the surface has the irradiance s L + (1 - s) r E = E.
    """
    one = np.float32(1.0)
    return open_share / (one - reflectance * (one - open_share))

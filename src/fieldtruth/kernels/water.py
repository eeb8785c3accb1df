# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays that continue from water: one refracted to the bottom, and those that are reflected.

Waves are a sum of sines, faded out where a pixel spans several; without wind they stand still. In wind a pixel mirrors
from several facets of those waves that are too short for it.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.camera_rays import RayBatch, new_batch, seen_over_map
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.gbuffer import FIELDS, MIRROR
from fieldtruth.kernels.packets import IntArray, Packet, SceneRays, hit_mover, hit_top, set_ray, trace_packet

_LANES, _FAR = packets.LANES, packets.TFAR
REFRACTION: Final = 1.0 / 1.333
"""Refractive index of air over that of water."""
ABSORPTION: Final = np.array([1.3, 0.75, 0.95], np.float32)
"""[1/m] of light in a lake in summer, rich in algae and humus: green penetrates deepest (Kirk 2011, Light and
Photosynthesis in Aquatic Ecosystems, attenuation of such waters about 1 per metre)."""
_WAVES: Final = 14
_FARTHEST: Final = 400.0  # [m]
_PRIM, _U, _V = packets.PRIM_ID, packets.HIT_U, packets.HIT_V


class SecondaryBatch(NamedTuple):
    """Rays that start on water, and the row of the batch that each belongs to. Threads must not share it."""

    batch: RayBatch
    gbuffer: Float32Array  # (n, FIELDS)
    colour: Float32Array  # (n, 3)
    row: IntArray  # (n,) of the point on the water
    share: Float32Array  # (n,) of the light that is reflected there
    slopes: Float32Array  # (n, 5) by the batch's rows: slope of the water, and variances of it below a pixel
    under: Float32Array  # (n, 3) by the batch's rows: colour of the water without what it reflects


def new_secondary_batch(count: int) -> SecondaryBatch:
    """Allocate memory for ``count`` rays."""
    return SecondaryBatch(
        batch=new_batch(count),
        gbuffer=np.zeros((count, FIELDS), np.float32),
        colour=np.zeros((count, 3), np.float32),
        row=np.zeros(count, np.int32),
        share=np.zeros(count, np.float32),
        slopes=np.zeros((count, 5), np.float32),
        under=np.zeros((count, 3), np.float32),
    )


def _waves() -> Float32Array:
    """Rows as in ``Shading.ripples``: waves of 0.1 to 2.5 m that a light wind drives towards +x."""
    rng = np.random.default_rng(5)
    length = np.geomspace(0.12, 2.6, _WAVES)
    heading = rng.normal(0.35, 0.55, _WAVES)
    slope = 0.0125 * (length / 0.6).clip(0.5, 1.0)
    k = 2.0 * np.pi / length
    waves = [k * np.cos(heading), k * np.sin(heading), slope, rng.uniform(0.0, 2.0 * np.pi, _WAVES), np.zeros(_WAVES)]
    return np.stack(waves, axis=-1).astype(np.float32)


def _seen_slopes() -> Float32Array:
    """Slopes z, over their deviation, below which shares (columns) of the facets that are seen are.

    Slopes are normal, and a facet is seen by its projected area, t + z: t, the tangent of the elevation over the
    deviation, is r / (1 - r) in rows of equal steps of r. The integral of (t + z) f(z) from -t is
    f(t) - f(z) + t (F(z) - F(-t)), with the normal distribution F and its density f. The last row, of a large t, is the
    normal distribution.
    """
    z, table = np.linspace(-5.0, 5.0, 4001), np.empty((65, 257))
    below = np.array([0.5 * (1.0 + math.erf(each * math.sqrt(0.5))) for each in z])
    density = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    shares = np.linspace(0.0, 1.0, table.shape[1])
    shares[[0, -1]] = 0.25 * shares[1], 1.0 - 0.25 * shares[1]  # the tails have no end
    for row, r in enumerate(np.linspace(0.0, 1.0, table.shape[0])):
        area = below
        if r < 1.0:
            t = r / (1.0 - r)
            first = 0.5 * (1.0 - math.erf(t * math.sqrt(0.5)))
            area = math.exp(-0.5 * t * t) / math.sqrt(2.0 * math.pi) - density + t * (below - first)
            area = np.where(z > -t, area, 0.0)
        area = np.maximum.accumulate(area)
        start = max(int(np.searchsorted(area, 0.0, side="right")) - 1, 0)
        table[row] = np.interp(shares, area[start:] / area[-1], z[start:])
    return table.astype(np.float32)


SAMPLES: Final = 4
"""Facets of a pixel that mirror, where it spans many; a prime less 1, so that parts along and across the ray differ."""
REFRACTED: Final = -1
_LEVEL: Final = 1e4  # tangent over deviation from above, where all facets are seen as well
_TABLE: Final = _seen_slopes()
RIPPLES: Final = _waves()
"""Those without wind; in wind they are of ``sense.ripples``."""


@inlined
def _slope(ripples: Float32Array, x: float, y: float, footprint: float) -> tuple[np.float32, np.float32]:
    """Slope of the water along x and y; waves shorter than two footprints [m] of a pixel fade."""
    sx, sy = np.float32(0.0), np.float32(0.0)
    for n in range(ripples.shape[0]):
        kx, ky = ripples[n, 0], ripples[n, 1]
        wave_number = np.sqrt(kx * kx + ky * ky)
        fade = np.float32(1.6) - np.float32(0.5) * footprint * wave_number
        if fade <= 0.0:
            continue
        steep = ripples[n, 2] * min(fade, np.float32(1.0)) * np.cos(kx * x + ky * y + ripples[n, 3]) / wave_number
        sx += steep * kx
        sy += steep * ky
    return sx, sy


_Variances = tuple[float, float, float]
"""Of the slope along a ray, of both slopes together, and of that across it."""


@inlined
def _unresolved(ripples: Float32Array, ahead: tuple[float, float], footprint: float) -> _Variances:
    """Variances of the slopes of waves that are too short for a pixel, about the unit direction ``ahead``."""
    dx, dy = ahead
    along, both, across = 0.0, 0.0, 0.0
    for n in range(ripples.shape[0]):
        if ripples[n, 4] > 0.0:
            kx, ky = ripples[n, 0], ripples[n, 1]
            wave_number = math.sqrt(kx * kx + ky * ky)
            fade = min(max(1.6 - 0.5 * footprint * wave_number, 0.0), 1.0)
            power = 0.5 * ripples[n, 4] * (1.0 - fade * fade) * ripples[n, 2] * ripples[n, 2]
            a, b = (kx * dx + ky * dy) / wave_number, (ky * dx - kx * dy) / wave_number
            along += power * a * a
            both += power * a * b
            across += power * b * b
    return along, both, across


@inlined
def _seen(t: float, share: float) -> float:
    """Slope, over its deviation, that a share of the facets which are seen stays below; see ``_seen_slopes``."""
    row, column = t / (1.0 + t) * (_TABLE.shape[0] - 1), share * (_TABLE.shape[1] - 1)
    i, j = min(int(row), _TABLE.shape[0] - 2), min(int(column), _TABLE.shape[1] - 2)
    a, b = row - i, column - j
    return float(
        (1.0 - a) * ((1.0 - b) * _TABLE[i, j] + b * _TABLE[i, j + 1])
        + a * ((1.0 - b) * _TABLE[i + 1, j] + b * _TABLE[i + 1, j + 1])
    )


@inlined
def _facet(
    variances: _Variances, ahead: tuple[float, float], steep: float, sample: int, number: tuple[float, float]
) -> tuple[float, float]:
    """Slope along x and y of one of SAMPLES facets of waves below a pixel; ``steep``: tangent of the ray's elevation.

    Each is from another part of those that are seen, at random ``number`` (2,) in it, so that together they are spread
    as all of them are. Refracted rays (REFRACTED) take the middle one.
    """
    dx, dy = ahead
    along, both, across = variances
    deviation = math.sqrt(along)
    if sample == REFRACTED:
        first, second = 0.5, 0.5
    else:
        first = (sample + number[0]) / SAMPLES
        turn = int(number[1] * SAMPLES)  # so that no part along the ray is always with the same across it
        part = ((2 * sample + 1) % (SAMPLES + 1) + turn) % SAMPLES
        second = (part + number[1] * SAMPLES - turn) / SAMPLES
    towards = deviation * _seen(steep / deviation, first)  # above 0 the water rises along the ray, and faces the viewer
    aside = both / along * towards + math.sqrt(max(across - both * both / along, 0.0)) * _seen(_LEVEL, second)
    return towards * dx - aside * dy, towards * dy + aside * dx


@inlined
def _mixed(x: float, y: float, phase: float) -> tuple[float, float]:
    """Two numbers in [0, 1) of a point of the water [m] and a phase that its stamp changes."""
    one = 43758.5453 * math.sin(12.9898 * x + 78.233 * y + 37.719 * phase)
    other = 24634.6345 * math.sin(39.3467 * x + 11.135 * y + 83.155 * phase)
    return one - math.floor(one), other - math.floor(other)


@kernel
def find_slopes(
    hit: tuple[RayBatch, Float32Array], ripples: Float32Array, count: int, pixel: float, second: SecondaryBatch
) -> None:
    """Write ``slopes`` of all hits on water, a batch with its G-buffer, for ``water_rays``."""
    batch, gbuffer = hit
    for k in range(count):
        dx, dy, dz = batch.direction[0, k], batch.direction[1, k], batch.direction[2, k]
        if batch.top[k] <= 0 or gbuffer[k, MIRROR] <= 0.0 or dz >= 0.0:
            continue
        footprint = np.float32(batch.distance[k] * pixel) / np.sqrt(max(-dz, np.float32(0.02)))
        sx, sy = _slope(ripples, batch.point[0, k], batch.point[1, k], footprint)
        along, both, across = _unresolved(ripples, _ahead(dx, dy), footprint)
        second.slopes[k, 0], second.slopes[k, 1] = sx, sy
        second.slopes[k, 2], second.slopes[k, 3], second.slopes[k, 4] = along, both, across


@inlined
def _ahead(dx: float, dy: float) -> tuple[float, float]:
    """Unit direction in plan view of a ray."""
    flat = math.sqrt(dx * dx + dy * dy)
    return (dx / flat, dy / flat) if flat > 1e-6 else (1.0, 0.0)


@kernel
def water_rays(
    hit: tuple[RayBatch, Float32Array], count: int, phase: float, sample: int, second: SecondaryBatch
) -> int:
    """Collect rays of all hits on water, whose ``slopes`` are known; returns their number.

    ``sample`` is REFRACTED, or the number of the reflected ray: where waves are too short for a pixel there are SAMPLES
    of them, elsewhere the first one only. ``share`` is the share of the light that the ray brings: Schlick's (1994)
    approximation of Fresnel reflectance, exact at normal and at grazing incidence, over the number of rays.
    """
    batch, gbuffer = hit
    top, point, direction, image = batch.top, batch.point, batch.direction, batch.image
    out, n, one = second.batch, 0, np.float32(1.0)
    for k in range(count):
        if top[k] <= 0 or gbuffer[k, MIRROR] <= 0.0:
            continue
        dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
        if dz >= 0.0:
            continue
        sx, sy, weight = second.slopes[k, 0], second.slopes[k, 1], one
        is_rough = second.slopes[k, 2] > 1e-9
        if sample > 0 and not is_rough:
            continue
        if is_rough:
            weight = np.float32(1.0 / SAMPLES)
            number, flat = _mixed(point[0, k], point[1, k], phase), math.sqrt(dx * dx + dy * dy)
            variances = (second.slopes[k, 2], second.slopes[k, 3], second.slopes[k, 4])
            tx, ty = _facet(variances, _ahead(dx, dy), -dz / max(flat, 1e-6), sample, number)
            sx += np.float32(tx)
            sy += np.float32(ty)
        scale = one / np.sqrt(one + sx * sx + sy * sy)
        nx, ny, nz = -sx * scale, -sy * scale, scale
        cosine = max(-(dx * nx + dy * ny + dz * nz), np.float32(0.01))
        away = one - cosine
        away *= away * away * away * away
        share = gbuffer[k, MIRROR] + (one - gbuffer[k, MIRROR]) * away
        if sample != REFRACTED:
            rx, ry, rz = dx + 2 * cosine * nx, dy + 2 * cosine * ny, dz + 2 * cosine * nz
            if is_rough:
                rz = abs(rz)  # what a facet sends down, the water behind it sends up again
            rz = max(rz, np.float32(0.004))
        else:
            if share > np.float32(0.85):
                continue
            ratio = np.float32(REFRACTION)
            inner = np.sqrt(one - ratio * ratio * (one - cosine * cosine))
            rx = ratio * dx + (ratio * cosine - inner) * nx
            ry = ratio * dy + (ratio * cosine - inner) * ny
            rz = min(ratio * dz + (ratio * cosine - inner) * nz, np.float32(-0.05))
        scale = one / np.sqrt(rx * rx + ry * ry + rz * rz)
        out.direction[0, n], out.direction[1, n], out.direction[2, n] = rx * scale, ry * scale, rz * scale
        out.point[0, n], out.point[1, n], out.point[2, n] = point[0, k], point[1, k], point[2, k]
        out.image[0, n], out.image[1, n] = image[0, k], image[1, k]
        second.row[n], second.share[n] = k, share * weight
        n += 1
    return n


@kernel
def trace_secondary(scene: SceneRays, tops: IntArray, packet: Packet, second: SecondaryBatch, count: int) -> None:
    """Trace the first ``count`` rays from ``point``, which becomes that of the hit; ``tops`` as for ``trace``."""
    ray, words, valid, batch = packet.ray, packet.words, packet.valid, second.batch
    for first in range(0, count, _LANES):
        for lane in range(_LANES):
            k = first + lane
            if k >= count:
                valid[lane] = 0
                continue
            origin = batch.point[0, k], batch.point[1, k], batch.point[2, k]
            direction = batch.direction[0, k], batch.direction[1, k], batch.direction[2, k]
            set_ray(packet, lane, origin, direction, 0.01, _FARTHEST)
        trace_packet(scene, packet)
        for lane in range(min(_LANES, count - first)):
            k = first + lane
            t = ray[_FAR + lane]
            batch.distance[k], batch.foreshortening[k] = t, seen_over_map(ray, lane)
            for axis in range(3):
                batch.point[axis, k] += t * batch.direction[axis, k]
            batch.barycentric[0, k], batch.barycentric[1, k] = ray[_U + lane], ray[_V + lane]
            batch.primitive[k] = np.int32(words[_PRIM + lane])
            batch.top[k], batch.mover[k] = hit_top(tops, words, lane), hit_mover(scene, words, lane)


@kernel
def blend_reflection(second: SecondaryBatch, count: int, sample: int, colour: Float32Array) -> None:
    """Blend the light of a number of reflected rays into the colour of the water by their shares."""
    under = second.under
    for n in range(count):
        k, share = second.row[n], second.share[n]
        for channel in range(3):
            if sample == 0:
                under[k, channel] = colour[k, channel]
            colour[k, channel] += (second.colour[n, channel] - under[k, channel]) * share


@kernel
def blend_bottom(second: SecondaryBatch, count: int, colour: Float32Array) -> None:
    """Blend the bottom into the colour of the water by the light that is not absorbed."""
    for n in range(count):
        k, depth = second.row[n], second.batch.distance[n]
        if second.batch.top[n] < 0:
            continue
        for channel in range(3):
            left = np.exp(-ABSORPTION[channel] * np.float32(1.6) * depth)  # both down and up
            colour[k, channel] += (np.float32(0.9) * second.colour[n, channel] - colour[k, channel]) * left

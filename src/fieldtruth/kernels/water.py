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
from fieldtruth.kernels.light import sky_radiance
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
    slopes: Float32Array  # (n, 8) by the batch's rows: see ``find_slopes``


def new_secondary_batch(count: int) -> SecondaryBatch:
    """Allocate memory for ``count`` rays."""
    return SecondaryBatch(
        batch=new_batch(count),
        gbuffer=np.zeros((count, FIELDS), np.float32),
        colour=np.zeros((count, 3), np.float32),
        row=np.zeros(count, np.int32),
        share=np.zeros(count, np.float32),
        slopes=np.zeros((count, 8), np.float32),
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


_GAUSS = np.polynomial.legendre.leggauss(6)
_SHARES: Final = 0.5 + 0.5 * _GAUSS[0]
_WEIGHTS: Final = 0.25 * _GAUSS[1]  # half of a node's, as each has two facets
"""Facets of a pixel that mirror the sky, where it spans many: Gauss's nodes along the ray, two across it for each."""
_ROUGH: Final = 1e-9  # variance of slopes below a pixel, from which on it has facets
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


_Direction = tuple[float, float, float]
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
            if fade >= 1.0:
                continue
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
def _facets(variances: _Variances, ahead: tuple[float, float], steep: float, node: int) -> tuple[float, ...]:
    """Slopes along x and y of the two facets of a node, of waves below a pixel; ``steep``: tangent of the elevation.

    Across the ray they have the deviation to either side, which has the mean and variance of all.
    """
    along, both, across = variances
    deviation, aside = math.sqrt(along), math.sqrt(max(across - both * both / along, 0.0))
    towards = deviation * _seen(steep / deviation, _SHARES[node])  # above 0 the water rises along the ray
    left = _about(ahead, towards, both / along * towards + aside)
    right = _about(ahead, towards, both / along * towards - aside)
    return left[0], left[1], right[0], right[1]


@inlined
def _about(ahead: tuple[float, float], towards: float, aside: float) -> tuple[float, float]:
    """Slope along x and y of a slope along a ray's direction and across it."""
    return towards * ahead[0] - aside * ahead[1], towards * ahead[1] + aside * ahead[0]


@inlined
def _mean_facet(variances: _Variances, ahead: tuple[float, float], steep: float) -> tuple[float, float]:
    """Mean slope along x and y of the facets that are seen of waves below a pixel.

    At the elevation whose tangent is T it is v F(t) / (T F(t) + sqrt(v) f(t)) along the ray, t = T / sqrt(v), with the
    variance v, the normal distribution F and its density f: 1.25 sqrt(v) at grazing incidence, so far water mirrors
    higher sky.
    """
    along, both, _ = variances
    t = steep / math.sqrt(along)
    below = 0.5 * (1.0 + math.erf(t / math.sqrt(2.0)))
    towards = along * below / (steep * below + math.sqrt(along / (2.0 * math.pi)) * math.exp(-0.5 * t * t))
    return _about(ahead, towards, both / along * towards)


@inlined
def _mirrored(ray: _Direction, sx: float, sy: float, mirror: float) -> tuple[_Direction, float]:
    """Unit direction of a ray that a facet of a slope reflects upwards, and the share of the light that it reflects.

    What a facet sends down, the water behind it sends up again. The share is Schlick's (1994) approximation of Fresnel
    reflectance, exact at normal and at grazing incidence.
    """
    dx, dy, dz = ray
    scale = 1.0 / math.sqrt(1.0 + sx * sx + sy * sy)
    cosine = max((dx * sx + dy * sy - dz) * scale, 0.01)
    rx, ry, rz = dx - 2.0 * cosine * sx * scale, dy - 2.0 * cosine * sy * scale, abs(dz + 2.0 * cosine * scale)
    per = 1.0 / math.sqrt(rx * rx + ry * ry + rz * rz)
    away = (1.0 - cosine) ** 2
    return (rx * per, ry * per, rz * per), mirror + (1.0 - mirror) * away * away * (1.0 - cosine)


@inlined
def _ahead(dx: float, dy: float) -> tuple[float, float]:
    """Unit direction in plan view of a ray."""
    flat = math.sqrt(dx * dx + dy * dy)
    return (dx / flat, dy / flat) if flat > 1e-6 else (1.0, 0.0)


@inlined
def _variances(second: SecondaryBatch, k: int) -> _Variances:
    """Variances of the slopes below the pixel of a row."""
    return second.slopes[k, 2], second.slopes[k, 3], second.slopes[k, 4]


@inlined
def _steep(dx: float, dy: float, dz: float) -> float:
    """Tangent of the elevation from which a ray comes."""
    return -dz / max(math.sqrt(dx * dx + dy * dy), 1e-6)


@inlined
def _mean_share(second: SecondaryBatch, ray: _Direction, k: int, mirror: float) -> np.float32:
    """Mean share of the light that the facets of a pixel reflect."""
    dx, dy, dz = ray
    variances, ahead, steep, total = _variances(second, k), _ahead(dx, dy), _steep(dx, dy, dz), 0.0
    sx, sy = second.slopes[k, 0], second.slopes[k, 1]
    for node in range(len(_SHARES)):
        ax, ay, bx, by = _facets(variances, ahead, steep, node)
        shares = _mirrored(ray, sx + ax, sy + ay, mirror)[1] + _mirrored(ray, sx + bx, sy + by, mirror)[1]
        total += _WEIGHTS[node] * shares
    return np.float32(total)


@kernel
def find_slopes(
    hit: tuple[RayBatch, Float32Array], ripples: Float32Array, count: int, pixel: float, second: SecondaryBatch
) -> None:
    """Write ``slopes`` of all hits on water, a batch with its G-buffer, for ``water_rays``.

    They are the slope along x and y, the three variances of waves below the pixel, and of the facets of these the mean
    share of the light that they reflect, and the mean slope.
    """
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
        if along > _ROUGH:
            second.slopes[k, 5] = _mean_share(second, (dx, dy, dz), k, gbuffer[k, MIRROR])
            mean = _mean_facet((along, both, across), _ahead(dx, dy), _steep(dx, dy, dz))
            second.slopes[k, 6], second.slopes[k, 7] = mean


@kernel
def water_rays(hit: tuple[RayBatch, Float32Array], count: int, reflected: bool, second: SecondaryBatch) -> int:
    """Collect the reflected or refracted rays of all hits on water, whose ``slopes`` are known; returns their number.

    ``share`` is Schlick's (1994) approximation of Fresnel reflectance, exact at normal and at grazing incidence; where
    waves are too short for a pixel, the mean over its facets. Its ray is that of the mean slope of these.
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
        sx, sy = second.slopes[k, 0], second.slopes[k, 1]
        is_rough = second.slopes[k, 2] > _ROUGH
        if is_rough:
            sx += second.slopes[k, 6]
            sy += second.slopes[k, 7]
        scale = one / np.sqrt(one + sx * sx + sy * sy)
        nx, ny, nz = -sx * scale, -sy * scale, scale
        cosine = max(-(dx * nx + dy * ny + dz * nz), np.float32(0.01))
        away = one - cosine
        away *= away * away * away * away
        share = gbuffer[k, MIRROR] + (one - gbuffer[k, MIRROR]) * away
        if is_rough:
            share = second.slopes[k, 5]
        if reflected:
            rx, ry, rz = dx + 2 * cosine * nx, dy + 2 * cosine * ny, dz + 2 * cosine * nz
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
        second.row[n], second.share[n] = k, share
        n += 1
    return n


@kernel
def blur_sky(
    hit: tuple[RayBatch, Float32Array], second: SecondaryBatch, count: int, dome: Float32Array, scale: np.float32
) -> None:
    """Write the colour of reflected rays that meet the sky, of pixels of many facets: the mean of what these mirror.

    ``dome`` is the sky's image, and ``scale`` makes its radiance a colour.
    """
    gbuffer, direction = hit[1], hit[0].direction
    for n in range(count):
        k = second.row[n]
        if second.batch.top[n] >= 0 or second.slopes[k, 2] <= _ROUGH:
            continue
        dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
        variances, ahead, steep = _variances(second, k), _ahead(dx, dy), _steep(dx, dy, dz)
        red, green, blue, total = 0.0, 0.0, 0.0, 0.0
        sx, sy = second.slopes[k, 0], second.slopes[k, 1]
        for node in range(len(_SHARES)):
            ax, ay, bx, by = _facets(variances, ahead, steep, node)
            for tx, ty in ((ax, ay), (bx, by)):
                (rx, ry, rz), share = _mirrored((dx, dy, dz), sx + tx, sy + ty, gbuffer[k, MIRROR])
                share *= _WEIGHTS[node]
                r, g, b = sky_radiance(dome, rx, ry, rz)
                red, green, blue, total = red + share * r, green + share * g, blue + share * b, total + share
        second.colour[n, 0], second.colour[n, 1] = scale * red / total, scale * green / total
        second.colour[n, 2] = scale * blue / total


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
def blend_reflection(second: SecondaryBatch, count: int, colour: Float32Array) -> None:
    """Blend reflected light into the colour of the water by the Fresnel share."""
    for n in range(count):
        k, share = second.row[n], second.share[n]
        for channel in range(3):
            colour[k, channel] += (second.colour[n, channel] - colour[k, channel]) * share


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

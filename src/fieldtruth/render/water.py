# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Water as cameras see it: the mirrored world above, and below what light comes up through it, shared by Fresnel's law.

Only a photograph asks; labels end at the surface. Two rays per pixel of water start there: one mirrored, one refracted
to the bottom. The waves are a fixed sum of sines (the world stands still), which fade where a pixel spans several.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.render.shade import FIELDS, MIRROR
from fieldtruth.sense import embree
from fieldtruth.sense.kernel import inlined, kernel
from fieldtruth.sense.packets import Packet, set_ray
from fieldtruth.sense.strip import Strip, new_strip

REFRACTION: Final = 1.0 / 1.333
"""Index of air over that of water."""
ABSORPTION: Final = np.array([1.3, 0.75, 0.95], np.float32)
"""[1/m] of light in a lake of summer, rich in algae and humus: green goes deepest (Kirk 2011, Light and
Photosynthesis in Aquatic Ecosystems, attenuation of such waters about 1 per metre)."""
_WAVES: Final = 14
_REACH: Final = 400.0  # [m]

_LANES, _FAR = embree.LANES, embree.TFAR
_GEOM, _INST, _PRIM, _U, _V = embree.GEOM_ID, embree.INST_ID, embree.PRIM_ID, embree.HIT_U, embree.HIT_V
_MISS = np.uint32(embree.MISS)
_intersect: Any = embree.intersect


class Second(NamedTuple):
    """A thread's memory for the rays that start on water: as those of a darkroom, and the row each belongs to."""

    strip: Strip
    surface: NDArray[np.float32]  # (n, FIELDS)
    colour: NDArray[np.float32]  # (n, 3)
    row: NDArray[np.int32]  # (n,) of the point on the water
    share: NDArray[np.float32]  # (n,) of the light that is mirrored there


def new_second(count: int) -> Second:
    """Memory for as many points as a strip has."""
    return Second(
        new_strip(count), np.zeros((count, FIELDS), np.float32), np.zeros((count, 3), np.float32),
        np.zeros(count, np.int32), np.zeros(count, np.float32),
    )  # fmt: skip


def _waves() -> NDArray[np.float32]:
    """Rows of wave vector x, y [rad/m], slope, phase: ripples of 0.1 to 2.5 m that a light wind drives towards +x."""
    rng = np.random.default_rng(5)
    length = np.geomspace(0.12, 2.6, _WAVES)
    heading = rng.normal(0.35, 0.55, _WAVES)
    slope = 0.0125 * (length / 0.6).clip(0.5, 1.0)
    k = 2.0 * np.pi / length
    waves = [k * np.cos(heading), k * np.sin(heading), slope, rng.uniform(0.0, 2.0 * np.pi, _WAVES)]
    return np.stack(waves, axis=-1).astype(np.float32)


_RIPPLES = _waves()


@inlined
def _slope(x: float, y: float, footprint: float) -> tuple[float, float]:
    """Slope of the water along x and y; waves shorter than two footprints [m] of a pixel fade."""
    sx, sy = np.float32(0.0), np.float32(0.0)
    for n in range(_RIPPLES.shape[0]):
        kx, ky = _RIPPLES[n, 0], _RIPPLES[n, 1]
        wave_number = np.sqrt(kx * kx + ky * ky)
        fade = np.float32(1.6) - np.float32(0.5) * footprint * wave_number
        if fade <= 0.0:
            continue
        steep = _RIPPLES[n, 2] * min(fade, np.float32(1.0)) * np.cos(kx * x + ky * y + _RIPPLES[n, 3]) / wave_number
        sx += steep * kx
        sy += steep * ky
    return sx, sy  # type: ignore[return-value]


@kernel
def leave_water(
    strip: Strip, surface: NDArray[np.float32], count: int, pixel: float, mirrored: bool, second: Second
) -> int:
    """List the points on water and the directions in which their second rays go on; returns how many there are.

    ``share`` is Schlick's approximation of Fresnel's reflectance, exact at normal and at grazing incidence.
    """
    top, point, direction, reach, image = strip.top, strip.point, strip.direction, strip.reach, strip.image
    out, n, one = second.strip, 0, np.float32(1.0)
    for k in range(count):
        if top[k] <= 0 or surface[k, MIRROR] <= 0.0:
            continue
        dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
        if dz >= 0.0:
            continue
        footprint = np.float32(reach[k] * pixel) / np.sqrt(max(-dz, np.float32(0.02)))
        sx, sy = _slope(point[0, k], point[1, k], footprint)
        scale = one / np.sqrt(one + sx * sx + sy * sy)
        nx, ny, nz = -sx * scale, -sy * scale, scale
        cosine = max(-(dx * nx + dy * ny + dz * nz), np.float32(0.01))
        away = one - cosine
        away *= away * away * away * away
        share = surface[k, MIRROR] + (one - surface[k, MIRROR]) * away
        if mirrored:
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
def follow(scene: np.uint64, packet: Packet, second: Second, count: int) -> None:
    """Trace the listed rays from where they leave the water; ``point`` becomes what they hit."""
    ray, words, valid, strip = packet.ray, packet.words, packet.valid, second.strip
    for first in range(0, count, _LANES):
        for lane in range(_LANES):
            k = first + lane
            if k >= count:
                valid[lane] = 0
                continue
            dx, dy, dz = strip.direction[0, k], strip.direction[1, k], strip.direction[2, k]
            set_ray(packet, lane, strip.point[0, k], strip.point[1, k], strip.point[2, k], dx, dy, dz, 0.01, _REACH)
        _intersect(valid.ctypes, scene, ray.ctypes, packet.arguments.ctypes)
        for lane in range(min(_LANES, count - first)):
            k = first + lane
            t = ray[_FAR + lane]
            strip.reach[k] = t
            for axis in range(3):
                strip.point[axis, k] += t * strip.direction[axis, k]
            strip.barycentric[0, k], strip.barycentric[1, k] = ray[_U + lane], ray[_V + lane]
            strip.primitive[k] = np.int32(words[_PRIM + lane])
            geometry, instance = words[_GEOM + lane], words[_INST + lane]
            strip.top[k] = np.int32(geometry if instance == _MISS else instance)


@kernel
def mix_mirrored(second: Second, count: int, colour: NDArray[np.float32]) -> None:
    """Blend the mirrored light into the points' own by Fresnel's share."""
    for n in range(count):
        k, share = second.row[n], second.share[n]
        for channel in range(3):
            colour[k, channel] += (second.colour[n, channel] - colour[k, channel]) * share


@kernel
def mix_bottom(second: Second, count: int, colour: NDArray[np.float32]) -> None:
    """Blend the bottom into the water's own colour by what is left of its light on the way up."""
    for n in range(count):
        k, way = second.row[n], second.strip.reach[n]
        if second.strip.top[n] < 0:
            continue
        for channel in range(3):
            left = np.exp(-ABSORPTION[channel] * np.float32(1.6) * way)  # and on its way down
            colour[k, channel] += (np.float32(0.9) * second.colour[n, channel] - colour[k, channel]) * left

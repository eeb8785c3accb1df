# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The photograph: light on what the rays hit, finer rays where neighbours differ, the lens, and the film's curve."""

from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fieldtruth.sense import embree
from fieldtruth.sense.atlas import srgb_from_linear
from fieldtruth.sense.hits import TERRAIN, HitTable, classify, hit_top
from fieldtruth.sense.light import LightTable
from fieldtruth.sense.packets import Packet, set_ray
from fieldtruth.sense.paint import (
    FIELDS, GLOSS, NX, NY, NZ, RED, SKY, SUN, THROUGH, TRACE_SUN, PaintTable, paint_ground, paint_object,
)  # fmt: skip
from fieldtruth.sense.pinhole import Pinhole, set_pixel_ray
from fieldtruth.sense.scene import SurfaceTable
from fieldtruth.sense.sky import sky_radiance

EXPOSURE: Final = 3.1
HAZE_PER_METRE: Final = 1.0 / 1800.0
EDGE_CONTRAST: Final = 0.06
"""Difference of the square roots of neighbours' luminance above which a pixel is refined."""
CURVE_TOP: Final = 16.0
_STEPS: Final = 4096
_LENS: Final = 0.07
"""Share of a pixel's light that a good lens spills into each of its four neighbours."""

_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.TILE_WIDTH, embree.TILE_HEIGHT
_FAR, _PRIM = embree.TFAR, embree.PRIM_ID
_OX, _OY, _OZ, _DX, _DY, _DZ = embree.ORG_X, embree.ORG_Y, embree.ORG_Z, embree.DIR_X, embree.DIR_Y, embree.DIR_Z
_intersect: Any = embree.intersect
_occluded: Any = embree.occluded


class Studio(NamedTuple):
    """Everything that a photograph needs to know of a scene; only read."""

    scene: np.uint64
    hits: HitTable
    surfaces: SurfaceTable
    paint: PaintTable
    light: LightTable
    curve: NDArray[np.uint8]


def film_curve() -> NDArray[np.uint8]:
    """SRGB byte by the square root of linear light in [0, CURVE_TOP]: a filmic curve (Narkowicz 2015, ACES fit)."""
    light = np.linspace(0.0, np.sqrt(CURVE_TOP), _STEPS) ** 2
    film = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)
    return np.rint(255.0 * srgb_from_linear(film)).astype(np.uint8)


@njit(nogil=True, cache=True)
def _shade(
    studio: Studio, packet: Packet, shadow: Packet, surface: NDArray[np.float32], points: NDArray[np.float64],
    pixel: float, dither: NDArray[np.float32], colour: NDArray[np.float32],
) -> None:  # fmt: skip
    """Colour (LANES, 3), linear and exposed, of a packet that has been traced; ``pixel`` is one pixel's angle [rad]."""
    light = studio.light
    sx, sy, sz = light.sun[0], light.sun[1], light.sun[2]
    any_shadow = False
    for lane in range(_LANES):
        shadow.valid[lane] = 0
        if packet.valid[lane] == 0:
            continue
        top = hit_top(packet.words, lane)
        if top < 0:
            continue
        reach = packet.ray[_FAR + lane]
        x = packet.ray[_OX + lane] + reach * packet.ray[_DX + lane]
        y = packet.ray[_OY + lane] + reach * packet.ray[_DY + lane]
        z = packet.ray[_OZ + lane] + reach * packet.ray[_DZ + lane]
        points[lane, 0], points[lane, 1], points[lane, 2] = x, y, z
        out = surface[lane]
        if top == TERRAIN:
            paint_ground(packet, lane, x, y, reach * pixel, dither[lane], studio.hits, studio.paint, light, out)
        else:
            paint_object(
                packet, lane, top, reach * pixel, dither[lane], studio.hits, studio.surfaces, studio.paint, light, out
            )
            if out[SUN] == TRACE_SUN:
                facing = out[NX] * sx + out[NY] * sy + out[NZ] * sz
                out[SUN] = 0.0
                if facing > 0.0 or out[THROUGH] > 0.0:
                    side = 0.002 if facing > 0.0 else -0.002
                    set_ray(
                        shadow, lane, x + side * out[NX], y + side * out[NY], z + side * out[NZ],
                        sx, sy, sz, 0.002 + 1e-5 * reach, 80.0,
                    )  # fmt: skip
                    out[SUN] = 1.0
                    any_shadow = True
    if any_shadow:
        _occluded(shadow.valid.ctypes, studio.scene, shadow.ray.ctypes, shadow.arguments.ctypes)
    for lane in range(_LANES):
        if packet.valid[lane] == 0:
            continue
        dx, dy, dz = packet.ray[_DX + lane], packet.ray[_DY + lane], packet.ray[_DZ + lane]
        if hit_top(packet.words, lane) < 0:
            r, g, b = sky_radiance(light.dome, dx, dy, dz)
            colour[lane, 0], colour[lane, 1], colour[lane, 2] = EXPOSURE * r, EXPOSURE * g, EXPOSURE * b
            continue
        out = surface[lane]
        if shadow.valid[lane] != 0 and shadow.ray[_FAR + lane] < 0.0:
            out[SUN] = 0.0
        _light(light, out, dx, dy, dz, packet.ray[_FAR + lane], colour[lane])


@njit(nogil=True, cache=True)
def _light(
    light: LightTable, surface: NDArray[np.float32], dx: float, dy: float, dz: float, reach: float,
    colour: NDArray[np.float32],
) -> None:  # fmt: skip
    """Light that a surface sends back along a ray: sun, sky, the ground's reflection, highlight, and haze on the way."""
    nx, ny, nz = surface[NX], surface[NY], surface[NZ]
    facing = np.float32(nx * light.sun[0] + ny * light.sun[1] + nz * light.sun[2])
    sun, through = surface[SUN], surface[THROUGH]
    front = max(facing, np.float32(0.0)) * sun * np.float32(1.0 / np.pi)
    behind = max(-facing, np.float32(0.0)) * sun * through * np.float32(1.0 / np.pi)
    up = np.float32(0.5) + np.float32(0.5) * nz
    sky = surface[SKY] * up
    below = (np.float32(0.35) + np.float32(0.65) * surface[SKY]) * (np.float32(1.0) - up)
    shine = np.float32(0.0)
    if surface[GLOSS] > 0.0 and sun > 0.0 and facing > 0.0:
        hx, hy, hz = light.sun[0] - dx, light.sun[1] - dy, light.sun[2] - dz
        half = (nx * hx + ny * hy + nz * hz) / np.sqrt(hx * hx + hy * hy + hz * hz)
        shine = np.float32(0.25 * surface[GLOSS] * sun * max(half, 0.0) ** 40)
    haze = np.float32(1.0 - np.exp(-reach * HAZE_PER_METRE))
    mist_r, mist_g, mist_b = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    if haze > 0.02:
        mist_r, mist_g, mist_b = sky_radiance(light.dome, dx, dy, 0.04)
    for channel in range(3):
        albedo = surface[RED + channel]
        glow = (np.float32(1.35), np.float32(1.45), np.float32(0.55))[channel]  # transmitted light is yellower
        radiance = albedo * (
            light.sun_rgb[channel] * (front + behind * glow)
            + light.dome.mean[channel] * sky
            + light.bounce[channel] * below
        )
        radiance += shine * light.sun_rgb[channel]
        mist = (mist_r, mist_g, mist_b)[channel]
        colour[channel] = EXPOSURE * (radiance * (np.float32(1.0) - haze) + mist * haze)


@njit(nogil=True, cache=True, inline="always")
def _dither(u: int, v: int) -> float:
    """A fixed pattern in [0, 1) by pixel (interleaved gradient noise, Jimenez 2014)."""
    inner = 0.06711056 * u + 0.00583715 * v
    value = 52.9829189 * (inner - np.floor(inner))
    return value - np.floor(value)  # type: ignore[no-any-return]


@njit(nogil=True, cache=True)
def first_hits(
    studio: Studio, packet: Packet, shadow: Packet, pose: NDArray[np.float64], lens: Pinhole, far: float,
    label: NDArray[np.uint8], instance: NDArray[np.uint16], depth: NDArray[np.float32], linear: NDArray[np.float32],
) -> None:  # fmt: skip
    """Trace the ray through every pixel's centre; its one hit gives class, object, depth and colour."""
    height, width = label.shape
    surface, points = np.zeros((_LANES, FIELDS), np.float32), np.zeros((_LANES, 3))
    colour, dither, cosine = np.zeros((_LANES, 3), np.float32), np.zeros(_LANES, np.float32), np.zeros(_LANES)
    for upper in range(0, height, _HEIGHT):
        for left in range(0, width, _WIDTH):
            for lane in range(_LANES):
                u, v = left + lane % _WIDTH, upper + lane // _WIDTH
                cosine[lane] = set_pixel_ray(packet, lane, pose, lens, u, v, far)
                dither[lane] = _dither(u, v)
            _intersect(packet.valid.ctypes, studio.scene, packet.ray.ctypes, packet.arguments.ctypes)
            _shade(studio, packet, shadow, surface, points, 1.0 / lens.fx, dither, colour)
            for lane in range(_LANES):
                u, v = left + lane % _WIDTH, upper + lane // _WIDTH
                top = hit_top(packet.words, lane)
                kind, thing = classify(studio.hits, top, packet.words[_PRIM + lane], points[lane, 0], points[lane, 1])
                label[v, u], instance[v, u] = kind, thing
                depth[v, u] = packet.ray[_FAR + lane] * cosine[lane] if top >= 0 else 0.0
                linear[v, u, 0], linear[v, u, 1], linear[v, u, 2] = colour[lane, 0], colour[lane, 1], colour[lane, 2]


@njit(nogil=True, cache=True)
def find_edges(linear: NDArray[np.float32], instance: NDArray[np.uint16], edges: NDArray[np.int32]) -> int:
    """List pixels (row, column) whose colour or object differs from a neighbour's; returns how many."""
    height, width = instance.shape
    bright = np.empty((2, width), np.float32)
    marked = np.zeros((2, width), np.bool_)
    count = 0
    for v in range(height + 1):
        row, above = v & 1, (v + 1) & 1
        marked[row, :] = False
        if v < height:
            for u in range(width):
                r, g, b = linear[v, u, 0], linear[v, u, 1], linear[v, u, 2]
                bright[row, u] = np.sqrt(min(np.float32(0.2) * r + np.float32(0.7) * g + np.float32(0.1) * b, 1.0))
                if u > 0 and (
                    abs(bright[row, u] - bright[row, u - 1]) > EDGE_CONTRAST or instance[v, u] != instance[v, u - 1]
                ):
                    marked[row, u], marked[row, u - 1] = True, True
                if v > 0 and (
                    abs(bright[row, u] - bright[above, u]) > EDGE_CONTRAST or instance[v, u] != instance[v - 1, u]
                ):
                    marked[row, u], marked[above, u] = True, True
        if v > 0:
            for u in range(width):
                if marked[above, u]:
                    edges[count, 0], edges[count, 1] = v - 1, u
                    count += 1
    return count


@njit(nogil=True, cache=True)
def refine(
    studio: Studio, packet: Packet, shadow: Packet, pose: NDArray[np.float64], lens: Pinhole, far: float,
    edges: NDArray[np.int32], count: int, samples: int, linear: NDArray[np.float32],
) -> None:  # fmt: skip
    """Add ``samples`` rays in other places of each listed pixel to the one through its centre and average them.

    Bright samples are held at the film's white first, so that a glint does not eat its neighbours.
    """
    surface, points = np.zeros((_LANES, FIELDS), np.float32), np.zeros((_LANES, 3))
    colour, dither = np.zeros((_LANES, 3), np.float32), np.zeros(_LANES, np.float32)
    white = np.float32(2.0)
    total = count * samples
    for k in range(count):
        v, u = edges[k, 0], edges[k, 1]
        for channel in range(3):
            linear[v, u, channel] = min(linear[v, u, channel], white)
    for first in range(0, total, _LANES):
        for lane in range(_LANES):
            packet.valid[lane] = 0
            if first + lane >= total:
                continue
            k, s = (first + lane) // samples, (first + lane) % samples
            v, u = edges[k, 0], edges[k, 1]
            angle = 2.0 * np.pi * (s + 0.25 + _dither(u, v)) / samples
            set_pixel_ray(packet, lane, pose, lens, u + 0.38 * np.cos(angle), v + 0.38 * np.sin(angle), far)
            dither[lane] = _dither(u + 5 * s, v)
        _intersect(packet.valid.ctypes, studio.scene, packet.ray.ctypes, packet.arguments.ctypes)
        _shade(studio, packet, shadow, surface, points, 1.0 / lens.fx, dither, colour)
        for lane in range(min(_LANES, total - first)):
            k = (first + lane) // samples
            v, u = edges[k, 0], edges[k, 1]
            for channel in range(3):
                linear[v, u, channel] += min(colour[lane, channel], white)
    for k in range(count):
        v, u = edges[k, 0], edges[k, 1]
        for channel in range(3):
            linear[v, u, channel] /= np.float32(samples + 1)


@njit(nogil=True, cache=True)
def develop(curve: NDArray[np.uint8], linear: NDArray[np.float32], photo: NDArray[np.uint8]) -> None:
    """Spill a little light into neighbours, as a lens does, and apply the film's curve."""
    height, width, _ = linear.shape
    scale = np.float32((_STEPS - 1) / np.sqrt(CURVE_TOP))
    keep, spill, top = np.float32(1.0 - 4.0 * _LENS), np.float32(_LENS), np.float32(CURVE_TOP)
    for v in range(height):
        up, down = max(v - 1, 0), min(v + 1, height - 1)
        for u in range(width):
            left, right = max(u - 1, 0), min(u + 1, width - 1)
            for channel in range(3):
                near = (
                    linear[up, u, channel] + linear[down, u, channel]
                    + linear[v, left, channel] + linear[v, right, channel]
                )  # fmt: skip
                value = keep * linear[v, u, channel] + spill * near
                photo[v, u, channel] = curve[int(np.sqrt(min(value, top)) * scale + np.float32(0.5))]


__all__ = ["Studio", "develop", "film_curve", "find_edges", "first_hits", "refine"]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The photograph: light on what the rays hit, finer rays where neighbours differ, the lens, and the film's curve."""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.render.bake import CURVE_STEPS, CURVE_TOP, Shading
from fieldtruth.render.light import LightTable
from fieldtruth.render.shade import (
    BLUE,
    FIELDS,
    GLOSS,
    GREEN,
    NX,
    NY,
    NZ,
    RED,
    SKY,
    SUN,
    THROUGH,
    TRACE_SUN,
    paint_ground,
    paint_objects,
)  # fmt: skip
from fieldtruth.render.sky import sky_radiance
from fieldtruth.render.water import Second, follow, leave_water, mix_bottom, mix_mirrored, new_second
from fieldtruth.sense import embree
from fieldtruth.sense.hits import TERRAIN
from fieldtruth.sense.kernel import kernel
from fieldtruth.sense.packets import Packet, new_packet, set_light_ray
from fieldtruth.sense.pinhole import Pinhole
from fieldtruth.sense.strip import STRIP_ROWS, Strip, name_pixels, new_strip, pixel_row_points, trace

EXPOSURE: Final = 3.9
HAZE_PER_METRE: Final = 1.0 / 1800.0
EDGE_CONTRAST: Final = 0.27
"""Difference of the square roots of neighbours' luminance above which a pixel at an edge is refined."""
EDGE_STEP: Final = 0.01
"""Step in depth, relative, that makes an edge."""
_LENS: Final = 0.07
"""Share of a pixel's light that a good lens spills into each of its four neighbours."""

_EXPOSURE, _PER_PI, _HAZE = np.float32(EXPOSURE), np.float32(1.0 / np.pi), np.float32(HAZE_PER_METRE)
_GLOW_R, _GLOW_G, _GLOW_B = np.float32(2.6), np.float32(2.8), np.float32(1.0)  # light through a leaf is yellower
_EDGE, _STEP = np.float32(EDGE_CONTRAST), np.float32(EDGE_STEP)
_TURNS, _TILE = 12, 4
_ANGLES = 2.0 * np.pi * np.arange(_TURNS) / _TURNS + 0.3
_OFFSETS = (0.38 * np.stack((np.cos(_ANGLES), np.sin(_ANGLES)), axis=-1)).astype(np.float32)  # [pixel]
_LIFT, _REACH = 0.002, 80.0  # [m] between a surface and its shadow ray, and how far that looks

_LANES, _FAR = embree.LANES, embree.TFAR
_occluded: Any = embree.occluded


class Darkroom(NamedTuple):
    """A thread's own memory for taking photographs."""

    packet: Packet
    shadow: Packet
    shadow_rows: NDArray[np.int32]  # (LANES,) point that each shadow ray starts from
    strip: Strip
    surface: NDArray[np.float32]  # (n, FIELDS)
    colour: NDArray[np.float32]  # (n, 3) linear and exposed
    second: Second  # for rays that go on from water
    linear: NDArray[np.float32]  # (h, w, 3) the same for the whole image
    marked: NDArray[np.bool_]  # (h, w) edges
    edges: NDArray[np.int32]  # (h * w, 2) row and column


def new_darkroom(height: int, width: int) -> Darkroom:
    """Memory for images of a size [pixel]."""
    count = STRIP_ROWS * width
    return Darkroom(
        packet=new_packet(coherent=True),
        shadow=new_packet(coherent=True),
        shadow_rows=np.zeros(_LANES, np.int32),
        strip=new_strip(count),
        surface=np.zeros((count, FIELDS), np.float32),
        colour=np.zeros((count, 3), np.float32),
        second=new_second(count),
        linear=np.zeros((height, width, 3), np.float32),
        marked=np.zeros((height, width), np.bool_),
        edges=np.zeros((height * width, 2), np.int32),
    )


@kernel
def take(
    shading: Shading, room: Darkroom, pose: NDArray[np.float64], lens: Pinhole, far: float, samples: int,
    label: NDArray[np.uint8], instance: NDArray[np.uint16], depth: NDArray[np.float32], photo: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Take a photograph: the ray through each pixel's centre gives its class, object, depth and colour; then edges
    get ``samples`` more rays for their colour alone, and the film is developed.
    """
    height, width = label.shape
    count = STRIP_ROWS * width
    for row in range(0, height, STRIP_ROWS):
        pixel_row_points(row, width, room.strip.image)
        trace(shading.scene, room.packet, pose, lens, far, room.strip, count)
        name_pixels(shading.hits, room.strip, count, label, instance, depth)
        _colour(shading, room, count, 1.0 / lens.fx)
        _keep(room.strip.image, room.colour, count, room.linear)
    edges = find_edges(room.linear, instance, depth, room.marked, room.edges)
    _refine(shading, room, pose, lens, far, edges, samples)
    _develop(shading.curve, room.linear, photo)


@kernel
def _keep(image: NDArray[np.float32], colour: NDArray[np.float32], count: int, linear: NDArray[np.float32]) -> None:
    for k in range(count):
        u, v = int(image[0, k]), int(image[1, k])
        linear[v, u, 0], linear[v, u, 1], linear[v, u, 2] = colour[k, 0], colour[k, 1], colour[k, 2]


@kernel
def _colour(shading: Shading, room: Darkroom, count: int, pixel: float) -> None:
    """Colour the traced points of the strip; ``pixel`` is the angle [rad] that one pixel spans."""
    _light(shading, room, room.strip, count, pixel, room.surface, room.colour)
    if not shading.has_water:
        return
    second = room.second
    found = leave_water(room.strip, room.surface, count, pixel, False, second)
    follow(shading.scene, room.packet, second, found)
    _light(shading, room, second.strip, found, pixel, second.surface, second.colour)
    mix_bottom(second, found, room.colour)
    found = leave_water(room.strip, room.surface, count, pixel, True, second)
    follow(shading.scene, room.packet, second, found)
    _light(shading, room, second.strip, found, pixel, second.surface, second.colour)
    mix_mirrored(second, found, room.colour)


@kernel
def _light(
    shading: Shading, room: Darkroom, strip: Strip, count: int, pixel: float, surface: NDArray[np.float32],
    colour: NDArray[np.float32],
) -> None:  # fmt: skip
    """Paint the points of a strip and let light fall on them."""
    paint_ground(strip, count, pixel, shading.hits, shading.paint, shading.light, surface)
    paint_objects(strip, count, pixel, shading.hits, shading.surfaces, shading.paint, shading.light, surface)
    _trace_sun(shading.scene, room.shadow, room.shadow_rows, shading.light.sun, strip, count, surface)
    _shine(strip, count, surface, shading.light, shading.gain, colour)


@kernel
def _trace_sun(
    scene: np.uint64, shadow: Packet, rows: NDArray[np.int32], sun: NDArray[np.float64], strip: Strip, count: int,
    surface: NDArray[np.float32],
) -> None:  # fmt: skip
    """Find out which points that ask for it see the sun."""
    sx, sy, sz, filled = sun[0], sun[1], sun[2], 0
    top, point, far = strip.top, strip.point, shadow.ray
    for k in range(count):
        if top[k] > TERRAIN and surface[k, SUN] == TRACE_SUN:
            facing = surface[k, NX] * sx + surface[k, NY] * sy + surface[k, NZ] * sz
            surface[k, SUN] = 0.0
            if facing > 0.0:
                x, y, z = (
                    point[0, k] + _LIFT * surface[k, NX],
                    point[1, k] + _LIFT * surface[k, NY],
                    point[2, k] + _LIFT * surface[k, NZ],
                )
                set_light_ray(shadow, filled, x, y, z, sx, sy, sz, _LIFT, _REACH)
                rows[filled] = k
                filled += 1
        if filled == _LANES or (k == count - 1 and filled > 0):
            for lane in range(filled, _LANES):
                shadow.valid[lane] = 0
            _occluded(shadow.valid.ctypes, scene, shadow.ray.ctypes, shadow.arguments.ctypes)
            for lane in range(filled):
                if far[_FAR + lane] >= 0.0:
                    surface[rows[lane], SUN] = 1.0
            filled = 0


@kernel
def _shine(
    strip: Strip, count: int, surface: NDArray[np.float32], light: LightTable, gain: np.float32,
    colour: NDArray[np.float32],
) -> None:  # fmt: skip
    """Light that comes back along each ray: sun, sky, the ground's reflection, highlight, and haze on the way."""
    top, direction, reach = strip.top, strip.direction, strip.reach
    dome, sun_rgb, bounce, mean = light.dome.rgb, light.sun_rgb, light.bounce, light.dome.mean
    mist = light.dome.mist / np.sqrt(gain)  # where little light falls, little is scattered
    sx, sy, sz = np.float32(light.sun[0]), np.float32(light.sun[1]), np.float32(light.sun[2])
    zero, one, half, exposure = np.float32(0.0), np.float32(1.0), np.float32(0.5), _EXPOSURE * gain
    for k in range(count):
        dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
        if top[k] < 0:
            r, g, b = sky_radiance(dome, dx, dy, dz)
            colour[k, 0], colour[k, 1], colour[k, 2] = exposure * r, exposure * g, exposure * b
            continue
        nx, ny, nz, sun = surface[k, NX], surface[k, NY], surface[k, NZ], surface[k, SUN]
        facing = nx * sx + ny * sy + nz * sz
        front = max(facing, zero) * sun * _PER_PI
        behind = max(-facing, zero) * sun * surface[k, THROUGH] * _PER_PI
        up = half + half * nz
        sky = surface[k, SKY] * up
        below = (np.float32(0.35) + np.float32(0.65) * surface[k, SKY]) * (one - up)
        shine = zero
        if surface[k, GLOSS] > zero and sun > zero and facing > zero:
            hx, hy, hz = sx - dx, sy - dy, sz - dz
            cosine = max((nx * hx + ny * hy + nz * hz) / np.sqrt(hx * hx + hy * hy + hz * hz), zero)
            power = cosine * cosine
            power *= power
            power *= power
            power *= power
            shine = np.float32(0.25) * surface[k, GLOSS] * sun * power * power  # cosine to the 32nd
        red = (
            surface[k, RED] * (sun_rgb[0] * (front + behind * _GLOW_R) + mean[0] * sky + bounce[0] * below)
            + shine * sun_rgb[0]
        )
        green = (
            surface[k, GREEN] * (sun_rgb[1] * (front + behind * _GLOW_G) + mean[1] * sky + bounce[1] * below)
            + shine * sun_rgb[1]
        )
        blue = (
            surface[k, BLUE] * (sun_rgb[2] * (front + behind * _GLOW_B) + mean[2] * sky + bounce[2] * below)
            + shine * sun_rgb[2]
        )
        haze = min(reach[k] * _HAZE, half)  # the first terms of 1 - exp(-x)
        haze -= half * haze * haze
        if haze > np.float32(0.01):
            red, green, blue = (
                red + (mist[0] - red) * haze, green + (mist[1] - green) * haze, blue + (mist[2] - blue) * haze,
            )  # fmt: skip
        colour[k, 0], colour[k, 1], colour[k, 2] = exposure * red, exposure * green, exposure * blue


@kernel
def find_edges(
    linear: NDArray[np.float32], instance: NDArray[np.uint16], depth: NDArray[np.float32],
    marked: NDArray[np.bool_], edges: NDArray[np.int32],
) -> int:  # fmt: skip
    """List pixels (row, column) that differ in brightness from a neighbour which lies elsewhere; returns how many.

    Elsewhere is another object, or a step in depth of more than EDGE_STEP: a texture's own contrast is no edge. The
    list goes tile by tile, so that rays that are traced together stay neighbours.
    """
    height, width = instance.shape
    bright = np.empty((2, width), np.float32)
    marked[:] = False
    for v in range(height):
        row, above = v & 1, (v + 1) & 1
        for u in range(width):
            r, g, b = linear[v, u, 0], linear[v, u, 1], linear[v, u, 2]
            value = np.sqrt(min(np.float32(0.2) * r + np.float32(0.7) * g + np.float32(0.1) * b, np.float32(1.0)))
            bright[row, u] = value
            here, thing = depth[v, u], instance[v, u]
            apart = u > 0 and (thing != instance[v, u - 1] or abs(here - depth[v, u - 1]) > _STEP * here)
            if apart and abs(value - bright[row, u - 1]) > _EDGE:
                marked[v, u], marked[v, u - 1] = True, True
            apart = v > 0 and (thing != instance[v - 1, u] or abs(here - depth[v - 1, u]) > _STEP * here)
            if apart and abs(value - bright[above, u]) > _EDGE:
                marked[v, u], marked[v - 1, u] = True, True
    count = 0
    for upper in range(0, height, _TILE):
        for left in range(0, width, _TILE):
            for v in range(upper, min(upper + _TILE, height)):
                for u in range(left, min(left + _TILE, width)):
                    if marked[v, u]:
                        edges[count, 0], edges[count, 1] = v, u
                        count += 1
    return count


@kernel
def _refine(
    shading: Shading, room: Darkroom, pose: NDArray[np.float64], lens: Pinhole, far: float, count: int, samples: int
) -> None:
    """Add ``samples`` rays in other places of each listed pixel to the one through its centre and average them.

    Bright samples are held at the film's white first, so that a glint does not eat its neighbours.
    """
    image, colour, linear, edges = room.strip.image, room.colour, room.linear, room.edges
    white, share = np.float32(2.0), np.float32(1.0 / (samples + 1))
    batch = image.shape[1] // samples
    for first in range(0, count, batch):
        pixels = min(batch, count - first)
        for k in range(pixels):
            v, u = edges[first + k, 0], edges[first + k, 1]
            turn = (3 * u + 5 * v) % _TURNS
            for s in range(samples):
                row = (turn + s * _TURNS // samples) % _TURNS
                image[0, k * samples + s] = u + _OFFSETS[row, 0]
                image[1, k * samples + s] = v + _OFFSETS[row, 1]
        trace(shading.scene, room.packet, pose, lens, far, room.strip, pixels * samples)
        _colour(shading, room, pixels * samples, 1.0 / lens.fx)
        for k in range(pixels):
            v, u = edges[first + k, 0], edges[first + k, 1]
            for channel in range(3):
                total = min(linear[v, u, channel], white)
                for s in range(samples):
                    total += min(colour[k * samples + s, channel], white)
                linear[v, u, channel] = total * share


@kernel
def _develop(curve: NDArray[np.uint8], linear: NDArray[np.float32], photo: NDArray[np.uint8]) -> None:
    """Spill a little light into neighbours, as a lens does, and apply the film's curve."""
    height, width, _ = linear.shape
    scale = np.float32((CURVE_STEPS - 1) / np.sqrt(CURVE_TOP))
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

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light on its path through a camera: lens and drops on it, sensor, processor; and optical flow of its images."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.kernels import packets
from fieldtruth.kernels.camera_rays import Intrinsics
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.packets import Packet, SceneRays, block_packet, set_ray
from fieldtruth.kernels.tone_curve import SPILL


@kernel
def spill(light: Float32Array, share: Float32Array, factor: float, out: Float32Array) -> None:
    """Fill ``out`` (h, w, 3) with light that spills into neighbours as an ideal camera's does.

    It is multiplied with ``factor`` and with the ``share`` (h, w) that vignetting leaves, which is empty for none.
    """
    height, width, _ = light.shape
    keep, part, exposed = np.float32(1.0 - 4.0 * SPILL), np.float32(SPILL), np.float32(factor)
    for v in range(height):
        up, down = max(v - 1, 0), min(v + 1, height - 1)
        for u in range(width):
            left, right = max(u - 1, 0), min(u + 1, width - 1)
            scale = exposed * share[v, u] if share.size else exposed
            for channel in range(3):
                near = (
                    light[up, u, channel] + light[down, u, channel]
                    + light[v, left, channel] + light[v, right, channel]
                )  # fmt: skip
                out[v, u, channel] = (keep * light[v, u, channel] + part * near) * scale


@kernel
def blur(light: Float32Array, spread: Float32Array, scratch: Float32Array) -> None:
    """Convolve light (h, w, n) with a point spread; beyond the border is the border's light."""
    height, width, channels = light.shape
    for v in range(height):
        for u in range(width):
            for channel in range(channels):
                total = spread[0] * light[v, u, channel]
                for k in range(1, len(spread)):
                    total += spread[k] * (light[v, max(u - k, 0), channel] + light[v, min(u + k, width - 1), channel])
                scratch[v, u, channel] = total
    for v in range(height):
        for u in range(width):
            for channel in range(channels):
                light[v, u, channel] = spread[0] * scratch[v, u, channel]
        for k in range(1, len(spread)):
            up, down = max(v - k, 0), min(v + k, height - 1)
            for u in range(width):
                for channel in range(channels):
                    light[v, u, channel] += spread[k] * (scratch[up, u, channel] + scratch[down, u, channel])


CELL: Final = 8
"""Side [pixel] of the cells in which light is scattered: bloom is smooth over more pixels."""


@kernel
def fill_means(light: Float32Array, cells: Float32Array) -> None:
    """Set the mean light of each cell of CELL x CELL pixels."""
    rows, columns, _ = cells.shape
    for i in range(rows):
        for j in range(columns):
            upper, left = i * CELL, j * CELL
            lower, right = min(upper + CELL, light.shape[0]), min(left + CELL, light.shape[1])
            per = np.float32(1.0 / ((lower - upper) * (right - left)))
            for v in range(upper, lower):
                for u in range(left, right):
                    for channel in range(3):
                        cells[i, j, channel] += light[v, u, channel] * per


@kernel
def blend_cells(light: Float32Array, cells: Float32Array, share: np.float32) -> None:
    """Blend the light of cells, interpolated between their centres, into an image by a share."""
    height, width, _ = light.shape
    rows, columns, _ = cells.shape
    half, zero, one = np.float32(0.5), np.float32(0.0), np.float32(1.0)
    for v in range(height):
        y = min(max((np.float32(v) + half) / np.float32(CELL) - half, zero), np.float32(rows - 1))
        i = min(int(y), max(rows - 2, 0))
        below, fy = min(i + 1, rows - 1), y - np.float32(i)
        for u in range(width):
            x = min(max((np.float32(u) + half) / np.float32(CELL) - half, zero), np.float32(columns - 1))
            j = min(int(x), max(columns - 2, 0))
            beside, fx = min(j + 1, columns - 1), x - np.float32(j)
            for channel in range(3):
                upper = cells[i, j, channel] + fx * (cells[i, beside, channel] - cells[i, j, channel])
                lower = cells[below, j, channel] + fx * (cells[below, beside, channel] - cells[below, j, channel])
                scattered = upper + fy * (lower - upper)
                light[v, u, channel] = (one - share) * light[v, u, channel] + share * scattered


@kernel
def spread_colours(light: Float32Array, cx: float, cy: float, red: float, blue: float, out: Float32Array) -> None:
    """Fill ``out`` (h, w, 3) with light whose red and blue are farther from (cx, cy) [pixel] than green.

    They are magnified by 1 + ``red`` and 1 + ``blue``, and interpolated linearly.
    """
    height, width, _ = light.shape
    zero, one = np.float32(0.0), np.float32(1.0)
    x0, y0 = np.float32(cx), np.float32(cy)
    right, lower = np.float32(width - 1), np.float32(height - 1)
    for v in range(height):
        for u in range(width):
            out[v, u, 1] = light[v, u, 1]
    for channel in (0, 2):
        scale = np.float32(1.0 / (1.0 + (red if channel == 0 else blue)))
        for v in range(height):
            y = min(max(y0 + (np.float32(v) - y0) * scale, zero), lower)
            i = min(int(y), height - 2)
            fy = y - np.float32(i)
            for u in range(width):
                x = min(max(x0 + (np.float32(u) - x0) * scale, zero), right)
                j = min(int(x), width - 2)
                fx = x - np.float32(j)
                out[v, u, channel] = (one - fy) * (
                    (one - fx) * light[i, j, channel] + fx * light[i, j + 1, channel]
                ) + fy * ((one - fx) * light[i + 1, j, channel] + fx * light[i + 1, j + 1, channel])


@kernel
def draw_drops(light: Float32Array, soft: Float32Array, drops: Array) -> None:
    """Draw drops, rows of ``drops``, that show the light ``soft`` of cells."""
    height, width, _ = light.shape
    rows, columns, _ = soft.shape
    for n in range(len(drops)):
        x, y, radius = drops[n]
        shrinks = 0.35 * height / radius  # the drop shows 0.7 of the image's height
        for v in range(max(int(y - radius), 0), min(int(y + radius) + 2, height)):
            for u in range(max(int(x - radius), 0), min(int(x + radius) + 2, width)):
                dx, dy = u - x, v - y
                part = np.sqrt(dx * dx + dy * dy) / radius
                if part >= 1.0:
                    continue
                edge = min((1.0 - part) / 0.45, 1.0)
                cover = np.float32(0.92 * edge * edge * (3.0 - 2.0 * edge))
                i = min(max(int((y - dy * shrinks) / CELL), 0), rows - 1)
                j = min(max(int((x - dx * shrinks) / CELL), 0), columns - 1)
                rim = np.float32(1.0 - 0.4 * part**4)
                for channel in range(3):
                    light[v, u, channel] += cover * (rim * soft[i, j, channel] - light[v, u, channel])


@kernel
def add_dust(light: Float32Array, dust: Array) -> None:
    """Dim light (h, w, 3) behind specks (n, 4), see ``dust_of``: normal profiles, as they are far out of focus."""
    height, width, _ = light.shape
    for n in range(len(dust)):
        x, y, radius, opacity = dust[n]
        reach = 2.0 * radius
        for v in range(max(int(y - reach), 0), min(int(y + reach) + 2, height)):
            for u in range(max(int(x - reach), 0), min(int(x + reach) + 2, width)):
                part = ((u - x) ** 2 + (v - y) ** 2) / (radius * radius)
                left = np.float32(1.0 - opacity * np.exp(-2.0 * part))
                for channel in range(3):
                    light[v, u, channel] *= left


@kernel
def draw_streaks(
    ends: Float32Array, widths: Float32Array, opacity: Float32Array, light: Float32Array, linear: Float32Array
) -> None:
    """Draw lines over light, each with its width, opacity and colour."""
    height, width, _ = linear.shape
    one, half, zero = np.float32(1.0), np.float32(0.5), np.float32(0.0)
    for n in range(len(widths)):
        ax, ay, bx, by = ends[n, 0, 0], ends[n, 0, 1], ends[n, 1, 0], ends[n, 1, 1]
        reach = half * max(widths[n], one) + half
        soft = one / max(half * widths[n], one)  # out of focus
        left, right = max(int(min(ax, bx) - reach), 0), min(int(max(ax, bx) + reach) + 1, width - 1)
        upper, lower = max(int(min(ay, by) - reach), 0), min(int(max(ay, by) + reach) + 1, height - 1)
        dx, dy = bx - ax, by - ay
        per = one / max(dx * dx + dy * dy, np.float32(1e-6))
        for v in range(upper, lower + 1):
            for u in range(left, right + 1):
                px, py = np.float32(u) - ax, np.float32(v) - ay
                along = min(max((px * dx + py * dy) * per, zero), one)
                away = np.sqrt((px - along * dx) ** 2 + (py - along * dy) ** 2)
                share = min(max((reach - away) * soft, zero), one) * opacity[n]
                for channel in range(3):
                    linear[v, u, channel] += share * (light[channel] - linear[v, u, channel])


class Sensor(NamedTuple):
    """An image sensor at one gain, as kernels take it."""

    channels: Array  # (values per pixel, 3) share of each channel of light in each value
    filters: tuple[int, int, int, int]
    """Row of ``channels`` of the first value in the upper left 2 x 2 pixels."""
    electrons: float  # per unit of light
    photons: float  # 1 with photon noise, else 0
    read_noise_e: float
    gain: float  # K, raw values per electron
    black: float
    top: float  # greatest raw value
    step: float  # of raw values; 0: not quantised


@kernel
def expose(
    light: Float32Array, sensor: Sensor, normal: Float32Array, prnu: Float32Array, dsnu: Float32Array, raw: Float32Array
) -> None:
    """Fill ``raw`` (h, w, n) from light (h, w, 3).

    ``normal`` (h, w, n) has standard normal noise; ``prnu`` and ``dsnu`` [electrons] have the deviations of each pixel
    in sensitivity and dark signal. Each of them may be empty, for none.
    """
    height, width, values = raw.shape
    channels, filters, black, top = sensor.channels, sensor.filters, np.float32(sensor.black), np.float32(sensor.top)
    per_light, photons = np.float32(sensor.electrons), np.float32(sensor.photons)
    dark, gain, whole = np.float32(sensor.read_noise_e**2), np.float32(sensor.gain), sensor.step > 0.0
    zero, half, saturated = np.float32(0.0), np.float32(0.5), np.float32((sensor.top - sensor.black) / sensor.gain)
    for v in range(height):
        for u in range(width):
            first = filters[2 * (v & 1) + (u & 1)]
            for value in range(values):
                row = first + value
                mean = np.float32(0.0)
                for channel in range(3):
                    mean += np.float32(channels[row, channel]) * light[v, u, channel]
                mean *= per_light
                if prnu.size:
                    mean *= np.float32(1.0) + prnu[v, u, value]
                electrons = mean
                if normal.size:
                    # Far above the full scale the noise does not matter, and its root would only be slow.
                    electrons += np.sqrt(photons * max(mean, zero) + dark) * normal[v, u, value]
                if dsnu.size:
                    electrons += dsnu[v, u, value]
                y = black + gain * min(electrons, saturated)
                if whole:
                    y = np.floor(y + half)
                raw[v, u, value] = min(max(y, zero), top)


@kernel
def interpolate(raw: Float32Array, sensor: Sensor, full_scale: float, light: Float32Array) -> None:
    """Fill light (h, w, 3) from raw values (h, w, n), with bilinear interpolation between pixels of a colour."""
    height, width, values = raw.shape
    black, scale = np.float32(sensor.black), np.float32(full_scale / (sensor.top - sensor.black))
    mono = values == 1 and len(sensor.channels) == 1
    if values == 3 or mono:
        for v in range(height):
            for u in range(width):
                for channel in range(3):
                    light[v, u, channel] = (raw[v, u, 0 if mono else channel] - black) * scale
        return
    filters = sensor.filters
    for v in range(height):
        up, down = v - 1 if v > 0 else 1, v + 1 if v < height - 1 else height - 2
        for u in range(width):
            left, right = u - 1 if u > 0 else 1, u + 1 if u < width - 1 else width - 2
            centre = raw[v, u, 0]
            own = filters[2 * (v & 1) + (u & 1)]
            across, along = raw[v, left, 0] + raw[v, right, 0], raw[up, u, 0] + raw[down, u, 0]
            if own == 1:
                beside = filters[2 * (v & 1) + (1 - (u & 1))]
                _set(light, v, u, beside, (np.float32(0.5) * across - black) * scale)
                _set(light, v, u, 1, (centre - black) * scale)
                _set(light, v, u, 2 - beside, (np.float32(0.5) * along - black) * scale)
            else:
                corners = raw[up, left, 0] + raw[up, right, 0] + raw[down, left, 0] + raw[down, right, 0]
                _set(light, v, u, own, (centre - black) * scale)
                _set(light, v, u, 1, (np.float32(0.25) * (across + along) - black) * scale)
                _set(light, v, u, 2 - own, (np.float32(0.25) * corners - black) * scale)


@inlined
def _set(light: Float32Array, v: int, u: int, channel: int, value: np.float32) -> None:
    light[v, u, channel] = value


@kernel
def mix_colours(light: Float32Array, gains: Float32Array, matrix: Float32Array, white: float) -> None:
    """Apply white balance (3,) and a colour matrix (3, 3) to light (h, w, 3).

    Light is clipped at white between them, so that what saturates the sensor is white and no other colour.
    """
    height, width, _ = light.shape
    top, zero = np.float32(white), np.float32(0.0)
    for v in range(height):
        for u in range(width):
            r = min(light[v, u, 0] * gains[0], top)
            g = min(light[v, u, 1] * gains[1], top)
            b = min(light[v, u, 2] * gains[2], top)
            for channel in range(3):
                value = matrix[channel, 0] * r + matrix[channel, 1] * g + matrix[channel, 2] * b
                light[v, u, channel] = max(value, zero)


@kernel
def sharpen(photo: NDArray[np.uint8], amount: float, spread: Float32Array, buffers: Float32Array) -> None:
    """Add to each channel of a photograph (h, w, 3) what its luminance differs from that blurred with ``spread``.

    This is an unsharp mask; edges get halos as wide as the blur. ``spread`` is half of a point spread, see
    ``sensors.camera.photo.point_spread``; ``buffers`` (2, h, w) is overwritten.
    """
    height, width, _ = photo.shape
    luminance, blurred = buffers[0], buffers[1]
    strength, half, zero, top = np.float32(amount), np.float32(0.5), np.float32(0.0), np.float32(255.0)
    for v in range(height):
        for u in range(width):
            r, g, b = np.float32(photo[v, u, 0]), np.float32(photo[v, u, 1]), np.float32(photo[v, u, 2])
            luminance[v, u] = np.float32(0.299) * r + np.float32(0.587) * g + np.float32(0.114) * b  # ITU-R BT.601
    for v in range(height):
        for u in range(width):
            total = spread[0] * luminance[v, u]
            for k in range(1, len(spread)):
                total += spread[k] * (luminance[v, max(u - k, 0)] + luminance[v, min(u + k, width - 1)])
            blurred[v, u] = total
    for v in range(height):
        for u in range(width):
            total = spread[0] * blurred[v, u]
            for k in range(1, len(spread)):
                total += spread[k] * (blurred[max(v - k, 0), u] + blurred[min(v + k, height - 1), u])
            more = strength * (luminance[v, u] - total) + half
            for channel in range(3):
                photo[v, u, channel] = np.uint8(min(max(np.float32(photo[v, u, channel]) + more, zero), top))


NEAR_M: Final = 1e-3
NEAR_SHARE: Final = 1e-4
"""A surface that is in front of a point by less than ``NEAR_M`` and this share of the distance does not hide it: rays
have single precision."""
_LANES, _WIDTH, _HEIGHT = packets.LANES, packets.TILE_WIDTH, packets.TILE_HEIGHT
_FAR = packets.TFAR


class FlowPoints(NamedTuple):
    """Points of a band of pixels in the next optical frame. Arrays are overwritten by the next band."""

    ray: Array  # (rows, w, 3) [m], of the sky of unit length; NaN where the lens has no ray
    distance: Array  # (rows, w) [m], infinite for the sky
    image: Array  # (rows, w, 2) [pixel], NaN where it is not in the image


@kernel
def move_points(
    lens: Intrinsics, table: Float32Array, moved: Array, depth: Float32Array, own: Mask, top: int, out: FlowPoints
) -> None:
    """Take the points of a band from the depth image to the next optical frame, and into a pinhole's image."""
    rows, width = out.distance.shape
    moves = own.shape[0] > 1
    for row in range(rows):
        v = top + row
        for u in range(width):
            if len(table) > 0:
                x, y, z = float(table[v, u, 0]), float(table[v, u, 1]), float(table[v, u, 2])
                scale, share = 1.0, float(table[v, u, 3])
            else:
                x, y, z = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0
                scale, share = 1.0 / np.sqrt(x * x + y * y + 1.0), 1.0
            far_away = depth[v, u] == 0.0
            scale = scale if far_away else depth[v, u] / share
            x, y, z = x * scale, y * scale, z * scale
            if not (moves and own[v, u]):
                a = moved[0, 0] * x + moved[0, 1] * y + moved[0, 2] * z
                b = moved[1, 0] * x + moved[1, 1] * y + moved[1, 2] * z
                c = moved[2, 0] * x + moved[2, 1] * y + moved[2, 2] * z
                if not far_away:
                    a, b, c = a + moved[0, 3], b + moved[1, 3], c + moved[2, 3]
                x, y, z = a, b, c
            if share == 0.0:
                x, y, z = np.nan, np.nan, np.nan
            out.ray[row, u, 0], out.ray[row, u, 1], out.ray[row, u, 2] = x, y, z
            out.distance[row, u] = np.inf if far_away else np.sqrt(x * x + y * y + z * z)
            out.image[row, u, 0] = lens.fx * x / z + lens.cx if z > 0.0 else np.nan
            out.image[row, u, 1] = lens.fy * y / z + lens.cy if z > 0.0 else np.nan


@kernel
def hide_points(scene: SceneRays, packet: Packet, pose: Array, far: float, points: FlowPoints) -> None:
    """Remove points that are outside the image, beyond ``far`` or behind the world, seen from the next pose (4, 4)."""
    rows, width = points.distance.shape
    x0, y0, z0 = np.float32(pose[0, 3]), np.float32(pose[1, 3]), np.float32(pose[2, 3])
    for upper in range(0, rows, _HEIGHT):
        for left in range(0, width, _WIDTH):
            for lane in range(_LANES):
                row, u = upper + lane // _WIDTH, left + lane % _WIDTH
                packet.valid[lane] = 0
                if row >= rows or u >= width or np.isnan(points.image[row, u, 0]):
                    continue
                x, y, z = points.ray[row, u, 0], points.ray[row, u, 1], points.ray[row, u, 2]
                d = points.distance[row, u]
                is_sky = d == np.inf
                a = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z
                b = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z
                c = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z
                if not is_sky:  # towards the point from the origin in single precision
                    a, b, c = a + pose[0, 3] - x0, b + pose[1, 3] - y0, c + pose[2, 3] - z0
                scale = 1.0 / np.sqrt(a * a + b * b + c * c)
                reach = far if is_sky else min(d * (1.0 - NEAR_SHARE) - NEAR_M, far)
                set_ray(packet, lane, (x0, y0, z0), (a * scale, b * scale, c * scale), 0.0, max(reach, 0.0))
            block_packet(scene, packet)
            for lane in range(_LANES):
                if packet.valid[lane] != 0 and packet.ray[_FAR + lane] < 0.0:
                    row, u = upper + lane // _WIDTH, left + lane % _WIDTH
                    points.image[row, u, 0], points.image[row, u, 1] = np.nan, np.nan

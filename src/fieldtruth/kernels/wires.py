# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wires that are narrower than a few pixels, by the share of each pixel that they cover."""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.camera_rays import RayBatch, View, gradients, seen_over_map
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.light import EXPOSURE, READ, Shading, WireTable, air_along, falling_on, read_probes
from fieldtruth.kernels.packets import IntArray, hit_mover, hit_top, set_ray, trace_packet
from fieldtruth.kernels.shading import ShadingBuffers

WIDEST: Final = 3.0
"""Width [pixel] from which a wire is drawn as the mesh that it is."""
_LANES, _FAR, _MASK = packets.LANES, packets.TFAR, packets.MASK
_PRIM, _U, _V = packets.PRIM_ID, packets.HIT_U, packets.HIT_V
_BEHIND = np.uint32(packets.SOLID | packets.CLEAR)
_Vector = tuple[float, float, float]
NORMAL, MIDDLE, REACH = 0, 3, 6
"""Columns of planes: normal of the plane through camera and segment, direction of its middle, chord to its ends."""


class _Chord(NamedTuple):
    """A segment of a wire as a camera meets it."""

    wire: int
    top: int
    start: _Vector  # [m] from the camera, in the world frame
    along: _Vector  # [m] from start to end
    first: _Vector  # rays have a positive component along it beyond the segment's start
    last: _Vector  # and a negative one before its end
    normal: _Vector  # unit, of the plane through the camera and the segment
    radius: float  # [m]


class _Read(NamedTuple):
    """Memory for the light at a point: a probe, and `air_along`."""

    probe: Float32Array  # (READ,)
    left: Float32Array  # (3,)
    glow: Float32Array  # (3,)


@kernel(inner=True)
def look_behind(shading: Shading, buffers: ShadingBuffers, view: View, count: int) -> None:
    """Trace rays that met a narrow wire again, without wires."""
    packet, batch, radius = buffers.packet, buffers.batch, shading.wires.radius
    ray, words, valid = packet.ray, packet.words, packet.valid
    tops, geometry_top, rows = batch.top, shading.hits.geometry_top, buffers.shadow_rows
    narrow = np.float32(0.5 * WIDEST / view.intrinsics.fx)
    origin, filled = (view.pose[0, 3], view.pose[1, 3], view.pose[2, 3]), 0
    for k in range(count):
        if tops[k] > 0 and np.float32(0.0) < radius[tops[k]] < narrow * batch.distance[k]:
            towards = batch.direction[0, k], batch.direction[1, k], batch.direction[2, k]
            set_ray(packet, filled, origin, towards, 0.0, view.far)
            words[_MASK + filled], rows[filled] = _BEHIND, k
            filled += 1
        if filled == _LANES or (k == count - 1 and filled > 0):
            for lane in range(filled, _LANES):
                valid[lane] = 0
            trace_packet(shading.scene, packet)
            for lane in range(filled):
                row, t = rows[lane], ray[_FAR + lane]
                batch.distance[row], batch.foreshortening[row] = t, seen_over_map(ray, lane)
                for axis in range(3):
                    batch.point[axis, row] = np.float32(origin[axis]) + t * batch.direction[axis, row]
                batch.barycentric[0, row], batch.barycentric[1, row] = ray[_U + lane], ray[_V + lane]
                batch.primitive[row] = np.int32(words[_PRIM + lane])
                tops[row], batch.mover[row] = hit_top(geometry_top, words, lane), hit_mover(shading.scene, words, lane)
            filled = 0


@inlined
def _cross(a: _Vector, b: _Vector) -> _Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def _dot(a: _Vector, b: _Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def _plane(a: _Vector, b: _Vector, out: Array) -> None:
    """Fill a row of planes for a segment between a and b [m] from the camera."""
    normal = _cross(a, b)
    middle = a[0] + b[0], a[1] + b[1], a[2] + b[2]
    per_normal = 1.0 / max(np.sqrt(_dot(normal, normal)), 1e-12)
    per_middle = 1.0 / max(np.sqrt(_dot(middle, middle)), 1e-12)
    per_a, per_b = 1.0 / np.sqrt(_dot(a, a)), 1.0 / np.sqrt(_dot(b, b))
    reach_a, reach_b = 0.0, 0.0
    for axis in range(3):
        out[NORMAL + axis], out[MIDDLE + axis] = normal[axis] * per_normal, middle[axis] * per_middle
        reach_a += (a[axis] * per_a - out[MIDDLE + axis]) ** 2
        reach_b += (b[axis] * per_b - out[MIDDLE + axis]) ** 2
    out[REACH] = np.sqrt(max(reach_a, reach_b))


@kernel
def _planes(wires: WireTable, view: View, centre: Array, rows: IntArray, out: Array) -> int:
    """List in ``rows`` (s, 2) segment and wire of all that may be seen in a cone, in ``out`` (s, 7) their planes.

    ``centre`` (4,) is the cone's middle direction and the greatest chord from it to the direction of a ray.
    """
    x, y, z = view.pose[0, 3], view.pose[1, 3], view.pose[2, 3]
    margin = centre[3] + 0.5 * WIDEST / view.intrinsics.fx + 2.0 / view.intrinsics.fx
    found = 0
    for wire in range(len(wires.top)):
        bx, by, bz = wires.ball[wire, 0] - x, wires.ball[wire, 1] - y, wires.ball[wire, 2] - z
        away, ball = np.sqrt(bx * bx + by * by + bz * bz), wires.ball[wire, 3]
        if away > ball:  # the chord to the ball's tangent is at most sqrt(2) times the sine of its angle
            reach = 1.4143 * ball / away + margin
            off = (bx / away - centre[0]) ** 2 + (by / away - centre[1]) ** 2 + (bz / away - centre[2]) ** 2
            if off > reach * reach:
                continue
        for row in range(wires.first[wire], wires.first[wire + 1]):
            a = wires.start[row, 0] - x, wires.start[row, 1] - y, wires.start[row, 2] - z
            b = wires.end[row, 0] - x, wires.end[row, 1] - y, wires.end[row, 2] - z
            _plane(a, b, out[found])
            if _may_see(out[found], centre, margin):
                rows[found, 0], rows[found, 1] = row, wire
                found += 1
    return found


@inlined
def _may_see(plane: Array, centre: Array, margin: float) -> bool:
    """Return whether a cone comes within a chord ``margin`` of a segment, by the triangle inequality."""
    reach, off = plane[REACH] + margin, 0.0
    for axis in range(3):
        off += (plane[MIDDLE + axis] - centre[axis]) ** 2
    across = plane[NORMAL] * centre[0] + plane[NORMAL + 1] * centre[1] + plane[NORMAL + 2] * centre[2]
    return off < reach * reach and abs(across) < margin  # type: ignore[no-any-return]


@kernel
def _cone(direction: Float32Array, first: int, end: int, out: Array) -> bool:
    """Fill ``out`` (4,) with the mean direction of rays and the greatest chord from it; False if there is no ray."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(first, end):
        x, y, z = x + direction[0, k], y + direction[1, k], z + direction[2, k]
    length = np.sqrt(x * x + y * y + z * z)
    if length < 1e-6:
        return False
    x, y, z, most = x / length, y / length, z / length, 0.0
    for k in range(first, end):
        a, b, c = direction[0, k], direction[1, k], direction[2, k]
        if a * a + b * b + c * c > 0.5:
            most = max(most, (a - x) ** 2 + (b - y) ** 2 + (c - z) ** 2)
    out[0], out[1], out[2], out[3] = x, y, z, np.sqrt(most)
    return True


@kernel(inner=True, allocates=True)
def draw_wires(shading: Shading, batch: RayBatch, view: View, count: int, colour: Float32Array) -> None:
    """Blend wires over the colours of what is behind them, in packets of rays near which there is one."""
    wires, cone, margin = shading.wires, np.empty(4), 3.5 / view.intrinsics.fx
    if not _cone(batch.direction, 0, count, cone):
        return
    rows, planes = np.empty((len(wires.start), 2), np.int32), np.empty((len(wires.start) + 1, 7))
    read = _Read(np.empty(READ, np.float32), np.empty(3, np.float32), np.empty(3, np.float32))
    found = _planes(wires, view, cone, rows, planes)
    for first in range(0, count if found else 0, _LANES):
        end = min(first + _LANES, count)
        if not _cone(batch.direction, first, end, cone):
            continue
        for m in range(found):
            if _may_see(planes[m], cone, cone[3] + margin):
                chord = _chord_of(shading.wires, view, rows[m], planes[m])
                _draw_segment(shading, batch, view, chord, (first, end), read, colour)


@inlined
def _side_of(point: _Vector, tangent: Array) -> _Vector:
    """Component of a wire's tangent at right angles to the direction of a point."""
    along = (point[0] * tangent[0] + point[1] * tangent[1] + point[2] * tangent[2]) / _dot(point, point)
    return tangent[0] - along * point[0], tangent[1] - along * point[1], tangent[2] - along * point[2]


@inlined
def _chord_of(wires: WireTable, view: View, row: IntArray, plane: Array) -> _Chord:
    start, end, top = wires.start[row[0]], wires.end[row[0]], wires.top[row[1]]
    x, y, z = view.pose[0, 3], view.pose[1, 3], view.pose[2, 3]
    a, b = (start[0] - x, start[1] - y, start[2] - z), (end[0] - x, end[1] - y, end[2] - z)
    along = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    first, last = _side_of(a, wires.tangent[row[0], 0]), _side_of(b, wires.tangent[row[0], 1])
    normal = plane[NORMAL], plane[NORMAL + 1], plane[NORMAL + 2]
    return _Chord(row[1], top, a, along, first, last, normal, float(wires.radius[top]))


@kernel(inner=True)
def _draw_segment(
    shading: Shading,
    batch: RayBatch,
    view: View,
    chord: _Chord,
    span: tuple[int, int],
    read: _Read,
    colour: Float32Array,
) -> None:
    """Blend a segment over the colours of the rays ``span`` of a batch.

    Rays beside a pixel's centre have the coverage of the whole pixel, so that the sum over an image is right.
    """
    image, direction, a, along, normal = batch.image, batch.direction, chord.start, chord.along, chord.normal
    for k in range(span[0], span[1]):
        ray = float(direction[0, k]), float(direction[1, k]), float(direction[2, k])
        if _dot(ray, chord.first) < 0.0 or _dot(ray, chord.last) >= 0.0:
            continue
        across = _cross(normal, ray)
        share = -_dot(across, a) / _dot(across, along)
        distance = _dot(ray, a) + share * _dot(ray, along)
        half = chord.radius / max(distance, 1e-6)
        if not 0.0 < distance < batch.distance[k] or 2.0 * half * view.intrinsics.fx >= WIDEST:
            continue
        right, down = gradients(view, batch, k, normal)
        du, dv = image[0, k] - np.floor(image[0, k] + 0.5), image[1, k] - np.floor(image[1, k] + 0.5)
        covered = coverage(_dot(normal, ray) - du * right - dv * down, half, abs(right), abs(down))
        if covered > 0.0:
            x, y = view.pose[0, 3] + distance * ray[0], view.pose[1, 3] + distance * ray[1]
            _blend(
                shading, chord, ray, (x, y, view.pose[2, 3] + distance * ray[2]), (distance, covered), read, colour[k]
            )


@inlined
def coverage(offset: float, half: float, width: float, height: float) -> float:
    """Share of a square that a strip covers whose middle is ``offset`` from the square's and whose half width is given.

    All are measured at right angles to the strip; ``width`` and ``height`` are the square's sides seen along the strip.
    """
    wide = max(width, height)
    narrow = max(min(width, height), 1e-3 * wide)
    return _below(offset + half, wide, narrow) - _below(offset - half, wide, narrow)


@inlined
def _below(x: float, wide: float, narrow: float) -> float:
    """Share of a square's area on one side of a line at x: integral of two boxes' convolution, a trapezium."""
    x = min(max(x, -0.5 * (wide + narrow)), 0.5 * (wide + narrow))
    total = max(x + 0.5 * (wide + narrow), 0.0) ** 2 - max(x + 0.5 * (wide - narrow), 0.0) ** 2
    total += max(x - 0.5 * (wide + narrow), 0.0) ** 2 - max(x - 0.5 * (wide - narrow), 0.0) ** 2
    return total / (2.0 * wide * narrow)


@kernel(inner=True)
def _blend(
    shading: Shading,
    chord: _Chord,
    ray: _Vector,
    point: _Vector,
    found: tuple[float, float],
    read: _Read,
    colour: Float32Array,
) -> None:
    """Blend the light of a wire at a point over a colour (3,); ``found`` is its distance and coverage.

    It is as ``_illuminate`` and ``dim`` have it for a matt surface, in the mean over the wire's width: that of the
    sun's cosine is (p / 4) ((pi - b) cos b + sin b), with b the angle around the axis between sun and camera, and p the
    sine of the angle between sun and axis. Wires are in the sun.
    """
    light, sun = shading.light, shading.light.sun
    per = 1.0 / np.sqrt(_dot(chord.along, chord.along))
    t = chord.along[0] * per, chord.along[1] * per, chord.along[2] * per
    s_along, v_along = sun[0] * t[0] + sun[1] * t[1] + sun[2] * t[2], -_dot(ray, t)
    sine, facing = np.sqrt(max(1.0 - s_along * s_along, 0.0)), np.sqrt(max(1.0 - v_along * v_along, 1e-9))
    cosine = -(ray[0] * sun[0] + ray[1] * sun[1] + ray[2] * sun[2]) - s_along * v_along
    cosine = min(max(cosine / max(sine * facing, 1e-9), -1.0), 1.0)
    turn = np.arccos(cosine)
    front = 0.25 * sine * ((np.pi - turn) * cosine + np.sin(turn)) / np.pi
    distance, covered = found
    toward = 0.25 * np.pi / facing  # the mean normal of what is seen is that long
    nx = toward * (-ray[0] - v_along * t[0])
    ny = toward * (-ray[1] - v_along * t[1])
    nz = toward * (-ray[2] - v_along * t[2])
    (probe, left, glow), per_metre = read, light.volume_per_metre
    u, v = (point[0] - light.volume_corner[0]) * per_metre, (point[1] - light.volume_corner[1]) * per_metre
    read_probes(light.volume, light.volume_base, np.float32(u), np.float32(v), np.float32(point[2]), probe)
    air_along(shading.air, ray, point[2] - distance * ray[2], distance, left, glow)
    for channel in range(3):
        value = (light.sun_rgb[channel] * front + falling_on(probe, channel, nx, ny, nz)) * shading.wires.albedo[
            chord.wire, channel
        ]
        seen = EXPOSURE * (left[channel] * shading.exposure * value + (1.0 - left[channel]) * glow[channel])
        colour[channel] += np.float32(covered * (seen - colour[channel]))

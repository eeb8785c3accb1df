# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Echoes of a beam that has a width: several rays stand for it, and what they meet within a pulse merges.

A beam's irradiance is a Gaussian of the angle, exp(-r^2 / 2 s^2) with s = FWHM / sqrt(8 ln 2). One ray in its middle
with half of the power, and the others in a ring of radius 2 s with the rest, have its moments up to the fifth degree
with six rays in the ring (Stroud 1971, Approximate calculation of multiple integrals, E2-r2 5-1), and its second and
fourth radial ones with any number. The ring is turned from beam to beam, so that two rays in it see no direction more
than others.

An echo begins with the nearest ray that is left, and takes all within ``pulse_length``. Its power is their sum and its
range their mean by power, where the peak of a waveform is that has not separated (Wagner and others 2006, ISPRS Journal
60, 100-112). Class and id are those of the object with most of its power.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.sense import embree
from fieldtruth.sense.hits import HitTable, hit_top
from fieldtruth.sense.packets import Packet, set_ray
from fieldtruth.sensors.lidar.noise import Receiver
from fieldtruth.sensors.lidar.sensing import Beams, aimed, entry
from fieldtruth.sensors.lidar.signal import LidarSignal
from fieldtruth.sensors.lidar.surfaces import EchoBuffers, SurfaceTable, brightness, cosine_of, surface_of

_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.LANES // 4, 4
_OX, _OY, _OZ, _DX, _DY, _DZ = embree.ORG_X, embree.ORG_Y, embree.ORG_Z, embree.DIR_X, embree.DIR_Y, embree.DIR_Z
_FAR, _PRIM, _GEOM, _INST, _INST_PRIM = embree.TFAR, embree.PRIM_ID, embree.GEOM_ID, embree.INST_ID, embree.INST_PRIM_ID
_MISS = np.uint32(embree.MISS)
_intersect: Any = embree.intersect

TURNS: Final = 16
"""Positions of the ring, which repeat from beam to beam."""
STRONGEST, LAST, TWO = range(3)


class SubRays(NamedTuple):
    """The rays of a beam, which echoes are reported, and memory for the rays of one tile of beams."""

    offset: Array  # (TURNS, rays, 2) [rad] across and up
    scale: float  # of a direction with an offset, to unit length
    weight: Array  # (rays,) share of the power
    choice: int
    pulse_length: float  # [m]
    number: NDArray[np.int64]  # (LANES * rays,) of the ray in its beam; see _slot; so are those below
    origin: Array  # (LANES * rays, 3)
    direction: Array  # (LANES * rays, 3) in the world
    range_m: Array  # (LANES * rays,) 0 for none
    clear: Array  # (LANES * rays,) [m] up to which nothing is there
    power: Array  # of a matt white surface at 1 m that faces the LiDAR: 1
    label: NDArray[np.int64]
    instance: NDArray[np.int64]
    order: NDArray[np.int64]  # (rays,)


def sub_rays_of(signal: LidarSignal) -> SubRays:
    """Rays of a beam of a signal with at least three of them."""
    count = signal.sub_rays
    radius = 2.0 * np.radians(signal.divergence_deg) / np.sqrt(8.0 * np.log(2.0))
    ring = np.arange(count - 1) + np.arange(TURNS)[:, None] / TURNS  # (TURNS, count - 1) of its spacing
    angle = 2.0 * np.pi * ring / (count - 1)
    offset = np.zeros((TURNS, count, 2))
    offset[:, 1:] = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    memory = _LANES * count
    return SubRays(
        offset=offset,
        scale=float(1.0 / np.sqrt(1.0 + radius**2)),
        weight=np.array([0.5, *(count - 1) * (0.5 / (count - 1),)]),
        choice=("strongest", "last", "two").index(signal.returns),
        pulse_length=signal.pulse_length,
        number=np.array([0] * _LANES + [*range(1, count)] * _LANES),
        origin=np.zeros((memory, 3)),
        direction=np.zeros((memory, 3)),
        range_m=np.zeros(memory),
        clear=np.zeros(memory),
        power=np.zeros(memory),
        label=np.zeros(memory, np.int64),
        instance=np.zeros(memory, np.int64),
        order=np.zeros(count, np.int64),
    )


@inlined
def _slot(beam: int, number: int, count: int) -> int:
    """Row of a ray of a tile's beam: first the middles of all beams, then the other rays of each beam."""
    return beam if number == 0 else _LANES + beam * (count - 1) + number - 1


@inlined
def _set_tile(poses: Array, beams: Beams, rays: SubRays, first_column: int, first_ring: int) -> None:
    """Origins and directions in the world of the rays of a tile; ray 0 of a beam is its own to the last bit."""
    origin, direction, offset, directions, lag = rays.origin, rays.direction, rays.offset, beams.directions, beams.lag
    columns, rings, count = directions.shape[0], directions.shape[1], offset.shape[1]
    for beam in range(_LANES):
        column, ring = min(first_column + beam % _WIDTH, columns - 1), min(first_ring + beam // _WIDTH, rings - 1)
        share, turn = lag[ring], (7 * ring + 5 * column) % TURNS
        x, y, z = (
            entry(poses, column, share, 0, 3),
            entry(poses, column, share, 1, 3),
            entry(poses, column, share, 2, 3),
        )
        dx, dy, dz = aimed(poses, column, share, beams, ring)
        a, b, c = directions[column, ring, 0], directions[column, ring, 1], directions[column, ring, 2]
        flat = np.sqrt(a * a + b * b)
        e, f = (-b / flat, a / flat) if flat > 1e-9 else (0.0, 1.0)
        ex, ey, ez = _rotated(poses, column, share, e, f, 0.0)  # across
        ux, uy, uz = _rotated(poses, column, share, -c * f, c * e, a * f - b * e)  # up
        for number in range(count):
            slot = _slot(beam, number, count)
            origin[slot, 0], origin[slot, 1], origin[slot, 2] = x, y, z
            if number == 0:
                direction[slot, 0], direction[slot, 1], direction[slot, 2] = dx, dy, dz
            else:
                across, up = offset[turn, number, 0], offset[turn, number, 1]
                direction[slot, 0] = (dx + across * ex + up * ux) * rays.scale
                direction[slot, 1] = (dy + across * ey + up * uy) * rays.scale
                direction[slot, 2] = (dz + across * ez + up * uz) * rays.scale


@inlined
def _rotated(poses: Array, column: int, share: float, a: float, b: float, c: float) -> tuple[float, float, float]:
    """Direction in the world of (a, b, c) in the LiDAR's frame."""
    x0, x1, x2 = entry(poses, column, share, 0, 0), entry(poses, column, share, 0, 1), entry(poses, column, share, 0, 2)
    y0, y1, y2 = entry(poses, column, share, 1, 0), entry(poses, column, share, 1, 1), entry(poses, column, share, 1, 2)
    z0, z1, z2 = entry(poses, column, share, 2, 0), entry(poses, column, share, 2, 1), entry(poses, column, share, 2, 2)
    return x0 * a + x1 * b + x2 * c, y0 * a + y1 * b + y2 * c, z0 * a + z1 * b + z2 * c


@kernel
def trace_echoes(
    scene: np.uint64,
    tables: tuple[HitTable, SurfaceTable],
    packets: tuple[Packet, Packet],
    poses: Array,
    beams: Beams,
    receiver: Receiver,
    rays: SubRays,
    out: EchoBuffers,
) -> None:
    """Trace the rays of all beams in tiles of neighbouring columns and rings, and make echoes of what they meet.

    The middles of beams are traced in the packets of ``trace_beams``, so that their ranges are the same to the last
    bit; other packets, of coherent rays, hold the other rays of a few neighbouring beams.
    """
    count = rays.weight.shape[0]
    columns, rings = out.true_range.shape
    for lane in range(_LANES):
        set_ray(packets[0], lane, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, beams.max_range)
        set_ray(packets[1], lane, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, beams.max_range)
    for first_column in range(0, columns, _WIDTH):
        for first_ring in range(0, rings, _HEIGHT):
            _set_tile(poses, beams, rays, first_column, first_ring)
            for beam in range(_LANES):
                column, ring = first_column + beam % _WIDTH, first_ring + beam // _WIDTH
                packets[0].valid[beam] = -1 if column < columns and ring < rings else 0
            for first in range(0, _LANES * count, _LANES):
                _trace(scene, tables, packets[min(first, 1)], beams, rays, first)
            for beam in range(_LANES):
                column, ring = first_column + beam % _WIDTH, first_ring + beam // _WIDTH
                if column >= columns or ring >= rings:
                    continue
                out.clear[column, ring] = rays.clear[beam]
                if not _one_echo(rays, beam, column, ring, out):
                    make_echoes(rays, beam, receiver, column, ring, out)


@inlined
def _trace(
    scene: np.uint64,
    tables: tuple[HitTable, SurfaceTable],
    packet: Packet,
    beams: Beams,
    rays: SubRays,
    first: int,
) -> None:
    """Trace the rays of a tile from row ``first`` on, as many as a packet has; what is not valid meets nothing."""
    hits, surfaces = tables
    ray, words, valid, arguments = packet
    origin, direction, weight, returns = rays.origin, rays.direction, rays.weight, beams.returns
    range_m, power, label, instance = rays.range_m, rays.power, rays.label, rays.instance
    tops, rotations = hits.geometry_top, surfaces.top_rotation
    for lane in range(_LANES):
        slot = first + lane
        ray[_OX + lane], ray[_OY + lane], ray[_OZ + lane] = origin[slot, 0], origin[slot, 1], origin[slot, 2]
        ray[_DX + lane], ray[_DY + lane] = direction[slot, 0], direction[slot, 1]
        ray[_DZ + lane] = direction[slot, 2]
        ray[_FAR + lane] = beams.max_range
        words[_GEOM + lane], words[_INST + lane], words[_INST_PRIM + lane] = _MISS, _MISS, _MISS
    _intersect(valid.ctypes, scene, ray.ctypes, arguments.ctypes)
    for lane in range(_LANES):
        slot = first + lane
        range_m[slot] = 0.0
        top, distance = hit_top(tops, words, lane), np.float64(ray[_FAR + lane])
        rays.clear[slot] = distance
        if valid[lane] == 0 or top < 0 or distance < beams.min_range:
            continue
        x, y = origin[slot, 0] + distance * direction[slot, 0], origin[slot, 1] + distance * direction[slot, 1]
        found, object_id, value, gloss, exponent = surface_of(hits, surfaces, top, words[_PRIM + lane], x, y)
        if returns[found]:
            bright = brightness(value, gloss, exponent, cosine_of(rotations, ray, lane, top))
            range_m[slot], label[slot], instance[slot] = distance, found, object_id
            power[slot] = weight[rays.number[slot]] * bright / (distance * distance)


@inlined
def _one_echo(rays: SubRays, beam: int, column: int, ring: int, out: EchoBuffers) -> bool:
    """Write the echo of a beam whose rays all meet the same object, within a pulse, and say whether they do."""
    range_m, power, label, instance = rays.range_m, rays.power, rays.label, rays.instance
    nearest = farthest = range_m[beam]
    total, moment, count = 0.0, 0.0, rays.weight.shape[0]
    for number in range(count):
        slot = _slot(beam, number, count)
        if range_m[slot] == 0.0 or label[slot] != label[beam] or instance[slot] != instance[beam]:
            return False
        nearest, farthest = min(nearest, range_m[slot]), max(farthest, range_m[slot])
        total += power[slot]
        moment += power[slot] * range_m[slot]
    if farthest - nearest > rays.pulse_length or total == 0.0:
        return False
    for echo in range(1, out.depth.shape[0]):
        out.depth[echo, column, ring] = 0.0
    distance = moment / total
    out.true_range[column, ring], out.depth[0, column, ring] = range_m[beam], distance
    out.apparent[0, column, ring], out.mixed[0, column, ring] = total * distance * distance, False
    out.label[0, column, ring], out.instance[0, column, ring] = label[beam], instance[beam]
    return True


@kernel
def make_echoes(rays: SubRays, beam: int, receiver: Receiver, column: int, ring: int, out: EchoBuffers) -> None:
    """Merge what the rays of a beam of the tile meet, and write the echoes that are reported."""
    range_m, power, order, count = rays.range_m, rays.power, rays.order, rays.weight.shape[0]
    out.true_range[column, ring] = range_m[beam]
    for echo in range(out.depth.shape[0]):
        out.depth[echo, column, ring] = 0.0
    left = 0
    for number in range(count):  # in the order of range
        slot = _slot(beam, number, count)
        if range_m[slot] == 0.0:
            continue
        k = left
        while k > 0 and range_m[order[k - 1]] > range_m[slot]:
            order[k] = order[k - 1]
            k -= 1
        order[k] = slot
        left += 1
    best, second, last = (-1, 0.0), (-1, 0.0), (-1, 0.0)  # where an echo begins, and its power
    k = 0
    while k < left:
        begin, total, nearest = k, 0.0, range_m[order[k]]
        while k < left and range_m[order[k]] - nearest <= rays.pulse_length:
            total += power[order[k]]
            k += 1
        if total > best[1]:
            best, second = (begin, total), best
        elif total > second[1]:
            second = begin, total
        if total * receiver.gain >= receiver.threshold or receiver.gain == 0.0:
            last = begin, total
    if rays.choice == STRONGEST or last[0] < 0:
        _write_echo(rays, left, best[0], (0, column, ring), out)
    elif rays.choice == LAST:
        _write_echo(rays, left, last[0], (0, column, ring), out)
    else:
        other = second[0] if last[0] == best[0] else last[0]
        _write_echo(rays, left, best[0] if other < 0 else min(best[0], other), (0, column, ring), out)
        if other >= 0:
            _write_echo(rays, left, max(best[0], other), (1, column, ring), out)


@inlined
def _write_echo(rays: SubRays, left: int, begin: int, cell: tuple[int, int, int], out: EchoBuffers) -> None:
    """Write the echo whose nearest ray is number ``begin`` in the order of range; none if that is negative."""
    range_m, power, order, label, instance = rays.range_m, rays.power, rays.order, rays.label, rays.instance
    end, total, moment = max(begin, 0), 0.0, 0.0
    while begin >= 0 and end < left and range_m[order[end]] - range_m[order[begin]] <= rays.pulse_length:
        total += power[order[end]]
        moment += power[order[end]] * range_m[order[end]]
        end += 1
    most, maker, mixed = -1.0, 0, False
    for k in range(max(begin, 0), end):
        own, mine = 0.0, order[k]
        for j in range(begin, end):
            same = label[order[j]] == label[mine] and instance[order[j]] == instance[mine]
            own += power[order[j]] if same else 0.0
            mixed = mixed or not same
        if own > most:
            most, maker = own, mine
    if total > 0.0:
        distance = moment / total
        out.depth[cell], out.apparent[cell], out.mixed[cell] = distance, total * distance * distance, mixed
        out.label[cell], out.instance[cell] = label[maker], instance[maker]

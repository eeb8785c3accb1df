# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays of a LiDAR: range, class and instance id of what its beams meet, how bright that looks, and echoes.

See ``sensors.lidar.sensing`` for the rays that stand for a beam, and how their echoes merge.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.kernels import packets
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.packets import (
    TERRAIN,
    Grid,
    HitTable,
    Packet,
    SceneRays,
    classify,
    hit_top,
    read_grid,
    set_ray,
    trace_packet,
)

_LANES, _WIDTH, _HEIGHT = packets.LANES, packets.LANES // 4, 4
TILE_COLUMNS: Final = _WIDTH
"""Columns whose rays share packets."""
_OX, _OY, _OZ, _DX, _DY, _DZ = packets.ORG_X, packets.ORG_Y, packets.ORG_Z, packets.DIR_X, packets.DIR_Y, packets.DIR_Z
_FAR, _TIME, _PRIM, _GEOM, _INST, _INST_PRIM = (
    packets.TFAR,
    packets.TIME,
    packets.PRIM_ID,
    packets.GEOM_ID,
    packets.INST_ID,
    packets.INST_PRIM_ID,
)
_MISS = np.uint32(packets.MISS)


class Scan(NamedTuple):
    """The returns of one revolution, ordered by column, then by ring.

    ``xyz`` (n, 3) [m] in the LiDAR's frame; ``range_m`` (n,) [m]; ``label`` class ids; ``instance`` instance ids;
    ``ring`` and ``column`` identify the ray; ``t_ns`` [ns] is the ray's time after the scan's stamp; ``top`` is the row
    in ``Scene.top_levels`` and 1 more, and ``part`` the ``PlantPart``, 0 unless the LiDAR has the extra.
    """

    xyz: Float32Array
    range_m: Float32Array
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    ring: NDArray[np.uint16]
    column: NDArray[np.uint16]
    t_ns: NDArray[np.uint32]
    top: NDArray[np.uint32]
    part: NDArray[np.uint8]


class Beams(NamedTuple):
    """Unit directions (columns, rings, 3), limits of range [m], and which classes return a pulse (256,).

    ``lag`` (rings,) is the share of a column's time after which a ring fires. ``time`` (columns + 1,) is the time,
    see ``packets.SceneRays``, at which each column begins and the last one ends.
    """

    directions: Array
    lag: Array
    min_range: float
    max_range: float
    returns: Mask
    time: Array


@inlined
def entry(poses: Array, k: int, share: float, row: int, column: int) -> float:
    """Entry of a pose between poses ``k`` and ``k + 1``; with the share 0 exactly that of pose ``k``."""
    begin: float = poses[k, row, column]
    return begin if share == 0.0 else begin + share * (poses[k + 1, row, column] - begin)


@inlined
def aimed(poses: Array, k: int, share: float, beams: Beams, ring: int) -> tuple[float, float, float]:
    """Direction in the world of the beam of a ring that leaves ``share`` of a column's time after column ``k``."""
    a, b, c = beams.directions[k, ring, 0], beams.directions[k, ring, 1], beams.directions[k, ring, 2]
    return (
        entry(poses, k, share, 0, 0) * a + entry(poses, k, share, 0, 1) * b + entry(poses, k, share, 0, 2) * c,
        entry(poses, k, share, 1, 0) * a + entry(poses, k, share, 1, 1) * b + entry(poses, k, share, 1, 2) * c,
        entry(poses, k, share, 2, 0) * a + entry(poses, k, share, 2, 1) * b + entry(poses, k, share, 2, 2) * c,
    )


@kernel
def collect_returns(directions: Array, echoes: "EchoBuffers", found: Scan) -> None:
    """List the returns by column, then by ring; NumPy's indexing takes eight times as long (1.3 ms of a scan of 25)."""
    labels, instances, distances = echoes.label, echoes.instance, echoes.depth
    xyz, range_m, label, instance, rings, columns, _, _, _ = found
    k = 0
    for column in range(distances.shape[1]):
        for ring in range(distances.shape[2]):
            distance = distances[0, column, ring]
            if distance == 0.0:
                continue
            for axis in range(3):
                xyz[k, axis] = directions[column, ring, axis] * distance
            range_m[k], label[k], instance[k] = distance, labels[0, column, ring], instances[0, column, ring]
            rings[k], columns[k] = ring, column
            k += 1


_NX, _NY, _NZ = packets.NG_X, packets.NG_Y, packets.NG_Z


class SurfaceTable(NamedTuple):
    """Reflectance of every triangle and of the ground."""

    face_material: NDArray[np.uint16]  # (faces of all meshes,) row of ``material``; a mesh starts at HitTable.mesh_face
    material: Float32Array  # (materials, 3) columns of a Reflectance
    top_rotation: Float32Array  # (tops, 3, 3) world from object, without scale
    ground: Grid  # reflectance off the trails, or everywhere
    trail: float  # below 0: that of the ground
    border: float
    border_width: float  # [m] inwards from a trail's edge


class EchoBuffers(NamedTuple):
    """Echoes of each beam, (echoes, columns, rings), the nearest first; the beam's own range is (columns, rings)."""

    label: NDArray[np.uint8]  # as the hit table has it: a class, or a code
    instance: NDArray[np.uint32]  # as the hit table has it: an instance id, or ``Scan.top``
    depth: Float32Array  # [m] range, 0 without an echo
    apparent: Float32Array  # reflectance of a matt surface that faces the LiDAR, fills the beam and is as bright
    mixed: Mask  # whether surfaces of more than one class or object made it
    clear: Float32Array  # [m] up to which nothing is in the middle of the beam
    true_range: Float32Array  # [m] of what the middle of the beam meets, 0 if that returns nothing


@inlined
def brightness(value: float, gloss: float, exponent: float, cosine: float) -> float:
    """Reflectance that a beam sees under an angle of incidence, relative to a matt white surface that it meets upright.

    The law of Lambert, value * cos, and a lobe of the share ``gloss`` (Jutzi and Gross 2009, equation 9): value * ((1 -
    gloss) cos + gloss |cos 2 theta|^n). The lobe ends at 45 deg: beyond, cos 2 theta is of light thrown forwards.
    """
    if gloss == 0.0:
        return value * cosine
    mirrored = max(2.0 * cosine * cosine - 1.0, 0.0)
    return value * ((1.0 - gloss) * cosine + gloss * mirrored**exponent)  # type: ignore[no-any-return]


@inlined
def cosine_of(rotations: Float32Array, ray: Float32Array, lane: int, top: int) -> float:
    """Cosine of the angle of incidence; Embree's normal is in the object's frame and not of unit length."""
    nx, ny, nz = ray[_NX + lane], ray[_NY + lane], ray[_NZ + lane]
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if top != TERRAIN:
        nx, ny, nz = (
            rotations[top, 0, 0] * nx + rotations[top, 0, 1] * ny + rotations[top, 0, 2] * nz,
            rotations[top, 1, 0] * nx + rotations[top, 1, 1] * ny + rotations[top, 1, 2] * nz,
            rotations[top, 2, 0] * nx + rotations[top, 2, 1] * ny + rotations[top, 2, 2] * nz,
        )
    facing = nx * ray[_DX + lane] + ny * ray[_DY + lane] + nz * ray[_DZ + lane]
    return min(abs(facing) / max(length, 1e-30), 1.0)  # type: ignore[no-any-return]


@inlined
def surface_of(
    hits: HitTable, surfaces: SurfaceTable, top: int, primitive: int, x: float, y: float
) -> tuple[float, float, float]:
    """Return the three columns of the reflectance of a hit at world x, y [m]."""
    if top == TERRAIN:
        inside = read_grid(hits.trail_distance, x, y)
        if inside >= 0.0 or surfaces.trail < 0.0:
            return read_grid(surfaces.ground, x, y), 0.0, 1.0
        return (surfaces.border if inside > -surfaces.border_width else surfaces.trail), 0.0, 1.0
    row, material = surfaces.face_material[hits.mesh_face[hits.top_mesh[top]] + primitive], surfaces.material
    return material[row, 0], material[row, 1], material[row, 2]


class Receiver(NamedTuple):
    """A LidarSignal as kernels take it."""

    gain: float
    """Photons from a matt white surface that faces the LiDAR at 1 m; 0 if every pulse returns."""
    threshold: float
    """[photon]"""
    log_signal: Array
    """Points of the standard deviation of ranges; empty without noise."""
    log_deviation: Array
    resolution: float
    """[m]"""
    angle: float
    """[rad]"""


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
    gain: float  # as of the receiver
    threshold: float  # as of the receiver
    packets: tuple[Packet, Packet]  # of the middles, and of the other rays
    origin: Array  # (LANES * rays, 3); see _slot for the rows, which those below have, too
    direction: Array  # (LANES * rays, 3) in the world
    time: Array  # (LANES * rays,)
    range_m: Array  # (LANES * rays,) 0 for none
    clear: Array  # (LANES * rays,) [m] up to which nothing is there
    power: Array  # of a matt white surface at 1 m that faces the LiDAR: 1; first of all its brightness
    code: NDArray[np.int64]  # of the hit table: the class, unless that has codes
    owner: NDArray[np.int64]  # of the hit table: the instance id, unless that has rows
    label: NDArray[np.int64]
    instance: NDArray[np.int64]
    order: NDArray[np.int64]  # (rays,)
    class_of: NDArray[np.uint8]  # (256,) class of a code
    object_of: NDArray[np.uint32]  # instance id of an owner; empty if it is the instance id


@inlined
def _slot(beam: int, number: int, count: int) -> int:
    """Row of a ray of a tile's beam: first the middles of all beams, then the other rays of each beam."""
    return beam if number == 0 else _LANES + beam * (count - 1) + number - 1


@inlined
def _set_tile(poses: Array, beams: Beams, rays: SubRays, first_column: int, first_ring: int) -> None:
    """Origins and directions in the world of the rays of a tile; ray 0 of a beam is its own to the last bit."""
    origin, direction, offset, directions, lag = rays.origin, rays.direction, rays.offset, beams.directions, beams.lag
    times, time = beams.time, rays.time
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
        origin[beam, 0], origin[beam, 1], origin[beam, 2] = x, y, z
        direction[beam, 0], direction[beam, 1], direction[beam, 2] = dx, dy, dz
        time[beam] = times[column] + share * (times[column + 1] - times[column])
        if count == 1:
            continue
        flat = np.sqrt(a * a + b * b)
        e, f = (-b / flat, a / flat) if flat > 1e-9 else (0.0, 1.0)
        ex, ey, ez = _rotated(poses, column, share, e, f, 0.0)  # across
        ux, uy, uz = _rotated(poses, column, share, -c * f, c * e, a * f - b * e)  # up
        for number in range(1, count):
            slot = _slot(beam, number, count)
            across, up = offset[turn, number, 0], offset[turn, number, 1]
            origin[slot, 0], origin[slot, 1], origin[slot, 2] = x, y, z
            time[slot] = time[beam]
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
    scene: SceneRays,
    hits: HitTable,
    surfaces: SurfaceTable | None,
    poses: Array,
    beams: Beams,
    rays: SubRays,
    span: tuple[int, int],
    out: EchoBuffers,
) -> None:
    """Trace a span of columns in tiles of neighbouring columns and rings, and make echoes of what they meet.

    A span that begins at a multiple of ``TILE_COLUMNS`` gives the same echoes as a scan in one piece.

    The middles of beams share packets, however many rays a beam has, so that their ranges are the same to the last bit;
    other packets, of coherent rays, hold the other rays of a few neighbouring beams. Without ``surfaces`` a beam has
    one ray, and only class, instance id and range are found. Arrays are indexed and never sliced: Numba counts the
    references of each slice, which takes longer.
    """
    count, packets = rays.weight.shape[0], rays.packets
    columns, rings = out.true_range.shape
    for lane in range(_LANES):
        set_ray(packets[0], lane, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, beams.max_range)
        set_ray(packets[1], lane, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, beams.max_range)
    for first_column in range(span[0], span[1], _WIDTH):
        for first_ring in range(0, rings, _HEIGHT):
            _set_tile(poses, beams, rays, first_column, first_ring)
            for beam in range(_LANES):
                column, ring = first_column + beam % _WIDTH, first_ring + beam // _WIDTH
                packets[0].valid[beam] = -1 if column < columns and ring < rings else 0
            for first in range(0, _LANES * count, _LANES):
                _trace(scene, hits, surfaces, packets[min(first, 1)], beams, rays, first)
            for beam in range(_LANES):
                column, ring = first_column + beam % _WIDTH, first_ring + beam // _WIDTH
                if column >= columns or ring >= rings:
                    continue
                out.clear[column, ring] = rays.clear[beam]
                if count == 1:
                    _write_middle(rays, beam, column, ring, out)
                elif surfaces is not None:
                    _weigh(rays, beam)
                    if not _one_echo(rays, beam, column, ring, out):
                        make_echoes(rays, beam, column, ring, out)


@inlined
def _trace(
    scene: SceneRays,
    hits: HitTable,
    surfaces: SurfaceTable | None,
    packet: Packet,
    beams: Beams,
    rays: SubRays,
    first: int,
) -> None:
    """Trace the rays of a tile from row ``first`` on, as many as a packet has; what is not valid meets nothing."""
    ray, words, valid, _ = packet
    origin, direction, tops, returns = rays.origin, rays.direction, hits.geometry_top, beams.returns
    range_m, power, label, instance = rays.range_m, rays.power, rays.label, rays.instance
    for lane in range(_LANES):
        slot = first + lane
        ray[_OX + lane], ray[_OY + lane], ray[_OZ + lane] = origin[slot, 0], origin[slot, 1], origin[slot, 2]
        ray[_DX + lane], ray[_DY + lane] = direction[slot, 0], direction[slot, 1]
        ray[_DZ + lane] = direction[slot, 2]
        ray[_FAR + lane], ray[_TIME + lane] = beams.max_range, rays.time[slot]
        words[_GEOM + lane], words[_INST + lane], words[_INST_PRIM + lane] = _MISS, _MISS, _MISS
    trace_packet(scene, packet)
    for lane in range(_LANES):
        slot = first + lane
        range_m[slot] = 0.0
        top, distance = hit_top(tops, words, lane), np.float64(ray[_FAR + lane])
        rays.clear[slot] = distance
        if valid[lane] == 0 or top < 0 or distance < beams.min_range:
            continue
        x, y = origin[slot, 0] + distance * direction[slot, 0], origin[slot, 1] + distance * direction[slot, 1]
        found, object_id = classify(hits, top, words[_PRIM + lane], x, y)
        if returns[rays.class_of[found]]:
            range_m[slot], rays.code[slot], rays.owner[slot] = distance, found, object_id
            label[slot] = rays.class_of[found]
            instance[slot] = rays.object_of[object_id] if len(rays.object_of) > 0 else object_id
            if surfaces is not None:
                value, gloss, exponent = surface_of(hits, surfaces, top, words[_PRIM + lane], x, y)
                power[slot] = brightness(value, gloss, exponent, cosine_of(surfaces.top_rotation, ray, lane, top))


@inlined
def _write_middle(rays: SubRays, beam: int, column: int, ring: int, out: EchoBuffers) -> None:
    """Write the echo of a beam that has one ray."""
    out.depth[0, column, ring] = out.true_range[column, ring] = rays.range_m[beam]
    out.apparent[0, column, ring] = rays.power[beam]
    out.label[0, column, ring], out.instance[0, column, ring] = rays.code[beam], rays.owner[beam]


@inlined
def _weigh(rays: SubRays, beam: int) -> None:
    """Turn how bright the surfaces look that the rays of a beam meet into power."""
    count = rays.weight.shape[0]
    for number in range(count):
        slot = _slot(beam, number, count)
        rays.power[slot] = rays.weight[number] * rays.power[slot] / (rays.range_m[slot] * rays.range_m[slot])


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
    out.label[0, column, ring], out.instance[0, column, ring] = rays.code[beam], rays.owner[beam]
    return True


@kernel
def make_echoes(rays: SubRays, beam: int, column: int, ring: int, out: EchoBuffers) -> None:
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
        if total * rays.gain >= rays.threshold or rays.gain == 0.0:
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
        out.label[cell], out.instance[cell] = rays.code[maker], rays.owner[maker]

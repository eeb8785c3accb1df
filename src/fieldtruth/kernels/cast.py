# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels of ``Scene.cast`` and ``Scene.occluded``: rays as they come, what they hit, and whether they are blocked."""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.core.classes import Label
from fieldtruth.kernels import packets
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.packets import TERRAIN, Grid, HitTable, Packet, hit_top, read_grid, set_ray

MARGIN: Final = 1e-3
"""Distance [m] before a target from which on nothing hides it: its own surface must not."""
OBJECT, FIRST = 9, 10
"""Columns of ``CastTable.words``."""

_LANES, _MISS = packets.LANES, packets.MISS
_OX, _OY, _OZ, _DX, _DY, _DZ = packets.ORG_X, packets.ORG_Y, packets.ORG_Z, packets.DIR_X, packets.DIR_Y, packets.DIR_Z
_NX, _NY, _NZ, _PRIM = packets.NG_X, packets.NG_Y, packets.NG_Z, packets.PRIM_ID
_NEAR, _FAR, _MASK, _GEOM, _INST = packets.TNEAR, packets.TFAR, packets.MASK, packets.GEOM_ID, packets.INST_ID
_INST_PRIM = packets.INST_PRIM_ID
_GROUND, _TRAIL = int(Label.GROUND), int(Label.TRAIL)
_intersect: Any = packets.intersect
_occluded: Any = packets.occluded

Points = NDArray[np.float32] | NDArray[np.float64]


class Hits(NamedTuple):
    """First hits of n rays, in the world frame, to single precision.

    Where a ray hits nothing, ``range_m`` is infinite, ``position`` NaN, ``normal``, ``label`` and ``instance`` 0, and
    ``material`` -1.
    """

    range_m: Float32Array
    """(n,) distance [m] from the origin, whatever the length of the direction."""
    position: Points
    """(n, 3) [m], of the type of the rays."""
    normal: Float32Array
    """(n, 3) of unit length: the plane of the triangle, without interpolation between vertices, on the side from which
    the ray came. So it always points against the ray, in whichever order the triangle has its corners."""
    label: NDArray[np.uint8]
    """(n,) class id."""
    instance: NDArray[np.uint32]
    """(n,) instance id."""
    material: NDArray[np.int16]
    """(n,) row in ``Scene.materials``. Of the ground: on trails that of the trail or of its border, elsewhere that of
    the greatest weight, of which photographs show a mixture; under snow that of the soil."""


class CastTable(NamedTuple):
    """Tables for the normal, texture and material of a hit, which has its class and instance id already."""

    tops: Float32Array  # (tops, 16) rotation times scale of world_from_object, by row; a line of the cache each
    words: NDArray[np.uint32]  # the same bytes; from column 9 on instance id and first row in ``face_material``
    face_material: NDArray[np.int16]  # (faces of all meshes,) row of the world's materials
    label: NDArray[np.uint8]  # (materials,) class ids
    cover: Float32Array  # (nx, ny, c) weights of the materials of the ground
    ground: NDArray[np.int16]  # (c + 2,) their rows, then those of the trail, or -1, and of its border
    grid: Grid  # of the cover; its values are the first channel
    border_width: float


class Bundle(NamedTuple):
    """Rays of one type of numbers; a step of 0 repeats the first row of an array for all rays."""

    origins: Points
    origin_step: int
    ahead: Points  # directions of any length above 0, or targets
    ahead_step: int
    targets: bool
    near: float
    far: float
    mask: int


@inlined
def _length(x: float, y: float, z: float) -> float:
    """Length of a vector, also where squares would be too large or too small; not finite if a component is not."""
    total = abs(x) + abs(y) + abs(z)
    if not (total > 0.0 and total < np.inf):
        return total
    per = 1.0 / total
    if per == np.inf:  # the least numbers have no reciprocal
        return 0.0
    x, y, z = x * per, y * per, z * per
    return total * np.sqrt(x * x + y * y + z * z)  # type: ignore[no-any-return]


@inlined
def _aim(packet: Packet, lane: int, bundle: Bundle, k: int) -> int:
    """Put ray k into a lane, not valid if it has no length between its limits; returns -1, or k if it is no ray."""
    ray, words = packet.ray, packet.words
    i, j = k * bundle.origin_step, k * bundle.ahead_step
    ox, oy, oz = np.float64(bundle.origins[i, 0]), np.float64(bundle.origins[i, 1]), np.float64(bundle.origins[i, 2])
    x, y, z = np.float64(bundle.ahead[j, 0]), np.float64(bundle.ahead[j, 1]), np.float64(bundle.ahead[j, 2])
    far = bundle.far
    if bundle.targets:
        x, y, z = x - ox, y - oy, z - oz
    length = _length(x, y, z)
    if bundle.targets:
        far = min(far, length - MARGIN)
    a, b, c = np.float32(ox), np.float32(oy), np.float32(oz)
    if not (length < np.inf and (length > 0.0 or bundle.targets) and abs(a) + abs(b) + abs(c) < np.inf):
        return k
    per = 1.0 / length if length > 0.0 else 0.0
    ray[_OX + lane], ray[_OY + lane], ray[_OZ + lane] = a, b, c
    ray[_DX + lane], ray[_DY + lane], ray[_DZ + lane] = x * per, y * per, z * per
    ray[_NEAR + lane], ray[_FAR + lane] = bundle.near, far
    words[_GEOM + lane], words[_INST + lane], words[_INST_PRIM + lane] = _MISS, _MISS, _MISS
    packet.valid[lane] = -1 if far >= bundle.near else 0
    return -1


@inlined
def _fill(packet: Packet, bundle: Bundle, first: int, last: int) -> int:
    """Put rays into a packet; returns -1, or the row of one that is invalid."""
    for lane in range(_LANES):
        if first + lane < last:
            if _aim(packet, lane, bundle, first + lane) >= 0:
                return first + lane
        else:
            packet.valid[lane] = 0
    return -1


@inlined
def _prepare(packet: Packet, bundle: Bundle) -> None:
    """Set what all rays share."""
    for lane in range(_LANES):
        set_ray(packet, lane, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, 0.0)
        packet.words[_MASK + lane] = bundle.mask


@kernel
def block_rays(scene: np.uint64, packet: Packet, bundle: Bundle, span: tuple[int, int], out: NDArray[np.bool_]) -> int:
    """Write whether anything blocks each of a span of rays; returns -1, or the row of one that is invalid."""
    ray, valid, arguments = packet.ray, packet.valid, packet.arguments
    _prepare(packet, bundle)
    for first in range(span[0], span[1], _LANES):
        bad = _fill(packet, bundle, first, span[1])
        if bad >= 0:
            return bad
        _occluded(valid.ctypes, scene, ray.ctypes, arguments.ctypes)
        for lane in range(min(_LANES, span[1] - first)):
            out[first + lane] = valid[lane] != 0 and ray[_FAR + lane] < np.float32(0.0)
    return -1


@inlined
def _ground(hits: HitTable, table: CastTable, x: float, y: float) -> tuple[int, int]:
    """Row of the material, and class, of the ground at world x, y [m]."""
    ground, channels = table.ground, table.cover.shape[2]
    trail = read_grid(hits.trail_distance, x, y)
    if trail < 0.0 and ground[channels] >= 0:
        return ground[channels + 1 if trail > -table.border_width else channels], _TRAIL
    grid, values = table.grid, table.cover
    u = min(max((x - grid.x0) * grid.per_metre, 0.0), values.shape[0] - 1.0)
    v = min(max((y - grid.y0) * grid.per_metre, 0.0), values.shape[1] - 1.0)
    i, j = min(int(u), values.shape[0] - 2), min(int(v), values.shape[1] - 2)
    fu, fv = u - i, v - j
    best, most = 0, -1.0
    for c in range(channels):
        low = values[i, j, c] * (1.0 - fv) + values[i, j + 1, c] * fv
        weight = low * (1.0 - fu) + (values[i + 1, j, c] * (1.0 - fv) + values[i + 1, j + 1, c] * fv) * fu
        if weight > most:
            best, most = c, weight
    return ground[best], _TRAIL if trail < 0.0 else _GROUND


@inlined
def _look_up(hits: HitTable, table: CastTable, packet: Packet, first: int, count: int, out: Hits) -> None:
    """Write ``material`` of the hits of a packet, and into ``instance`` the row of the top-level geometry.

    Each loop waits for the memory of all lanes at once.
    """
    words, tops, rows = packet.words, hits.geometry_top, table.words
    top, material, faces = out.instance, out.material, table.face_material
    for lane in range(count):
        top[first + lane] = hit_top(tops, words, lane)
    for lane in range(count):
        row = top[first + lane]
        material[first + lane] = -1
        if row != _MISS and row != TERRAIN:
            material[first + lane] = faces[np.int64(rows[row, FIRST]) + np.int64(words[_PRIM + lane])]


@inlined
def _write_normal(packet: Packet, lane: int, axes: Float32Array, row: int, normal: Float32Array, k: int) -> None:
    """Write the unit normal of a hit on the top-level geometry of a row, on the side of the ray."""
    ray = packet.ray
    a, b, c = np.float64(ray[_NX + lane]), np.float64(ray[_NY + lane]), np.float64(ray[_NZ + lane])
    x = axes[row, 0] * a + axes[row, 1] * b + axes[row, 2] * c
    y = axes[row, 3] * a + axes[row, 4] * b + axes[row, 5] * c
    z = axes[row, 6] * a + axes[row, 7] * b + axes[row, 8] * c
    length = np.sqrt(x * x + y * y + z * z)
    away = x * ray[_DX + lane] + y * ray[_DY + lane] + z * ray[_DZ + lane] > 0.0
    scale = 0.0 if length == 0.0 else (-1.0 if away else 1.0) / length
    normal[k, 0], normal[k, 1], normal[k, 2] = x * scale, y * scale, z * scale


@kernel
def trace_rays(
    scene: np.uint64,
    hits: HitTable,
    table: CastTable,
    packet: Packet,
    bundle: Bundle,
    span: tuple[int, int],
    out: Hits,
) -> int:
    """Write what a span of rays hits; returns -1, or the row of one that is invalid."""
    ray, _, valid, arguments = packet
    range_m, position, normal, label, instance, material = out
    _prepare(packet, bundle)
    for first in range(span[0], span[1], _LANES):
        bad = _fill(packet, bundle, first, span[1])
        if bad >= 0:
            return bad
        _intersect(valid.ctypes, scene, ray.ctypes, arguments.ctypes)
        count = min(_LANES, span[1] - first)
        _look_up(hits, table, packet, first, count, out)
        for lane in range(count):
            k = first + lane
            row = instance[k]
            if row == _MISS:
                range_m[k], label[k], instance[k] = np.inf, 0, 0
                for axis in range(3):
                    position[k, axis], normal[k, axis] = np.nan, 0.0
                continue
            i, far = k * bundle.origin_step, np.float64(ray[_FAR + lane])
            x, y = bundle.origins[i, 0] + far * ray[_DX + lane], bundle.origins[i, 1] + far * ray[_DY + lane]
            range_m[k], instance[k] = far, table.words[row, OBJECT]
            position[k, 0], position[k, 1] = x, y
            position[k, 2] = bundle.origins[i, 2] + far * ray[_DZ + lane]
            if row == TERRAIN:
                material[k], label[k] = _ground(hits, table, x, y)
            else:
                label[k] = table.label[material[k]]
            _write_normal(packet, lane, table.tops, row, normal, k)
    return -1

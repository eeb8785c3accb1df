# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Embree's packets of rays, the memory and functions that kernels use with them, and what was hit.

The ``embreex`` wheel ships the Embree library. Kernels refer to ``rtcIntersect16`` as an external symbol, so that they
can be cached. Layout of a packet in 4-byte words (Embree 4.4, ``rtcore_ray.h``): field f of lane k is word
``f * LANES + k``, with the fields numbered as below; ``sense.embree.Engine`` checks it.

Packets are as wide as the processor traces natively: 16 rays with AVX-512, else 8. Measured on a park-like scene, one
core, camera rays in 4 x 4 tiles with the coherent flag: 16 rays 9.5, 8 rays 7.1, single rays 4.4 Mrays/s.

Camera and LiDAR both call ``classify`` on hits of the same scene, so their labels cannot disagree.
"""

import ctypes as c
from functools import cache
from importlib.metadata import files
from typing import Any, Final, NamedTuple

import numpy as np
from llvmlite import binding as llvm
from numba import types
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.kernels.compile import inlined
from fieldtruth.kernels.ruts import NO_RUTS, RutTable

MISS: Final = 0xFFFFFFFF
SOLID: Final = 1
"""Mask of geometry that casts shadows; the default."""
CLEAR: Final = 2
"""Mask of geometry that light passes through: water."""
THIN: Final = 4
"""Mask of wires. They cast shadows; photographs draw them by their width and need what is behind them."""
SHADOWS: Final = SOLID | THIN
"""Mask of shadow rays."""
_NATIVE_RAY16 = 34
_COHERENT = 1 << 16


@cache
def embree_library() -> c.CDLL | None:
    """Load the wheel's Embree and TBB libraries once, and register what kernels call; None if they are missing."""
    shipped = {stem: f for f in files("embreex") or () for stem in ("libtbb", "libembree4") if f.name.startswith(stem)}
    if len(shipped) != 2:
        return None
    c.CDLL(str(shipped["libtbb"].locate()), c.RTLD_GLOBAL)
    library = c.CDLL(str(shipped["libembree4"].locate()))
    queries = [f"{query}{lanes}" for query in ("Intersect", "Occluded") for lanes in (1, 8, 16)]
    for name in (*(f"rtc{query}" for query in queries), *(f"rtcForward{query}Ex" for query in queries)):
        llvm.add_symbol(name, c.cast(getattr(library, name), c.c_void_p).value)
    library.rtcNewDevice.restype, library.rtcNewDevice.argtypes = c.c_void_p, (c.c_char_p,)
    library.rtcGetDeviceProperty.restype = c.c_ssize_t
    library.rtcGetDeviceProperty.argtypes = c.c_void_p, c.c_int
    return library


@cache
def embree_device(library: c.CDLL) -> int:
    """Return the Embree device of this process.

    It builds with one thread, so that the bounding volume hierarchy, and with it the result of a tie, does not depend
    on timing. It is never released: after releasing a second device, one of TBB's threads was seen to spin forever.
    """
    return int(library.rtcNewDevice(b"threads=1"))


def _native_lanes() -> int:
    """Packet width: 16 if Embree traces packets of 16 natively on this processor, else 8."""
    library = embree_library()  # without it, the engine says what is wrong
    if library is None:
        return 8
    return 16 if library.rtcGetDeviceProperty(embree_device(library), _NATIVE_RAY16) else 8


LANES: Final = _native_lanes()
TILE_WIDTH: Final = 4
"""A packet of neighbouring rays is a tile of ``TILE_WIDTH`` x ``TILE_HEIGHT``, lane = row * TILE_WIDTH + column."""
TILE_HEIGHT: Final = LANES // TILE_WIDTH
ORG_X, ORG_Y, ORG_Z, TNEAR, DIR_X, DIR_Y, DIR_Z, TIME, TFAR, MASK, ID, FLAGS = (LANES * k for k in range(12))
NG_X, NG_Y, NG_Z, HIT_U, HIT_V, PRIM_ID, GEOM_ID, INST_ID, INST_PRIM_ID = (LANES * k for k in range(12, 21))
RAY_WORDS: Final = 12 * LANES
RAYHIT_WORDS: Final = 21 * LANES
_TRACE = types.void(types.voidptr, types.uint64, types.voidptr, types.voidptr)
intersect = types.ExternalFunction(f"rtcIntersect{LANES}", _TRACE)
"""Call from a kernel: (valid, scene, rayhit, arguments); valid is LANES int32 of -1 or 0; all 64-byte aligned."""
occluded = types.ExternalFunction(f"rtcOccluded{LANES}", _TRACE)
"""Call from a kernel as ``intersect``; reads the 12 ray fields only; TFAR of an occluded lane becomes -inf."""
_intersect: Any = intersect
_occluded: Any = occluded


def arguments_block(*, coherent: bool) -> NDArray[np.uint64]:
    """RTCIntersectArguments (or RTCOccludedArguments), its context, and memory for a packet, as one block for kernels.

    ``coherent`` doubles the speed of neighbouring pixels' rays; those of a LiDAR are farther apart and faster without.
    The block contains its own address: keep it alive while it is used, and do not copy it.
    """
    words = aligned(32 + RAY_WORDS, np.int32).view(np.uint32)
    block = words.view(np.uint64)
    words[16:18] = MISS  # RTCRayQueryContext: instID and instPrimID
    words[0] = _COHERENT if coherent else 0
    words[1] = MISS  # feature mask: all
    block[1] = block[8:].ctypes.data
    return block


SPARE: Final = 64
"""Offset [byte] from the context of ``arguments_block`` to its memory, for the rays of a packet in another frame."""


def aligned(words: int, dtype: type[np.float32] | type[np.int32] = np.float32) -> NDArray[Any]:
    """Zeros (words,) on a 64-byte boundary, as packets need."""
    memory = np.zeros(words + 16, dtype)
    start = (-memory.ctypes.data % 64) // 4
    return memory[start : start + words]


IntArray = NDArray[np.int32]
Scalar = float | np.float32
Vector = tuple[Scalar, Scalar, Scalar]


class Packet(NamedTuple):
    """Memory of one packet, not to be shared by threads. ``ray`` and ``words`` view the same bytes."""

    ray: Float32Array
    words: NDArray[np.uint32]
    valid: IntArray
    arguments: NDArray[np.uint64]


def new_packet(*, coherent: bool) -> Packet:
    """Allocate a packet of LANES rays; ``coherent`` as in ``arguments_block``."""
    ray = aligned(RAYHIT_WORDS)
    return Packet(ray, ray.view(np.uint32), aligned(LANES, np.int32), arguments_block(coherent=coherent))


@inlined
def set_ray(packet: Packet, lane: int, origin: Vector, direction: Vector, near: float, far: float) -> None:
    """Put a ray into a lane: origin [m], unit direction, least and greatest distance [m] of a hit. Its time stays."""
    ray, words = packet.ray, packet.words
    ray[ORG_X + lane], ray[ORG_Y + lane], ray[ORG_Z + lane] = origin
    ray[DIR_X + lane], ray[DIR_Y + lane], ray[DIR_Z + lane] = direction
    ray[TNEAR + lane], ray[TFAR + lane] = near, far
    words[MASK + lane], words[ID + lane], words[FLAGS + lane] = MISS, 0, 0
    words[GEOM_ID + lane], words[INST_ID + lane], words[INST_PRIM_ID + lane] = MISS, MISS, MISS
    packet.valid[lane] = -1


@inlined
def set_shadow_ray(packet: Packet, lane: int, origin: Vector, direction: Vector, near: float, far: float) -> None:
    """Put a ray into a lane as ``set_ray`` does; it passes through water, as light does."""
    set_ray(packet, lane, origin, direction, near, far)
    packet.words[MASK + lane] = SHADOWS


NO_BODIES: Final = np.zeros((1, 0, 3, 3), np.float32)
"""Axes without bodies."""


class SceneRays(NamedTuple):
    """Scenes that rays meet: what stands still, bodies that move, plants that lean, and ground with ruts.

    The time of a ray is its share of the interval. Instances of bodies have the first numbers of all geometries, those
    of plants the next ones: they are elements of one geometry, whose number is that of the first.
    """

    still: np.uint64  # handle of the Embree scene
    moving: np.uint64  # of that of the bodies; 0: none
    axes: Float32Array  # (knots, bodies, 3, 3) rotation times scale of world_from_body, evenly over the interval
    plants: np.uint64 = np.uint64(0)  # handle of the Embree scene of plants; 0: none
    plant_axes: Float32Array = NO_BODIES  # (knots, geometries, 3, 3) by which each has turned in its own frame
    ground: np.uint64 = np.uint64(0)  # handle of the Embree scene of ground with ruts; 0: none
    ruts: RutTable = NO_RUTS  # their depths at time 0


@inlined
def set_time(packet: Packet, time: float) -> None:
    """Set the time of all rays of a packet."""
    for lane in range(LANES):
        packet.ray[TIME + lane] = time


@inlined
def _between(axes: Float32Array, rows: tuple[int, int, int, np.float32], i: int, j: int) -> np.float32:
    """Entry of a body's axes between two knots."""
    low, high, body, share = rows
    begin = axes[low, body, i, j]
    return begin + share * (axes[high, body, i, j] - begin)  # type: ignore[no-any-return]


@inlined
def body_normal(axes: Float32Array, body: int, time: float, normal: Vector) -> Vector:
    """Turn a normal of a body into the world at a time: it stays perpendicular to edges, as the body's matrix moves."""
    last = axes.shape[0] - 1
    k = min(int(time * last), max(last - 1, 0))
    rows = k, min(k + 1, last), body, np.float32(time * last - k)
    m00, m01, m02 = _between(axes, rows, 0, 0), _between(axes, rows, 0, 1), _between(axes, rows, 0, 2)
    m10, m11, m12 = _between(axes, rows, 1, 0), _between(axes, rows, 1, 1), _between(axes, rows, 1, 2)
    m20, m21, m22 = _between(axes, rows, 2, 0), _between(axes, rows, 2, 1), _between(axes, rows, 2, 2)
    x, y, z = normal
    return (
        (m11 * m22 - m12 * m21) * x + (m12 * m20 - m10 * m22) * y + (m10 * m21 - m11 * m20) * z,
        (m02 * m21 - m01 * m22) * x + (m00 * m22 - m02 * m20) * y + (m01 * m20 - m00 * m21) * z,
        (m01 * m12 - m02 * m11) * x + (m02 * m10 - m00 * m12) * y + (m00 * m11 - m01 * m10) * z,
    )


@inlined
def mover_normal(scene: SceneRays, number: int, time: float, normal: Vector) -> Vector:
    """Turn a normal of body or plant ``number`` at a time to the frame of its top-level geometry."""
    bodies = scene.axes.shape[1]
    if number < bodies:
        return body_normal(scene.axes, number, time, normal)
    return body_normal(scene.plant_axes, number - bodies, time, normal)


@inlined
def trace_packet(scene: SceneRays, packet: Packet) -> None:
    """Find the first hits of a packet. Normals of bodies are in the world, others in the frame of their object.

    The frame of a plant's object is that without any lean.
    """
    ray, words, valid, arguments = packet
    _intersect(valid.ctypes, scene.still, ray.ctypes, arguments.ctypes)
    if scene.ground != np.uint64(0):
        _intersect(valid.ctypes, scene.ground, ray.ctypes, arguments.ctypes)
    if scene.moving == np.uint64(0) and scene.plants == np.uint64(0):
        return
    if scene.plants != np.uint64(0):
        _intersect(valid.ctypes, scene.plants, ray.ctypes, arguments.ctypes)
    if scene.moving != np.uint64(0):
        _intersect(valid.ctypes, scene.moving, ray.ctypes, arguments.ctypes)
    movers = scene.axes.shape[1] + scene.plant_axes.shape[1]
    for lane in range(LANES):
        if valid[lane] == 0 or words[GEOM_ID + lane] == MISS or words[INST_ID + lane] >= movers:
            continue
        number = int(words[INST_ID + lane]) + int(words[INST_PRIM_ID + lane])
        words[INST_ID + lane], words[INST_PRIM_ID + lane] = number, 0
        normal = ray[NG_X + lane], ray[NG_Y + lane], ray[NG_Z + lane]
        turned = mover_normal(scene, number, float(ray[TIME + lane]), normal)
        ray[NG_X + lane], ray[NG_Y + lane], ray[NG_Z + lane] = turned


@inlined
def block_packet(scene: SceneRays, packet: Packet) -> None:
    """Find which rays of a packet anything blocks: their TFAR becomes -inf."""
    _occluded(packet.valid.ctypes, scene.still, packet.ray.ctypes, packet.arguments.ctypes)
    if scene.ground != np.uint64(0):
        _occluded(packet.valid.ctypes, scene.ground, packet.ray.ctypes, packet.arguments.ctypes)
    if scene.plants != np.uint64(0):
        _occluded(packet.valid.ctypes, scene.plants, packet.ray.ctypes, packet.arguments.ctypes)
    if scene.moving != np.uint64(0):
        _occluded(packet.valid.ctypes, scene.moving, packet.ray.ctypes, packet.arguments.ctypes)


TERRAIN: Final = 0
"""Row of the terrain among the scene's top-level geometries."""
_GROUND, _TRAIL, _SKY = int(Label.GROUND), int(Label.TRAIL), int(Label.SKY)


class Grid(NamedTuple):
    """A raster as kernels take it: values (nx, ny), position of its first node, and nodes per metre."""

    values: Float32Array
    x0: float
    y0: float
    per_metre: float


class HitTable(NamedTuple):
    """Class and instance id of every triangle.

    A top-level geometry is the terrain (row 0), the backdrop if there is one, one instance of a mesh, or a body that
    moves: those are the last rows, with axes that are the world's. Bunches of a clump that lean share its row.
    """

    geometry_top: NDArray[np.int32]  # (geometries of the Embree scene,) row of the top-level geometry it belongs to
    top_object: NDArray[np.uint32]  # (tops,) instance id
    top_mesh: NDArray[np.int32]  # (tops,) row of mesh_face; -1 for the terrain
    mesh_face: NDArray[np.int64]  # (meshes,) first row in face_label
    face_label: NDArray[np.uint8]  # (faces of all meshes,)
    trail_distance: Grid


class NormalBuffers(NamedTuple):
    """Image of surface normals that a kernel fills, (h, w, 3) in the optical frame, and what it takes for that.

    ``axes`` (tops, 3, 3) is the rotation times scale of ``world_from_object`` of each top-level geometry.
    """

    image: Float32Array
    axes: Array


NO_NORMALS: Final = NormalBuffers(np.zeros((0, 0, 3), np.float32), np.zeros((0, 3, 3)))
"""Where no normals are wanted."""


class LabelBuffers(NamedTuple):
    """Label, instance and depth images that a kernel fills, each (h, w), and normals if they are wanted."""

    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    depth: Float32Array
    normal: NormalBuffers = NO_NORMALS


@inlined
def read_grid(grid: Grid, x: float, y: float) -> float:
    """Bilinear value of a grid at world x, y [m]; beyond the border the border's value (as ``Raster.at``)."""
    nx, ny = grid.values.shape
    u = min(max((x - grid.x0) * grid.per_metre, 0.0), nx - 1.0)
    v = min(max((y - grid.y0) * grid.per_metre, 0.0), ny - 1.0)
    i, j = min(int(u), nx - 2), min(int(v), ny - 2)
    fu, fv = u - i, v - j
    low = grid.values[i, j] * (1.0 - fv) + grid.values[i, j + 1] * fv
    high = grid.values[i + 1, j] * (1.0 - fv) + grid.values[i + 1, j + 1] * fv
    return low * (1.0 - fu) + high * fu  # type: ignore[no-any-return]


@inlined
def hit_top(tops: NDArray[np.int32], words: NDArray[np.uint32], lane: int) -> int:
    """Row of the top-level geometry that a lane hit, -1 for none. ``words`` is the packet viewed as uint32."""
    instance = words[INST_ID + lane]
    geometry = words[GEOM_ID + lane]
    if geometry == MISS:
        return -1
    return np.int64(tops[geometry if instance == MISS else instance])  # type: ignore[return-value]


@inlined
def hit_mover(scene: SceneRays, words: NDArray[np.uint32], lane: int) -> int:
    """Number of the body or plant that a lane hit, -1 for none."""
    instance = words[INST_ID + lane]
    if words[GEOM_ID + lane] == MISS or instance >= scene.axes.shape[1] + scene.plant_axes.shape[1]:
        return -1
    return np.int64(instance)  # type: ignore[return-value]


@inlined
def classify(table: HitTable, top: int, primitive: int, x: float, y: float) -> tuple[int, int]:
    """Class and instance id of a hit on triangle ``primitive`` of ``top`` at world x, y [m]; sky and 0 for a miss."""
    if top < 0:
        return _SKY, 0
    if top == TERRAIN:
        return (_TRAIL if read_grid(table.trail_distance, x, y) < 0.0 else _GROUND), GROUND_ID
    face = table.mesh_face[table.top_mesh[top]] + primitive
    return np.int64(table.face_label[face]), np.int64(table.top_object[top])  # type: ignore[return-value]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Embree 4 through its C API: devices, scenes and instances; kernels trace them, see ``kernels.packets``.

The ``embreex`` wheel ships the Embree library; its Python interface supports neither instances nor packets, so the
library is called directly. ``Engine`` raises EngineError for another version, or another layout of packets.

``processor`` names what the last digit of a reading depends on. Embree orders triangles otherwise in packets of another
width, so that a ray may meet either of two surfaces at one depth; its instruction sets, the code that Numba compiles
and the loops of NumPy round otherwise.
"""

import ctypes as c
from collections.abc import Sequence
from functools import cache, cached_property
from typing import Any, Final, Self

import numpy as np
from numpy.lib.introspect import opt_func_info
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.errors import EngineError
from fieldtruth.kernels import packets, swaying
from fieldtruth.kernels.compile import compiler_target
from fieldtruth.kernels.packets import LANES, MISS, NO_BODIES, SOLID, SceneRays

VERSION: Final = 40400
_TRIANGLES, _GRIDS, _USER, _INSTANCE, _INSTANCE_ARRAY = 0, 2, 120, 121, 122
_INDEX, _VERTEX, _GRID, _TRANSFORM = 0, 1, 8, 23
_FLOAT3, _UINT, _UINT3, _GRID_FORMAT, _FLOAT3X4_COLUMN_MAJOR = 0x9003, 0x5001, 0x5003, 0xA001, 0x9234
_RTC_GRID: Final = np.dtype([("start", "u4"), ("stride", "u4"), ("width", "u2"), ("height", "u2")])
_GRID_NODES: Final = 17  # on a side of a grid; 9 and 33 were measured to be no faster
_NATIVE_PACKETS = ((34, 16), (33, 8), (32, 4))  # number of the property, rays
_ROBUST = 1 << 2
_HIGH_QUALITY = 2
_SIGNATURES: Final[dict[str, tuple[Any, tuple[Any, ...]]]] = {
    "rtcGetDeviceError": (c.c_int, (c.c_void_p,)),
    "rtcNewScene": (c.c_void_p, (c.c_void_p,)),
    "rtcReleaseScene": (None, (c.c_void_p,)),
    "rtcSetSceneFlags": (None, (c.c_void_p, c.c_int)),
    "rtcSetSceneBuildQuality": (None, (c.c_void_p, c.c_int)),
    "rtcCommitScene": (None, (c.c_void_p,)),
    "rtcNewGeometry": (c.c_void_p, (c.c_void_p, c.c_int)),
    "rtcReleaseGeometry": (None, (c.c_void_p,)),
    "rtcSetNewGeometryBuffer": (c.c_void_p, (c.c_void_p, c.c_int, c.c_uint, c.c_int, c.c_size_t, c.c_size_t)),
    "rtcSetGeometryInstancedScene": (None, (c.c_void_p, c.c_void_p)),
    "rtcSetGeometryInstancedScenes": (None, (c.c_void_p, c.c_void_p, c.c_size_t)),
    "rtcSetGeometryTimeStepCount": (None, (c.c_void_p, c.c_uint)),
    "rtcSetGeometryTransform": (None, (c.c_void_p, c.c_uint, c.c_int, c.c_void_p)),
    "rtcSetGeometryMask": (None, (c.c_void_p, c.c_uint)),
    "rtcCommitGeometry": (None, (c.c_void_p,)),
    "rtcSetGeometryUserPrimitiveCount": (None, (c.c_void_p, c.c_uint)),
    "rtcSetGeometryUserData": (None, (c.c_void_p, c.c_void_p)),
    "rtcSetGeometryBoundsFunction": (None, (c.c_void_p, c.c_void_p, c.c_void_p)),
    "rtcSetGeometryIntersectFunction": (None, (c.c_void_p, c.c_void_p)),
    "rtcSetGeometryOccludedFunction": (None, (c.c_void_p, c.c_void_p)),
    "rtcGetSceneBounds": (None, (c.c_void_p, c.c_void_p)),
    "rtcAttachGeometryByID": (None, (c.c_void_p, c.c_void_p, c.c_uint)),
}


@cache
def _library() -> c.CDLL:
    library = packets.embree_library()
    if library is None:
        raise EngineError("cannot find Embree 4 in the package embreex; run: pip install --force-reinstall embreex")
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def native_packet() -> int:
    """Return the rays of the widest packet that Embree traces natively on this processor; 1 for none."""
    library = _library()
    device = packets.embree_device(library)
    return next((rays for number, rays in _NATIVE_PACKETS if library.rtcGetDeviceProperty(device, number)), 1)


class Engine:
    """The Embree device, after a check of version and packet layout.

    Raises:
        EngineError: the library differs from the one that the kernels were written for.
    """

    def __init__(self) -> None:
        self._api = _library()
        self.device = packets.embree_device(self._api)
        found = self._api.rtcGetDeviceProperty(self.device, 0)
        if found != VERSION:
            raise EngineError(f"Embree must be version {VERSION}, got {found}; run: pip install 'embreex>=4.4,<4.5'")
        self._check_layout()

    def _check_layout(self) -> None:
        """Trace one triangle of an instance in the last lane, and compare with the solution of the 3 x 3 system."""
        corners = np.array([[0.0, 0.0, 0.5], [4.0, 0.5, 1.0], [0.5, 4.0, 1.5]])
        origin, direction = np.array([1.0, 2.0, 7.0]), np.array([0.1, -0.2, -1.0])
        first, second = corners[1:] - corners[0]
        distance, u, v = np.linalg.solve(
            np.stack([-direction, first, second], axis=-1), origin - corners[0] - [0, 0, 2]
        )
        triangle, scene = RayScene(self), RayScene(self)
        triangle.add_mesh([[9.0, 9.0, 9.0], *corners], [[0, 0, 1], [1, 2, 3]])
        scene.add_mesh([[50, 50, 50], [51, 50, 50], [50, 51, 50]], [[0, 1, 2]])
        matrix = np.eye(4)
        matrix[2, 3] = 2.0
        scene.add_instance(triangle.commit(), matrix)
        scene.commit()
        ray, words, valid, arguments = packets.new_packet(coherent=False)
        lane = LANES - 1

        def at(*fields: str) -> list[int]:
            return [getattr(packets, field) + lane for field in fields]

        valid[lane] = -1
        ray[at("ORG_X", "ORG_Y", "ORG_Z")] = origin
        ray[at("DIR_X", "DIR_Y", "DIR_Z")] = direction
        ray[at("TFAR")] = 100.0
        words[at("MASK", "GEOM_ID", "INST_ID", "INST_PRIM_ID")] = MISS
        trace = getattr(self._api, f"rtcIntersect{LANES}")
        trace.restype, trace.argtypes = None, (c.c_void_p,) * 4
        trace(valid.ctypes.data, scene._pointer, ray.ctypes.data, arguments.ctypes.data)
        floats = ray[at("TFAR", "NG_X", "NG_Y", "NG_Z", "HIT_U", "HIT_V")]
        ids = words[at("PRIM_ID", "GEOM_ID", "INST_ID")]
        expected = [distance, *np.cross(first, second), u, v]
        if not (np.allclose(floats, expected, rtol=1e-5) and ids.tolist() == [1, 0, 1]):
            raise EngineError(f"Embree's packets of {LANES} rays have an unexpected layout; reinstall embreex")

    def check(self) -> None:
        """Raise EngineError if Embree has set an error code since the last call."""
        code = self._api.rtcGetDeviceError(self.device)
        if code:
            raise EngineError(f"Embree reports error {code} (rtcore_device.h, RTCError)")


class RayScene:
    """Triangle meshes, grids and instances of other scenes; kernels trace its ``handle``.

    Geometries are numbered in their order, from ``first`` on. (A scene takes memory and time for all numbers below.)
    """

    def __init__(self, engine: Engine, first: int = 0) -> None:
        self.engine = engine
        self._next = first
        self._api = engine._api
        self._kept: list[object] = []  # instanced scenes, and arrays, must outlive their instances
        self._pointer = self._api.rtcNewScene(engine.device)
        self._api.rtcSetSceneFlags(self._pointer, _ROBUST)
        self._api.rtcSetSceneBuildQuality(self._pointer, _HIGH_QUALITY)

    @property
    def handle(self) -> np.uint64:
        """Address of the scene."""
        return np.uint64(self._pointer)

    @property
    def alone(self) -> SceneRays:
        """The scene without bodies that move."""
        return SceneRays(self.handle, np.uint64(0), NO_BODIES)

    def add_mesh(self, vertices: ArrayLike, faces: ArrayLike) -> int:
        """Attach triangles: vertices (v, 3) [m], faces (f, 3); those of MISS are left out. Returns the geometry id."""
        geometry = self._api.rtcNewGeometry(self.engine.device, _TRIANGLES)
        self._set_buffer(geometry, _VERTEX, _FLOAT3, np.ascontiguousarray(vertices, np.float32))
        self._set_buffer(geometry, _INDEX, _UINT3, np.ascontiguousarray(faces, np.uint32))
        return self._attach(geometry)

    def add_grid(self, nodes: ArrayLike) -> int:
        """Attach a regular grid of nodes (nx, ny, 3) [m], cells divided from (i, j) to (i + 1, j + 1). Returns its id.

        It takes a quarter of the memory of its triangles.
        """
        # Embree divides a cell along the other diagonal: with the rows in reverse order it is this one.
        points = np.ascontiguousarray(np.asarray(nodes)[::-1], np.float32)
        nx, ny, _ = points.shape
        i, j = (np.arange(0, n - 1, _GRID_NODES - 1) for n in (nx, ny))
        grids = np.zeros((len(i), len(j)), _RTC_GRID)  # neighbours share the nodes of their border
        grids["start"], grids["stride"] = i[:, None] * ny + j, ny
        grids["width"] = np.minimum(_GRID_NODES, ny - j)
        grids["height"] = np.minimum(_GRID_NODES, nx - i)[:, None]
        geometry = self._api.rtcNewGeometry(self.engine.device, _GRIDS)
        self._set_buffer(geometry, _VERTEX, _FLOAT3, points.reshape(-1, 3))
        self._set_buffer(geometry, _GRID, _GRID_FORMAT, grids.ravel())
        return self._attach(geometry)

    def add_grids(self, nodes: ArrayLike) -> int:
        """Attach n separate grids as one geometry, of nodes (steps, n, a, b, 3) [m] with cells as in ``add_grid``.

        Nodes move on straight lines between steps, evenly from time 0 to time 1. Returns its id.
        """
        points = np.ascontiguousarray(np.asarray(nodes)[:, :, ::-1], np.float32)
        steps, count, height, width, _ = points.shape
        grids = np.zeros(count, _RTC_GRID)
        grids["start"], grids["stride"] = np.arange(count) * height * width, width
        grids["width"], grids["height"] = width, height
        geometry = self._api.rtcNewGeometry(self.engine.device, _GRIDS)
        if steps > 1:
            self._api.rtcSetGeometryTimeStepCount(geometry, steps)
        for step, at in enumerate(points):
            self._set_buffer(geometry, _VERTEX, _FLOAT3, at.reshape(-1, 3), slot=step)
        self._set_buffer(geometry, _GRID, _GRID_FORMAT, grids)
        return self._attach(geometry)

    def add_instance(
        self, scene: Self, this_from_scene: NDArray[np.float64], *, mask: int = SOLID, number: int | None = None
    ) -> int:
        """Attach a committed scene, visible to rays whose mask includes ``mask``, as the next or a given geometry.

        It is at a pose (4, 4), or at poses (k, 4, 4) evenly from time 0 to time 1, between which the matrix changes
        linearly. Returns its id.
        """
        geometry = self._api.rtcNewGeometry(self.engine.device, _INSTANCE)
        self._api.rtcSetGeometryInstancedScene(geometry, scene._pointer)
        poses = this_from_scene.reshape(-1, 4, 4)
        columns = np.ascontiguousarray(poses[:, :3].transpose(0, 2, 1), np.float32)
        if len(columns) > 1:
            self._api.rtcSetGeometryTimeStepCount(geometry, len(columns))
        for step, at in enumerate(range(columns.ctypes.data, columns.ctypes.data + columns.nbytes, columns[0].nbytes)):
            self._api.rtcSetGeometryTransform(geometry, step, _FLOAT3X4_COLUMN_MAJOR, at)
        self._api.rtcSetGeometryMask(geometry, mask)
        self._kept.append(scene)
        return self._attach(geometry, number)

    def add_instances(
        self, scenes: Sequence[Self], which: NDArray[np.uint32], columns: NDArray[np.float32], *, number: int
    ) -> None:
        """Attach committed scenes as one geometry of n elements, which builds ten times as fast as n instances.

        Element k is ``scenes[which[k]]`` at poses (steps, n, 12), column by column, in time as for ``add_instance``.
        """
        if len(columns) == 2 and native_packet() == LANES:
            self._add_swaying(scenes, which, columns, number)
            return
        geometry = self._api.rtcNewGeometry(self.engine.device, _INSTANCE_ARRAY)
        pointers = (c.c_void_p * len(scenes))(*(scene._pointer for scene in scenes))
        self._api.rtcSetGeometryInstancedScenes(geometry, pointers, len(scenes))
        self._api.rtcSetGeometryTimeStepCount(geometry, len(columns))
        self._set_buffer(geometry, _INDEX, _UINT, which, 4)
        for step, poses in enumerate(columns):
            self._set_buffer(geometry, _TRANSFORM, _FLOAT3X4_COLUMN_MAJOR, poses, 48, step)
        self._kept += scenes
        self._attach(geometry, number)

    def _add_swaying(
        self, scenes: Sequence[Self], which: NDArray[np.uint32], columns: NDArray[np.float32], number: int
    ) -> None:
        """Attach committed scenes that move, see ``add_instances``, placed by ``kernels.swaying``."""
        handles = np.array([scene._pointer for scene in scenes], np.uint64)[which]
        boxes = np.empty((len(which), 8), np.float32)
        swaying.swept_boxes(columns, which, np.array([scene._box for scene in scenes]), boxes)
        words = np.array([each.ctypes.data for each in (columns[0], columns[1], handles, boxes)], np.uint64)
        geometry, api = self._api.rtcNewGeometry(self.engine.device, _USER), self._api
        api.rtcSetGeometryUserPrimitiveCount(geometry, len(which))
        api.rtcSetGeometryUserData(geometry, words.ctypes.data)
        api.rtcSetGeometryBoundsFunction(geometry, swaying.bound(), None)
        api.rtcSetGeometryIntersectFunction(geometry, swaying.meet())
        api.rtcSetGeometryOccludedFunction(geometry, swaying.block())
        self._kept += [*scenes, columns, handles, boxes, words]
        self._attach(geometry, number)

    @cached_property
    def _box(self) -> NDArray[np.float64]:
        """Least and greatest coordinates (2, 3) [m] of what the scene holds."""
        found = packets.aligned(8)
        self._api.rtcGetSceneBounds(self._pointer, found.ctypes.data)
        return found.reshape(2, 4)[:, :3].astype(np.float64)

    def commit(self) -> Self:
        """Build the hierarchy; afterwards the scene can be traced or instanced."""
        self._api.rtcCommitScene(self._pointer)
        self.engine.check()
        return self

    def _set_buffer(
        self, geometry: int, kind: int, layout: int, data: NDArray[Any], size: int = 12, slot: int = 0
    ) -> None:
        """Copy elements of a size [byte] into a buffer of Embree's own, long enough to read 16 at the last one."""
        buffer = self._api.rtcSetNewGeometryBuffer(geometry, kind, slot, layout, size, len(data))
        self.engine.check()
        c.memmove(buffer, data.ctypes.data, data.nbytes)

    def _attach(self, geometry: int, number: int | None = None) -> int:
        identity = self._next if number is None else number
        self._next = identity + 1
        self._api.rtcCommitGeometry(geometry)
        self._api.rtcAttachGeometryByID(self._pointer, geometry, identity)
        self._api.rtcReleaseGeometry(geometry)
        self.engine.check()
        return identity

    def __del__(self) -> None:
        if getattr(self, "_pointer", None):
            self._api.rtcReleaseScene(self._pointer)


_SETS: Final = {16: "AVX-512", 8: "AVX or AVX2", 4: "SSE or NEON"}
"""Instruction sets by the widest packet that Embree traces natively with them."""


@cache
def processor() -> dict[str, str]:
    """Return what Embree, Numba and NumPy use in this process: platform, packets, instruction sets, compiler target."""
    triple, name, features = compiler_target()
    loops = opt_func_info(func_name="^exp$", signature="^float64$").get("exp", {})
    return {
        "platform": triple,
        "packet width": str(LANES),
        "Embree's instruction set": _SETS.get(native_packet(), "unknown"),
        "Numba's processor": name,
        "Numba's instruction sets": " ".join(sorted(f[1:] for f in features.split(",") if f.startswith("+"))),
        "NumPy's instruction set": " ".join(sorted({found["current"] for found in loops.values()})),
    }

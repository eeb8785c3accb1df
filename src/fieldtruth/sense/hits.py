# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Class and instance id of a ray hit.

Camera and LiDAR both call ``classify`` on hits of the same scene, so their labels cannot disagree.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.kernels.compile import inlined
from fieldtruth.sense import embree

TERRAIN: Final = 0
"""Row of the terrain among the scene's top-level geometries."""

_GROUND, _TRAIL, _SKY = int(Label.GROUND), int(Label.TRAIL), int(Label.SKY)
_MISS = embree.MISS
_INST, _GEOM = embree.INST_ID, embree.GEOM_ID


class Grid(NamedTuple):
    """A raster as kernels take it: values (nx, ny), position of its first node, and nodes per metre."""

    values: Float32Array
    x0: float
    y0: float
    per_metre: float


class HitTable(NamedTuple):
    """Class and instance id of every triangle.

    A top-level geometry is the terrain (row 0), the backdrop if there is one, or one instance of a mesh.
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
    instance = words[_INST + lane]
    geometry = words[_GEOM + lane]
    if geometry == _MISS:
        return -1
    return np.int64(tops[geometry if instance == _MISS else instance])  # type: ignore[return-value]


@inlined
def classify(table: HitTable, top: int, primitive: int, x: float, y: float) -> tuple[int, int]:
    """Class and instance id of a hit on triangle ``primitive`` of ``top`` at world x, y [m]; sky and 0 for a miss."""
    if top < 0:
        return _SKY, 0
    if top == TERRAIN:
        return (_TRAIL if read_grid(table.trail_distance, x, y) < 0.0 else _GROUND), GROUND_ID
    face = table.mesh_face[table.top_mesh[top]] + primitive
    return np.int64(table.face_label[face]), np.int64(table.top_object[top])  # type: ignore[return-value]

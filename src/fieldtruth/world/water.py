# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Water: flat sheets, which are objects of kind "water", and the height of its surface."""

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh, Raster, make_mesh
from fieldtruth.world.placement import WorldBuilder

DRY: Final = -1e5
"""Height [m] of the water in a raster of several levels, on dry ground."""
TILE: Final = 30.0
"""Length [m] of water that its texture covers."""


def make_sheet(name: str, vertices: Array, faces: ArrayLike, material: str = "water") -> Mesh:
    """Sheet of water of vertices (v, 3) [m] and triangles (f, 3); its texture follows x and y."""
    up = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    return make_mesh(name, vertices, up, vertices[:, :2] / TILE, faces, (material,), footprint=0.0)


def make_flat_sheet(name: str, x: Array, y: Array) -> Mesh:
    """Sheet of water at height 0 on a grid of coordinates (nx,), (ny,) [m]."""
    nx, ny = len(x), len(y)
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((nx, ny))], axis=-1).reshape(-1, 3)
    a = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    faces = np.stack([a, a + ny, a + ny + 1, a, a + ny + 1, a + 1], axis=-1).reshape(-1, 3)
    return make_sheet(name, vertices, faces)


def add_water(builder: WorldBuilder, level: float | Raster | None, sheets: Iterable[tuple[Mesh, float]]) -> None:
    """Add sheets, each with its height [m], and the ``World.water_level`` that belongs to them."""
    builder.water_level = level
    for mesh, height in sheets:
        pose = np.eye(4)
        pose[2, 3] = height
        builder.add("water", mesh, pose, [])

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tables that shading kernels read: light, surfaces, materials. They are made once per scene and never change."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.render.atlas import Atlas
from fieldtruth.render.sky import Dome
from fieldtruth.sense.hits import Grid, HitTable
from fieldtruth.sense.packets import IntArray

EXPOSURE: Final = 3.9
HAZE_PER_METRE: Final = 1.0 / 1800.0
"""Extinction coefficient [1/m] of clear air."""
NO_SHADOW: Final = -2
"""Value of ``LightTable.top_leaf`` for the backdrop."""
AIR_TEXEL: Final = 1.0  # [m] of air_sky along x and y, from the world's corner
AIR_LAYER: Final = 1.5  # [m] between layers of air_sky
AIR_BASE: Final = 0.4  # [m] of the lowest layer above the ground

NORMAL_X, NORMAL_Y, NORMAL_Z, TEX_U, TEX_V, OPEN_SKY = range(6)
"""Columns of ``SurfaceTable.vertex``."""
FIRST, SECOND, THIRD, MATERIAL = range(4)
"""Columns of ``SurfaceTable.face``."""


class LightTable(NamedTuple):
    """Baked light. Irradiances are relative to the sun's on a surface that faces it."""

    sun: Array  # (3,) unit vector towards the sun
    sun_rgb: Float32Array  # (3,) irradiance
    dome: Dome
    bounce: Float32Array  # (3,) radiance from below
    ground_sun: Grid  # share of the sun's disc that is visible from the ground
    ground_sky: Grid  # share of the sky's light that reaches the ground
    vertex_sky: Float32Array  # (v,) the same for every vertex of every mesh on its own
    leaf_sun: NDArray[np.uint8]  # one per face of each instance with leaves: 1 where a leaf sees the sun
    air_sky: Float32Array  # (nx, ny, nz) share of open sky in the air, with all occluders
    top_base: Float32Array  # (tops,) [m] z of each geometry's origin, from which air_sky's height is measured
    top_leaf: NDArray[np.int64]  # (tops,) first row of leaf_sun; -1: no leaves; NO_SHADOW: the backdrop


class SurfaceTable(NamedTuple):
    """Vertices and faces of all meshes, concatenated; a mesh's faces start at row ``HitTable.mesh_face``."""

    vertex: Float32Array  # (v, 6) unit normal in the object's frame, uv in repeats, share of open sky
    face: IntArray  # (f, 4) rows of its three vertices and of its material, in the order of ``World.materials``
    face_repeat: Float32Array  # (f,) [m] covered by one repeat of the texture
    top_rotation: Float32Array  # (tops, 3, 3) world from object, without scale
    top_tint: Float32Array  # (tops, 3)


class MaterialTable(NamedTuple):
    """Colours: rows by material, and the ground's colour and material on grids."""

    atlas: Atlas
    texture: IntArray  # (materials,) row of the atlas
    tint: Float32Array  # (materials, 3)
    translucency: Float32Array
    gloss: Float32Array
    mirror: Float32Array
    repeat: Float32Array  # (materials,) [m] per repeat, used for the ground
    ground: Float32Array  # (nx, ny, 4) linear colour off the trails, and height [m] of the ground without its relief
    ground_material: NDArray[np.uint8]  # (mx, my) row of the material whose texture is used
    surface: Grid  # heights [m] of the ground
    corner: tuple[float, float]  # [m] x and y of the first node of ground and ground_material
    per_metre_rgb: float
    per_metre_material: float
    trail: int  # rows of materials
    border: int
    border_width: float


class Shading(NamedTuple):
    """All that a photograph needs of a scene."""

    scene: np.uint64  # handle of the Embree scene
    hits: HitTable
    surfaces: SurfaceTable
    materials: MaterialTable
    light: LightTable
    has_water: bool
    exposure: np.float32  # relative to an open meadow
    air: Float32Array  # (3,) extinction [1/m] of the weather by channel
    has_weather: bool

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tables that shading kernels read: light, surfaces, materials. They are made once per scene and never change."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.render.atlas import Atlas
from fieldtruth.render.sky.dome import Dome
from fieldtruth.render.sun_map import SunMap
from fieldtruth.sense.hits import Grid, HitTable
from fieldtruth.sense.packets import IntArray

EXPOSURE: Final = 3.9
NO_SHADOW: Final = -2
"""Value of ``LightTable.top_leaf`` for the backdrop."""
AIR_TEXEL: Final = 1.0  # [m] between the light volume's probes along x and y, from the world's corner
AIR_LAYER: Final = 1.5  # [m] between their layers
AIR_BASE: Final = 0.4  # [m] of the lowest layer above the ground

NORMAL_X, NORMAL_Y, NORMAL_Z, TEX_U, TEX_V, OPEN = range(6)
"""Columns of ``SurfaceTable.vertex``."""
FIRST, SECOND, THIRD, MATERIAL = range(4)
"""Columns of ``SurfaceTable.face``."""


class LightTable(NamedTuple):
    """Baked light, as a camera's meter and white balance scale it: 1 is the irradiance ``unit``. See docs/light.md."""

    sun: Array  # (3,) unit vector towards the sun
    sun_rgb: Float32Array  # (3,) irradiance of a surface that faces the sun
    disc: Float32Array  # (3,) radiance in the middle of the sun's disc
    unit: Float32Array  # (3,) irradiance [100 klx] of each channel that stands for 1
    cloud_sun: Grid  # share of sunlight that clouds let through; ground_sun has it
    has_cloud_shadow: bool
    dome: Dome
    sun_map: SunMap
    ground_sun: Grid  # share of the sun's disc that is visible from the ground
    ground_near: Grid  # share of directions above the ground in which nothing is near, weighted by the cosine
    vertex_near: Float32Array  # (v,) the same for every vertex of every mesh on its own
    leaf_sun: NDArray[np.uint8]  # one per face of each instance with leaves: 1 where a leaf sees the sun
    volume: Float32Array  # (nx, ny, nz, 16) probes of the light in the air, see ``render.volume``
    volume_base: Float32Array  # (nx, ny) height [m] of the ground, from which probes are AIR_BASE + k AIR_LAYER apart
    volume_corner: tuple[float, float]  # [m] x and y of the first probe
    volume_per_metre: float
    top_leaf: NDArray[np.int64]  # (tops,) first row of leaf_sun; -1: no leaves; NO_SHADOW: the backdrop


class SurfaceTable(NamedTuple):
    """Vertices and faces of all meshes, concatenated; a mesh's faces start at row ``HitTable.mesh_face``."""

    vertex: Float32Array  # (v, 6) unit normal in the object's frame, uv in repeats, LightTable.vertex_near
    face: IntArray  # (f, 4) rows of its three vertices and of its material, in the order of ``World.materials``
    face_repeat: Float32Array  # (f,) [m] covered by one repeat of the texture
    top_rotation: Float32Array  # (tops, 3, 3) world from object, without scale
    top_tint: Float32Array  # (tops, 3)
    top_base: Float32Array  # (tops,) height [m] of the origin


class MaterialTable(NamedTuple):
    """Colours: rows by material, and the ground's colour and material on grids."""

    atlas: Atlas
    texture: IntArray  # (materials,) row of the atlas
    tint: Float32Array  # (materials, 3)
    through: Float32Array  # (materials, 3) light from behind over light from the front; 0 except for leaves
    gloss: Float32Array
    mirror: Float32Array
    repeat: Float32Array  # (materials,) [m] per repeat, used for the ground
    age: Float32Array  # (materials, 3) furrows [m], weathering and patches, see `Material`
    relief: Float32Array  # (materials,) [m] height of the texture's relief
    patch: Float32Array  # (materials,) [m] side of patches of the ground that show different parts of the texture
    seen: Float32Array  # (materials, 2, TERMS) see relief_views: brightness of distant relief by direction
    land: Mask  # (materials,) whether it is ground, which beyond the edge continues the world's
    steep: IntArray  # (materials,) row of the atlas for steep land; -1: none
    wetness: float  # 0 to 1
    ground: Float32Array  # (nx, ny, 5) linear colour off trails, height [m] without relief, factor on trails' colour
    ground_material: NDArray[np.uint8]  # (mx, my) row of the material whose texture is used
    surface: Grid  # heights [m] of the ground
    corner: tuple[float, float]  # [m] x and y of the first node of ground and ground_material
    per_metre_rgb: float
    per_metre_material: float
    trail: int  # rows of materials
    border: int
    border_width: float


class SnowTable(NamedTuple):
    """Snow of a world: the share of the ground that it hides, and how much lies on what faces up, 0 to 1."""

    ground: Grid
    on_top: np.float32


class AirTable(NamedTuple):
    """The air between surfaces and cameras. Extinction coefficients (3,) [1/m] are those of red, green and blue."""

    clear: Float32Array  # of air without weather, up to the sky, whose radiance includes it
    even: Float32Array  # of rain, snow and dust, and of fog that is as dense at every height
    fog: Float32Array  # of fog that thins with height, where it is densest
    fog_scale: np.float32  # [m] height over which it does; 0 without
    ground: np.float32  # [m] height where it is densest: the lowest ground
    light: Float32Array  # (n + 1, 3) radiance by azimuth, see air.azimuth_of
    has_weather: bool


class WireTable(NamedTuple):
    """Wires as chains of segments in the world frame, whose width photographs compute instead of sampling it."""

    start: Array  # (s, 3) [m] ends of the segments of all wires
    end: Array  # (s, 3)
    tangent: Array  # (s, 2, 3) [m] of the wire at both ends, the same for the two segments that meet there
    first: IntArray  # (w + 1,) first segment of each wire, and the number of segments
    ball: Array  # (w, 4) centre and radius [m] of a ball around each wire
    top: IntArray  # (w,) row of the top-level geometry
    albedo: Float32Array  # (w, 3) linear
    radius: Float32Array  # (tops,) [m] of each top-level geometry; 0: no wire


class Shading(NamedTuple):
    """All that a photograph needs of a scene."""

    scene: np.uint64  # handle of the Embree scene
    hits: HitTable
    surfaces: SurfaceTable
    materials: MaterialTable
    light: LightTable
    wires: WireTable
    has_water: bool
    exposure: np.float32  # relative to an open meadow
    air: AirTable
    snow: SnowTable
    has_snow: bool

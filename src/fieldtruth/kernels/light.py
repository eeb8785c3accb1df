# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tables that shading reads, made once per scene, and the light that reaches a point: of sun, sky and air.

``render.light`` says what the coefficients of the light volume are and fills it. Air scatters light out of a ray, and
its own light into it: along a path of optical depth tau the radiance L becomes L exp(-tau) + A (1 - exp(-tau))
(Koschmieder 1924); ``render.air`` says what A is.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.kernels.between_nodes import cell_of
from fieldtruth.kernels.camera_rays import RayBatch
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.packets import Grid, HitTable, IntArray, SceneRays
from fieldtruth.kernels.textures import Atlas


class Dome(NamedTuple):
    """Radiance ``rgb`` (n, n, 3) of the upper half of the sky without the sun's disc.

    It is a paraboloid map (Heidrich and Seidel 1998): the direction (x, y, z) is at row x / (1 + z) and column
    y / (1 + z), both from -1 to 1, so that a lookup needs no angle.
    """

    rgb: Float32Array
    mean: Float32Array  # (3,) irradiance of level ground, divided by pi
    horizon: Float32Array  # (3,) radiance near the horizon, the colour of haze


@kernel
def sky_radiance(g: Float32Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Radiance of a dome's image ``g`` in a unit direction; below the horizon, the horizon's."""
    half, one = np.float32(0.5 * g.shape[0]), np.float32(1.0)
    flat = max(np.float32(z), np.float32(0.0))
    scale = half * np.float32(0.998) / (flat + np.sqrt(x * x + y * y + flat * flat))
    u, v = half - np.float32(0.5) + x * scale, half - np.float32(0.5) + y * scale
    i, j = int(u), int(v)
    fu, fv = u - np.float32(i), v - np.float32(j)
    a, b, c, d = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
    return (
        g[i, j, 0] * a + g[i, j + 1, 0] * b + g[i + 1, j, 0] * c + g[i + 1, j + 1, 0] * d,
        g[i, j, 1] * a + g[i, j + 1, 1] * b + g[i + 1, j, 1] * c + g[i + 1, j + 1, 1] * d,
        g[i, j, 2] * a + g[i, j + 1, 2] * b + g[i + 1, j, 2] * c + g[i + 1, j + 1, 2] * d,
    )


TEXEL: Final = 0.04  # [m]
OFFSET: Final = np.float32(0.5 * TEXEL)
"""[m] in front of a surface where its share is read, so that its own roughness does not shade it."""
_LEAST_FACING: Final = np.float32(0.2)  # cosine to the sun; surfaces that face it less have nearly no light of it
_TAPS: Final = 4
_TURN = 0.3 + 2.0 * np.pi * np.arange(_TAPS) / _TAPS
_TAP: Final = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=-1).astype(np.float32)
Vector = tuple[np.float32, np.float32, np.float32]


class SunMap(NamedTuple):
    """The map, and where it lies; without texels where the sun is below the horizon."""

    depth: Float32Array  # (nu, nv) [m] along the direction to the sun, of the first surface that it meets
    axes: Float32Array  # (3, 3) unit vectors along u, along v and to the sun
    corner: tuple[float, float]  # [m] of the first texel's centre along u and v
    per_metre: float


@inlined
def _texel(depth: Float32Array, i: np.uintp, j: np.uintp, own: np.float32) -> tuple[np.float32, np.float32]:
    """1 and 0 if a point of depth ``own`` sees the sun past a texel; if not, 0 and how far away what hides it is."""
    away = depth[i, j] - own
    hidden = away > np.float32(0.0)
    return np.float32(0.0 if hidden else 1.0), away if hidden else np.float32(0.0)


@inlined
def sun_share(sun_map: SunMap, point: Vector, normal: Vector, spread: np.float32) -> tuple[np.float32, np.float32]:
    """Share of the sun that a surface sees at a point [m], and how far away what hides it is.

    It is the mean over a circle of radius ``spread`` [m], in which the surface is the plane through the point with
    this unit normal, which faces the sun. The share is -1 outside the map.
    """
    axes, depth, per = sun_map.axes, sun_map.depth, np.float32(sun_map.per_metre)
    zero, one, texel = np.float32(0.0), np.float32(1.0), np.float32(1.0) / per
    x, y, z = point[0] + OFFSET * normal[0], point[1] + OFFSET * normal[1], point[2] + OFFSET * normal[2]
    u = (axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z - np.float32(sun_map.corner[0])) * per
    v = (axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z - np.float32(sun_map.corner[1])) * per
    radius, last_u, last_v = spread * per, np.float32(depth.shape[0] - 2), np.float32(depth.shape[1] - 2)
    if min(u, v) < radius or u > last_u - radius or v > last_v - radius:
        return -one, zero
    own = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
    facing = axes[2, 0] * normal[0] + axes[2, 1] * normal[1] + axes[2, 2] * normal[2]
    per_facing = -texel / max(facing, _LEAST_FACING)
    along_u = (axes[0, 0] * normal[0] + axes[0, 1] * normal[1] + axes[0, 2] * normal[2]) * per_facing
    along_v = (axes[1, 0] * normal[0] + axes[1, 1] * normal[1] + axes[1, 2] * normal[2]) * per_facing
    share, away = zero, zero
    for tap in range(_TAPS):
        a, b = u + radius * _TAP[tap, 0], v + radius * _TAP[tap, 1]
        i, j = int(a), int(b)
        fu, fv = a - np.float32(i), b - np.float32(j)
        row, column, next_one = np.uintp(i), np.uintp(j), np.uintp(1)
        d00 = own + (np.float32(i) - u) * along_u + (np.float32(j) - v) * along_v
        s00, a00 = _texel(depth, row, column, d00)
        s01, a01 = _texel(depth, row, column + next_one, d00 + along_v)
        s10, a10 = _texel(depth, row + next_one, column, d00 + along_u)
        s11, a11 = _texel(depth, row + next_one, column + next_one, d00 + along_u + along_v)
        low, high = s00 + (s01 - s00) * fv, s10 + (s11 - s10) * fv
        share += low + (high - low) * fu
        away = max(away, max(max(a00, a01), max(a10, a11)))
    return share * np.float32(1.0 / _TAPS), away


SHADOW_RANGE: Final = 80.0  # [m]; occluders farther away cast no shadow
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
    volume: Float32Array  # (nx, ny, nz, 16) probes of the light in the air, see ``render.light``
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
    seen: Float32Array  # (materials, 2, TERMS) see render.materials: brightness of distant relief by direction
    land: Mask  # (materials,) whether it is ground, which beyond the edge continues the world's
    steep: IntArray  # (materials,) row of the atlas for steep land; -1: none
    wetness: float  # 0 to 1
    ground: Float32Array  # (nx, ny, 5) linear colour off trails, height [m] without relief, factor on trails' colour
    ground_material: NDArray[np.uint8]  # (mx, my) row of the material whose texture is used
    surface: Grid  # heights [m] of the ground
    corner: tuple[float, float]  # [m] x and y of the first node of ground and ground_material
    per_metre_rgb: float
    per_metre_material: float
    trail: int  # rows of materials; -1: the cover has that of trails, too
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
    light: Float32Array  # (n + 1, 3) radiance by azimuth, see azimuth_of
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


class RobotTable(NamedTuple):
    """The visible robot that carries the camera, as it hides the sun from the world; without ``parts``, none."""

    parts: Array  # (p, 7) as ``kernels.robot`` takes them, in base_link
    base_from_optical: Array  # (4, 4)
    ball: Array  # (4,) centre and radius [m] of a ball around all parts
    disc: Array  # (n, 3) unit directions to points of the sun's disc in the world frame, from its rim inwards


class Shading(NamedTuple):
    """All that a photograph needs of a scene."""

    scene: SceneRays
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
    robot: RobotTable
    # (n, 5) of water: wave vector x, y [rad/m], slope, phase, share of its variance that tilts pixels that it is below
    ripples: Float32Array


READ: Final = 15
"""Coefficients that are read: 4 of each channel, then one of each for what faces up."""
_PER_LAYER: Final = np.float32(1.0 / AIR_LAYER)
_BASE: Final = np.float32(AIR_BASE)


@inlined
def read_probes(
    volume: Float32Array, base: Float32Array, u: np.float32, v: np.float32, z: np.float32, out: Float32Array
) -> None:
    """Trilinear coefficients at node u, v of the volume and height z [m], into ``out`` (READ,)."""
    zero, one, end, next_one = np.float32(0.0), np.float32(1.0), np.float32(1.001), np.uintp(1)
    i, j, fu, fv = cell_of(volume.shape[0], volume.shape[1], u, v)
    i1, j1 = i + next_one, j + next_one
    a, b, c, d = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
    ground = base[i, j] * a + base[i, j1] * b + base[i1, j] * c + base[i1, j1] * d
    w = min(max((z - ground - _BASE) * _PER_LAYER, zero), np.float32(volume.shape[2]) - end)
    layer = int(w)
    fw = w - np.float32(layer)
    k, low = np.uintp(layer), one - fw
    k1 = k + next_one
    a0, b0, c0, d0 = a * low, b * low, c * low, d * low
    a1, b1, c1, d1 = a * fw, b * fw, c * fw, d * fw
    for n in range(READ):
        out[n] = (
            volume[i, j, k, n] * a0 + volume[i, j, k1, n] * a1 + volume[i, j1, k, n] * b0 + volume[i, j1, k1, n] * b1
            + volume[i1, j, k, n] * c0 + volume[i1, j, k1, n] * c1
            + volume[i1, j1, k, n] * d0 + volume[i1, j1, k1, n] * d1
        )  # fmt: skip


@inlined
def read_lowest(volume: Float32Array, u: np.float32, v: np.float32, out: Float32Array) -> None:
    """Bilinear coefficients at node u, v of the lowest layer, into ``out`` (READ,)."""
    one, next_one, k = np.float32(1.0), np.uintp(1), np.uintp(0)
    i, j, fu, fv = cell_of(volume.shape[0], volume.shape[1], u, v)
    i1, j1 = i + next_one, j + next_one
    a, b, c, d = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
    for n in range(READ):
        out[n] = volume[i, j, k, n] * a + volume[i, j1, k, n] * b + volume[i1, j, k, n] * c + volume[i1, j1, k, n] * d


@inlined
def falling_on(probe: Float32Array, channel: int, nx: np.float32, ny: np.float32, nz: np.float32) -> np.float32:
    """Irradiance over pi on a surface with this normal: two bands, and what they lack on a level surface."""
    at, up = 4 * channel, max(nz, np.float32(0.0))
    value = probe[at] + probe[at + 1] * nx + probe[at + 2] * ny + probe[at + 3] * nz + probe[12 + channel] * up * up
    return max(value, np.float32(0.0))


@inlined
def among(open_share: np.float32, reflectance: np.float32) -> np.float32:
    """Share of the light from afar at a point of which ``open_share`` of the directions are open.

    The others end on near surfaces, which are as bright as this one: with the reflectance r and the share s of the
    light L, the surface has the irradiance s L + (1 - s) r E = E.
    """
    one = np.float32(1.0)
    return open_share / (one - reflectance * (one - open_share))


RADIUS_DEG: Final = 0.266
"""Of the sun's disc, at its mean distance."""
RADIUS: Final = float(np.radians(RADIUS_DEG))
LIMB: Final = 0.6
"""Radiance falls by this share from the middle of the disc to its limb (linear law; Cox 2000, section 14.7)."""
DISC: Final = 1.0 / (np.pi * RADIUS**2 * (1.0 - LIMB / 3.0))
"""[1/sr] Radiance in the middle of the disc over the irradiance of a surface that faces it."""
GLITTER_WIDTH: Final = float(np.radians(1.6))
"""Standard deviation to which ripples that are smaller than a pixel spread the sun's reflection."""


@kernel
def add_disc(light: LightTable, exposure: np.float32, batch: RayBatch, count: int, colour: Float32Array) -> None:
    """Add the disc, whose centre has the radiance ``light.disc``, to rays that leave the world."""
    top, direction, disc = batch.top, batch.direction, light.disc
    sx, sy, sz = np.float32(light.sun[0]), np.float32(light.sun[1]), np.float32(light.sun[2])
    widest, one, scale = np.float32(RADIUS * RADIUS), np.float32(1.0), np.float32(EXPOSURE) * exposure
    if disc[0] <= np.float32(0.0):
        return
    for k in range(count):
        if top[k] >= 0:
            continue
        x, y, z = direction[0, k] - sx, direction[1, k] - sy, direction[2, k] - sz
        squared = x * x + y * y + z * z
        if squared < widest and direction[2, k] > np.float32(0.0):
            radiance = scale * (one - np.float32(LIMB) * (one - np.sqrt(one - squared / widest)))
            for channel in range(3):
                colour[k, channel] += radiance * disc[channel]


@kernel
def add_glitter(light: LightTable, exposure: np.float32, batch: RayBatch, count: int, colour: Float32Array) -> None:
    """Add the sun, as wide as ripples spread it, to reflected rays that leave the world."""
    top, direction, disc = batch.top, batch.direction, light.disc
    sx, sy, sz = np.float32(light.sun[0]), np.float32(light.sun[1]), np.float32(light.sun[2])
    variance, farthest = np.float32(GLITTER_WIDTH**2), np.float32((4.0 * GLITTER_WIDTH) ** 2)
    scale = np.float32(EXPOSURE / (2.0 * np.pi * GLITTER_WIDTH**2 * DISC)) * exposure
    for k in range(count):
        if top[k] >= 0:
            continue
        x, y, z = direction[0, k] - sx, direction[1, k] - sy, direction[2, k] - sz
        squared = x * x + y * y + z * z
        if squared < farthest:
            share = scale * np.exp(np.float32(-0.5) * squared / variance)
            for channel in range(3):
                colour[k, channel] += share * disc[channel]


@inlined
def fog_length(above: float, rise: float, length: float, scale: float) -> float:
    """Length [m] of a path in the densest fog with the same extinction, for cameras and LiDARs.

    The path begins ``above`` [m] the densest fog, is ``length`` [m] long and ends ``rise`` [m] higher. It is the
    integral of exp(-height / scale) along it; a ``scale`` of 0 is that of fog which is as dense at every height.
    """
    if scale == 0.0:
        return length
    low, high = above / scale, (above + rise) / scale
    x = high - low
    if abs(x) < 0.02:
        return length * np.exp(-low) * (1.0 - x * (0.5 - x / 6.0))  # type: ignore[no-any-return]
    return length * (np.exp(-low) - np.exp(-high)) / x  # type: ignore[no-any-return]


LAYER: Final = 1000.0
"""[m] up to which the weather reaches: a ray to the sky at elevation e is in it for LAYER / sin(e)."""
AZIMUTHS: Final = 64


@inlined
def azimuth_of(x: float, y: float) -> float:
    """Azimuth of a direction on a scale from 0 to 4 that needs no arc tangent: the four quarters of |x| + |y| = 1."""
    along = y / (abs(x) + abs(y) + np.float32(1e-9))
    if x < np.float32(0.0):
        return np.float32(2.0) - along  # type: ignore[return-value]
    return along if along >= np.float32(0.0) else np.float32(4.0) + along  # type: ignore[return-value]


@kernel(inner=True)
def dim(shading: Shading, batch: RayBatch, count: int, colour: Float32Array) -> None:
    """Change the exposed colours (n, 3) of traced rays as the air does; those for which the lens has no ray stay."""
    top, direction, distance, air, one = batch.top, batch.direction, batch.distance, shading.air, np.float32(1.0)
    scale = np.float32(EXPOSURE)  # as much less is scattered as falls, whatever the exposure
    half, sixth, thin = np.float32(0.5), np.float32(1.0 / 6.0), np.float32(0.1)
    unseen = np.float32(1e-3)  # a depth that changes no byte by more than one
    per_azimuth = np.float32(AZIMUTHS / 4)
    for k in range(count):
        dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
        length, clear = distance[k], one
        if top[k] < 0:
            if not air.has_weather or dx * dx + dy * dy + dz * dz < np.float32(0.5):
                continue
            length, clear = np.float32(LAYER) / max(dz, np.float32(1e-4)), np.float32(0.0)
        elif not air.has_weather and air.clear[2] * length < unseen:
            continue
        thick = np.float32(0.0)
        if air.fog_scale > np.float32(0.0):
            above = batch.point[2, k] - distance[k] * dz - air.ground
            thick = np.float32(fog_length(above, max(length * dz, -above), length, air.fog_scale))  # type: ignore[arg-type]
        at = azimuth_of(dx, dy) * per_azimuth
        row = min(int(at), AZIMUTHS - 1)
        share = at - np.float32(row)
        for channel in range(3):
            depth = (clear * air.clear[channel] + air.even[channel]) * length + air.fog[channel] * thick
            # 1 - exp(-depth): where that is little, by its first terms.
            taken = depth * (one - depth * (half - depth * sixth)) if depth < thin else one - np.exp(-depth)
            glow = air.light[row, channel] + share * (air.light[row + 1, channel] - air.light[row, channel])
            colour[k, channel] += taken * (scale * glow - colour[k, channel])


@inlined
def air_along(
    air: AirTable,
    ray: tuple[float, float, float],
    start: float,
    distance: float,
    left: Float32Array,
    glow: Float32Array,
) -> None:
    """Share ``left`` (3,) of light after a distance from a height ``start`` [m] along a ray, and the air's light."""
    thick = 0.0
    if air.fog_scale > 0.0:
        above = start - float(air.ground)
        thick = fog_length(above, max(distance * ray[2], -above), distance, float(air.fog_scale))
    at = azimuth_of(ray[0], ray[1]) * (AZIMUTHS / 4)
    row = min(int(at), AZIMUTHS - 1)
    for channel in range(3):
        depth = (air.clear[channel] + air.even[channel]) * distance + air.fog[channel] * thick
        left[channel] = np.exp(-depth)
        glow[channel] = air.light[row, channel] + (at - row) * (air.light[row + 1, channel] - air.light[row, channel])

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What beams meet: range, class and instance id as the ideal LiDAR finds them, and how bright the surface looks."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.sense import embree
from fieldtruth.sense.hits import TERRAIN, Grid, HitTable, hit_top, read_grid
from fieldtruth.sense.packets import Packet, set_ray
from fieldtruth.sense.scene import Scene, grid_of
from fieldtruth.sensors.lidar.reflectance import reflectance_of
from fieldtruth.sensors.lidar.sensing import Beams, aim_tile, aimed, entry
from fieldtruth.sensors.lidar.snow import below_snow, ground_below_snow, snow_on_trails
from fieldtruth.world.model import Raster, World

_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.LANES // 4, 4
_OX, _OY, _OZ, _DX, _DY, _DZ = embree.ORG_X, embree.ORG_Y, embree.ORG_Z, embree.DIR_X, embree.DIR_Y, embree.DIR_Z
_FAR, _PRIM, _GEOM, _INST, _INST_PRIM = embree.TFAR, embree.PRIM_ID, embree.GEOM_ID, embree.INST_ID, embree.INST_PRIM_ID
_NX, _NY, _NZ = embree.NG_X, embree.NG_Y, embree.NG_Z
_MISS = np.uint32(embree.MISS)
_GROUND, _TRAIL = int(Label.GROUND), int(Label.TRAIL)
_intersect: Any = embree.intersect


class SurfaceTable(NamedTuple):
    """Reflectance of every triangle and of the ground."""

    face_material: NDArray[np.uint16]  # (faces of all meshes,) row of ``material``; a mesh starts at HitTable.mesh_face
    material: Float32Array  # (materials, 3) columns of a Reflectance
    top_rotation: Float32Array  # (tops, 3, 3) world from object, without scale
    ground: Grid  # reflectance off the trails
    trail: float
    border: float
    border_width: float  # [m] inwards from a trail's edge


class EchoBuffers(NamedTuple):
    """Echoes of each beam, (echoes, columns, rings), the nearest first; the beam's own range is (columns, rings)."""

    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    depth: Float32Array  # [m] range, 0 without an echo
    apparent: Float32Array  # reflectance of a matt surface that faces the LiDAR, fills the beam and is as bright
    mixed: Mask  # whether surfaces of more than one class or object made it
    clear: Float32Array  # [m] up to which nothing is in the middle of the beam
    true_range: Float32Array  # [m] of what the middle of the beam meets, 0 if that returns nothing


def echo_buffers(echoes: int, columns: int, rings: int) -> EchoBuffers:
    """Return empty buffers."""
    shape = (echoes, columns, rings)
    return EchoBuffers(
        label=np.zeros(shape, np.uint8),
        instance=np.zeros(shape, np.uint32),
        depth=np.zeros(shape, np.float32),
        apparent=np.zeros(shape, np.float32),
        mixed=np.zeros(shape, np.bool_),
        clear=np.zeros(shape[1:], np.float32),
        true_range=np.zeros(shape[1:], np.float32),
    )


def surface_table(scene: Scene) -> SurfaceTable:
    """Reflectances of a scene's surfaces, in the order of its ``hits``."""
    world = scene.world
    rows = {name: row for row, name in enumerate(world.materials)}
    faces = [np.array([rows[n] for n in mesh.materials], np.uint16)[mesh.material] for mesh in scene.meshes]
    rotation = np.array([top.world_from_object[:3, :3] for top in scene.tops])
    terrain, on_trail = world.terrain, snow_on_trails(world.terrain)
    return SurfaceTable(
        face_material=np.concatenate([*faces, np.zeros(0, np.uint16)]),
        material=np.array([reflectance_of(material) for material in world.materials.values()], np.float32),
        top_rotation=(rotation / np.linalg.norm(rotation[:, :, :1], axis=1, keepdims=True)).astype(np.float32),
        ground=_ground(world),
        trail=below_snow(reflectance_of(world.materials[terrain.trail_material]).value, on_trail),
        border=below_snow(reflectance_of(world.materials[terrain.border_material]).value, on_trail),
        border_width=terrain.border_width,
    )


def _ground(world: World) -> Grid:
    """Mean reflectance of the materials of the ground by their weights."""
    cover = world.terrain.cover
    values = [reflectance_of(world.materials[name]).value for name in world.terrain.ground_materials]
    weights = cover.values / np.maximum(cover.values.sum(axis=-1, keepdims=True), 1e-6)
    mixed = (weights @ np.array(values)).astype(np.float32)
    bare = Raster(values=mixed, spacing=cover.spacing, x0=cover.x0, y0=cover.y0)
    return grid_of(ground_below_snow(bare, world.terrain))


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
) -> tuple[int, int, float, float, float]:
    """Class and instance id, as ``classify``, and the three columns of the reflectance of a hit at world x, y [m]."""
    if top == TERRAIN:
        inside = read_grid(hits.trail_distance, x, y)
        if inside >= 0.0:
            return _GROUND, GROUND_ID, read_grid(surfaces.ground, x, y), 0.0, 1.0
        value = surfaces.border if inside > -surfaces.border_width else surfaces.trail
        return _TRAIL, GROUND_ID, value, 0.0, 1.0
    face = hits.mesh_face[hits.top_mesh[top]] + primitive
    row = surfaces.face_material[face]
    material = surfaces.material
    label, instance = np.int64(hits.face_label[face]), np.int64(hits.top_object[top])
    return label, instance, material[row, 0], material[row, 1], material[row, 2]  # type: ignore[return-value]


@kernel
def trace_surfaces(
    scene: np.uint64,
    tables: tuple[HitTable, SurfaceTable],
    packet: Packet,
    poses: Array,
    beams: Beams,
    out: EchoBuffers,
) -> None:
    """Trace all rays as ``sensing.trace_beams`` does, with the same ranges, labels and ids to the last bit.

    The only echo of a beam is that of its middle.
    """
    hits, surfaces = tables
    label, instance, distance, apparent, _, clear, true_range = out
    _, lag, min_range, max_range, returns = beams
    ray, words, valid, arguments = packet
    tops, rotations = hits.geometry_top, surfaces.top_rotation
    columns, rings = true_range.shape
    for lane in range(_LANES):
        set_ray(packet, lane, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, max_range)
    for first_column in range(0, columns, _WIDTH):
        for first_ring in range(0, rings, _HEIGHT):
            aim_tile(packet, poses, beams, first_column, first_ring)
            _intersect(valid.ctypes, scene, ray.ctypes, arguments.ctypes)
            for lane in range(_LANES):
                if valid[lane] == 0:
                    continue
                column, ring = first_column + lane % _WIDTH, first_ring + lane // _WIDTH
                distance[0, column, ring] = true_range[column, ring] = 0.0
                top = hit_top(tops, words, lane)
                clear[column, ring] = range_m = ray[_FAR + lane]
                if top < 0 or range_m < min_range:
                    continue
                share = lag[ring]
                dx, dy, _ = aimed(poses, column, share, beams, ring)
                x = entry(poses, column, share, 0, 3) + range_m * dx
                y = entry(poses, column, share, 1, 3) + range_m * dy
                class_id, object_id, value, gloss, exponent = surface_of(hits, surfaces, top, words[_PRIM + lane], x, y)
                if returns[class_id]:
                    distance[0, column, ring] = true_range[column, ring] = range_m
                    label[0, column, ring], instance[0, column, ring] = class_id, object_id
                    cosine = cosine_of(rotations, ray, lane, top)
                    apparent[0, column, ring] = brightness(value, gloss, exponent, cosine)

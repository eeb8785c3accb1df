# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What beams meet: range, class and instance id as the ideal LiDAR finds them, and how bright the surface looks."""

import numpy as np

from fieldtruth.kernels.lidar import EchoBuffers, SurfaceTable
from fieldtruth.kernels.packets import Grid
from fieldtruth.sense.scene import Scene, grid_of
from fieldtruth.sensors.lidar.reflectance import reflectance_of
from fieldtruth.sensors.lidar.snow import below_snow, ground_below_snow, snow_on_trails
from fieldtruth.world.model import Raster, World


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

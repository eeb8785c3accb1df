# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ray-tracing scene that all sensors share: the world in Embree, and the classes of its hits."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.kernels.packets import CLEAR, MISS, SOLID, THIN, Grid, HitTable
from fieldtruth.sense.embree import Engine, RayScene
from fieldtruth.sense.parts import parts_of
from fieldtruth.world.model import Heightfield, Mesh, Raster, World

_NO_TINT: Final = (1.0, 1.0, 1.0)


def terrain_nodes(field: Heightfield) -> Float32Array:
    """Nodes (nx, ny, 3) [m] of a heightfield."""
    nx, ny = field.heights.shape
    nodes = np.empty((nx, ny, 3), np.float32)
    nodes[..., 0] = (field.x0 + field.spacing * np.arange(nx))[:, None]
    nodes[..., 1] = field.y0 + field.spacing * np.arange(ny)
    nodes[..., 2] = field.heights
    return nodes


def grid_of(raster: Raster | Heightfield) -> Grid:
    """Convert a raster of one channel, or heights, to the form that kernels take."""
    values = raster.heights if isinstance(raster, Heightfield) else raster.values
    return Grid(np.ascontiguousarray(values, np.float32), raster.x0, raster.y0, 1.0 / raster.spacing)


class TopLevel(NamedTuple):
    """A geometry at the top level of the Embree scene: terrain (mesh None), or a mesh at a pose."""

    mesh: Mesh | None
    world_from_object: Array
    object_id: int
    tint: tuple[float, float, float]  # colour factors


class Scene:
    """A world in the ray tracer. Threads may share it: it does not change after construction.

    ``rays`` is the Embree scene, in which an object is one geometry or two; ``hits`` gives the row of ``tops``
    that a geometry belongs to, and class and instance id of a hit.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.engine = Engine()
        self.meshes = [*world.meshes.values(), *([world.backdrop] if world.backdrop is not None else [])]
        self.tops = list(_top_levels(world))
        self.rays = RayScene(self.engine)
        parts = {mesh.name: [self.mesh_rays(mesh, part) for part in parts_of(mesh)] for mesh in self.meshes}
        masks = {mesh.name: _mask(world, mesh) for mesh in self.meshes}
        geometry_top = []
        for row, (mesh, pose, *_) in enumerate(self.tops):
            if mesh is None:
                self.rays.add_grid(terrain_nodes(world.terrain.surface))
                geometry_top.append(row)
                continue
            for part in parts[mesh.name]:
                self.rays.add_instance(part, pose, mask=masks[mesh.name])
                geometry_top.append(row)
        self.rays.commit()
        self.hits = _hit_table(world, self.meshes, self.tops, geometry_top)

    def mesh_rays(self, mesh: Mesh, part: Mask | None = None) -> RayScene:
        """Build the Embree scene of a mesh in its own frame, of all faces or of a part (f,) of them."""
        scene = RayScene(self.engine)
        faces = mesh.faces.astype(np.uint32)
        if part is not None:
            faces[~part] = MISS
        scene.add_mesh(mesh.vertices, faces)
        return scene.commit()


def _mask(world: World, mesh: Mesh) -> int:
    if any(world.materials[name].mirror > 0 for name in mesh.materials):
        return CLEAR
    return SOLID if mesh.axis is None else THIN


def _top_levels(world: World) -> Iterator[TopLevel]:
    for mesh in (None, *([world.backdrop] if world.backdrop is not None else [])):
        yield TopLevel(mesh, np.eye(4), GROUND_ID, _NO_TINT)
    for instance in world.instances:
        yield TopLevel(world.meshes[instance.mesh], instance.world_from_object, instance.object_id, instance.tint)
    for swarm in world.swarms:
        meshes = [world.meshes[name] for name in swarm.meshes]
        for row, pose, tint in zip(swarm.mesh.tolist(), swarm.world_from_object, swarm.tint.tolist(), strict=True):
            yield TopLevel(meshes[row], pose, swarm.object_id, tint)


def _hit_table(world: World, meshes: list[Mesh], tops: list[TopLevel], geometry_top: list[int]) -> HitTable:
    """Concatenate classes and instance ids into tables that kernels index."""
    labels = {name: int(material.label) for name, material in world.materials.items()}
    rows = {mesh.name: row for row, mesh in enumerate(meshes)}
    face_labels = [np.array([labels[n] for n in m.materials], np.uint8)[m.material] for m in meshes]
    return HitTable(
        geometry_top=np.array(geometry_top, np.int32),
        top_object=np.array([top.object_id for top in tops], np.uint32),
        top_mesh=np.array([-1 if top.mesh is None else rows[top.mesh.name] for top in tops], np.int32),
        mesh_face=np.cumsum([0, *(len(m.faces) for m in meshes)])[:-1].astype(np.int64),
        face_label=np.concatenate([*face_labels, np.zeros(0, np.uint8)]),
        trail_distance=grid_of(world.terrain.trail_distance),
    )

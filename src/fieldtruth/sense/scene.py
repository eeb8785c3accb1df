# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One ray scene for all sensors: the world's triangles in Embree, and the tables that name what a ray hits."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.sense.embree import CLEAR, SOLID, Engine, RayScene
from fieldtruth.sense.hits import Grid, HitTable
from fieldtruth.world.model import GROUND_ID, Heightfield, Mesh, Raster, World

_PLAIN: Final = (1.0, 1.0, 1.0)


def terrain_triangles(field: Heightfield) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Triangles of a heightfield: vertices (nx * ny, 3) [m] and faces (2 * (nx - 1) * (ny - 1), 3), facing up."""
    nx, ny = field.heights.shape
    x = field.x0 + field.spacing * np.arange(nx)
    y = field.y0 + field.spacing * np.arange(ny)
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), field.heights], axis=-1).reshape(-1, 3)
    a = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    b, c, d = a + ny, a + ny + 1, a + 1  # (i + 1, j), (i + 1, j + 1), (i, j + 1)
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return vertices.astype(np.float32), faces.astype(np.int32)


def grid_of(raster: Raster) -> Grid:
    """Return a one-channel raster as kernels take it."""
    return Grid(np.ascontiguousarray(raster.values, np.float32), raster.x0, raster.y0, 1.0 / raster.spacing)


class Scene:
    """A world in the ray tracer. Threads may share it: it does not change after construction.

    ``rays`` is the Embree scene; ``hits`` are the tables that give class and instance id of a hit.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.engine = Engine()
        self.meshes = [*world.meshes.values(), *([world.backdrop] if world.backdrop is not None else [])]
        rows = {mesh.name: row for row, mesh in enumerate(self.meshes)}
        self.mesh_rays = [self._committed(mesh) for mesh in self.meshes]
        self.rays = RayScene(self.engine)
        self.tops: list[tuple[int, Mesh | None, NDArray[np.float64]]] = []
        """Everything at the top level: its row, its mesh (None for the terrain) and its world_from_object."""
        self.tints: list[tuple[float, float, float]] = []
        """Colour factors of everything at the top level."""
        objects = [GROUND_ID]
        self._add(self.rays.add_mesh(*terrain_triangles(world.terrain.field)), None, np.eye(4))
        if world.backdrop is not None:
            self._add(self.rays.add_mesh(world.backdrop.vertices, world.backdrop.faces), world.backdrop, np.eye(4))
            objects.append(GROUND_ID)
        for instance in world.instances:
            mesh, pose = world.meshes[instance.mesh], instance.world_from_object
            clear = any(world.materials[name].mirror > 0 for name in mesh.materials)
            top = self.rays.add_instance(self.mesh_rays[rows[mesh.name]], pose, mask=CLEAR if clear else SOLID)
            self._add(top, mesh, pose, instance.tint)
            objects.append(instance.object_id)
        for swarm in world.swarms:
            own = [world.meshes[name] for name in swarm.meshes]
            for row, pose, tint in zip(swarm.mesh.tolist(), swarm.world_from_object, swarm.tint.tolist(), strict=True):
                mesh = own[row]
                self._add(self.rays.add_instance(self.mesh_rays[rows[mesh.name]], pose), mesh, pose, tint)
                objects.append(swarm.object_id)
        self.rays.commit()
        self.hits = _hit_table(world, self.meshes, self.tops, objects)

    def _add(
        self, row: int, mesh: Mesh | None, pose: NDArray[np.float64], tint: tuple[float, float, float] = _PLAIN
    ) -> None:
        if row != len(self.tops):
            raise AssertionError(f"Embree numbered a thing {row} instead of {len(self.tops)}")
        self.tops.append((row, mesh, pose))
        self.tints.append(tint)

    def _committed(self, mesh: Mesh) -> RayScene:
        scene = RayScene(self.engine)
        scene.add_mesh(mesh.vertices, mesh.faces)
        return scene.commit()


def _hit_table(
    world: World, meshes: list[Mesh], tops: list[tuple[int, Mesh | None, NDArray[np.float64]]], objects: list[int]
) -> HitTable:
    """Concatenate what names a hit into tables that kernels index."""
    labels = {name: int(material.label) for name, material in world.materials.items()}
    rows = {mesh.name: row for row, mesh in enumerate(meshes)}
    face_labels = [np.array([labels[n] for n in m.materials], np.uint8)[m.material] for m in meshes]
    return HitTable(
        top_object=np.array(objects, np.uint16),
        top_mesh=np.array([-1 if mesh is None else rows[mesh.name] for _, mesh, _ in tops], np.int32),
        mesh_face=np.cumsum([0, *(len(m.faces) for m in meshes)])[:-1].astype(np.int64),
        face_label=np.concatenate([*face_labels, np.zeros(0, np.uint8)]),
        trail_distance=grid_of(world.terrain.trail_distance),
    )

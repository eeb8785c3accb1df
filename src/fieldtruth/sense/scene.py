# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One ray scene for all sensors: the world's triangles in Embree, and the tables that name what a ray hits."""

from threading import Lock
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.experiment.config import LightConfig
from fieldtruth.sense.embree import Engine, RayScene
from fieldtruth.sense.hits import Grid, HitTable
from fieldtruth.world.model import GROUND_ID, Heightfield, Mesh, Raster, World

if TYPE_CHECKING:
    from fieldtruth.sense.studio import Studio


class SurfaceTable(NamedTuple):
    """Geometry of all meshes, one behind the other, for kernels that paint: rows by vertex, face and thing."""

    vertex_normal: NDArray[np.float32]  # (v, 3) unit, in the object's frame
    vertex_uv: NDArray[np.float32]  # (v, 2) repeats of the texture
    face_vertices: NDArray[np.int32]  # (f, 3) rows by vertex
    face_material: NDArray[np.int32]  # (f,) row of the world's materials, in the order of ``World.materials``
    face_repeat: NDArray[np.float32]  # (f,) [m] that one repeat of the texture covers
    top_rotation: NDArray[np.float32]  # (tops, 3, 3) world from object, without scale
    top_tint: NDArray[np.float32]  # (tops, 3)
    mesh_vertex: NDArray[np.int64]  # (meshes + 1,) first row by vertex


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
    """A world that can be looked at. Threads share it: after construction it is only read.

    ``rays`` is the Embree scene, ``hits`` names what was hit, ``surfaces`` says how it lies; ``light`` serves cameras.
    """

    def __init__(self, world: World, light: LightConfig | None = None) -> None:
        self.world = world
        self.light = light if light is not None else LightConfig()
        self._lock = Lock()
        self._studio: Studio | None = None
        self.engine = Engine()
        meshes = list(world.meshes.values())
        if world.backdrop is not None:
            meshes.append(world.backdrop)
        rows = {mesh.name: row for row, mesh in enumerate(meshes)}
        self.mesh_rays = [self._committed(mesh) for mesh in meshes]
        self.rays = RayScene(self.engine)
        self.tops: list[tuple[int, Mesh | None, NDArray[np.float64]]] = []
        """Everything at the top level: its row, its mesh (None for the terrain) and its world_from_object."""
        objects, tints = [GROUND_ID], [(1.0, 1.0, 1.0)]
        self._add(self.rays.add_mesh(*terrain_triangles(world.terrain.field)), None, np.eye(4))
        if world.backdrop is not None:
            self._add(self.rays.add_mesh(world.backdrop.vertices, world.backdrop.faces), world.backdrop, np.eye(4))
            objects.append(GROUND_ID)
            tints.append((1.0, 1.0, 1.0))
        for instance in world.instances:
            mesh, pose = world.meshes[instance.mesh], instance.world_from_object
            self._add(self.rays.add_instance(self.mesh_rays[rows[mesh.name]], pose), mesh, pose)
            objects.append(instance.object_id)
            tints.append(instance.tint)
        self.rays.commit()
        top_mesh = [-1 if mesh is None else rows[mesh.name] for _, mesh, _ in self.tops]
        self.hits, self.surfaces = _tables(world, meshes, top_mesh, objects, [t[2] for t in self.tops], tints)

    def _add(self, row: int, mesh: Mesh | None, pose: NDArray[np.float64]) -> None:
        if row != len(self.tops):
            raise AssertionError(f"Embree numbered a thing {row} instead of {len(self.tops)}")
        self.tops.append((row, mesh, pose))

    @property
    def studio(self) -> "Studio":
        """Light, colours and film: made when the first photograph asks for them, and shared by threads."""
        from fieldtruth.sense.studio import make_studio  # late: a LiDAR alone needs no light

        with self._lock:
            if self._studio is None:
                self._studio = make_studio(self)
            return self._studio

    def _committed(self, mesh: Mesh) -> RayScene:
        scene = RayScene(self.engine)
        scene.add_mesh(mesh.vertices, mesh.faces)
        return scene.commit()


def _tables(
    world: World, meshes: list[Mesh], top_mesh: list[int], objects: list[int], poses: list[NDArray[np.float64]],
    tints: list[tuple[float, float, float]],
) -> tuple[HitTable, SurfaceTable]:  # fmt: skip
    """Concatenate the meshes' arrays into tables that kernels index."""
    material_rows = {name: row for row, name in enumerate(world.materials)}
    labels = np.array([m.label for m in world.materials.values()], np.uint8)
    vertex_starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    face_starts = np.cumsum([0, *(len(m.faces) for m in meshes)])
    materials = [np.array([material_rows[n] for n in m.materials], np.int32)[m.material] for m in meshes]
    material = np.concatenate([*materials, np.zeros(0, np.int32)])
    hits = HitTable(
        top_object=np.array(objects, np.uint16),
        top_mesh=np.array(top_mesh, np.int32),
        mesh_face=face_starts[:-1].astype(np.int64),
        face_label=labels[material] if len(labels) else np.zeros(0, np.uint8),
        trail_distance=grid_of(world.terrain.trail_distance),
    )
    rotations = np.array([pose[:3, :3] / np.cbrt(np.linalg.det(pose[:3, :3])) for pose in poses])
    surfaces = SurfaceTable(
        vertex_normal=np.concatenate([*(m.normals for m in meshes), np.zeros((0, 3), np.float32)]),
        vertex_uv=np.concatenate([*(m.uv for m in meshes), np.zeros((0, 2), np.float32)]),
        face_vertices=np.concatenate(
            [*(m.faces + np.int32(s) for m, s in zip(meshes, vertex_starts, strict=False)), np.zeros((0, 3), np.int32)]
        ),
        face_material=material,
        face_repeat=np.concatenate([*(_metres_per_repeat(m) for m in meshes), np.zeros(0, np.float32)]),
        top_rotation=rotations.astype(np.float32),
        top_tint=np.array(tints, np.float32),
        mesh_vertex=vertex_starts.astype(np.int64),
    )
    return hits, surfaces


def _metres_per_repeat(mesh: Mesh) -> NDArray[np.float32]:
    """Length [m] of one repeat of the texture on each face: the square root of area over area in uv."""
    corners, uv = mesh.vertices[mesh.faces].astype(np.float64), mesh.uv[mesh.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    s, t = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area_uv = np.abs(s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0])
    return np.asarray(np.sqrt(area / np.maximum(area_uv, 1e-9)).clip(1e-3, 1e3), np.float32)

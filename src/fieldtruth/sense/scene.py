# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ray-tracing scene that all sensors share: the world in Embree, and the classes of its hits."""

from collections.abc import Iterator
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.kernels.cast import CastTable, Hits
from fieldtruth.kernels.packets import CLEAR, MISS, SOLID, THIN, Grid, HitTable
from fieldtruth.sense.cast import bundle_of, cast, cast_table, occluded
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
                if world.terrain.visible:
                    self.rays.add_grid(terrain_nodes(world.terrain.surface))
                    geometry_top.append(row)
                continue
            for part in parts[mesh.name]:
                self.rays.add_instance(part, pose, mask=masks[mesh.name])
                geometry_top.append(row)
        self.rays.commit()
        self.hits = _hit_table(world, self.meshes, self.tops, geometry_top)

    @property
    def materials(self) -> tuple[str, ...]:
        """Names of the world's materials, by ``Hits.material``."""
        return tuple(self.world.materials)

    def cast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_range: float = np.inf,
        *,
        min_range: float = 0.0,
        water: bool = True,
        workers: int | None = None,
    ) -> Hits:
        """Return the first surface that each ray hits.

        Args:
            origins: (n, 3) [m] in the world frame, or (3,) of all rays; float32 is traced without a copy.
            directions: (n, 3) in the world frame, or (3,) of all rays; of any length above 0, which changes nothing.
            max_range: farther surfaces are not hit [m].
            min_range: nearer surfaces are not hit [m]; above 0, a ray that leaves a surface does not hit it again.
            water: whether water is hit; otherwise rays go straight through.
            workers: threads, by default one per core.

        Raises:
            ValueError: a direction without length, a number that is not finite, or shapes that do not fit.
        """
        bundle = bundle_of(origins, directions, "directions", min_range, max_range, water)
        return cast(self.rays.handle, self.hits, self._cast_table, bundle, workers)

    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        max_range: float = np.inf,
        *,
        targets: ArrayLike | None = None,
        min_range: float = 0.0,
        water: bool = True,
        workers: int | None = None,
    ) -> Mask:
        """Whether anything blocks each ray (n,): along ``directions`` up to ``max_range``, or before ``targets``.

        It is faster than ``cast``, because any hit will do. Arguments are those of ``cast``, and:

        Args:
            origins: see ``cast``.
            directions: see ``cast``.
            max_range: see ``cast``.
            targets: (n, 3) [m] in the world frame, or (3,) of all rays, instead of directions. What is in the last
                millimetre before a target does not hide it: it may be on a surface.
            min_range: see ``cast``.
            water: see ``cast``.
            workers: see ``cast``.

        Raises:
            ValueError: as ``cast``; not exactly one of directions and targets.
        """
        if (directions is None) == (targets is None):
            raise ValueError("occluded needs directions or targets, one of the two")
        if targets is not None:
            bundle = bundle_of(origins, targets, "targets", min_range, max_range, water)
        else:
            bundle = bundle_of(origins, np.asarray(directions), "directions", min_range, max_range, water)
        return occluded(self.rays.handle, bundle, workers)

    @cached_property
    def _cast_table(self) -> CastTable:
        return cast_table(self.world, self.meshes, [top.world_from_object for top in self.tops], self.hits)

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

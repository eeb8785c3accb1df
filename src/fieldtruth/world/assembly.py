# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From a filled builder and its terrain to a world: instance ids, and the materials and textures that are used.

A world may also end at its edge, as the paper's environments of 50 m x 100 m do: nothing is outside the rectangle. What
stands inside stays, to the last triangle, so that the same drive can be recorded with and without surroundings. Crowns,
wires and water that reach across the edge are cut there.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin
from fieldtruth.world.litter import scatter_litter
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Instance, Mesh, Swarm, Terrain, World
from fieldtruth.world.objects.config import ObjectConfig
from fieldtruth.world.objects.place import scatter_objects
from fieldtruth.world.placement import FarSwarm, WorldBuilder
from fieldtruth.world.textures import make_textures

_LITTER_SEED: Final = 7919


def assemble(
    builder: WorldBuilder,
    terrain: Terrain,
    *,
    name: str,
    seed: int,
    textures: np.random.SeedSequence,
    backdrop: Mesh,
    beyond: Sequence[FarSwarm] = (),
    litter: float = 0.0,
    objects: Sequence[ObjectConfig] = (),
    origin: Origin = PAPER_ORIGIN,
) -> World:
    """Make a world of a builder's objects and swarms, of the swarms ``beyond`` its edge, and of an amount of litter.

    Own ``objects`` that are to be scattered take the space that is left.

    Instance ids of swarms follow those of the named objects, so that each id is a row of /gazebo/model_states. Litter
    has the last ones, and a seed of its own: all else is the same without it.
    """
    scatter_objects(builder, terrain, objects, seed)
    meshes, further = dict(builder.meshes), list(beyond)
    if litter:
        further += scatter_litter(builder, terrain, litter, np.random.default_rng([seed, _LITTER_SEED]))
    for _, own in further:
        meshes |= {mesh.name: mesh for mesh in own}
    first = GROUND_ID + 1 + len(builder.instances)
    swarms = [replace(s, object_id=first + k) for k, s in enumerate([*builder.swarms, *(s for s, _ in further)])]
    used = used_materials(terrain, (*meshes.values(), backdrop))
    materials = {n: material for n, material in (*MATERIALS.items(), *builder.materials.items()) if n in used}
    drawn = dict.fromkeys(n for m in materials.values() for n in m.images if n not in builder.textures)
    return World(
        name=name,
        seed=seed,
        size=builder.size,
        terrain=terrain,
        meshes=meshes,
        instances=tuple(builder.instances),
        swarms=tuple(swarms),
        materials=materials,
        textures={**make_textures(textures, drawn), **builder.textures},
        backdrop=backdrop,
        water_level=builder.water_level,
        object_names=("husky", f"{name}_ground", *(i.name for i in builder.instances), *(s.name for s in swarms)),
        origin=origin,
    )


_Keep = Callable[[Mesh, Array], str | None]
"""Name of the part of a mesh at a pose (4, 4) that is inside the edge; None: no part is."""


def cut_at_edge(world: World) -> World:
    """The world without its backdrop, without the members of swarms beyond its edge, and with all else cut there."""
    half, meshes = np.array(world.size) / 2, dict[str, Mesh]()
    radius = {m.name: np.linalg.norm(m.vertices, axis=1).max(initial=0.0) for m in world.meshes.values()}

    def is_inside(mesh: Mesh, pose: Array) -> bool:
        farthest = np.abs(pose[:2, 3]) + np.linalg.norm(pose[:2, :3], axis=1) * radius[mesh.name]
        if (farthest < half - 1e-3).all():  # nearly all members: none of their vertices has to be moved
            return True
        corners = mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        return bool((np.abs(corners[:, :2]) <= half).all())

    def keep(mesh: Mesh, pose: Array) -> str | None:
        if is_inside(mesh, pose):
            meshes.setdefault(mesh.name, mesh)
            return mesh.name
        part = _cut(replace(mesh, name=f"{mesh.name}_cut_{len(meshes)}"), pose, half)
        if not len(part.faces):
            return None
        meshes[part.name] = part
        return part.name

    instances = tuple(_cut_instance(world, instance, keep) for instance in world.instances)
    swarms = tuple(s for swarm in world.swarms if len((s := _cut_swarm(world, swarm, half, keep)).mesh))
    first = len(world.object_names) - len(world.swarms)
    cut = replace(
        world,
        meshes=meshes,
        instances=instances,
        swarms=tuple(replace(swarm, object_id=first + k) for k, swarm in enumerate(swarms)),
        backdrop=None,
        object_names=(*world.object_names[:first], *(swarm.name for swarm in swarms)),
    )
    return tidied(cut)


def used_materials(terrain: Terrain, meshes: Iterable[Mesh]) -> set[str]:
    """Names of the materials that a terrain or a mesh has."""
    ground = {*terrain.ground_materials, *terrain.trail_materials}
    return ground.union(*(mesh.materials for mesh in meshes))


def tidied(world: World) -> World:
    """The world without materials and textures that nothing has."""
    backdrop = () if world.backdrop is None else (world.backdrop,)
    used = used_materials(world.terrain, (*world.meshes.values(), *backdrop))
    materials = {name: material for name, material in world.materials.items() if name in used}
    textures = {name for material in materials.values() for name in material.images}
    return replace(
        world, materials=materials, textures={name: image for name, image in world.textures.items() if name in textures}
    )


def _cut_instance(world: World, instance: Instance, keep: _Keep) -> Instance:
    mesh = keep(world.meshes[instance.mesh], instance.world_from_object)
    if mesh is None:
        raise ValueError(f"{instance.name} is wholly outside the edge of {world.name}")
    return replace(instance, mesh=mesh)


def _cut_swarm(world: World, swarm: Swarm, half: Array, keep: _Keep) -> Swarm:
    """A swarm's members whose origin is inside the edge, cut there."""
    inside = np.flatnonzero((np.abs(swarm.world_from_object[:, :2, 3]) <= half).all(axis=1))
    kept = [
        (name, row)
        for row in inside
        if (name := keep(world.meshes[swarm.meshes[swarm.mesh[row]]], swarm.world_from_object[row])) is not None
    ]
    names, rows = tuple(dict.fromkeys(name for name, _ in kept)), [row for _, row in kept]
    return replace(
        swarm,
        meshes=names,
        mesh=np.array([names.index(name) for name, _ in kept], np.int32),
        world_from_object=swarm.world_from_object[rows],
        tint=swarm.tint[rows],
    )


def _cut(mesh: Mesh, pose: Array, half: Array) -> Mesh:
    """The part of a mesh at a pose that is inside |x| <= half[0], |y| <= half[1] [m], in the mesh's frame."""
    vertices = np.concatenate([mesh.vertices, mesh.normals, mesh.uv], axis=1).astype(np.float64)
    faces, rows = mesh.faces, np.arange(len(mesh.faces))
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            along = vertices[:, :3] @ pose[axis, :3] + pose[axis, 3]
            vertices, faces, kept = _cut_by_plane(vertices, faces, half[axis] - sign * along)
            rows = rows[kept]
    used, number = np.unique(faces, return_inverse=True)
    normals = vertices[used, 3:6]
    return replace(
        mesh,
        vertices=vertices[used, :3].astype(np.float32),
        normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        uv=vertices[used, 6:].astype(np.float32),
        faces=number.reshape(-1, 3).astype(np.int32),
        material=mesh.material[rows],
        part=None if mesh.part is None else mesh.part[rows],
        limb=None if mesh.limb is None else mesh.limb[rows],
    )


def _cut_by_plane(
    vertices: Array, faces: NDArray[np.int32], inside: Array
) -> tuple[Array, NDArray[np.int32], NDArray[np.intp]]:
    """Triangles' parts where the linear function ``inside``, given at the vertices, is at least 0.

    Returns vertices with those of the cuts appended, the triangles, and for each the row in ``faces`` that it is of.
    """
    count = (inside[faces] >= 0).sum(axis=1)
    one, two = np.flatnonzero(count == 1), np.flatnonzero(count == 2)
    # The corner that is alone on its side of the plane, then the others in the triangle's order.
    a, b, c = np.concatenate([_from_corner(faces[one], inside >= 0), _from_corner(faces[two], inside < 0)]).T
    ab, ac = len(vertices) + np.arange(2 * len(a)).reshape(2, -1)
    cuts = [_crossings(vertices, inside, a, other) for other in (b, c)]
    alone_inside, alone_outside = slice(len(one)), slice(len(one), None)
    parts = [
        faces[count == 3],
        np.stack([a, ab, ac], axis=1)[alone_inside],
        np.stack([ab, b, c], axis=1)[alone_outside],
        np.stack([ab, c, ac], axis=1)[alone_outside],
    ]
    rows = np.concatenate([np.flatnonzero(count == 3), one, two, two])
    return np.concatenate([vertices, *cuts]), np.concatenate(parts).astype(np.int32), rows


def _from_corner(faces: NDArray[np.int32], marked: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Triangles that start at their only marked vertex, in the same direction of rotation."""
    first = np.argmax(marked[faces], axis=1)
    return np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)


def _crossings(vertices: Array, inside: Array, one: NDArray[np.int32], other: NDArray[np.int32]) -> Array:
    """Crossings of edges with the plane, computed from the inner end, so that neighbouring triangles agree exactly."""
    swap = inside[one] < 0
    near, far = np.where(swap, other, one), np.where(swap, one, other)
    share = inside[near] / (inside[near] - inside[far])
    return np.asarray(vertices[near] + share[:, None] * (vertices[far] - vertices[near]))

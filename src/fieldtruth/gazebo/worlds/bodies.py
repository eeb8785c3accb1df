# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world as bodies of Gazebo: the ground, the objects and the swarms, each a set of placed meshes of one material."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.drive.ground import HARD
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.interchange.surfaces import Surface, beyond_edge, mesh_surfaces, tiles_of_swarms
from fieldtruth.world.model import LITTER, Collider, Mesh, Swarm, World

SOFT: Final = frozenset({Label.TREETOP, Label.BUSH, Label.HIGH_GRASS, Label.CABLE, Label.WATER})
"""Classes that a robot passes through. LiDAR rays hit them: water hides the ground below, and its class marks such a
point as none, because Gazebo knows no surface that swallows a ray.
"""
UP: Final = np.array([0, 0, 1], np.float32)
RAY_RANGE: Final = 120.0
"""Distance [m] from the world's edge beyond which nothing returns a ray."""
SMALL: Final = 500
"""Triangles of a member, on average, below which members of a swarm are merged: thousands of small meshes take Gazebo
minutes to load, and sharing their files saves little."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A mesh file, named ``mesh`` in the folder of ``model``, placed in a body.

    ``pose`` is (x, y, z) [m] and (roll, pitch, yaw) [rad] in the body; ``name`` is distinct there.
    """

    name: str
    model: str
    mesh: str
    material: str
    label: Label
    pose: tuple[float, ...] = (0.0,) * 6
    scale: float = 1.0
    solid: bool = True
    """Whether wheels and chassis touch it."""
    returns: bool = True
    """Whether rays of a LiDAR hit it."""
    visible: bool = True
    """Whether cameras see it."""


TILE: Final = 12.5
"""Side [m] of a tile of merged members, as small as keeps the numbers in its file short."""
AddMesh = Callable[[Part, Surface], None]
"""Stores the mesh file of a part, which is at the origin of its model."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """What becomes a static model: its name in /gazebo/model_states, pose in the world, parts.

    ``colliders`` are the primitive shapes of its physics, to be scaled by ``scale``.
    """

    name: str
    parts: tuple[Part, ...]
    pose: tuple[float, ...] = (0.0,) * 6
    colliders: tuple[Collider, ...] = ()
    scale: float = 1.0


def world_bodies(world: World, add: AddMesh, *, beyond: bool) -> Iterator[Body]:
    """Yield the bodies of a world, with ``beyond`` also those beyond its edge."""
    files: dict[str, tuple[Part, ...]] = {}

    def parts_of(mesh: Mesh) -> tuple[Part, ...]:
        if mesh.name not in files:
            surfaces = mesh_surfaces(mesh, world.materials)
            files[mesh.name] = tuple(_part(add, mesh.name, surface) for surface in surfaces)
        return files[mesh.name]

    yield _ground(world, add)
    for instance in world.instances:
        mesh, (pose, scale) = world.meshes[instance.mesh], pose_and_scale(instance.world_from_object)
        parts = tuple(replace(part, scale=scale) for part in parts_of(mesh))
        yield Body(name=instance.name, parts=parts, pose=pose, colliders=mesh.colliders, scale=scale)
    if beyond and world.backdrop is not None:
        yield Body(name=f"{world.name}_backdrop", parts=parts_of(world.backdrop))
    small = {swarm.name for swarm in world.swarms if _mean_faces(world, swarm) < SMALL}
    merged = replace(world, swarms=tuple(swarm for swarm in world.swarms if swarm.name in small))
    for outside in (False, True) if beyond else (False,):
        yield from _merged(merged, add, beyond=outside)
        for swarm in world.swarms:
            members = np.flatnonzero(beyond_edge(world, swarm) == outside)
            if swarm.name not in small and len(members):
                meshes = {row: parts_of(world.meshes[swarm.meshes[row]]) for row in set(swarm.mesh[members].tolist())}
                yield _members(world, swarm, members.tolist(), meshes, beyond=outside)


def pose_and_scale(matrix: Array) -> tuple[tuple[float, ...], float]:
    """Position [m] and fixed-axis angles [rad] of a pose (4, 4) with a uniform scale, and the scale."""
    scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
    angles = Rotation.from_matrix(matrix[:3, :3] / scale).as_euler("xyz")
    return tuple(np.round([*matrix[:3, 3], *angles], 9).tolist()), round(scale, 9)


def _part(
    add: AddMesh,
    model: str,
    surface: Surface,
    *,
    mesh: str = "",
    material: str = "",
    solid: bool = True,
    placed: bool = False,
) -> Part:
    """Store a surface; ``mesh`` and ``material`` are by default the name of the surface's material.

    One that is ``placed`` in the world is stored around its middle, because shorter numbers make smaller files.
    """
    name = mesh or surface.material
    middle = np.zeros(3, np.float32)
    if placed:
        middle = np.rint(surface.vertices.mean(axis=0))
        surface = replace(surface, vertices=surface.vertices - middle)
    part = Part(
        name=name,
        model=model,
        mesh=name,
        material=material or surface.material,
        label=surface.label,
        pose=(*middle.tolist(), 0.0, 0.0, 0.0),
        solid=solid and surface.label not in SOFT,
    )
    add(part, surface)
    return part


def _ground(world: World, add: AddMesh) -> Body:
    """The terrain. The material of a tile's surfaces has the name of the tile: they share an image.

    Rays and cameras meet grass and litter, which are not solid, and wheels the soil below.
    """
    name, layer = world.object_names[GROUND_ID], world.terrain.layer
    parts = []
    for tile in ground_tiles(world):
        for surface in tile.surfaces:
            part = _part(add, name, surface, material=tile.name, solid=layer is None, placed=True)
            parts.append(part)
    if layer is not None:
        soil = replace(world, terrain=replace(world.terrain, layer=None))
        for tile in ground_tiles(soil):
            for surface in tile.surfaces:
                bare = replace(surface, uv=np.zeros_like(surface.uv), normals=surface.normals * 0 + UP)
                part = _part(add, name, bare, mesh=f"{surface.material}_soil", material=tile.name, placed=True)
                parts.append(replace(part, visible=False))
    return Body(name=name, parts=tuple(parts))


def _merged(world: World, add: AddMesh, *, beyond: bool) -> Iterator[Body]:
    """One body for the members of each swarm inside the world or beyond its edge, with a part per tile and material."""
    parts: dict[str, list[Part]] = {}
    for tile in tiles_of_swarms(world, TILE, beyond=beyond):
        if tile.beyond == beyond:
            for surface in tile.surfaces(world):
                solid = surface.label in HARD and not beyond and tile.swarm.kind != LITTER
                mesh = f"{tile.name}_{surface.material}"
                part = _part(add, tile.swarm.name, surface, mesh=mesh, solid=solid, placed=True)
                parts.setdefault(_body_name(world, tile.swarm, beyond=beyond), []).append(part)
    for name, found in parts.items():
        yield Body(name=name, parts=tuple(found))


def _body_name(world: World, swarm: Swarm, *, beyond: bool) -> str:
    """Name of the swarm; the members beyond the edge of one that has others, too, are another body."""
    return f"{swarm.name}_beyond" if beyond and not beyond_edge(world, swarm).all() else swarm.name


def _mean_faces(world: World, swarm: Swarm) -> float:
    faces = np.array([len(world.meshes[name].faces) for name in swarm.meshes])
    return float(faces[swarm.mesh].mean())


def _members(
    world: World, swarm: Swarm, members: list[int], meshes: dict[int, tuple[Part, ...]], *, beyond: bool
) -> Body:
    """Body of the members of a swarm inside the world or beyond its edge, which share mesh files."""
    parts = []
    for member in members:
        pose, scale = pose_and_scale(swarm.world_from_object[member])
        outside = np.maximum(np.abs(pose[:2]) - np.array(world.size) / 2, 0.0)
        near = bool(np.hypot(*outside) < RAY_RANGE)
        for part in meshes[int(swarm.mesh[member])]:
            returns = part.returns and near
            name = f"{part.name}_{member}"
            solid = part.label in HARD and not beyond and swarm.kind != LITTER
            parts.append(replace(part, name=name, pose=pose, scale=scale, solid=solid, returns=returns))
    return Body(name=_body_name(world, swarm, beyond=beyond), parts=tuple(parts))

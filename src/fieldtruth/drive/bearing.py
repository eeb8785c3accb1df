# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground that bears wheels and hull: the soil with every hard object on it that has no collider.

Objects with colliders are obstacles of the physics; swarms have none. What is hard in a swarm (stones, pebbles, edging
stones) is part of the height that the robot feels; what bends or breaks (grass, herbs, leaves, stems of saplings,
fallen twigs of less than 3 cm) is not. The foot of a trunk, whose roots spread beyond the collider, is part of it, too:
up to ``FOOT`` above the soil.

A node carries the highest visible point of all these in the square of one spacing around it. So no stone is lost
between two nodes, and none is higher than it is; its outline grows by half a spacing at most. On stones of 3 and 5 cm
height the envelope of a rolling wheel keeps its peak to 0.4 mm; the bump is 2.5 cm longer than over the mesh itself.
"""

import dataclasses
import weakref
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.kernels.soil import lay_stones
from fieldtruth.world.model import LITTER, Heightfield, Mesh, World

BEARING_SPACING: Final = 0.05
"""Greatest spacing [m] of the nodes in a world with stones."""
FOOT: Final = 0.165
"""Height [m] of a wheel's axle: above it the collider of an object stops the robot, not the ground."""
HARD: Final = frozenset({Label.GROUND, Label.TRAIL, Label.ROCK})
"""Classes of the surfaces of a swarm that bear; blades, leaves and stems of herbs have others."""
_FEET: Final = frozenset({Label.TRUNK})
"""Classes of the surfaces of objects with colliders that reach beyond these near the ground."""

_known: Final[dict[int, Heightfield]] = {}
_faces: Final[dict[int, dict[frozenset[Label], NDArray[np.int32]]]] = {}


class HardSurface(NamedTuple):
    """Upper surfaces that bear: a mesh at poses (n, 4, 4), with the name of each; nothing above ``reach`` counts."""

    names: tuple[str, ...]
    vertices: Array  # (v, 3) [m]
    faces: NDArray[np.int32]  # (f, 3)
    poses: Array
    reach: float  # [m] above the soil


def bearing_field(world: World) -> Heightfield:
    """Heights of soil and stones; without stones the terrain's own field. It is computed once per world.

    Nodes are at most ``BEARING_SPACING`` apart. They divide the terrain's cells evenly, so that where no stone lies the
    surface is exactly that of ``world.terrain.field``.
    """
    key = id(world)
    if key not in _known:
        _known[key] = _with_stones(world)
        weakref.finalize(world, _known.pop, key, None)
    return _known[key]


def hard_surfaces(world: World) -> Iterator[HardSurface]:
    """Yield what is hard and has no collider inside the world: stones of swarms, and the feet of trunks."""
    for swarm in (each for each in world.swarms if each.kind != LITTER):
        inside = (np.abs(swarm.world_from_object[:, :2, 3]) <= np.array(world.size) / 2).all(axis=1)
        for row, name in enumerate(swarm.meshes):
            faces = _faces_of(world, world.meshes[name], HARD)
            poses = swarm.world_from_object[inside & (swarm.mesh == row)]
            if len(faces) and len(poses):
                names = (f"an object of swarm {swarm.name}",) * len(poses)
                yield HardSurface(names, world.meshes[name].vertices.astype(np.float64), faces, poses, np.inf)
    for name in dict.fromkeys(instance.mesh for instance in world.instances):
        mesh, copies = world.meshes[name], [i for i in world.instances if i.mesh == name]
        faces = _faces_of(world, mesh, _FEET)
        faces = faces[mesh.vertices[faces, 2].min(axis=1, initial=np.inf) < 2 * FOOT]
        if len(faces):
            poses = np.array([i.world_from_object for i in copies])
            yield HardSurface(tuple(i.name for i in copies), mesh.vertices.astype(np.float64), faces, poses, FOOT)


def _faces_of(world: World, mesh: Mesh, labels: frozenset[Label]) -> NDArray[np.int32]:
    """Faces (f, 3) of the materials of some classes; they are looked for once per mesh."""
    known = _faces.get(id(mesh))
    if known is None:
        known = _faces[id(mesh)] = {}
        weakref.finalize(mesh, _faces.pop, id(mesh), None)
    if labels not in known:
        known[labels] = _find_faces(world, mesh, labels)
    return known[labels]


def _find_faces(world: World, mesh: Mesh, labels: frozenset[Label]) -> NDArray[np.int32]:
    rows = [k for k, name in enumerate(mesh.materials) if world.materials[name].label in labels]
    return np.ascontiguousarray(mesh.faces[np.isin(mesh.material, rows)])


def _with_stones(world: World) -> Heightfield:
    surfaces = list(hard_surfaces(world))
    if not surfaces:
        return world.terrain.field
    soil = divided(world.terrain.field)
    heights = soil.heights.copy()
    for surface in surfaces:
        poses = np.ascontiguousarray(surface.poses, np.float64)
        grid = (soil.x0, soil.y0, soil.spacing, surface.reach)
        lay_stones(heights, soil.heights, grid, surface.vertices, surface.faces, poses)
    return dataclasses.replace(soil, heights=heights)


def divided(field: Heightfield) -> Heightfield:
    """The same surface on nodes at most ``BEARING_SPACING`` apart."""
    parts = int(np.ceil(field.spacing / BEARING_SPACING - 1e-9))
    if parts == 1:
        return field
    spacing = field.spacing / parts
    x, y = (
        start + spacing * np.arange(parts * (count - 1) + 1)
        for start, count in zip((field.x0, field.y0), field.heights.shape, strict=True)
    )
    heights = np.stack([field.height_at(at, y).astype(np.float32) for at in x])
    return Heightfield(heights=heights, spacing=spacing, x0=field.x0, y0=field.y0)

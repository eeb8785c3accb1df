# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world as glTF 2.0 in one binary file (.glb).

Axes: glTF is right-handed with y up. Our x (north) stays x, our z (up) becomes y, our y (west) becomes -z; meshes and
poses are both converted, so a node's mesh is upright in its own frame. Blender's importer turns y up into z up again:
there, coordinates are ours.

Nodes are named after objects, and share meshes. The ``extras`` of a node have instance id, kind and classes, those of a
material its class. A swarm is a node whose children are its meshes with ``EXT_mesh_gpu_instancing``, or (format
gltf-plain) one node per member. The extension has poses of float32, nodes have float64.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import fieldtruth
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import CLASSES, GROUND_ID
from fieldtruth.core.geodesy import ORIGIN_HEIGHT, ORIGIN_LATITUDE, ORIGIN_LONGITUDE
from fieldtruth.interchange import check_scene_memory
from fieldtruth.interchange.glb import INDICES, VERTICES, Glb
from fieldtruth.interchange.gltf_materials import NEUTRAL, STEPS, Look, Materials, nearest_step
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.interchange.ground_image import ground_images
from fieldtruth.interchange.surfaces import Surface, mesh_surfaces
from fieldtruth.interchange.swarms import beyond_edge
from fieldtruth.world.model import Mesh, Swarm, World

INSTANCING: Final = "EXT_mesh_gpu_instancing"


_FACE_BYTES: Final = 250
"""Memory for a face of the largest mesh while it is split and written."""
_NODE_BYTES: Final = 3000
"""Memory for the JSON of a node."""


def write(world: World, target: Path, *, beyond: bool, instancing: bool = True) -> None:
    """Write the file ``target``; ``instancing`` selects the extension for swarms, else a node per member."""
    single = 0 if instancing else sum(len(swarm.mesh) for swarm in world.swarms)
    largest = max((len(mesh.faces) for mesh in world.meshes.values()), default=0)
    check_scene_memory(world, "gltf" if instancing else "gltf-plain", largest * _FACE_BYTES + single * _NODE_BYTES)
    head: dict[str, object] = {"asset": {"version": "2.0", "generator": f"fieldtruth {fieldtruth.__version__}"}}
    if instancing and world.swarms:
        # Required: a reader without it would show one member of each swarm, at the origin.
        head |= {"extensionsUsed": [INSTANCING], "extensionsRequired": [INSTANCING]}
    with Glb(target.parent, head | {"scene": 0}) as glb:
        scene = _Scene(world, glb, beyond=beyond)
        nodes = [*scene.ground(), *scene.objects(), *scene.swarms(instancing=instancing)]
        glb.add("scenes", {"name": f"{world.name}_{world.seed}", "nodes": nodes, "extras": _description(world)})
        glb.save(target)


def y_up(vectors: NDArray[Any]) -> NDArray[Any]:
    """Vectors (..., 3) in glTF's axes: (x, z, -y)."""
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], axis=-1)


def decompose(poses: Array) -> tuple[Array, Array, Array]:
    """Translations (n, 3), quaternions (n, 4) in (x, y, z, w) and scales (n, 3) of poses (n, 4, 4), in glTF's axes."""
    scale = np.cbrt(np.linalg.det(poses[:, :3, :3]))
    quaternion = Rotation.from_matrix(poses[:, :3, :3] / scale[:, None, None]).as_quat()
    rotation = np.column_stack([y_up(quaternion[:, :3]), quaternion[:, 3]])
    return y_up(poses[:, :3, 3]), rotation, np.repeat(scale[:, None], 3, axis=1)


def _description(world: World) -> dict[str, object]:
    return {
        "environment": world.name,
        "seed": world.seed,
        "size_m": list(world.size),
        "origin": {"latitude_deg": ORIGIN_LATITUDE, "longitude_deg": ORIGIN_LONGITUDE, "height_m": ORIGIN_HEIGHT},
        "axes": "x north, y up, z east",
        "classes": [{"id": int(c.label), "name": c.name, "rgb": c.rgb} for c in CLASSES],
    }


class _Scene:
    """Adds a world's parts to a file; each method returns the indices of its nodes."""

    def __init__(self, world: World, glb: Glb, *, beyond: bool) -> None:
        self._world, self._glb, self._beyond = world, glb, beyond
        self._materials = Materials(world, glb, self._looks())
        self._primitives: dict[str, list[tuple[str, dict[str, object]]]] = {}
        self._meshes: dict[tuple[str, int], int] = {}

    def _looks(self) -> Iterator[Look]:
        """Materials and steps of brightness of everything."""
        world = self._world
        steps = nearest_step([i.tint for i in world.instances] or np.zeros((0, 3)))
        used = {(i.mesh, int(step)) for i, step in zip(world.instances, steps, strict=True)}
        for swarm in world.swarms:
            names = [swarm.meshes[row] for row in swarm.mesh]
            used |= set(zip(names, nearest_step(swarm.tint).tolist(), strict=True))
        for mesh, step in used:
            yield from ((material, step) for material in world.meshes[mesh].materials)
        if world.backdrop is not None:
            yield from ((material, NEUTRAL) for material in world.backdrop.materials)

    def ground(self) -> list[int]:
        """The tiles of the terrain and the land beyond the edge."""
        world, nodes = self._world, []
        tiles, extras = list(ground_tiles(world)), self._extras(GROUND_ID, "ground")
        for tile, jpeg in zip(tiles, ground_images(world, tiles), strict=True):
            texture = self._materials.add_image(tile.name, jpeg)
            primitives = [
                self._primitive(s) | {"material": self._materials.add_ground(s.material, s.label, texture)}
                for s in tile.surfaces
            ]
            mesh = self._glb.add("meshes", {"name": tile.name, "primitives": primitives})
            nodes.append(self._glb.add("nodes", {"name": tile.name, "mesh": mesh, "extras": extras}))
        if self._beyond and world.backdrop is not None:
            mesh = self._mesh(world.backdrop, NEUTRAL)
            nodes.append(self._glb.add("nodes", {"name": "backdrop", "mesh": mesh, "extras": extras}))
        return nodes

    def objects(self) -> list[int]:
        """The named objects, water included."""
        instances = self._world.instances
        if not instances:
            return []
        steps = nearest_step([i.tint for i in instances])
        placements = _placements(np.array([i.world_from_object for i in instances]))
        nodes = []
        for instance, step, placement in zip(instances, steps.tolist(), placements, strict=True):
            mesh = self._world.meshes[instance.mesh]
            extras = self._extras(instance.object_id, instance.kind, mesh) | {"tint": list(instance.tint)}
            node = {"name": instance.name, "mesh": self._mesh(mesh, step), **placement, "extras": extras}
            nodes.append(self._glb.add("nodes", node))
        return nodes

    def swarms(self, *, instancing: bool) -> list[int]:
        """A node for each swarm."""
        nodes = []
        for swarm in self._world.swarms:
            members = np.arange(len(swarm.mesh)) if self._beyond else np.flatnonzero(~beyond_edge(self._world, swarm))
            if len(members):
                children = self._batches(swarm, members) if instancing else self._members(swarm, members)
                extras = self._extras(swarm.object_id, swarm.kind, *(self._world.meshes[n] for n in swarm.meshes))
                node = {"name": swarm.name, "children": children, "extras": extras | {"members": len(members)}}
                nodes.append(self._glb.add("nodes", node))
        return nodes

    def _batches(self, swarm: Swarm, members: NDArray[np.intp]) -> list[int]:
        steps, children = nearest_step(swarm.tint), []
        kinds = np.stack([swarm.mesh, steps], axis=-1)
        for row, step in np.unique(kinds[members], axis=0).tolist():
            batch = members[(kinds[members] == (row, step)).all(axis=1)]
            arrays = (*decompose(swarm.world_from_object[batch]), swarm.tint[batch])
            names = ("TRANSLATION", "ROTATION", "SCALE", "_TINT")
            attributes = {n: self._glb.array(a.astype(np.float32)) for n, a in zip(names, arrays, strict=True)}
            mesh = self._world.meshes[swarm.meshes[row]]
            node = {
                "name": f"{swarm.name}/{_named(mesh.name, step)}",
                "mesh": self._mesh(mesh, step),
                "extensions": {INSTANCING: {"attributes": attributes}},
                "extras": self._extras(swarm.object_id, swarm.kind, mesh),
            }
            children.append(self._glb.add("nodes", node))
        return children

    def _members(self, swarm: Swarm, members: NDArray[np.intp]) -> list[int]:
        steps, children = nearest_step(swarm.tint).tolist(), []
        extras = [self._extras(swarm.object_id, swarm.kind, self._world.meshes[name]) for name in swarm.meshes]
        for member, placement in zip(members.tolist(), _placements(swarm.world_from_object[members]), strict=True):
            row = int(swarm.mesh[member])
            mesh = self._mesh(self._world.meshes[swarm.meshes[row]], steps[member])
            node = {"name": f"{swarm.name}.{member}", "mesh": mesh, **placement, "extras": extras[row]}
            children.append(self._glb.add("nodes", node))
        return children

    def _extras(self, instance_id: int, kind: str, *meshes: Mesh) -> dict[str, object]:
        labels = sorted({self._world.materials[name].label for mesh in meshes for name in mesh.materials})
        extras: dict[str, object] = {"instance_id": instance_id, "kind": kind}
        if meshes:
            extras |= {"class_ids": [int(n) for n in labels], "class_names": [CLASSES[n].name for n in labels]}
        return extras

    def _mesh(self, mesh: Mesh, step: int) -> int:
        """Index of a mesh at a step of brightness; its arrays are written once."""
        if mesh.name not in self._primitives:
            surfaces = mesh_surfaces(mesh, self._world.materials)
            self._primitives[mesh.name] = [(s.material, self._primitive(s)) for s in surfaces]
        if (mesh.name, step) not in self._meshes:
            primitives = [
                primitive | {"material": self._materials.row(material, step)}
                for material, primitive in self._primitives[mesh.name]
            ]
            name = _named(mesh.name, step)
            self._meshes[mesh.name, step] = self._glb.add("meshes", {"name": name, "primitives": primitives})
        return self._meshes[mesh.name, step]

    def _primitive(self, surface: Surface) -> dict[str, object]:
        u, v = surface.uv.T
        uv = np.column_stack([u, 1 - v])  # v points down in glTF
        small = len(surface.vertices) < np.iinfo(np.uint16).max
        indices = surface.faces.ravel().astype(np.uint16 if small else np.uint32)
        vertices: Float32Array = y_up(surface.vertices)
        return {
            "attributes": {
                "POSITION": self._glb.array(vertices, target=VERTICES, bounds=True),
                "NORMAL": self._glb.array(y_up(surface.normals), target=VERTICES),
                "TEXCOORD_0": self._glb.array(uv, target=VERTICES),
            },
            "indices": self._glb.array(indices, target=INDICES),
        }


def _named(mesh: str, step: int) -> str:
    return mesh if step == NEUTRAL else f"{mesh}@{STEPS[step]:.2f}"


def _placements(poses: Array) -> Iterator[Mapping[str, list[float]]]:
    for translation, rotation, scale in zip(*(part.tolist() for part in decompose(poses)), strict=True):
        yield {"translation": translation, "rotation": rotation, "scale": scale}

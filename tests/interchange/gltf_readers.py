# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""GLB files as trimesh (plain) and pygltflib (with instancing) read them, in our axes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pygltflib
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

F8 = NDArray[np.float64]
Z_UP: Final[F8] = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], np.float64)
"""World from glTF's axes, as Blender's importer turns them."""


class Part(NamedTuple):
    """Triangles of one material under one node."""

    node: str
    world_from_object: F8  # (4, 4)
    corners: F8  # (f, 3, 3) in the world
    normals: F8  # (f, 3, 3) at the corners, as stored
    material: str


def read_plain(path: Path) -> list[Part]:
    """All parts of a file, in our axes."""
    scene = trimesh.load_scene(path, process=False, maintain_order=True)
    parts = []
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        mesh = scene.geometry[name]
        corners = np.asarray(mesh.vertices, np.float64)[mesh.faces] @ pose[:3, :3].T + pose[:3, 3]
        world_from_object = Z_UP @ pose @ Z_UP.T
        normals = mesh.vertex_normals[mesh.faces] @ (Z_UP[:3, :3] @ pose[:3, :3]).T
        parts.append(Part(str(node), world_from_object, corners @ Z_UP[:3, :3].T, normals, mesh.visual.material.name))
    return parts


class Member(NamedTuple):
    """A member of a swarm."""

    mesh: str
    world_from_object: F8
    tint: F8


class InstancedFile:
    """A file with EXT_mesh_gpu_instancing."""

    def __init__(self, path: Path) -> None:
        self.gltf: Any = pygltflib.GLTF2().load_binary(str(path))
        self.nodes = {node.name: node for node in self.gltf.nodes}
        self.roots = [self.gltf.nodes[k].name for k in self.gltf.scenes[0].nodes]

    def array(self, accessor: int) -> NDArray[Any]:
        found = self.gltf.accessors[accessor]
        view = self.gltf.bufferViews[found.bufferView]
        kind = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}[found.componentType]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[found.type]
        blob = self.gltf.binary_blob()[view.byteOffset :][: view.byteLength]
        values: NDArray[Any] = np.frombuffer(blob, kind).reshape(found.count, width)
        return values

    def triangle_count(self, mesh: int) -> int:
        return sum(self.gltf.accessors[p.indices].count // 3 for p in self.gltf.meshes[mesh].primitives)

    def members(self, swarm: str) -> Iterator[Member]:
        for child in self.nodes[swarm].children:
            node = self.gltf.nodes[child]
            attributes = node.extensions["EXT_mesh_gpu_instancing"]["attributes"]
            names = ("TRANSLATION", "ROTATION", "SCALE", "_TINT")
            for position, quaternion, scale, tint in zip(*(self.array(attributes[n]) for n in names), strict=True):
                pose = np.eye(4)
                pose[:3, :3] = Rotation.from_quat(quaternion).as_matrix() * scale
                pose[:3, 3] = position
                name = self.gltf.meshes[node.mesh].name.partition("@")[0]
                yield Member(name, Z_UP @ pose @ Z_UP.T, tint.astype(np.float64))

    def class_ids(self, mesh: int) -> list[int]:
        return [self.gltf.materials[p.material].extras["class_id"] for p in self.gltf.meshes[mesh].primitives]

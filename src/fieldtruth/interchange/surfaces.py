# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Meshes and materials as other tools take them.

A surface has the triangles of one material, and therefore of one class. Swarms can be merged into a few large ones, for
tools that are slow with many small objects. Materials become images, for tools that have no colour factor.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.textures import linear_from_srgb, srgb_from_linear
from fieldtruth.world.model import Material, Mesh, Swarm, World


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Triangles of one material.

    ``vertices`` (v, 3) float32 [m]; ``normals`` (v, 3) float32 of unit length; ``uv`` (v, 2) float32 in repeats of the
    texture, u to the right and v up; ``faces`` (f, 3) int32, anticlockwise seen from outside; ``tint`` (v, 3) float32
    is a linear colour factor per vertex, None where it is 1.
    """

    material: str
    label: int
    vertices: Float32Array
    normals: Float32Array
    uv: Float32Array
    faces: NDArray[np.int32]
    tint: Float32Array | None = None


def mesh_surfaces(mesh: Mesh, materials: Mapping[str, Material]) -> tuple[Surface, ...]:
    """Split a mesh by material, in the order of ``mesh.materials``; each part has the vertices that it uses."""
    return tuple(
        Surface(
            material=name,
            label=materials[name].label,
            vertices=mesh.vertices[rows],
            normals=mesh.normals[rows],
            uv=mesh.uv[rows],
            faces=faces,
        )
        for name, rows, faces in _parts(mesh)
    )


def _parts(mesh: Mesh) -> Iterator[tuple[str, NDArray[np.intp], NDArray[np.int32]]]:
    """Yield a material's name, the rows of its vertices and its faces, for each material that has faces."""
    for row, name in enumerate(mesh.materials):
        faces = mesh.faces[mesh.material == row]
        if not len(faces):
            continue
        used = np.zeros(len(mesh.vertices), bool)
        used[faces] = True
        renumbered = (np.cumsum(used) - 1).astype(np.int32)
        yield name, np.flatnonzero(used), renumbered[faces]


def merge_surfaces(parts: Sequence[Surface]) -> Surface:
    """Join surfaces of one material and one frame into one."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    tinted = any(part.tint is not None for part in parts)
    tints = [np.ones((len(p.vertices), 3), np.float32) if p.tint is None else p.tint for p in parts] if tinted else []
    return Surface(
        material=parts[0].material,
        label=parts[0].label,
        vertices=np.concatenate([part.vertices for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        uv=np.concatenate([part.uv for part in parts]),
        faces=np.concatenate([part.faces + np.int32(o) for part, o in zip(parts, offsets, strict=True)]),
        tint=np.concatenate(tints) if tinted else None,
    )


def placed(surface: Surface, poses: NDArray[np.float64], tints: NDArray[np.float32] | None = None) -> Surface:
    """Copy a surface to poses (n, 4, 4), rotation times a uniform scale and translation, with tints (n, 3)."""
    count, size = len(poses), len(surface.vertices)
    rotations = poses[:, :3, :3] / np.cbrt(np.linalg.det(poses[:, :3, :3]))[:, None, None]
    vertices = surface.vertices.astype(np.float64) @ np.swapaxes(poses[:, :3, :3], 1, 2) + poses[:, None, :3, 3]
    normals = surface.normals @ np.swapaxes(rotations, 1, 2).astype(np.float32)
    offsets = (size * np.arange(count, dtype=np.int32))[:, None, None]
    return Surface(
        material=surface.material,
        label=surface.label,
        vertices=vertices.reshape(-1, 3).astype(np.float32),
        normals=normals.reshape(-1, 3),
        uv=np.tile(surface.uv, (count, 1)),
        faces=(surface.faces + offsets).reshape(-1, 3),
        tint=None if tints is None else np.repeat(tints, size, axis=0),
    )


# ---------------------------------------------------------------------------------------------------------------------
# Swarms as a few large meshes

BEYOND_TILE: Final = 8
"""Side of a tile of members beyond the edge, in sides of a tile inside, because they are few and far."""


@dataclass(frozen=True, kw_only=True)
class SwarmTile:
    """Members of one swarm on one tile."""

    name: str
    swarm: Swarm
    members: NDArray[np.intp]
    """Rows of the swarm's arrays."""
    beyond: bool
    """True beyond the world's edge."""

    def surfaces(self, world: World) -> tuple[Surface, ...]:
        """Return a surface per material of the members, in world coordinates."""
        parts: dict[str, list[Surface]] = {}
        for row, mesh in enumerate(self.swarm.meshes):
            of_mesh = self.members[self.swarm.mesh[self.members] == row]
            if len(of_mesh):
                for surface in mesh_surfaces(world.meshes[mesh], world.materials):
                    copies = placed(surface, self.swarm.world_from_object[of_mesh], self.swarm.tint[of_mesh])
                    parts.setdefault(surface.material, []).append(copies)
        return tuple(merge_surfaces(found) for found in parts.values())

    def face_count(self, world: World) -> int:
        """Number of the members' triangles."""
        faces = np.array([len(world.meshes[name].faces) for name in self.swarm.meshes])
        return int(faces[self.swarm.mesh[self.members]].sum())


def beyond_edge(world: World, swarm: Swarm) -> NDArray[np.bool_]:
    """Return True (n,) for members whose origin is beyond the world's edge."""
    return np.asarray((np.abs(swarm.world_from_object[:, :2, 3]) > np.array(world.size) / 2).any(axis=1))


def tiles_of_swarms(world: World, size_m: float = 25.0, *, beyond: bool) -> Iterator[SwarmTile]:
    """Group the members of each swarm by tile; with ``beyond`` also those beyond the world's edge.

    A member belongs to the tile that its origin is on. Tiles start in the world's corner and have a side of ``size_m``
    [m]; beyond the edge they are ``BEYOND_TILE`` times as large. Their surfaces are made one tile at a time.
    """
    for swarm in world.swarms:
        outside = beyond_edge(world, swarm)
        yield from _tiles(world, swarm, np.flatnonzero(~outside), size_m, beyond=False)
        if beyond:
            yield from _tiles(world, swarm, np.flatnonzero(outside), size_m * BEYOND_TILE, beyond=True)


def _tiles(world: World, swarm: Swarm, members: NDArray[np.intp], side: float, *, beyond: bool) -> Iterator[SwarmTile]:
    tile = np.floor((swarm.world_from_object[members, :2, 3] + np.array(world.size) / 2) / side).astype(int)
    for i, j in np.unique(tile, axis=0).tolist():
        rows = members[(tile == (i, j)).all(axis=1)]
        name = f"{swarm.name}_beyond_{i}_{j}" if beyond else f"{swarm.name}_{i}_{j}"
        yield SwarmTile(name=name, swarm=swarm, members=rows, beyond=beyond)


# ---------------------------------------------------------------------------------------------------------------------
# Materials

JPEG_QUALITY: Final = 90
"""Textures of 512 x 512 texels: 60 to 130 kB, a quarter of their PNG."""


def material_image(world: World, material: str) -> NDArray[np.uint8]:
    """Image (n, n, 3) sRGB of a material: its texture times its tint in linear light, at most white."""
    found = world.materials[material]
    return tinted(world.textures[found.texture], found.tint)


def tinted(texture: NDArray[np.uint8], tint: Sequence[float]) -> NDArray[np.uint8]:
    """Multiply the colours (n, n, 3) sRGB of an image by a linear tint (3,); the result is at most white."""
    linear = linear_from_srgb(np.arange(256) / 255.0)[:, None] * np.array(tint)
    table = np.rint(srgb_from_linear(linear) * 255.0).astype(np.uint8)
    return np.stack([table[texture[..., k], k] for k in range(3)], axis=-1)


def encode_image(image: NDArray[np.uint8]) -> bytes:
    """Encode an image (h, w, 3) sRGB as JPEG."""
    data: bytes = simplejpeg.encode_jpeg(np.ascontiguousarray(image), quality=JPEG_QUALITY, colorsubsampling="420")
    return data


def roughness(material: Material) -> float:
    """Roughness of a material, 0 (mirror) to 1 (matt), as glTF and USD define it."""
    return 0.05 if material.mirror > 0 else 1.0 - 0.7 * material.gloss

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world as glTF 2.0 in one binary file (.glb).

Axes: glTF is right-handed with y up. Our x (north) stays x, our z (up) becomes y, our y (west) becomes -z; meshes and
poses are both converted, so a node's mesh is upright in its own frame. Blender's importer turns y up into z up again:
there, coordinates are ours.

Nodes are named after objects, and share meshes. The ``extras`` of a node have instance id, kind and classes, those of a
material its class. A swarm is a node whose children are its meshes with ``EXT_mesh_gpu_instancing``, or (format
gltf-plain) one node per member. The extension has poses of float32, nodes have float64.

A tint of glTF is at most 1, ours may brighten. So a texture is stored as bright as its brightest use, and each material
has a factor of at most 1. Tints of objects are rounded to ``STEPS`` of brightness, each a material of its own, because
glTF has no colour per node, and tools ignore extensions that add one.

The file is JSON and one binary buffer, which is written as a stream.
"""

import json
import shutil
import struct
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

import fieldtruth
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.core.errors import OutputError
from fieldtruth.interchange import check_scene_memory
from fieldtruth.interchange.ground import ground_images, ground_tiles
from fieldtruth.interchange.surfaces import Surface, beyond_edge, encode_image, mesh_surfaces, roughness, tinted
from fieldtruth.world.model import Mesh, Swarm, World

# ---------------------------------------------------------------------------------------------------------------------
# The container

VERTICES, INDICES = 34962, 34963
"""Targets of buffer views (ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER)."""
LARGEST: Final = 2**32 - 2**27
"""Largest buffer [byte]: lengths in a GLB are 32 bits; the JSON needs some, too."""
_COMPONENTS: Final = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125}
_TYPES: Final = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Glb:
    """A GLB file that grows: ``add`` items to the JSON's lists, arrays and images to the buffer, then ``save``.

    The buffer is a temporary file beside the output, so that a scene larger than the memory can be written.
    """

    def __init__(self, folder: Path, head: Mapping[str, object]) -> None:
        """``head``: the JSON's items that are not lists."""
        self._json: dict[str, Any] = dict(head)
        self._buffer = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115
        self._length = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._buffer.close()

    def add(self, key: str, item: Mapping[str, object]) -> int:
        """Append an item to one of the JSON's lists (nodes, meshes, ...) and return its index."""
        items: list[Mapping[str, object]] = self._json.setdefault(key, [])
        items.append(item)
        return len(items) - 1

    def array(self, values: NDArray[Any], *, target: int | None = None, bounds: bool = False) -> int:
        """Append an array (n,) or (n, 2 to 4) of float32 or unsigned integers; return the index of its accessor.

        ``bounds`` adds the smallest and largest values, which positions must have.
        """
        rows = values.reshape(len(values), -1)
        accessor: dict[str, object] = {
            "bufferView": self._view(np.ascontiguousarray(values).tobytes(), target),
            "componentType": _COMPONENTS[values.dtype.str[1:]],
            "count": len(values),
            "type": _TYPES[rows.shape[1]],
        }
        if bounds:
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        return self.add("accessors", accessor)

    def image(self, name: str, jpeg: bytes) -> int:
        """Append a JPEG and return the index of the image."""
        return self.add("images", {"name": name, "mimeType": "image/jpeg", "bufferView": self._view(jpeg, None)})

    def _view(self, data: bytes, target: int | None) -> int:
        view: dict[str, object] = {"buffer": 0, "byteOffset": self._length, "byteLength": len(data)}
        padding = -len(data) % 4
        if self._length + len(data) + padding > LARGEST:
            raise OutputError(f"the scene is larger than a GLB file can be ({LARGEST / 1e9:.1f} GB); use --no-beyond")
        self._buffer.write(data + bytes(padding))
        self._length += len(data) + padding
        return self.add("bufferViews", view if target is None else view | {"target": target})

    def save(self, path: Path) -> None:
        """Write the file."""
        self._json["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(self._json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        with path.open("wb") as stream:
            stream.write(struct.pack("<4s2I", b"glTF", 2, 12 + 8 + len(text) + 8 + self._length))
            stream.write(struct.pack("<I4s", len(text), b"JSON") + text)
            stream.write(struct.pack("<I4s", self._length, b"BIN\0"))
            self._buffer.seek(0)
            shutil.copyfileobj(self._buffer, stream, 1 << 20)


# ---------------------------------------------------------------------------------------------------------------------
# Materials and textures

STEPS: Final = tuple(2.0 ** (k / 4) for k in range(-2, 3))
"""Steps of brightness, 19 % apart: a rounded tint is at most 9 % off within their range."""
NEUTRAL: Final = STEPS.index(1.0)
_LUMINANCE: Final = (0.2126, 0.7152, 0.0722)
_REPEAT, _CLAMP, _LINEAR, _MIPMAPS = 10497, 33071, 9729, 9987
Look = tuple[str, int]
"""A material's name and a step of brightness."""


def nearest_step(tints: ArrayLike) -> NDArray[np.intp]:
    """Index (n,) into ``STEPS`` whose brightness is nearest to that of linear tints (n, 3)."""
    brightness = np.log2(np.maximum(np.asarray(tints, np.float64) @ _LUMINANCE, 1e-6))
    return np.asarray(np.abs(brightness[:, None] - np.log2(STEPS)).argmin(axis=1))


class Materials:
    """The materials of a scene, written once each."""

    def __init__(self, world: World, glb: Glb, looks: Iterable[Look]) -> None:
        """``looks`` are all that will be used."""
        self._world, self._glb = world, glb
        self._gain: dict[str, float] = {}
        for name, step in looks:
            material = world.materials[name]
            brightest = max(material.tint) * STEPS[step]
            self._gain[material.texture] = max(1.0, brightest, self._gain.get(material.texture, 1.0))
        self._textures: dict[str, int] = {}
        self._rows: dict[Look, int] = {}
        wrap = [{"wrapS": w, "wrapT": w, "magFilter": _LINEAR, "minFilter": _MIPMAPS} for w in (_REPEAT, _CLAMP)]
        self._samplers = [glb.add("samplers", sampler) for sampler in wrap]

    def row(self, name: str, step: int = NEUTRAL) -> int:
        """Index of a material at a step of brightness."""
        if (name, step) not in self._rows:
            material = self._world.materials[name]
            gain = self._gain[material.texture]
            self._rows[name, step] = self._add(
                name if step == NEUTRAL else f"{name}@{STEPS[step]:.2f}",
                material.label,
                self._texture(material.texture, gain),
                [float(np.clip(tint * STEPS[step] / gain, 0, 1)) for tint in material.tint],
                roughness=roughness(material),
                translucency=material.translucency,
            )
        return self._rows[name, step]

    def add_image(self, name: str, jpeg: bytes) -> int:
        """Add an image that does not repeat and return the index of its texture."""
        source = self._glb.image(name, jpeg)
        return self._glb.add("textures", {"sampler": self._samplers[1], "source": source})

    def add_ground(self, name: str, label: int, texture: int) -> int:
        """Add a material of the ground and return its index."""
        return self._add(name, label, texture, [1.0, 1.0, 1.0], roughness=1.0)

    def _texture(self, name: str, gain: float) -> int:
        if name not in self._textures:
            jpeg = encode_image(tinted(self._world.textures[name], (gain, gain, gain)))
            source = self._glb.image(name, jpeg)
            self._textures[name] = self._glb.add("textures", {"sampler": self._samplers[0], "source": source})
        return self._textures[name]

    def _add(
        self, name: str, label: int, texture: int, factor: list[float], *, roughness: float, translucency: float = 0.0
    ) -> int:
        surface = {
            "baseColorFactor": [*factor, 1.0],
            "baseColorTexture": {"index": texture},
            "metallicFactor": 0.0,
            "roughnessFactor": roughness,
        }
        extras = {"class_id": int(label), "class_name": self._world.classes[label].name, "translucency": translucency}
        # Double-sided, as for the ray tracer: leaves and blades are single layers.
        material = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True, "extras": extras}
        return self._glb.add("materials", material)


# ---------------------------------------------------------------------------------------------------------------------
# The scene

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
    latitude, longitude, height = world.origin
    return {
        "environment": world.name,
        "seed": world.seed,
        "size_m": list(world.size),
        "origin": {"latitude_deg": latitude, "longitude_deg": longitude, "height_m": height},
        "axes": "x north, y up, z east",
        "classes": [{"id": int(c.label), "name": c.name, "rgb": c.rgb} for c in world.classes],
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
            extras |= {
                "class_ids": [int(n) for n in labels],
                "class_names": [self._world.classes[n].name for n in labels],
            }
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

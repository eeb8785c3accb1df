# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world as Wavefront OBJ: a folder with scene.obj, scene.mtl, textures and objects.json.

Coordinates are the world's (x north, y west, z up). OBJ has no instances: every object is written with its own
vertices, a swarm as one object per tile. ``objects.json`` has instance id and kind of each object (``o``) and the class
of each material (``usemtl``). Objects keep their material's colour; their own tints are left out.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

import numpy as np
import orjson
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.interchange import check_scene_memory
from fieldtruth.interchange.ground import GroundTile, ground_images, ground_tiles
from fieldtruth.interchange.surfaces import (
    Surface,
    encode_image,
    material_image,
    mesh_surfaces,
    placed,
    tiles_of_swarms,
)
from fieldtruth.world.model import World

OBJECTS: Final = "objects.json"
_FACE_BYTES: Final = 250
"""Memory for a face of the largest tile of a swarm while it is merged and written."""
_ROWS: Final = 100_000
"""Lines that are formatted at once, which bounds the memory."""


class _Object(NamedTuple):
    name: str
    instance_id: int
    kind: str
    surfaces: tuple[Surface, ...]


def write(world: World, target: Path, *, beyond: bool) -> None:
    """Write the folder ``target``."""
    largest = max((members.face_count(world) for members in tiles_of_swarms(world, beyond=beyond)), default=0)
    check_scene_memory(world, "obj", largest * _FACE_BYTES)
    tiles = list(ground_tiles(world))
    (target / "textures").mkdir(parents=True)
    objects: dict[str, dict[str, object]] = {}
    labels: dict[str, int] = {}
    with (target / "scene.obj").open("wb") as stream:
        stream.write(
            f"# fieldtruth: {world.name}, seed {world.seed}; x north, y west, z up [m]\nmtllib scene.mtl\n".encode()
        )
        writer = _Writer(stream)
        for item in _objects(world, tiles, beyond=beyond):
            objects[item.name] = {"instance_id": item.instance_id, "kind": item.kind}
            labels |= {surface.material: surface.label for surface in item.surfaces}
            writer.write(item)
    materials = {name: {"class_id": int(n), "class_name": world.classes[n].name} for name, n in labels.items()}
    text = orjson.dumps({"objects": objects, "materials": materials}, option=orjson.OPT_INDENT_2)
    (target / OBJECTS).write_bytes(text)
    _write_materials(world, tiles, list(labels), target)


def _objects(world: World, tiles: list[GroundTile], *, beyond: bool) -> Iterator[_Object]:
    for tile in tiles:
        yield _Object(tile.name, GROUND_ID, "ground", tile.surfaces)
    if beyond and world.backdrop is not None:
        yield _Object("backdrop", GROUND_ID, "ground", mesh_surfaces(world.backdrop, world.materials))
    for instance in world.instances:
        surfaces = mesh_surfaces(world.meshes[instance.mesh], world.materials)
        pose = instance.world_from_object[None]
        yield _Object(instance.name, instance.object_id, instance.kind, tuple(placed(s, pose) for s in surfaces))
    for swarm_tile in tiles_of_swarms(world, beyond=beyond):
        swarm = swarm_tile.swarm
        yield _Object(swarm_tile.name, swarm.object_id, swarm.kind, swarm_tile.surfaces(world))


class _Writer:
    """Appends objects; indices of OBJ count all vertices of the file from 1."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._next = 1

    def write(self, item: _Object) -> None:
        self._stream.write(f"o {item.name}\n".encode())
        for surface in item.surfaces:
            self._lines(b"v ", surface.vertices, decimals=5)
            self._lines(b"vt ", surface.uv, decimals=5)
            self._lines(b"vn ", surface.normals, decimals=3)
            self._stream.write(f"usemtl {surface.material}\n".encode())
            for rows in _chunks(surface.faces + self._next):
                # [[[1,1,1],[2,2,2],[3,3,3]],... becomes f 1/1/1 2/2/2 3/3/3
                nested = orjson.dumps(np.repeat(rows[..., None], 3, axis=-1), option=orjson.OPT_SERIALIZE_NUMPY)[3:-3]
                text = nested.replace(b"]],[[", b"\nf ").replace(b"],[", b" ").replace(b",", b"/")
                self._stream.write(b"f " + text + b"\n")
            self._next += len(surface.vertices)

    def _lines(self, keyword: bytes, values: NDArray[np.float32], *, decimals: int) -> None:
        for rows in _chunks(values.astype(np.float64).round(decimals)):
            text = orjson.dumps(np.ascontiguousarray(rows), option=orjson.OPT_SERIALIZE_NUMPY)[2:-2]
            self._stream.write(keyword + text.replace(b"],[", b"\n" + keyword).replace(b",", b" ") + b"\n")


def _chunks(values: NDArray[np.int32] | Array) -> Iterator[NDArray[np.int32] | Array]:
    for start in range(0, len(values), _ROWS):
        yield values[start : start + _ROWS]


def _write_materials(world: World, tiles: list[GroundTile], names: list[str], target: Path) -> None:
    of_tiles = {surface.material: tile.name for tile in tiles for surface in tile.surfaces}
    for tile, jpeg in zip(tiles, ground_images(world, tiles), strict=True):
        (target / "textures" / f"{tile.name}.jpg").write_bytes(jpeg)
    lines = []
    for name in names:
        image = of_tiles.get(name, name)
        if name not in of_tiles:
            (target / "textures" / f"{name}.jpg").write_bytes(encode_image(material_image(world, name)))
        lines += [f"newmtl {name}", "Ka 0 0 0", "Kd 1 1 1", "Ks 0 0 0", "illum 1", f"map_Kd textures/{image}.jpg", ""]
    (target / "scene.mtl").write_text("\n".join(lines), encoding="utf-8")

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds on disk: one uncompressed ``.npz`` of plain arrays and a JSON text, which loads in a second.

The layer of grass and litter, and snow, are kept in half precision (15 um at 3 cm).
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import Label
from fieldtruth.core.files import atomic_output
from fieldtruth.world.model import Collider, Heightfield, Instance, Material, Mesh, Raster, Swarm, Terrain, World

_MESH_ARRAYS = ("vertices", "normals", "uv", "faces", "material")
_SWARM_ARRAYS = ("mesh", "world_from_object", "tint")
Arrays = dict[str, NDArray[Any]]


def save_world(path: Path, world: World) -> None:
    """Write a world atomically; missing folders are created."""
    arrays: Arrays = {}
    meshes = {**world.meshes, **({world.backdrop.name: world.backdrop} if world.backdrop is not None else {})}
    text = {
        "name": world.name,
        "seed": world.seed,
        "size": world.size,
        "layout": dict(world.layout),
        "backdrop": world.backdrop.name if world.backdrop is not None else None,
        "object_names": world.object_names,
        "materials": [asdict(m) for m in world.materials.values()],
        "textures": list(world.textures),
        "meshes": [_mesh_text(m) for m in meshes.values()],
        "instances": [
            {"name": i.name, "kind": i.kind, "mesh": i.mesh, "object_id": i.object_id, "tint": i.tint}
            for i in world.instances
        ],
        "swarms": [
            {"name": s.name, "kind": s.kind, "object_id": s.object_id, "meshes": s.meshes} for s in world.swarms
        ],
        "water_level": world.water_level,
        "terrain": _terrain_text(world.terrain),
    }
    for k, texture in enumerate(world.textures.values()):
        arrays[f"texture_{k}"] = texture
    for k, mesh in enumerate(meshes.values()):
        arrays |= {f"mesh_{k}_{name}": getattr(mesh, name) for name in _MESH_ARRAYS}
        if mesh.axis is not None:
            arrays[f"mesh_{k}_axis"] = mesh.axis
    arrays["instance_poses"] = np.array([i.world_from_object for i in world.instances]).reshape(-1, 4, 4)
    for k, swarm in enumerate(world.swarms):
        arrays |= {f"swarm_{k}_{name}": getattr(swarm, name) for name in _SWARM_ARRAYS}
    terrain = world.terrain
    arrays |= {"heights": terrain.field.heights, "trail": terrain.trail_distance.values, "cover": terrain.cover.values}
    for name, depth in (("layer", terrain.layer), ("snow", terrain.snow)):
        if depth is not None:
            arrays[name] = depth.astype(np.float16)
    arrays["text"] = np.frombuffer(json.dumps(text).encode(), np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_output(path) as part, part.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def read_world(path: Path) -> World:
    """Read a file that ``save_world`` wrote; what damage raises is not defined."""
    with np.load(path, allow_pickle=False) as arrays:
        text = json.loads(arrays["text"].tobytes())
        meshes = {m["name"]: _mesh(m, k, arrays) for k, m in enumerate(text["meshes"])}
        backdrop = meshes.pop(text["backdrop"]) if text["backdrop"] is not None else None
        poses = arrays["instance_poses"]
        return World(
            name=text["name"],
            seed=text["seed"],
            size=tuple(text["size"]),
            layout=text["layout"],
            terrain=_terrain(text["terrain"], arrays),
            meshes=meshes,
            instances=tuple(
                Instance(**(i | {"tint": tuple(i["tint"])}), world_from_object=pose)
                for i, pose in zip(text["instances"], poses, strict=True)
            ),
            materials={m["name"]: _material(m) for m in text["materials"]},
            textures={name: arrays[f"texture_{k}"] for k, name in enumerate(text["textures"])},
            swarms=tuple(_swarm(s, k, arrays) for k, s in enumerate(text["swarms"])),
            water_level=text["water_level"],
            backdrop=backdrop,
            object_names=tuple(text["object_names"]),
        )


def _mesh_text(mesh: Mesh) -> dict[str, Any]:
    return {
        "name": mesh.name,
        "materials": mesh.materials,
        "footprint": mesh.footprint,
        "species": mesh.species,
        "colliders": [asdict(c) for c in mesh.colliders],
    }


def _mesh(text: dict[str, Any], row: int, arrays: Any) -> Mesh:
    colliders = tuple(
        Collider(**(c | {"size": tuple(c["size"]), "position": tuple(c["position"])})) for c in text["colliders"]
    )
    return Mesh(
        name=text["name"],
        materials=tuple(text["materials"]),
        footprint=text["footprint"],
        species=tuple(text["species"]),
        colliders=colliders,
        axis=arrays.get(f"mesh_{row}_axis"),
        **{name: arrays[f"mesh_{row}_{name}"] for name in _MESH_ARRAYS},
    )


def _swarm(text: dict[str, Any], row: int, arrays: Any) -> Swarm:
    own = {name: arrays[f"swarm_{row}_{name}"] for name in _SWARM_ARRAYS}
    return Swarm(**(text | {"meshes": tuple(text["meshes"])}), **own)


def _material(text: dict[str, Any]) -> Material:
    return Material(**(text | {"label": Label(text["label"]), "tint": tuple(text["tint"])}))


def _terrain_text(terrain: Terrain) -> dict[str, Any]:
    grids: dict[str, Heightfield | Raster] = {
        "field": terrain.field,
        "trail_distance": terrain.trail_distance,
        "cover": terrain.cover,
    }
    return {
        "grids": {name: [grid.spacing, grid.x0, grid.y0] for name, grid in grids.items()},
        "ground_materials": terrain.ground_materials,
        "trail_material": terrain.trail_material,
        "border_material": terrain.border_material,
        "border_width": terrain.border_width,
        "visible": terrain.visible,
    }


def _terrain(text: dict[str, Any], arrays: Any) -> Terrain:
    grids = {name: dict(zip(("spacing", "x0", "y0"), grid, strict=True)) for name, grid in text["grids"].items()}
    return Terrain(
        field=Heightfield(heights=arrays["heights"], **grids["field"]),
        trail_distance=Raster(values=arrays["trail"], **grids["trail_distance"]),
        cover=Raster(values=arrays["cover"], **grids["cover"]),
        ground_materials=tuple(text["ground_materials"]),
        trail_material=text["trail_material"],
        border_material=text["border_material"],
        border_width=text["border_width"],
        visible=text["visible"],
        layer=arrays["layer"].astype(np.float32) if "layer" in arrays else None,
        snow=arrays["snow"].astype(np.float32) if "snow" in arrays else None,
    )

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds by name and seed, built by rules or read from the cache."""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from fieldtruth.core.cache import cache_folder as default_cache_folder
from fieldtruth.core.cache import cache_key
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.core.classes import Label
from fieldtruth.core.files import atomic_output
from fieldtruth.core.memory import check_memory
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.fields import Frozen, configuration_error
from fieldtruth.world.assembly import cut_at_edge
from fieldtruth.world.environments import ENVIRONMENTS
from fieldtruth.world.environments.layout import GroundConfig
from fieldtruth.world.grids import Line
from fieldtruth.world.library import data_files
from fieldtruth.world.model import Collider, Heightfield, Instance, Material, Mesh, Raster, Swarm, Terrain, World
from fieldtruth.world.seasons.change import in_season

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


_LIBRARIES: Final = ("numpy", "scipy", "numba")


_BASE: Final = 4e8


"""Memory [byte] for building a world, besides what grows with its terrain's nodes and with its area."""


_PER_NODE: Final = 60


"""Memory [byte] per node of the terrain while it is built."""


_PER_M2: Final = 1000


"""Memory [byte] for the objects on a square metre."""


def build_world(environment: str, seed: int = 0, layout: Mapping[str, Any] | None = None) -> World:
    """Build an environment. The same name, seed and layout give the same world.

    ``layout`` changes its configuration, for example ``{"old_trees": 60}``; docs/environments.md lists the keys. The
    corridors of the environment stay free of obstacles in every layout. ``{"beyond": False}`` ends the world at its
    edge; what is inside stays the same.

    Raises:
        UnknownNameError: unknown environment.
        ConfigurationError: a key or value that the layout does not allow.
        CrowdedWorldError: the layout has more objects than fit into the world.
        OutputError: its terrain needs more memory than there is.
    """
    check_layout(environment, layout)
    config: Any = layout_model(environment).model_validate(dict(layout or {}))
    if isinstance(config, GroundConfig):  # environments of other packages may have another layout
        (length, width), spacing = config.size, config.spacing
        task = f"a world of {length:g} m x {width:g} m with nodes every {spacing:g} m"
        needed = _BASE + length * width * (_PER_NODE / spacing**2 + _PER_M2)
        check_memory(int(needed), task, "make layout.grid larger, or layout.size smaller")
        config = config.for_size()
    world: World = _module(environment, "build").build(seed, reserved_corridors(environment), config)
    if isinstance(config, GroundConfig):
        world = in_season(world, config.season, config.drought, config.snow_depth)
    world = replace(world, layout=dict(layout or {}))
    return cut_at_edge(world) if getattr(config, "beyond", True) is False else world


def check_experiment(experiment: Experiment, source: str = "") -> None:
    """Check that an experiment's environment exists and that its layout is allowed there.

    Raises:
        UnknownNameError: unknown environment; the text starts with ``source``, a file's name for example.
        ConfigurationError: a key or value that the environment's layout does not allow; the text starts likewise.
    """
    check_layout(experiment.environment, experiment.layout, source)


def check_layout(environment: str, layout: Mapping[str, Any] | None, source: str = "") -> None:
    """Check an environment's name and a layout for it; raises as ``check_experiment``."""
    ENVIRONMENTS.find(environment, source)
    try:
        layout_model(environment).model_validate(dict(layout or {}))
    except ValidationError as report:
        prefix = f"{source}: layout" if source else "layout"
        raise configuration_error(layout_model(environment), report, prefix) from report


def layout_model(environment: str) -> type[Frozen]:
    """Configuration of an environment's layout: counts, densities, sizes."""
    model: type[Frozen] = _module(environment, "config").Config
    return model


def reserved_corridors(environment: str) -> list[Line]:
    """Centre lines of the corridors that stay free of obstacles, whatever experiments exist."""
    config = _module(environment, "config")
    if not hasattr(config, "CORRIDORS"):  # packages made for earlier versions have a module of their own for them
        config = _module(environment, "corridors")
    return [Line.through(corners, smooth=False) for corners in config.CORRIDORS]


def load_world(
    environment: str, seed: int = 0, layout: Mapping[str, Any] | None = None, *, cache_folder: Path | None = None
) -> World:
    """Read a world from the cache, or build it (see ``build_world``) and store it there.

    Args:
        environment: a name from ``list_environments``.
        seed: of everything random.
        layout: changes to the environment's configuration.
        cache_folder: by default ``core.cache_folder.cache_folder()``. File names contain a digest of the code, the
            libraries' versions and the layout. A folder that cannot be written is ignored.
    """
    check_layout(environment, layout)
    folder = default_cache_folder() if cache_folder is None else cache_folder
    stem = f"{environment}-{seed}" + (f"_{cache_key((), dict(sorted(layout.items())))[:12]}" if layout else "")
    path = folder / f"{stem}-{world_key(environment)}.npz"
    return load_or_make(path, read_world, lambda: build_world(environment, seed, layout), save_world)


def world_key(environment: str) -> str:
    """Digest of everything besides seed and layout that shapes a world: code, data files, versions of libraries."""
    package = ENVIRONMENTS[environment].package
    modules = [__name__, *(f"{package}.{name}" for name in ("build", "config"))]
    files = data_files()  # the package's and added ones
    if not package.startswith("fieldtruth."):  # `cache_key` finds the package's own modules only
        folders = map(Path, import_module(package).__path__)
        files += sorted(path for folder in folders for path in folder.rglob("*") if _is_source(path))
    return cache_key(modules, [path.read_bytes() for path in files], libraries=_LIBRARIES)


def _is_source(path: Path) -> bool:
    return path.is_file() and "__pycache__" not in path.parts


def world_of(experiment: Experiment) -> World:
    """Load the world of an experiment."""
    return load_world(experiment.environment, experiment.seed, experiment.layout)


def _module(environment: str, name: str) -> Any:
    return import_module(f"{ENVIRONMENTS[environment].package}.{name}")

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds for Gazebo: world files, models, meshes, textures."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from fieldtruth.core import geodesy
from fieldtruth.core.classes import CLASSES, PALETTE, Label
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.gazebo.robot import Flavour
from fieldtruth.gazebo.templates import render, write
from fieldtruth.gazebo.worlds.bodies import TILE, Body, Part, world_bodies
from fieldtruth.gazebo.worlds.mesh_files import COARSE, FINE, SOLID, texture_file, write_glb, write_obj, write_textures
from fieldtruth.interchange import check_scene_memory
from fieldtruth.interchange.surfaces import Surface, tiles_of_swarms
from fieldtruth.render.daylight import sun_direction
from fieldtruth.world.model import World

HEADING_DEG: Final = 90.0
"""Of the world's x axis, from east towards north: x is north and y west."""
_LIGHT: Final = {"ambient": (0.5, 0.52, 0.55), "sky": (0.62, 0.74, 0.88), "sun": (0.95, 0.9, 0.8)}
"""Colours in sRGB, chosen by eye beside photographs of the same views."""
_FACE_BYTES: Final = 700
_MEMBER_BYTES: Final = 10_000
_VERSION: Final = {"classic": "1.7", "gz": "1.9"}
"""Version of SDF that the oldest Gazebo of a flavour reads: 11.1, and Garden."""


def write_world(folder: Path, world: World, flavour: Flavour, *, beyond: bool) -> None:
    """Write a world into ``folder``, the root of a package of one flavour.

    - ``worlds/{name}.world`` (classic) or ``.sdf`` (gz), and ``{name}_plain`` in the flat colours of the classes;
    - ``models/``: one folder for each mesh that objects share, for the ground and for each swarm; they are models of
      their own, too; and ``{name}_materials`` with textures and, for Gazebo 11, the materials.

    Raises:
        OutputError: the memory is too small.
    """
    check_scene_memory(world, "gazebo", _needed_memory(world))
    models, materials = folder / "models", f"{world.name}_materials"

    def add(part: Part, surface: Surface) -> None:
        path = models / part.model / "meshes" / part.mesh
        if flavour == "gz":
            write_glb(path.with_name(f"{path.name}.glb"), surface)
        else:
            texture = f"../../{materials}/materials/textures/{texture_file(world, part.material)}"
            ground = part.label in (Label.GROUND, Label.TRAIL)
            decimals = FINE if ground else SOLID if part.solid and part.model not in swarms else COARSE
            write_obj(path.with_name(f"{path.name}.obj"), surface, texture, decimals)

    swarms = {swarm.name for swarm in world.swarms}
    bodies = list(world_bodies(world, add, beyond=beyond))
    textures = {name: texture_file(world, name) for name in sorted({p.material for b in bodies for p in b.parts})}
    write_textures(models / materials / "materials" / "textures", world, textures.keys())
    clear = {material.name for material in world.materials.values() if material.mirror > 0}
    colours = {c.label.name: PALETTE[c.label] / 255 for c in CLASSES if c.rgb is not None}
    values = {
        "flavour": flavour,
        "version": _VERSION[flavour],
        "materials": materials,
        "textures": textures,
        "clear": clear,
        "colours": colours,
    }
    if flavour == "classic":
        script = render("worlds", "ogre.material.jinja", **values)
        write(models / materials / "materials" / "scripts" / f"{materials}.material", script)
    for body in _shared(bodies):
        _write_model(models / body.name, world, body, values)
    for flat in (False, True):
        name = f"{world.name}_plain" if flat else world.name
        text = render("worlds", "world.xml.jinja", **values, **_scene(world, flat=flat), bodies=bodies)
        write(folder / "worlds" / f"{name}.{'sdf' if flavour == 'gz' else 'world'}", text)


def _needed_memory(world: World) -> int:
    """Memory [byte] for the text of the largest mesh file, and for a world file with a part per member of a swarm."""
    tiles = (tile.face_count(world) for tile in tiles_of_swarms(world, TILE, beyond=True))
    largest = max((*tiles, *(len(mesh.faces) for mesh in world.meshes.values())), default=0)
    return largest * _FACE_BYTES + sum(len(swarm.mesh) for swarm in world.swarms) * _MEMBER_BYTES


def _shared(bodies: Iterable[Body]) -> list[Body]:
    """One body at the origin for each folder of meshes, with the meshes that are in it."""
    found: dict[str, tuple[dict[str, Part], Body]] = {}
    for body in bodies:
        for part in body.parts:
            parts, _ = found.setdefault(part.model, ({}, body))
            pose = part.pose if part.name == part.mesh else Part.pose  # that of a tile, not of a member
            parts.setdefault(part.mesh, replace(part, name=part.mesh, pose=pose, scale=1.0))
    return [
        Body(name=model, parts=tuple(parts.values()), colliders=first.colliders)
        for model, (parts, first) in found.items()
    ]


def _write_model(folder: Path, world: World, body: Body, values: dict[str, Any]) -> None:
    classes = sorted({part.label for part in body.parts})
    description = f"{body.name}: {', '.join(CLASSES[label].name for label in classes)}. Made for {world.name}."
    write(folder / "model.sdf", render("worlds", "model.xml.jinja", **values, body=body, flat=False))
    config = render(
        "worlds", "model.config.xml.jinja", name=body.name, description=description, version=values["version"]
    )
    write(folder / "model.config", config)


def _scene(world: World, *, flat: bool) -> dict[str, Any]:
    sun = LightConfig().values
    light = _LIGHT | {"direction": -sun_direction(sun.azimuth_deg, sun.elevation_deg)}
    if flat:
        light |= {"ambient": np.ones(3), "sky": PALETTE[Label.SKY] / 255}
    return {
        "world": world,
        "flat": flat,
        "light": light,
        "geodesy": geodesy,
        "heading": HEADING_DEG,
        "gravity": GRAVITY,
    }

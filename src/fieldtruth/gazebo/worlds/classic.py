# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world for Gazebo 11: OBJ meshes, Ogre materials, the world file and its plain twin."""

from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.core import geodesy
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.drive.physics import GRAVITY
from fieldtruth.experiment.config import LightConfig
from fieldtruth.gazebo.templates import render, write
from fieldtruth.gazebo.worlds.bodies import Body, Part, world_bodies
from fieldtruth.gazebo.worlds.mesh_files import COARSE, FINE, write_obj
from fieldtruth.gazebo.worlds.textures import write_textures
from fieldtruth.interchange.surfaces import Surface
from fieldtruth.render.sky import sun_direction
from fieldtruth.world.model import World

HEADING_DEG: Final = 90.0
"""Of x, from east towards north, which makes x north and y west."""
SKY: Final = (0.62, 0.74, 0.88)


def write_classic(folder: Path, world: World, *, beyond: bool) -> None:
    """Write ``models/`` and ``worlds/`` of a world and its plain twin into ``folder``."""
    models, materials = folder / "models", f"{world.name}_materials"
    textures = write_textures(models / materials / "materials" / "textures", world, f"{world.name}_")

    def add(part: Part, surface: Surface) -> None:
        path = models / part.model / "meshes" / f"{part.mesh}.obj"
        texture = f"../../{materials}/materials/textures/{textures[part.material]}"
        write_obj(path, surface, texture, FINE if part.solid else COARSE)

    bodies = list(world_bodies(world, add, beyond=beyond))
    flat = {c.label.name.lower(): np.array(c.rgb) / 255 for c in CLASSES if c.rgb is not None}
    clear = {m.name for m in world.materials.values() if m.mirror > 0}
    script = render("worlds", "ogre.material.jinja", prefix=materials, textured=textures, flat=flat, clear=clear)
    write(models / materials / "materials" / "scripts" / f"{materials}.material", script)
    for name, is_flat in ((world.name, False), (f"{world.name}_plain", True)):
        write(folder / "worlds" / f"{name}.world", _world_text(world, bodies, materials, is_flat))


def _world_text(world: World, bodies: list[Body], materials: str, flat: bool) -> str:
    light = LightConfig()
    sky = next(c.rgb for c in CLASSES if c.label == Label.SKY)
    return render(
        "worlds",
        "classic_world.xml.jinja",
        title=f"{world.name}, seed {world.seed}" + (": flat colours of the classes" if flat else ""),
        world=world,
        bodies=bodies,
        materials=materials,
        flat=flat,
        geodesy=geodesy,
        heading=HEADING_DEG,
        gravity=GRAVITY,
        light={
            "ambient": (1, 1, 1) if flat else (0.5, 0.52, 0.55),
            "background": np.array(sky) / 255 if flat else SKY,
            "sun": (0.95, 0.9, 0.8),
            "direction": -sun_direction(light.sun_azimuth_deg, light.sun_elevation_deg),
        },
    )

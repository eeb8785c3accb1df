# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From a filled site and its ground to a world: object ids, and those materials and textures that are used."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import GROUND_ID, Mesh, Swarm, Terrain, World
from fieldtruth.world.placement import CrowdedWorldError, Site
from fieldtruth.world.textures import make_textures

MOST_OBJECTS: Final = 500
"""Each is in every /gazebo/model_states message, with some 120 bytes; below 64 kB LZ4 finds the one before."""


def assemble(
    site: Site,
    terrain: Terrain,
    *,
    name: str,
    seed: int,
    textures: np.random.SeedSequence,
    backdrop: Mesh,
    beyond: Sequence[tuple[Swarm, Sequence[Mesh]]] = (),
    water_level: float | None = None,
) -> World:
    """Make a world of what stands on a site; ``beyond`` are swarms on the land behind its edge, with their meshes.

    Swarms get the object ids behind those of the named objects, so that every id is a row of /gazebo/model_states.
    """
    meshes = dict(site.meshes)
    for _, own in beyond:
        meshes |= {mesh.name: mesh for mesh in own}
    if len(site.instances) > MOST_OBJECTS:
        raise CrowdedWorldError(f"{len(site.instances)} things with names; at most {MOST_OBJECTS} fit, ask for fewer")
    first = GROUND_ID + 1 + len(site.instances)
    swarms = [replace(s, object_id=first + k) for k, s in enumerate([*site.swarms, *(s for s, _ in beyond)])]
    used = {n for mesh in (*meshes.values(), backdrop) for n in mesh.materials}
    used |= {*terrain.ground_materials, terrain.trail_material, terrain.border_material}
    materials = {n: material for n, material in MATERIALS.items() if n in used}
    return World(
        name=name,
        seed=seed,
        size=site.size,
        terrain=terrain,
        meshes=meshes,
        instances=tuple(site.instances),
        swarms=tuple(swarms),
        materials=materials,
        textures=make_textures(textures, dict.fromkeys(m.texture for m in materials.values())),
        backdrop=backdrop,
        water_level=water_level,
        object_names=("husky", f"{name}_ground", *(i.name for i in site.instances), *(s.name for s in swarms)),
    )

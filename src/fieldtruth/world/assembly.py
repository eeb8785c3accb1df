# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From a filled builder and its terrain to a world: instance ids, and the materials and textures that are used."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.core.classes import GROUND_ID
from fieldtruth.world.litter import scatter_litter
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh, Terrain, World
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.swarms import FarSwarm
from fieldtruth.world.textures import make_textures

_LITTER_SEED: Final = 7919


def assemble(
    builder: WorldBuilder,
    terrain: Terrain,
    *,
    name: str,
    seed: int,
    textures: np.random.SeedSequence,
    backdrop: Mesh,
    beyond: Sequence[FarSwarm] = (),
    litter: float = 0.0,
) -> World:
    """Make a world of a builder's objects and swarms, of the swarms ``beyond`` its edge, and of an amount of litter.

    Instance ids of swarms follow those of the named objects, so that each id is a row of /gazebo/model_states. Litter
    has the last ones, and a seed of its own: all else is the same without it.
    """
    meshes, further = dict(builder.meshes), list(beyond)
    if litter:
        further += scatter_litter(builder, terrain, litter, np.random.default_rng([seed, _LITTER_SEED]))
    for _, own in further:
        meshes |= {mesh.name: mesh for mesh in own}
    first = GROUND_ID + 1 + len(builder.instances)
    swarms = [replace(s, object_id=first + k) for k, s in enumerate([*builder.swarms, *(s for s, _ in further)])]
    used = {n for mesh in (*meshes.values(), backdrop) for n in mesh.materials}
    used |= {*terrain.ground_materials, terrain.trail_material, terrain.border_material}
    materials = {n: material for n, material in MATERIALS.items() if n in used}
    return World(
        name=name,
        seed=seed,
        size=builder.size,
        terrain=terrain,
        meshes=meshes,
        instances=tuple(builder.instances),
        swarms=tuple(swarms),
        materials=materials,
        textures=make_textures(textures, dict.fromkeys(n for m in materials.values() for n in m.images)),
        backdrop=backdrop,
        water_level=builder.water_level,
        object_names=("husky", f"{name}_ground", *(i.name for i in builder.instances), *(s.name for s in swarms)),
    )

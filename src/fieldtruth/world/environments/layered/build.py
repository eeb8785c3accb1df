# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world of the layers of an environment's file, in this order: relief, ground, objects, plants, land beyond."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.assembly import assemble
from fieldtruth.world.classes import class_table
from fieldtruth.world.environments.layered.config import DESCRIPTIONS, Description
from fieldtruth.world.environments.layered.expressions import Constant, Expression
from fieldtruth.world.environments.layered.fields import FAR, Fields, rng_of
from fieldtruth.world.environments.layered.land import ground_height, make_land_beyond, swarms_beyond, waves
from fieldtruth.world.environments.layered.objects import nearest
from fieldtruth.world.environments.layered.plants import scatter_plants
from fieldtruth.world.environments.layered.puddles import dig_puddles
from fieldtruth.world.environments.layered.steps import shape
from fieldtruth.world.environments.layered.surroundings import shape_surroundings
from fieldtruth.world.environments.layered.trails_beyond import with_trails
from fieldtruth.world.environments.layered.trees import crowns, feet, raise_roots
from fieldtruth.world.environments.layout import Trails, hills_spacing, network
from fieldtruth.world.grids import (
    COVER,
    Line,
    coarseness,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    make_trails,
)
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Instance, Material, Mesh, Terrain, World
from fieldtruth.world.objects.place import stand_objects
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import with_layer, with_microrelief
from fieldtruth.world.water import add_water, make_flat_sheet

TRAIL: Final = Expression("trail")
SHEET_NODES: Final = 13
"""Nodes along each side of a sheet of water, at least."""
SHEET_SPACING: Final = 75.0
"""Distance [m] between the nodes of a sheet of water, at most."""
WANDER: Final = (25.0, 90.0)
"""Lengths [m] of the waves in which trails wander."""
_CORNER: Final = 60
"""Points of a line between the corners of a trail that wanders."""


def build(seed: int, corridors: Sequence[Line], config: Any) -> World:
    """Build an environment of layers. The same file, seed and layout give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    description = DESCRIPTIONS[config.environment]
    config = config.model_copy(update={"plants": {**description.seasonal.get(config.season, {}), **config.plants}})
    fields = _fields(description, seed, corridors, config)
    fields.height = shape_relief(fields, description)
    sheets = lay_water(fields, description)
    builder = make_ground(fields, config, description)
    builder.materials |= {name: _tinted(fields, MATERIALS[name], rgb) for name, rgb in description.tints.items()}
    stand_objects(builder, config.objects, class_table(config.classes))
    add_water(builder, fields.water, sheets)
    if description.water is not None:
        builder.instances[-1] = replace(builder.instances[-1], name=f"{description.water.name}_1")
    land = make_land_beyond(builder, fields, description.beyond)
    fields.ground = ground_height(builder, land)
    place_objects(builder, fields, config, description)
    fields.crowns, fields.near["foot"] = crowns(builder, fields.nodes), nearest(feet(builder))
    terrain = with_layer(cover_ground(builder, fields, description), rng_of(seed, "layer"))
    scatter_plants(builder, fields, config, description.plants)
    if description.roots:  # they may have raised the world's edge
        land = make_land_beyond(builder, fields, description.beyond)
    return assemble(
        builder,
        terrain,
        name=config.environment,
        seed=seed,
        textures=np.random.SeedSequence(seed).spawn(1)[0],
        backdrop=with_trails(land.mesh, land.trails, replace(terrain, **_surface(description)), builder.size),
        beyond=[*fields.far, *swarms_beyond(builder, fields, config, description.beyond, land)],
        litter=config.litter,
        objects=config.objects,
    )


def place_objects(builder: WorldBuilder, fields: Fields, config: Any, description: Description) -> None:
    """Place the objects of all layers in turn; the ground is raised over roots when the last of them are there."""
    rooted, missing = list[Instance](), set(description.roots)
    for name, layer in description.objects.items():
        first = len(builder.instances)
        layer.place(builder, fields, config, name)
        if name in missing:
            rooted += builder.instances[first:]
            missing.remove(name)
            if not missing:
                raise_roots(builder, rooted, rng_of(fields.seed, "roots"))


def _fields(description: Description, seed: int, corridors: Sequence[Line], config: Any) -> Fields:
    lines_of_trails = wandered(config.trails, config.wander, seed) if description.trails else []
    trails = make_trails(lines_of_trails, config.trail_width) if lines_of_trails else []
    lines = {
        name: Line.joined([Line.through(corners) for corners in network(corners_of, config.size, description.size)])
        for name, corners_of in description.lines.items()
    }
    nodes = grid_axes(config.size, hills_spacing(config.size))
    parameters = {name: float(getattr(config, name)) for name in description.parameters}
    parameters |= {"trail_width": trails[0].width if trails else 0.0, "spacing": float(nodes[0][1] - nodes[0][0])}
    return Fields(description.fields, parameters, seed, config.size, nodes, trails, corridors, lines)


def shape_relief(fields: Fields, description: Description) -> Array:
    """Heights [m] at the nodes: the relief, which begins with the land of the grids about the world."""
    fields.land = shape_surroundings(fields, description.surroundings)
    x, y = np.meshgrid(*fields.nodes, indexing="ij")
    return shape(fields, description.relief, np.zeros(x.shape) if fields.land is None else fields.land(x, y), "relief")


def lay_water(fields: Fields, description: Description) -> list[tuple[Mesh, float]]:
    """Set the level of the water, and dig its puddles; return its sheets with their heights [m]."""
    if description.puddles is not None:
        assert fields.height is not None
        larger = np.prod(fields.size) / np.prod(description.size)
        puddles = description.puddles.model_copy(update={"count": round(description.puddles.count * float(larger))})
        wet = dig_puddles(fields, puddles, fields.height, rng_of(fields.seed, "puddles"))
        fields.height, fields.water = wet.heights, wet.level
        fields.forget()
        return wet.sheets
    if description.water is None:
        return []
    water = description.water
    fields.water = level = fields.constant(water.level)
    reach = [s / 2 + water.beyond for s in fields.size]
    x, y = (np.linspace(-half, half, max(SHEET_NODES, round(2 * half / SHEET_SPACING))) for half in reach)
    return [(make_flat_sheet(water.name, x, y), level)]


def painted(values: Callable[[Expression], Array], ground: Mapping[str, Expression]) -> dict[str, Array]:
    """Share (nx, ny) of each material of the ground: each covers what is below it; the first one is everywhere."""
    shares: dict[str, Array] = {}
    for name, rule in ground.items():
        opacity = np.clip(values(rule), 0.0, 1.0) if shares else np.ones_like(values(TRAIL))
        shares = {other: share * (1.0 - opacity) for other, share in shares.items()}
        shares[name] = opacity
    return shares


def make_ground(fields: Fields, config: Any, description: Description) -> WorldBuilder:
    """Terrain of the relief with the microrelief of what covers it, in an empty world."""
    grounds: dict[str, Array] = {}
    values = fields.over(fields.nodes)
    on_trail = (not description.trail.painted) * np.clip(0.5 - values(TRAIL) / 0.2, 0.0, 1.0)
    shares = {name: (1.0 - on_trail) * share for name, share in painted(values, description.ground).items()}
    for name, share in (*shares.items(), (description.trail.material, on_trail)):
        ground = MATERIALS[name].ground_type
        if ground:
            grounds[ground] = grounds.get(ground, 0.0) + share
    cover = [(config.roughness_of(ground), share) for ground, share in grounds.items()]
    fine = grid_axes(config.size, config.grid)
    assert fields.height is not None
    heights = with_microrelief(fields.height, fields.nodes, fine, cover, rng_of(fields.seed, "microrelief"))
    field = make_heightfield(heights, config.grid, *fine)
    return WorldBuilder(field, config.size, fields.trails, fields.corridors, description.corridor_width)


def cover_ground(builder: WorldBuilder, fields: Fields, description: Description) -> Terrain:
    """Terrain with its materials; edges of trails are ragged."""
    axes = grid_axes(builder.size, cell := COVER * coarseness(builder.size))
    values, trail = fields.over(axes), description.trail
    shares = painted(values, description.ground)
    if fields.trails:
        ragged = fractal_noise(*axes, wavelength=1.4, octaves=3, rng=rng_of(fields.seed, "trail"), gain=0.7)
        distance = np.minimum(values(TRAIL), values(trail.also)) + trail.ragged * ragged
        trail_distance = make_raster(distance, cell, *axes)
    else:
        trail_distance = make_raster(np.full((2, 2), FAR), max(builder.size), *axes)
    return Terrain(
        field=builder.field,
        trail_distance=trail_distance,
        cover=make_raster(np.stack(list(shares.values()), axis=-1), cell, *axes),
        ground_materials=tuple(shares),
        **({"trail_material": "", "border_material": ""} if trail.painted else _surface(description)),
        border_width=0.0 if trail.painted else fields.constant(trail.border_width),
    )


def _surface(description: Description) -> dict[str, Any]:
    return {"trail_material": description.trail.material, "border_material": description.trail.border}


def wandered(trails: Trails, by: float, seed: int) -> Trails:
    """Return the corners of trails that the seed has moved ``by`` [m], smoothly, so that what meets still meets."""
    if not by:
        return trails
    aside = [waves(*WANDER, rng_of(seed, f"wander.{axis}")) for axis in "xy"]
    moved = []
    for corners in trails:
        points = Line.through(corners).points
        points = points[np.unique([*range(0, len(points), _CORNER), len(points) - 1])]
        points = points + by / np.sqrt(2.0) * np.stack([wave(*points.T) for wave in aside], axis=-1)
        moved.append(tuple((float(x), float(y)) for x, y in points))
    return tuple(moved)


def _tinted(fields: Fields, material: Material, rgb: Sequence[Constant]) -> Material:
    red, green, blue = (max(0.0, fields.constant(rule)) * own for rule, own in zip(rgb, material.tint, strict=True))
    return replace(material, tint=(red, green, blue))

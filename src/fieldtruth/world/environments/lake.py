# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The lake's shore (paper, 2.2.2): a lake, its shore, high grass, bushes and trees, two power poles with their wires.

The ground stands a few metres above the water and comes down to it over beaches and scarps.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Frozen, Number, Positive
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import Land, height_beyond, make_backdrop
from fieldtruth.world.environments.basin import basin_heights
from fieldtruth.world.environments.lake_flora import grow_beyond, plant_bushes, plant_trees, sow_grass
from fieldtruth.world.environments.lake_ground import cover_ground
from fieldtruth.world.environments.layout import Count, Individuals, Size
from fieldtruth.world.environments.power_line import string_line
from fieldtruth.world.environments.shore import make_shore
from fieldtruth.world.model import Mesh, World
from fieldtruth.world.placement import Site
from fieldtruth.world.trails import Line

FAR_POLES: Final = 2  # on either side of the world
WATER_TILE: Final = 30.0  # [m] of water that its texture covers


class LakeConfig(Frozen):
    """How the shore is laid out."""

    size: Size = (100.0, 50.0)  # [m] along x (north) and y (west)
    grid: Positive = 0.2  # [m] between the terrain's nodes
    water_level: Number = -3.0  # [m]
    edge: Number = -13.5  # [m], mean y of the water's edge; the lake lies east of it
    bends: Annotated[Number, Field(ge=0, le=6)] = 3.0  # [m], deviation of its points and coves
    bank: Annotated[Number, Field(ge=1, le=6)] = 3.4  # [m], the meadow's height above the water
    relief: Annotated[Number, Field(ge=0, le=1)] = 0.3  # [m], deviation of the meadow's swells
    line_y: Number = 17.5  # [m] of the power line
    pole_distance: Annotated[Number, Field(ge=20, le=80)] = 46.0  # [m]
    sag: Annotated[Number, Field(gt=0, le=0.05)] = 0.018  # of a wire, relative to its span
    waterside_trees: Count = 13
    meadow_trees: Count = 30
    waterside_bushes: Count = 12
    meadow_bushes: Count = 26
    individuals: Individuals = 3  # of each species
    grass: Annotated[Number, Field(ge=0, le=4)] = 1.0  # density of all high grass relative to what we think natural


def build_lake(seed: int, corridors: Sequence[Line], config: LakeConfig | None = None) -> World:
    """Lay out a lake's shore; ``corridors`` are lines that robots drive and that stay dry and free.

    Raises CrowdedWorldError where the rules leave no room for what the configuration asks for.
    """
    config = config if config is not None else LakeConfig()
    seeds = np.random.SeedSequence(seed).spawn(9)
    shape, wires, growth, woods, shrubs, grass, cover, land = (np.random.default_rng(s) for s in seeds[:-1])
    level, few = config.water_level, config.individuals
    shore = make_shore(
        config.size, config.grid, edge=config.edge, bends=config.bends, bank=config.bank, relief=config.relief,
        water_level=level, dry=corridors, rng=shape,
    )  # fmt: skip
    site = Site(shore.field, config.size, (), corridors)
    basin = basin_heights(edge=config.edge, bank=config.bank, water_level=level, rng=land)
    backdrop = _backdrop(site, basin, level, land)
    _flood(site, level)
    line = string_line(
        site, y=config.line_y, distance=config.pole_distance, sag=config.sag, far=FAR_POLES,
        ground_at=_ground_at(site, backdrop), rng=wires,
    )  # fmt: skip
    plant_trees(site, shore, line, config.waterside_trees, config.meadow_trees, few, growth, woods)
    plant_bushes(site, shore, config.waterside_bushes, config.meadow_bushes, few, shrubs)
    sow_grass(site, shore, level, config.grass, few, grass)
    return assemble(
        site, cover_ground(site, shore, cover), name="lake", seed=seed, textures=seeds[-1], backdrop=backdrop,
        beyond=[*line.beyond, *grow_beyond(site, backdrop, basin, line, level, land)], water_level=level,
    )  # fmt: skip


def _backdrop(site: Site, basin: Land, level: float, rng: np.random.Generator) -> Mesh:
    """The lake's bed and its other shores: mud up to the water where triangles are fine enough, meadow elsewhere."""

    def cover(x: Array, y: Array, _slope: Array) -> NDArray[np.intp]:
        return np.asarray((basin(x, y) < level + 0.1) & (np.hypot(x, y) < 110.0), np.intp)

    return make_backdrop(site.field, site.size, ("meadow", "mud"), rng, land=basin, cover=cover)


def _ground_at(site: Site, backdrop: Mesh) -> Callable[[Array], Array]:
    """Height [m] of the ground at places (n, 2) in the world and beyond its edge."""
    beyond, half = height_beyond(site.field, site.size, backdrop), np.array(site.size) / 2

    def height(places: Array) -> Array:
        inside = np.asarray((np.abs(places) < half).all(axis=1))
        x, y = np.where(inside[:, None], 2 * half, places).T  # what is inside must not disturb
        return np.where(inside, site.field.height_at(*places.T), beyond(x, y))

    return height


def _flood(site: Site, level: float) -> None:
    """The lake: one flat sheet that goes on below the land, so that the water's edge is where the ground meets it."""
    x, y = (np.linspace(low, high, 25) for low, high in ((-900.0, 900.0), (-900.0, 40.0)))
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((25, 25))], axis=-1).reshape(-1, 3)
    a = (np.arange(24)[:, None] * 25 + np.arange(24)).ravel()
    faces = np.stack([a, a + 25, a + 26, a, a + 26, a + 1], axis=-1).reshape(-1, 3)
    sheet = Mesh(
        name="lake",
        vertices=vertices.astype(np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (len(vertices), 1)),
        uv=(vertices[:, :2] / WATER_TILE).astype(np.float32),
        faces=faces.astype(np.int32),
        material=np.zeros(len(faces), np.int32),
        materials=("water",),
        footprint=0.0,
    )
    pose = np.eye(4)
    pose[2, 3] = level
    site.stand("water", sheet, pose, [])
    site.instances[-1] = replace(site.instances[-1], name="lake_1")


__all__ = ["LakeConfig", "build_lake"]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The shape of a lake's shore: where the water's edge runs, and the ground above and below the water.

The height depends on the distance to the water's edge: a beach or a scarp, then the bank, which flattens into the
meadow; under water a shelf, then the slope down to the bed. The land beyond the world's edge continues the near shore
and has a far shore and hills.

The cover is rough grass, bare earth on the scarps, mud and pebbles at the water.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Land
from fieldtruth.world.environments.lake.config import Config
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.grids import COVER, Line, coarseness, fractal_noise, grid_axes, make_heightfield, make_raster
from fieldtruth.world.materials import Roughness
from fieldtruth.world.model import Heightfield, Raster, Terrain
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import with_microrelief


def basin_heights(config: Config, rng: np.random.Generator) -> Land:
    """Heights [m] of the land around the lake as a function of x, y [m] of any shape.

    The near shore runs along x at y = ``config.edge``. The far shore is 130 to 200 m away, the lake's ends 250 to
    350 m; hills rise behind the far shore. North and south of the world the lake bends towards the robot, so that water
    is visible ahead when it drives along the shore.
    """
    edge = config.edge
    far, ends = edge - rng.uniform(130.0, 170.0), (-rng.uniform(250.0, 330.0), rng.uniform(250.0, 330.0))
    near_bends, far_bends = _waves(rng, (70.0, 160.0, 420.0), 2.5), _waves(rng, (60.0, 140.0, 330.0), 13.0)
    bays = rng.uniform(9.0, 15.0, 2)
    along, across = _waves(rng, (340.0, 610.0, 1300.0), 0.26), _waves(rng, (420.0, 900.0), 0.2)
    rough = _waves(rng, (83.0, 121.0, 190.0), 1.0)

    def heights(x: Array, y: Array) -> Array:
        leaving = np.clip(np.abs(x) / 40.0 - 1.25, 0.0, 1.0) ** 2  # in front of the world the shore is straight
        bay = np.where(x < 0, bays[0], bays[1]) * np.clip(5.0 - np.abs(x) / 50.0, 0.0, 1.0)
        off_near = edge + leaving * (bay + near_bends(x)) - y
        off_far = y - far - far_bends(x)
        out = np.minimum(np.minimum(off_near, off_far), 0.6 * np.minimum(x - ends[0], ends[1] - x))
        depth, inland = np.maximum(out, 0.0), np.maximum(-out, 0.0)
        rise = config.bank * (1.0 - np.exp(-inland / 9.0))
        hilly = np.logaddexp(0.0, 3.0 * (1.0 + along(x + 0.4 * y) + across(y - 0.3 * x))) / 3.0
        beyond = np.where(y < edge, 44.0, 24.0)  # the robot's own side is flatter
        away = np.maximum(inland - 12.0, 0.0) / 400.0
        hills = (beyond * hilly + 2.2 * rough(x + 0.5 * y) * np.minimum(away, 1.0)) * away / np.hypot(1.0, away)
        return np.asarray(config.water_level + np.where(out > 0, -np.minimum(0.3 * depth, 6.0), rise + hills))

    return heights


def _waves(rng: np.random.Generator, lengths: tuple[float, ...], height: float) -> Callable[[Array], Array]:
    """Sum of sines of the given wavelengths [m] with random phases and deviation ``height``."""
    phases = rng.uniform(0.0, 2.0 * np.pi, len(lengths))
    scale = height * np.sqrt(2.0 / len(lengths))

    def at(x: Array) -> Array:
        return np.asarray(sum(scale * np.sin(2 * np.pi * x / w + p) for w, p in zip(lengths, phases, strict=True)))

    return at


DEPTH: Final = 3.5  # [m] of the lake's bed
DRY: Final = 6.0  # [m] of land between a corridor's centre line and the water
WORN: Final = 2.4
"""Distance [m] from a corridor's centre line within which the ground is smoothed."""


@dataclass(frozen=True, kw_only=True)
class Shore:
    """A lake's shore: the ground, the distance to the water, and the steepness of the bank."""

    field: Heightfield
    inland: Raster
    """Distance [m] to the water's edge, below 0 in the lake."""
    scarp: Raster
    """0 at a beach, 1 where the bank ends in a scarp."""


def make_shore(
    config: Config, corridors: Sequence[Line], rng: np.random.Generator, fine_rng: np.random.Generator
) -> Shore:
    """Shape a shore along x with the lake at negative y; ``corridors`` stay on land."""
    x, y = grid_axes(config.size, spacing := hills_spacing(config.size))
    coves = fractal_noise(x, y, wavelength=34.0, octaves=4, rng=rng, gain=0.46)
    inland = y[None, :] - config.edge + config.bends * coves
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    off_corridor = np.full(inland.shape, np.inf)
    for line in corridors:
        off_corridor = np.minimum(off_corridor, line.distance(nodes).reshape(inland.shape))
    inland = _smooth_max(inland, DRY - off_corridor, 1.0) if corridors else inland
    inland = _signed_distance(inland > 0) * spacing
    turns = fractal_noise(x, y, wavelength=30.0, octaves=2, rng=rng, gain=0.4)
    scarp = 1.0 / (1.0 + np.exp(-2.4 * (turns + 0.15)))
    slumps = fractal_noise(x, y, wavelength=4.5, octaves=3, rng=rng, gain=0.45)
    swell = fractal_noise(x, y, wavelength=30.0, octaves=3, rng=rng, gain=0.4)
    above = _above(inland, scarp, slumps, config.bank) + config.relief * swell * np.clip(inland / 18.0, 0.0, 1.0)
    height = np.where(inland > 0, above, -_below(-inland, scarp))
    # Along corridors the bank has an even slope.
    worn = np.exp(-((off_corridor / WORN) ** 2))
    height += worn * (gaussian_filter(height, WORN / spacing, mode="nearest") - height)
    fine = grid_axes(config.size, config.grid)
    heights = with_microrelief(height + config.water_level, (x, y), fine, _cover(config, inland, height), fine_rng)
    return Shore(
        field=make_heightfield(heights, config.grid, *fine),
        inland=make_raster(inland, spacing, x, y),
        scarp=make_raster(scarp, spacing, x, y),
    )


def _cover(config: Config, inland: Array, height: Array) -> list[tuple[Roughness, Array]]:
    """Mud at and under the water, earth on the scarps, meadow elsewhere, with their shares of the ground."""
    mud = np.clip(1.5 - inland / 2.0, 0.0, 1.0)
    scarp = (1.0 - mud) * np.clip((np.hypot(*np.gradient(height, hills_spacing(config.size))) - 0.4) / 0.2, 0.0, 1.0)
    shares = {"mud": mud, "earth": scarp, "meadow": 1.0 - mud - scarp}
    return [(config.roughness_of(ground), share) for ground, share in shares.items()]


def _smooth_max(a: Array, b: Array, width: float) -> Array:
    return np.asarray(np.logaddexp(a / width, b / width) * width)


def _signed_distance(land: NDArray[np.bool_]) -> Array:
    """Distance [nodes] to the border of a mask, positive inside, smooth over the grid's steps."""
    inside, outside = distance_transform_edt(land), distance_transform_edt(~land)
    return np.asarray(gaussian_filter(np.where(land, inside - 0.5, 0.5 - outside), 2.5, mode="nearest"))


def _above(inland: Array, scarp: Array, slumps: Array, bank: float) -> Array:
    """Height [m] over the water at a distance [m] inland."""
    d = np.maximum(inland, 0.0)
    beach = 3.6 * (1.0 - scarp)
    rise = (bank - 0.8) * (1.0 - np.exp(-(np.maximum(d - beach, 0.0) ** 1.3) / 21.0)) + 0.022 * d
    strand = 0.09 * np.minimum(d, beach)
    # The scarp recedes where the bank has slumped.
    cut = np.clip((d - 0.4 - 0.5 * np.maximum(slumps, -0.6)) / 1.7, 0.0, 1.0)
    step = 1.0 * scarp**1.5 * cut * cut * (3.0 - 2.0 * cut) * np.exp(-np.maximum(d - 2.0, 0.0) / 7.0)
    return np.asarray(rise + strand + step + 0.03 * d * (d < 0.5))


def _below(out: Array, scarp: Array) -> Array:
    """Depth [m] at a distance [m] out from the water's edge."""
    d = np.maximum(out, 0.0)
    shelf = (0.09 + 0.16 * scarp) * d
    slope = 0.32 * np.maximum(d - 5.0, 0.0)
    return np.asarray(DEPTH * np.tanh((shelf + slope) / DEPTH))


def cover_ground(builder: WorldBuilder, shore: Shore, rng: np.random.Generator) -> Terrain:
    """Rough grass, drier on the swells, bare earth on the scarps; mud or pebbles at and under the water."""
    x, y = grid_axes(builder.size, node := COVER * coarseness(builder.size))
    nodes = np.meshgrid(x, y, indexing="ij")
    patch = fractal_noise(x, y, wavelength=15.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(x, y, wavelength=1.6, octaves=3, rng=rng, gain=0.7)
    stony = np.clip(0.5 + 1.6 * fractal_noise(x, y, wavelength=20.0, octaves=2, rng=rng) + 0.5 * fine, 0.0, 1.0)
    inland, height = shore.inland.at(*nodes), builder.field.height_at(*nodes)
    steep = np.hypot(*np.gradient(gaussian_filter(height, 0.3 / node, mode="nearest"), node))
    scarp = np.clip((steep - 0.5 + 0.12 * fine) / 0.2, 0.0, 1.0)
    wet = np.clip(1.0 - (inland - 0.9 - 1.6 * (1.0 - shore.scarp.at(*nodes)) + 0.55 * fine) / 0.7, 0.0, 1.0)
    litter = _below_crowns(builder, x, y, fine)
    dry = np.clip(0.28 + 0.3 * patch + 0.24 * fine, 0.0, 0.9)
    turf = (1.0 - wet) * (1.0 - scarp) * (1.0 - litter)
    drowned = np.clip(-inland / 3.0, 0.0, 0.85)
    cover = np.stack(
        [
            turf * (1.0 - dry),
            turf * dry,
            (1.0 - wet) * scarp * (1.0 - litter),
            (1.0 - wet) * litter,
            wet * (1.0 - stony * (1.0 - drowned)),
            wet * stony * (1.0 - drowned),
        ],
        axis=-1,
    )
    no_trail = np.full((2, 2), 1e3, np.float32)
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(no_trail, max(builder.size), x, y),
        cover=make_raster(cover, node, x, y),
        ground_materials=("rough_grass", "dry_grass", "soil", "litter", "mud", "pebbles"),
        trail_material="gravel",
        border_material="gravel",
    )


def _below_crowns(builder: WorldBuilder, x: Array, y: Array, fine: Array) -> Array:
    """Share of the ground [0, 1] covered by leaves, around trunks and bushes."""
    share = np.zeros((len(x), len(y)))
    for instance in builder.instances:
        if not instance.kind.endswith(("tree", "bush")):
            continue
        at = instance.world_from_object[:2, 3]
        radius = 1.1 if instance.kind.endswith("tree") else 0.7
        i, j = (np.flatnonzero(np.abs(axis - c) < radius + 1.0) for axis, c in zip((x, y), at, strict=True))
        away = np.hypot(*np.meshgrid(x[i] - at[0], y[j] - at[1], indexing="ij"))
        block = np.ix_(i, j)
        share[block] = np.maximum(share[block], np.clip((radius - away) / 0.5 + 0.8 * fine[block], 0.0, 1.0))
    return share

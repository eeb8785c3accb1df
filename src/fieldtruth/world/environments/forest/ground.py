# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of the forest: uneven soil, pits, mounds and roots, trodden and rutted trails; needles, leaves and moss."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.environments.layout import HILLS, hills_spacing
from fieldtruth.world.grids import (
    COVER,
    Trail,
    coarseness,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    signed_distance,
)
from fieldtruth.world.model import Heightfield, Raster, Terrain
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import Axes, limit_slope, pits_and_mounds, root_swells, slope_limit, with_microrelief

CONIFERS = ("spruce", "pine")
BROADLEAVES = ("beech", "birch", "oak")

UPROOTED: Final = 0.006
"""Density [1/m^2] of pits and mounds."""
OFF_TRAIL: Final = 3.0
"""Distance [m] of pits and mounds from a trail's edge."""

RUT_OFF_CENTRE, RUT_WIDTH, RUT_DEPTH = 0.55, 0.12, 0.035
"""Distance [m] of ruts from a trail's centre line, the deviation of their Gaussian profile, and mean depth."""

ROOTS: Final = 0.1
"""Largest spacing [m] of the terrain's nodes on which roots can be seen."""


def make_heights(
    config: Config, trails: Sequence[Trail], rng: np.random.Generator, fine_rng: np.random.Generator
) -> Heightfield:
    """Swells, hollows, and the pits and mounds of uprooted trees; trodden flat along the trails."""
    spacing = hills_spacing(config.size)
    (x, y), fine = grid_axes(config.size, spacing), grid_axes(config.size, config.grid)
    swell = fractal_noise(x, y, wavelength=34.0, octaves=4, rng=rng, gain=0.45)
    off_trail = signed_distance(trails, x, y).astype(np.float64)
    heights = config.relief * swell + _uprooted((x, y), spacing, off_trail, rng)
    on_trail = 1.0 / (1.0 + np.exp((off_trail - 0.5) / 0.35))
    trodden = gaussian_filter(heights, 1.2 / spacing) - 0.05
    heights = heights * (1.0 - on_trail) + trodden * on_trail
    heights = limit_slope(heights, spacing, slope_limit(off_trail, within=10.0, beyond=32.0, near=0.6, far=5.0))
    bare = np.clip(0.5 - off_trail / 0.4, 0.0, 1.0)
    cover = [(config.roughness_of("trodden_earth"), bare), (config.roughness_of("forest_floor"), 1.0 - bare)]
    heights += _ruts((x, y), np.abs(off_trail + config.trail_width / 2), RUT_WIDTH * (spacing / HILLS), fine_rng)
    heights = with_microrelief(heights - heights.mean(), (x, y), fine, cover, fine_rng)
    return make_heightfield(heights, config.grid, *fine)


def _uprooted(nodes: Axes, spacing: float, off_trail: Array, rng: np.random.Generator) -> Array:
    """Heights [m] of pits and mounds that are ``UPROOTED`` per m^2, off the trails."""
    count = round(UPROOTED * float(np.prod([np.ptp(axis) for axis in nodes])))
    positions = rng.uniform([axis[0] for axis in nodes], [axis[-1] for axis in nodes], (count, 2))
    apart = make_raster(off_trail, spacing, *nodes).at(*positions.T) > OFF_TRAIL
    return pits_and_mounds(*nodes, positions[apart], rng)


def _ruts(nodes: Axes, off_centre: Array, width: float, rng: np.random.Generator) -> Array:
    """Heights [m] of two ruts along each trail, deep in parts and elsewhere worn away; shallower if they are wide."""
    depth = RUT_DEPTH * np.clip(0.5 + 0.6 * fractal_noise(*nodes, wavelength=9.0, octaves=2, rng=rng), 0.0, 1.4)
    depth *= RUT_WIDTH / width
    return np.asarray(-depth * np.exp(-0.5 * ((off_centre - RUT_OFF_CENTRE) / width) ** 2))


def raise_roots(builder: WorldBuilder, rng: np.random.Generator) -> None:
    """Raise the ground over the roots of the trees, snags and stumps, on trails as in the litter.

    Roots are narrower than the nodes of a coarse terrain; there is only the swell about a trunk.
    """
    field = builder.field
    trunks = []
    for instance in builder.instances:
        if instance.kind in (*CONIFERS, *BROADLEAVES, "snag", "stump"):
            trunk = builder.meshes[instance.mesh].colliders[0]
            scale = float(np.cbrt(np.linalg.det(instance.world_from_object[:3, :3])))
            trunks.append((*instance.world_from_object[:2, 3], scale * trunk.size[0]))
    x, y = grid_axes(builder.size, field.spacing)
    heights = field.heights + root_swells(x, y, trunks, rng if field.spacing <= ROOTS else None).astype(np.float32)
    builder.field = replace(field, heights=heights)


def make_glades(size: tuple[float, float], rng: np.random.Generator) -> Raster:
    """Light on the forest floor, about 0 on average: high in glades, low in shade."""
    x, y = grid_axes(size, 0.5)
    return make_raster(fractal_noise(x, y, wavelength=13.0, octaves=3, rng=rng), 0.5, x, y)


def cover_ground(builder: WorldBuilder, glades: Raster, rng: np.random.Generator) -> Terrain:
    """Needles below conifers, leaves below broadleaved trees, moss in patches, humus in between."""
    x, y = grid_axes(builder.size, cell := COVER * coarseness(builder.size))
    px, py = np.meshgrid(x, y, indexing="ij")
    distance = signed_distance(builder.trails, x, y)
    fine = fractal_noise(x, y, wavelength=1.3, octaves=3, rng=rng, gain=0.7)
    patch = fractal_noise(x, y, wavelength=7.0, octaves=4, rng=rng, gain=0.6)
    conifers, broad = (_crown_share(builder, (x, y), cell, species) for species in (CONIFERS, BROADLEAVES))
    leaves = np.clip(0.5 + 0.55 * (broad - conifers) + 0.22 * patch, 0.05, 0.95)
    moss = np.clip(0.25 * patch + 0.3 * fine - 0.18 * glades.at(px, py) - 0.12, 0.0, 0.9) * (distance > 0.2)
    soil = np.clip(0.22 - 0.25 * patch + 0.2 * fine, 0.0, 0.5)
    rest = (1.0 - moss) * (1.0 - soil)
    cover = np.stack([rest * (1.0 - leaves), rest * leaves, moss, (1.0 - moss) * soil], axis=-1)
    ragged = distance + 0.16 * fine + 0.1 * patch
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(ragged, cell, x, y),
        cover=make_raster(cover, cell, x, y),
        ground_materials=("needles", "litter", "moss", "soil"),
        trail_material="path",
        border_material="path_edge",
        border_width=0.22,
    )


def _crown_share(builder: WorldBuilder, nodes: Axes, spacing: float, species: Sequence[str]) -> Array:
    """Share (nx, ny) in [0, 1] to which nodes are below crowns of some species."""
    x, y = nodes
    step = max(1, round(0.5 / spacing))
    cell = step * spacing
    marks = np.zeros((len(x[::step]), len(y[::step])))
    for instance in builder.instances:
        if instance.kind in species:
            i, j = np.round((instance.world_from_object[:2, 3] - (x[0], y[0])) / cell).astype(int)
            marks[i, j] += 1.0
    spread = gaussian_filter(marks, 1.6 / cell) * (15.0 / cell**2)
    coarse = make_raster(np.clip(spread, 0, 1), cell, x, y)
    return coarse.at(*np.meshgrid(x, y, indexing="ij"))

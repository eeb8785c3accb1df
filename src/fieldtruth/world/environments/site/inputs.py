# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the maps of a site have within it, and what was filled, assumed or left out, in words."""

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core.geodesy import Origin
from fieldtruth.maps.canopy import read_canopy, read_canopy_points
from fieldtruth.maps.elevation import Elevation, read_ground_points, read_raster
from fieldtruth.maps.imagery import read_classes
from fieldtruth.maps.inventory import read_inventory
from fieldtruth.maps.osm import StreetMap, read_osm
from fieldtruth.maps.stems import read_stems, with_stems
from fieldtruth.maps.trees import Tree, fill_canopy, find_trees
from fieldtruth.world.build import needed_libraries
from fieldtruth.world.environments.site.config import Config

TABLES: Final = (".csv", ".tsv", ".txt", ".gpkg", ".geojson", ".json", ".shp")
"""Endings of inventories of trees."""
LASER: Final = (".las", ".laz")


_CLASS_STEP: Final = 1.0  # [m] between the positions at which land cover is counted


class MappedTrees(NamedTuple):
    """Trees of a file within a site, and what is to be said of them."""

    trees: list[Tree]
    notes: tuple[str, ...]


class Inputs(NamedTuple):
    """What was read of a site's files; None of those that it does not have."""

    elevation: Elevation | None
    trees: MappedTrees | None
    streets: StreetMap | None


def inputs_of(layout: Mapping[str, Any]) -> tuple[Config, Inputs]:
    """Read the maps of a layout of a site.

    Raises:
        ConfigurationError: as ``read_inputs``, or a library for maps is not installed.
    """
    config = Config.model_validate(layout)
    with needed_libraries():
        return config, read_inputs(config)


def read_inputs(config: Config) -> Inputs:
    """Read the ground, the trees and OpenStreetMap of a site.

    Raises:
        ConfigurationError: a file that cannot be read, or that does not cover the site.
    """
    elevation = read_elevation(config)
    trees = None if config.trees is None else read_trees(config, config.place)
    streets = None if config.map is None else read_osm(config.map.path, config.place, config.size)
    return Inputs(elevation, trees, streets)


def read_elevation(config: Config, spacing: float = 0.0) -> Elevation | None:
    """Read the ground; None without an elevation model. Of a raster, heights ``spacing`` [m] apart may do."""
    file = config.elevation
    if file is None:
        return None
    read = read_ground_points if file.path.suffix.lower() in LASER else partial(read_raster, spacing=spacing)
    return read(
        file.path,
        config.place,
        config.size,
        crs=file.crs,
        reference=file.reference,
        geoid_height=file.geoid_height,
    )


def read_trees(config: Config, origin: Origin) -> MappedTrees:
    """Read the trees of an inventory, or find them in a canopy; none without such a file."""
    file = config.trees
    if file is None:
        return MappedTrees([], ())
    ending = file.path.suffix.lower()
    if ending in TABLES:
        found = read_inventory(file.path, origin, config.size, crs=file.crs, columns=file.columns)
        outside = (f"{found.outside} outside of the site",) if found.outside else ()
        return MappedTrees(list(found.trees), (*outside, *found.notes))
    read = read_canopy_points if ending in LASER else read_canopy
    canopy = read(file.path, origin, config.size, crs=file.crs)
    trees = find_trees(canopy)
    lower = fill_canopy(canopy, trees)
    cells = f"{len(trees):,} trees found in a canopy model of {np.sqrt(canopy.cell_area):.2g} m cells, "
    cells += f"which {len(lower):,} lower ones fill"
    trees += lower
    if ending in LASER and (seen := read_stems(file.path, origin, config.size, crs=file.crs, canopy=canopy)):
        trees = with_stems(trees, seen, canopy)
        cells += f"; {len(seen):,} stems seen from the ground"
    missing = (f"{canopy.missing:,} cells without data count as bare ground",) if canopy.missing else ()
    return MappedTrees(trees, (cells, *missing))


def describe(config: Config, inputs: Inputs) -> Iterator[str]:
    """Yield a line for each file of a site: what was read, filled, assumed and left out."""
    if config.elevation is not None and inputs.elevation is not None:
        ground, filled = inputs.elevation, int(inputs.elevation.filled.sum())
        gaps = f"{filled:,} of {ground.filled.size:,} cells had no data and were filled" if filled else "no gaps"
        yield f"ground: {config.elevation.path.name}: cells of {ground.resolution:.3g} m, {gaps}; {ground.note}"
    else:
        yield "ground: no elevation; gently rolling"
    if config.trees is not None and inputs.trees is not None:
        notes = "".join(f"; {note}" for note in inputs.trees.notes)
        yield f"trees: {config.trees.path.name}: {len(inputs.trees.trees):,} trees{notes}"
    if config.map is not None and inputs.streets is not None:
        counts = Counter(each.kind for each in inputs.streets.features)
        found = ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())) or "nothing"
        broken = f"; {inputs.streets.incomplete} incomplete ways and areas" if inputs.streets.incomplete else ""
        yield f"map: {config.map.path.name}: {found}{broken}; © OpenStreetMap contributors, ODbL"
    if (cover := config.land_cover) is not None:
        x, y = (np.arange(-side / 2, side / 2, _CLASS_STEP) for side in config.size)
        codes = read_classes(cover.path, config.place, config.size, (x, y), crs=cover.crs)
        shares = [(name, float((codes == code).mean())) for code, name in cover.classes.items()]
        left = 1.0 - sum(share for _, share in shares)
        named = ", ".join(f"{share:.0%} {name}" for name, share in shares if share)
        yield f"land cover: {cover.path.name}: {named or 'none of the classes'}; {left:.0%} of other classes or no data"
    if config.photo is not None:
        yield f"photo: {config.photo.path.name}: colour of the ground"

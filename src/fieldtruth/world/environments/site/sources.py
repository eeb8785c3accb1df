# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of a site as they are read: ground, trees with species that grow here, lines and areas of surfaces."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from matplotlib.path import Path as Outline
from scipy.ndimage import label

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.geodesy import Origin
from fieldtruth.maps.imagery import read_classes
from fieldtruth.maps.osm import Feature, read_osm
from fieldtruth.maps.tags import metres
from fieldtruth.maps.trees import Tree
from fieldtruth.world.environments.site.config import Config, LandCoverFile
from fieldtruth.world.environments.site.inputs import read_trees
from fieldtruth.world.plants import TREES
from fieldtruth.world.relief import Axes

CELL: Final = 1.0
"""Distance [m] between the positions at which land cover is asked for woods."""
USUAL: Final = 14.0
"""Height [m] of trees whose height no map says, in the mean; they vary by a quarter."""
GENERA: Final[Mapping[str, str]] = {
    "acer": "lime", "aesculus": "lime", "alnus": "alder", "betula": "birch", "carpinus": "beech", "fagus": "beech",
    "fraxinus": "lime", "larix": "pine", "abies": "spruce", "picea": "spruce", "pseudotsuga": "spruce", "pinus": "pine",
    "platanus": "lime", "populus": "birch", "prunus": "oak", "quercus": "oak", "salix": "willow", "tilia": "lime",
    "ulmus": "lime", "needleleaved": "spruce", "broadleaved": "beech",
}  # fmt: skip
"""Species of ours by genus, or by type of leaf: the one whose crown and bark are nearest in form."""


class Stem(NamedTuple):
    """A tree to plant: position and height [m], species; radius of its crown, diameter of its trunk [m], or NaN."""

    x: float
    y: float
    height: float
    crown: float
    species: str
    diameter: float = float("nan")


def read_features(config: Config, origin: Origin) -> list[Feature]:
    """Read OpenStreetMap; empty without it."""
    return [] if config.map is None else read_osm(config.map.path, origin, config.size).features


def read_stems(config: Config, origin: Origin, features: Sequence[Feature], rng: np.random.Generator) -> list[Stem]:
    """Read trees of an inventory or a canopy, and of the map; woods without any get random ones."""
    trees = [*read_trees(config, origin).trees]
    trees += [_mapped(each) for each in features if each.kind == "tree"]
    trees += [_planted(each, xy) for each in features for xy in _rows(each)]
    at = np.array([(tree.x, tree.y) for tree in trees]).reshape(-1, 2)
    for wood in features:
        if wood.kind == "wood" and wood.closed and not inside(wood, at).any():
            trees += [Tree(x, y, None, None, None, wood.tags.get("leaf_type")) for x, y in _strewn(wood, config, rng)]
    if config.land_cover is not None and "wood" in config.land_cover.classes.values():
        at = np.array([(tree.x, tree.y) for tree in trees]).reshape(-1, 2)
        trees += [Tree(x, y, None, None, None, None) for x, y in _strewn_cover(config, config.land_cover, at, rng)]
    names, shares = list(config.species), np.array(list(config.species.values()))
    stems = []
    for tree in trees:
        drawn = names[int(rng.choice(len(names), p=shares / shares.sum()))]
        height = USUAL * float(np.clip(rng.normal(1.0, 0.25), 0.4, 1.6)) if tree.height is None else tree.height
        crown = np.nan if tree.crown_radius is None else tree.crown_radius
        diameter = np.nan if tree.diameter is None else tree.diameter
        stems.append(Stem(tree.x, tree.y, max(height, 1.5), crown, species_of(tree.species) or drawn, diameter))
    return stems


ROW: Final = 8.0
"""Distance [m] between the trees of a row."""
ORCHARD, FRUIT = 4.5, (3.2, 4.6)
"""Distance [m] between the trees of an orchard, and their heights."""


def _rows(feature: Feature) -> Array:
    """Positions (n, 2) [m] of the trees of a row or an orchard; none of others."""
    if feature.kind == "tree_row" and not feature.closed:
        return along(feature.geometry, ROW)
    return filled(feature, ORCHARD) if feature.kind == "orchard" and feature.closed else np.zeros((0, 2))


def _planted(feature: Feature, xy: Array) -> Tree:
    x, y = xy.tolist()
    if feature.kind == "tree_row":
        return Tree(x, y, feature.height, None, None, feature.tags.get("species") or feature.tags.get("leaf_type"))
    low, high = FRUIT
    share = (round(97.0 * x) ^ round(89.0 * y)) % 101 / 100.0
    return Tree(x, y, low + share * (high - low), None, None, "apple" if "apple" in TREES else "oak")


def along(line: Array, apart: float) -> Array:
    """Points (n, 2) along a polyline, ``apart`` [m] from one to the next."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    steps = np.arange(apart / 2.0, length[-1], apart)
    return np.stack([np.interp(steps, length, line[:, k]) for k in range(2)], axis=-1)


def filled(area: Feature, apart: float) -> Array:
    """Points (n, 2) of a square lattice in an area, with rows along its longest side."""
    sides = np.roll(area.geometry, -1, axis=0) - area.geometry
    dx, dy = sides[np.argmax(np.hypot(*sides.T))]
    turn = np.array([[dx, dy], [-dy, dx]]) / np.hypot(dx, dy)
    own = area.geometry @ turn.T
    steps = [np.arange(own[:, k].min() + apart / 2.0, own[:, k].max(), apart) for k in (0, 1)]
    lattice = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2) @ turn
    return np.asarray(lattice[inside(area, lattice)])


def _mapped(feature: Feature) -> Tree:
    x, y = feature.geometry[0].tolist()
    tags = feature.tags
    crown, girth = metres(tags.get("crown")), metres(tags.get("circumference"))
    species = tags.get("species") or tags.get("leaf_type")
    return Tree(x, y, feature.height, crown and crown / 2.0, girth and girth / np.pi, species)


def species_of(text: str | None) -> str | None:
    """Return our species of a name, Latin or English, or of a type of leaf; None if it says nothing."""
    words = (text or "").lower().replace("_", " ").split()
    return next((GENERA.get(word, word) for word in words if word in GENERA or word in TREES), None)


def inside(feature: Feature, points: Array) -> Mask:
    """Mask (n,) of the points (n, 2) [m] that are in an area, and not in its holes."""
    found = Outline(feature.geometry).contains_points(points)
    for hole in feature.holes:
        found &= ~Outline(hole).contains_points(points)
    return np.asarray(found, np.bool_)


def _strewn(wood: Feature, config: Config, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Positions in an area."""
    xy = _stratified(wood.geometry.min(axis=0), wood.geometry.max(axis=0), config, rng)
    return [(x, y) for x, y in xy[inside(wood, xy)].tolist()]


def _strewn_cover(
    config: Config, file: LandCoverFile, trees: Array, rng: np.random.Generator
) -> list[tuple[float, float]]:
    """Positions in those woods of a raster, cells that touch each other, in which there are no trees (n, 2) [m]."""
    half = np.array(config.size) / 2
    x, y = (np.arange(-side, side + CELL / 2, CELL) for side in half)
    classes = read_classes(file.path, config.place, config.size, (x, y), crs=file.crs)
    wooded = np.isin(classes, [code for code, name in file.classes.items() if name == "wood"])
    woods, _ = label(wooded, np.ones((3, 3)))

    def wood_at(xy: Array) -> Array:
        i, j = np.rint((xy + half) / CELL).astype(int).T
        return np.asarray(woods[i, j])

    known = trees[(np.abs(trees) <= half).all(axis=1)]
    xy = _stratified(-half, half, config, rng)
    return [(a, b) for a, b in xy[~np.isin(wood_at(xy), [0, *wood_at(known)])].tolist()]


def _stratified(low: Array, high: Array, config: Config, rng: np.random.Generator) -> Array:
    """Positions (n, 2) [m] in a rectangle, stratified, so that trees neither clump nor line up."""
    cells = np.maximum(1, np.ceil((high - low) * np.sqrt(config.trees_per_m2))).astype(int)
    grid = np.stack(np.meshgrid(*(np.arange(c) for c in cells), indexing="ij"), axis=-1).reshape(-1, 2)
    return np.asarray(low + (grid + rng.random(grid.shape)) / cells * (high - low))


def area_mask(features: Sequence[Feature], nodes: Axes) -> Mask:
    """Mask (nx, ny) of the nodes in some of the areas."""
    x, y = nodes
    mask = np.zeros((len(x), len(y)), np.bool_)
    for each in features:
        low, high = each.geometry.min(axis=0), each.geometry.max(axis=0)
        i, j = (slice(*np.searchsorted(axis, (low[k], high[k]))) for k, axis in enumerate((x, y)))
        points = np.stack(np.meshgrid(x[i], y[j], indexing="ij"), axis=-1)
        mask[i, j] |= inside(each, points.reshape(-1, 2)).reshape(points.shape[:2])
    return mask

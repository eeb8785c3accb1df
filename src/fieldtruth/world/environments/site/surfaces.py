# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Surfaces of a site: what covers the land by its use, and roads, tracks and paths by their material.

What the land is used for comes from a raster of classes where it has one of the layout's ``classes``, else from the
areas of the map, of which the smaller is drawn over the larger. Roads are asphalt, tracks and paths what their tags
``surface`` and ``tracktype`` say.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.core.geodesy import Origin
from fieldtruth.maps.imagery import read_classes, read_colours
from fieldtruth.maps.osm import Feature
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.sources import area_mask
from fieldtruth.world.grids import (
    COVER,
    Line,
    Trail,
    coarseness,
    fractal_noise,
    grid_axes,
    make_raster,
    signed_distance,
)
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Heightfield, Raster, Terrain, water_at
from fieldtruth.world.relief import Axes
from fieldtruth.world.textures import TEXTURES

MATERIAL: Final[Mapping[str, str]] = {
    "lawn": "lawn", "grass": "lawn", "meadow": "rough_grass", "farmland": "soil", "soil": "soil", "heath": "dry_grass",
    "scrub": "rough_grass", "wood": "litter", "forest_floor": "litter", "orchard": "lawn", "sand": "soil",
    "bare_rock": "rock_face", "scree": "scree", "wetland": "mud", "water": "mud",
}  # fmt: skip
"""Material of the ground by the use of the land."""
PAVED: Final[Mapping[str, str]] = {
    **dict.fromkeys(("asphalt", "paved", "concrete", "chipseal", "concrete:plates", "concrete:lanes"), "asphalt"),
    **dict.fromkeys(("gravel", "fine_gravel", "compacted", "pebblestone"), "gravel"),
    **dict.fromkeys(("sett", "paving_stones", "cobblestone", "unhewn_cobblestone", "bricks"), "setts"),
    **dict.fromkeys(("ground", "dirt", "earth", "grass", "mud", "sand", "unpaved", "woodchips"), "path"),
}  # fmt: skip
"""Material of trails by the tag ``surface`` (OSM wiki, Key:surface)."""
_GRADES: Final = {"grade1": "asphalt", "grade2": "gravel"}
"""Material of tracks by ``tracktype``: solid, and compacted gravel; others are earth (OSM wiki, Key:tracktype)."""
_USUAL: Final = {"road": "asphalt", "parking": "asphalt"}
_RAGGED: Final[Mapping[str, float]] = {"asphalt": 0.2, "setts": 0.3, "gravel": 0.6, "path": 1.0}
"""Raggedness of a trail's edge by material, relative to that of earth."""
AREA_EDGE: Final = 0.4
"""Standard deviation [m] of the transition between areas."""
CANOPY: Final = 1.6
"""Distance [m] beyond a trunk's crown over which litter gives way to grass."""
MIDDLE: Final = 0.35
"""Half width [m] of the strip of grass between the wheel tracks of an earth track."""


class Way(NamedTuple):
    """A trail of the map, its material, and whether it is a track of two wheels."""

    trail: Trail
    material: str
    is_track: bool


def material_of(feature: Feature) -> str:
    """Material of a road, a track, a path or a parking place."""
    named = PAVED.get(feature.tags.get("surface", "").split(";")[0])
    if named is None and feature.kind == "track":
        named = _GRADES.get(feature.tags.get("tracktype", ""))
    return named or _USUAL.get(feature.kind, "path")


def ways_of(features: Iterable[Feature], config: Config) -> list[Way]:
    """Roads, tracks and paths of the map that are lines."""
    ways = []
    for each in features:
        if each.kind in ("path", "track", "road") and not each.closed and len(each.geometry) > 1:
            corners = [(float(x), float(y)) for x, y in each.geometry]
            width = config.trail_width if each.width is None else each.width
            line = Line.through(corners, smooth=each.kind != "road")
            ways.append(Way(Trail(line, width), material_of(each), each.kind == "track"))
    return ways


class LandUse(NamedTuple):
    """Names of uses, and the row of that of each node of a grid."""

    names: tuple[str, ...]
    number: NDArray[np.int16]  # (nx, ny)
    spacing: float
    corner: tuple[float, float]

    def is_(self, xy: Array, *names: str) -> Mask:
        """Mask (n,) of the positions (n, 2) [m] whose land has one of some uses."""
        rows = [self.names.index(name) for name in names if name in self.names]
        i, j = (
            np.clip(np.rint((xy[:, k] - self.corner[k]) / self.spacing).astype(int), 0, self.number.shape[k] - 1)
            for k in (0, 1)
        )
        return np.isin(self.number[i, j], rows)


def land_use(config: Config, features: Sequence[Feature], origin: Origin) -> LandUse:
    """Return what the land is used for: the site's ``surface``, where neither raster nor map say anything else."""
    x, y = grid_axes(config.size, COVER * coarseness(config.size))
    names: list[str] = [config.surface]
    number = np.zeros((len(x), len(y)), np.int16)

    def row(name: str) -> int:
        if name not in names:
            names.append(name)
        return names.index(name)

    for each in features:
        if each.closed and each.kind in MATERIAL:
            number[area_mask([each], (x, y))] = row(each.kind)
    if (file := config.land_cover) is not None:
        classes = read_classes(file.path, origin, config.size, (x, y), crs=file.crs)
        for code, name in file.classes.items():
            number[classes == code] = row(name)
    return LandUse(tuple(names), number, float(x[1] - x[0]), (float(x[0]), float(y[0])))


class Paths(NamedTuple):
    """Signed distance [m] to the edge of the nearest trail of each material, and to the middle of tracks of earth."""

    edges: Mapping[str, Raster]
    middle: Raster

    @property
    def nearest(self) -> Array:
        """Signed distance (nx, ny) [m] to the edge of the nearest trail."""
        return np.asarray(np.min([edge.values for edge in self.edges.values()], axis=0))


_FAR: Final = 1e3  # [m], where there are no trails


def distances(ways: Sequence[Way], features: Sequence[Feature], nodes: Axes) -> Paths:
    """Distances to trails, and to roads and parking places that are areas."""
    shape, spacing = (len(nodes[0]), len(nodes[1])), float(nodes[0][1] - nodes[0][0])
    far = np.full(shape, _FAR, np.float32)
    edges: dict[str, Float32Array] = {}
    for name in dict.fromkeys(way.material for way in ways):
        edges[name] = signed_distance(grouped(way.trail for way in ways if way.material == name), *nodes)
    for each in features:
        if each.closed and each.kind in ("road", "path", "track", "parking"):
            inside = area_mask([each], nodes)
            if inside.any():
                own = (distance_transform_edt(~inside) - distance_transform_edt(inside)) * spacing
                edges[material_of(each)] = np.minimum(edges.get(material_of(each), far), own.astype(np.float32))
    tracks = [Trail(way.trail.line, 0.0) for way in ways if way.is_track and way.material == "path"]
    middle = signed_distance(grouped(tracks), *nodes) if tracks else far
    rasters = {name: make_raster(edge, spacing, *nodes) for name, edge in (edges or {"path": far}).items()}
    return Paths(rasters, make_raster(middle, spacing, *nodes))


def grouped(trails: Iterable[Trail]) -> list[Trail]:
    """Trails of one width as one with gaps, so that a search is as fast for a town as for a park."""
    widths: dict[float, list[Line]] = {}
    for trail in trails:
        widths.setdefault(trail.width, []).append(trail.line)
    return [Trail(Line.joined(lines) if len(lines) > 1 else lines[0], width) for width, lines in widths.items()]


def cover_ground(
    field: Heightfield,
    config: Config,
    land: LandUse,
    paths: Paths,
    shade: Raster,
    water: float | Raster | None,
    origin: Origin,
    rng: np.random.Generator,
) -> Terrain:
    """The land's surfaces in the open; litter and moss below crowns; bare patches; mud by the water; trails."""
    x, y = grid_axes(config.size, cell := COVER * coarseness(config.size))
    fine = fractal_noise(x, y, wavelength=1.3, octaves=3, rng=rng, gain=0.7).astype(np.float32)
    patch = fractal_noise(x, y, wavelength=7.0, octaves=4, rng=rng, gain=0.6).astype(np.float32)
    crowns = shade.at(x[:, None], y).astype(np.float32)
    below = np.clip(crowns + 0.15 * fine, 0.0, 1.0)
    moss = below * np.clip(0.25 * patch + 0.3 * fine - 0.1, 0.0, 0.7)
    bare = (1.0 - below) * np.clip(0.2 * patch + 0.25 * fine - 0.25, 0.0, 0.5)
    shares = {"litter": below - moss, "moss": moss, "soil": bare}
    open_ground = 1.0 - below - bare
    for row, use in enumerate(land.names):
        share = gaussian_filter((land.number == row).astype(np.float32), AREA_EDGE / cell)
        shares[MATERIAL[use]] = shares.get(MATERIAL[use], 0.0) + open_ground * share
    if water is not None:
        above = field.height_at(x[:, None], y) - water_at(water, x[:, None], y)
        _lay(shares, "mud", np.clip(1.5 - above / 0.2 + 0.5 * fine, 0.0, 1.0).astype(np.float32))
    distance = np.full(fine.shape, _FAR, np.float32)
    for name, edge in sorted(paths.edges.items(), key=lambda pair: -_RAGGED[pair[0]]):  # the firmest on top
        ragged = (edge.at(x[:, None], y) + _RAGGED[name] * (0.12 * fine + 0.06 * patch)).astype(np.float32)
        distance = np.minimum(distance, ragged)
        on = np.clip(0.5 - ragged / 0.12, 0.0, 1.0)
        if name == "path":
            strip = (MIDDLE + 0.15 * fine - paths.middle.at(x[:, None], y)) / 0.15
            on = on * (1.0 - 0.85 * np.clip(strip, 0.0, 1.0))
        _lay(shares, name, on)
    weights = np.clip(np.stack(list(shares.values()), axis=-1), 0.0, 1.0).astype(np.float32)
    return Terrain(
        field=field,
        trail_distance=make_raster(distance, cell, x, y),
        cover=make_raster(weights, cell, x, y),
        ground_materials=tuple(shares),
        trail_material="",
        border_material="",
        colour=_colour(config, tuple(shares), weights, (x, y), crowns, origin),
    )


def _lay(shares: dict[str, Any], name: str, share: Any) -> None:
    """Lay a share (nx, ny) of a material over the others."""
    for other in shares:
        shares[other] = shares[other] * (1.0 - share)
    shares[name] = shares.get(name, 0.0) + share


SMOOTH: Final = 1.5
"""Standard deviation [m] of the Gaussian through which an orthophoto is seen; what is finer is that of the material."""


def _colour(
    config: Config, names: tuple[str, ...], weights: Float32Array, nodes: Axes, crowns: Float32Array, origin: Origin
) -> Float32Array | None:
    """Linear colour (nx, ny, 3) of the ground in an orthophoto, that of the materials below crowns; None without one.

    A photograph's brightness depends on its exposure: it gets the mean of the materials in the open.
    """
    if (file := config.photo) is None:
        return None
    seen = read_colours(file.path, origin, config.size, nodes, crs=file.crs)
    cell = float(nodes[0][1] - nodes[0][0])
    seen = gaussian_filter(seen, (SMOOTH / cell, SMOOTH / cell, 0.0), mode="nearest")
    albedo = [np.multiply(TEXTURES[MATERIALS[n].texture].albedo, MATERIALS[n].tint) for n in names]
    own = weights @ np.array(albedo, np.float32) / np.maximum(weights.sum(axis=-1, keepdims=True), 1e-6)
    clear = (1.0 - crowns)[..., None]
    gain = float((own * clear).mean() / max(float((seen * clear).mean()), 1e-6))
    return np.asarray(own + clear * (gain * seen - own), np.float32)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of the hillside: heights, and a cover of turf, stony soil, scree and bare rock.

The same fields decide where stones lie and plants grow: stones in the scree, grass in the turf.

Heights of a mountain's flank: valley on one side, summits on the other, gullies that start above the world.

Three grids, each finer and smaller than the one before, are eroded, and each takes its shape from the coarser one: the
region down to the horizon (10 m), the surroundings of the world (1 m), and the world itself.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator, RectBivariateSpline
from scipy.ndimage import gaussian_filter, shift
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Land
from fieldtruth.world.environments.hillside.config import Config
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.grids import COVER, Line, coarseness, fractal_noise, grid_axes, make_heightfield, make_raster
from fieldtruth.world.model import Heightfield, Raster, Terrain
from fieldtruth.world.relief import collapsed, eroded, limit_slope, slope_limit, with_microrelief

REGION: Final = 1100.0
"""Half the side length [m] of the region."""

MARGIN: Final = 90.0
"""Width [m] of the surroundings of the world."""

_PROFILE: Final = (
    (-1100, 0), (-700, -5), (-330, -11), (-190, -7), (-150, 0), (-110, 12), (-60, 21), (-25, 25), (-17, 20), (-12, 10),
    (10, 9), (15, 22), (22, 27), (32, 24), (55, 20), (150, 17), (280, 20), (370, 3), (470, -16), (1100, -6),
)  # fmt: skip
"""(y [m], slope [deg] along y): far side of the valley, its floor, lower flank, shoulder, upper flank, top."""


class Mountain(NamedTuple):
    """Ground of the world, (nx, ny) each, and the land around it."""

    heights: Array  # [m]
    drained: Array  # [m^2] that drains through each node, including the mountain above
    land: Land


def make_mountain(x: Array, y: Array, config: Config, corridor_distance: Land, rng: np.random.Generator) -> Mountain:
    """Shape the flank on nodes x, y [m] of the world.

    The slope stays below ``config.route_slope_deg`` near corridors, and about ``config.steepest_deg`` from 9 m on.
    """
    region = _region(rng)
    near_x, near_y = (np.arange(c[0] - MARGIN, c[-1] + MARGIN + 0.5) for c in (x, y))
    gx, gy = np.meshgrid(near_x, near_y, indexing="ij")
    distance = corridor_distance(gx, gy)
    h = region(near_x, near_y) + config.ruggedness * fractal_noise(near_x, near_y, wavelength=26.0, octaves=5, rng=rng)
    steep = slope_limit(
        distance, within=0.9 * config.route_slope_deg, beyond=config.steepest_deg + 4, near=2.5, far=9.0
    )
    h = limit_slope(h, 1.0, steep, rounds=60)
    away = np.clip(distance / 6.0, 0.25, 1.0)
    near = eroded(h, 1.0, strength=0.016 * config.gullies * away, creep=0.05, repose_deg=config.steepest_deg, steps=40)
    spline = RectBivariateSpline(near_x, near_y, near.heights)
    h = spline(x, y) + _fine_relief(x, y, spline, corridor_distance, rng)
    strength = 0.002 * config.gullies * np.clip(corridor_distance(*np.meshgrid(x, y, indexing="ij")) / 4.0, 0.1, 1.0)
    spacing = float(x[1] - x[0])
    h = eroded(h, spacing, strength=strength, creep=0.001, repose_deg=config.steepest_deg, steps=10).heights
    drained = np.exp(RectBivariateSpline(near_x, near_y, np.log(near.drained), kx=1, ky=1)(x, y))
    return Mountain(h, drained, _blended(spline, region, (x, y)))


def smooth_corridors(heights: Array, distance: Array, config: Config) -> Array:
    """Limit the slope of heights (nx, ny) [m] by the ``distance`` [m] from corridors; remove ribs and ledges there.

    What is shorter than about 2 m is removed; the microrelief of the ground replaces it.
    """
    spacing = hills_spacing(config.size)
    limit = slope_limit(distance, within=config.route_slope_deg, beyond=config.steepest_deg, near=1.3, far=6.0)
    h = collapsed(heights, spacing, repose_deg=config.steepest_deg, steps=10)
    h += (gaussian_filter(h, 0.6 / spacing) - h) * np.clip(1.5 - distance / 2.0, 0.0, 0.8)
    return limit_slope(h, spacing, limit, rounds=60)


def _region(rng: np.random.Generator) -> RectBivariateSpline:
    """Land of the region as a spline: a curved ridge and valley along x, with eroded spurs outside the world."""
    c = np.arange(-REGION, REGION + 1, 10.0)
    gx, gy = np.meshgrid(c, c, indexing="ij")
    away = np.hypot(np.maximum(np.abs(gx) - 50, 0), np.maximum(np.abs(gy) - 25, 0))
    far = np.clip((away - 30) / 350, 0, 1)
    bend = (4.0 + 90.0 * far) * fractal_noise(c, c, wavelength=620.0, octaves=3, rng=rng)
    knots, slopes = np.array(_PROFILE, np.float64).T
    fine = np.arange(-REGION - 600, REGION + 601, 1.0)
    profile = np.cumsum(np.tan(np.radians(PchipInterpolator(knots, slopes)(fine.clip(-REGION, REGION)))))
    profile -= np.interp(0.0, fine, profile)
    h = np.interp(gy + bend, fine, profile)
    ridged = 1.0 - np.abs(fractal_noise(c, c, wavelength=420.0, octaves=5, rng=rng, gain=0.5))
    h += far * 26.0 * ridged
    h = eroded(h, 10.0, strength=0.0035 * far, creep=1.0, repose_deg=38.0, steps=30).heights
    return RectBivariateSpline(c, c, h)


def _fine_relief(
    x: Array, y: Array, near: RectBivariateSpline, corridor_distance: Land, rng: np.random.Generator
) -> Array:
    """Hummocks away from corridors, and ribs and ledges of rock on steep slopes there [m]."""
    away = np.clip((corridor_distance(*np.meshgrid(x, y, indexing="ij")) - 0.8) / 5.0, 0.0, 1.0)
    hummocks = fractal_noise(x, y, wavelength=3.2, octaves=3, rng=rng)
    slope = np.hypot(near(x, y, dx=1), near(x, y, dy=1))
    rocky = np.clip((slope - 0.3) / 0.25 + 0.5 * fractal_noise(x, y, wavelength=9.0, octaves=2, rng=rng), 0.0, 1.0)
    ribs = 0.8 - np.abs(fractal_noise(x, y, wavelength=4.5, octaves=4, rng=rng, gain=0.55))
    return np.asarray(away * (0.05 * hummocks + 0.34 * rocky * ribs))


def _blended(near: RectBivariateSpline, far: RectBivariateSpline, axes: tuple[Array, Array]) -> Land:
    """Height of the land beyond the world: the surroundings, blended into the region at their outer edge."""
    half_x, half_y = (float(a[-1]) for a in axes)

    def land(x: Array, y: Array) -> Array:
        away = np.maximum(np.abs(x) - half_x, np.abs(y) - half_y)
        share = np.clip((away - MARGIN + 40) / 38, 0, 1)
        share = share * share * (3 - 2 * share)
        inside = near.ev(x.clip(-half_x - MARGIN, half_x + MARGIN), y.clip(-half_y - MARGIN, half_y + MARGIN))
        return np.asarray(inside * (1 - share) + far.ev(x.clip(-REGION, REGION), y.clip(-REGION, REGION)) * share)

    return land


_TURF, _SOIL, _SCREE, _ROCK = range(4)
_MATERIALS: Final = ("turf_dry", "soil_stony", "scree", "rock_face")


class Ground(NamedTuple):
    """The heightfield with the weights of its cover (turf, soil, scree, rock) and its slope [deg]."""

    field: Heightfield
    cover: Raster
    slope: Raster

    def turf(self, xy: Array) -> Array:
        """Share (n,) of turf at positions (n, 2)."""
        return self._share(_TURF, xy)

    def scree(self, xy: Array) -> Array:
        """Share (n,) of scree at positions (n, 2)."""
        return self._share(_SCREE, xy)

    def rock(self, xy: Array) -> Array:
        """Share (n,) of bare rock at positions (n, 2)."""
        return self._share(_ROCK, xy)

    def slope_deg(self, xy: Array) -> Array:
        """Slope (n,) [deg] at positions (n, 2), averaged over about a metre."""
        return self.slope.at(xy[:, 0], xy[:, 1])

    def _share(self, channel: int, xy: Array) -> Array:
        return np.asarray(self.cover.at(xy[:, 0], xy[:, 1])[:, channel])


def make_ground(
    config: Config,
    corridors: Sequence[Line],
    rngs: tuple[np.random.Generator, np.random.Generator, np.random.Generator],
) -> tuple[Ground, Land]:
    """Ground of the world, and the height of the land beyond it; generators of relief, cover and microrelief."""
    x, y = grid_axes(config.size, spacing := hills_spacing(config.size))
    distance = _corridor_distance(corridors)
    mountain = make_mountain(x, y, config, distance, rngs[0])
    hills = smooth_corridors(mountain.heights, distance(*np.meshgrid(x, y, indexing="ij")), config)
    ground = cover_ground(make_heightfield(hills, spacing, x, y), mountain.drained, distance, rngs[1])
    cover = list(
        zip(map(config.roughness_of, config.grounds), _smoothed_shares(ground.cover, x, y, spacing), strict=True)
    )
    fine = grid_axes(config.size, config.grid)
    heights = with_microrelief(hills, (x, y), fine, cover, rngs[2])
    return ground._replace(field=make_heightfield(heights, config.grid, *fine)), mountain.land


def _smoothed_shares(cover: Raster, x: Array, y: Array, spacing: float) -> list[Array]:
    """Share of each ground at nodes x, y, averaged over about a metre: relief does not change from stone to stone."""
    shares = cover.at(*np.meshgrid(x, y, indexing="ij"))
    return [gaussian_filter(shares[..., k], 0.4 / spacing, mode="nearest") for k in range(shares.shape[-1])]


def _corridor_distance(corridors: Sequence[Line]) -> Land:
    """Distance [m] to the nearest corridor's centre line as a function of x, y, to 3 cm; infinite beyond 20 m."""
    if not corridors:
        return lambda x, _: np.full(np.shape(x), np.inf)
    tree = cKDTree(np.concatenate([line.points for line in corridors]))

    def distance(x: Array, y: Array) -> Array:
        return np.asarray(tree.query(np.stack([x, y], axis=-1), distance_upper_bound=20.0)[0])

    return distance


def cover_ground(field: Heightfield, drained: Array, corridor_distance: Land, rng: np.random.Generator) -> Ground:
    """Cover a heightfield by slope, by the area ``drained`` (nx, ny) [m^2] through its nodes, and by noise."""
    nx, ny = field.heights.shape
    x, y = field.x0 + field.spacing * np.arange(nx, dtype=float), field.y0 + field.spacing * np.arange(ny, dtype=float)
    cell = COVER * coarseness((field.spacing * nx, field.spacing * ny))
    fine_x, fine_y = (np.asarray(np.arange(c[0], c[-1] + cell / 2, cell), np.float64) for c in (x, y))
    smooth = gaussian_filter(field.heights.astype(np.float64), 0.5 / field.spacing)
    steep = np.degrees(np.arctan(np.hypot(*np.gradient(smooth, field.spacing))))
    slope = make_raster(steep, field.spacing, x, y)
    # Scree lies below breaking rock: the mean of the rock within some metres uphill (towards +y).
    breaking = np.clip((steep - 27) / 6, 0, 1)
    fallen = gaussian_filter(shift(breaking, (0, -4.0 / field.spacing), order=1, mode="nearest"), 2.0 / field.spacing)
    gully = np.clip((np.log10(drained) - 2.3) / 0.7, 0, 1)
    patch = fractal_noise(fine_x, fine_y, wavelength=11.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(fine_x, fine_y, wavelength=1.3, octaves=4, rng=rng, gain=0.7)
    gx, gy = np.meshgrid(fine_x, fine_y, indexing="ij")
    steep, fallen, gully = (make_raster(v, field.spacing, x, y).at(gx, gy) for v in (steep, fallen, gully))
    # Turf is worn off in the corridors, and loose stones are pressed into the soil: firm ground, as on mountain trails.
    trodden = np.clip(1.3 - corridor_distance(gx, gy) / 1.6, 0, 0.5)
    rock = np.clip((steep - 29) / 5 + 0.5 * patch + 0.45 * fine - 0.25, 0, 1)
    scree = np.clip(1.5 * fallen + 0.7 * gully + 0.45 * patch + 0.35 * fine - 0.5 - 2 * trodden, 0, 1)
    turf = np.clip(0.52 - np.clip(steep - 18, 0, 30) / 30 - 0.38 * patch + 0.4 * fine - trodden, 0, 1)
    free = 1 - rock
    weights = [free * (1 - scree) * turf, free * (1 - scree) * (1 - turf), free * scree, rock]
    return Ground(field, make_raster(np.stack(weights, axis=-1), cell, fine_x, fine_y), slope)


def as_terrain(ground: Ground, size: tuple[float, float]) -> Terrain:
    """Terrain without trails: the distance to one is 1 km everywhere."""
    nodes = tuple(int(s) + 1 for s in size)
    return Terrain(
        field=ground.field,
        trail_distance=Raster(values=np.full(nodes, 1000.0, np.float32), spacing=1.0, x0=-size[0] / 2, y0=-size[1] / 2),
        cover=ground.cover,
        ground_materials=_MATERIALS,
        trail_material="soil_stony",
        border_material="soil_stony",
    )

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of the hillside: heights, and a cover of turf, stony soil, scree and bare rock.

The same fields decide where stones lie and plants grow: stones in the scree, grass in the turf.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter, shift
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Land
from fieldtruth.world.environments.hillside.config import Config
from fieldtruth.world.environments.hillside.mountain import make_mountain, smooth_corridors
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.grids import COVER, Line, coarseness, fractal_noise, grid_axes, make_heightfield, make_raster
from fieldtruth.world.model import Heightfield, Raster, Terrain
from fieldtruth.world.relief import with_microrelief

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

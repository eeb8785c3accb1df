# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What covers a dry mountain's flank: turf where soil stays, stony soil, scree below what breaks, bare rock.

The same fields say where things lie and grow, so that stones lie in the scree and grass in the turf.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Cover, Land
from fieldtruth.world.grids import distance_beyond
from fieldtruth.world.model import Heightfield, Raster, Terrain
from fieldtruth.world.noise import fractal_noise

_CELL: Final = 0.1  # [m] of the cover
_TURF, _SOIL, _SCREE, _ROCK = range(4)
_MATERIALS: Final = ("turf_dry", "soil_stony", "scree", "rock_face")
FAR_MATERIALS: Final = ("garrigue", "crags", "hillslope")
"""Materials of the land beyond: the first two from afar, the last near the edge."""


class Ground(NamedTuple):
    """The field, and on it the weights of the cover (turf, soil, scree, rock) and the slope [deg]."""

    field: Heightfield
    cover: Raster
    slope: Raster

    def share(self, channel: int, places: Array) -> Array:
        """Weight (n,) of one cover at places (n, 2)."""
        return np.asarray(self.cover.at(places[:, 0], places[:, 1])[:, channel])

    def turf(self, places: Array) -> Array:
        """Share (n,) of turf."""
        return self.share(_TURF, places)

    def scree(self, places: Array) -> Array:
        """Share (n,) of scree."""
        return self.share(_SCREE, places)

    def rock(self, places: Array) -> Array:
        """Share (n,) of bare rock."""
        return self.share(_ROCK, places)

    def slope_deg(self, places: Array) -> Array:
        """Slope (n,) [deg] over about a metre."""
        return self.slope.at(places[:, 0], places[:, 1])


def look_at(field: Heightfield, drained: Array, route_distance: Land, rng: np.random.Generator) -> Ground:
    """Cover a field by its slope, by the area ``drained`` (nx, ny) [m^2] through its nodes, and by chance."""
    nx, ny = field.heights.shape
    x, y = field.x0 + field.spacing * np.arange(nx, dtype=float), field.y0 + field.spacing * np.arange(ny, dtype=float)
    fine_x, fine_y = (np.asarray(np.arange(c[0], c[-1] + _CELL / 2, _CELL), np.float64) for c in (x, y))
    smooth = gaussian_filter(field.heights.astype(np.float64), 0.5 / field.spacing)
    steep = np.degrees(np.arctan(np.hypot(*np.gradient(smooth, field.spacing))))
    slope = _raster(steep, field.spacing, x, y)
    # Scree lies below what breaks: the mean of the rock within some metres uphill (towards +y).
    breaking = np.clip((steep - 27) / 6, 0, 1)
    fallen = gaussian_filter(shift(breaking, (0, -4.0 / field.spacing), order=1, mode="nearest"), 2.0 / field.spacing)
    gully = np.clip((np.log10(drained) - 2.3) / 0.7, 0, 1)
    patch = fractal_noise(fine_x, fine_y, wavelength=11.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(fine_x, fine_y, wavelength=1.3, octaves=4, rng=rng, gain=0.7)
    gx, gy = np.meshgrid(fine_x, fine_y, indexing="ij")
    steep, fallen, gully = (_raster(v, field.spacing, x, y).at(gx, gy) for v in (steep, fallen, gully))
    trodden = np.clip(1.3 - route_distance(gx, gy) / 1.6, 0, 0.5)
    rock = np.clip((steep - 29) / 5 + 0.5 * patch + 0.45 * fine - 0.25, 0, 1)
    scree = np.clip(1.5 * fallen + 0.7 * gully + 0.45 * patch + 0.35 * fine - 0.5, 0, 1)
    turf = np.clip(0.52 - np.clip(steep - 18, 0, 30) / 30 - 0.38 * patch + 0.4 * fine - trodden, 0, 1)
    free = 1 - rock
    weights = [free * (1 - scree) * turf, free * (1 - scree) * (1 - turf), free * scree, rock]
    return Ground(field, _raster(np.stack(weights, axis=-1), _CELL, fine_x, fine_y), slope)


def _raster(values: Array, spacing: float, x: Array, y: Array) -> Raster:
    return Raster(values=values.astype(np.float32), spacing=spacing, x0=float(x[0]), y0=float(y[0]))


def terrain(ground: Ground, size: tuple[float, float]) -> Terrain:
    """The ground as sensors see it. There are no trails: their distance is that of another place."""
    nodes = tuple(int(s) + 1 for s in size)
    return Terrain(
        field=ground.field,
        trail_distance=Raster(values=np.full(nodes, 1000.0, np.float32), spacing=1.0, x0=-size[0] / 2, y0=-size[1] / 2),
        cover=ground.cover,
        ground_materials=_MATERIALS,
        trail_material="soil_stony",
        border_material="soil_stony",
    )


def far_cover(size: tuple[float, float], rng: np.random.Generator) -> Cover:
    """Cover of the land beyond: as in the world near its edge, garrigue and crags from 25 m on."""
    waves = rng.normal(0, 1, (12, 2)) * np.exp(rng.uniform(np.log(0.05), np.log(1.2), (12, 1)))
    phase = rng.uniform(0, 2 * np.pi, 12)

    def cover(x: Array, y: Array, slope: Array) -> NDArray[np.intp]:
        patch = np.sin(np.stack([x, y], axis=-1) @ waves.T + phase).mean(axis=1) * np.sqrt(24)
        away = distance_beyond(size, x, y)
        steep = np.degrees(slope)
        far = np.where(steep + 3 * patch > 37, 1, 0)
        return np.where(away + 6 * patch < 30, 2, far)

    return cover

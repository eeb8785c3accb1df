# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rectangle of a world, cut out of what is given in longitudes and latitudes."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import Origin, geodetic_from_world, world_from_geodetic

SMALLEST: Final = 1e-3
"""Length [m] and area [m2] of what is left out: cutting makes such pieces."""


class Rectangle:
    """The rectangle of a world, and a box of longitudes and latitudes around it.

    Longitudes are relative to the origin's, from -180 to 180 deg: none is near the end of the range.
    """

    def __init__(self, origin: Origin, size: tuple[float, float]) -> None:
        self.origin = origin
        self.rectangle = (-size[0] / 2, -size[1] / 2, size[0] / 2, size[1] / 2)
        x, y = (np.linspace(-side / 2, side / 2, 17) for side in size)
        border = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((17, 17))], axis=-1).reshape(-1, 3)
        degrees = self.degrees(geodetic_from_world(border, origin)[:, 1::-1])
        margin = 0.1 * np.ptp(degrees, axis=0)
        self.box = (*(degrees.min(axis=0) - margin).tolist(), *(degrees.max(axis=0) + margin).tolist())

    def degrees(self, lonlat: Sequence[tuple[float, float]] | Array) -> Array:
        """Longitude from the origin's, and latitude (n, 2) [deg]; NaN of nodes that are missing."""
        degrees = np.array(lonlat, np.float64).reshape(-1, 2)
        degrees[:, 0] = (degrees[:, 0] - self.origin.longitude + 180.0) % 360.0 - 180.0
        return degrees

    def touches(self, degrees: Array) -> bool:
        """Whether the box around some nodes and that around the world overlap."""
        known = degrees[~np.isnan(degrees[:, 0])]
        return bool(
            len(known) and (known.max(axis=0) >= self.box[:2]).all() and (known.min(axis=0) <= self.box[2:]).all()
        )

    def point(self, degrees: Array) -> Array:
        """Point (1, 2) [m] in the world, or none (0, 2)."""
        world = self._world(degrees)
        inside = (np.abs(world) <= self.rectangle[2:]).all(axis=-1)
        return np.asarray(world[inside])

    def lines(self, degrees: Array) -> list[Array]:
        """The parts (n, 2) [m] of a line in the world, in its direction; it is broken where nodes are missing."""
        import shapely

        parts = []
        known = ~np.isnan(degrees[:, 0])
        for run in np.split(degrees, np.flatnonzero(np.diff(known)) + 1):
            if len(run) > 1 and not np.isnan(run[0, 0]):
                near = shapely.clip_by_rect(shapely.LineString(run), *self.box)
                inside = shapely.clip_by_rect(shapely.transform(near, self._world), *self.rectangle)
                parts += [each for each in shapely.get_parts(inside) if each.length > SMALLEST]
        return [np.asarray(shapely.get_coordinates(each)) for each in parts]

    def areas(self, rings: Sequence[Array]) -> tuple[float, list[tuple[Array, tuple[Array, ...]]]]:
        """Size [deg2] of an area of an outer ring and inner ones; outlines [m] and holes of its parts in the world."""
        import shapely

        whole = shapely.make_valid(shapely.Polygon(rings[0], rings[1:]))
        near = shapely.transform(shapely.intersection(whole, shapely.box(*self.box)), self._world)
        inside = shapely.intersection(shapely.make_valid(near), shapely.box(*self.rectangle))
        parts = [
            shapely.orient_polygons(each)
            for each in shapely.get_parts(inside)
            if each.geom_type == "Polygon" and each.area > SMALLEST
        ]
        return float(whole.area), [(_ring(p.exterior), tuple(_ring(hole) for hole in p.interiors)) for p in parts]

    def _world(self, degrees: Array) -> Array:
        """Coordinates x and y (n, 2) [m]."""
        longitude, latitude = degrees.T
        height = np.full(len(degrees), self.origin.height)
        geodetic = np.stack([latitude, longitude + self.origin.longitude, height], axis=-1)
        return world_from_geodetic(geodetic, self.origin)[:, :2]


def _ring(ring: Any) -> Array:
    return np.array(ring.coords)[:-1]

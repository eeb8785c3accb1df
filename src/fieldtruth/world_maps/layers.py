# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layers of a map: their names, units and numbers, and those that are read from the world tile by tile."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.drive.soil import PRESSED, UNNAMED
from fieldtruth.kernels.columns import Cells, Crossings, Surface, drop_faces, walk_columns
from fieldtruth.world.model import World
from fieldtruth.world_maps.bodies import boxes_of, copies_of, faces_of

Layers = dict[str, NDArray[Any]]
"""Arrays (n, m) by the name of the layer; cell (i, j) is the i-th along x and the j-th along y."""
_ROOM: Final = 8  # crossings per cell for which there is memory at first


class Layer(NamedTuple):
    """A row of the table."""

    unit: str
    """SI unit; empty for a number."""
    dtype: str
    description: str
    names: str = ""
    """Names of its numbers, a key of ``names_of``; empty: none."""


def _surface(name: str, what: str) -> dict[str, Layer]:
    """A height with class and instance id."""
    return {
        name: Layer("m", "f4", f"height of {what}"),
        f"{name}_class": Layer("", "u1", f"class id of {what}; 0: none", "classes"),
        f"{name}_instance": Layer("", "u4", f"instance id of {what}; 0: none"),
    }


LAYERS: Final[Mapping[str, Layer]] = {
    "ground": Layer("m", "f4", "height of the bare ground"),
    "ground_class": Layer("", "u1", "class id of the bare ground; its instance id is 1", "classes"),
    **_surface("hard_ground", "the ground with stones and roots"),
    **_surface("overhang", "the lowest overhang above the ground with stones and roots"),
    **_surface("plant_top", "the top of plants"),
    "ground_cover": Layer("m", "f4", "height of short grass, litter and snow above the bare ground"),
    "surface": Layer("", "u1", "material of the bare ground", "surfaces"),
    "soil": Layer("", "u1", "soil that bears wheels", "soils"),
    "water_depth": Layer("m", "f4", "depth of water above the bare ground"),
    "solid_volume": Layer("m3", "f4", "volume of solid bodies up to 2 m above the bare ground"),
    "flexible_volume": Layer("m3", "f4", "volume of thin stems up to 2 m above the bare ground"),
    "passable_volume": Layer("m3", "f4", "volume of layers of 5 cm with leaves, up to 2 m above the bare ground"),
    "obstacle": Layer("", "u1", "1 where a solid body is 0.1 to 2 m above the bare ground"),
    "slope": Layer("rad", "f4", "slope of the plane through the ground with stones and roots, over 0.5 m"),
    "step_height": Layer("m", "f4", "greatest difference of its height within 0.1 m"),
    "roughness_20_50cm": Layer("m", "f4", "rms of its waves of 0.2 to 0.5 m"),
    "roughness_50_150cm": Layer("m", "f4", "rms of its waves of 0.5 to 1.5 m"),
    "roughness_150_500cm": Layer("m", "f4", "rms of its waves of 1.5 to 5 m"),
    "drop_height": Layer("m", "f4", "depth of a gap in it, up to 2 m wide"),
    "drop_width": Layer("m", "f4", "width of that gap"),
    "solid_distance": Layer("m", "f4", "distance to the nearest obstacle, at most 10 m"),
}
"""All layers by name; those from ``slope`` on follow from others."""


class Grid(NamedTuple):
    """Cells of a map: (i, j) has its middle at ``x0 + (i + 0.5) * resolution``, likewise in y [m]."""

    x0: float
    y0: float
    resolution: float
    shape: tuple[int, int]

    def middles(self, rows: slice, columns: slice) -> tuple[Array, Array]:
        """Return x (n,) and y (m,) [m] of the middles of some cells."""
        i, j = (np.arange(s.start, s.stop) for s in (rows, columns))
        return self.x0 + (i + 0.5) * self.resolution, self.y0 + (j + 0.5) * self.resolution


def names_of(world: World) -> dict[str, dict[int, str]]:
    """Return the names of the numbers in layers: ``classes``, ``surfaces`` and ``soils``."""
    return {
        "classes": {int(row.label): row.key for row in world.classes.coloured},
        "surfaces": dict(enumerate((*world.terrain.ground_materials, *world.terrain.trail_materials))),
        "soils": dict(enumerate(dict.fromkeys([*_soils_of(world), "rock"]))),
    }


def _soils_of(world: World) -> list[str]:
    """Name of the soil of each surface."""
    own = [world.materials.get(name) for name in (*world.terrain.ground_materials, *world.terrain.trail_materials)]
    return [UNNAMED if each is None else each.ground_type or UNNAMED for each in own]


def surface_at(world: World, x: Array, y: Array) -> NDArray[np.uint8]:
    """Return the material of the ground, as a number of ``names_of``, at x and y [m] (any shape).

    On trails it is that of the trail or of its border, elsewhere that of the greatest weight, as ``Scene.cast`` says.
    """
    terrain, count = world.terrain, len(world.terrain.ground_materials)
    best = np.argmax(terrain.cover.at(x, y), axis=-1)
    distance = terrain.other_ground.at(x, y)
    return np.where(distance < 0, count + (distance > -terrain.border_width), best).astype(np.uint8)


class WorldColumns:
    """The columns of a world above the cells of a map. Threads may share it."""

    def __init__(self, world: World, grid: Grid) -> None:
        self._world, self._grid = world, grid
        self._faces = faces_of(world)
        self._copies = list(copies_of(world))
        self._boxes = boxes_of(self._faces, self._copies)
        numbers = {name: number for number, name in names_of(world)["soils"].items()}
        self._soils, self._rock = np.array([numbers[name] for name in _soils_of(world)]), numbers["rock"]

    def tile(self, rows: slice, columns: slice) -> Layers:
        """Return the layers up to ``obstacle`` of some cells, in the types of ``LAYERS``."""
        world, terrain, area = self._world, self._world.terrain, self._grid.resolution**2
        x, y = self._grid.middles(rows, columns)
        at = np.meshgrid(x, y, indexing="ij")
        ground, surface = terrain.field.height_at(*at), surface_at(world, *at)
        cells = self._filled(x, y, ground, terrain.label_at(*at))
        made: Layers = {
            "ground": ground,
            "ground_class": terrain.label_at(*at),
            "ground_cover": terrain.surface.height_at(*at) - ground,
            "surface": surface,
            "soil": np.where(cells.hard.z > ground + PRESSED, self._rock, self._soils[surface]),
            "water_depth": np.maximum(world.water_at(*at) - ground, 0.0),
            "solid_volume": cells.solid * area,
            "flexible_volume": cells.flexible * area,
            "passable_volume": cells.passable * area,
            "obstacle": cells.obstacle,
        }
        for name, found in (("hard_ground", cells.hard), ("overhang", cells.overhang), ("plant_top", cells.top)):
            made |= {name: found.z, f"{name}_class": found.label, f"{name}_instance": found.instance}
        return {name: values.astype(LAYERS[name].dtype) for name, values in made.items()}

    def _filled(self, x: Array, y: Array, ground: Array, label: NDArray[np.uint8]) -> Cells:
        """Drop all that is above or below them on cells of middles x (n,) and y (m,)."""
        low, high = ((np.array([x[k], y[k]]) + half * self._grid.resolution) for k, half in ((0, -0.5), (-1, 0.5)))
        near = [np.flatnonzero(((a <= high) & (b >= low)).all(axis=1)) for a, b in self._boxes]
        room = _ROOM * ground.size
        while True:
            cells, count = _cells(x, y, self._grid.resolution, ground, label), 0
            numbers = np.empty((2, room), np.int64)
            found = Crossings(
                numbers[0], np.empty(room), np.empty(room, np.int8), numbers[1], np.empty(room, np.uint32)
            )
            for copies, rows in zip(self._copies, near, strict=True):
                count = drop_faces(self._faces, copies, rows, cells, found, count)
            if count <= room:
                break
            room = count
        walk_columns(self._faces, cells, found, np.lexsort((found.z[:count], found.cell[:count])))
        return cells


def _cells(x: Array, y: Array, spacing: float, ground: Array, label: NDArray[np.uint8]) -> Cells:
    """Cells on which nothing was dropped yet."""
    shape = ground.shape
    hard = Surface(ground.copy(), label.copy(), np.full(shape, GROUND_ID, np.uint32))
    lengths, bits = np.zeros((3, *shape)), np.zeros(shape, np.uint64)
    none = [Surface(np.full(shape, np.nan), np.zeros(shape, np.uint8), np.zeros(shape, np.uint32)) for _ in range(2)]
    start = float(x[0]), float(y[0]), spacing, ground, hard
    return Cells(*start, none[0], none[1], lengths[0], lengths[1], lengths[2], bits, np.zeros(shape, np.uint8))

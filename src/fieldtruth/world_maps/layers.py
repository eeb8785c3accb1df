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
from fieldtruth.kernels.columns import Cells, Columns, Crossings, drop_faces, walk_columns
from fieldtruth.world.model import Raster, World
from fieldtruth.world_maps.bodies import boxes_of, copies_of, faces_of

Layers = dict[str, NDArray[Any]]
"""Arrays (n, m) by the name of the layer; cell (i, j) is the i-th along x and the j-th along y."""
_CROSSINGS: Final = 8
"""Crossings per cell for which there is memory at first."""


class Layer(NamedTuple):
    """A row of the table."""

    unit: str
    """SI unit; empty for a number or a name."""
    dtype: str
    description: str
    names: str = ""
    """Table of names of its numbers, a key of ``names_of``."""


def _three(name: str, what: str) -> dict[str, Layer]:
    """A height with class and instance id."""
    return {
        name: Layer("m", "f4", f"height of {what}"),
        f"{name}_class": Layer("", "u1", f"class id of {what}; 0: none", "classes"),
        f"{name}_instance": Layer("", "u4", f"instance id of {what}; 0: none"),
    }


LAYERS: Final[Mapping[str, Layer]] = {
    "ground": Layer("m", "f4", "height of the bare ground"),
    "ground_class": Layer("", "u1", "class id of the bare ground; its instance id is 1", "classes"),
    **_three("hard_ground", "the ground with stones and roots"),
    **_three("overhang", "the lowest overhang above the ground with stones and roots"),
    **_three("plant_top", "the top of plants"),
    "ground_cover": Layer("m", "f4", "height of short grass, litter and snow above the bare ground"),
    "surface": Layer("", "u1", "material of the bare ground", "surfaces"),
    "soil": Layer("", "u1", "soil that bears wheels", "soils"),
    "water_depth": Layer("m", "f4", "depth of water above the bare ground"),
    "solid_volume": Layer("m3", "f4", "volume of solid bodies up to 2 m above the bare ground"),
    "flexible_volume": Layer("m3", "f4", "volume of thin stems up to 2 m above the bare ground"),
    "passable_volume": Layer(
        "m3", "f4", "volume of layers of 5 cm with leaves or blades, up to 2 m above the bare ground"
    ),
    "obstacle": Layer("", "u1", "1 where a solid body is 0.1 to 2 m above the bare ground"),
    "slope": Layer("rad", "f4", "slope of the plane through the ground with stones and roots, over 0.5 m"),
    "step_height": Layer("m", "f4", "greatest difference of its height within 0.1 m"),
    "roughness_20_50cm": Layer("m", "f4", "rms of its waves of 0.2 to 0.5 m"),
    "roughness_50_150cm": Layer("m", "f4", "rms of its waves of 0.5 to 1.5 m"),
    "roughness_150_500cm": Layer("m", "f4", "rms of its waves of 1.5 to 5 m"),
    "drop_height": Layer("m", "f4", "depth of a gap up to 2 m wide"),
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
    soils = dict.fromkeys([*_soils_of(world), "rock"])
    return {
        "classes": {int(row.label): row.key for row in world.classes.coloured},
        "surfaces": dict(enumerate(_surfaces_of(world))),
        "soils": dict(enumerate(soils)),
    }


def _surfaces_of(world: World) -> tuple[str, ...]:
    return (*world.terrain.ground_materials, *world.terrain.trail_materials)


def _soils_of(world: World) -> list[str]:
    """Name of the soil of each surface."""
    known = world.materials
    return [known[name].ground_type or UNNAMED if name in known else UNNAMED for name in _surfaces_of(world)]


def surface_at(world: World, x: Array, y: Array) -> NDArray[np.uint8]:
    """Return the material of the ground, as a number of ``names_of``, at x and y [m] (any shape).

    On trails it is that of the trail or of its border, elsewhere that of the greatest weight, as ``Scene.cast`` says.
    """
    terrain = world.terrain
    channels = [
        Raster(values=terrain.cover.values[..., k], **_place(terrain.cover))
        for k in range(len(terrain.ground_materials))
    ]
    best = np.argmax([channel.at(x, y) for channel in channels], axis=0)
    if terrain.trail_material:
        distance = terrain.trail_distance.at(x, y)
        best = np.where(distance < 0, len(channels) + (distance > -terrain.border_width), best)
    return best.astype(np.uint8)


def _place(raster: Raster) -> dict[str, float]:
    return {"spacing": raster.spacing, "x0": raster.x0, "y0": raster.y0}


class WorldColumns:
    """The columns of a world above the cells of a map. Threads may share it."""

    def __init__(self, world: World, grid: Grid) -> None:
        self._world, self._grid = world, grid
        self._faces = faces_of(world)
        self._copies = [(copies, *boxes_of(self._faces, copies)) for copies in copies_of(world)]
        names = names_of(world)["soils"]
        numbers = {name: number for number, name in names.items()}
        self._soils = np.array([numbers[name] for name in _soils_of(world)], np.uint8)
        self._rock = numbers["rock"]

    def tile(self, rows: slice, columns: slice) -> Layers:
        """Return the layers up to ``obstacle`` of some cells, in the types of ``LAYERS``."""
        world, terrain, area = self._world, self._world.terrain, self._grid.resolution**2
        x, y = self._grid.middles(rows, columns)
        at = np.meshgrid(x, y, indexing="ij")
        ground = terrain.field.height_at(*at)
        cells, found = self._dropped(x, y, ground, terrain.label_at(*at))
        surface = surface_at(world, *at)
        level = world.water_at(*at)
        made = {
            "ground": ground,
            "ground_class": terrain.label_at(*at),
            "hard_ground": cells.hard,
            "hard_ground_class": cells.hard_label,
            "hard_ground_instance": cells.hard_instance,
            "overhang": found.overhang,
            "overhang_class": found.label,
            "overhang_instance": found.instance,
            "plant_top": cells.top,
            "plant_top_class": cells.top_label,
            "plant_top_instance": cells.top_instance,
            "ground_cover": terrain.surface.height_at(*at) - ground,
            "surface": surface,
            "soil": np.where(cells.hard > ground + PRESSED, self._rock, self._soils[surface]),
            "water_depth": np.maximum(level - ground, 0.0),
            "solid_volume": found.solid * area,
            "flexible_volume": found.flexible * area,
            "passable_volume": found.passable * area,
            "obstacle": cells.solid,
        }
        return {name: np.asarray(values).astype(LAYERS[name].dtype) for name, values in made.items()}

    def _dropped(self, x: Array, y: Array, ground: Array, label: NDArray[np.uint8]) -> tuple[Cells, Columns]:
        """Drop on cells of middles x (n,) and y (m,) all that is above or below them."""
        near = self._near(x, y)
        room = _CROSSINGS * ground.size
        while True:
            cells, found = _cells(x, y, self._grid.resolution, ground, label), _crossings(room)
            count = 0
            for (copies, *_), rows in zip(self._copies, near, strict=True):
                count = drop_faces(self._faces, copies, rows, cells, found, count)
            if count <= room:
                break
            room = count
        zeros = [np.zeros(ground.shape) for _ in range(3)]
        columns = Columns(
            np.full(ground.shape, np.nan), np.zeros(ground.shape, np.uint8), np.zeros(ground.shape, np.uint32), *zeros
        )
        walk_columns(cells, found, count, columns)
        return cells, columns

    def _near(self, x: Array, y: Array) -> list[NDArray[np.intp]]:
        """Rows of the copies, of each group, whose boxes meet the cells."""
        margin = 0.5 * self._grid.resolution
        low, high = np.array([x[0], y[0]]) - margin, np.array([x[-1], y[-1]]) + margin
        return [np.flatnonzero(((least <= high) & (most >= low)).all(axis=1)) for _, least, most in self._copies]


def _cells(x: Array, y: Array, spacing: float, ground: Array, label: NDArray[np.uint8]) -> Cells:
    shape = ground.shape
    return Cells(
        float(x[0]), float(y[0]), spacing, ground,
        ground.copy(), label.copy(), np.full(shape, GROUND_ID, np.uint32),
        np.full(shape, np.nan), np.zeros(shape, np.uint8), np.zeros(shape, np.uint32),
        np.zeros(shape, np.uint64), np.zeros(shape, np.uint8),
    )  # fmt: skip


def _crossings(room: int) -> Crossings:
    return Crossings(
        np.empty(room, np.int64), np.empty(room), np.empty(room, np.int8),
        np.empty(room, np.uint8), np.empty(room, np.uint8), np.empty(room, np.uint32),
    )  # fmt: skip

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The inventory of a world: every object with its position and measures, as CSV files and as a GeoPackage.

``inventory`` has a row per named object; ``swarm_members`` a row per member of a swarm, which share one instance id.
"""

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.interchange.geopackage import ColumnType, PointLayer, Value, write_points
from fieldtruth.interchange.measures import BREAST_HEIGHT, Measures, measure, moved, trunk_diameter
from fieldtruth.world.model import World
from fieldtruth.world.plants import BUSHES, GRASSES, TREES

OBJECTS: Final = "inventory"
MEMBERS: Final = "swarm_members"

COLUMNS: Final[Mapping[str, ColumnType]] = {
    "instance_id": "INTEGER",
    "name": "TEXT",
    "kind": "TEXT",
    "species": "TEXT",
    "scientific_name": "TEXT",
    "classes": "TEXT",
    "latitude_deg": "REAL",
    "longitude_deg": "REAL",
    "ground_height_m": "REAL",
    "x_m": "REAL",
    "y_m": "REAL",
    "height_m": "REAL",
    "length_m": "REAL",
    "width_m": "REAL",
    "trunk_diameter_m": "REAL",
    "crown_base_m": "REAL",
    "crown_diameter_m": "REAL",
    "leaf_area_m2": "REAL",
    "volume_m3": "REAL",
}
"""Columns of both tables. Empty: the object has no such part."""

_DECIMALS: Final = {"latitude_deg": 9, "longitude_deg": 9, "volume_m3": 9}
_DECIMALS_OF_METRES: Final = 4


class Item(NamedTuple):
    """A row before it is measured."""

    object_id: int
    name: str
    kind: str
    mesh: str
    world_from_object: Array
    beyond: bool
    """Whether it is outside the world's edge."""


def write(world: World, folder: Path, *, beyond: bool) -> None:
    """Write ``inventory.csv``, ``swarm_members.csv`` and ``inventory.gpkg`` with both tables into a new folder.

    ``beyond`` includes the members of swarms outside the world's edge.
    """
    members = [item for item in swarm_members(world) if beyond or not item.beyond]
    tables = {
        OBJECTS: ("named objects", inventory(world)),
        MEMBERS: ("members of swarms, which share an instance id", inventory_rows(world, members)),
    }
    folder.mkdir()
    layers = []
    for name, (description, rows) in tables.items():
        with (folder / f"{name}.csv").open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(COLUMNS)
            writer.writerows(rows)
        latitude = list(COLUMNS).index("latitude_deg")
        positions = np.array([row[latitude : latitude + 2] for row in rows], np.float64).reshape(-1, 2)
        layers.append(PointLayer(name, f"{world.name}, seed {world.seed}: {description}", COLUMNS, rows, positions))
    write_points(folder / f"{OBJECTS}.gpkg", layers)


def inventory(world: World) -> list[tuple[Value, ...]]:
    """Rows of the named objects; ``COLUMNS`` names their values."""
    return inventory_rows(world, list(named_objects(world)))


def named_objects(world: World) -> Iterator[Item]:
    """Every named object, in the order of the instance ids."""
    for i in world.instances:
        yield Item(i.object_id, i.name, i.kind, i.mesh, i.world_from_object, _is_beyond(world, i.world_from_object))


def swarm_members(world: World) -> Iterator[Item]:
    """Every member of every swarm."""
    for swarm in world.swarms:
        for row, pose in zip(swarm.mesh, swarm.world_from_object, strict=True):
            yield Item(swarm.object_id, swarm.name, swarm.kind, swarm.meshes[row], pose, _is_beyond(world, pose))


def _is_beyond(world: World, pose: Array) -> bool:
    return bool((np.abs(pose[:2, 3]) > np.array(world.size) / 2).any())


def inventory_rows(world: World, items: Sequence[Item]) -> list[tuple[Value, ...]]:
    """Measure objects; ``COLUMNS`` names the values of a row."""
    positions = np.array([item.world_from_object[:3, 3] for item in items]).reshape(-1, 3)
    inside = np.array([not item.beyond for item in items], np.bool_)
    # The terrain ends at the edge; beyond it objects stand with their origin on the ground.
    positions[inside, 2] = world.terrain.field.height_at(*positions[inside, :2].T)
    geodetic = geodetic_from_world(positions)
    measures: dict[str, Measures] = {}
    rows = []
    for item, position, (latitude, longitude, _) in zip(items, positions, geodetic, strict=True):
        if item.mesh not in measures:
            measures[item.mesh] = measure(world.meshes[item.mesh], world.materials)
        species = world.meshes[item.mesh].species
        values = {
            "instance_id": item.object_id,
            "name": item.name,
            "kind": item.kind,
            "species": "; ".join(species),
            "scientific_name": "; ".join(filter(None, map(scientific_name, species))),
            "classes": "; ".join(measures[item.mesh].classes),
            "latitude_deg": latitude,
            "longitude_deg": longitude,
            "ground_height_m": position[2],
            "x_m": position[0],
            "y_m": position[1],
            **_measured(measures[item.mesh], item.world_from_object, position),
        }
        rows.append(tuple(_plain(name, values[name]) for name in COLUMNS))
    return rows


def scientific_name(species: str) -> str:
    """Scientific name of a species; empty for a type of rock."""
    for library in (TREES, BUSHES, GRASSES):
        if species in library:
            return library[species].latin
    return ""


def _measured(mesh: Measures, world_from_object: Array, foot: Array) -> dict[str, float]:
    """Measures [m] of an object that stands at ``foot`` (3,), a point of the ground."""
    scale = float(np.cbrt(np.linalg.det(world_from_object[:3, :3])))
    leaves = mesh.leaf_corners
    height = moved(world_from_object, mesh.corners)[:, 2].max() - foot[2]
    return {
        "height_m": height if height > 0 else np.nan,  # the middle of a lake may be below the land
        "length_m": scale * mesh.length,
        "width_m": scale * mesh.width,
        "trunk_diameter_m": trunk_diameter(moved(world_from_object, mesh.wood), foot[2] + BREAST_HEIGHT, foot[:2]),
        "crown_base_m": np.nan if leaves is None else max(moved(world_from_object, leaves)[:, 2].min() - foot[2], 0.0),
        "crown_diameter_m": scale * mesh.crown_diameter,
        "leaf_area_m2": scale**2 * mesh.leaf_area,
        "volume_m3": scale**3 * mesh.volume,
    }


def _plain(name: str, value: object) -> Value:
    """The value rounded and of a plain type; None if it is missing."""
    if not isinstance(value, float):
        return value if isinstance(value, int) else str(value) or None
    return None if np.isnan(value) else round(float(value), _DECIMALS.get(name, _DECIMALS_OF_METRES))

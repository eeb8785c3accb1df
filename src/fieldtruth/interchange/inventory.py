# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The inventory of a world: every object with its position and measures, as CSV files and as a GeoPackage.

Measures are taken from the meshes: height, trunk, crown, leaf area, volume. A GeoPackage has point layers in WGS 84, as
GIS programs read them (OGC 12-128r19, GeoPackage 1.4): it is an SQLite database with tables of the standard's Annex C.
The same layers give the same bytes: the date of the last change is fixed.

``inventory`` has a row per named object; ``swarm_members`` a row per member of a swarm, which share one instance id.
"""

import csv
import sqlite3
import struct
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.core.yaml_io import package_data
from fieldtruth.drive.passability import forces_of_copies, passability_of
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.interchange.surfaces import beyond_edge
from fieldtruth.world.model import Material, Mesh, World
from fieldtruth.world.plants import BUSHES, GRASSES, TREES

# ---------------------------------------------------------------------------------------------------------------------
# Measures of meshes

BREAST_HEIGHT: Final = 1.3
"""Height above the ground [m] at which the diameter of a trunk is measured, as foresters do."""
TRUNK_WITHIN: Final = 0.8
"""Distance [m] from a tree's position within which a section of wood belongs to the trunk and not to a branch.

The middle of a crooked oak's trunk is up to 0.7 m aside at breast height."""


@dataclass(frozen=True, kw_only=True)
class Measures:
    """Measures of a mesh in its own frame, at scale 1."""

    corners: Array  # (n, 3) corners of its convex hull [m]
    length: float  # [m] along x
    width: float  # [m] along y
    labels: tuple[int, ...]  # class ids, the class of the largest area first
    wood: Array  # (t, 3, 3) triangles of trunk and branches [m]
    leaf_corners: Array | None = None  # (n, 3) corners of the convex hull of its leaves [m]
    leaf_area: float = np.nan  # [m2]
    crown_diameter: float = np.nan  # [m]
    volume: float = np.nan  # [m3]


def measure(mesh: Mesh, materials: Mapping[str, Material]) -> Measures:
    """Measure a mesh; what it lacks is NaN.

    Leaves are the surfaces that transmit light, blades and petals among them. They are single layers of triangles, so
    the sum of the triangles is the area of one side. The crown's diameter is that of the circle with the area of the
    leaves' convex hull, seen from above. The volume is that of a rock, with its part below the soil.
    """
    triangles = mesh.vertices.astype(np.float64)[mesh.faces]
    edges = np.diff(triangles, axis=1)
    area = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    used = [materials[name] for name in mesh.materials]
    label = np.array([material.label for material in used], np.intp)[mesh.material]
    leafy = np.array([material.translucency > 0 for material in used])[mesh.material]
    by_class = np.bincount(label, area)
    present = sorted(np.unique(label), key=lambda k: -by_class[k])
    length, width, _ = np.ptp(triangles.reshape(-1, 3), axis=0)
    leaf_corners = hull_corners(triangles[leafy].reshape(-1, 3)) if leafy.any() else None
    return Measures(
        corners=hull_corners(triangles.reshape(-1, 3)),
        length=float(length),
        width=float(width),
        labels=tuple(int(k) for k in present),
        wood=triangles[label == Label.TRUNK],
        leaf_corners=leaf_corners,
        leaf_area=float(area[leafy].sum()) if leafy.any() else np.nan,
        crown_diameter=np.nan if leaf_corners is None else circle_diameter(_area_from_above(leaf_corners)),
        volume=float(np.linalg.det(triangles).sum()) / 6 if present == [Label.ROCK] else np.nan,
    )


def hull_corners(points: Array) -> Array:
    """Corners (n, 3) of the convex hull of points (m, 3); of a flat or straight set, all different points."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return np.unique(points, axis=0)


def circle_diameter(area: float) -> float:
    """Diameter [m] of the circle with this area [m2]."""
    return float(2 * np.sqrt(area / np.pi))


def _area_from_above(points: Array) -> float:
    """Area [m2] of the convex hull of points (m, 3), projected along z."""
    try:
        return float(ConvexHull(points[:, :2]).volume)
    except QhullError:
        return 0.0


def moved(world_from_object: Array, points: Array) -> Array:
    """Points (..., 3) of an object's frame in the world.

    Without a matrix product, which rounds equal points in different rows differently: seams would open.
    """
    x, y, z = np.moveaxis(points, -1, 0)[..., None]
    return np.asarray(sum(c * world_from_object[:3, k] for k, c in enumerate((x, y, z))) + world_from_object[:3, 3])


class Section(NamedTuple):
    """Middle of a trunk's section in world x, y [m], and the diameter [m] of the circle with its area."""

    x: float
    y: float
    diameter: float


def trunk_diameter(wood: Array, height: float, xy: Array) -> float:
    """Diameter [m] of ``trunk_section``; NaN if there is no trunk."""
    section = trunk_section(wood, height, xy)
    return np.nan if section is None else section.diameter


def trunk_section(wood: Array, height: float, xy: Array) -> Section | None:
    """Horizontal section of a trunk at a height; None if there is no trunk.

    Args:
        wood: triangles (t, 3, 3) [m] in the world, outwards counter-clockwise.
        height: of the section in the world [m].
        xy: position [m] of the tree (2,). Of all closed sections within ``TRUNK_WITHIN`` of it, the largest counts.
    """
    count = (wood[..., 2] > height).sum(axis=1)
    cut, count = wood[(count > 0) & (count < 3)], count[(count > 0) & (count < 3)]
    if not len(cut):
        return None
    # The corner that is alone on its side of the plane, then the others in the triangle's order.
    above = cut[..., 2] > height
    alone = np.argmax(above == (count == 1)[:, None], axis=1)
    rows = np.arange(len(cut))
    first, second, third = (cut[rows, (alone + k) % 3] for k in range(3))
    ends = np.stack([_crossing(first, second, height), _crossing(first, third, height)], axis=1)
    ends[count == 2] = ends[count == 2, ::-1]
    _, node = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    a, b = node.reshape(-1, 2).T
    nodes = int(node.max()) + 1
    _, part_of_node = connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(nodes, nodes)), directed=False)
    part = part_of_node[a]
    (ax, ay), (bx, by) = (ends - xy).transpose(1, 2, 0)
    area = np.abs(np.bincount(part, 0.5 * (ax * by - ay * bx)))
    middles = np.column_stack([np.bincount(part, ax), np.bincount(part, ay)]) / np.bincount(part)[:, None]
    middle = np.hypot(*middles.T)
    is_open = np.bincount(part_of_node, np.bincount(node.ravel()) % 2) > 0  # the open end of a branch's tube
    near = np.flatnonzero((middle < TRUNK_WITHIN) & ~is_open)
    if not len(near):
        return None
    k = near[np.argmax(area[near])]
    x, y = (xy + middles[k]).tolist()
    return Section(x, y, circle_diameter(float(area[k])))


def _crossing(one: Array, other: Array, height: float) -> Array:
    """Points (n, 2) where edges cross a height, computed from the lower end, so that neighbours agree exactly."""
    swap = (one[:, 2] > other[:, 2])[:, None]
    low, high = np.where(swap, other, one), np.where(swap, one, other)
    share = (height - low[:, 2]) / (high[:, 2] - low[:, 2])
    return np.asarray(low[:, :2] + share[:, None] * (high[:, :2] - low[:, :2]))


# ---------------------------------------------------------------------------------------------------------------------
# GeoPackage

Value = int | float | str | None
ColumnType = Literal["INTEGER", "REAL", "TEXT"]
WGS_84: Final = 4326
"""EPSG code of latitude and longitude; coordinates in the file are (longitude, latitude)."""
_APPLICATION_ID: Final = 0x47504B47  # "GPKG"
_VERSION: Final = 10400
_CHANGED: Final = "1980-01-01T00:00:00.000Z"
_POINT: Final = struct.Struct("<2sBBiBIdd")
_TABLES: Final = package_data("fieldtruth.interchange", "inventory.yaml")
"""Columns of both tables, and of a GeoPackage its reference systems and its tables in SQL."""


class PointLayer(NamedTuple):
    """A table with a point per row."""

    name: str
    description: str
    columns: Mapping[str, ColumnType]
    rows: Sequence[Sequence[Value]]
    geodetic: Array
    """(n, 2) latitude and longitude [deg] of the rows."""


def write_points(path: Path, layers: Sequence[PointLayer]) -> None:
    """Write a GeoPackage with these layers; their rows keep their order."""
    with closing(sqlite3.connect(":memory:")) as database:
        database.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
        database.execute(f"PRAGMA user_version = {_VERSION}")
        database.executescript(_TABLES["tables"])
        database.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", _TABLES["systems"])
        for layer in layers:
            _write_layer(database, layer)
        database.commit()
        path.write_bytes(database.serialize())


def _write_layer(database: sqlite3.Connection, layer: PointLayer) -> None:
    columns = "".join(f', "{name}" {kind}' for name, kind in layer.columns.items())
    database.execute(
        f'CREATE TABLE "{layer.name}" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom POINT{columns})'
    )
    latitude, longitude = layer.geodetic.T.tolist()
    bounds = [f(v, default=None) for f in (min, max) for v in (longitude, latitude)]
    database.execute(
        "INSERT INTO gpkg_contents VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?, ?)",
        (layer.name, layer.name, layer.description, _CHANGED, *bounds, WGS_84),
    )
    database.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', 'POINT', ?, 0, 0)", (layer.name, WGS_84))
    blanks = ", ".join("?" * (len(layer.columns) + 1))
    database.executemany(
        f'INSERT INTO "{layer.name}" VALUES (NULL, {blanks})',
        ((_point(*position), *row) for position, row in zip(layer.geodetic.tolist(), layer.rows, strict=True)),
    )


def _point(latitude: float, longitude: float) -> bytes:
    """A point as GeoPackageBinary: its header without an envelope (flags 1: little endian), then well-known binary."""
    return _POINT.pack(b"GP", 0, 1, WGS_84, 1, 1, longitude, latitude)


# ---------------------------------------------------------------------------------------------------------------------
# The inventory

OBJECTS: Final = "inventory"
MEMBERS: Final = "swarm_members"
COLUMNS: Final[Mapping[str, ColumnType]] = _TABLES["columns"]
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
    """True outside the world's edge."""


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
        beyond = bool((np.abs(i.world_from_object[:2, 3]) > np.array(world.size) / 2).any())
        yield Item(i.object_id, i.name, i.kind, i.mesh, i.world_from_object, beyond)


def swarm_members(world: World) -> Iterator[Item]:
    """Every member of every swarm."""
    for swarm in world.swarms:
        rows = zip(swarm.mesh.tolist(), swarm.world_from_object, beyond_edge(world, swarm).tolist(), strict=True)
        for mesh, pose, beyond in rows:
            yield Item(swarm.object_id, swarm.name, swarm.kind, swarm.meshes[mesh], pose, beyond)


def inventory_rows(world: World, items: Sequence[Item]) -> list[tuple[Value, ...]]:
    """Measure objects; ``COLUMNS`` names the values of a row."""
    positions = np.array([item.world_from_object[:3, 3] for item in items]).reshape(-1, 3)
    inside = np.array([not item.beyond for item in items], np.bool_)
    # The terrain ends at the edge; beyond it objects stand with their origin on the ground.
    positions[inside, 2] = world.terrain.field.height_at(*positions[inside, :2].T)
    geodetic = geodetic_from_world(positions, world.origin)
    forces = _forces(world, items)
    passability = passability_of(forces, RobotConfig())
    measures: dict[str, Measures] = {}
    rows = []
    for item, position, (latitude, longitude, _), force, share in zip(
        items, positions, geodetic, forces.tolist(), passability.tolist(), strict=True
    ):
        if item.mesh not in measures:
            measures[item.mesh] = measure(world.meshes[item.mesh], world.materials)
        species = world.meshes[item.mesh].species
        values = {
            "instance_id": item.object_id,
            "name": item.name,
            "kind": item.kind,
            "species": "; ".join(species),
            "scientific_name": "; ".join(filter(None, map(scientific_name, species))),
            "classes": "; ".join(world.classes[label].name for label in measures[item.mesh].labels),
            "latitude_deg": latitude,
            "longitude_deg": longitude,
            "ground_height_m": position[2],
            "x_m": position[0],
            "y_m": position[1],
            "force_n": force if np.isfinite(force) else np.nan,
            "passability": share,
            **_measured(measures[item.mesh], item.world_from_object, position),
        }
        rows.append(tuple(_plain(name, values[name]) for name in COLUMNS))
    return rows


def _forces(world: World, items: Sequence[Item]) -> Array:
    """Force [N] (n,) with which the paper's robot presses down objects; infinite if they are solid."""
    forces = np.zeros(len(items))
    rows = defaultdict[tuple[str, str], list[int]](list)
    for row, item in enumerate(items):
        rows[item.kind, item.mesh].append(row)
    for (kind, mesh), own in rows.items():
        poses = np.array([items[row].world_from_object for row in own])
        forces[own] = forces_of_copies(world, kind, world.meshes[mesh], poses, RobotConfig())
    return forces


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

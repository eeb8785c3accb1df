# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The files of a map: GeoTIFF, a grid map of ROS, an image for Nav2's map server, NumPy.

Layers are arrays over x and y. A GeoTIFF has north at the top, which is x, and west at the left, which is y, so that
both axes are turned round. So are the matrices of grid_map, which begin at the greatest x and y.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray
from rosbags.typesys.stores import ros1_noetic as noetic

from fieldtruth.bag.messages import WORLD, header, register, serialize
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.arrays import Mask
from fieldtruth.core.geodesy import Origin
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.kernels.columns import LOW
from fieldtruth.world.model import World
from fieldtruth.world_maps.layers import LAYERS, Grid, Layer, Layers

ABOUT: Final = "map.yaml"
"""File of a folder that says what is in it."""
TOPIC: Final = "/grid_map"
NAMES_TOPIC: Final = "/grid_map/names"
STAMP_NS: Final = 1
"""Stamp of a map in a bag: ROS takes 0 for "no time"."""
_ROWS: Final = 512  # of an image that are in memory at once
_OCCUPIED, _FREE = 0, 254
_SEMI_MAJOR, _ECCENTRICITY2 = 6_378_137.0, 6.694379990141e-3  # of WGS 84


class MadeMap(NamedTuple):
    """A map that is made: its layers (n, m), names of their numbers by table, what the layers are, and of which rig."""

    world: World
    grid: Grid
    layers: Layers
    names: dict[str, dict[int, str]]
    rows: Mapping[str, Layer] = LAYERS
    rig: Mapping[str, Any] = {}
    """For a map that depends on a robot, the values of its rig."""


class Format(NamedTuple):
    """A row of the table."""

    write: Callable[[MadeMap, Path], None]
    suffix: str
    """Added to the world's name and seed for the default output path."""
    layers: tuple[str, ...] = ()
    """Layers that it is made of; empty: the user's choice."""
    most_bytes: float = np.inf
    """Size of all layers, in single precision, that it can hold."""
    library: str = ""
    """Library of the extra ``maps`` that it needs."""


def about(made: MadeMap) -> dict[str, Any]:
    """Return what a reader of the layers needs to know, for a YAML file."""
    grid = made.grid
    return {
        "world": {"name": made.world.name, "seed": made.world.seed, "origin": [float(v) for v in made.world.origin]}
        | ({"layout": dict(made.world.layout)} if made.world.layout else {}),
        "grid": {"x0": grid.x0, "y0": grid.y0, "resolution": grid.resolution, "shape": list(grid.shape)},
        "layers": {
            name: {"unit": made.rows[name].unit, "description": made.rows[name].description} for name in made.layers
        },
        **made.names,
        **({"rig": dict(made.rig)} if made.rig else {}),
    }


def local_crs(origin: Origin) -> str:
    """Return the map projection whose east and north are -y and x of a world frame, in PROJ's words.

    A transverse Mercator projection about the origin, scaled to its height: within 500 m and 50 m of height of the
    origin, it agrees with the frame's plane to 5 mm.
    """
    w = 1.0 - _ECCENTRICITY2 * np.sin(np.radians(origin.latitude)) ** 2
    radius = _SEMI_MAJOR * np.sqrt(1.0 - _ECCENTRICITY2) / w
    at = f"+lat_0={origin.latitude:.12f} +lon_0={origin.longitude:.12f} +k={1.0 + origin.height / radius:.15f}"
    return f"+proj=tmerc {at} +datum=WGS84 +units=m"


def _write_geotiff(made: MadeMap, target: Path) -> None:
    """Write a folder of a GeoTIFF for each layer, and ``map.yaml``."""
    from affine import Affine

    target.mkdir()
    grid = made.grid
    north, west = grid.x0 + grid.shape[0] * grid.resolution, -(grid.y0 + grid.shape[1] * grid.resolution)
    transform = Affine(grid.resolution, 0.0, west, 0.0, -grid.resolution, north)
    for name, values in made.layers.items():
        _write_tiff(target / f"{name}.tif", name, values, transform, made)
    (target / ABOUT).write_text(yaml.safe_dump(about(made), sort_keys=False), encoding="utf-8")


def _write_tiff(path: Path, name: str, values: NDArray[Any], transform: Any, made: MadeMap) -> None:
    import rasterio
    from rasterio.windows import Window

    layer, (rows, columns) = made.rows[name], values.shape
    none = np.nan if values.dtype.kind == "f" else 0 if "0: none" in layer.description else None
    profile = {"driver": "GTiff", "width": columns, "height": rows, "count": 1, "dtype": values.dtype, "nodata": none}
    tiles = {"tiled": True, "blockxsize": 256, "blockysize": 256, "compress": "deflate", "bigtiff": "if_safer"}
    crs = rasterio.crs.CRS.from_string(local_crs(made.world.origin))
    with rasterio.open(path, "w", **profile, **tiles, crs=crs, transform=transform) as file:
        file.set_band_description(1, layer.description)
        file.set_band_unit(1, layer.unit)
        if layer.names:
            file.update_tags(1, **{str(number): text for number, text in made.names[layer.names].items()})
        if layer.names == "classes":
            palette = made.world.classes.palette
            file.write_colormap(1, {number: (*map(int, palette[number]), 255) for number in made.names["classes"]})
        for first, last in _blocks(rows):
            block = values[rows - last : rows - first][::-1, ::-1]
            file.write(np.ascontiguousarray(block), 1, window=Window(0, first, columns, last - first))


def _blocks(count: int) -> Iterator[tuple[int, int]]:
    return ((first, min(first + _ROWS, count)) for first in range(0, count, _ROWS))


# Fields as in grid_map_msgs of ROS 1, so that the MD5 sums are those of ANYbotics' package.
_INFO_TYPE, GRID_MAP_TYPE = "grid_map_msgs/msg/GridMapInfo", "grid_map_msgs/msg/GridMap"
_INFO = "std_msgs/Header header\nfloat64 resolution\nfloat64 length_x\nfloat64 length_y\ngeometry_msgs/Pose pose\n"
LATCHED_TOPICS: Final = (Topic(TOPIC, GRID_MAP_TYPE, None), Topic(NAMES_TOPIC, "std_msgs/msg/String", None))
_GRID_MAP = (
    "grid_map_msgs/GridMapInfo info\nstring[] layers\nstring[] basic_layers\nstd_msgs/Float32MultiArray[] data\n"
    "uint16 outer_start_index\nuint16 inner_start_index\n"
)


_INFO_MESSAGE, _GRID_MAP_MESSAGE = register(_INFO, _INFO_TYPE), register(_GRID_MAP, GRID_MAP_TYPE)


def grid_map_message(grid: Grid, layers: Layers, stamp_ns: int = STAMP_NS, number: int = 0) -> bytes:
    """Serialise grid_map_msgs/GridMap of layers (n, m), the ``number``-th of its topic."""
    length_x, length_y = (count * grid.resolution for count in grid.shape)
    pose = noetic.geometry_msgs__msg__Pose(
        noetic.geometry_msgs__msg__Point(grid.x0 + length_x / 2, grid.y0 + length_y / 2, 0.0),
        noetic.geometry_msgs__msg__Quaternion(0.0, 0.0, 0.0, 1.0),
    )
    own = _INFO_MESSAGE(header(number, stamp_ns, WORLD), grid.resolution, length_x, length_y, pose)
    message = _GRID_MAP_MESSAGE(own, list(layers), [], [_matrix(values) for values in layers.values()], 0, 0)
    return serialize(message, GRID_MAP_TYPE)


def names_message(text: Mapping[str, Any]) -> bytes:
    """Serialise std_msgs/String: what is in the layers, as YAML."""
    message = noetic.std_msgs__msg__String(yaml.safe_dump(dict(text), sort_keys=False))
    return serialize(message, "std_msgs/msg/String")


def _write_grid_map(made: MadeMap, target: Path) -> None:
    """Write a bag of one latched message with all layers, and one with names of classes, surfaces and soils."""
    data = grid_map_message(made.grid, made.layers)
    with BagWriter(target, LATCHED_TOPICS) as bag:
        bag.write(TOPIC, STAMP_NS, data)
        bag.write(NAMES_TOPIC, STAMP_NS, names_message(about(made)))


def _matrix(values: NDArray[Any]) -> Any:
    """Return a layer as grid_map has it: rows towards -x, columns towards -y, column by column."""
    rows, columns = values.shape
    dimensions = [
        noetic.std_msgs__msg__MultiArrayDimension("column_index", columns, rows * columns),
        noetic.std_msgs__msg__MultiArrayDimension("row_index", rows, rows),
    ]
    layout = noetic.std_msgs__msg__MultiArrayLayout(dimensions, 0)
    return noetic.std_msgs__msg__Float32MultiArray(
        layout, np.ascontiguousarray(values[::-1, ::-1].T, np.float32).ravel()
    )


def _write_npz(made: MadeMap, target: Path) -> None:
    """Write layers (n, m) over x and y, ``x0``, ``y0``, ``resolution``, ``origin``, ``world``, ``rig``, and names."""
    names = {key: np.array([table.get(k, "") for k in range(max(table) + 1)]) for key, table in made.names.items()}
    x0, y0, resolution, _ = made.grid
    with target.open("wb") as file:
        grid = {"x0": np.float64(x0), "y0": np.float64(y0), "resolution": np.float64(resolution)}
        world = {"origin": np.array(made.world.origin), "world": np.array(identity(made.world))}
        if made.world.layout:
            world["layout"] = np.array(json.dumps(dict(made.world.layout)))
        if made.rig:
            world["rig"] = np.array(json.dumps(dict(made.rig)))
        np.savez_compressed(file, allow_pickle=False, **made.layers, **names, **grid, **world)


def identity(world: World) -> str:
    """Return a text that differs between worlds: name, seed, size and number of objects."""
    count = len(world.instances) + sum(len(each.mesh) for each in world.swarms)
    return f"{world.name} with seed {world.seed}, {world.size[0]:g} m x {world.size[1]:g} m, {count} objects"


def _write_pgm(made: MadeMap, target: Path) -> None:
    """Write ``map.pgm`` and ``map.yaml`` for Nav2's map server: x to the right, y up; occupied or free."""
    target.mkdir()
    grid, layers = made.grid, made.layers
    columns, rows = grid.shape
    with (target / "map.pgm").open("wb") as file:
        file.write(b"P5\n%d %d\n255\n" % (columns, rows))
        for first, last in _blocks(rows):
            own = slice(rows - last, rows - first)
            occupied = is_occupied({name: values[:, own] for name, values in layers.items()})
            file.write(np.where(occupied, _OCCUPIED, _FREE).astype(np.uint8).T[::-1].tobytes())
    text = {"image": "map.pgm", "mode": "trinary", "resolution": grid.resolution, "origin": [grid.x0, grid.y0, 0.0]}
    text |= {"negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.25}
    (target / ABOUT).write_text(yaml.safe_dump(text, sort_keys=False), encoding="utf-8")


def is_occupied(layers: Layers) -> Mask:
    """Return whether cells hold an obstacle, or a step or water of more than 0.1 m; ``OCCUPYING`` names the layers."""
    occupied: Mask = (layers["obstacle"] > 0) | (layers["step_height"] > LOW) | (layers["water_depth"] > LOW)
    return occupied


OCCUPYING: Final = ("obstacle", "step_height", "water_depth")
FORMATS: Final = {
    "geotiff": Format(_write_geotiff, "_map", library="rasterio"),
    "grid_map": Format(_write_grid_map, "_map.bag", most_bytes=1e9),  # TCPROS refuses longer messages
    "npz": Format(_write_npz, "_map.npz"),
    "pgm": Format(_write_pgm, "_nav2", OCCUPYING),
}
"""By name."""

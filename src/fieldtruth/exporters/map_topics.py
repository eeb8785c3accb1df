# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export the maps around the robot as topics, in a bag to be played beside that of the run."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys.stores import ros1_noetic as noetic

from fieldtruth.bag.messages import WORLD, header, serialize
from fieldtruth.bag.run import Run
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.arrays import Mask
from fieldtruth.core.readings import Cloud
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.exporters import Options
from fieldtruth.local_maps import LocalMap, LocalMaps
from fieldtruth.world_maps.files import (
    GRID_MAP_TYPE,
    LATCHED_TOPICS,
    NAMES_TOPIC,
    TOPIC,
    grid_map_message,
    names_message,
)
from fieldtruth.world_maps.layers import Grid

MAP, SEEN_MAP, ALL_LAYERS = "/local_map", "/local_map/seen", "/local_map/grid_map"
GRID_TYPE: Final = "nav_msgs/msg/OccupancyGrid"
_OCCUPIED, _UNKNOWN = 100, -1


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the bag: latched ``/grid_map`` of the world along the path with its names, and for each frame
    ``/local_map`` and ``/local_map/seen`` (nav_msgs/OccupancyGrid), and ``/local_map/grid_map`` with all layers.

    Raises:
        BagError, UnknownNameError, ConfigurationError: as ``LocalMaps``.
    """
    (run,) = runs
    given, clouds = options.maps.given(), bool(run.of(Cloud))
    if "layers" in given:
        given["layers"] = list(dict.fromkeys([*given["layers"], "ground", "free", *["seen"] * clouds]))
    maps = LocalMaps(run, **given, workers=options.workers, progress=options.progress)
    per_frame = [(MAP, GRID_TYPE), *[(SEEN_MAP, GRID_TYPE)] * clouds, (ALL_LAYERS, GRID_MAP_TYPE)]
    stamps = maps.stamps_ns.tolist()

    def messages(number: int) -> list[bytes]:
        made = maps.at(stamps[number])
        known = np.isfinite(made.layers["ground"])
        found = [occupancy_grid(made, known, number)]
        if clouds:
            found.append(occupancy_grid(made, known & (made.layers["seen"] > 0), number))
        return [*found, grid_map_message(made.grid, made.layers, made.stamp_ns, number)]

    with BagWriter(target, [*LATCHED_TOPICS, *(Topic(name, kind, 1.0) for name, kind in per_frame)]) as bag:
        bag.write(TOPIC, stamps[0], grid_map_message(maps.grid, maps.world_layers, stamps[0]))
        bag.write(NAMES_TOPIC, stamps[0], names_message(maps.describe()))
        for stamp, own in zip(stamps, options.each("maps", run, range(len(stamps)), messages), strict=True):
            for (name, _), data in zip(per_frame, own, strict=True):
                bag.write(name, stamp, data)


def occupancy_grid(made: LocalMap, known: Mask, number: int) -> bytes:
    """Serialise nav_msgs/OccupancyGrid: 0 where the robot is free to go, 100 where not, -1 where it is not known."""
    grid: Grid = made.grid
    cells: NDArray[Any] = np.where(known, np.where(made.layers["free"] > 0, 0, _OCCUPIED), _UNKNOWN).astype(np.int8)
    origin = noetic.geometry_msgs__msg__Pose(
        noetic.geometry_msgs__msg__Point(grid.x0, grid.y0, 0.0),
        noetic.geometry_msgs__msg__Quaternion(0.0, 0.0, 0.0, 1.0),
    )
    head = header(number, made.stamp_ns, WORLD)
    info = noetic.nav_msgs__msg__MapMetaData(head.stamp, grid.resolution, *grid.shape, origin)
    data = np.ascontiguousarray(cells.T).ravel()  # x first
    return serialize(noetic.nav_msgs__msg__OccupancyGrid(head, info, data), GRID_TYPE)

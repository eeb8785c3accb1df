# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps around the robot at every frame of a run: exact layers of its world, what was seen until then, what is free.

A map is a window of the map of the world: its axes are the world's, and it moves with the robot in whole cells, as
those of grid_map and elevation_mapping do. So no value is interpolated, and equal cells of two frames are equal.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import Trajectory
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.parallel import check_memory, cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.kernels.walks import SeenCells, free_ways, see_cells
from fieldtruth.local_maps.costs import CostMap, read_costs
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World
from fieldtruth.world_maps import check_layers, grid_of, map_layers
from fieldtruth.world_maps.files import OCCUPYING, identity, is_occupied
from fieldtruth.world_maps.filters import FARTHEST
from fieldtruth.world_maps.layers import LAYERS, Grid, Layer, Layers, names_of

SIDE: Final = 20.0
"""Default side [m] of a map."""
RESOLUTION: Final = 0.1
"""Default side [m] of a cell."""
SEEN_HEIGHT: Final = 2.0
"""Height [m] above the bare ground up to which a ray has seen a cell that it passes."""
OWN: Final = {
    "seen": Layer("", "u1", "2 where a LiDAR had a return, 1 where a ray passed up to 2 m above the ground; 0: none"),
    "free": Layer("", "u1", "1 where no obstacle, step or water of more than 0.1 m is and costs, if any, have a way"),
}
"""Layers that a map of the world does not have."""
DEFAULT: Final = (
    *("ground", "ground_class", "hard_ground", "hard_ground_class", "hard_ground_instance", "overhang"),
    *("overhang_class", "overhang_instance", "plant_top", "plant_top_class", "plant_top_instance", "water_depth"),
    *("obstacle", "slope", "step_height", *OWN),
)
"""Layers of a map if none are asked for, beside those of costs."""
ANGLES: Final = np.radians(np.arange(360.0))
"""Directions [rad] of free distances: 0 is the robot's heading, positive to the left."""
_NEVER: Final = np.iinfo(np.int64).max
_MOST_CELLS: Final = 4000  # along a side


class LocalMap(NamedTuple):
    """The map around the robot at a stamp. Cells beyond the world are NaN or 0 in all layers."""

    stamp_ns: int
    grid: Grid
    """Cells; ``grid.x0``, ``grid.y0`` [m] is the corner of least x and y in the world."""
    layers: Layers
    """(n, n) by name, over x and y of the world; heights [m] are the world's, too."""
    world_from_base: Array
    """(4, 4) true pose of base_link."""
    free_distance: Array
    """(360,) [m] from base_link, at 0, 1, ... degrees to the left of the heading, to the first cell that is not free,
    at most half the side."""

    @property
    def arrays(self) -> Layers:
        """All of it by name: layers, ``x0``, ``y0``, ``resolution``, ``stamp_ns``, ``world_from_base``, free space."""
        grid = {
            "x0": np.array(self.grid.x0),
            "y0": np.array(self.grid.y0),
            "resolution": np.array(self.grid.resolution),
        }
        own = {"world_from_base": self.world_from_base, "free_distance": self.free_distance}
        return {**self.layers, **grid, "stamp_ns": np.array(self.stamp_ns), **own, "free_polygon": self.free_polygon}

    @property
    def free_polygon(self) -> Array:
        """Corners (360, 2) [m] of the space that is free around the robot, in its levelled frame: x ahead, y left."""
        return np.asarray(self.free_distance[:, None] * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1))


class LocalMaps:
    """Maps around the robot of a run: ``maps[i]`` at the stamps of its first LiDAR, ``maps.at(stamp_ns)`` at any.

    May be pickled, forked and read by threads. The part of the world along the path is mapped once, when it is made,
    and all clouds are read for the layer ``seen``.

    Args:
        run: the run, or the path of its folder or bag.
        side: side [m] of a map.
        resolution: side [m] of a cell.
        layers: names of ``world_maps.LAYERS``, ``seen``, ``free`` and those of costs; None: ``DEFAULT`` and all costs.
        cost: NPZ file of ``fieldtruth cost`` for this world and robot, whose layers without a heading become layers.
        workers: threads; None uses all available cores.
        progress: receives the progress.

    Raises:
        BagError: the world of the run is not known, or it has no true poses, or no LiDAR or camera.
        UnknownNameError: an unknown layer.
        ConfigurationError: a side, resolution or cost map that is not allowed.
    """

    def __init__(
        self,
        run: Run | Path | str,
        *,
        side: float = SIDE,
        resolution: float = RESOLUTION,
        layers: Sequence[str] | None = None,
        cost: Path | str | None = None,
        workers: int | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.run = run if isinstance(run, Run) else open_run(Path(run))
        check_layers(None, resolution, "npz")
        if not 1 <= side / resolution <= _MOST_CELLS:
            raise ConfigurationError(f"side must be 1 to {_MOST_CELLS} cells of {resolution:g} m, got {side:g} m")
        self._count, self._reach = round(side / resolution), side / 2
        progress = progress or Silent()
        self._trajectory, self.stamps_ns = self.run.trajectory, _stamps_of(self.run)
        costs = None if cost is None else read_costs(Path(cost))
        self.rows = _rows_of(costs)
        """What the layers are that may be asked for, by name."""
        self.names = _checked_names(layers, self.rows, self.run, resolution)
        """Names of the layers of a map."""
        with progress.stage("build the world"):
            world = world_of_run(self.run)
        if costs is not None:
            costs.check_world(world)
        self.about: dict[str, Any] = {"world": identity(world), **names_of(world)}
        """Which world it is, and names of the numbers in layers by table: ``classes``, ``surfaces``, ``soils``."""
        with progress.stage("map the world"):
            self.grid = grid_of(world, resolution, self._area(world, resolution))
            own = [name for name in self.names if name in LAYERS]
            cells = self.grid.shape[0] * self.grid.shape[1]
            check_memory(8 * cells * (len(own) + 6), "the map along the path", "take a coarser resolution")
            found = map_layers(
                world, self.grid, list(dict.fromkeys(["ground", *OCCUPYING, *own])), workers or cpu_count()
            )
        self._layers = {name: found[name] for name in own}
        self._free = np.asarray(~is_occupied(found), np.uint8)
        if costs is not None:
            self._add_costs(costs)
        shape = self.grid.shape
        self._seen = SeenCells(*self.grid[:3], found["ground"], np.full(shape, _NEVER), np.full(shape, _NEVER))
        if "seen" in self.names:
            self._see(progress)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __getitem__(self, index: SupportsIndex) -> LocalMap:
        """Return the map at the i-th frame."""
        return self.at(int(self.stamps_ns[index]))

    def __iter__(self) -> Iterator[LocalMap]:
        return (self.at(int(stamp)) for stamp in self.stamps_ns)

    def at(self, stamp_ns: int) -> LocalMap:
        """Return the map at a stamp [ns].

        Raises:
            BagError: there is no true pose at this stamp.
        """
        pose = self._trajectory.world_from_base(stamp_ns)
        x0, y0, resolution, _ = self.grid
        place = np.array([(pose[0, 3] - x0) / resolution, (pose[1, 3] - y0) / resolution])
        i, j = np.rint(place - self._count / 2).astype(int).tolist()
        grid = Grid(x0 + i * resolution, y0 + j * resolution, resolution, (self._count, self._count))
        found = {name: self._window(values, i, j) for name, values in self._layers.items()}
        if "free" in self.names:
            found["free"] = self._window(self._free, i, j)
        if "seen" in self.names:
            passed, hit = (self._window(each, i, j, _NEVER) for each in (self._seen.passed, self._seen.hit))
            found["seen"] = np.where(hit <= stamp_ns, 2, passed <= stamp_ns).astype(np.uint8)
        distance = np.full(len(ANGLES), self._reach / resolution)
        free_ways(self._free, place[0], place[1], transforms.yaw_from_rotation(pose[:3, :3]) + ANGLES, distance)
        return LocalMap(stamp_ns, grid, {name: found[name] for name in self.names}, pose, distance * resolution)

    @property
    def world_layers(self) -> Layers:
        """Layers (n, m) of the world along the path, on ``grid``: those of all maps that do not change with time."""
        return dict(self._layers)

    def sample(self, name: str, points: Array) -> NDArray[Any]:
        """Return a layer's values (n,) of the cells below points (n, 2 or 3) [m] in the world; NaN or 0 beyond."""
        values = self._free if name == "free" else self._layers[name]
        cells = np.floor((points[:, :2] - self.grid[:2]) / self.grid.resolution)  # NaN is not inside
        inside = ((cells >= 0) & (cells < self.grid.shape)).all(axis=1)
        found = np.full(len(points), _none_of(values), values.dtype)
        i, j = cells[inside].astype(int).T
        found[inside] = values[i, j]
        return found

    def describe(self) -> dict[str, Any]:
        """Return side, resolution, units and descriptions of the layers, the world and names, for a YAML file."""
        rows = {name: {"unit": self.rows[name].unit, "description": self.rows[name].description} for name in self.names}
        side = self._count * self.grid.resolution
        return {"side": side, "resolution": self.grid.resolution, "layers": rows} | self.about

    def _area(self, world: World, resolution: float) -> list[float]:
        """Return the rectangle around the path, from the borders of cells of a map of the whole world on."""
        path, corner = self._trajectory.position[:, :2], -np.array(world.size) / 2
        low = path.min(axis=0) - self._reach - FARTHEST
        low = corner + np.floor((low - corner) / resolution) * resolution
        return [*low.tolist(), *(path.max(axis=0) + self._reach + FARTHEST).tolist()]

    def _window(self, values: NDArray[Any], i: int, j: int, none: Any = None) -> NDArray[Any]:
        """Return the cells of a window from (i, j) on; beyond the grid ``none``, by default NaN or 0."""
        found = np.full((self._count,) * 2, _none_of(values) if none is None else none, values.dtype)
        spans = [(max(k, 0), min(k + self._count, n)) for k, n in zip((i, j), values.shape, strict=True)]
        (a, b), (c, d) = spans
        if a < b and c < d:
            found[a - i : b - i, c - j : d - j] = values[a:b, c:d]
        return found

    def _add_costs(self, costs: CostMap) -> None:
        x, y = self.grid.middles(slice(0, self.grid.shape[0]), slice(0, self.grid.shape[1]))
        known, passes = costs.covers(x, y), np.zeros(self.grid.shape, np.bool_)
        for name in costs.rows:
            values = costs.at(name, x, y)
            if name.startswith("passes"):
                passes |= values > 0
            if name in self.names:
                self._layers[name] = values
        self._free &= passes | ~known

    def _see(self, progress: Progress) -> None:
        """Read all clouds, and note when each cell was seen first."""
        with progress.stage("what was seen", self.run.duration_s) as advance:
            for source in self.run.of(Cloud):
                clouds, before = self.run.readings(source.name, labelled=False), 0
                base_from_sensor = self.run.calibration.base_from(source.name)
                for cloud in clouds:
                    origins, ends = world_rays(cloud, self._trajectory, base_from_sensor)
                    see_cells(origins, ends, cloud.stamp_ns, SEEN_HEIGHT, self._seen)
                    advance((cloud.stamp_ns - before) / 1e9 / len(self.run.of(Cloud)))
                    before = cloud.stamp_ns


def layers_of(
    run: Run,
    *,
    side: float = SIDE,
    resolution: float = RESOLUTION,
    layers: Sequence[str] | None = None,
    cost: Path | str | None = None,
) -> dict[str, Layer]:
    """Return the layers of the maps of a run by name, before any work; arguments and errors as ``LocalMaps``."""
    rows = _rows_of(None if cost is None else read_costs(Path(cost)))
    return {name: rows[name] for name in _checked_names(layers, rows, run, resolution)}


def world_of_run(run: Run) -> World:
    """Return the world of a run.

    Raises:
        BagError: a bag from elsewhere, whose world is not known.
    """
    if run.experiment is None:
        raise BagError(f"{run.bag} has no experiment.yaml beside it, which says what its world is")
    return world_of(run.experiment)


def world_rays(cloud: Cloud, trajectory: Trajectory, base_from_sensor: Array) -> tuple[Array, Array]:
    """Return origins and ends (n, 3) [m] in the world of a cloud's rays, from the sensor's pose at their own times.

    The last sweep of a run may go on beyond the last pose, which is then taken.
    """
    ends, origins = np.empty((len(cloud.xyz), 3)), np.empty((len(cloud.xyz), 3))
    after = np.zeros(len(ends), np.int64) if cloud.t_ns is None else cloud.t_ns.astype(np.int64)
    stamps, at_time = np.unique(np.minimum(cloud.stamp_ns + after, trajectory.stamps_ns[-1]), return_inverse=True)
    for k, stamp in enumerate(stamps.tolist()):
        rows = at_time == k if len(stamps) > 1 else slice(None)
        pose = trajectory.world_from_base(stamp) @ base_from_sensor
        ends[rows], origins[rows] = transforms.transform(pose, cloud.xyz[rows].astype(np.float64)), pose[:3, 3]
    return origins, ends


def _rows_of(costs: CostMap | None) -> dict[str, Layer]:
    return {**LAYERS, **OWN, **({} if costs is None else costs.rows)}


def _none_of(values: NDArray[Any]) -> Any:
    return np.nan if values.dtype.kind == "f" else 0


def _stamps_of(run: Run) -> Counts:
    """Stamps [ns] of the first sensor of clouds, or else of images."""
    found = run.of(Cloud) or run.of(Image)
    if not found:
        raise BagError(f"{run.bag} has neither clouds nor images, at whose stamps maps are made")
    return run.readings(found[0].name, labelled=False).stamps_ns


def _checked_names(layers: Sequence[str] | None, rows: dict[str, Layer], run: Run, resolution: float) -> list[str]:
    """Return the names of the layers of a map; raises as ``LocalMaps``."""
    seen = bool(run.of(Cloud))
    if layers is not None and not layers:
        raise ConfigurationError(f"layers must name one of {', '.join(rows)}")
    for name in layers or ():
        if name not in rows:
            raise UnknownNameError("layer", name, rows)
        if name == "seen" and not seen:
            raise BagError(f"layer seen needs clouds, and {run.bag} has none")
    if own := [name for name in layers or () if name in LAYERS]:
        check_layers(own, resolution, "npz")
    costs = [name for name in rows if name not in LAYERS and name not in OWN]
    chosen = layers or [name for name in (*DEFAULT, *costs) if seen or name != "seen"]
    return list(dict.fromkeys(chosen))

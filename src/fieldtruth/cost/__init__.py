# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of being somewhere: over each cell of a grid and at each heading, the simulated robot is driven.

Where it does not pass, its cause is kept; where it passes, slip, tilt, vertical acceleration, energy and time.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.files import atomic_output, output_errors, remove
from fieldtruth.core.parallel import check_memory, cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.cost.stretch import CAUSE_TEXTS, Cause, Passage
from fieldtruth.cost.tiles import Costs, Order, made_tiles
from fieldtruth.drive.traversability import CELL, Blockage, Traversability
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.world.model import World
from fieldtruth.world_maps import check_map, check_size, grid_of
from fieldtruth.world_maps.files import FORMATS, MadeMap
from fieldtruth.world_maps.layers import Layer, Layers

RESOLUTION: Final = 0.25
"""Default side [m] of a cell."""
HEADINGS: Final = 8
SPEEDS: Final = (1.0,)  # [m/s]
_SLOWEST: Final = 0.05  # [m/s]
_RESOLUTIONS: Final = (0.05, 10.0)
_MOST_HEADINGS: Final = 72
_SAMPLED: Final = 2000
"""Cells of the planner's map along an axis that are looked at for free ground."""

_QUANTITIES: Final[Mapping[str, Layer]] = {
    "slip": Layer("", "f4", "share of the treads' way by which the robot's is shorter"),
    "tilt": Layer("rad", "f4", "greatest tilt"),
    "peak": Layer("m/s2", "f4", "greatest vertical acceleration, up or down"),
    "rms": Layer("m/s2", "f4", "root of the mean square of the vertical acceleration"),
    "energy": Layer("J/m", "f4", "work of the motors"),
    "time": Layer("s/m", "f4", "time"),
}
"""Layers of the costs by the fields of ``Passage``."""
_NAMES: Final = {"causes": {int(cause): text for cause, text in CAUSE_TEXTS.items()}}


def cost_layers(speeds: Sequence[float], headings: int) -> dict[str, Layer]:
    """Return the layers of a map of costs: for each speed [m/s] those over all headings, and those of each heading."""
    layers = {}
    for speed in speeds:
        of = f"at {speed:g} m/s"
        layers[layer_name("passes", speed)] = Layer("", "u1", f"number of headings at which the robot passes {of}")
        for name, row in _QUANTITIES.items():
            layers[layer_name(name, speed)] = row._replace(description=f"{row.description} {of}, mean of the headings")
        for angle in _angles(headings):
            at = f"{of}, heading {angle} deg"
            layers[layer_name("cause", speed, angle)] = Layer("", "u1", f"why the robot does not pass {at}", "causes")
            for name, row in _QUANTITIES.items():
                layers[layer_name(name, speed, angle)] = row._replace(description=f"{row.description} {at}")
    return layers


def layer_name(layer: str, speed: float, angle: str | None = None) -> str:
    """Return the name of a layer at a speed [m/s], over all headings or at one [deg]."""
    return f"{layer}_v{speed:g}" + ("" if angle is None else f"_h{angle}")


def _angles(headings: int) -> list[str]:
    """Headings [deg] in the names of layers."""
    return [f"{k * 360 / headings:03.0f}" for k in range(headings)]


def write_cost_map(
    world: World,
    out: Path | str | None = None,
    *,
    to: str,
    rig: Rig | None = None,
    speeds: Sequence[float] = SPEEDS,
    headings: int = HEADINGS,
    resolution: float = RESOLUTION,
    area: Sequence[float] | None = None,
    overwrite: bool = False,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Drive a robot over each cell of a world at each heading, write what it costs, and return the path.

    What is done is kept in the cache folder, so that the same call goes on after it was stopped.

    Args:
        world: see ``load_world``.
        out: path of the file or folder, by default in the current folder and named after the world and its seed.
        to: geotiff, grid_map or npz, as of ``write_map``.
        rig: supplies the robot, by default the paper's.
        speeds: commanded speeds [m/s].
        headings: number of headings, which divide the circle evenly; the first is along x.
        resolution: side [m] of a cell.
        area: x0, y0, x1, y1 [m] of the part that is mapped, in the world frame; by default the world.
        overwrite: replace an existing output.
        workers: processes; None uses all available cores. The output does not depend on it.
        progress: receives the progress.

    Raises:
        UnknownNameError: an unknown format.
        ConfigurationError: a speed, number of headings, resolution or area that is not allowed, or no free ground.
        OutputError: the output exists or cannot be written, memory or disk are too small, or a process was ended.
    """
    rig, progress = rig or Rig(), progress or Silent()
    check_cost(rig.robot, speeds, headings, resolution)
    target = check_cost_output(f"{world.name}_{world.seed}", out, to=to, overwrite=overwrite)
    grid, speeds = grid_of(world, resolution, area), tuple(dict.fromkeys(map(float, speeds)))
    order, table = Order(rig, grid, headings), cost_layers(speeds, headings)
    with output_errors(target):
        _prepare(target, to, world, order, table)
        layers = _driven(world, order, speeds, table, workers or cpu_count(), progress)
        with progress.stage("write the map"), atomic_output(target) as part:
            FORMATS[to].write(MadeMap(world, grid, layers, _NAMES, table, rig.model_dump(mode="json")), part)
            if overwrite:
                remove(target)
    return target


def _prepare(target: Path, to: str, world: World, order: Order, table: Mapping[str, Layer]) -> None:
    """Check disk, memory and free ground for the layers of a table, and make the folder of the target."""
    check_size(target, to, order.grid, [], [row.dtype for row in table.values()])
    needed = order.grid.shape[0] * order.grid.shape[1] * 4 * len(table)
    check_memory(needed, "a map of costs", "take fewer --speed, an --area or a coarser --resolution")
    _check_free_ground(world, order.rig)
    target.parent.mkdir(parents=True, exist_ok=True)


def _driven(
    world: World,
    order: Order,
    speeds: Sequence[float],
    table: Mapping[str, Layer],
    workers: int,
    progress: Progress,
) -> Layers:
    """Drive over all tiles at each speed [m/s], and return the layers of a table."""
    shape = order.grid.shape
    layers: Layers = {name: np.zeros(shape, row.dtype) for name, row in table.items()}
    for speed in speeds:
        with progress.stage(f"drive at {speed:g} m/s", float(shape[0] * shape[1])) as advance:
            for cells, costs in made_tiles(world, order, speed, workers):
                for name, values in named_layers(costs, speed):
                    layers[name][cells] = values
                advance(float(costs.cause[..., 0].size))
    return layers


def named_layers(costs: Costs, speed: float) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the layers of costs (n, m) at a speed [m/s] by name."""
    passes = costs.cause == Cause.PASSES
    count = passes.sum(axis=-1)
    yield layer_name("passes", speed), count
    for q, name in enumerate(Passage._fields):
        total = np.where(passes, costs.values[..., q], 0.0).sum(axis=-1)
        yield layer_name(name, speed), np.where(count > 0, total / np.maximum(count, 1), np.nan)
    for k, angle in enumerate(_angles(costs.cause.shape[-1])):
        yield layer_name("cause", speed, angle), costs.cause[..., k]
        for q, name in enumerate(Passage._fields):
            yield layer_name(name, speed, angle), costs.values[..., k, q]


def check_cost(robot: RobotConfig, speeds: Sequence[float], headings: int, resolution: float) -> None:
    """Check speeds, headings and resolution; raises as ``write_cost_map``."""
    finest, coarsest = _RESOLUTIONS
    for speed in speeds or [np.nan]:
        if not _SLOWEST <= speed <= robot.max_speed:
            allowed = f"{_SLOWEST:g} to {robot.max_speed:g} m/s, the limit of the robot {robot.model}"
            raise ConfigurationError(f"speed must be {allowed}, got {speed:g}")
    if not finest <= resolution <= coarsest:
        raise ConfigurationError(f"resolution must be {finest:g} to {coarsest:g} m, got {resolution:g}")
    if not 1 <= headings <= _MOST_HEADINGS or 360 % headings:
        raise ConfigurationError(f"headings must divide 360 and be at most {_MOST_HEADINGS}, got {headings}")


def check_cost_output(stem: str, out: Path | str | None = None, *, to: str, overwrite: bool = False) -> Path:
    """Return the path of the output, before any work; raises as ``write_cost_map``."""
    fits = {name: each for name, each in FORMATS.items() if not each.layers}
    if to not in fits:
        raise UnknownNameError("format", to, fits)
    return check_map(stem + "_cost", out, to=to, overwrite=overwrite)


def _check_free_ground(world: World, rig: Rig) -> None:
    """Check that the planner's map of the world has a free cell."""
    ground = Traversability(world, rig)
    x, y = (
        start + CELL * np.unique(np.linspace(0, n - 1, min(n, _SAMPLED)).astype(int))
        for start, n in zip(ground.corner, ground.shape, strict=True)
    )
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    if not (ground.blockage_at(points) == Blockage.NONE).any():
        raise ConfigurationError(f"{world.name}: no free ground for the robot {rig.robot.model}")

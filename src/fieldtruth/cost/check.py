# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of maps of costs: layers over headings follow from those of each, and a sample of lines is driven again."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.cost import check_cost, cost_layers, layer_name, named_layers
from fieldtruth.cost.stretch import Cause, Passage
from fieldtruth.cost.tiles import Costs, Order, TileDrives
from fieldtruth.experiment.rig import Rig
from fieldtruth.local_maps.check import StoredMap, compare, read_map
from fieldtruth.local_maps.costs import DAMAGED
from fieldtruth.validation.check import Check, Count, Rule, Spec, Tally

TILES: Final = 4
"""Tiles, chosen at random, in which lines are driven again."""
LINES: Final = 8
"""Lines of each of them, of any heading and speed."""
SAME_MEANS: Final = Rule("costs are NaN where a heading does not pass, means and counts are those of the headings")
SAME_DRIVES: Final = Rule("causes and costs are those of drives that are made again (sample)")
COSTS: Final[Spec] = Spec("costs", (SAME_MEANS,), "values")
DRIVES: Final[Spec] = Spec("costs by drives", (SAME_DRIVES,), "values", "a map that does not say its robot")
_CAUSE: Final = re.compile(r"cause_v(.+)_h(\d+)")


def has_costs(path: Path) -> bool:
    """Return whether a map, for which ``is_map`` is true, is one of costs."""
    if path.is_dir():
        return any(path.glob("cause_v*.tif"))
    if path.suffix == ".bag":
        return any(map(_CAUSE.fullmatch, read_map(path).layers))
    try:
        with np.load(path, allow_pickle=False) as file:
            return any(map(_CAUSE.fullmatch, file.files))
    except DAMAGED:  # which those who read it say
        return False


def validate_cost_map(path: Path | str, *, workers: int | None = None, progress: Progress | None = None) -> list[Check]:
    """Check a map that ``fieldtruth cost`` wrote: each value by the others, and those of some lines by new drives.

    Args:
        path: an NPZ file, a folder of GeoTIFFs, or a bag of a grid map.
        workers: ignored, as the lines are driven in this process.
        progress: receives the progress.

    Raises:
        ConfigurationError: no such map, or one whose world is not known or is built otherwise now.
        OutputError: no library that reads GeoTIFFs.
    """
    stored, progress = read_map(Path(path)), progress or Silent()
    found = [match.groups() for match in map(_CAUSE.fullmatch, stored.layers) if match]
    if not found:
        raise ConfigurationError(f"{path} is no map of costs; `fieldtruth cost` makes one")
    try:
        speeds, headings = list(dict.fromkeys(float(speed) for speed, _ in found)), len({angle for _, angle in found})
        tallies, rig = [Tally(COSTS), Tally(DRIVES)], Rig.model_validate(stored.rig)
    except ValueError as error:
        raise ConfigurationError(f"{path} does not describe speeds and a rig") from error
    if stored.rig:
        check_cost(rig.robot, speeds, headings, stored.grid.resolution)
    known = all(name in stored.layers for name in cost_layers(speeds, headings))
    tallies[0][SAME_MEANS].see(known, "a layer that is missing")
    if not known:
        tallies[1].skipped = "a layer is missing"
    if known:
        costs = {speed: _costs(stored, speed, headings) for speed in speeds}
        for speed in speeds:
            _compare_means(tallies[0][SAME_MEANS], stored, costs[speed], speed)
        if stored.rig:
            with progress.stage("build the world"):
                drives = TileDrives(stored.rebuilt(Path(path)), order := Order(rig, stored.grid, headings))
            chosen = list(_sample(order, speeds))
            with progress.stage("drive", float(len(chosen))) as advance:
                for speed, tile, lines in chosen:
                    _compare_drives(tallies[1][SAME_DRIVES], order, drives, costs[speed], (tile, speed, lines))
                    advance(1.0)
    return [tally.result() for tally in tallies]


def _costs(stored: StoredMap, speed: float, headings: int) -> Costs:
    """Return the causes and costs at a speed [m/s] of a whole map, whose layers are all there."""

    def of(name: str) -> NDArray[Any]:
        angles = (f"{k * 360 / headings:03.0f}" for k in range(headings))
        return np.stack([stored.layers[layer_name(name, speed, angle)] for angle in angles], axis=-1)

    values = np.stack([of(name) for name in Passage._fields], axis=-1)
    return Costs(of("cause").astype(np.uint8), values.astype(np.float32))


def _compare_means(count: Count, stored: StoredMap, costs: Costs, speed: float) -> None:
    """Compare the layers over all headings with those that follow from each heading."""
    fits = (np.isfinite(costs.values) == (costs.cause == Cause.PASSES)[..., None]).ravel()
    shape = costs.values.shape
    count.see_all(fits, lambda k: f"cost, cell, heading and number {np.unravel_index(k, shape)!s}, against its cause")
    for name, due in named_layers(costs, speed):
        if "_h" not in name:
            compare(count, name, stored.layers[name], due.astype(stored.layers[name].dtype))


def _sample(order: Order, speeds: list[float]) -> Iterator[tuple[float, tuple[int, int], set[tuple[int, int]]]]:
    """Yield tiles at a speed with some lines, as numbers of heading and line."""
    rng, tiles = np.random.default_rng(0), order.tiles()
    for row in rng.permutation(len(tiles))[:TILES].tolist():
        lines = [(k, n) for k, a in enumerate(order.angles().tolist()) for n in range(len(order.lines(tiles[row], a)))]
        chosen = {lines[at] for at in rng.permutation(len(lines))[:LINES].tolist()}
        yield speeds[int(rng.integers(len(speeds)))], tiles[row], chosen


def _compare_drives(
    count: Count,
    order: Order,
    drives: TileDrives,
    costs: Costs,
    what: tuple[tuple[int, int], float, set[tuple[int, int]]],
) -> None:
    """Drive lines of a tile at a speed again, and compare."""
    tile, speed, lines = what
    due, (x, y) = drives.costs(tile, speed, lines), order.cells(tile)
    for k, n in sorted(lines):
        cells = order.lines(tile, float(order.angles()[k]))[n].cells
        where = f"line of the tile at {x.start, y.start}, heading {k * 360 / order.headings:g} deg, {speed:g} m/s"
        compare(count, f"cause, {where}", costs.cause[x, y][(*cells, k)], due.cause[(*cells, k)])
        compare(count, f"costs, {where}", costs.values[x, y][(*cells, k)], due.values[(*cells, k)])

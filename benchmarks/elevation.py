# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Elevation maps against the bare ground below plants, by class of cover: the tables of docs/benchmarks_truth.md.

Run: python benchmarks/elevation.py [--envs NAME ...] [--signal ideal|datasheet] [--method FILE.py:FUNCTION]

A robot drives along the first route of each environment; its clouds are those of true poses. A method makes heights of
them: a function ``(clouds, poses, grid) -> heights`` of the scans' points (n, 3) [m] in the world and within the grid,
the poses ``world_from_lidar`` (k, 4, 4) at which they were taken, and the cells, a ``world_maps.layers.Grid``. Heights
are an array of the grid's shape [m], NaN where it has no estimate.

The truth is the mean height of the bare ground in a cell, of 64 places in it. Errors are estimates less truth: too high
is positive. ``pip install cloth-simulation-filter`` adds a filter of ground points (Zhang and others 2016,
doi:10.3390/rs8060501).
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from drives import FIGURES, Drive, drive_arguments, driven, score, show
from numpy.typing import NDArray

import fieldtruth as ft
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError, FieldtruthError
from fieldtruth.core.user_code import named_function
from fieldtruth.world.model import World
from fieldtruth.world_maps.layers import Grid

REACH: Final = 10.0
"""Distance [m] from the nearest position of the LiDAR up to which cells are scored."""
RESOLUTION: Final = 0.2
"""Side [m] of a cell."""
PARTS: Final = 8
"""Places along a side of a cell, of which the truth is the mean."""
LAYERS: Final = (
    *("ground", "ground_cover", "plant_top", "plant_top_class", "water_depth"),
    *("solid_volume", "flexible_volume", "passable_volume"),
)
FEW: Final = 100
"""Cells of a class of cover, at least."""
FLAT: Final = 0.02
"""Height [m] of short grass and litter below which ground is bare."""
CEILING: Final = 1.0
"""Height [m] above the LiDAR up to which points are those of an elevation map."""
COVERS: Final = (
    *("bare", "short grass, litter", "high grass", "bush"),
    *("below trees, open", "below trees, undergrowth", "stems, objects", "water"),
)
"""Classes of cover. Below trees, there are plants up to 2 m above the ground in undergrowth only."""

Method = Callable[[Sequence[Array], Array, Grid], Array]


class Truth(NamedTuple):
    """Arrays (n, m) of a grid: bare ground [m], rows of ``COVERS``, and the greatest height [m] that grows there."""

    grid: Grid
    ground: Array
    cover: NDArray[np.intp]
    height: Array


def truth_of(world: World, grid: Grid) -> Truth:
    """Read the truth of a grid from the map of a world."""
    area = (grid.x0, grid.y0, *(start + n * grid.resolution for start, n in zip(grid[:2], grid.shape, strict=True)))
    with tempfile.TemporaryDirectory() as folder:
        resolution = grid.resolution / PARTS
        path = ft.write_map(
            world, Path(folder) / "map.npz", to="npz", resolution=resolution, layers=LAYERS, area=area, workers=1
        )
        with np.load(path) as made:
            fine = {name: _split(made[name], grid.shape) for name in LAYERS}
    top = np.fmax(fine["plant_top"] - fine["ground"], fine["ground_cover"])
    return Truth(grid, fine["ground"].mean(axis=-1, dtype=np.float64), _cover(fine), top.max(axis=-1))


def _split(layer: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    """Places of each cell (n, m, 64) of a finer layer."""
    n, m = shape
    return layer.reshape(n, PARTS, m, PARTS).swapaxes(1, 2).reshape(n, m, -1)


def _cover(fine: Mapping[str, NDArray[Any]]) -> NDArray[np.intp]:
    """Row of ``COVERS`` of each cell: the first of these that is at any of its places."""
    plant, low = fine["plant_top_class"], fine["passable_volume"] + fine["flexible_volume"] > 0
    tree = np.isin(plant, (Label.TRUNK, Label.TREETOP))
    found = {
        "water": fine["water_depth"] > 0,
        "stems, objects": fine["solid_volume"] > 0,
        "below trees, undergrowth": tree & low,
        "below trees, open": tree,
        "bush": plant == Label.BUSH,
        "high grass": plant == Label.HIGH_GRASS,
        "short grass, litter": fine["ground_cover"] > FLAT,
    }
    rows = [COVERS.index(name) for name in found]
    return np.select([each.any(axis=-1) for each in found.values()], rows, COVERS.index("bare"))


def grid_around(drive: Drive) -> Grid:
    """Cells within reach of a drive, and of its world, in whole cells about the world's origin."""
    half, xy = np.array(drive.world.size) / 2, drive.poses[:, :2, 3]
    low = np.ceil(np.maximum(xy.min(axis=0) - REACH, -half) / RESOLUTION).astype(int)
    n, m = np.floor(np.minimum(xy.max(axis=0) + REACH, half) / RESOLUTION).astype(int) - low
    x0, y0 = (low * RESOLUTION).tolist()
    return Grid(x0, y0, RESOLUTION, (int(n), int(m)))


def within_reach(drive: Drive, grid: Grid) -> Mask:
    """Mask (n, m) of the cells that are scored."""
    x, y = grid.middles(slice(0, grid.shape[0]), slice(0, grid.shape[1]))
    xy = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    return drive.distance(xy.reshape(-1, 2)).reshape(grid.shape) <= REACH


# ---------------------------------------------------------------------------------------------------------------------
# Methods


def cells_of(points: Array, grid: Grid) -> tuple[Array, NDArray[np.int64]]:
    """Points (k, 3) that are in a grid, of points (n, 3), and the number (k,) of the cell of each, row by row."""
    at = np.floor((points[:, :2] - (grid.x0, grid.y0)) / grid.resolution).astype(np.int64)
    inside = ((at >= 0) & (at < grid.shape)).all(axis=1)
    return points[inside], at[inside] @ np.array([grid.shape[1], 1])


def lowest(clouds: Sequence[Array], poses: Array, grid: Grid) -> Array:
    """Height of the lowest point of each cell."""
    points, cell = cells_of(np.concatenate(clouds), grid)
    heights = np.full(grid.shape[0] * grid.shape[1], np.inf)
    np.minimum.at(heights, cell, points[:, 2])
    return np.where(np.isfinite(heights), heights, np.nan).reshape(grid.shape)


def mean(clouds: Sequence[Array], poses: Array, grid: Grid) -> Array:
    """Mean height of the points of each cell, as of a map that takes all of them for ground.

    Those of crowns, more than ``CEILING`` above the LiDAR, are left out, as programs of elevation maps do.
    """
    low = [cloud[cloud[:, 2] < pose[2, 3] + CEILING] for cloud, pose in zip(clouds, poses, strict=True)]
    return mean_of(np.concatenate(low), grid)


def mean_of(points: Array, grid: Grid) -> Array:
    """Mean height of points (k, 3) by cell."""
    points, cell = cells_of(points, grid)
    size = grid.shape[0] * grid.shape[1]
    total, count = np.bincount(cell, points[:, 2], size), np.bincount(cell, minlength=size)
    return np.asarray(total / np.where(count > 0, count, np.nan)).reshape(grid.shape)


def cloth(clouds: Sequence[Array], poses: Array, grid: Grid) -> Array:
    """Mean height of the points that a cloth touches which falls on the cloud turned upside down."""
    import CSF

    points, (csf, ground) = np.concatenate(clouds), (CSF.CSF(), CSF.VecInt())
    csf.params.bSloopSmooth, csf.params.rigidness = True, 2
    csf.params.cloth_resolution, csf.params.class_threshold = 0.5, 0.1
    csf.setPointCloud(points)
    with silent():
        csf.do_filtering(ground, CSF.VecInt(), False)
    return mean_of(points[np.array(ground, np.int64)], grid)


@contextmanager
def silent() -> Iterator[None]:
    """Discard what a library in C++ prints."""
    sys.stdout.flush()
    kept = os.dup(1)
    with Path(os.devnull).open("wb") as nothing:
        os.dup2(nothing.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def methods_of(names: Sequence[str]) -> dict[str, Method]:
    """Return the methods of this module, and a user's own."""
    found: dict[str, Method] = {"lowest": lowest, "mean": mean}
    if find_spec("CSF") is None:
        print("cloth is left out: pip install cloth-simulation-filter", file=sys.stderr)
    else:
        found["cloth"] = cloth
    return found | {name: named_function("method", name) for name in names}


def heights_of(name: str, given: Any, grid: Grid) -> Array:
    """Return what a method gave; raises ConfigurationError if it is no array of the grid's shape."""
    shape = np.shape(given)
    if shape != grid.shape:
        raise ConfigurationError(f"method {name} must return heights of shape {grid.shape}, got {shape}")
    return np.asarray(given, np.float64)


# ---------------------------------------------------------------------------------------------------------------------
# Scores


def rows_of(estimates: Mapping[str, Array], truth: Truth, scored: Mask) -> Iterator[list[object]]:
    """Yield a row of the table for each class of at least ``FEW`` cells and each method."""
    for k, name in enumerate(COVERS[:-1]):  # no LiDAR sees the ground below water
        own = scored & (truth.cover == k)
        for method, heights in estimates.items() if own.sum() >= FEW else ():
            height = float(np.median(truth.height[own]))
            yield [name, int(own.sum()), height, method, *score((heights - truth.ground)[own])]


def picture(estimates: Mapping[str, Array], truth: Truth, scored: Mask, file: str) -> None:
    """Draw the classes of cover, and the error of each method."""
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

    colours = ("#c8ab7a", "#b5d77a", "#5f9e2f", "#8e6bbf", "#e3b04b", "#3f6b3a", "#7f7f7f", "#4a90d9")
    extent = (0.0, truth.grid.shape[0] * RESOLUTION, 0.0, truth.grid.shape[1] * RESOLUTION)
    figure = Figure((12, 6), layout="constrained")
    first, *others = figure.subplots(-(-(1 + len(estimates)) // 2), 2).flat
    kinds = np.where(scored, truth.cover, np.nan)
    shown = first.imshow(kinds.T, origin="lower", extent=extent, cmap=ListedColormap(colours), vmin=-0.5, vmax=7.5)
    first.set_title("cover")
    figure.colorbar(shown, ax=first, ticks=range(len(COVERS))).ax.set_yticklabels(COVERS, fontsize=7)
    for axes, (name, heights) in zip(others, estimates.items(), strict=False):
        error = np.where(scored, heights - truth.ground, np.nan)
        shown = axes.imshow(error.T, origin="lower", extent=extent, cmap="RdBu_r", vmin=-0.5, vmax=0.5)
        axes.set_title(f"{name}: error [m]")
        axes.set_facecolor("#dddddd")
    figure.colorbar(shown, ax=others)
    figure.savefig(file, dpi=110)


def main() -> None:
    """Print the table."""
    parser = drive_arguments(__doc__ or "", ("park", "forest", "hillside", "lake", "wet_meadow"))
    options = parser.parse_args()
    try:
        methods = methods_of(options.method)
        columns = ["environment", "cover", "cells", "height", "method", *FIGURES]
        for k, environment in enumerate(options.envs):
            drive = driven(environment, options.seconds, options.signal)
            grid = grid_around(drive)
            truth, scored = truth_of(drive.world, grid), within_reach(drive, grid)
            clouds = [cells_of(scan.points, grid)[0] for scan in drive.scans]
            estimates = {
                name: heights_of(name, method(clouds, drive.poses, grid), grid) for name, method in methods.items()
            }
            show(columns, [[environment, *row] for row in rows_of(estimates, truth, scored)], header=k == 0)
        if options.picture:
            picture(estimates, truth, scored, options.picture)
    except FieldtruthError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()

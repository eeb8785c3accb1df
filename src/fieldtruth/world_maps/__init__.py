# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of a world: what is in each cell of a grid over it, exact, in the files that robots and maps use.

A map is made tile by tile. Its layers are files on the disk while it is made, so that memory does not grow with it.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from shutil import disk_usage
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, OutputError, UnknownNameError
from fieldtruth.core.files import atomic_output, output_errors, output_path, remove
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.world.model import World
from fieldtruth.world_maps.files import ABOUT, FORMATS, MadeMap
from fieldtruth.world_maps.filters import FILTERS, Filter
from fieldtruth.world_maps.layers import LAYERS, Grid, Layers, WorldColumns, names_of

RESOLUTION: Final = 0.05
"""Default side [m] of a cell."""
FINEST: Final = 0.001
COARSEST: Final = 100.0
_TILE: Final = 256
"""Cells along the side of a tile of columns."""
_BLOCK: Final = 1024
"""Cells along the side of a tile of filters, which see what is around it."""
_SPARE: Final = 100_000_000
"""Bytes that stay free on the disk."""
_LESS: Final = "take fewer --layers, an --area or a coarser --resolution"


def write_map(
    world: World,
    out: Path | str | None = None,
    *,
    to: str,
    resolution: float = RESOLUTION,
    layers: Sequence[str] | None = None,
    area: Sequence[float] | None = None,
    overwrite: bool = False,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a map of a world.

    Args:
        world: see ``load_world``.
        out: path of the file or folder, by default in the current folder and named after the world and its seed.
        to: the format, a key of ``FORMATS``: geotiff, grid_map, npz or pgm.
        resolution: side [m] of a cell.
        layers: keys of ``LAYERS``, by default all that the resolution allows; ``pgm`` has its own.
        area: x0, y0, x1, y1 [m] of the part that is mapped, in the world frame; by default the world.
        overwrite: replace an existing output.
        workers: threads; None uses all available cores. The output does not depend on it.
        progress: receives the progress.

    Returns:
        Path of the output.

    Raises:
        UnknownNameError: an unknown format or layer.
        ConfigurationError: a resolution or area that is not allowed, or a world without ground.
        OutputError: the output exists or cannot be written, a library is missing, or the disk is too small.
    """
    target = check_map_output(f"{world.name}_{world.seed}", out, to=to, overwrite=overwrite)
    wanted = check_layers(layers, resolution, to)
    grid = grid_of(world, resolution, area)
    sources = [each.source for names, each in FILTERS.items() if {*names} & {*wanted}]
    stored = list(dict.fromkeys([*wanted, *sources]))
    progress, workers = progress or Silent(), workers or cpu_count()
    with output_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        _check_size(target, to, grid, stored, wanted)
        with TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent, ignore_cleanup_errors=True) as folder:
            values = _opened(Path(folder), grid, stored)
            with progress.stage("columns"):
                _fill_columns(WorldColumns(world, grid), grid, values, workers)
            with progress.stage("slopes, gaps, distances"):
                _fill_filters(grid, values)
            with progress.stage("write the map"), atomic_output(target) as part:
                made = MadeMap(world, grid, {name: values[name] for name in wanted}, names_of(world))
                FORMATS[to].write(made, part)
                if overwrite:
                    remove(target)
    return target


def check_map_output(stem: str, out: Path | str | None = None, *, to: str, overwrite: bool = False) -> Path:
    """Return the path of the output, before any work; raises as ``write_map``."""
    if to not in FORMATS:
        raise UnknownNameError("format", to, FORMATS)
    suffix = FORMATS[to].suffix
    target = output_path(stem + suffix if out is None else out, single="." in suffix, overwrite=overwrite)
    with output_errors(target):
        if target.is_dir() and not (target / ABOUT).is_file():
            raise OutputError(f"{target} is a folder that does not hold a map; choose another --out")
    if FORMATS[to].library and find_spec(FORMATS[to].library) is None:
        raise OutputError(f"{to} needs a library that is not installed; run: pip install 'fieldtruth[maps]'")
    return target


def check_layers(layers: Sequence[str] | None, resolution: float, to: str) -> list[str]:
    """Return the layers of a map; raises as ``write_map``."""
    if not FINEST <= resolution <= COARSEST:
        raise ConfigurationError(
            f"resolution must be a number of metres from {FINEST} to {COARSEST:g}, got {resolution:g}"
        )
    limits = {name: each.coarsest for names, each in FILTERS.items() for name in names}
    if FORMATS[to].layers:
        if layers is not None:
            raise ConfigurationError(f"layers must not be given for {to}, which is made of its own")
        return list(FORMATS[to].layers)
    for name in layers or ():
        if name not in LAYERS:
            raise UnknownNameError("layer", name, LAYERS)
        if resolution > limits.get(name, np.inf) * (1 + 1e-9):
            raise ConfigurationError(
                f"layer {name} needs a resolution of at most {limits[name]:g} m, got {resolution:g}"
            )
    if layers is not None and not layers:
        raise ConfigurationError(f"layers must name one at least. Available: {', '.join(LAYERS)}")
    chosen = LAYERS if layers is None else dict.fromkeys(layers)
    return [name for name in chosen if resolution <= limits.get(name, np.inf) * (1 + 1e-9)]


def grid_of(world: World, resolution: float, area: Sequence[float] | None = None) -> Grid:
    """Return the cells of a map, all of them within the world and the area; raises as ``write_map``."""
    if not world.terrain.visible:
        raise ConfigurationError(f"{world.name}: a map needs a world with ground, this one has objects only")
    half = np.array(world.size) / 2
    low, high = -half, half
    if area is not None:
        if len(area) != 4 or not (np.isfinite(area).all() and area[0] < area[2] and area[1] < area[3]):
            raise ConfigurationError(f"area must be x0,y0,x1,y1 [m] with x0 < x1 and y0 < y1, got {_listed(area)}")
        low, high = np.maximum(low, area[:2]), np.minimum(high, area[2:])
    count = np.floor((high - low) / resolution + 1e-6).astype(int)
    if (count < 1).any():
        size = " x ".join(f"{side:g}" for side in world.size)
        raise ConfigurationError(f"area must hold one cell of {resolution:g} m of the world, {size} m about 0, 0")
    return Grid(float(low[0]), float(low[1]), resolution, (int(count[0]), int(count[1])))


def _listed(values: Sequence[float]) -> str:
    return ",".join(f"{value:g}" for value in values)


def _check_size(target: Path, to: str, grid: Grid, stored: Sequence[str], wanted: Sequence[str]) -> None:
    """Check that layers and output, uncompressed, fit on the disk, and into the format; OutputError: both figures."""
    cells = grid.shape[0] * grid.shape[1]
    size, output = f"a map of {grid.shape[0]} x {grid.shape[1]} cells", cells * 4 * len(wanted)
    needed = cells * sum(np.dtype(LAYERS[name].dtype).itemsize for name in stored) + output + _SPARE
    with suppress(OSError):
        if needed > (free := disk_usage(target.parent).free):
            raise OutputError(
                f"cannot write {target}: {size} needs {needed / 1e9:.1f} GB of disk, but {free / 1e9:.1f} GB are free; "
                f"{_LESS}"
            )
    if output > (most := FORMATS[to].most_bytes):
        raise OutputError(f"{to} holds {most / 1e9:g} GB, but {size} has {output / 1e9:.1f} GB; {_LESS}")


def _opened(folder: Path, grid: Grid, names: Sequence[str]) -> Layers:
    """Arrays of a size of the whole map, in files."""
    return {
        name: np.lib.format.open_memmap(folder / f"{name}.npy", "w+", LAYERS[name].dtype, grid.shape) for name in names
    }


def _tiles(grid: Grid, side: int) -> Iterator[tuple[slice, slice]]:
    n, m = grid.shape
    for i in range(0, n, side):
        for j in range(0, m, side):
            yield slice(i, min(i + side, n)), slice(j, min(j + side, m))


def _fill_columns(columns: WorldColumns, grid: Grid, values: Layers, workers: int) -> None:
    tiles = list(_tiles(grid, _TILE))
    made = in_order(tiles, lambda tile: columns.tile(*tile), workers)
    for tile, layers in zip(tiles, made, strict=True):
        for name in values.keys() & layers.keys():
            values[name][tile] = layers[name]


def _fill_filters(grid: Grid, values: Layers) -> None:
    for names, each in FILTERS.items():
        if values.keys() & {*names}:
            for tile in _tiles(grid, _BLOCK):
                made = dict(zip(names, _filtered(each, values, grid, tile), strict=True))
                for name in values.keys() & made.keys():
                    values[name][tile] = made[name]


def _filtered(each: Filter, values: Layers, grid: Grid, tile: tuple[slice, slice]) -> Iterator[Array]:
    """Filter a tile together with what is around it."""
    reach = int(np.ceil(each.reach / grid.resolution)) + 1
    wide = tuple(slice(max(0, s.start - reach), min(n, s.stop + reach)) for s, n in zip(tile, grid.shape, strict=True))
    own = tuple(slice(s.start - w.start, s.stop - w.start) for s, w in zip(tile, wide, strict=True))
    for made in each.make(values[each.source][wide].astype(np.float64), grid.resolution):
        yield made[own]

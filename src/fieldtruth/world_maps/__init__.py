# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of a world: what is in each cell of a grid over it, exact, in the files that robots and maps use.

A map is made tile by tile. Its layers are files on the disk while it is made, so that memory does not grow with it.
"""

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from shutil import disk_usage
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from fieldtruth.core.errors import ConfigurationError, OutputError, UnknownNameError
from fieldtruth.core.files import atomic_output, output_errors, output_path, remove
from fieldtruth.core.parallel import check_memory, cpu_count, in_order
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.world.model import World
from fieldtruth.world_maps.files import ABOUT, FORMATS, MadeMap
from fieldtruth.world_maps.filters import FILTERS
from fieldtruth.world_maps.layers import LAYERS, Grid, Layers, WorldColumns, names_of

RESOLUTION: Final = 0.05
"""Default side [m] of a cell."""
_RESOLUTIONS: Final = (0.001, 100.0)
_TILE: Final = 256  # cells along the side of a tile of columns
_BLOCK: Final = 1024  # cells along the side of a tile of filters, which see what is around it
_OWN: Final = (".tif", ".pgm", ".yaml")  # endings of the files of a map that is a folder
_SPARE: Final = 100_000_000  # bytes that stay free on the disk


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
    """Write a map of a world, and return its path.

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

    Raises:
        UnknownNameError: an unknown format or layer.
        ConfigurationError: a resolution or area that is not allowed, or a world without ground.
        OutputError: the output exists or cannot be written, a library is missing, or the disk is too small.
    """
    target = check_map(f"{world.name}_{world.seed}", out, to=to, overwrite=overwrite)
    wanted, grid = check_layers(layers, resolution, to), grid_of(world, resolution, area)
    stored, progress = _with_sources(wanted), progress or Silent()
    with output_errors(target):
        check_size(target, to, grid, *([LAYERS[name].dtype for name in names] for names in (stored, wanted)))
        target.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent, ignore_cleanup_errors=True) as folder:
            paths = {name: Path(folder) / f"{name}.npy" for name in stored}
            open_ = np.lib.format.open_memmap
            values: Layers = {name: open_(path, "w+", LAYERS[name].dtype, grid.shape) for name, path in paths.items()}
            with progress.stage("columns"):
                _fill_columns(WorldColumns(world, grid), grid, values, workers or cpu_count())
            with progress.stage("slopes, gaps, distances"):
                _fill_filters(grid, values)
            with progress.stage("write the map"), atomic_output(target) as part:
                FORMATS[to].write(MadeMap(world, grid, {name: values[name] for name in wanted}, names_of(world)), part)
                if overwrite:
                    remove(target)
    return target


def map_layers(world: World, grid: Grid, layers: Sequence[str], workers: int) -> Layers:
    """Return some layers of a map, in memory."""
    stored = _with_sources(layers)
    values: Layers = {name: np.empty(grid.shape, LAYERS[name].dtype) for name in stored}
    _fill_columns(WorldColumns(world, grid), grid, values, workers)
    _fill_filters(grid, values)
    return {name: values[name] for name in layers}


def _with_sources(layers: Sequence[str]) -> list[str]:
    """Return layers, and those that they follow from."""
    sources = [each.source for names, each in FILTERS.items() if {*names} & {*layers}]
    return list(dict.fromkeys([*layers, *sources]))


def check_map(stem: str, out: Path | str | None = None, *, to: str, overwrite: bool = False) -> Path:
    """Return the path of the output, before any work; raises as ``write_map``."""
    if to not in FORMATS:
        raise UnknownNameError("format", to, FORMATS)
    suffix = FORMATS[to].suffix
    target = output_path(stem + suffix if out is None else out, single="." in suffix, overwrite=overwrite)
    if target.is_dir() and not ((target / ABOUT).is_file() and all(each.suffix in _OWN for each in target.iterdir())):
        raise OutputError(f"{target} is a folder that holds no map, or more than a map; choose another --out")
    check_library(to)
    return target


def check_library(to: str) -> None:
    """Raise OutputError if the library of a format is not installed."""
    library = FORMATS[to].library
    if library and find_spec(library) is None:
        raise OutputError(f"{to} needs a library that is not installed; run: pip install 'fieldtruth[maps]'")


def check_layers(layers: Sequence[str] | None, resolution: float, to: str) -> list[str]:
    """Return the layers of a map; raises as ``write_map``."""
    finest, coarsest = _RESOLUTIONS
    if not finest <= resolution <= coarsest:
        raise ConfigurationError(f"resolution must be {finest:g} to {coarsest:g} m, got {resolution:g}")
    if layers is not None and (FORMATS[to].layers or not layers):
        allowed = f"be left out for {to}, which has its own" if layers else f"name one of {', '.join(LAYERS)}"
        raise ConfigurationError(f"layers must {allowed}")
    limits = {name: each.coarsest for names, each in FILTERS.items() for name in names}
    fine = [name for name in LAYERS if resolution <= limits.get(name, coarsest) * (1 + 1e-9)]
    for name in layers or ():
        if name not in LAYERS:
            raise UnknownNameError("layer", name, LAYERS)
        if name not in fine:
            raise ConfigurationError(
                f"layer {name} needs a resolution of at most {limits[name]:g} m, got {resolution:g}"
            )
    return list(dict.fromkeys(FORMATS[to].layers or layers or fine))


def grid_of(world: World, resolution: float, area: Sequence[float] | None = None) -> Grid:
    """Return the cells of a map, all of them within the world and the area; raises as ``write_map``."""
    if not world.terrain.visible:
        raise ConfigurationError(f"{world.name}: a map needs a world with ground, this one has objects only")
    (x0, y0, x1, y1), (length, width) = area or (-np.inf, -np.inf, np.inf, np.inf), world.size
    low, high = np.maximum((x0, y0), (-length / 2, -width / 2)), np.minimum((x1, y1), (length / 2, width / 2))
    n, m = np.floor((high - low) / resolution + 1e-6).tolist()
    if not (n >= 1 and m >= 1):
        text = f"{length:g} m x {width:g} m about 0, 0"
        raise ConfigurationError(f"area must hold a cell of {resolution:g} m of the world, which is {text}")
    return Grid(float(low[0]), float(low[1]), resolution, (int(n), int(m)))


def check_size(target: Path, to: str, grid: Grid, stored: Sequence[str], wanted: Sequence[str]) -> None:
    """Check that layers and output, uncompressed, fit on the disk, and into the format; OutputError: both figures.

    ``stored`` and ``wanted`` are the types of layers that are files while a map is made, and of those of the output.
    """
    cells = grid.shape[0] * grid.shape[1]
    output, most = cells * 4 * len(wanted), FORMATS[to].most_bytes
    free = disk_usage(next(each for each in target.absolute().parents if each.exists())).free
    needed = cells * sum(np.dtype(each).itemsize for each in stored) + output + _SPARE
    less = f"of {grid.shape[0]} x {grid.shape[1]} cells; take fewer --layers, an --area or a coarser --resolution"
    if needed > free:
        figures = f"{needed / 1e9:.1f} GB of disk, but {free / 1e9:.1f} GB are free"
        raise OutputError(f"cannot write {target}: it needs {figures}, for a map {less}")
    if output > most:
        raise OutputError(f"{to} holds at most {most / 1e9:g} GB, got {output / 1e9:.1f} GB for a map {less}")
    if most < np.inf:  # it is in memory as a whole
        check_memory(3 * output, f"{to} of a map {less.partition(';')[0]}", less.partition("; ")[2])


def _tiles(grid: Grid, side: int) -> Iterator[tuple[slice, slice]]:
    n, m = grid.shape
    return (
        (slice(i, min(i + side, n)), slice(j, min(j + side, m))) for i in range(0, n, side) for j in range(0, m, side)
    )


def _fill_columns(columns: WorldColumns, grid: Grid, values: Layers, workers: int) -> None:
    made = in_order(_tiles(grid, _TILE), lambda tile: (tile, columns.tile(*tile)), workers)
    for tile, layers in made:
        for name in values.keys() & layers.keys():
            values[name][tile] = layers[name]


def _fill_filters(grid: Grid, values: Layers) -> None:
    """Filter each tile together with what is around it."""
    for names, each in FILTERS.items():
        reach = int(np.ceil(each.reach / grid.resolution)) + 1
        for tile in _tiles(grid, _BLOCK) if values.keys() & {*names} else ():
            sides = list(zip(tile, grid.shape, strict=True))
            wide = tuple(slice(max(0, s.start - reach), min(n, s.stop + reach)) for s, n in sides)
            own = tuple(slice(s.start - w.start, s.stop - w.start) for s, w in zip(tile, wide, strict=True))
            made = each.make(values[each.source][wide].astype(np.float64), grid.resolution)
            for name, found in zip(names, made, strict=True):
                if name in values:
                    values[name][tile] = found[own]

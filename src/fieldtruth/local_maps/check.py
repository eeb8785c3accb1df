# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of maps that are files: every cell is made again in the rebuilt world, and a sample of heights by rays."""

import json
import re
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from fieldtruth import local_maps
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.arrays import Index, Mask
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.parallel import check_memory, cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.experiment.environment_file import environment_of
from fieldtruth.local_maps import OWN, LocalMaps
from fieldtruth.local_maps.costs import DAMAGED, FILE
from fieldtruth.local_maps.rays import HEIGHTS, wrong_heights
from fieldtruth.validation.check import Check, Count, Rule, Spec, Tally
from fieldtruth.world import build
from fieldtruth.world.model import World
from fieldtruth.world_maps import check_library, map_layers
from fieldtruth.world_maps.files import ABOUT, NAMES_TOPIC, TOPIC, identity
from fieldtruth.world_maps.layers import LAYERS, Grid

SUFFIX: Final = "_local_maps"
"""Ending of the name of a folder of maps around the robot of a run."""
RAYS: Final = 400
"""Cells whose heights are compared with rays, in a square of ``_SQUARE`` cells at a random place."""
SAME_CELLS: Final = Rule("cells are those of the rebuilt world")
SAME_HEIGHTS: Final = Rule("heights are those of vertical rays, traced in double precision (sample)")
MAP: Final[Spec] = Spec("map", (SAME_CELLS,), "cells", "no layers that are made of the world alone")
LOCAL: Final[Spec] = Spec("local maps", (SAME_CELLS,), "cells")
HEIGHT_RAYS: Final[Spec] = Spec("heights by rays", (SAME_HEIGHTS,), "rays", f"a map without {', '.join(HEIGHTS)}")
_SQUARE: Final = 128
_CLOSE: Final = 1e-4  # [m], or share, by which another processor may round
_TEXT: Final = re.compile(r"(.+) with seed (\d+), ")
_SHAPE: Final = 2  # dimensions of a layer
_NUMBERS: Final = "biuf"  # kinds of their values
Values = Mapping[str, NDArray[Any]]


class StoredMap(NamedTuple):
    """A map of a world as a file has it: its layers over x and y, and how the world is built again."""

    grid: Grid
    layers: Values
    name: str
    seed: int
    layout: Mapping[str, Any]
    identity: str = ""
    """Of its world; empty if the file does not have it."""
    rig: Mapping[str, Any] = {}
    """Values of the rig that it depends on, if it does."""

    def rebuilt(self, path: Path) -> World:
        """Build its world again; raises ConfigurationError if that is another one now."""
        world = build.load_world(environment_of(self.name, self.layout), self.seed, self.layout)
        if self.identity and identity(world) != self.identity:
            raise ConfigurationError(f"{path} is of {self.identity}, which is built otherwise now: {identity(world)}")
        return world


def is_map(path: Path) -> bool:
    """Return whether there is a map of a world, or a folder of maps around a robot."""
    if path.is_dir():
        return (path / ABOUT).is_file()
    if path.suffix == ".bag" and path.is_file():
        try:
            with open_bag(path) as bag:
                return NAMES_TOPIC in bag.counts
        except BagError:
            return False
    return path.suffix == ".npz" and path.is_file()


def maps_in(path: Path) -> list[Path]:
    """Return the folders of maps around the robot that are in the folder of a run."""
    return sorted(each for each in path.glob(f"*{SUFFIX}") if is_map(each)) if path.is_dir() else []


def costs_in(path: Path) -> list[Path]:
    """Return the map of costs that is in a folder of maps around a robot."""
    return [path / FILE] * (path / FILE).is_file()


def validate_map(path: Path | str, *, workers: int | None = None, progress: Progress | None = None) -> list[Check]:
    """Check a map that ``fieldtruth map`` wrote, or maps around the robot, which are in the folder of their run.

    Costs in maps around the robot are those of ``costs.npz`` beside them, for which there is ``validate_cost_map``.

    Args:
        path: an NPZ file, a folder of GeoTIFFs, a bag of a grid map, or a folder of maps around a robot.
        workers: number of threads; None uses all cores. The result does not depend on it.
        progress: receives the progress.

    Raises:
        ConfigurationError: no such map, or one that does not say what its world is.
        BagError: the run of maps around a robot is missing.
        OutputError: not enough memory, or no library that reads GeoTIFFs.
    """
    path, workers, progress = Path(path), workers or cpu_count(), progress or Silent()
    if path.is_dir() and (path.name.endswith(SUFFIX) or _stamped(path)):
        return _check_local(path, open_run(path.resolve().parent), workers, progress)
    stored = read_map(path)
    with progress.stage("build the world"):
        world = stored.rebuilt(path)
    tallies, (rows, columns) = [Tally(MAP), Tally(HEIGHT_RAYS)], stored.grid.shape
    names = [name for name in stored.layers if name in LAYERS]
    check_memory(8 * rows * columns * (len(names) + 6), "the map", "take one of a part of the world")
    with progress.stage("map the world"):
        due = map_layers(world, stored.grid, names, workers)
    for name in names:
        compare(tallies[0][SAME_CELLS], name, stored.layers[name], due[name])
    with progress.stage("trace rays"):
        _trace(tallies[1][SAME_HEIGHTS], world, stored.grid, stored.layers)
    return [tally.result() for tally in tallies]


def _check_local(folder: Path, run: Run, workers: int, progress: Progress) -> list[Check]:
    """Make all maps around the robot again, with the map of costs that is beside them and has a check of its own."""
    try:
        about = yaml.safe_load((folder / ABOUT).read_text(encoding="utf-8"))
        side, resolution = float(about["side"]), float(about["resolution"])
        names, has_costs = [str(name) for name in about["layers"]], "cost" in about
    except (*DAMAGED, yaml.YAMLError) as error:
        raise ConfigurationError(f"{folder / ABOUT} does not describe maps around a robot") from error
    cost = next(iter(costs_in(folder)), None)
    unknown = cost is None and (has_costs or any(name not in LAYERS and name not in OWN for name in names))
    if unknown:
        names = [name for name in names if name in LAYERS or (name in OWN and name != "free")]
    given: dict[str, Any] = {"side": side, "resolution": resolution, "layers": names, "cost": cost}
    maps = LocalMaps(run, **given, workers=workers, progress=progress)
    tally, rays, world = Tally(LOCAL), Tally(HEIGHT_RAYS), local_maps.world_of_run(run)
    stamps, found = maps.stamps_ns.tolist(), _stamped(folder)
    if has_costs and cost is None:
        tally[SAME_CELLS].add(1, 1, f"{FILE}, which is missing")
    if cost is not None and (robot := read_map(cost).rig.get("robot")) != run.rig.robot.model_dump(mode="json"):
        tally[SAME_CELLS].add(1, 1, f"{FILE}, which is of {'another' if robot else 'no'} robot")
    for path in sorted(path for stamp, path in found.items() if stamp not in stamps):
        tally[SAME_CELLS].add(1, 1, f"{path.name}, at whose stamp there is no frame")
    for stamp in stamps:
        path, made = folder / f"{stamp}.npz", maps.at(stamp)
        try:
            stored = _arrays(path)
        except DAMAGED:
            what = "is damaged" if path.exists() else "is missing"
            tally[SAME_CELLS].add(1, 1, f"{path.name}, which {what}")
            continue
        due: dict[str, NDArray[Any]] = {**made.layers, "world_from_base": made.world_from_base}
        if not unknown:
            due |= {"free_distance": made.free_distance, "free_polygon": made.free_polygon}
        for name, values in due.items():
            compare(tally[SAME_CELLS], f"{path.name}, {name}", stored.get(name), values)
        _trace(rays[SAME_HEIGHTS], world, made.grid, stored, RAYS // 8)
    tally.note = f"not costs and what follows from them, without {FILE}" * unknown
    return [tally.result(), rays.result()]


def _stamped(folder: Path) -> dict[int, Path]:
    """Return the files of a folder that are named as maps around a robot, by their stamps [ns]."""
    return {int(path.stem): path for path in folder.glob("*.npz") if path.stem.isdecimal()}


def compare(count: Count, where: str, values: NDArray[Any] | None, due: NDArray[Any]) -> None:
    """Count the cells of a layer."""
    if values is None or values.dtype.kind not in _NUMBERS or values.shape != due.shape:
        found_as = "missing" if values is None else f"{values.dtype} {values.shape}"
        count.add(due.size, due.size, f"{where}, which is {found_as}, expected {due.dtype} {due.shape}")
        return
    with np.errstate(invalid="ignore"):
        same: Mask = np.isclose(values, due, _CLOSE, _CLOSE, equal_nan=True) if due.dtype.kind == "f" else values == due
    found, expected = values.ravel(), due.ravel()
    count.see_all(
        np.asarray(same).ravel(),
        lambda k: f"{where}, cell {np.unravel_index(k, due.shape)!s}: {found[k]:g}, expected {expected[k]:g}",
    )


def _trace(count: Count, world: World, grid: Grid, layers: Values, rays: int = RAYS) -> None:
    """Compare heights in a square of cells with vertical rays, if the map has all that it takes."""
    needed = [*HEIGHTS, *(f"{name}_class" for name in HEIGHTS), *(f"{name}_instance" for name in HEIGHTS[1:])]
    if not {*needed} <= layers.keys():
        return
    if any(layers[name].dtype.kind not in _NUMBERS or layers[name].shape != grid.shape for name in needed):
        return  # which the other check says
    rng = np.random.default_rng(zlib.crc32(np.ascontiguousarray(layers["ground"]).tobytes()[:4096]))
    start = [int(rng.integers(max(1, n - _SQUARE + 1))) for n in grid.shape]
    square = tuple(slice(a, a + _SQUARE) for a in start)
    known = np.argwhere(np.isfinite(layers["ground"][square]))
    cells: Index = known[rng.permutation(len(known))[:rays]] + start
    if len(cells):
        for name, (_, wrong) in wrong_heights(world, grid, {key: layers[key] for key in needed}, cells).items():
            count.add(len(wrong), int(wrong.sum()), f"layer {name} near cell {tuple(cells[0].tolist())}")


def read_map(path: Path) -> StoredMap:
    """Read a map of a world; raises ConfigurationError."""
    try:
        return _READERS["" if path.is_dir() else path.suffix](path)
    except (*DAMAGED, yaml.YAMLError) as error:
        text = "is no map that says what its world is; `fieldtruth map` writes them as geotiff, grid_map and npz"
        raise ConfigurationError(f"{path} {text}") from error


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def _read_npz(path: Path) -> StoredMap:
    found = _arrays(path)
    shape = next(values.shape for values in found.values() if values.ndim == _SHAPE)
    x0, y0, resolution = (float(found[key]) for key in ("x0", "y0", "resolution"))
    grid = Grid(x0, y0, resolution, (int(shape[0]), int(shape[1])))
    named = _TEXT.match(text := str(found["world"]))
    layout = dict(json.loads(str(found.get("layout", "{}"))))
    layers = {name: values for name, values in found.items() if name in LAYERS or values.shape == shape}
    rig = dict(json.loads(str(found.get("rig", "{}"))))
    return StoredMap(grid, layers, named[1], int(named[2]), layout, text, rig)  # type: ignore[index]


def _of_about(about: Mapping[str, Any], layers: Callable[[Grid], Iterator[tuple[str, NDArray[Any]]]]) -> StoredMap:
    grid, world = about["grid"], about["world"]
    made = Grid(grid["x0"], grid["y0"], grid["resolution"], (grid["shape"][0], grid["shape"][1]))
    found = {n: values.astype(LAYERS[n].dtype) if n in LAYERS else values for n, values in layers(made)}
    layout, rig = dict(world.get("layout", {})), dict(about.get("rig", {}))
    return StoredMap(made, found, str(world["name"]), int(world["seed"]), layout, rig=rig)


def _read_folder(path: Path) -> StoredMap:
    def layers(grid: Grid) -> Iterator[tuple[str, NDArray[Any]]]:
        check_library("geotiff")
        import rasterio

        for each in sorted(path.glob("*.tif")):
            with rasterio.open(each) as file:
                yield each.stem, file.read(1)[::-1, ::-1]

    return _of_about(yaml.safe_load((path / ABOUT).read_text(encoding="utf-8")), layers)


def _read_bag(path: Path) -> StoredMap:
    with open_bag(path) as bag:
        found: dict[str, Any] = {
            raw.topic: bag.types().deserialize_ros1(raw.data, raw.msgtype) for raw in bag.messages()
        }

    def layers(grid: Grid) -> Iterator[tuple[str, NDArray[Any]]]:
        for name, matrix in zip(found[TOPIC].layers, found[TOPIC].data, strict=True):
            yield name, matrix.data.reshape(grid.shape[::-1]).T[::-1, ::-1]

    return _of_about(yaml.safe_load(found[NAMES_TOPIC].data), layers)


_READERS: Final = {".npz": _read_npz, "": _read_folder, ".bag": _read_bag}

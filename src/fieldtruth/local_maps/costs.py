# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files of ``fieldtruth cost``, read back for maps around a robot: a cell takes the cost of the cell it is in."""

import zipfile
import zlib
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.model import World
from fieldtruth.world_maps.files import identity
from fieldtruth.world_maps.layers import Grid, Layer, Layers

FILE: Final = "costs.npz"
"""Copy of the map of costs in a folder of maps around a robot."""
DAMAGED: Final = (LookupError, TypeError, ValueError, OSError, EOFError, StopIteration, zipfile.BadZipFile, zlib.error)
"""Errors of readers of damaged maps."""
_SHAPE: Final = 2  # dimensions of a layer
_UNITS = {"tilt": "rad", "peak": "m/s2", "rms": "m/s2", "energy": "J/m", "time": "s/m"}


class CostMap(NamedTuple):
    """Costs of driving over the cells of a grid."""

    grid: Grid
    layers: Layers
    """By names as slip_v1, and slip_v1_h045 at a heading."""
    path: Path
    world: str
    """See ``identity``."""

    @property
    def rows(self) -> dict[str, Layer]:
        """What the layers without a heading are."""
        names = [name for name in self.layers if "_h" not in name]
        texts = {name: f"{name.split('_')[0]} of the map of costs, speed in the name" for name in names}
        return {n: Layer(_UNITS.get(n.split("_")[0], ""), str(self.layers[n].dtype), texts[n]) for n in names}

    def covers(self, x: Array, y: Array) -> Mask:
        """Return whether points at x (n,) and y (m,) [m] are on the map, (n, m)."""
        i, j = self._cells(x, y)
        inside: Mask = np.logical_and.outer((i >= 0) & (i < self.grid.shape[0]), (j >= 0) & (j < self.grid.shape[1]))
        return inside

    def at(self, name: str, x: Array, y: Array) -> NDArray[Any]:
        """Return a layer at x (n,) and y (m,) [m], (n, m); NaN or 0 beyond the map."""
        values, (i, j) = self.layers[name], self._cells(x, y)
        found = values[np.clip(i, 0, self.grid.shape[0] - 1)[:, None], np.clip(j, 0, self.grid.shape[1] - 1)]
        none = np.nan if values.dtype.kind == "f" else 0
        return np.where(self.covers(x, y), found, none).astype(values.dtype)

    def check_world(self, world: World) -> None:
        """Raise ConfigurationError if it is a map of another world."""
        if self.world != (own := identity(world)):
            raise ConfigurationError(f"{self.path} is of another world: {self.world}, and the run is in {own}")

    def _cells(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        x0, y0, resolution, _ = self.grid
        i, j = (np.floor((v - v0) / resolution).astype(np.int64) for v, v0 in ((x, x0), (y, y0)))
        return i, j


def read_costs(path: Path) -> CostMap:
    """Read a map of costs.

    Raises:
        ConfigurationError: the file is missing or no map of costs.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            found = dict(file)
    except FileNotFoundError as error:
        raise ConfigurationError(f"{path} does not exist; `fieldtruth cost EXPERIMENT --to npz` makes it") from error
    except DAMAGED as error:
        raise ConfigurationError(f"{path} is no NPZ file; `fieldtruth cost EXPERIMENT --to npz` makes one") from error
    try:
        passes = next(values for name, values in found.items() if name.startswith("passes_v") and values.ndim == _SHAPE)
        x0, y0, resolution = (float(found[key]) for key in ("x0", "y0", "resolution"))
        if not (resolution > 0.0 and np.isfinite([x0, y0, resolution]).all() and "world" in found):
            raise ValueError("no grid, or no world")
    except DAMAGED as error:
        text = "is no map of costs that names its world; `fieldtruth cost EXPERIMENT --to npz` makes one"
        raise ConfigurationError(f"{path} {text}") from error
    grid = Grid(x0, y0, resolution, (int(passes.shape[0]), int(passes.shape[1])))
    layers = {name: values for name, values in found.items() if values.shape == passes.shape}
    return CostMap(grid, layers, path, str(found["world"]))

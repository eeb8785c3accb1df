# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export the world of a run as a sparse grid of voxels with classes: one NPZ file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.bag.run import Run
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.errors import OutputError
from fieldtruth.exporters import Options
from fieldtruth.exporters.amodal import world_of_run
from fieldtruth.exporters.voxels import lattice_of, voxels_of

LEAST_M: Final = 0.01
MOST_M: Final = 10.0
_MOST_CELLS: Final = 1 << 16


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the file: ``coords`` (n, 3) uint16, ``label`` (n,) uint8, ``origin``, ``voxel_m``, ``shape``, ``names``.

    Raises:
        BagError: the world of the run is not known.
        OutputError: a voxel that is too small or too large.
    """
    if not LEAST_M <= options.voxel_m <= MOST_M:
        raise OutputError(f"voxel must be between {LEAST_M} and {MOST_M} m, got {options.voxel_m:g}")
    (run,) = runs
    with options.progress.stage("build the world"):
        world = world_of_run(run)
    lattice = lattice_of(world, options.voxel_m)
    if max(lattice.shape) > _MOST_CELLS:
        raise OutputError(f"voxel must be so large that {_MOST_CELLS} span the world, got {options.voxel_m:g}")
    parts, before = [], 0.0
    with options.progress.stage("voxels", 1.0) as advance:
        for done, voxels in voxels_of(world, lattice):
            parts.append(voxels)
            advance(done - before)
            before = done
    coords, label = (np.concatenate(each) for each in zip(*parts, strict=True))
    target.parent.mkdir(parents=True, exist_ok=True)
    size = f"{len(label):,} voxels, {(coords.nbytes + label.nbytes) / 1e6:.0f} MB in memory"
    with options.progress.stage(f"compress {size}"), target.open("wb") as file:
        np.savez_compressed(
            file,
            coords=coords,
            label=label,
            origin=lattice.origin,
            voxel_m=np.float64(options.voxel_m),
            shape=np.array(lattice.shape, np.int64),
            names=np.array([row.name for row in CLASSES]),
        )

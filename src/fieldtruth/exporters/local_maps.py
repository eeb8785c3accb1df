# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export the maps around the robot: an NPZ file for each cloud, and what the layers are in ``map.yaml``."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

from fieldtruth.bag.run import Run
from fieldtruth.exporters import Options
from fieldtruth.local_maps import LocalMaps
from fieldtruth.local_maps.costs import FILE
from fieldtruth.world_maps.files import ABOUT


def local_maps_of(run: Run, options: Options) -> LocalMaps | None:
    """Make the maps of a run of a data set, if it is to have maps: if an option of maps is given."""
    given = options.maps.given()
    return LocalMaps(run, **given, workers=options.workers, progress=options.progress) if given else None


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: ``STAMP.npz`` for each frame, ``map.yaml``, and the map of costs if there is one.

    Each has the layers (n, n) over x and y of the world, ``x0``, ``y0``, ``resolution``, ``stamp_ns``,
    ``world_from_base`` (4, 4), ``free_distance`` (360,) and ``free_polygon`` (360, 2).

    Raises:
        BagError, UnknownNameError, ConfigurationError: as ``LocalMaps``.
    """
    (run,) = runs
    maps = LocalMaps(run, **options.maps.given(), workers=options.workers, progress=options.progress)
    target.mkdir()
    about = maps.describe()
    if options.maps.cost is not None:
        shutil.copyfile(options.maps.cost, target / FILE)  # by which ``validate`` makes the costs again
        about["cost"] = FILE
    (target / ABOUT).write_text(yaml.safe_dump(about, sort_keys=False), encoding="utf-8")

    def save(stamp_ns: int) -> None:
        np.savez_compressed(target / f"{stamp_ns}.npz", allow_pickle=False, **maps.at(stamp_ns).arrays)

    list(options.each("maps", run, maps.stamps_ns.tolist(), save))

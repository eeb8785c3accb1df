# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export the maps around the robot: an NPZ file for each cloud, and what the layers are in ``map.yaml``."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

from fieldtruth.bag.run import Run
from fieldtruth.exporters import Options
from fieldtruth.local_maps import LocalMaps
from fieldtruth.world_maps.files import ABOUT


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: ``STAMP.npz`` for each frame, and ``map.yaml``.

    Each has the layers (n, n) over x and y of the world, ``x0``, ``y0``, ``resolution``, ``stamp_ns``,
    ``world_from_base`` (4, 4), ``free_distance`` (360,) and ``free_polygon`` (360, 2).

    Raises:
        BagError, UnknownNameError, ConfigurationError: as ``LocalMaps``.
    """
    (run,) = runs
    maps = LocalMaps(run, **options.maps.given(), workers=options.workers, progress=options.progress)
    target.mkdir()
    rows = {name: {"unit": maps.rows[name].unit, "description": maps.rows[name].description} for name in maps.names}
    about = {"side": maps[0].grid.shape[0] * maps.grid.resolution, "resolution": maps.grid.resolution, "layers": rows}
    (target / ABOUT).write_text(yaml.safe_dump(about | maps.about, sort_keys=False), encoding="utf-8")

    def save(stamp_ns: int) -> None:
        made = maps.at(stamp_ns)
        grid = {"x0": made.grid.x0, "y0": made.grid.y0, "resolution": made.grid.resolution}
        np.savez_compressed(
            target / f"{stamp_ns}.npz",
            allow_pickle=False,
            **made.layers,
            **grid,
            stamp_ns=np.int64(stamp_ns),
            world_from_base=made.world_from_base,
            free_distance=made.free_distance,
            free_polygon=made.free_polygon,
        )

    list(options.each("maps", run, maps.stamps_ns.tolist(), save))

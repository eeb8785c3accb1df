# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export, for each pixel of an image with depth, what the map says of the cell below its point: free, and costs.

A pixel has a value if its point is at most 2 m above the bare ground, on the ground or on what stands on it, and within
50 m along x and y of the path.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.png import encode_png
from fieldtruth.exporters import Options
from fieldtruth.exporters.image_files import metres_npy
from fieldtruth.exporters.pixel_points import PixelPoints, views_with_depth
from fieldtruth.local_maps import SEEN_HEIGHT, LocalMaps
from fieldtruth.local_maps.costs import read_costs

_REACH = 50.0
_NONE = 255


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write ``VIEW/LAYER/STAMP.png`` with 255 for no value, of floating-point layers ``.npy`` with NaN.

    Raises:
        BagError: no view has depth, or the world of the run is not known.
        UnknownNameError, ConfigurationError: as ``LocalMaps``.
    """
    (run,) = runs
    views, given = views_with_depth(run, "image-cost"), options.maps.given()
    costs = read_costs(Path(given["cost"])).rows if "cost" in given else {}
    layers = list(dict.fromkeys(given.pop("layers", ["free", *costs])))
    if "seen" in layers:
        raise ConfigurationError("layer seen changes with time, so image-cost has no such layer; local-maps has")
    given |= {"side": 2 * _REACH, "layers": [*layers, "ground"]}
    maps = LocalMaps(run, **given, workers=options.workers, progress=options.progress)
    for view in views:
        _write_view(run, view, maps, layers, target / view.label, options)


def _write_view(run: Run, view: Source, maps: LocalMaps, layers: Sequence[str], folder: Path, options: Options) -> None:
    points, images = PixelPoints(run, view), run.readings(view.name, ["depth"])
    for name in layers:
        (folder / name).mkdir(parents=True)

    def save(row: int) -> None:
        image = images.read(row)
        xyz = points.of(image)
        for name in layers:
            suffix, data = encoded(pixel_values(maps, name, xyz))
            (folder / name / f"{image.stamp_ns}{suffix}").write_bytes(data)

    list(options.each(f"{view.label}: images", run, range(len(images)), save))


def pixel_values(maps: LocalMaps, layer: str, xyz: Array) -> NDArray[Any]:
    """Return a layer at the points (h, w, 3) [m] of pixels: of bytes 255 where the map has nothing, of others NaN."""
    flat = xyz.reshape(-1, 3)
    with np.errstate(invalid="ignore"):
        known = flat[:, 2] <= maps.sample("ground", flat) + SEEN_HEIGHT
    found = maps.sample(layer, flat)
    is_byte = found.dtype == np.uint8
    values = np.where(known, found, _NONE if is_byte else np.nan)
    return values.astype(np.uint8 if is_byte else np.float32).reshape(xyz.shape[:2])


def encoded(values: NDArray[Any]) -> tuple[str, bytes]:
    """Return the ending of a file of values (h, w), and its bytes."""
    return (".png", encode_png(values)) if values.dtype == np.uint8 else (".npy", metres_npy(values))

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Traction of the places that an image shows, as the images and the table that WayFAST's loader reads.

WayFAST (Gasparino et al. 2022) calls the shares of a wheeled robot's commanded speed and turn rate that the ground lets
through mu and nu. Its loader, https://github.com/matval/WayFAST at ce3e105, reads a table of eleven columns, of which
the first five are files: photograph, depth [mm] of 16 bits, and of 8 bits the path, mu and nu, where 255 is 1.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.geometry import Trajectory
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.png import encode_png
from fieldtruth.core.readings import Image
from fieldtruth.exporters.image_files import millimetres_png

TABLE: Final = "data.csv"
HEADER: Final = "color,depth,path,mu,nu,sensor,stamp_ns,x,y,z,heading\n"
"""Columns of the table; x, y, z [m] and heading [rad] are those of base_link in the world at the stamp."""
_ONE: Final = 255


def tractions(slip: Array, turn_slip: Array) -> Array:
    """Return mu and nu (n, 2) of places, from 0 to 1; nu is 1 where no wheel turns the robot, mu NaN without wheels."""
    return np.stack([np.clip(1.0 - slip, 0.0, 1.0), np.clip(1.0 - np.nan_to_num(turn_slip), 0.0, 1.0)], axis=1)


def write_images(traction: Array, pixel: NDArray[np.uint16], place: NDArray[np.int32], image: Image, to: Path) -> bool:
    """Write the depth as ``STAMP_depth.png`` and, with mu and nu (n, 2) of the pixels' places, path, mu and nu, too.

    Pixels (m, 2) of places without mu are not on the path. Off the path, mu and nu are the mean on it: the loader
    averages when it makes images smaller, and would mix zeros into the values at the path's edge.

    Returns:
        False, and nothing is written, if no pixel has mu.
    """
    assert image.depth is not None
    known = np.isfinite(traction[place, 0])
    u, v = pixel[known].T
    if not len(u):
        return False
    values = traction[place[known]]
    layers = np.empty((3, *image.depth.shape), np.uint8)
    layers[0], layers[1:] = 0, np.rint(_ONE * values.mean(axis=0))[:, None, None]
    layers[0, v, u], layers[1:, v, u] = _ONE, np.rint(_ONE * values.T)
    files = {"depth": millimetres_png(image.depth)} | {
        name: encode_png(layer) for name, layer in zip(("path", "mu", "nu"), layers, strict=True)
    }
    for name, data in files.items():
        (to / f"{image.stamp_ns}_{name}.png").write_bytes(data)
    return True


def row_of(line: dict[str, Any], path: Trajectory) -> str:
    """Return the row of the table for an image's line of ``frames.jsonl``."""
    stem, pose = line["file"].removesuffix(".npz"), path.world_from_base(line["stamp_ns"])
    files = [line["photo"], *(f"{stem}_{name}.png" for name in ("depth", "path", "mu", "nu"))]
    x, y, z = pose[:3, 3]
    heading = transforms.yaw_from_rotation(pose[:3, :3])
    return ",".join([*files, line["sensor"], str(line["stamp_ns"]), *(f"{e:.6f}" for e in (x, y, z, heading))]) + "\n"

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Points in the world that the pixels of a view show, by its recorded depth."""

import numpy as np

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Image
from fieldtruth.sense.lens import ray_table


def views_with_depth(run: Run, form: str) -> list[Source]:
    """Return the views of a run whose depth is recorded; BagError: it has no such view, for ``form``."""
    found = run.of(Image, "photo", "depth")
    if not found:
        raise BagError(f"{form} needs images with depth, and {run.bag} has none; `--extras depth` records it")
    return found


class PixelPoints:
    """The points of the pixels of a view; all rows of an image are taken at its stamp."""

    def __init__(self, run: Run, view: Source) -> None:
        lens = run.calibration.lens(view.name)
        self._trajectory, self._base_from_view = run.trajectory, run.calibration.base_from(view.name)
        if lens.is_pinhole:
            u, v = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
            rays = (u - lens.K[0, 2]) / lens.K[0, 0], (v - lens.K[1, 2]) / lens.K[1, 1], np.ones(u.shape)
            self._rays = np.stack(rays, axis=-1)
        else:
            table = ray_table(view.config).astype(np.float64)
            with np.errstate(invalid="ignore"):
                self._rays = table[..., :3] / table[..., 3:]

    def of(self, image: Image) -> Array:
        """Return the points (h, w, 3) [m] in the world of an image with depth; not finite in the sky."""
        assert image.depth is not None
        pose = self._trajectory.world_from_base(image.stamp_ns) @ self._base_from_view
        depth = np.where(np.isfinite(image.depth), image.depth, np.nan)
        return transforms.transform(pose, self._rays * depth[..., None])

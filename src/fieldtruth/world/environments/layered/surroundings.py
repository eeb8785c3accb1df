# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Coarser grids about a world, each with a relief of its own that begins with that of the wider one before it.

A mountain's flank gets its shape so: ridges and valleys on a wide grid, gullies that reach into the world on a finer
one. The world's relief begins with that of the last grid, and beyond the edge the land goes on as the grids have it.
"""

from collections.abc import Mapping
from typing import Annotated, Final

import numpy as np
from pydantic import Field
from scipy.interpolate import RectBivariateSpline

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.fields import Frozen, Positive
from fieldtruth.world.backdrop import Land
from fieldtruth.world.environments.layered.fields import Fields
from fieldtruth.world.environments.layered.steps import Relief, shape
from fieldtruth.world.grids import make_raster

FADES: Final = (0.55, 0.98)
"""Shares of a grid's margin between which its land becomes that of the wider one."""


class Surroundings(Frozen):
    """A grid about the world."""

    margin: Annotated[Positive, Field(le=5000)]  # [m] beyond the world's edge
    spacing: Annotated[Positive, Field(ge=0.5)]  # [m]
    relief: Mapping[str, Relief]


def shape_surroundings(fields: Fields, grids: Mapping[str, Surroundings]) -> Land | None:
    """Shape the grids in turn, and return the height [m] of the land; the last one's is ``fields.surroundings``."""
    land: Land | None = None
    for name, grid in grids.items():
        x, y = (
            np.arange(-s / 2 - grid.margin, s / 2 + grid.margin + grid.spacing / 2, grid.spacing) for s in fields.size
        )
        around = fields.about((x, y))
        start = land(*np.meshgrid(x, y, indexing="ij")) if land else np.zeros((len(x), len(y)))
        heights = shape(around, grid.relief, start, f"surroundings.{name}")
        fields.surroundings = make_raster(heights, grid.spacing, x, y)
        land = _joined(RectBivariateSpline(x, y, heights), land, fields.size, grid.margin)
    return land


def _joined(near: RectBivariateSpline, far: Land | None, size: tuple[float, float], margin: float) -> Land:
    """Land of a grid, which becomes that of a wider one towards its margin; beyond the widest its edge goes on."""
    half = np.array(size) / 2
    reach = half + margin

    def land(x: Array, y: Array) -> Array:
        inside = np.asarray(near.ev(x.clip(-reach[0], reach[0]), y.clip(-reach[1], reach[1])))
        if far is None:
            return inside
        away = np.maximum(np.abs(x) - half[0], np.abs(y) - half[1])
        share = np.clip((away / margin - FADES[0]) / (FADES[1] - FADES[0]), 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        return np.asarray(inside * (1.0 - share) + far(x, y) * share)

    return land

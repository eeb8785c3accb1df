# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Hits of rays in a world, by the second tracer of ``fieldtruth validate``: double precision, NumPy, no Embree.

It shares neither the triangulation of the terrain nor the tables of classes and objects with the sensors' scene.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.validation.tracer import TERRAIN, ReferenceTracer

NEAR: Final = 3e-5
"""Distance [m] from a triangle's edge below which single precision may fall on either side (coordinates of 64 m)."""
NEARBY: Final = 40.0
"""[m] within which most rays hit something; the others are traced again to the horizon."""
HORIZON: Final = 10_000.0  # [m]


class Expected(NamedTuple):
    """Hits that rays must have; ``doubtful`` rays graze an edge, so that either side may be right."""

    range_m: Array
    label: NDArray[np.uint8]
    instance: NDArray[np.int64]
    cosine: Array  # of the angle between ray and normal
    doubtful: Mask


def expected_hits(tracer: ReferenceTracer, origins: Array, directions: Array) -> Expected:
    """First hit of rays (n, 3) with directions of unit length."""
    count = len(origins)
    result = Expected(
        np.zeros(count),
        np.full(count, int(Label.SKY), np.uint8),
        np.zeros(count, np.int64),
        np.ones(count),
        np.zeros(count, np.bool_),
    )
    _trace(tracer, origins, directions, np.arange(count), NEARBY, result)
    open_rays = np.flatnonzero((result.range_m == 0.0) | (result.range_m > NEARBY - 1.0))
    _trace(tracer, origins, directions, open_rays, HORIZON, result)
    return result


def _trace(
    tracer: ReferenceTracer, origins: Array, directions: Array, rays: NDArray[np.intp], limit: float, result: Expected
) -> None:
    """Write the first hit within a limit [m] of some rays."""
    hits = tracer.hits(origins[rays], directions[rays], np.full(len(rays), limit))
    terrain = tracer.world.terrain
    x, y, _ = (origins[rays][hits.ray] + hits.range_m[:, None] * directions[rays][hits.ray]).T
    label = np.where(hits.label == TERRAIN, terrain.label_at(x, y), hits.label)
    near_edge = (label <= Label.TRAIL) & (np.abs(terrain.trail_distance.at(x, y)) < NEAR / hits.cosine)
    near_edge |= np.abs(hits.margin) < NEAR / hits.cosine
    bounds = np.searchsorted(hits.ray, np.arange(len(rays) + 1))
    for k, ray in enumerate(rays):
        own = np.arange(bounds[k], bounds[k + 1])
        met = own[hits.margin[own] > 0][:1]
        for row in met:
            result.range_m[ray], result.label[ray] = hits.range_m[row], label[row]
            result.instance[ray], result.cosine[ray] = hits.instance[row], hits.cosine[row]
        up_to = own[: met[0] - bounds[k] + 1] if len(met) else own
        touching = own[np.abs(hits.range_m[own] - result.range_m[ray]) < NEAR / hits.cosine[own]]
        pairs = set(zip(label[touching], hits.instance[touching], strict=True))
        result.doubtful[ray] = near_edge[up_to].any() or len(pairs) > 1

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Any number of rays from anywhere: what they hit, and whether anything blocks them.

Rays are packed as they come, without a pose each; blocks of them are traced side by side by threads.
"""

from collections.abc import Callable
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.kernels.cast import FIRST, OBJECT, Bundle, CastTable, Hits, block_rays, trace_rays
from fieldtruth.kernels.packets import MISS, SOLID, THIN, Grid, HitTable, Packet, aligned, new_packet
from fieldtruth.world.model import Mesh, World

BLOCK: Final = 1 << 16
"""Rays that a thread traces at once."""


def cast_table(world: World, meshes: list[Mesh], poses: list[NDArray[np.float64]], hits: HitTable) -> CastTable:
    """Return what hits are looked up in; ``poses`` (4, 4) are those of the top-level geometries of ``hits``."""
    rows = {name: row for row, name in enumerate(world.materials)}
    faces = [np.array([rows[n] for n in m.materials], np.int16)[m.material] for m in meshes]
    terrain = world.terrain
    names = (*terrain.ground_materials, terrain.trail_material, terrain.border_material)
    cover = np.ascontiguousarray(terrain.cover.values, np.float32)
    tops = aligned(16 * len(poses)).reshape(-1, 16)
    tops[:, :9] = np.array([pose[:3, :3].ravel() for pose in poses])
    words = tops.view(np.uint32)
    words[:, OBJECT] = hits.top_object
    words[:, FIRST] = np.array([*hits.mesh_face, 0])[hits.top_mesh]  # the terrain's row is -1
    return CastTable(
        tops=tops,
        words=words,
        face_material=np.concatenate([*faces, np.zeros(1, np.int16)]),
        label=np.array([int(material.label) for material in world.materials.values()], np.uint8),
        cover=cover,
        ground=np.array([rows[name] for name in names], np.int16),
        grid=Grid(cover[..., 0], terrain.cover.x0, terrain.cover.y0, 1.0 / terrain.cover.spacing),
        border_width=terrain.border_width,
    )


def cast(scene: np.uint64, hits: HitTable, table: CastTable, bundle: Bundle, workers: int | None) -> Hits:
    """Trace rays with ``workers`` threads, by default one per core; see ``Scene.cast``."""
    count = _count(bundle)
    out = Hits(
        np.empty(count, np.float32),
        np.empty((count, 3), bundle.origins.dtype),
        np.empty((count, 3), np.float32),
        np.empty(count, np.uint8),
        np.empty(count, np.uint32),
        np.empty(count, np.int16),
    )
    _in_blocks(bundle, workers, lambda packet, span: int(trace_rays(scene, hits, table, packet, bundle, span, out)))
    return out


def occluded(scene: np.uint64, bundle: Bundle, workers: int | None) -> NDArray[np.bool_]:
    """Whether anything blocks each ray (n,); see ``Scene.occluded``."""
    out = np.empty(_count(bundle), np.bool_)
    _in_blocks(bundle, workers, lambda packet, span: int(block_rays(scene, packet, bundle, span, out)))
    return out


def bundle_of(
    origins: ArrayLike, ahead: ArrayLike, kind: Literal["directions", "targets"], near: float, far: float, water: bool
) -> Bundle:
    """Check the shapes of rays, and bring origins and directions, or targets, to one type of numbers.

    Raises:
        ValueError: shapes that do not fit, or limits that are no range.
    """
    given = {"origins": np.asarray(origins), kind: np.asarray(ahead)}
    single = all(array.dtype == np.float32 for array in given.values())
    for name, array in given.items():
        if array.ndim not in (1, 2) or array.shape[-1] != 3:
            raise ValueError(f"{name} must have the shape (n, 3) or (3,), got {array.shape}")
    kind_of_number: Any = np.float32 if single else np.float64
    starts, ends = (np.ascontiguousarray(np.atleast_2d(array), kind_of_number) for array in given.values())
    if given["origins"].ndim == given[kind].ndim == 2 and len(starts) != len(ends):
        raise ValueError(f"origins and {kind} must be equally many, got {len(starts)} and {len(ends)}")
    if not 0.0 <= near <= far:
        raise ValueError(f"min_range must be at least 0 and at most max_range, got {near} and {far}")
    steps = [int(array.ndim == 2) for array in given.values()]
    mask = MISS if water else SOLID | THIN
    return Bundle(starts, steps[0], ends, steps[1], kind == "targets", float(near), float(far), mask)


def _count(bundle: Bundle) -> int:
    """Return the number of rays."""
    starts, ends = len(bundle.origins), len(bundle.ahead)
    return ends if bundle.ahead_step else starts


def _in_blocks(bundle: Bundle, workers: int | None, work: Callable[[Packet, tuple[int, int]], int]) -> None:
    """Trace blocks of rays, each from a first to a last row.

    Raises:
        ValueError: ``work`` returned the row of an invalid ray, instead of -1.
    """
    count = _count(bundle)
    spans = [(first, min(first + BLOCK, count)) for first in range(0, count, BLOCK)]
    threads = min(workers or cpu_count(), len(spans))

    def trace(span: tuple[int, int]) -> int:
        return work(new_packet(coherent=False), span)

    for bad in in_order(spans, trace, threads) if threads > 1 else map(trace, spans):
        if bad >= 0:
            raise ValueError(_problem(bundle, bad, count))


def _problem(bundle: Bundle, row: int, count: int) -> str:
    """State what is wrong with a ray."""
    where = f"; row {row} is" if count > 1 else ", got" if bundle.targets else ""
    origin, ahead = bundle.origins[row * bundle.origin_step], bundle.ahead[row * bundle.ahead_step]
    with np.errstate(over="ignore"):
        if not np.isfinite(origin.astype(np.float32)).all():
            return f"origins must be finite{where or ', got'} {origin.tolist()}"
    if bundle.targets:
        return f"targets must be finite{where} {ahead.tolist()}"
    return "directions must be finite and longer than 0" + (f"{where} {ahead.tolist()}" if where else "")

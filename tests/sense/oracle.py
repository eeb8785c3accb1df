# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An independent ray tracer in double precision, on trimesh's plane and triangle arithmetic.

Every triangle whose bounding sphere a ray hits is tested; it shares no hierarchy and no library with the sensors.
"""

from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from trimesh.intersections import planes_lines
from trimesh.triangles import points_to_barycentric

from fieldtruth.core.classes import Label
from fieldtruth.world.model import Heightfield, Mesh, World

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

NEAR: Final = 3e-5
"""Distance [m] from a triangle's border below which single precision may err (coordinates of 64 m)."""
_PAIRS: Final = 4_000_000  # of triangles and rays, tested at once


class Piece(NamedTuple):
    """Triangles (t, 3, 3) [m] in their own frame, classes (t,) (0: as the terrain), instance id and pose."""

    corners: F8
    label: NDArray[np.uint8]
    object_id: int
    pose: F8


class Verdict(NamedTuple):
    """Expected hit of each ray; ``doubtful`` rays graze a border, so that either side is right."""

    range_m: F8
    label: NDArray[np.uint8]
    instance: I8
    cosine: F8  # of the angle between ray and normal
    doubtful: NDArray[np.bool_]


def ground(heightfield: Heightfield) -> F8:
    """Triangles of a heightfield as its docstring has them: cells divided from (i, j) to (i + 1, j + 1)."""
    h = heightfield.heights.astype(np.float64)
    i, j = np.meshgrid(*(np.arange(n - 1) for n in h.shape), indexing="ij")

    def node(di: int, dj: int) -> F8:
        x = heightfield.x0 + heightfield.spacing * (i + di)
        y = heightfield.y0 + heightfield.spacing * (j + dj)
        return np.stack([x, y, h[i + di, j + dj]], axis=-1)

    lower = np.stack([node(0, 0), node(1, 0), node(1, 1)], axis=-2)
    upper = np.stack([node(0, 0), node(1, 1), node(0, 1)], axis=-2)
    return np.stack([lower, upper], axis=2)  # (nx - 1, ny - 1, 2, 3, 3)


def pieces(world: World, block: int = 50) -> list[Piece]:
    """All triangles of a world; the ground in blocks, so that far ones are skipped."""
    cells = ground(world.terrain.field)
    found = [
        Piece(c.reshape(-1, 3, 3), np.zeros(c[..., 0, 0].size, np.uint8), 1, np.eye(4))
        for strip in np.array_split(cells, max(1, cells.shape[0] // block))
        for c in np.array_split(strip, max(1, cells.shape[1] // block), axis=1)
    ]
    if world.backdrop is not None:
        found.append(_piece(world, world.backdrop, 1, np.eye(4)))
    found += [_piece(world, world.meshes[i.mesh], i.object_id, i.world_from_object) for i in world.instances]
    for swarm in world.swarms:
        own = [_piece(world, world.meshes[name], swarm.object_id, np.eye(4)) for name in swarm.meshes]
        found += [own[row]._replace(pose=pose) for row, pose in zip(swarm.mesh, swarm.world_from_object, strict=True)]
    return found


def _piece(world: World, mesh: Mesh, object_id: int, pose: F8) -> Piece:
    label = np.array([int(world.materials[name].label) for name in mesh.materials], np.uint8)[mesh.material]
    return Piece(mesh.vertices.astype(np.float64)[mesh.faces], label, object_id, pose)


@dataclass
class _Hits:
    """Every triangle that a ray hits or narrowly misses."""

    ray: list[I8] = field(default_factory=list)
    reach: list[F8] = field(default_factory=list)
    margin: list[F8] = field(default_factory=list)  # [m] inside the triangle; below 0 outside
    cosine: list[F8] = field(default_factory=list)
    label: list[NDArray[np.uint8]] = field(default_factory=list)
    instance: list[I8] = field(default_factory=list)


def judge(world: World, origins: F8, directions: F8) -> Verdict:
    """Trace rays (n, 3), directions of unit length, through a world."""
    hits = _Hits()
    for piece in pieces(world):
        _try_piece(piece, origins, directions, hits)
    ray, reach, margin, cosine, label, instance = (
        np.concatenate(getattr(hits, name)) for name in ("ray", "reach", "margin", "cosine", "label", "instance")
    )
    x, y, _ = (origins[ray] + reach[:, None] * directions[ray]).T
    label = np.where(label == 0, world.terrain.label_at(x, y), label)
    near_edge = (label <= Label.TRAIL) & (np.abs(world.terrain.trail_distance.at(x, y)) < NEAR / cosine)
    count = len(origins)
    verdict = Verdict(
        np.zeros(count), np.full(count, int(Label.SKY), np.uint8), np.zeros(count, np.int64), np.ones(count),
        np.zeros(count, np.bool_),
    )  # fmt: skip
    order = np.lexsort((reach, ray))
    starts = np.searchsorted(ray[order], np.arange(count + 1))
    for k in range(count):
        for row in order[starts[k] : starts[k + 1]]:
            verdict.doubtful[k] |= np.abs(margin[row]) < NEAR / cosine[row] or bool(near_edge[row])
            if margin[row] > 0:
                verdict.range_m[k], verdict.label[k], verdict.instance[k] = reach[row], label[row], instance[row]
                verdict.cosine[k] = cosine[row]
                break
        later = order[starts[k] : starts[k + 1]]
        touching = np.abs(reach[later] - verdict.range_m[k]) < NEAR / cosine[later]
        verdict.doubtful[k] |= len(set(zip(label[later][touching], instance[later][touching], strict=True))) > 1
    return verdict


def _try_piece(piece: Piece, origins: F8, directions: F8, hits: _Hits) -> None:
    inverse = np.linalg.inv(piece.pose)
    start, ahead = origins @ inverse[:3, :3].T + inverse[:3, 3], directions @ inverse[:3, :3].T
    length = np.linalg.norm(ahead, axis=1)  # of 1 m in the piece's own frame
    unit = ahead / length[:, None]
    low, high = piece.corners.min(axis=1), piece.corners.max(axis=1)
    centre, radius = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2
    everywhere, all_rays = (high.max(axis=0) - low.min(axis=0)) / 2, np.arange(len(start))
    middle = (high.max(axis=0) + low.min(axis=0)) / 2
    near = all_rays[_near(middle, np.linalg.norm(everywhere), start, unit)]
    # Triangles in cells of a grid: first the spheres about whole cells, then those about their triangles.
    cell = np.floor((centre - middle) / (np.linalg.norm(everywhere) / 16)).astype(int) @ [1, 100, 10_000]
    order = np.argsort(cell, kind="stable")
    _, firsts, counts = np.unique(cell[order], return_index=True, return_counts=True)
    cell_low = np.minimum.reduceat(low[order], firsts)
    cell_high = np.maximum.reduceat(high[order], firsts)
    cell_middle, cell_radius = (cell_low + cell_high) / 2, np.linalg.norm(cell_high - cell_low, axis=1) / 2
    for rays in np.array_split(near, len(near) * len(centre) // _PAIRS + 1):
        met, k = np.nonzero(_near(cell_middle[:, None], cell_radius[:, None], start[rays], unit[rays]))
        total = counts[met]
        within = np.arange(total.sum()) - np.repeat(np.cumsum(total) - total, total)
        face, ray = order[np.repeat(firsts[met], total) + within], np.repeat(rays[k], total)
        here = _near(centre[face], radius[face], start[ray], unit[ray])
        _try_triangles(piece, face[here], ray[here], start, ahead, length, hits)


def _near(centre: F8, radius: F8 | np.floating, start: F8, unit: F8) -> NDArray[np.bool_]:
    """Whether rays pass through spheres, enlarged by 1 mm."""
    away = centre - start
    along = np.einsum("...i,...i", away, unit)
    return np.asarray(np.einsum("...i,...i", away, away) - along**2 < (radius + 0.001) ** 2)


def _try_triangles(piece: Piece, face: I8, ray: I8, start: F8, ahead: F8, length: F8, hits: _Hits) -> None:
    corners = piece.corners[face]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    cosine = np.abs((across * ahead[ray]).sum(axis=1)) / np.maximum(area * length[ray], 1e-300)
    keep = (area > 0) & (cosine > 2e-5)  # trimesh treats smaller cosines as parallel
    face, ray, corners, across, area, cosine = (v[keep] for v in (face, ray, corners, across, area, cosine))
    if len(face) == 0:
        return
    normal = across / area[:, None]
    point, valid = planes_lines(corners[:, 0], normal, start[ray], ahead[ray] / length[ray, None])  # type: ignore[no-untyped-call]
    assert valid.all()
    weights = points_to_barycentric(corners, point)  # type: ignore[no-untyped-call]
    opposite = np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=-1)
    scale = 1.0 / length[ray]
    margin = (weights * area[:, None] / opposite).min(axis=1) * scale  # [m] to the nearest border
    reach = ((point - start[ray]) * ahead[ray]).sum(axis=1) / length[ray] ** 2
    here = (margin > -NEAR / cosine) & (reach > 0)
    hits.ray.append(ray[here])
    hits.reach.append(reach[here])
    hits.margin.append(margin[here])
    hits.cosine.append(cosine[here])
    hits.label.append(piece.label[face[here]])
    hits.instance.append(np.full(np.count_nonzero(here), piece.object_id))

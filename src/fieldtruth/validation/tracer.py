# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A second ray tracer: double precision, NumPy, no Embree and no tree. It serves a few thousand rays, not images.

Bounding boxes of objects, then of groups of triangles, then the triangles themselves are tested by brute force. Of the
ground these are boxes about squares of cells, then about cells, whose triangles are made as they are met: a terrain of
5 cm has four million triangles, and a ray meets the boxes of a few dozen. Every triangle that a ray hits, or misses by
less than single precision resolves, is returned.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.sense.interval import STILL, Moving
from fieldtruth.sense.leaning import LEAN_KNOT_NS, WHOLE, Leaning, square
from fieldtruth.sense.limbs import faces_of_piece
from fieldtruth.validation.boxes import SKIN, blocks, meets, near_all
from fieldtruth.validation.rutted import RuttedCells
from fieldtruth.world.model import Heightfield, Mesh, World

_SIDE: Final = 16  # cells on the side of a square
_OFFSETS: Final = np.stack(np.meshgrid(np.arange(_SIDE), np.arange(_SIDE), indexing="ij"), axis=-1).reshape(-1, 2)


class Ground:
    """The triangles of a heightfield as its docstring defines them; it does not use those of the sensors' scene."""

    def __init__(self, field: Heightfield) -> None:
        self._field = field
        self._cells = np.array(field.heights.shape) - 1
        starts = [np.arange(0, n, _SIDE) for n in self._cells]
        self._first = np.stack(np.meshgrid(*starts, indexing="ij"), axis=-1).reshape(-1, 2)
        end = np.minimum(self._first + _SIDE, self._cells)
        low, high = self._squares(np.minimum), self._squares(np.maximum)
        origin, step = np.array([field.x0, field.y0]), field.spacing
        self._low = np.column_stack([origin + step * self._first, low]) - SKIN
        self._high = np.column_stack([origin + step * end, high]) + SKIN

    @property
    def triangles(self) -> int:
        """Number of triangles in all cells."""
        return 2 * int(np.prod(self._cells))

    def near(self, start: Array, ahead: Array, limit: Array) -> Iterator[tuple[Index, Array]]:
        """Rows of rays (n, 3) up to their limits (n,), and the corners (n, 3, 3) of triangles whose box they meet."""
        near = near_all(self._low, self._high, start, ahead, limit)
        for rays in blocks(len(start), len(near)):
            ray, square = np.nonzero(
                meets(self._low[near], self._high[near], start[rays, None], ahead[rays, None], limit[rays, None])
            )
            square = near[square]
            for part in blocks(len(ray), _SIDE * _SIDE):
                row = np.repeat(ray[part] + rays.start, _SIDE * _SIDE)
                cell = (self._first[square[part], None] + _OFFSETS).reshape(-1, 2)
                inside = (cell < self._cells).all(axis=1)
                row, nodes = row[inside], self._nodes(cell[inside])
                met = meets(nodes.min(axis=1) - SKIN, nodes.max(axis=1) + SKIN, start[row], ahead[row], limit[row])
                row, nodes = row[met], nodes[met]
                yield np.concatenate([row, row]), np.concatenate([nodes[:, [0, 1, 2]], nodes[:, [0, 2, 3]]])

    def _squares(self, extreme: np.ufunc) -> Array:
        """Least or greatest height (n,) of each square's nodes, those of its far sides included."""
        h = self._field.heights
        cells = extreme(extreme(h[:-1, :-1], h[1:, :-1]), extreme(h[:-1, 1:], h[1:, 1:]))
        for axis, count in enumerate(self._cells):
            cells = extreme.reduceat(cells, np.arange(0, count, _SIDE), axis=axis)
        return np.asarray(cells.ravel(), np.float64)

    def _nodes(self, cell: NDArray[np.int64]) -> Array:
        """Corners (n, 4, 3) of cells (n, 2), anticlockwise from (i, j); a cell is divided from it to (i + 1, j + 1)."""
        ij, field = cell[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), self._field
        nodes = np.empty((len(cell), 4, 3))
        nodes[..., :2] = (field.x0, field.y0) + field.spacing * ij
        nodes[..., 2] = field.heights[ij[..., 0], ij[..., 1]]
        return nodes


TERRAIN: Final = 0
"""Label of triangles of the terrain, whose class depends on where they are hit."""
_GROUP: Final = 32  # triangles per box
_RAYS: Final = 32  # at once against all objects
_PARALLEL: Final = 2e-5
"""Cosine between ray and normal below which a triangle is seen edge-on and skipped."""


class Hits(NamedTuple):
    """Triangles that rays hit or nearly hit, ordered by ray and then by range."""

    ray: Index
    range_m: Array
    label: NDArray[np.uint8]
    instance: Index
    part: NDArray[np.uint8]
    """``PlantPart``."""
    margin: Array
    """Distance [m] to the nearest edge of the triangle, in its plane; below 0 outside."""
    cosine: Array
    """Of the angle between ray and normal."""
    front: Mask
    """True where the ray meets the side from which the corners run counterclockwise."""
    top: Index
    """Row in ``Scene.top_levels`` and 1 more."""


class _Solid(NamedTuple):
    """Triangles of a mesh in its own frame, neighbours together, with a box about each ``_GROUP`` of them."""

    corners: Array
    label: NDArray[np.uint8]
    part: NDArray[np.uint8]
    low: Array
    high: Array


class _Placed(NamedTuple):
    """All objects with the same mesh: object_from_world, ``Hits.top``, and boxes in the world."""

    inverse: Array
    top: Index
    low: Array
    high: Array


class _Leaning(NamedTuple):
    """All plants of the same mesh, or bunch of it, that lean, as they would stand without it."""

    rows: Index
    """Of ``Plants``."""
    placed: _Placed
    radius: Array
    """(2, n) [m] Greatest distance of a corner of a plant's box from its foot, and from that of its tree."""


class _Key(NamedTuple):
    """Key of what is placed many times: a mesh, or a bunch of it, that leans or not."""

    mesh: str
    bunch: int
    leans: bool


_Rays = tuple[Array, Array, Array]
"""Origins, directions (n, 3) and limits (n,)."""
STANDS: Final = -1
"""In place of a row of ``Plants``: what does not lean."""


class _Triangles(NamedTuple):
    """Corners (n, 3, 3), class, ``Hits.top`` and part (n,)."""

    corners: Array
    label: NDArray[np.uint8]
    top: Index
    part: NDArray[np.uint8]


class ReferenceTracer:
    """The triangles of a world, of bodies that move, of plants that lean, and of ruts. Threads may share it."""

    def __init__(self, world: World, moving: Moving = STILL) -> None:
        self.world, self.side, leaning = world, max(world.size), moving.leaning
        self._bodies, self._leaning = moving.bodies, leaning
        self._labels = labels = {name: int(material.label) for name, material in world.materials.items()}
        self._ground = Ground(world.terrain.surface) if world.terrain.visible else None
        self._rutted = RuttedCells(moving.ruts) if moving.ruts is not None and world.terrain.visible else None
        meshes: dict[_Key, tuple[Array, NDArray[np.uint8], NDArray[np.uint8]]] = {}
        poses: dict[_Key, list[tuple[Array, int]]] = {}
        rows: dict[_Key, list[int]] = {}
        plants, owners = _plants_by_top(leaning), [0, GROUND_ID]

        def place(mesh: Mesh, pose: Array, instance: int) -> None:
            top = len(owners) - 1
            owners.append(instance)
            for bunch, row in plants.get(top, [(WHOLE, STANDS)]):
                key = _Key(mesh.name, bunch, row != STANDS)
                if key not in meshes:
                    label = np.array([labels[material] for material in mesh.materials], np.uint8)[mesh.material]
                    own = faces_of_piece(mesh, bunch)
                    meshes[key] = mesh.vertices.astype(np.float64)[mesh.faces[own]], label[own], mesh.face_parts[own]
                poses.setdefault(key, []).append((pose, top + 1))
                rows.setdefault(key, []).append(row)

        if world.backdrop is not None:
            place(world.backdrop, np.eye(4), GROUND_ID)
        for each in world.instances:
            place(world.meshes[each.mesh], each.world_from_object, each.object_id)
        for swarm in world.swarms:
            own = [world.meshes[name] for name in swarm.meshes]
            for row, pose in zip(swarm.mesh.tolist(), swarm.world_from_object, strict=True):
                place(own[row], pose, swarm.object_id)
        self._owners = np.array([*owners, *(body.object_id for body in self._bodies)])
        self._solids = {key: _grouped(*mesh) for key, mesh in meshes.items()}
        placed = {key: _placed(self._solids[key], poses[key]) for key in meshes}
        self._placed = {key: each for key, each in placed.items() if not key.leans}
        self._leant = {key: _leant(leaning, each, rows[key]) for key, each in placed.items() if leaning and key.leans}

    @property
    def triangles(self) -> int:
        """Number of triangles in the world, those of each object counted."""
        every = [*self._placed.items(), *((key, each.placed) for key, each in self._leant.items())]
        objects = (len(self._solids[key].corners) * len(placed.top) for key, placed in every)
        return sum(objects, self._ground.triangles if self._ground is not None else 0)

    def hits(self, origins: Array, directions: Array, limit: Array, stamps_ns: Index | None = None) -> Hits:
        """Trace rays (n, 3), directions of unit length, each up to its limit (n,) [m].

        They leave at stamps (n,), by default at 0, which matter where bodies move or plants lean.
        """
        stamps = np.zeros(len(origins), np.int64) if stamps_ns is None else stamps_ns
        nothing = np.zeros(0)
        index, flags = nothing.astype(int), nothing.astype(np.bool_)
        none = nothing.astype(np.uint8)
        found = [Hits(index, nothing, none, index, none, nothing, nothing, flags, index)]
        for first in range(0, len(origins), _RAYS):
            rays = np.arange(first, min(first + _RAYS, len(origins)))
            for row, corners in self._near_ground(origins[rays], directions[rays], limit[rays], stamps[rays]):
                ray = rays[row]
                label, top = np.full(len(ray), TERRAIN, np.uint8), np.full(len(ray), TERRAIN + 1)
                triangles = _Triangles(corners, label, top, np.zeros(len(ray), np.uint8))
                found.append(_hits_on(triangles, ray, origins[ray], directions[ray], limit[ray], self.side))
            start, ahead, end = origins[rays, None], directions[rays, None], limit[rays, None]
            for key, placed in self._placed.items():
                near = near_all(placed.low, placed.high, start, ahead, end)
                ray, row = np.nonzero(meets(placed.low[near], placed.high[near], start, ahead, end))
                if len(ray):
                    own = placed.inverse[near[row]], placed.top[near[row]]
                    found += self._hits_of(key, rays[ray], *own, (origins, directions, limit))
            if self._leaning is not None:
                found += self._hits_on_plants(self._leaning, rays, stamps, (origins, directions, limit))
        for number in range(len(self._bodies)):
            found += self._hits_on_body(number, origins, directions, limit, stamps)
        hits = Hits._make(np.concatenate(parts) for parts in zip(*found, strict=True))
        hits = hits._replace(instance=self._owners[hits.top])
        order = np.lexsort((hits.range_m, hits.ray))
        return Hits._make(part[order] for part in hits)

    def _near_ground(self, start: Array, ahead: Array, limit: Array, stamps: Index) -> Iterator[tuple[Index, Array]]:
        """Rows of rays, and corners of triangles of the ground, as ``Ground.near``; rays leave at stamps (n,) [ns]."""
        for row, corners in self._ground.near(start, ahead, limit) if self._ground is not None else ():
            own = slice(None) if self._rutted is None else ~self._rutted.replaces(corners)
            yield row[own], corners[own]
        if self._rutted is not None:
            yield from self._rutted.near(start, ahead, limit, stamps)

    def _hits_on_body(
        self, number: int, origins: Array, directions: Array, limit: Array, stamps: Index
    ) -> Iterator[Hits]:
        """Yield the hits of each ray that passes near a body, which is where it is at the ray's own stamp."""
        body = self._bodies[number]
        mesh, poses = body.mesh, body.at(stamps)
        vertices = mesh.vertices.astype(np.float64)
        label = np.array([self._labels[name] for name in mesh.materials], np.uint8)[mesh.material]
        top = np.full(len(mesh.faces), len(self._owners) - len(self._bodies) + number)
        offset = poses[:, :3, 3] - origins
        along = np.clip(np.einsum("ni,ni->n", offset, directions), 0.0, limit)
        away = np.linalg.norm(offset - along[:, None] * directions, axis=1)
        for ray in np.flatnonzero(away <= np.linalg.norm(vertices, axis=1).max() + SKIN):
            corners = (vertices @ poses[ray, :3, :3].T + poses[ray, :3, 3])[mesh.faces]
            rays = np.full(len(corners), ray)
            triangles = _Triangles(corners, label, top, mesh.face_parts)
            yield _hits_on(triangles, rays, origins[rays], directions[rays], limit[rays], self.side)

    def _hits_on_plants(self, leaning: Leaning, rays: Index, stamps: Index, all_rays: _Rays) -> list[Hits]:
        """Hits of rays (n,) on plants, each of which is where it is at the ray's own stamp."""
        start, ahead, limit = (each[rays] for each in all_rays)
        instants, instant = np.unique(stamps[rays], return_inverse=True)
        begin, end = instants.min() // LEAN_KNOT_NS, -(-instants.max() // LEAN_KNOT_NS)
        leans = leaning.vectors(leaning.rows, np.arange(begin, end + 1) * LEAN_KNOT_NS)
        limb = leaning.plants.parent[leaning.rows] >= 0
        tree = np.searchsorted(leaning.rows, np.where(limb, leaning.plants.parent[leaning.rows], leaning.rows))
        turn = np.where(limb, np.linalg.norm(leans, axis=-1).max(axis=0), 0.0)
        most, sunk = np.linalg.norm(leans[..., :2], axis=-1).max(axis=0)[tree], leans[..., 2].max(axis=0)[tree]
        found = list[Hits]()
        for key, (rows, placed, radius) in self._leant.items():
            own = np.searchsorted(leaning.rows, rows)
            turned = turn[own] * radius[0]  # an arc is longer than its chord
            away = (turned + most[own] * (radius[1] + turned) + sunk[own])[:, None]
            low, high = placed.low - away, placed.high + away
            near = near_all(low, high, start[:, None], ahead[:, None], limit[:, None])
            ray, row = np.nonzero(meets(low[near], high[near], start[:, None], ahead[:, None], limit[:, None]))
            if len(ray):
                plants, own = np.unique(near[row], return_inverse=True)
                poses = square(leaning.at(rows[plants], instants))[instant[ray], own]
                inverse = np.asarray(np.linalg.inv(poses), np.float64)
                found += self._hits_of(key, rays[ray], inverse, placed.top[near[row]], all_rays)
        return found

    def _hits_of(self, key: _Key, ray: Index, inverse: Array, top: Index, rays: _Rays) -> list[Hits]:
        """Hits of pairs of ray and object, all with the same mesh; ``inverse`` (n, 4, 4) is object_from_world."""
        (origins, directions, limit), solid, found = rays, self._solids[key], []
        start = np.einsum("nij,nj->ni", inverse[:, :3, :3], origins[ray]) + inverse[:, :3, 3]
        ahead = np.einsum("nij,nj->ni", inverse[:, :3, :3], directions[ray])
        low, high = solid.low - SKIN, solid.high + SKIN
        for pairs in blocks(len(ray), len(low)):
            near = meets(low, high, start[pairs, None], ahead[pairs, None], limit[ray[pairs], None])
            pair, group = np.nonzero(near)
            pair += pairs.start
            for part in blocks(len(pair), _GROUP):
                face = group[part, None] * _GROUP + np.arange(_GROUP)
                inside = face < len(solid.corners)
                face, pair_of = face[inside], np.repeat(pair[part], inside.sum(axis=1))
                of, label, part = ray[pair_of], solid.label[face], solid.part[face]
                triangles = _Triangles(solid.corners[face], label, top[pair_of], part)
                found.append(_hits_on(triangles, of, start[pair_of], ahead[pair_of], limit[of], self.side))
        return found


def resolution(range_m: Array, side: float) -> Array:
    """Distance [m] across the ray by which single precision may displace its end, in a world of a greatest side [m].

    Coordinates of 64 m, half of 128 m, have a last digit of 8 um, larger ones one that grows with them, and are
    transformed to the frame of an object; the last digit of a direction moves the end by 1.2e-7 of the range.
    """
    return np.asarray(3e-5 * max(1.0, side / 128.0) + 2.4e-7 * range_m)


def _hits_on(triangles: _Triangles, ray: Index, start: Array, ahead: Array, limit: Array, side: float) -> Hits:
    """Hits of rays on triangles, pair by pair; rays are given in their frame, in a world of a greatest side [m]."""
    corners, label, top, part = triangles
    range_m, margin, cosine = _intersect(corners, start, ahead)
    margin /= np.linalg.norm(ahead, axis=1)  # a metre in the frame
    front, cosine = cosine < 0, np.abs(cosine)
    hit = (range_m > 0) & (range_m <= limit) & (cosine > _PARALLEL)
    hit &= margin > -resolution(range_m, side) / np.maximum(cosine, _PARALLEL)
    known = ray, range_m, label, top, part, margin, cosine, front, top  # instance ids follow when all hits are found
    return Hits._make(each[hit] for each in known)


def _grouped(corners: Array, label: NDArray[np.uint8], part: NDArray[np.uint8]) -> _Solid:
    """Sort triangles along a Morton curve, so that neighbours share a box."""
    middle = corners.mean(axis=1)
    cell = (middle - middle.min(axis=0)) / max(1e-9, float(np.ptp(middle, axis=0).max()))
    cell = (cell * 1023).astype(np.int64)
    code = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    order = np.argsort(code, kind="stable")
    corners, starts = corners[order], np.arange(0, len(corners), _GROUP)
    low, high = corners.min(axis=1), corners.max(axis=1)
    low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
    return _Solid(corners, label[order], part[order], low, high)


def _placed(solid: _Solid, poses: list[tuple[Array, int]]) -> _Placed:
    pose, top = np.array([pose for pose, _ in poses]), np.array([number for _, number in poses])
    bounds = np.stack([solid.low.min(axis=0), solid.high.max(axis=0)])
    corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i, j, k in np.ndindex(2, 2, 2)])
    moved = np.einsum("nij,cj->nci", pose[:, :3, :3], corners) + pose[:, None, :3, 3]
    inverse = np.asarray(np.linalg.inv(pose), np.float64)
    return _Placed(inverse, top, moved.min(axis=1) - SKIN, moved.max(axis=1) + SKIN)


def _plants_by_top(leaning: Leaning | None) -> dict[int, list[tuple[int, int]]]:
    """Bunch, and row of ``Plants`` or STANDS, of each plant of the top-level geometries of which any leans."""
    found: dict[int, list[tuple[int, int]]] = {}
    if leaning is not None:
        plants, leans = leaning.plants, np.isin(np.arange(len(leaning.plants.top)), leaning.rows)
        for row in np.flatnonzero(np.isin(plants.top, plants.top[leans])).tolist():
            own = int(plants.bunch[row]), row if leans[row] else STANDS
            found.setdefault(int(plants.top[row]), []).append(own)
    return found


def _leant(leaning: Leaning, placed: _Placed, rows: list[int]) -> _Leaning:
    plants, own = leaning.plants, np.array(rows)
    feet = plants.foot[[own, np.where(plants.parent[own] >= 0, plants.parent[own], own)]]
    far = np.maximum(np.abs(placed.low - feet), np.abs(placed.high - feet))
    return _Leaning(own, placed, np.linalg.norm(far, axis=-1))


def _intersect(corners: Array, start: Array, ahead: Array) -> tuple[Array, Array, Array]:
    """Intersect rays with the planes of triangles (n, 3, 3).

    Returns:
        Range in lengths of ``ahead``, distance to the nearest edge (below 0 outside), cosine to the normal,
        which is below 0 in front of it.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], -edges[:, 2])
    area = np.linalg.norm(normal, axis=1)
    towards = np.einsum("ni,ni->n", normal, ahead)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = np.einsum("ni,ni->n", normal, corners[:, 0] - start) / towards
        cosine = towards / (area * np.linalg.norm(ahead, axis=1))
        point = start + range_m[:, None] * ahead
        inwards = np.cross(normal[:, None], edges)
        inside = np.einsum("nki,nki->nk", inwards, point[:, None] - corners) / np.linalg.norm(inwards, axis=-1)
    flat = ~(area > 0)
    return np.where(flat, -1.0, range_m), np.where(flat, -np.inf, inside.min(axis=1)), np.where(flat, 0.0, cosine)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants that lean: which they are, how each turns about its foot, and where that is at a stamp.

A plant leans as a rigid body: its geometry is turned about its foot by a horizontal rotation vector (x, y) [rad], whose
norm is the angle and whose direction the axis. Lengths stay, and so do labels, texture, tint and baked light. Real
stems bend instead; a rigid turn has the right displacement of the top, and too much of it below.

The motion is defined by leans at knots, every LEAN_KNOT_NS of simulated time; between two knots the matrix of the pose
changes linearly, so that each point moves on a straight line (as in ``sense.moving``). All sensors and the second
tracer have this one motion.

A clump of grass is wide, and turned as a whole its rim would leave the soil. So a clump leans in bunches, those of its
stems that are rooted in one square of BUNCH; a bunch's foot is the middle of its roots. Anything else leans as a whole,
and so do clumps beyond the world's edge, which no robot reaches.

Groups of a tree's limbs may have rows of their own (``sense.limbs``). Such a group turns about its foot on the trunk,
and then as the trunk does.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise
from threading import Lock
from typing import Final, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fieldtruth.core.arrays import Array, Float32Array, Index
from fieldtruth.core.classes import Label
from fieldtruth.kernels.leaning import place_geometries, pose_limbs, pose_plants
from fieldtruth.sense.embree import RayScene
from fieldtruth.sense.ripples import Ripples
from fieldtruth.world.model import LOOSE, Mesh, World
from fieldtruth.world.stems import DEAD

Key = TypeVar("Key")
Value = TypeVar("Value")
LEAN_KNOT_NS: Final = 100_000_000
"""Time [ns] between two knots of plants."""
BUNCH: Final = 0.25
"""Side [m] of the squares, in the frame of a clump, whose stems lean together."""
_KEPT: Final = 8
"""Scenes, and knots, that are kept: sensors that read at the same time share them."""
_SUNK: Final = 1e-3
"""Depth [m] from which on a plant is crushed, and moved by nothing else."""
WHOLE: Final = -1
"""Number of a bunch that is the whole plant."""
_NONE: Final = -1
"""Parent of what is no limb."""
_WIDEST: Final = 0.4  # [m] between roots of stems that are one bunch
_TUFT: Final = 0.3  # [m], at most between two stems of one tuft
_GREEN: Final = frozenset({Label.TREETOP, Label.BUSH, Label.HIGH_GRASS, Label.TRUNK})


class Plants(NamedTuple):
    """Plants of a world that can lean, one row each, then groups of limbs.

    Those of one clump or tree share its row of ``Scene.top_levels``.
    """

    top: Index
    """(n,) Row of ``Scene.top_levels``, which has label, instance id, tint and baked light."""
    bunch: Index
    """(n,) Number of the bunch in its mesh, a value of ``limbs.pieces_of``; WHOLE of a plant that leans as a whole."""
    foot: Array
    """(n, 3) [m] in the world: what it turns about."""
    height: Array
    """(n,) [m] of its top above the foot; of limbs their reach from it."""
    object_id: Index
    """(n,) Instance id."""
    kind: NDArray[np.str_]
    """(n,) Kind of the object or swarm, such as ``high_grass``."""
    mesh: NDArray[np.str_]
    """(n,) Name of its mesh in ``World.meshes``, which names its species."""
    world_from_object: Array
    """(n, 4, 4) Of the whole object or clump, without any lean."""
    parent: Index
    """(n,) Row of the tree whose limbs these are; -1 of what is no limb."""
    ahead: Array
    """(n, 3) Unit vector in the world from the foot to the middle of limbs; upwards of what is no limb."""


class Lean(Protocol):
    """A cause by which plants lean, such as wind: a pure function of plant and time.

    A cause that begins again, because another drive begins, counts that in ``version``; without one it never does. One
    that ``holds`` plants, such as a hull, has there the lean [rad] at which no other cause moves them any more.
    """

    @property
    def rows(self) -> Index:
        """Rows (n,) of ``Plants`` that it moves; others stand still."""
        ...

    def __call__(self, rows: Index, knots_ns: NDArray[np.int64]) -> Array:
        """Rotation vectors (k, n, 2 or 3) [rad] about world x and y of some of its rows (n,) at knots (k,) [ns].

        Knots are multiples of LEAN_KNOT_NS. A plant that leans towards +x turns about +y. The third column of limbs is
        their turn about z; that of other plants the depth [m] by which one that is crushed sinks. So a cause that has a
        depth has no limbs, unless it holds plants: it gets no rows of limbs then, which are held with their tree.
        """
        ...


class Leaning:
    """Plants of a world and what makes them lean.

    Vectors of several causes are added. Those of the others shrink with the lean of a cause that holds the plant, to
    nothing at the lean ``holds``, or where the plant is crushed: wind does not turn what lies below a hull.
    """

    def __init__(self, plants: Plants, causes: Sequence[Lean], ripples: Ripples | None = None) -> None:
        """``ripples`` are those of the same wind."""
        self.plants, self.causes, self.ripples = plants, tuple(causes), ripples
        self._root = np.where(plants.parent == _NONE, np.arange(len(plants.parent)), plants.parent)
        self._known, self._lock = dict[tuple[int, ...], Array](), Lock()

    def with_cause(self, old: Lean, new: Lean) -> "Leaning":
        """Return the same plants with another cause in place of one."""
        return Leaning(self.plants, [new if each is old else each for each in self.causes], self.ripples)

    @cached_property
    def rows(self) -> Index:
        """Rows (n,) of the plants that any cause moves, rising; a tree moves with all its limbs."""
        moved = np.concatenate([np.zeros(0, np.intp), *(cause.rows for cause in self.causes)]).astype(np.intp)
        return np.flatnonzero(np.isin(self._root, self._root[moved]))

    def vectors(self, rows: Index, knots_ns: NDArray[np.int64]) -> Array:
        """Rotation vectors [rad] and depth [m] (k, n, 3) of plants (n,) at knots (k,) [ns]; of limbs x, y, z [rad].

        Those of all ``rows`` are kept for a while: an interval begins at the knot at which the one before has ended.
        """
        if rows is not self.rows:
            return self._summed(rows, knots_ns)
        found, version = list[Array](), self.version
        for knot in knots_ns.tolist():
            if (known := self._known.get((*version, knot))) is None:
                known = self._summed(rows, np.array([knot]))[0]
                with self._lock:
                    keep(self._known, (*version, knot), known)
            found.append(known)
        return np.array(found)

    def _summed(self, rows: Index, knots_ns: NDArray[np.int64]) -> Array:
        """Add the vectors of all causes, see ``vectors``."""
        total = np.zeros((len(knots_ns), len(rows), 3))
        for cause in sorted(self.causes, key=_holds):  # those that hold come last
            most = _holds(cause)
            trees = self._root[rows] if most > 0.0 else rows
            own = np.isin(trees, cause.rows)
            if own.any() and most > 0.0:
                tree, row = np.unique(trees[own], return_inverse=True)
                found = cause(tree, knots_ns)[:, row]
                share = np.maximum(1.0 - np.linalg.norm(found[..., :2], axis=-1) / most, 0.0)
                share *= np.maximum(1.0 - found[..., 2:].sum(axis=-1) / _SUNK, 0.0)
                total[:, own] *= share[..., None]
                found[:, trees[own] != rows[own]] = 0.0  # limbs go with their tree
                total[:, own, : found.shape[-1]] += found
            elif own.any():
                found = cause(rows[own], knots_ns)
                total[:, own, : found.shape[-1]] += found
        return total

    @property
    def version(self) -> tuple[int, ...]:
        """Number that changes when a cause begins again."""
        return tuple(getattr(cause, "version", 0) for cause in self.causes)

    def poses(self, rows: Index, knots_ns: NDArray[np.int64]) -> Array:
        """Matrices (k, n, 3, 4) world_from_object of plants (n,) at knots (k,) [ns]."""
        poses = np.empty((len(knots_ns), len(rows), 3, 4))
        matrix, foot = self.plants.world_from_object[rows], self.plants.foot[rows]
        found, limb = self.vectors(rows, knots_ns), np.flatnonzero(self.plants.parent[rows] != _NONE)
        for vectors, out in zip(found, poses, strict=True):
            pose_plants(vectors, matrix, foot, out)
        if not len(limb):
            return poses
        tree = self.plants.parent[rows[limb]]
        trees, of = np.unique(tree, return_inverse=True)
        bearing = found[:, np.searchsorted(rows, tree)] if rows is self.rows else self.vectors(trees, knots_ns)[:, of]
        turned, leant = np.empty((len(limb), 3, 4)), np.empty((len(limb), 3, 4))
        for vectors, tilts, out in zip(found, bearing, poses, strict=True):
            pose_limbs(vectors[limb], matrix[limb], foot[limb], turned)
            pose_plants(tilts, turned, self.plants.foot[tree], leant)
            out[limb] = leant
        return poses

    def at(self, rows: Index, stamps_ns: NDArray[np.int64]) -> Array:
        """Matrices (k, n, 3, 4) world_from_object of plants (n,) at stamps (k,) [ns], which need not be knots."""
        low, rest = np.divmod(np.asarray(stamps_ns, np.int64), LEAN_KNOT_NS)
        if not rest.any():
            return self.poses(rows, low * LEAN_KNOT_NS)
        knots, row = np.unique(np.concatenate([low, low + (rest > 0)]), return_inverse=True)
        poses, (begin, end) = self.poses(rows, knots * LEAN_KNOT_NS), np.split(row, 2)
        share = (rest / LEAN_KNOT_NS)[:, None, None, None]
        return np.asarray(poses[begin] + share * (poses[end] - poses[begin]))


def keep(kept: dict[Key, Value], key: Key, value: Value, *, most: int = _KEPT) -> None:
    """Put a value into a dictionary of at most so many, and forget the oldest ones."""
    while len(kept) >= most:
        del kept[next(iter(kept))]
    kept[key] = value


def _holds(cause: Lean) -> float:
    """Lean [rad] by which a cause holds plants wholly; 0 of one that does not."""
    return float(getattr(cause, "holds", 0.0))


class LeantScene(NamedTuple):
    """Plants at knots, or at one stamp, as rays meet them."""

    rays: RayScene
    axes: Float32Array
    """(k, geometries, 3, 3) Turn of each in its own frame, see ``packets.SceneRays``."""


class TracedPlants:
    """Plants that lean in the ray tracer. Threads may share it.

    A geometry is a plant, or one of its parts (``scene.parts_of``). ``parts`` gives the Embree scenes of a plant's
    mesh, or of a bunch of it; ``first`` is the number of the first geometry.
    """

    def __init__(self, leaning: Leaning, parts: Callable[[str, int], Sequence[RayScene]], first: int) -> None:
        self.leaning, self._first = leaning, first
        plants, rows = leaning.plants, leaning.rows
        names = [*zip(plants.mesh[rows].tolist(), plants.bunch[rows].tolist(), strict=True)]
        found = {name: parts(*name) for name in dict.fromkeys(names)}
        self._scenes = [scene for scenes in found.values() for scene in scenes]
        starts = np.cumsum([0, *(len(scenes) for scenes in found.values())]).tolist()
        start = dict(zip(found, starts, strict=False))
        counts = [len(found[name]) for name in names]
        self.rows: Index = rows.repeat(counts)
        """(geometries,) Row of ``Plants`` of each geometry."""
        self._which = np.array([start[name] + k for name in names for k in range(len(found[name]))], np.uint32)
        self._plant = np.arange(len(rows)).repeat(counts)
        self._own = plants.world_from_object[rows]
        self._made, self._lock = dict[tuple[int, ...], LeantScene](), Lock()

    def at(self, stamps_ns: NDArray[np.int64]) -> LeantScene:
        """Return the plants at knots (k,) [ns] that follow one another, or at one stamp."""
        key = *self.leaning.version, *stamps_ns.tolist()
        if (known := self._made.get(key)) is not None:
            return known
        poses = self.leaning.at(self.leaning.rows, stamps_ns)
        count = len(self._plant)
        columns, axes = np.empty((len(poses), count, 12), np.float32), np.empty((len(poses), count, 3, 3), np.float32)
        for step in range(len(poses)):
            place_geometries(poses[step], self._own, self._plant, columns[step], axes[step])
        rays = RayScene(self._scenes[0].engine)
        rays.add_instances(self._scenes, self._which, columns, number=self._first)
        made = LeantScene(rays.commit(), axes)
        with self._lock:
            keep(self._made, key, made)
        return made

    def moved(self, geometry: Index, stamps_ns: tuple[int, int]) -> Array:
        """Matrices (n, 4, 4) by which points of geometries (n,) move in the world from one stamp [ns] to another."""
        rows, row = np.unique(self.rows[geometry], return_inverse=True)
        begin, end = square(self.leaning.at(rows, np.array(stamps_ns)))
        return np.asarray((end @ np.linalg.inv(begin))[row])


def square(poses: Array) -> Array:
    """Matrices (..., 4, 4) of poses (..., 3, 4)."""
    last = np.broadcast_to(np.array([0.0, 0.0, 0.0, 1.0]), (*poses.shape[:-2], 1, 4))
    return np.concatenate([poses, last], axis=-2)


def plants_of(world: World) -> Plants:
    """Return the plants of a world that can lean: trees, bushes, grasses and herbs, without dead wood and litter."""
    tops, meshes, kinds, ids, poses = list[int](), list[str](), list[str](), list[int](), list[Array]()
    top = 1 + (world.backdrop is not None)
    living = {name for name, mesh in world.meshes.items() if _is_living(world, mesh)}

    def add(kind: str, mesh: str, object_id: int, pose: Array) -> None:
        nonlocal top
        if mesh in living and kind not in LOOSE:
            tops.append(top)
            meshes.append(mesh)
            kinds.append(kind)
            ids.append(object_id)
            poses.append(pose)
        top += 1

    for each in world.instances:
        add(each.kind, each.mesh, each.object_id, each.world_from_object)
    for swarm in world.swarms:
        for row, pose in zip(swarm.mesh.tolist(), swarm.world_from_object, strict=True):
            add(swarm.kind, swarm.meshes[row], swarm.object_id, pose)
    pose = np.array(poses).reshape(-1, 4, 4)
    near = np.abs(pose[:, :2, 3]) <= np.array(world.size) / 2.0
    inside: list[bool] = np.all(near, axis=1).tolist()
    feet = {
        (name, own): feet_of(world.meshes[name], whole=not own) for name, own in {*zip(meshes, inside, strict=True)}
    }
    parts = [feet[each] for each in zip(meshes, inside, strict=True)]
    row = np.arange(len(parts)).repeat([len(part) for part in parts])
    local, matrix = np.concatenate([np.zeros((0, 5)), *parts]), pose[row]
    return Plants(
        top=np.array(tops, np.intp)[row],
        bunch=local[:, 4].astype(np.intp),
        foot=np.einsum("nij,nj->ni", matrix[:, :3, :3], local[:, :3]) + matrix[:, :3, 3],
        height=local[:, 3] * np.linalg.norm(matrix[:, :3, 2], axis=1),
        object_id=np.array(ids, np.intp)[row],
        kind=np.array(kinds, np.str_)[row],
        mesh=np.array(meshes, np.str_)[row],
        world_from_object=matrix,
        parent=np.full(len(row), _NONE, np.intp),
        ahead=np.tile([0.0, 0.0, 1.0], (len(row), 1)),
    )


def _is_living(world: World, mesh: Mesh) -> bool:
    """Return whether a mesh is of a plant that grows."""
    labels = {world.materials[name].label for name in mesh.materials}
    return bool(mesh.species) and not DEAD & set(mesh.materials) and bool(_GREEN & labels)


def feet_of(mesh: Mesh, *, whole: bool = False) -> Array:
    """Foot (x, y, z), height [m] and number (n, 5) of the bunches of a mesh, in its frame; one row of a ``whole``."""
    bunch = bunches_of(mesh)
    if whole or bunch[0] == WHOLE:
        return np.array([[0.0, 0.0, 0.0, float(mesh.vertices[:, 2].max()), WHOLE]])
    found = np.zeros((int(bunch.max()) + 1, 5))
    found[:, 4] = np.arange(len(found))
    owner = np.zeros(len(mesh.vertices), np.intp)
    owner[mesh.faces.ravel()] = bunch.repeat(3)
    rooted = mesh.vertices[:, 2] < 0.0
    count = np.bincount(owner[rooted], minlength=len(found))
    for axis in range(2):
        found[:, axis] = np.bincount(owner[rooted], mesh.vertices[rooted, axis], len(found)) / np.maximum(count, 1)
    np.maximum.at(found[:, 3], owner, mesh.vertices[:, 2])
    return found[np.unique(bunch)]  # without squares in which only stems of other bunches are rooted


def bunches_of(mesh: Mesh) -> Index:
    """Bunch (f,) of each face of a mesh; WHOLE everywhere of a plant that leans as a whole.

    Stems are the connected parts of a mesh that reach into the soil. What is connected to none, such as leaves and
    flowers, follows the stems that bear it in the order of vertices (``world.plants.grasses``), and so do stems of one
    tuft: they lean together, so that nothing is torn off.
    """
    whole = np.full(len(mesh.faces), WHOLE, np.intp)
    if mesh.colliders or mesh.footprint <= 0.5 * _WIDEST:
        return whole
    count, part = _parts(mesh)
    low, first = np.full(count, np.inf), np.full(count, len(mesh.vertices))
    np.minimum.at(low, part, mesh.vertices[:, 2].astype(np.float64))
    np.minimum.at(first, part, np.arange(len(part)))
    order = np.argsort(first)
    rooted, position = low[order] < 0.0, mesh.vertices[first[order], :2].astype(np.float64)
    foot = np.zeros((count, 2))
    foot[order] = _tuft_feet(rooted, position)
    if np.ptp(foot, axis=0).max() <= _WIDEST:
        return whole
    _, bunch = np.unique(np.floor(foot / BUNCH), axis=0, return_inverse=True)
    return np.asarray(bunch.ravel()[part[mesh.faces[:, 0]]], np.intp)


def _parts(mesh: Mesh) -> tuple[int, Index]:
    """Number of connected parts of a mesh, and the part (v,) of each vertex."""
    a, b = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]]]).T
    size = len(mesh.vertices)
    count, part = connected_components(coo_array((np.ones(len(a), np.bool_), (a, b)), (size, size)), directed=False)
    return int(count), part.astype(np.intp)


def _tuft_feet(rooted: NDArray[np.bool_], position: Array) -> Array:
    """Foot (p, 2) of the tuft of each part, in the order of vertices: the mean of its roots.

    A tuft ends where a stem follows leaves, or is farther than _TUFT from the tuft's first one.
    """
    feet = np.zeros_like(position)
    starts, begin = [0], 0
    for k in range(1, len(rooted)):
        if rooted[k] and (not rooted[k - 1] or np.abs(position[k] - position[begin]).max() > _TUFT):
            starts.append(k)
            begin = k
    for start, end in pairwise([*starts, len(rooted)]):
        own = slice(start, end)
        roots = position[own][rooted[own]]
        feet[own] = roots.mean(axis=0) if len(roots) else position[start]
    return feet

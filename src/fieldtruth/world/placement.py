# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Placing objects by rules: a world builder records the space that is taken, so that nothing overlaps.

Circles on a plane are found by position: placing an object takes as long in a large world as in a small one. Swarms are
many small objects at once, spread over an area.
"""

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Float32Array, Index, Mask
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.world.grids import BUILT_IN, Line, Trail
from fieldtruth.world.model import Heightfield, Instance, Material, Mesh, Raster, Swarm


class Circles:
    """Circles (x, y, radius) [m] in the cells of a grid, so that a search visits near ones only."""

    def __init__(self, cell: float) -> None:
        self._cell = cell
        self._cells: dict[tuple[int, int], list[tuple[float, float, float]]] = {}
        self._widest = 0.0
        self.visits = 0
        """Circles that all searches looked at."""

    def add(self, x: float, y: float, radius: float = 0.0) -> None:
        """Add a circle."""
        key = int(x // self._cell), int(y // self._cell)
        self._cells.setdefault(key, []).append((float(x), float(y), float(radius)))
        self._widest = max(self._widest, float(radius))

    def about(self, x: float, y: float, radius: float) -> Iterator[tuple[float, float, float]]:
        """Yield at least all circles that overlap one about x, y [m]."""
        reach, cell = radius + self._widest, self._cell
        for i in range(int((x - reach) // cell), int((x + reach) // cell) + 1):
            for j in range(int((y - reach) // cell), int((y + reach) // cell) + 1):
                found = self._cells.get((i, j), ())
                self.visits += len(found)
                yield from found


def upright_pose(x: float, y: float, yaw: float, scale: float) -> Array:
    """Pose (4, 4) of an object at x, y [m] and height 0, turned by ``yaw`` [rad] and scaled."""
    pose: Array = upright_poses(np.array([[x, y]]), np.array([yaw]), np.array([scale]))[0]
    return pose


def upright_poses(xy: Array, yaw: Array, scale: Array) -> Array:
    """Poses (n, 4, 4) at positions (n, 2) and height 0, turned by ``yaw`` (n,) [rad] and scaled by ``scale`` (n,)."""
    poses = np.zeros((len(xy), 4, 4))
    poses[:, 0, 0] = poses[:, 1, 1] = scale * np.cos(yaw)
    poses[:, 1, 0], poses[:, 0, 1] = scale * np.sin(yaw), -scale * np.sin(yaw)
    poses[:, 2, 2], poses[:, 3, 3] = scale, 1.0
    poses[:, :2, 3] = xy
    return poses


def outside(xy: Array, circles: Array) -> Mask:
    """Mask of the positions (n, 2) that are in none of some circles (m, 3) of x, y and radius [m]."""
    off = np.ones(len(xy), np.bool_)
    if len(xy) and len(circles):
        inside = cKDTree(xy).query_ball_point(circles[:, :2], circles[:, 2])
        off[np.concatenate([np.asarray(rows, np.intp) for rows in inside])] = False
    return off


def rotations_to(up: Array) -> Array:
    """Smallest rotations (n, 3, 3) that take z to directions ``up`` (n, 3), which need not be of unit length.

    Rodrigues' formula about z x up; ``up`` must not point straight down.
    """
    x, y, z = (up / np.linalg.norm(up, axis=1, keepdims=True)).T
    share = 1.0 / (1.0 + z)
    return np.stack(
        [
            np.stack([1.0 - share * x * x, -share * x * y, x], axis=-1),
            np.stack([-share * x * y, 1.0 - share * y * y, y], axis=-1),
            np.stack([-x, -y, z], axis=-1),
        ],
        axis=1,
    )


def tilted(poses: Array, slope_x: ArrayLike, slope_y: ArrayLike, tilt: float) -> Array:
    """Rotations (n, 3, 3) of upright poses (n, 4, 4) after leaning by a share ``tilt`` of the ground's slope.

    ``slope_x``, ``slope_y`` (n,) are the ground's slopes [rise over run] along x and y.
    """
    sx, sy = (-tilt * np.atleast_1d(np.asarray(s, np.float64)) for s in (slope_x, slope_y))
    return np.asarray(rotations_to(np.column_stack([sx, sy, np.ones(len(sx))])) @ poses[:, :3, :3])


def random_tint(rng: np.random.Generator, spread: float) -> tuple[float, float, float]:
    """Colour factors near 1: brightness varies by ``spread``, each channel by a third of it."""
    bright = rng.normal(0.0, spread)
    r, g, b = np.exp(np.clip(bright + rng.normal(0.0, spread / 3, 3), -0.5, 0.5))
    return float(r), float(g), float(b)


def random_tints(rng: np.random.Generator, spread: float, count: int) -> Float32Array:
    """Colour factors (count, 3) with the distribution of ``random_tint``."""
    bright = rng.normal(0.0, spread, (count, 1)) + rng.normal(0.0, spread / 3, (count, 3))
    return np.asarray(np.exp(bright.clip(-0.5, 0.5)), np.float32)


Density = Callable[[Array], Array]
"""Share [0, 1] of the objects that are kept at positions (n, 2)."""
FarSwarm = tuple[Swarm, Sequence[Mesh]]
"""A swarm outside the world's edge, with its meshes."""


@dataclass(frozen=True, kw_only=True)
class SwarmForm:
    """Kind, density and pose of the small objects of a swarm."""

    kind: str
    per_m2: float = 1.0
    """Density before it is thinned."""
    scales: tuple[float, float] = (0.8, 1.25)
    tint: float = 0.1
    """Spread of the brightness, see ``random_tint``."""
    tilt: float = 0.0
    """Share of the ground's slope by which they lean: 0 is upright, 1 at right angles to the ground."""
    lean_deg: float = 0.0
    """Standard deviation [deg] of a random lean, inside the world only."""
    sink: float = 0.0
    """Depth [m] below the ground, times the scale."""
    clear: float = 0.0
    """Distance [m] kept from obstacles and from the corridors' centre lines, inside the world only."""
    aside: float = 0.0
    """Distance [m] kept from the corridors' centre lines by stones that a robot cannot drive over."""


@dataclass(frozen=True, kw_only=True)
class SwarmSpec(SwarmForm):
    """Many small objects to spread over an area."""

    name: str
    meshes: Sequence[Mesh]


def jittered_grid(
    span: Array, per_m2: float, rng: np.random.Generator, density: Density | None = None, keep: Density | None = None
) -> Array:
    """Positions (n, 2) about the origin, stratified so that they neither clump nor line up.

    One position is drawn uniformly in each cell of a grid over ``span`` (x, y) [m], in rows along y, then a number in
    [0, 1) for each. Positions where ``keep`` is 0 and those whose number is not below ``density`` are dropped.
    """
    cells = np.maximum(1, np.round(span * np.sqrt(per_m2))).astype(int)
    grid = np.stack(np.meshgrid(*(np.arange(c) for c in cells), indexing="ij"), axis=-1).reshape(-1, 2)
    xy = (grid + rng.random(grid.shape)) / cells * span - span / 2
    chance = rng.random(len(xy))
    if keep is not None:
        inside = keep(xy).astype(np.bool_)
        xy, chance = xy[inside], chance[inside]
    return np.asarray(xy if density is None else xy[chance < density(xy)])


def random_scales(rng: np.random.Generator, scales: tuple[float, float], count: int) -> Array:
    """Scales (count,) whose logarithm is uniform between those of the two ``scales``."""
    return np.exp(rng.uniform(np.log(scales[0]), np.log(scales[1]), count))


def make_swarm(
    name: str,
    kind: str,
    meshes: Sequence[Mesh],
    poses: Array,
    rng: np.random.Generator | None,
    *,
    tint: float = 0.1,
    rows: Index | None = None,
) -> Swarm:
    """Assemble a swarm at poses (n, 4, 4); ``assemble`` sets its instance id when all objects are known.

    Draws the mesh of each pose, unless ``rows`` (n,) names it, then the tints. Without a generator meshes are used in
    turn, untinted.
    """
    n = len(poses)
    if rows is None:
        rows = np.arange(n) % len(meshes) if rng is None else rng.integers(len(meshes), size=n)
    return Swarm(
        name=name,
        kind=kind,
        object_id=0,
        meshes=tuple(mesh.name for mesh in meshes),
        mesh=rows.astype(np.int32),
        world_from_object=poses,
        tint=np.ones((n, 3), np.float32) if rng is None else random_tints(rng, tint, n),
    )


EASES: Final = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
"""Shares of the requested spacing that are tried in turn, because random positions waste space."""
Attempt = Callable[[Array, int, bool], Instance | None]
"""Tries to add an object: (candidate, number of objects placed so far, whether the spacing is kept)."""


class CrowdedWorldError(FieldtruthError):
    """The objects of a layout do not fit into the world; the message states how many do."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ObjectGroup:
    """Objects of one kind that a builder distributes; meshes are used in turn."""

    kind: str
    meshes: Sequence[Mesh]
    count: int
    spacing: float = 0.0
    """Distance [m] between any two of the group; it eases where space is scarce."""
    scales: tuple[float, float] = (1.0, 1.0)
    tint: float = 0.0
    """Spread of the brightness, see ``random_tint``."""
    differ: float = 0.0
    """Distance [m] within which no two are copies of one mesh while another is left; all are used about equally."""

    def mesh(self, number: int) -> Mesh:
        """Mesh of the object with this number, counted from 0."""
        return self.meshes[number % len(self.meshes)]

    def check_complete(self, placed: Sequence[Instance]) -> list[Instance]:
        """Return the placed objects.

        Raises:
            CrowdedWorldError: there are fewer than ``count``.
        """
        if len(placed) < self.count:
            raise CrowdedWorldError(
                f"only {len(placed)} of {self.count} objects of kind {self.kind} fit in the world; "
                "reduce the layout's count"
            )
        return list(placed)


def place_until_count(
    count: int, candidates: Iterable[Array], attempt: Attempt, *, spacings: Sequence[float] = (0.0,)
) -> list[Instance]:
    """Try candidate positions in turn until ``count`` objects are placed (dart throwing, Cook 1986).

    For each of ``spacings`` [m] in turn, all candidates are tried in their order. ``attempt`` returns the object that
    it placed, or None; it is called for candidates too near to those already placed as well, because some attempts
    draw random numbers before that matters. This function draws none itself. It ends with the last object: no candidate
    is taken from the iterable after that. Candidates are arrays that start with x, y [m]; only a sequence can be tried
    with several spacings.

    Returns the objects, fewer than ``count`` if all candidates were tried with every spacing.
    """
    placed: list[Instance] = []
    taken = Circles(max(*spacings, 1.0))
    if count == 0:
        return placed
    for spacing in spacings:
        for candidate in candidates:
            x, y = candidate[:2].tolist()
            apart = all(hypot(a - x, b - y) >= spacing for a, b, _ in taken.about(x, y, spacing))
            instance = attempt(candidate, len(placed), apart)
            if instance is not None:
                taken.add(x, y)
                placed.append(instance)
                if len(placed) == count:
                    return placed
    return placed


def eased(spacing: float, eases: Sequence[float] = EASES) -> list[float]:
    """Spacings [m] to try in turn: shares of the requested one."""
    return [ease * spacing for ease in eases]


def _least_used(used: Sequence[tuple[float, float, int]], xy: Array, group: ObjectGroup) -> int:
    """Row of the mesh that is used least, of those that no object near xy [m] is a copy of if there are any."""
    names, (x, y) = [mesh.name for mesh in group.meshes], xy.tolist()
    counts = Counter(row for _, _, row in used)
    near = {names[row] for a, b, row in used if hypot(a - x, b - y) < group.differ}
    return min(range(len(names)), key=lambda row: (names[row] in near, counts[row], row))


@dataclasses.dataclass
class WorldBuilder:
    """A world while it is built. Each object keeps a circle of its mesh's footprint free of others."""

    field: Heightfield
    size: tuple[float, float]
    trails: Sequence[Trail]
    corridors: Sequence[Line]
    """Centre lines of the strips that stay free of obstacles, ``corridor_width`` [m] wide."""
    corridor_width: float = 2.0
    water_level: float | Raster | None = None
    meshes: dict[str, Mesh] = dataclasses.field(default_factory=dict, init=False)
    instances: list[Instance] = dataclasses.field(default_factory=list, init=False)
    swarms: list[Swarm] = dataclasses.field(default_factory=list, init=False)
    materials: dict[str, Material] = dataclasses.field(default_factory=dict, init=False)
    """Materials of own objects, which are not ours by name, and their textures."""
    textures: dict[str, NDArray[np.uint8]] = dataclasses.field(default_factory=dict, init=False)
    taken: Circles = dataclasses.field(default_factory=lambda: Circles(4.0), init=False)
    solids: list[tuple[float, float, float]] = dataclasses.field(default_factory=list, init=False)
    """Circles (x, y, radius) [m] in which nothing of a swarm grows."""
    _counts: dict[str, int] = dataclasses.field(default_factory=dict, init=False)

    def trail_distance(self, xy: Array) -> Array:
        """Distance [m], (n,), of positions (n, 2) to the nearest trail's edge; negative inside, infinite without."""
        if not self.trails:
            return np.full(len(xy), np.inf)
        return np.asarray(np.min([t.line.distance(xy) - t.width / 2.0 for t in self.trails], axis=0))

    def random_positions(self, count: int, rng: np.random.Generator) -> Array:
        """Positions (count, 2), uniform over the world."""
        return np.asarray(rng.uniform(-0.5, 0.5, (count, 2)) * self.size)

    def tries(self, count: int) -> int:
        """Number of positions to try: ``count`` in a world as large as the built-in ones, in a larger one more."""
        return round(count * max(1.0, self.size[0] * self.size[1] / (BUILT_IN[0] * BUILT_IN[1])))

    def is_free(self, xy: Sequence[float] | Array, radius: float) -> bool:
        """Return True if a circle around xy [m] is in the world, outside all corridors, and overlaps no object."""
        x, y = float(xy[0]), float(xy[1])
        length, width = self.size
        if abs(x) + radius > length / 2 - 0.5 or abs(y) + radius > width / 2 - 0.5:
            return False
        for a, b, r in self.taken.about(x, y, radius):
            if (x - a) * (x - a) + (y - b) * (y - b) < (radius + r) * (radius + r):
                return False
        least = radius + self.corridor_width / 2
        near = (line for line in self.corridors if line.may_be_within(least, x, y))
        return all(line.distance([[x, y]])[0] >= least for line in near)

    def add(
        self,
        kind: str,
        mesh: Mesh,
        world_from_object: Array,
        circles: Iterable[tuple[float, float, float]],
        *,
        tint: tuple[float, float, float] = (1.0, 1.0, 1.0),
        named: str = "",
    ) -> Instance:
        """Add a mesh at a pose (4, 4); it keeps ``circles`` (x, y, radius) [m] free of other objects.

        Its name is ``named``, by default its kind, with a number.
        """
        named = named or kind
        count = self._counts[named] = self._counts.get(named, 0) + 1
        instance = Instance(
            name=f"{named}_{count}",
            kind=kind,
            mesh=mesh.name,
            object_id=GROUND_ID + 1 + len(self.instances),
            world_from_object=world_from_object,
            tint=tint,
        )
        self.meshes.setdefault(mesh.name, mesh)
        self.instances.append(instance)
        for circle in circles:
            self.taken.add(*circle)
        scale = float(np.cbrt(np.linalg.det(world_from_object[:3, :3])))
        for collider in mesh.colliders:
            x, y = (world_from_object @ [*collider.position, 1.0])[:2]
            length, width = collider.size[:2]
            half = length if collider.shape == "cylinder" else np.hypot(length, width) / 2
            self.solids.append((float(x), float(y), float(half) * scale))
        return instance

    def add_upright(
        self,
        kind: str,
        mesh: Mesh,
        xy: Sequence[float] | Array,
        *,
        yaw: float,
        scale: float = 1.0,
        tint: tuple[float, float, float] = (1.0, 1.0, 1.0),
    ) -> Instance:
        """Add a mesh at xy [m], turned by ``yaw`` [rad], at the height of the lowest ground below its footprint."""
        x, y = xy
        radius = mesh.footprint * scale
        angles = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
        reach = min(radius, 0.9)
        ground = self.field.height_at([x, *(x + reach * np.cos(angles))], [y, *(y + reach * np.sin(angles))])
        pose = upright_pose(x, y, yaw, scale)
        pose[2, 3] = float(ground.min())
        return self.add(kind, mesh, pose, [(x, y, radius)], tint=tint)

    def scatter(
        self, group: ObjectGroup, rng: np.random.Generator, allowed: Callable[[Array], Mask], *, tries: int = 4000
    ) -> list[Instance]:
        """Scatter upright objects where ``allowed`` is true for positions (n, 2).

        Draws ``tries`` positions at first; then for each candidate a scale, and for a placed object yaw and tint.

        Raises:
            CrowdedWorldError: too few candidates are free even at half the spacing.
        """
        darts = self.random_positions(self.tries(tries), rng)
        return self.place(group, rng, darts[allowed(darts)])

    def place(
        self,
        group: ObjectGroup,
        rng: np.random.Generator,
        candidates: Array,
        *,
        eases: Sequence[float] = EASES,
        pose: Callable[[Array, float, float], Array] | None = None,
    ) -> list[Instance]:
        """Place objects at candidates (n, 2), upright or at the ``pose`` (4, 4) of a position, a yaw and a scale.

        Draws for each candidate a scale, and for a placed object tint and yaw, unless candidates (n, 3) have that.

        Raises:
            CrowdedWorldError: too few candidates are free even at the least of the eased spacings.
        """
        used: list[tuple[float, float, int]] = []

        def attempt(candidate: Array, number: int, apart: bool) -> Instance | None:
            xy, scale = candidate[:2], float(rng.uniform(*group.scales))
            if not apart:
                return None
            row = _least_used(used, xy, group) if group.differ else number % len(group.meshes)
            mesh, radius = group.meshes[row], group.meshes[row].footprint * scale
            if not self.is_free(xy, radius):
                return None
            used.append((float(xy[0]), float(xy[1]), row))
            yaw = float(candidate[2]) if len(candidate) > 2 else float(rng.uniform(0.0, 2.0 * np.pi))
            tint = random_tint(rng, group.tint)
            if pose is None:
                return self.add_upright(group.kind, mesh, xy, yaw=yaw, scale=scale, tint=tint)
            return self.add(group.kind, mesh, pose(xy, yaw, scale), [(*xy, radius)], tint=tint)

        placed = place_until_count(group.count, candidates, attempt, spacings=eased(group.spacing, eases))
        return group.check_complete(placed)

    def add_swarm(self, swarm: Swarm, meshes: Sequence[Mesh]) -> None:
        """Add a swarm with its meshes."""
        for mesh in meshes:
            self.meshes.setdefault(mesh.name, mesh)
        self.swarms.append(swarm)

    def scatter_swarm(self, spec: SwarmSpec, rng: np.random.Generator, density: Density | None = None) -> None:
        """Spread small objects over the ground as one swarm, thinned by ``density`` at positions (n, 2).

        Draws a jittered grid, scales, quarter turns (bounding boxes stay narrow), lean, meshes and tints.
        """
        self.add_swarm_at(spec, jittered_grid(np.array(self.size), spec.per_m2, rng, density), rng)

    def add_swarm_at(self, spec: SwarmSpec, xy: Array, rng: np.random.Generator) -> None:
        """Add small objects at those of positions (n, 2) that are clear; draws as ``scatter_swarm`` after the grid."""
        xy = xy[self.off_solids(xy, spec.clear)]
        beside = max(spec.clear, spec.aside)
        for line in self.corridors if beside > 0 else ():
            xy = xy[line.distance(xy) > beside]
        n = len(xy)
        if n == 0:
            return
        scale = random_scales(rng, spec.scales, n)
        poses = upright_poses(xy, (np.pi / 2) * rng.integers(4, size=n).astype(np.float64), scale)
        poses[:, :3, :3] = self._tilted(xy, spec.tilt, spec.lean_deg, rng) @ poses[:, :3, :3]
        poses[:, 2, 3] = self.field.height_at(xy[:, 0], xy[:, 1]) - spec.sink * scale
        self.add_swarm(make_swarm(spec.name, spec.kind, spec.meshes, poses, rng, tint=spec.tint), spec.meshes)

    def off_solids(self, xy: Array, clear: float) -> Mask:
        """Mask of the positions (n, 2) that are at least ``clear`` [m] from all colliders."""
        return outside(xy, np.add(np.array(self.solids).reshape(-1, 3), (0.0, 0.0, clear)))

    def _tilted(self, xy: Array, tilt: float, lean_deg: float, rng: np.random.Generator) -> Array:
        """Rotations (n, 3, 3) from upright to the share ``tilt`` of the ground's slope, with some random lean."""
        slope_x, slope_y = self.field.slope_at(*xy.T)
        lean = np.tan(np.radians(lean_deg)) * rng.standard_normal((len(xy), 2)).clip(-2, 2)
        up = np.column_stack([-tilt * slope_x + lean[:, 0], -tilt * slope_y + lean[:, 1], np.ones(len(xy))])
        return rotations_to(up)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Placing objects by rules: a world builder records the space that is taken, so that nothing overlaps."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from math import hypot
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.world.circles import Circles
from fieldtruth.world.grids import BUILT_IN
from fieldtruth.world.model import Heightfield, Instance, Mesh, Swarm
from fieldtruth.world.poses import random_tint, rotations_to, upright_pose, upright_poses
from fieldtruth.world.swarms import Density, SwarmSpec, jittered_grid, make_swarm, random_scales
from fieldtruth.world.trails import Line, Trail

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

    def mesh(self, number: int) -> Mesh:
        """Mesh of the object with this number, counted from 0."""
        return self.meshes[number % len(self.meshes)]

    def check_complete(self, placed: Sequence[Instance], where: str = "in the world") -> list[Instance]:
        """Return the placed objects.

        Raises:
            CrowdedWorldError: there are fewer than ``count``.
        """
        if len(placed) < self.count:
            raise CrowdedWorldError(
                f"only {len(placed)} of {self.count} objects of kind {self.kind} fit {where}; reduce the layout's count"
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


@dataclasses.dataclass
class WorldBuilder:
    """A world while it is built. Each object keeps a circle of its mesh's footprint free of others."""

    field: Heightfield
    size: tuple[float, float]
    trails: Sequence[Trail]
    corridors: Sequence[Line]
    """Centre lines of the strips that stay free of obstacles, ``corridor_width`` [m] wide."""
    corridor_width: float = 2.0
    water_level: float | None = None
    meshes: dict[str, Mesh] = dataclasses.field(default_factory=dict, init=False)
    instances: list[Instance] = dataclasses.field(default_factory=list, init=False)
    swarms: list[Swarm] = dataclasses.field(default_factory=list, init=False)
    taken: Circles = dataclasses.field(default_factory=lambda: Circles(4.0), init=False)
    _solids: list[tuple[float, float, float]] = dataclasses.field(default_factory=list, init=False)
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
        """Whether a circle around xy [m] is in the world, outside all corridors, and overlaps no object."""
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
    ) -> Instance:
        """Add a mesh at a pose (4, 4); it keeps ``circles`` (x, y, radius) [m] free of other objects."""
        count = self._counts[kind] = self._counts.get(kind, 0) + 1
        instance = Instance(
            name=f"{kind}_{count}",
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
            self._solids.append((float(x), float(y), float(half) * scale))
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
        self,
        group: ObjectGroup,
        rng: np.random.Generator,
        allowed: Callable[[Array], Mask],
        *,
        tries: int = 4000,
    ) -> list[Instance]:
        """Scatter upright objects where ``allowed`` is true for positions (n, 2).

        Draws ``tries`` positions at first; then for each candidate a scale, and for a placed object yaw and tint.

        Raises:
            CrowdedWorldError: too few candidates are free even at half the spacing.
        """
        darts = self.random_positions(self.tries(tries), rng)

        def attempt(xy: Array, number: int, apart: bool) -> Instance | None:
            mesh, scale = group.mesh(number), float(rng.uniform(*group.scales))
            if not apart or not self.is_free(xy, mesh.footprint * scale):
                return None
            yaw = float(rng.uniform(0.0, 2.0 * np.pi))
            return self.add_upright(group.kind, mesh, xy, yaw=yaw, scale=scale, tint=random_tint(rng, group.tint))

        hits = darts[allowed(darts)]
        return group.check_complete(place_until_count(group.count, hits, attempt, spacings=eased(group.spacing)))

    def along_trails(self, group: ObjectGroup, rng: np.random.Generator, offset: float) -> list[Instance]:
        """Add objects of scale 1 on both sides of the trails, facing them, ``offset`` [m] outside their edge.

        Draws the order of all candidates at first, then the tint of each placed object.

        Raises:
            CrowdedWorldError: too few candidates are free even at half the spacing.
        """
        candidates = self._beside_trails(offset)
        order = rng.permutation(len(candidates))

        def attempt(candidate: Array, number: int, apart: bool) -> Instance | None:
            mesh, xy = group.mesh(number), candidate[:2]
            if not apart or self.trail_distance(xy[None])[0] < min(mesh.footprint, offset) - 1e-6:
                return None
            if not self.is_free(xy, mesh.footprint):
                return None
            return self.add_upright(group.kind, mesh, xy, yaw=float(candidate[2]), tint=random_tint(rng, group.tint))

        placed = place_until_count(group.count, candidates[order], attempt, spacings=eased(group.spacing))
        return group.check_complete(placed, "along the trails")

    def _beside_trails(self, offset: float) -> Array:
        """Candidates (n, 3): x, y [m] every 0.8 m on either side of the trails, and the yaw [rad] towards the trail."""
        candidates = []
        for trail in self.trails:
            inside = (np.abs(trail.line.points) < np.array(self.size) / 2 - 2).all(axis=1)
            for row in np.flatnonzero(inside)[::16]:
                tx, ty = trail.line.tangents[row]
                for side in (-1.0, 1.0):
                    outwards = side * np.array([-ty, tx])
                    xy = trail.line.points[row] + outwards * (trail.width / 2 + offset)
                    candidates.append((*xy, np.arctan2(-outwards[1], -outwards[0])))
        return np.array(candidates).reshape(-1, 3)

    def add_swarm(self, swarm: Swarm, meshes: Sequence[Mesh]) -> None:
        """Add a swarm with its meshes."""
        for mesh in meshes:
            self.meshes.setdefault(mesh.name, mesh)
        self.swarms.append(swarm)

    def scatter_swarm(self, spec: SwarmSpec, rng: np.random.Generator, density: Density | None = None) -> None:
        """Spread small objects over the ground as one swarm, thinned by ``density`` at positions (n, 2).

        Draws a jittered grid, scales, quarter turns (bounding boxes stay narrow), lean, meshes and tints.
        """
        xy = jittered_grid(np.array(self.size), spec.per_m2, rng, density)
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
        """Whether positions (n, 2) are at least ``clear`` [m] from all colliders."""
        off = np.ones(len(xy), np.bool_)
        if len(xy) and self._solids:
            solids = np.array(self._solids)
            inside = cKDTree(xy).query_ball_point(solids[:, :2], solids[:, 2] + clear)
            off[np.concatenate([np.asarray(rows, np.intp) for rows in inside])] = False
        return off

    def _tilted(self, xy: Array, tilt: float, lean_deg: float, rng: np.random.Generator) -> Array:
        """Rotations (n, 3, 3) from upright to the share ``tilt`` of the ground's slope, with some random lean."""
        slope_x, slope_y = self.field.slope_at(*xy.T)
        lean = np.tan(np.radians(lean_deg)) * rng.standard_normal((len(xy), 2)).clip(-2, 2)
        up = np.column_stack([-tilt * slope_x + lean[:, 0], -tilt * slope_y + lean[:, 1], np.ones(len(xy))])
        return rotations_to(up)

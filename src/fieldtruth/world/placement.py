# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Putting things into a world by rules: what stands where is kept, so nothing overlaps and the routes stay free."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.world.model import GROUND_ID, Heightfield, Instance, Mesh, Swarm
from fieldtruth.world.trails import Line, Trail

_EASES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
"""Shares of the wished spacing, tried in turn: things that are strewn at random may take each other's room."""


class CrowdedWorldError(FieldtruthError):
    """The rules leave no room for what was asked for; says how many of what found a place."""


@dataclasses.dataclass
class Site:
    """A world while it is filled. Every placed thing keeps a circle of its mesh's footprint to itself."""

    field: Heightfield
    size: tuple[float, float]
    trails: Sequence[Trail]
    corridors: Sequence[Line]
    """Lines that robots drive; their middle keeps ``corridor_width`` / 2 [m] free of everything that stands."""
    corridor_width: float = 2.0
    meshes: dict[str, Mesh] = dataclasses.field(default_factory=dict)
    instances: list[Instance] = dataclasses.field(default_factory=list)
    swarms: list[Swarm] = dataclasses.field(default_factory=list)
    _circles: Array = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))
    _solids: list[tuple[float, float, float]] = dataclasses.field(default_factory=list)
    _counts: dict[str, int] = dataclasses.field(default_factory=dict)

    def trail_distance(self, places: Array) -> Array:
        """Distance [m], (n,), of places (n, 2) to the nearest trail's edge, below 0 inside; infinite without trails."""
        if not self.trails:
            return np.full(len(places), np.inf)
        return np.asarray(np.min([t.line.distance(places) - t.width / 2.0 for t in self.trails], axis=0))

    def is_free(self, x: float, y: float, radius: float, *, margin: float = 0.0) -> bool:
        """Tell whether a circle lies in the world, off the corridors and ``margin`` [m] off everything placed."""
        length, width = self.size
        if abs(x) + radius > length / 2 - 0.5 or abs(y) + radius > width / 2 - 0.5:
            return False
        a, b, r = self._circles.T
        if ((x - a) ** 2 + (y - b) ** 2 < (radius + r + margin) ** 2).any():
            return False
        return all(line.distance([[x, y]])[0] >= radius + self.corridor_width / 2 for line in self.corridors)

    def place(
        self, kind: str, mesh: Mesh, x: float, y: float, *, yaw: float, scale: float = 1.0,
        tint: tuple[float, float, float] = (1.0, 1.0, 1.0),
    ) -> Instance:  # fmt: skip
        """Stand a mesh on the ground at x, y [m], turned by ``yaw`` [rad], where its footprint's lowest ground is."""
        radius = mesh.footprint * scale
        angles = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
        reach = min(radius, 0.9)
        ground = self.field.height_at([x, *(x + reach * np.cos(angles))], [y, *(y + reach * np.sin(angles))])
        pose = np.eye(4)
        pose[:3, :3] = scale * np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        pose[:3, 3] = x, y, float(ground.min())
        return self.stand(kind, mesh, pose, [(x, y, radius)], tint=tint)

    def stand(
        self, kind: str, mesh: Mesh, world_from_object: Array, circles: Iterable[tuple[float, float, float]],
        *, tint: tuple[float, float, float] = (1.0, 1.0, 1.0),
    ) -> Instance:  # fmt: skip
        """Put a mesh at a pose (4, 4) as it is; it keeps ``circles`` (x, y, radius) [m] to itself.

        For what lies or leans: a fallen trunk keeps a row of circles, a rock may be tilted.
        """
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
        self._circles = np.concatenate([self._circles, np.array([*circles], np.float64).reshape(-1, 3)])
        scale = float(np.cbrt(np.linalg.det(world_from_object[:3, :3])))
        for collider in mesh.colliders:
            x, y = (world_from_object @ [*collider.position, 1.0])[:2]
            length, width = collider.size[:2]
            half = length if collider.shape == "cylinder" else np.hypot(length, width) / 2
            self._solids.append((float(x), float(y), float(half) * scale))
        return instance

    def scatter(
        self, kind: str, meshes: Sequence[Mesh], count: int, *, rng: np.random.Generator,
        allowed: Callable[[Array], NDArray[np.bool_]], spacing: float = 0.0, scales: tuple[float, float] = (1.0, 1.0),
        tint: float = 0.0, tries: int = 4000, quarters: bool = False,
    ) -> list[Instance]:  # fmt: skip
        """Scatter ``count`` things, at least ``spacing`` [m] from their own kind (dart throwing, Cook 1986).

        ``allowed`` says for places (n, 2) where they may stand. Meshes are taken in turn, so that all are used alike.
        ``quarters`` turns things by quarter turns only: the box of a tall tree, which every passing ray must look into,
        stays as narrow as the tree (7 to 11 % of the time for an image of a dense forest).
        Where too few of the ``tries`` darts find room, the spacing eases down to a half. Raises CrowdedWorldError when
        even that does not help.
        """
        placed: list[Instance] = []
        length, width = self.size
        darts = rng.uniform(-0.5, 0.5, (tries, 2)) * [length, width]
        hits = darts[allowed(darts)]
        for apart, (x, y) in ((ease * spacing, dart) for ease in _EASES for dart in hits):
            if len(placed) == count:
                break
            mesh, scale = meshes[len(placed) % len(meshes)], float(rng.uniform(*scales))
            if not _keeps_apart(x, y, placed, apart):
                continue
            if self.is_free(x, y, mesh.footprint * scale):
                yaw = float(rng.integers(4)) * np.pi / 2 if quarters else float(rng.uniform(0.0, 2.0 * np.pi))
                placed.append(self.place(kind, mesh, x, y, yaw=yaw, scale=scale, tint=random_tint(rng, tint)))
        if len(placed) < count:
            raise CrowdedWorldError(f"only {len(placed)} of {count} {kind} find room in the world; ask for fewer")
        return placed

    def along_trails(
        self, kind: str, meshes: Sequence[Mesh], count: int, *, rng: np.random.Generator, offset: float,
        spacing: float, tint: float = 0.0,
    ) -> list[Instance]:  # fmt: skip
        """Line the trails with ``count`` things that face the trail from ``offset`` [m] beyond its edge.

        ``spacing`` [m] eases, and CrowdedWorldError is raised, as in ``scatter``.
        """
        length, width = self.size
        candidates = []
        for trail in self.trails:
            inside = np.flatnonzero(
                (np.abs(trail.line.points[:, 0]) < length / 2 - 2) & (np.abs(trail.line.points[:, 1]) < width / 2 - 2)
            )
            for row in inside[:: max(1, int(0.8 / 0.05))]:
                for side in (-1.0, 1.0):
                    tx, ty = trail.line.tangents[row]
                    outwards = side * np.array([-ty, tx])
                    place = trail.line.points[row] + outwards * (trail.width / 2 + offset)
                    candidates.append((*place, float(np.arctan2(-outwards[1], -outwards[0]))))
        placed: list[Instance] = []
        order = rng.permutation(len(candidates))
        for apart, (x, y, yaw) in ((ease * spacing, candidates[row]) for ease in _EASES for row in order):
            if len(placed) == count:
                break
            mesh = meshes[len(placed) % len(meshes)]
            if not _keeps_apart(x, y, placed, apart):
                continue
            clear_of_trails = self.trail_distance(np.array([[x, y]]))[0] >= min(mesh.footprint, offset) - 1e-6
            if clear_of_trails and self.is_free(x, y, mesh.footprint):
                placed.append(self.place(kind, mesh, x, y, yaw=yaw, tint=random_tint(rng, tint)))
        if len(placed) < count:
            raise CrowdedWorldError(f"only {len(placed)} of {count} {kind} find room along the trails; ask for fewer")
        return placed

    def strew(
        self, name: str, kind: str, meshes: Sequence[Mesh], *, per_m2: float, rng: np.random.Generator,
        density: Callable[[Array], Array] | None = None, scales: tuple[float, float] = (0.8, 1.25), tint: float = 0.1,
        tilt: float = 0.0, lean_deg: float = 0.0, sink: float = 0.0, clear: float = 0.0,
    ) -> int:  # fmt: skip
        """Strew small things over the ground as one swarm: up to ``per_m2`` of them, thinned by ``density``.

        ``density`` gives for places (n, 2) the share [0, 1] that grows or lies there. Places are a jittered grid
        (stratified, so that they neither clump nor line up). Nothing stands in an obstacle, nor within ``clear`` [m] of
        one or of a corridor's middle. Things stand upright, ``tilt`` 1 lays them along the ground's slope, and
        ``lean_deg`` [deg] leans them at random; ``sink`` [m] times their scale puts them into the soil. They are turned
        by quarter turns: their boxes, into which every passing ray must look, stay narrow. Returns how many there are.
        """
        places = self._jittered(per_m2, rng)
        chance = rng.random(len(places))
        if density is not None:
            places = places[chance < density(places)]
        places = places[self._off_solids(places, clear)]
        for line in self.corridors if clear > 0 else ():
            places = places[line.distance(places) > clear]
        n = len(places)
        if n == 0:
            return 0
        scale = np.exp(rng.uniform(np.log(scales[0]), np.log(scales[1]), n))
        poses = upright_poses(places, (np.pi / 2) * rng.integers(4, size=n).astype(np.float64), scale)
        poses[:, :3, :3] = self._tilted(places, tilt, lean_deg, rng) @ poses[:, :3, :3]
        poses[:, 2, 3] = self.field.height_at(places[:, 0], places[:, 1]) - sink * scale
        self.meshes.update({mesh.name: mesh for mesh in meshes if mesh.name not in self.meshes})
        self.swarms.append(
            Swarm(
                name=name,
                kind=kind,
                object_id=0,  # known when all objects are
                meshes=tuple(mesh.name for mesh in meshes),
                mesh=rng.integers(len(meshes), size=n).astype(np.int32),
                world_from_object=poses,
                tint=random_tints(rng, tint, n),
            )
        )
        return n

    def _jittered(self, per_m2: float, rng: np.random.Generator) -> Array:
        """Places (n, 2), one somewhere in each cell of a grid over the world, in rows along y."""
        cells = np.maximum(1, np.round(np.array(self.size) * np.sqrt(per_m2))).astype(int)
        grid = np.stack(np.meshgrid(*(np.arange(c) for c in cells), indexing="ij"), axis=-1).reshape(-1, 2)
        return np.asarray((grid + rng.random(grid.shape)) / cells * self.size - np.array(self.size) / 2)

    def _off_solids(self, places: Array, clear: float) -> NDArray[np.bool_]:
        from scipy.spatial import cKDTree

        off = np.ones(len(places), np.bool_)
        if len(places) and self._solids:
            solids = np.array(self._solids)
            inside = cKDTree(places).query_ball_point(solids[:, :2], solids[:, 2] + clear)
            off[np.concatenate([np.asarray(rows, np.intp) for rows in inside])] = False
        return off

    def _tilted(self, places: Array, tilt: float, lean_deg: float, rng: np.random.Generator) -> Array:
        """Rotations (n, 3, 3) from upright to the share ``tilt`` of the ground's slope, with some lean at random."""
        step = 0.25
        x, y = places.T
        along = (self.field.height_at(x + step, y) - self.field.height_at(x - step, y)) / (2 * step)
        across = (self.field.height_at(x, y + step) - self.field.height_at(x, y - step)) / (2 * step)
        lean = np.tan(np.radians(lean_deg)) * rng.standard_normal((len(places), 2)).clip(-2, 2)
        return rotations_to(np.column_stack([-tilt * along + lean[:, 0], -tilt * across + lean[:, 1], np.ones(len(x))]))


def _keeps_apart(x: float, y: float, placed: Sequence[Instance], spacing: float) -> bool:
    return all(np.hypot(*(i.world_from_object[:2, 3] - (x, y))) >= spacing for i in placed)


def random_tint(rng: np.random.Generator, spread: float) -> tuple[float, float, float]:
    """Colour factors near 1: brightness by ``spread``, each channel by a third of it."""
    bright = rng.normal(0.0, spread)
    r, g, b = np.exp(np.clip(bright + rng.normal(0.0, spread / 3, 3), -0.5, 0.5))
    return float(r), float(g), float(b)


def random_tints(rng: np.random.Generator, spread: float, count: int) -> NDArray[np.float32]:
    """Colour factors (count, 3) as those of ``random_tint``."""
    bright = rng.normal(0.0, spread, (count, 1)) + rng.normal(0.0, spread / 3, (count, 3))
    return np.asarray(np.exp(bright.clip(-0.5, 0.5)), np.float32)


def upright_poses(places: Array, yaw: Array, scale: Array) -> Array:
    """Poses (n, 4, 4) at places (n, 2) and height 0, turned by ``yaw`` (n,) [rad] and scaled by ``scale`` (n,)."""
    poses = np.zeros((len(places), 4, 4))
    poses[:, 0, 0] = poses[:, 1, 1] = scale * np.cos(yaw)
    poses[:, 1, 0], poses[:, 0, 1] = scale * np.sin(yaw), -scale * np.sin(yaw)
    poses[:, 2, 2], poses[:, 3, 3] = scale, 1.0
    poses[:, :2, 3] = places
    return poses


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

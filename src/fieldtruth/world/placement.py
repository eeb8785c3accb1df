# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Putting things into a world by rules: what stands where is kept, so nothing overlaps and the routes stay free."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fieldtruth.errors import FieldtruthError
from fieldtruth.world.model import GROUND_ID, Heightfield, Instance, Mesh
from fieldtruth.world.trails import Line, Trail

Array = NDArray[np.float64]

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
    _circles: list[tuple[float, float, float]] = dataclasses.field(default_factory=list)
    _counts: dict[str, int] = dataclasses.field(default_factory=dict)

    def trail_distance(self, places: Array) -> Array:
        """Distance [m], (n,), of places (n, 2) to the nearest trail's edge, below 0 inside."""
        return np.asarray(np.min([t.line.distance(places) - t.width / 2.0 for t in self.trails], axis=0))

    def is_free(self, x: float, y: float, radius: float, *, margin: float = 0.0) -> bool:
        """Tell whether a circle lies in the world, off the corridors and ``margin`` [m] off everything placed."""
        length, width = self.size
        if abs(x) + radius > length / 2 - 0.5 or abs(y) + radius > width / 2 - 0.5:
            return False
        if any((x - a) ** 2 + (y - b) ** 2 < (radius + r + margin) ** 2 for a, b, r in self._circles):
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
        count = self._counts[kind] = self._counts.get(kind, 0) + 1
        instance = Instance(
            name=f"{kind}_{count}",
            kind=kind,
            mesh=mesh.name,
            object_id=GROUND_ID + 1 + len(self.instances),
            world_from_object=pose,
            tint=tint,
        )
        self.meshes.setdefault(mesh.name, mesh)
        self.instances.append(instance)
        self._circles.append((x, y, radius))
        return instance

    def scatter(
        self, kind: str, meshes: Sequence[Mesh], count: int, *, rng: np.random.Generator,
        allowed: Callable[[Array], NDArray[np.bool_]], spacing: float = 0.0, scales: tuple[float, float] = (1.0, 1.0),
        tint: float = 0.0, tries: int = 4000,
    ) -> list[Instance]:  # fmt: skip
        """Scatter ``count`` things, at least ``spacing`` [m] from their own kind (dart throwing, Cook 1986).

        ``allowed`` says for places (n, 2) where they may stand. Meshes are taken in turn, so that all are used alike.
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
                yaw = float(rng.uniform(0.0, 2.0 * np.pi))
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


def _keeps_apart(x: float, y: float, placed: Sequence[Instance], spacing: float) -> bool:
    return all(np.hypot(*(i.world_from_object[:2, 3] - (x, y))) >= spacing for i in placed)


def random_tint(rng: np.random.Generator, spread: float) -> tuple[float, float, float]:
    """Colour factors near 1: brightness by ``spread``, each channel by a third of it."""
    bright = rng.normal(0.0, spread)
    r, g, b = np.exp(np.clip(bright + rng.normal(0.0, spread / 3, 3), -0.5, 0.5))
    return float(r), float(g), float(b)

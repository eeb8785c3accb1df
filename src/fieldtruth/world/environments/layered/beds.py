# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Beds: areas of a wavy outline, planted with bushes of one species, edged with stones and bordered with flowers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Final

import numpy as np
from pydantic import AfterValidator, Field

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.fields import Frozen, Integer, Positive
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import FAR, Fields, rng_of
from fieldtruth.world.environments.layered.plants import Plants, density_of, grown, specified
from fieldtruth.world.environments.layered.sections import Layer, Rule, ordered
from fieldtruth.world.environments.layered.trees import SPECIES, by_species
from fieldtruth.world.environments.layout import Count
from fieldtruth.world.model import Mesh, make_mesh
from fieldtruth.world.placement import (
    CrowdedWorldError,
    WorldBuilder,
    make_swarm,
    random_tint,
    rotations_to,
    upright_poses,
)

OFF_TRAIL: Final = 0.45
OFF_CORRIDOR: Final = 1.25
APART: Final = 0.8
"""Distances [m] of a bed's outline from a trail's edge, from a corridor's centre line and from other beds."""
TRIES: Final = 3000
"""Random beds in a world as large as the built-in ones."""
PLACES: Final = 80
"""Random positions in a bed for each bush."""
SCALES: Final = (0.85, 1.1)
TINT: Final = 0.08
"""Spread of the bushes' brightness."""


@dataclass(frozen=True)
class Bed:
    """A closed wavy outline around ``centre`` [m]: an ellipse turned by ``yaw`` [rad], with waves."""

    centre: tuple[float, float]
    axes: tuple[float, float]  # [m] half the length and half the width
    yaw: float
    waves: tuple[tuple[int, float, float], ...]  # (number around the bed, share of the radius, phase [rad])

    @classmethod
    def for_bushes(cls, centre: Array, meshes: Sequence[Mesh], rng: np.random.Generator) -> "Bed":
        """A bed of a random shape with room for these bushes and a border of flowers."""
        radius = 0.3 + float(np.sqrt(1.3 * sum(mesh.footprint**2 for mesh in meshes)))
        stretch = float(rng.uniform(1.0, 1.35))
        waves = tuple(
            (k, float(rng.uniform(0.3, 1.0)) * share, float(rng.uniform(0.0, 6.3)))
            for k, share in ((2, 0.09), (3, 0.07), (4, 0.03))
        )
        yaw = float(rng.uniform(0.0, np.pi))
        return cls((float(centre[0]), float(centre[1])), (radius * stretch, radius / stretch), yaw, waves)

    @property
    def radius(self) -> float:
        """Radius [m] of a circle around the centre that contains the bed."""
        return max(self.axes) * (1.0 + sum(abs(share) for _, share, _ in self.waves))

    def outline(self, spacing: float) -> Array:
        """Positions (n, 2) [m] along the outline, anticlockwise, about ``spacing`` [m] apart, not closed."""
        turn = np.linspace(0.0, 2.0 * np.pi, 721)
        fine = self._radius_at(turn)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
        steps = np.linspace(0.0, along[-1], max(8, int(along[-1] / spacing)), endpoint=False)
        local = np.stack([np.interp(steps, along, fine[:, k]) for k in range(2)], axis=1)
        return np.asarray(local @ self._rotation().T + self.centre)

    def distance(self, xy: Array) -> Array:
        """Distance [m], (n,), of positions (n, 2) from the outline along the ray to the centre, negative inside."""
        local = (xy - self.centre) @ self._rotation()
        return np.asarray(np.hypot(*local.T) - self._radius_at(np.arctan2(local[:, 1], local[:, 0])))

    def _rotation(self) -> Array:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s], [s, c]])

    def _radius_at(self, turn: Array) -> Array:
        a, b = self.axes
        ellipse = a * b / np.hypot(b * np.cos(turn), a * np.sin(turn))
        return np.asarray(ellipse * (1.0 + sum(share * np.cos(k * turn + phase) for k, share, phase in self.waves)))


def bed_distance(beds: Sequence[Bed], xy: Array) -> Array:
    """Distance [m], (n,), of positions (n, 2) to the nearest bed's outline: below 0 inside, ``FAR`` from 2 m on."""
    nearest = np.full(len(xy), FAR)
    for bed in beds:
        near = np.hypot(*(xy - bed.centre).T) < bed.radius + 2.0
        nearest[near] = np.minimum(nearest[near], bed.distance(xy[near]))
    return nearest


PerBed = Annotated[Integer, Field(ge=1)]


class Edging(Frozen):
    """Stones end to end along the outlines, slightly irregular: one swarm."""

    name: str
    kind: str = "edging"
    stone: tuple[Positive, Positive, Positive] = (0.2, 0.075, 0.035)
    """Length along the outline, width, and height above the ground [m], low enough for a mower."""
    material: str = "bed_edge"


class Border(Plants):
    """Flowers in each bed of one species of the group, in turn; a swarm of each."""

    name: str = "{species}"  # of a swarm


class Beds(Layer):
    """Bushes in beds, each of one species of the group, in turn."""

    group: str
    count: Annotated[Integer, Field(ge=0)]  # of bushes
    bushes: Annotated[tuple[PerBed, PerBed], AfterValidator(ordered)] = (3, 6)  # in a bed, at least and at most
    where: Rule = Field(default=Expression("1"))  # chance of a bed's centre
    edging: Edging | None = None
    border: Border | None = None

    def layout(self) -> tuple[Any, Any]:
        """Type and default of its key of the layout."""
        return Count, self.count

    def groups(self) -> tuple[str, ...]:
        """Names of the groups of plants that it needs."""
        return self.group, *(self.border.group if self.border is not None else ())

    def rules(self) -> Iterator[tuple[str, Expression]]:
        """Yield its rules by their keys."""
        yield from super().rules()
        if self.border is not None:
            yield from ((f"border.{key}", rule) for key, rule in self.border.rules())

    def place(self, builder: WorldBuilder, fields: Fields, config: Any, name: str) -> None:
        """Lay beds until as many bushes are planted as ``config`` says, with their edges and borders.

        Raises:
            CrowdedWorldError: bushes are left after all tries.
        """
        rng, grown_bushes = rng_of(fields.seed, f"objects.{name}"), grown(fields, config, self.group)
        species = list(by_species(grown_bushes).values())
        beds = self._lay(builder, fields, species, getattr(config, name), self.kind or name, rng)
        fields.near[name] = lambda xy: bed_distance(beds, xy)
        if self.edging is not None and beds:
            edge(builder, beds, self.edging, rng)
        if self.border is not None:
            plant_border(builder, fields, beds, self.border, config, rng)

    def _lay(
        self,
        builder: WorldBuilder,
        fields: Fields,
        species: Sequence[Sequence[Mesh]],
        count: int,
        kind: str,
        rng: np.random.Generator,
    ) -> list[Bed]:
        beds: list[Bed] = []
        left, tries = count, builder.tries(TRIES)
        centres = rng.uniform(-0.5, 0.5, (tries, 2)) * (np.array(builder.size) - 3.0)
        chosen = rng.random(tries) < fields.at(self.where, centres)
        for attempt in np.flatnonzero(chosen) if left else ():
            individuals, (low, high) = species[len(beds) % len(species)], self.bushes
            few = min(left, int(rng.integers(low, (high if attempt < tries / 2 else low) + 1)))
            meshes = [individuals[k % len(individuals)] for k in rng.permutation(max(few, len(individuals)))[:few]]
            bed = Bed.for_bushes(centres[attempt], meshes, rng)
            if not _is_free(builder, bed, beds):
                continue
            beds.append(bed)
            left -= _plant(builder, bed, meshes, kind, rng)
            if not left:
                break
        if left:
            raise CrowdedWorldError(f"{left} of {count} bushes do not fit into a bed; reduce the layout's count")
        return beds


def _is_free(builder: WorldBuilder, bed: Bed, beds: Sequence[Bed]) -> bool:
    """Return True if the bed is in the world, outside trails, corridors and other beds, and contains no object."""
    rim = bed.outline(0.3)
    inside = (np.abs(rim) < np.array(builder.size) / 2 - 0.6).all()
    apart = all(np.hypot(*np.subtract(bed.centre, b.centre)) > bed.radius + b.radius + APART for b in beds)
    if not inside or not apart or (builder.trail_distance(rim) < OFF_TRAIL).any():
        return False
    middle = bed.centre + (rim - bed.centre)[::2] * 0.55
    samples = np.concatenate([rim, middle, [bed.centre]])
    if any((line.distance(samples) < OFF_CORRIDOR).any() for line in builder.corridors):
        return False
    return all(builder.is_free(xy, 0.3) for xy in samples)


def _plant(builder: WorldBuilder, bed: Bed, meshes: Sequence[Mesh], kind: str, rng: np.random.Generator) -> int:
    """Plant bushes in the bed, the largest first and farthest from the rim; return how many fitted."""
    placed = 0
    for mesh in sorted(meshes, key=lambda m: -m.footprint):
        positions = bed.centre + rng.uniform(-1.0, 1.0, (PLACES, 2)) * bed.radius
        scales = rng.uniform(*SCALES, PLACES)
        for row in np.flatnonzero(bed.distance(positions) < -0.65 * mesh.footprint * scales):
            xy, scale = positions[row], float(scales[row])
            if builder.is_free(xy, mesh.footprint * scale):
                yaw = float(rng.uniform(0.0, 2.0 * np.pi))
                builder.add_upright(kind, mesh, xy, yaw=yaw, scale=scale, tint=random_tint(rng, TINT))
                placed += 1
                break
    return placed


def edge(builder: WorldBuilder, beds: Sequence[Bed], edging: Edging, rng: np.random.Generator) -> None:
    """Add the stones of the beds' edges as one swarm."""
    stones = [_stone(f"{edging.name}_{k}", edging, rng) for k in range(6)]
    outlines = [bed.outline(edging.stone[0] + 0.012) for bed in beds]
    xy = np.concatenate(outlines)
    ahead = np.concatenate([np.roll(o, -1, axis=0) - np.roll(o, 1, axis=0) for o in outlines])
    n = len(xy)
    lean = rng.normal(0.0, 0.03, (n, 2))
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0]) + rng.normal(0.0, 0.03, n) + np.pi * rng.integers(2, size=n)
    poses = upright_poses(xy, yaw, rng.uniform(0.94, 1.03, n))
    poses[:, :3, :3] = rotations_to(np.column_stack([lean, np.ones(n)])) @ poses[:, :3, :3]
    poses[:, 2, 3] = builder.field.height_at(*xy.T) + rng.normal(0.0, 0.004, n)
    builder.add_swarm(make_swarm(edging.name, edging.kind, stones, poses, rng, tint=0.2), stones)


def _stone(name: str, edging: Edging, rng: np.random.Generator) -> Mesh:
    """A split stone that reaches 12 cm into the soil: a block with sloping sides and a worn top."""
    length, width, height = edging.stone
    corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [length / 2, width / 2]
    rims = [np.column_stack([corner, np.full(4, -0.12)]), np.column_stack([corner, np.full(4, 0.4 * height)])]
    rims.append(np.column_stack([corner * [0.93, 0.78], np.full(4, height)]))
    rims = [rims[0], *(rim + rng.normal(0.0, 0.005, rim.shape) for rim in rims[1:])]
    quads = [[low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]] for low, high in pairwise(rims) for k in range(4)]
    quads.append(list(rims[2]))
    points = np.array(quads)
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    side = np.abs(normals[:, 2]) < 0.5
    uv = np.where(side[:, None, None], points[..., [0, 2]] + points[..., [1, 1]] * [1.0, 0.0], points[..., :2]) / 0.5
    k = 4 * np.arange(len(points))
    faces = np.stack([k, k + 1, k + 2, k, k + 2, k + 3], axis=1).reshape(-1, 3)
    return make_mesh(
        name, points, normals.repeat(4, axis=0), uv.reshape(-1, 2) + rng.random(2), faces, (edging.material,),
        footprint=length / 2,
    )  # fmt: skip


def plant_border(
    builder: WorldBuilder, fields: Fields, beds: Sequence[Bed], border: Border, config: Any, rng: np.random.Generator
) -> None:
    """Scatter flowers of one species in each bed, in turn."""
    per_m2, flowers = density_of(fields, border), grown(fields, config, *border.group)
    names = [name for group in border.group for name in config.planter.species(group)]
    for k, name in enumerate(names if per_m2 else ()):
        own, meshes = beds[k :: len(names)], [mesh for mesh in flowers if name in mesh.species]

        def density(xy: Array, own: Sequence[Bed] = own) -> Array:
            return (bed_distance(own, xy) < 0) * fields.at(border.where, xy)

        if own:
            spec = specified(border.name.replace(SPECIES, name), border, meshes, per_m2)
            builder.scatter_swarm(spec, rng, density)

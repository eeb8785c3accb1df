# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Beds of a park: mulched areas with a wavy outline and an edge of stones, planted with bushes of one species."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.park.config import Config
from fieldtruth.world.model import Instance, Mesh, make_mesh
from fieldtruth.world.placement import (
    CrowdedWorldError,
    WorldBuilder,
    make_swarm,
    place_until_count,
    random_tint,
    rotations_to,
    upright_poses,
)

OFF_TRAIL: Final = 0.45
OFF_CORRIDOR: Final = 1.25
"""Distances [m] of a bed's outline from a trail's edge and from a corridor's centre line."""

INDIVIDUALS: Final = 3  # of each species

STONE: Final = (0.2, 0.075, 0.035)
"""Length along the edge, width, and height above the ground [m] of a stone of the edge, low enough for a mower."""


@dataclass(frozen=True)
class Bed:
    """A closed wavy outline around ``centre`` [m]: an ellipse turned by ``yaw`` [rad], with waves."""

    species: str  # of its bushes
    centre: tuple[float, float]
    axes: tuple[float, float]  # [m] half the length and half the width
    yaw: float
    waves: tuple[tuple[int, float, float], ...]  # (number around the bed, share of the radius, phase [rad])

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
    """Distance [m], (n,), of positions (n, 2) to the nearest bed's outline: negative inside, infinite without beds."""
    nearest = np.full(len(xy), np.inf)
    for bed in beds:
        near = np.hypot(*(xy - bed.centre).T) < bed.radius + 2.0
        nearest[near] = np.minimum(nearest[near], bed.distance(xy[near]))
    return nearest


def lay_beds(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> list[Bed]:
    """Lay beds, most of them near the trails, until ``config.bushes`` are planted in them.

    Not ``place_until_count``: an attempt lays a bed and plants several bushes.

    Raises:
        CrowdedWorldError: bushes are left after all tries.
    """
    planter, count = config.planter, config.bushes
    bushes = {name: planter.grow("bed_bush", rng, species=[name]) for name in planter.species("bed_bush")}
    beds: list[Bed] = []
    remaining, names = count, list(bushes)
    length, width = builder.size
    tries = builder.tries(3000)
    for attempt in range(tries):
        if remaining == 0:
            break
        name = names[len(beds) % len(names)]
        few = min(remaining, int(rng.integers(3, 7 if attempt < tries / 2 else 4)))
        meshes = [bushes[name][k] for k in rng.permutation(max(few, INDIVIDUALS))[:few] % INDIVIDUALS]
        centre = rng.uniform(-0.5, 0.5, 2) * [length - 3.0, width - 3.0]
        if rng.random() > 0.3 + 0.7 * np.exp(-max(builder.trail_distance(centre[None])[0] - 2.0, 0.0) / 4.0):
            continue
        bed = _random_bed(name, centre, meshes, rng)
        if _is_free(builder, bed, beds):
            beds.append(bed)
            remaining -= _plant(builder, bed, meshes, rng)
    if remaining:
        raise CrowdedWorldError(f"{remaining} of {count} bushes do not fit into a bed; reduce the layout's count")
    return beds


def _random_bed(species: str, centre: Array, meshes: Sequence[Mesh], rng: np.random.Generator) -> Bed:
    """A bed with room for these bushes and a border of flowers."""
    radius = 0.3 + float(np.sqrt(1.3 * sum(mesh.footprint**2 for mesh in meshes)))
    stretch = float(rng.uniform(1.0, 1.35))
    waves = tuple(
        (k, float(rng.uniform(0.3, 1.0)) * share, float(rng.uniform(0.0, 6.3)))
        for k, share in ((2, 0.09), (3, 0.07), (4, 0.03))
    )
    yaw = float(rng.uniform(0.0, np.pi))
    return Bed(species, (float(centre[0]), float(centre[1])), (radius * stretch, radius / stretch), yaw, waves)


def _is_free(builder: WorldBuilder, bed: Bed, beds: Sequence[Bed]) -> bool:
    """Return True if the bed is in the world, outside trails, corridors and other beds, and contains no object."""
    rim = bed.outline(0.3)
    inside = (np.abs(rim) < np.array(builder.size) / 2 - 0.6).all()
    apart = all(np.hypot(*np.subtract(bed.centre, b.centre)) > bed.radius + b.radius + 0.8 for b in beds)
    if not inside or not apart or (builder.trail_distance(rim) < OFF_TRAIL).any():
        return False
    middle = bed.centre + (rim - bed.centre)[::2] * 0.55
    samples = np.concatenate([rim, middle, [bed.centre]])
    if any((line.distance(samples) < OFF_CORRIDOR).any() for line in builder.corridors):
        return False
    return all(builder.is_free(xy, 0.3) for xy in samples)


def _plant(builder: WorldBuilder, bed: Bed, meshes: Sequence[Mesh], rng: np.random.Generator) -> int:
    """Plant bushes in the bed, the largest first and farthest from the rim; return how many fitted.

    Draws for each of up to 80 tries per bush a scale and a position, and for a placed bush yaw and tint.
    """
    placed = 0
    for mesh in sorted(meshes, key=lambda m: -m.footprint):

        def candidates() -> Iterator[Array]:
            for _ in range(80):
                scale = rng.uniform(0.85, 1.1)
                yield np.array([*(bed.centre + rng.uniform(-1.0, 1.0, 2) * bed.radius), scale])

        def attempt(candidate: Array, number: int, apart: bool, mesh: Mesh = mesh) -> Instance | None:
            xy, scale = candidate[:2], float(candidate[2])
            radius = mesh.footprint * scale
            if bed.distance(xy[None])[0] >= -0.65 * radius or not builder.is_free(xy, radius):
                return None
            yaw = float(rng.uniform(0.0, 2.0 * np.pi))
            return builder.add_upright("bush", mesh, xy, yaw=yaw, scale=scale, tint=random_tint(rng, 0.08))

        placed += len(place_until_count(1, candidates(), attempt))
    return placed


def edge_beds(builder: WorldBuilder, beds: Sequence[Bed], rng: np.random.Generator) -> None:
    """Add the stones of the beds' edges as one swarm: end to end, slightly irregular."""
    if not beds:
        return
    stones = [_stone(f"bed_stone_{k}", rng) for k in range(6)]
    outlines = [bed.outline(STONE[0] + 0.012) for bed in beds]
    xy = np.concatenate(outlines)
    ahead = np.concatenate([np.roll(o, -1, axis=0) - np.roll(o, 1, axis=0) for o in outlines])
    n = len(xy)
    lean = rng.normal(0.0, 0.03, (n, 2))
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0]) + rng.normal(0.0, 0.03, n) + np.pi * rng.integers(2, size=n)
    poses = upright_poses(xy, yaw, rng.uniform(0.94, 1.03, n))
    poses[:, :3, :3] = rotations_to(np.column_stack([lean, np.ones(n)])) @ poses[:, :3, :3]
    poses[:, 2, 3] = builder.field.height_at(*xy.T) + rng.normal(0.0, 0.004, n)
    builder.add_swarm(make_swarm("bed_edges", "edging", stones, poses, rng, tint=0.2), stones)


def _stone(name: str, rng: np.random.Generator) -> Mesh:
    """A split stone that reaches 12 cm into the soil: a block with sloping sides and a worn top."""
    length, width, height = STONE
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
        name, points, normals.repeat(4, axis=0), uv.reshape(-1, 2) + rng.random(2), faces, ("bed_edge",),
        footprint=length / 2,
    )  # fmt: skip

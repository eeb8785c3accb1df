# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Beds of a park: mulched places with a wavy outline and an edge of stones, in which bushes of one kind stand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh, Swarm
from fieldtruth.world.placement import CrowdedWorldError, Site, random_tint, random_tints, rotations_to, upright_poses
from fieldtruth.world.plants import BUSHES, grow_bush

SHRUBS: Final[Mapping[str, tuple[float, float]]] = {
    "box": (0.65, 1.1), "hazel": (0.5, 0.95), "heather": (0.8, 1.15), "juniper": (0.5, 0.9),
}  # fmt: skip
"""Kinds of bushes, with their heights relative to a grown one's: gardeners cut them back."""

OFF_TRAIL: Final = 0.45
OFF_ROUTE: Final = 1.25
"""Distances [m] that a bed's outline keeps from a trail's edge and from the line of a route."""

STONE: Final = (0.2, 0.075, 0.035)
"""Length along the edge, width, and height above the ground [m] of a stone of the edge, flush enough for a mower."""


@dataclass(frozen=True)
class Bed:
    """A closed wavy outline about ``centre`` [m]: an ellipse turned by ``yaw`` [rad], its radius changed by waves."""

    kind: str  # of the bushes in it
    centre: tuple[float, float]
    axes: tuple[float, float]  # [m] half the length and half the width
    yaw: float
    waves: tuple[tuple[int, float, float], ...]  # (number about the bed, share of the radius, phase [rad])

    @property
    def reach(self) -> float:
        """Radius [m] of a circle about the centre that holds the bed."""
        return max(self.axes) * (1.0 + sum(abs(share) for _, share, _ in self.waves))

    def outline(self, spacing: float) -> Array:
        """Places (n, 2) [m] along the outline, anticlockwise, ``spacing`` [m] apart or a little more, not closed."""
        turn = np.linspace(0.0, 2.0 * np.pi, 721)
        fine = self._radius(turn)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
        steps = np.linspace(0.0, along[-1], max(8, int(along[-1] / spacing)), endpoint=False)
        local = np.stack([np.interp(steps, along, fine[:, k]) for k in range(2)], axis=1)
        return np.asarray(local @ self._turned().T + self.centre)

    def distance(self, places: Array) -> Array:
        """Distance [m], (n,), of places (n, 2) from the outline along the ray to the centre, below 0 inside."""
        local = (places - self.centre) @ self._turned()
        return np.asarray(np.hypot(*local.T) - self._radius(np.arctan2(local[:, 1], local[:, 0])))

    def _turned(self) -> Array:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s], [s, c]])

    def _radius(self, turn: Array) -> Array:
        a, b = self.axes
        ellipse = a * b / np.hypot(b * np.cos(turn), a * np.sin(turn))
        return np.asarray(ellipse * (1.0 + sum(share * np.cos(k * turn + phase) for k, share, phase in self.waves)))


def bed_distance(beds: Sequence[Bed], places: Array) -> Array:
    """Distance [m], (n,), of places (n, 2) from the nearest bed's outline, below 0 inside; infinite without beds."""
    nearest = np.full(len(places), np.inf)
    for bed in beds:
        near = np.hypot(*(places - bed.centre).T) < bed.reach + 2.0
        nearest[near] = np.minimum(nearest[near], bed.distance(places[near]))
    return nearest


def lay_beds(site: Site, bushes: int, individuals: int, rng: np.random.Generator) -> list[Bed]:
    """Lay beds, most of them near the trails, until all ``bushes`` stand in one. Raises CrowdedWorldError."""
    shrubs = {
        name: [
            grow_bush(
                BUSHES[name], name=f"bush_{name}_{k}", rng=rng,
                height=BUSHES[name].grown.height * float(rng.uniform(*heights)),
            )
            for k in range(individuals)
        ]
        for name, heights in SHRUBS.items()
    }  # fmt: skip
    beds: list[Bed] = []
    remaining, kinds = bushes, list(shrubs)
    length, width = site.size
    for attempt in range(3000):
        if remaining == 0:
            break
        kind = kinds[len(beds) % len(kinds)]
        count = min(remaining, int(rng.integers(3, 7 if attempt < 1500 else 4)))
        meshes = [shrubs[kind][k] for k in rng.permutation(max(count, individuals))[:count] % individuals]
        centre = rng.uniform(-0.5, 0.5, 2) * [length - 3.0, width - 3.0]
        if rng.random() > 0.3 + 0.7 * np.exp(-max(site.trail_distance(centre[None])[0] - 2.0, 0.0) / 4.0):
            continue
        bed = _shaped(kind, centre, meshes, rng)
        if _is_free(site, bed, beds):
            beds.append(bed)
            remaining -= _plant(site, bed, meshes, rng)
    if remaining:
        raise CrowdedWorldError(f"{remaining} of {bushes} bushes find no bed in the park; ask for fewer")
    return beds


def _shaped(kind: str, centre: Array, meshes: Sequence[Mesh], rng: np.random.Generator) -> Bed:
    """A bed with room for these bushes and a border of flowers."""
    radius = 0.3 + float(np.sqrt(1.3 * sum(mesh.footprint**2 for mesh in meshes)))
    stretch = float(rng.uniform(1.0, 1.35))
    waves = tuple((k, float(rng.uniform(0.3, 1.0)) * share, float(rng.uniform(0.0, 6.3)))
                  for k, share in ((2, 0.09), (3, 0.07), (4, 0.03)))  # fmt: skip
    yaw = float(rng.uniform(0.0, np.pi))
    return Bed(kind, (float(centre[0]), float(centre[1])), (radius * stretch, radius / stretch), yaw, waves)


def _is_free(site: Site, bed: Bed, beds: Sequence[Bed]) -> bool:
    """Tell whether the bed lies in the world, off trails, routes and other beds, and nothing stands in it."""
    rim = bed.outline(0.3)
    inside = (np.abs(rim) < np.array(site.size) / 2 - 0.6).all()
    apart = all(np.hypot(*np.subtract(bed.centre, b.centre)) > bed.reach + b.reach + 0.8 for b in beds)
    if not inside or not apart or (site.trail_distance(rim) < OFF_TRAIL).any():
        return False
    middle = bed.centre + (rim - bed.centre)[::2] * 0.55
    places = np.concatenate([rim, middle, [bed.centre]])
    if any((line.distance(places) < OFF_ROUTE).any() for line in site.corridors):
        return False
    return all(site.is_free(x, y, 0.3) for x, y in places)


def _plant(site: Site, bed: Bed, meshes: Sequence[Mesh], rng: np.random.Generator) -> int:
    """Stand bushes in the bed, the largest first and farthest from the rim; returns how many found room."""
    placed = 0
    for mesh in sorted(meshes, key=lambda m: -m.footprint):
        for _ in range(80):
            scale = float(rng.uniform(0.85, 1.1))
            radius = mesh.footprint * scale
            place = bed.centre + rng.uniform(-1.0, 1.0, 2) * bed.reach
            if bed.distance(place[None])[0] < -0.65 * radius and site.is_free(float(place[0]), float(place[1]), radius):
                yaw = float(rng.uniform(0.0, 2.0 * np.pi))
                site.place("bush", mesh, *place.tolist(), yaw=yaw, scale=scale, tint=random_tint(rng, 0.08))
                placed += 1
                break
    return placed


def edge_beds(site: Site, beds: Sequence[Bed], rng: np.random.Generator) -> None:
    """Set the stones of the edges, end to end and each a little askew, as one swarm."""
    if not beds:
        return
    stones = [_stone(f"bed_stone_{k}", rng) for k in range(6)]
    outlines = [bed.outline(STONE[0] + 0.012) for bed in beds]
    places = np.concatenate(outlines)
    ahead = np.concatenate([np.roll(o, -1, axis=0) - np.roll(o, 1, axis=0) for o in outlines])
    n = len(places)
    lean = rng.normal(0.0, 0.03, (n, 2))
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0]) + rng.normal(0.0, 0.03, n) + np.pi * rng.integers(2, size=n)
    poses = upright_poses(places, yaw, rng.uniform(0.94, 1.03, n))
    poses[:, :3, :3] = rotations_to(np.column_stack([lean, np.ones(n)])) @ poses[:, :3, :3]
    poses[:, 2, 3] = site.field.height_at(*places.T) + rng.normal(0.0, 0.004, n)
    site.meshes.update({mesh.name: mesh for mesh in stones})
    site.swarms.append(
        Swarm(
            name="bed_edges", kind="edging", object_id=0, meshes=tuple(mesh.name for mesh in stones),
            mesh=rng.integers(len(stones), size=n).astype(np.int32), world_from_object=poses,
            tint=random_tints(rng, 0.2, n),
        )
    )  # fmt: skip


def _stone(name: str, rng: np.random.Generator) -> Mesh:
    """A split stone, 12 cm of it in the soil: a block with sloping flanks and a worn top."""
    length, width, height = STONE
    corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [length / 2, width / 2]
    rims = [np.column_stack([corner, np.full(4, -0.12)]), np.column_stack([corner, np.full(4, 0.4 * height)])]
    rims.append(np.column_stack([corner * [0.93, 0.78], np.full(4, height)]))
    rims = [rims[0], *(rim + rng.normal(0.0, 0.005, rim.shape) for rim in rims[1:])]
    quads = [[low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]]
             for low, high in pairwise(rims) for k in range(4)] + [list(rims[2])]  # fmt: skip
    points = np.array(quads)
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    side = np.abs(normals[:, 2]) < 0.5
    uv = np.where(side[:, None, None], points[..., [0, 2]] + points[..., [1, 1]] * [1.0, 0.0], points[..., :2]) / 0.5
    k = 4 * np.arange(len(points))
    faces = np.stack([k, k + 1, k + 2, k, k + 2, k + 3], axis=1).reshape(-1, 3)
    return Mesh(
        name=name,
        vertices=points.reshape(-1, 3).astype(np.float32),
        normals=normals.repeat(4, axis=0).astype(np.float32),
        uv=(uv.reshape(-1, 2) + rng.random(2)).astype(np.float32),
        faces=faces.astype(np.int32),
        material=np.zeros(len(faces), np.int32),
        materials=("bed_edge",),
        footprint=length / 2,
    )

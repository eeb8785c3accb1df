# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants of the hillside: bushes in groups, few trees, dead ones among them, and dry grass where soil stays."""

from collections.abc import Callable, Sequence

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import strew_beyond
from fieldtruth.world.environments.hillside_ground import Ground
from fieldtruth.world.model import Heightfield, Mesh, Swarm
from fieldtruth.world.noise import solid_noise
from fieldtruth.world.placement import CrowdedWorldError, Site, random_tint, rotations_to, upright_poses
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_snag, grow_tree, grow_tuft

Rng = np.random.Generator
Density = Callable[[Array], Array]


def plant(
    site: Site, ground: Ground, rng: Rng, *, pines: int, oaks: int, snags: int, junipers: int, gorse: int,
    cushions: int, individuals: int,
) -> None:  # fmt: skip
    """Named plants, with colliders: trees first, then bushes in groups."""

    def soil(places: Array) -> Array:
        return np.clip(1 - ground.scree(places) - ground.rock(places), 0, 1) * (ground.slope_deg(places) < 30)

    def thicket(places: Array) -> Array:
        return np.asarray(
            soil(places) * np.clip(0.25 + 0.7 * solid_noise(places, wavelength=14, octaves=2, rng=rng), 0.03, 1)
        )

    height = rng.uniform
    pine = [grow_tree(TREES["pine"], name=f"pine_{k}", height=height(6.6, 9.5), rng=rng) for k in range(individuals)]
    oak = [
        grow_tree(TREES["oak"], name=f"oak_{k}", height=height(4.0, 6.2), rng=rng, detail=0.8)
        for k in range(individuals)
    ]
    dead = [
        grow_snag(TREES["pine"], name=f"snag_{k}", height=height(2.5, 5.5), rng=rng, detail=0.6)
        for k in range(min(individuals, 3))
    ]
    _scatter(site, ground, "pine", pine, pines, rng=rng, density=soil, spacing=8.0, tilt=0.0)
    _scatter(site, ground, "oak", oak, oaks, rng=rng, density=soil, spacing=6.0, tilt=0.0)
    _scatter(site, ground, "snag", dead, snags, rng=rng, density=soil, spacing=8.0, tilt=0.1)
    for kind, count, low, high, spacing in (
        ("juniper", junipers, 0.75, 1.15, 2.2), ("gorse", gorse, 0.5, 1.0, 1.4), ("heather", cushions, 0.7, 1.3, 0.9),
    ):  # fmt: skip
        full = BUSHES[kind].grown.height
        meshes = [
            grow_bush(BUSHES[kind], name=f"{kind}_{k}", height=full * height(low, high), rng=rng, detail=0.6)
            for k in range(individuals + 1)
        ]
        _scatter(site, ground, kind, meshes, count, rng=rng, density=thicket, spacing=spacing, tilt=0.5)


def _scatter(
    site: Site, ground: Ground, kind: str, meshes: Sequence[Mesh], count: int, *, rng: Rng, density: Density,
    spacing: float, tilt: float, tries: int = 6000,
) -> None:  # fmt: skip
    """Like ``Site.scatter``, for slopes: plants lean by ``tilt`` of the slope, and stand where their stem meets it."""
    length, width = site.size
    darts = rng.uniform(-0.5, 0.5, (tries, 2)) * [length, width]
    hits = darts[rng.random(tries) < density(darts)]
    taken = np.zeros((0, 2))
    for apart, (x, y) in ((ease * spacing, dart) for ease in (1.0, 0.7, 0.4, 0.0) for dart in hits):
        if len(taken) == count:
            break
        mesh, scale = meshes[len(taken) % len(meshes)], float(rng.uniform(0.85, 1.15))
        far = len(taken) == 0 or np.hypot(*(taken - (x, y)).T).min() >= apart
        if far and site.is_free(x, y, mesh.footprint * scale):
            pose = _stem_pose(ground.field, x, y, float(rng.uniform(0, 2 * np.pi)), scale, tilt)
            site.stand(kind, mesh, pose, [(x, y, mesh.footprint * scale)], tint=random_tint(rng, 0.07))
            taken = np.concatenate([taken, [[x, y]]])
    if len(taken) < count:
        raise CrowdedWorldError(f"only {len(taken)} of {count} {kind} find room in the world; ask for fewer")


def _stem_pose(field: Heightfield, x: float, y: float, yaw: float, scale: float, tilt: float) -> Array:
    step = 0.25
    dx, dy = (
        float(field.height_at(x + i, y + j) - field.height_at(x - i, y - j)) / (2 * step)
        for i, j in ((step, 0.0), (0.0, step))
    )
    pose: Array = upright_poses(np.array([[x, y]]), np.array([yaw]), np.array([scale]))[0]
    pose[:3, :3] = rotations_to(np.array([[-tilt * dx, -tilt * dy, 1.0]]))[0] @ pose[:3, :3]
    # Roots reach below the stem; its foot, a few decimetres wide, must not show on the lower side.
    pose[2, 3] = float(field.height_at(x, y)) - 0.12 * float(np.hypot(dx, dy)) * (1 - tilt)
    return pose


def strew_grass(site: Site, ground: Ground, rng: Rng, *, per_m2: float) -> list[Mesh]:
    """Tufts of dry high grass in the turf, sparse elsewhere; returns the meshes."""
    kind = GRASSES["dry"]
    low, high = kind.height
    tufts = [grow_tuft(kind, name=f"tuft_{k}", height=float(rng.uniform(0.8 * low, high)), rng=rng) for k in range(8)]

    def grown(places: Array) -> Array:
        clump = np.clip(0.5 + 0.6 * solid_noise(places, wavelength=5.0, octaves=3, rng=rng), 0, 1)
        return np.clip(0.02 + 0.9 * clump * ground.turf(places) * (1 - ground.scree(places)), 0, 1)

    if per_m2:
        site.strew("grass", "high_grass", tufts, per_m2=per_m2, rng=rng, density=grown, scales=(0.5, 1.1), tint=0.1,
                   tilt=0.2, lean_deg=6, sink=0.02, clear=0.0)  # fmt: skip
    return tufts


def vegetate_beyond(
    field: Heightfield, size: tuple[float, float], backdrop: Mesh, tufts: Sequence[Mesh], rng: Rng
) -> list[tuple[Swarm, tuple[Mesh, ...]]]:
    """Bushes, few trees and grass on the land beyond the edge."""
    bushes = [
        grow_bush(BUSHES[kind], name=f"far_{kind}_{k}", height=BUSHES[kind].grown.height * share, rng=rng, detail=0.12)
        for kind in ("juniper", "gorse")
        for k, share in enumerate((0.7, 1.0))
    ]
    trees = [
        grow_tree(TREES[s], name=f"far_{s}_{k}", height=float(rng.uniform(*h)), rng=rng, detail=0.15)
        for s, h in (("pine", (6.6, 9.5)), ("oak", (4.0, 6.0)))
        for k in range(2)
    ]
    place = (field, size, backdrop)
    return [
        strew_beyond(*place, "far_bushes", "bush", bushes, per_m2=0.022, rng=rng, scales=(0.6, 1.3), tilt=0.4),
        strew_beyond(*place, "far_trees", "tree", trees, per_m2=0.0013, rng=rng, margin=3.0, sink=0.1),
        strew_beyond(*place, "far_grass", "high_grass", tufts, per_m2=0.5, rng=rng, within=22.0, margin=0.3, sink=0.03),
    ]

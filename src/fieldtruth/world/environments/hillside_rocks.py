# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rocks of the hillside: outcrops where it is steep, boulders that rolled below them, stones in scree and gullies."""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import strew_beyond
from fieldtruth.world.environments.hillside_ground import Ground
from fieldtruth.world.model import Heightfield, Mesh, Swarm
from fieldtruth.world.placement import Site
from fieldtruth.world.rocks import ROCK_TYPES, make_rock, scatter_rocks

Rng = np.random.Generator


def _some(kinds: str, name: str, sizes: tuple[float, float], triangles: int, number: int, rng: Rng) -> list[Mesh]:
    """``number`` rocks of each of the kinds, named in words; ``sizes`` [m] from and to."""
    return [
        make_rock(
            ROCK_TYPES[kind], name=f"{name}_{kind}_{k}", size=float(rng.uniform(*sizes)), rng=rng, triangles=triangles,
            solid=sizes[1] > 0.3,
        )
        for k in range(number)
        for kind in kinds.split()
    ]  # fmt: skip


def lay_rocks(
    site: Site, ground: Ground, rng: Rng, *, crags: int, boulders: int, blocks: int, slabs: int, individuals: int
) -> None:
    """Named rocks, with colliders, large ones first."""

    def steep(places: Array) -> Array:
        return np.clip((ground.slope_deg(places) - 17) / 10, 0.02, 1)

    def rolled(places: Array) -> Array:
        return np.clip(0.15 + ground.scree(places) + 0.5 * ground.rock(places), 0, 1)

    crag = _some("crag", "crag", (2.2, 3.0), 2400, 2 * individuals, rng)
    boulder = _some("limestone granite", "boulder", (1.1, 1.8), 1600, individuals, rng)
    block = _some("limestone scree granite", "block", (0.45, 0.85), 720, individuals, rng)
    slab = _some("slab", "slab", (0.7, 1.5), 900, individuals, rng)
    scatter_rocks(site, "crag", crag, crags, rng=rng, density=steep, spacing=2.6, scales=(0.8, 1.25))
    scatter_rocks(site, "boulder", boulder, boulders, rng=rng, density=rolled, spacing=3.0)
    scatter_rocks(site, "rock", block, blocks, rng=rng, density=rolled, spacing=1.2, scales=(0.75, 1.3))
    scatter_rocks(site, "slab", slab, slabs, rng=rng, density=rolled, spacing=1.5, scales=(0.7, 1.2))


def strew_stones(site: Site, ground: Ground, rng: Rng, *, stones: float, pebbles: float) -> None:
    """Swarms: stones off the routes' middle, pebbles everywhere."""

    def loose(places: Array) -> Array:
        return np.clip(0.12 + 0.9 * ground.scree(places) + 0.5 * ground.rock(places), 0, 1)

    def gravel(places: Array) -> Array:
        return np.clip(1 - 0.85 * ground.turf(places) - 0.4 * ground.rock(places), 0, 1)

    big = _some("scree limestone slab", "stone", (0.13, 0.2), 180, 4, rng)
    small = _some("scree limestone", "pebble", (0.04, 0.07), 80, 5, rng)
    if stones:
        site.strew("stones", "rock", big, per_m2=stones, rng=rng, density=loose, scales=(0.65, 1.4), tint=0.1,
                   tilt=0.9, lean_deg=8, clear=0.9)  # fmt: skip
    if pebbles:
        site.strew("pebbles", "rock", small, per_m2=pebbles, rng=rng, density=gravel, scales=(0.6, 1.5), tint=0.12,
                   tilt=0.9, lean_deg=12)  # fmt: skip


def rocks_beyond(
    field: Heightfield, size: tuple[float, float], backdrop: Mesh, rng: Rng
) -> tuple[Swarm, tuple[Mesh, ...]]:
    """Boulders on the land beyond the edge."""
    meshes = [
        make_rock(ROCK_TYPES[kind], name=f"far_{kind}_{k}", size=s, rng=rng, triangles=320, solid=False)
        for k, s in enumerate((0.7, 1.2, 2.2))
        for kind in ("limestone", "crag")
    ]
    return strew_beyond(
        field, size, backdrop, "far_rocks", "rock", meshes, per_m2=0.016, rng=rng, within=75.0, margin=1.8,
        scales=(0.5, 1.4), tilt=0.75, sink=0.1,
    )  # fmt: skip

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Herbs of the park: flowers in the beds, and long grass where it is not mown."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.environments.park.beds import Bed, bed_distance
from fieldtruth.world.grids import noise_map
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import Density, SwarmSpec, WorldBuilder
from fieldtruth.world.plants import GRASSES, grow_clump, grow_tuft


def plant_herbs(builder: WorldBuilder, beds: Sequence[Bed], share: float, rng: np.random.Generator) -> None:
    """Scatter flowers and ornamental grass in the beds, long grass at trunks, posts and edges, and patches of meadow.

    ``share`` scales all densities; 0 plants none.
    """
    patch = noise_map(builder.size, 11.0, rng, nodes=10)
    base_distance = _base_distance(builder)

    def open_ground(xy: Array, clear: float) -> Mask:
        lines = [line.distance(xy) > clear + 0.6 for line in builder.corridors]
        return np.asarray(np.logical_and.reduce([builder.trail_distance(xy) > clear, *lines]))

    def unmown(xy: Array) -> Array:
        by_base = np.clip(1.25 - base_distance(xy) / 0.26, 0.0, 1.0)
        edge = bed_distance(beds, xy)
        by_edge = 0.75 * ((edge > 0.05) & (edge < 0.19)) * np.clip(0.5 + patch(xy), 0.0, 1.0)
        keep = (edge > 0.05) & (builder.trail_distance(xy) > 0.08)
        return np.asarray(np.maximum(by_base, by_edge) * keep * min(share, 1.0))

    def meadow(xy: Array) -> Array:
        middle = np.clip(3.0 * (patch(xy) - 1.25), 0.0, 1.0)
        free = open_ground(xy, 2.2) & (bed_distance(beds, xy) > 1.0) & (base_distance(xy) > 1.0)
        return np.asarray(middle * free * min(share, 1.0))

    rough = _make_tufts("meadow", (0.15, 0.26), 4, rng) + _make_tufts("forest", (0.13, 0.22), 2, rng)
    spec = SwarmSpec(name="rough_grass", kind="high_grass", meshes=rough, per_m2=16.0, scales=(0.65, 1.1), lean_deg=5.0)
    builder.scatter_swarm(spec, rng, unmown)
    species = {GRASSES["meadow"]: 0.62, GRASSES["daisy"]: 0.16, GRASSES["buttercup"]: 0.12, GRASSES["yarrow"]: 0.1}
    islands = [
        grow_clump(species, name=f"meadow_island_{k}", radius=0.7, per_m2=10.0, rng=rng, size=0.05, detail=0.55)
        for k in range(4)
    ]
    spec = SwarmSpec(
        name="meadow_islands", kind="high_grass", meshes=islands, per_m2=0.9, scales=(0.7, 1.05), tilt=1.0, clear=0.9
    )
    builder.scatter_swarm(spec, rng, meadow)
    _plant_beds(builder, beds, share, rng)


def _plant_beds(builder: WorldBuilder, beds: Sequence[Bed], share: float, rng: np.random.Generator) -> None:
    """Scatter flowers of one species along each bed's border, and a few high tufts among its bushes."""
    for k, name in enumerate(("daisy", "yarrow", "buttercup")):
        own = beds[k::3]
        if own:
            tufts = _make_tufts(name, (0.22, 0.42), 4, rng)
            spec = SwarmSpec(
                name=f"bed_{name}",
                kind="flower",
                meshes=tufts,
                per_m2=20.0,
                scales=(0.7, 1.1),
                lean_deg=5.0,
                clear=0.12,
            )
            builder.scatter_swarm(spec, rng, _border(own, share, noise_map(builder.size, 1.7, rng, nodes=10)))

    def among_bushes(xy: Array) -> Array:
        return np.asarray((bed_distance(beds, xy) < -0.45) * min(share, 1.0))

    tall = _make_tufts("sedge", (0.45, 0.75), 3, rng) + _make_tufts("dry", (0.45, 0.8), 3, rng)
    spec = SwarmSpec(
        name="bed_grass", kind="ornamental_grass", meshes=tall, per_m2=1.8, scales=(0.8, 1.15), lean_deg=3.0, clear=0.2
    )
    builder.scatter_swarm(spec, rng, among_bushes)


def _border(beds: Sequence[Bed], share: float, patch: Callable[[Array], Array]) -> Density:
    def density(xy: Array) -> Array:
        inside = bed_distance(beds, xy)
        return np.asarray(((inside < -0.16) & (inside > -0.75)) * np.clip(0.45 + 0.5 * patch(xy), 0.0, share))

    return density


def _make_tufts(name: str, heights: tuple[float, float], count: int, rng: np.random.Generator) -> list[Mesh]:
    """Tufts of one species from low to high [m]."""
    return [
        grow_tuft(GRASSES[name], name=f"{name}_{k}", height=float(height), rng=rng, detail=0.6)
        for k, height in enumerate(np.linspace(*heights, count))
    ]


def _base_distance(builder: WorldBuilder) -> Callable[[Array], Array]:
    """Distance [m] to the nearest trunk, post or leg of furniture as a function of positions (n, 2)."""
    cells = [np.full((1, 2), 1e6)]
    for instance in builder.instances:
        if instance.kind == "bush":
            continue
        mesh, pose = builder.meshes[instance.mesh], instance.world_from_object
        low = mesh.vertices[mesh.vertices[:, 2] < mesh.vertices[:, 2].min() + 0.15].astype(np.float64)
        cells.append(np.unique(np.round((low @ pose[:3, :3].T + pose[:3, 3])[:, :2] / 0.08), axis=0) * 0.08)
    tree = cKDTree(np.concatenate(cells))
    return lambda xy: np.asarray(tree.query(xy)[0])

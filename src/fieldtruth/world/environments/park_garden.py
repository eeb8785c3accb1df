# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What grows in a park: trees at crown's distance; flowers in the beds, and long grass where no mower gets."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.park_beds import Bed, bed_distance
from fieldtruth.world.grids import grid_axes
from fieldtruth.world.model import Mesh, Raster
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.placement import CrowdedWorldError, Site, random_tint
from fieldtruth.world.plants import GRASSES, TREES, grow_clump, grow_tree, grow_tuft

COMMON: Final = ("lime", "birch", "oak")
RARE: Final[Mapping[str, tuple[str, ...]]] = {"large_tree": ("beech", "spruce", "pine"), "small_tree": ("beech",)}
"""Species by how many individuals are grown: several of the common ones, one of the others."""

ALIKE: Final = 14.0
"""Distance [m] within which a tree that is a copy of another may not stand if any other individual is to be had."""
_EASES: Final = (1.0, 0.85, 0.7, 0.55)


def plant_trees(
    site: Site, large: int, small: int, individuals: int, growth: np.random.Generator, rng: np.random.Generator
) -> None:
    """Large trees at crown's distance, small ones between them, none on a trail. Raises CrowdedWorldError."""
    for kind, heights, count, spacing in (
        ("large_tree", (9.5, 14.5), large, 7.0),
        ("small_tree", (3.2, 5.0), small, 4.0),
    ):
        # The rare ones come second, so that each is planted even where trees are few.
        names = [(name, 0) for name in COMMON] + [(name, 0) for name in RARE[kind] if individuals > 1]
        names += [(name, k) for k in range(1, individuals) for name in COMMON]
        trees = [
            grow_tree(TREES[name], name=f"{kind}_{name}_{k}", height=float(growth.uniform(*heights)), rng=growth)
            for name, k in names
        ]
        _scatter_trees(site, kind, trees, count, spacing, rng)


def _scatter_trees(
    site: Site, kind: str, trees: Sequence[Mesh], count: int, spacing: float, rng: np.random.Generator
) -> None:
    """Dart throwing as ``Site.scatter``, but neighbours are different individuals, and all are used about alike."""
    darts = rng.uniform(-0.5, 0.5, (6000, 2)) * site.size
    darts = darts[site.trail_distance(darts) > 1.6]
    spots, used = np.zeros((0, 2)), np.zeros(0, np.intp)
    for ease in _EASES:
        for dart in darts:
            away = np.hypot(*(spots - dart).T)
            if len(spots) == count or (away < ease * spacing).any():
                continue
            near = [np.count_nonzero(used[away < ALIKE] == k) for k in range(len(trees))]
            often = np.bincount(used, minlength=len(trees))
            row = min(range(len(trees)), key=lambda k: (near[k] > 0, often[k], k))
            scale = float(rng.uniform(0.9, 1.12))
            if site.is_free(float(dart[0]), float(dart[1]), trees[row].footprint * scale):
                yaw = float(rng.uniform(0.0, 2.0 * np.pi))
                site.place(kind, trees[row], *dart.tolist(), yaw=yaw, scale=scale, tint=random_tint(rng, 0.07))
                spots, used = np.concatenate([spots, dart[None]]), np.append(used, row)
    if len(spots) < count:
        raise CrowdedWorldError(f"only {len(spots)} of {count} {kind} find room in the world; ask for fewer")


def sow_herbs(site: Site, beds: Sequence[Bed], share: float, rng: np.random.Generator) -> None:
    """Flowers and ornamental grass in the beds, long grass about trunks, posts and edges, and islands of meadow.

    ``share`` thins or thickens all of it; 0 is none.
    """
    patch = _patches(site.size, 11.0, rng)
    feet = cKDTree(_feet(site))

    def off_foot(places: Array) -> Array:
        return np.asarray(feet.query(places)[0])

    def open_ground(places: Array, clear: float) -> NDArray[np.bool_]:
        lines = [line.distance(places) > clear + 0.6 for line in site.corridors]
        return np.asarray(np.logical_and.reduce([site.trail_distance(places) > clear, *lines]))

    def unmown(places: Array) -> Array:
        by_foot = np.clip(1.25 - off_foot(places) / 0.26, 0.0, 1.0)
        edge = bed_distance(beds, places)
        by_edge = 0.75 * ((edge > 0.05) & (edge < 0.19)) * np.clip(0.5 + patch(places), 0.0, 1.0)
        keep = (edge > 0.05) & (site.trail_distance(places) > 0.08)
        return np.asarray(np.maximum(by_foot, by_edge) * keep * min(share, 1.0))

    def island(places: Array) -> Array:
        middle = np.clip(3.0 * (patch(places) - 1.25), 0.0, 1.0)
        free = open_ground(places, 2.2) & (bed_distance(beds, places) > 1.0) & (off_foot(places) > 1.0)
        return np.asarray(middle * free * min(share, 1.0))

    rough = _tufts("meadow", (0.15, 0.26), 4, rng) + _tufts("forest", (0.13, 0.22), 2, rng)
    site.strew(
        "rough_grass", "high_grass", rough, per_m2=16.0, rng=rng, density=unmown, scales=(0.65, 1.1), tint=0.1,
        lean_deg=5.0,
    )  # fmt: skip
    meadow = {GRASSES["meadow"]: 0.62, GRASSES["daisy"]: 0.16, GRASSES["buttercup"]: 0.12, GRASSES["yarrow"]: 0.1}
    islands = [
        grow_clump(meadow, name=f"meadow_island_{k}", radius=0.7, per_m2=10.0, rng=rng, size=0.05, detail=0.55)
        for k in range(4)
    ]
    site.strew(
        "meadow_islands", "high_grass", islands, per_m2=0.9, rng=rng, density=island, scales=(0.7, 1.05), tint=0.1,
        tilt=1.0, clear=0.9,
    )  # fmt: skip
    _sow_beds(site, beds, share, rng)


def _sow_beds(site: Site, beds: Sequence[Bed], share: float, rng: np.random.Generator) -> None:
    """Each bed has flowers of its own kind along its border, and a few high tufts among the bushes."""
    for k, name in enumerate(("daisy", "yarrow", "buttercup")):
        own = beds[k::3]
        if own:
            site.strew(
                f"bed_{name}", "flower", _tufts(name, (0.22, 0.42), 4, rng), per_m2=20.0, rng=rng, tint=0.1,
                density=_border(own, share, _patches(site.size, 1.7, rng)), scales=(0.7, 1.1), lean_deg=5.0, clear=0.12,
            )  # fmt: skip

    def among(places: Array) -> Array:
        return np.asarray((bed_distance(beds, places) < -0.45) * min(share, 1.0))

    tall = _tufts("sedge", (0.45, 0.75), 3, rng) + _tufts("dry", (0.45, 0.8), 3, rng)
    site.strew(
        "bed_grass", "ornamental_grass", tall, per_m2=1.8, rng=rng, density=among, scales=(0.8, 1.15), tint=0.1,
        lean_deg=3.0, clear=0.2,
    )  # fmt: skip


def _border(beds: Sequence[Bed], share: float, patch: Callable[[Array], Array]) -> Callable[[Array], Array]:
    def density(places: Array) -> Array:
        inside = bed_distance(beds, places)
        return np.asarray(((inside < -0.16) & (inside > -0.75)) * np.clip(0.45 + 0.5 * patch(places), 0.0, share))

    return density


def _tufts(name: str, heights: tuple[float, float], count: int, rng: np.random.Generator) -> list[Mesh]:
    """Tufts of one kind from low to high [m]."""
    return [
        grow_tuft(GRASSES[name], name=f"{name}_{k}", height=float(height), rng=rng, detail=0.6)
        for k, height in enumerate(np.linspace(*heights, count))
    ]


def _feet(site: Site) -> Array:
    """Places (n, 2) [m] close together along all that a mower must keep off: trunks, posts, legs of furniture."""
    places = []
    for thing in site.instances:
        if thing.kind == "bush":
            continue
        mesh, pose = site.meshes[thing.mesh], thing.world_from_object
        low = mesh.vertices[mesh.vertices[:, 2] < mesh.vertices[:, 2].min() + 0.15].astype(np.float64)
        cells = np.unique(np.round((low @ pose[:3, :3].T + pose[:3, 3])[:, :2] / 0.08), axis=0)
        places.append(cells * 0.08)
    return np.concatenate(places) if places else np.full((1, 2), 1e6)


def _patches(size: tuple[float, float], wavelength: float, rng: np.random.Generator) -> Callable[[Array], Array]:
    """Noise of unit deviation over the world."""
    spacing = wavelength / 10
    x, y = grid_axes(size, spacing)
    values = fractal_noise(x, y, wavelength=wavelength, octaves=3, rng=rng).astype(np.float32)
    raster = Raster(values=values, spacing=float(x[1] - x[0]), x0=float(x[0]), y0=float(y[0]))
    return lambda places: raster.at(*places.T)

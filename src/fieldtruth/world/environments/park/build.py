# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The urban park (paper, 2.2.1): almost plane ground, two trails, trees, bushes, lamps, benches, tables, bins.

The ground has gentle swells; lawn, litter below crowns, mulch in beds, trails with a border. Trees are at crown's
distance; flowers grow in the beds, and long grass where it is not mown. Beds are mulched areas with a wavy outline and
an edge of stones, planted with bushes of one species.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.assembly import assemble
from fieldtruth.world.classes import class_table
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.environments.park.beyond import make_surroundings
from fieldtruth.world.environments.park.config import Config
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.grids import (
    COVER,
    Line,
    Trail,
    coarseness,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    make_trails,
    noise_map,
    signed_distance,
)
from fieldtruth.world.model import Heightfield, Instance, Mesh, Terrain, World, make_mesh
from fieldtruth.world.objects.place import stand_objects
from fieldtruth.world.placement import (
    CrowdedWorldError,
    Density,
    ObjectGroup,
    WorldBuilder,
    eased,
    make_swarm,
    place_until_count,
    random_tint,
    rotations_to,
    upright_poses,
)
from fieldtruth.world.relief import with_layer, with_microrelief

BED_OFF_TRAIL: Final = 0.45
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
    if not inside or not apart or (builder.trail_distance(rim) < BED_OFF_TRAIL).any():
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


def make_heights(
    config: Config, trails: Sequence[Trail], rng: np.random.Generator, fine_rng: np.random.Generator
) -> Heightfield:
    """Low swells; fine gravel on the trails, lawn elsewhere."""
    hills, fine = grid_axes(config.size, hills_spacing(config.size)), grid_axes(config.size, config.grid)
    swell = config.relief * fractal_noise(*hills, wavelength=46.0, octaves=3, rng=rng, gain=0.35)
    on_trail = np.clip(0.5 - signed_distance(trails, *hills) / 0.2, 0.0, 1.0)
    cover = [(config.roughness_of("gravel"), on_trail), (config.roughness_of("lawn"), 1.0 - on_trail)]
    heights = with_microrelief(swell - swell.mean(), hills, fine, cover, fine_rng)
    return make_heightfield(heights, config.grid, *fine)


def cover_ground(builder: WorldBuilder, beds: Sequence[Bed], border_width: float, rng: np.random.Generator) -> Terrain:
    """Lawn, dry and worn in patches, litter below large trees, mulch in the beds, trails with a border of setts."""
    x, y = grid_axes(builder.size, cell := COVER * coarseness(builder.size))
    distance = signed_distance(builder.trails, x, y)
    patch = fractal_noise(x, y, wavelength=14.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(x, y, wavelength=1.6, octaves=3, rng=rng, gain=0.7)
    worn = np.clip(0.95 - distance / 0.32 + 0.75 * fine, 0.0, 1.0)
    litter, bare = np.zeros_like(patch), np.zeros_like(patch)
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    bed = np.clip(0.5 - bed_distance(beds, nodes).reshape(patch.shape) / 0.1, 0.0, 1.0)
    # Leaves below large trees, mulch around young ones, bare soil around furniture.
    for kind, radius, ragged, under in (
        ("large_tree", 1.1, (0.5, 0.35), litter),
        ("small_tree", 0.5, (0.12, 0.1), bed),
        ("bench", 0.85, (0.5, 0.45), bare),
        ("table", 1.1, (0.5, 0.5), bare),
    ):
        for instance in builder.instances:
            if instance.kind != kind:
                continue
            ix, iy = instance.world_from_object[:2, 3] + (
                0.35 * instance.world_from_object[:2, 0] if kind == "bench" else 0
            )
            near = np.ix_(*(np.flatnonzero(np.abs(axis - at) < radius + 1.0) for axis, at in ((x, ix), (y, iy))))
            away = np.hypot(x[near[0]] - ix, y[near[1]] - iy)
            here = np.clip((radius - away) / ragged[0] + ragged[1] * 3.1 * fine[near], 0.0, 1.0) * (away < radius + 1.0)
            under[near] = np.maximum(under[near], here)
    dry = np.clip(0.32 + 0.36 * patch + 0.26 * fine, 0.0, 0.95)
    trodden = np.clip(0.9 * worn * (0.5 + 0.4 * fine) + 0.55 * bare * (0.7 + 0.5 * fine), 0.0, 1.0)
    free = (1.0 - bed) * (1.0 - litter)
    cover = np.stack(
        [free * (1 - trodden) * (1 - dry), free * (1 - trodden) * dry, free * trodden, bed, litter * (1 - bed)], axis=-1
    )
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(distance, cell, x, y),
        cover=make_raster(cover, cell, x, y),
        ground_materials=("lawn", "lawn_dry", "soil", "mulch", "leaves_on_lawn"),
        trail_material="gravel",
        border_material="setts",
        border_width=border_width,
    )


def furnish(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Add benches and lamps along the trails, bins beside benches, tables on the lawn."""

    def pieces(kind: str, variants: int, count: int, spacing: float, tint: float) -> ObjectGroup:
        meshes = [make_furniture(f"{kind}_{k}") for k in range(variants)]
        return ObjectGroup(kind=kind, meshes=meshes, count=count, spacing=spacing, tint=tint)

    def on_lawn(xy: Array) -> Mask:
        return np.abs(builder.trail_distance(xy) - 4.5) < 2.5

    builder.along_trails(pieces("lamp_post", 1, config.lamp_posts, 9.0, 0.03), rng, offset=0.45)
    seats = builder.along_trails(pieces("bench", 3, config.benches, 6.0, 0.08), rng, offset=0.95)
    _place_bins(builder, pieces("trash_bin", 2, config.trash_bins, 5.0, 0.06), seats, rng)
    builder.scatter(pieces("table", 2, config.tables, 5.0, 0.08), rng, on_lawn)


def _place_bins(
    builder: WorldBuilder, bins: ObjectGroup, benches: Sequence[Instance], rng: np.random.Generator
) -> None:
    """Add at most one bin beside each bench, the rest along the trails.

    Draws the order of the benches at first, then the tint of each placed bin.
    """
    candidates = []
    for row in rng.permutation(len(benches)):
        pose = benches[row].world_from_object
        for side in (1.0, -1.0):
            x, y, _, _ = pose @ [-0.05, side * 1.45, 0.0, 1.0]
            candidates.append(np.array([x, y, np.arctan2(pose[1, 0], pose[0, 0]), row]))
    served: set[float] = set()

    def attempt(candidate: Array, number: int, apart: bool) -> Instance | None:
        x, y, yaw, row = candidate
        mesh = bins.mesh(number)
        if row in served or not builder.is_free((x, y), mesh.footprint):
            return None
        served.add(row)
        return builder.add_upright(bins.kind, mesh, (x, y), yaw=float(yaw), tint=random_tint(rng, bins.tint))

    placed = len(place_until_count(bins.count, candidates, attempt))
    if placed < bins.count:
        builder.along_trails(replace(bins, count=bins.count - placed), rng, offset=0.6)


ALIKE: Final = 14.0
"""Distance [m] within which two trees are not copies of one individual if another individual is available."""
OFF_TRAIL: Final = 1.6  # [m]
TRIES: Final = 6000


def plant_trees(builder: WorldBuilder, config: Config, growth: np.random.Generator, rng: np.random.Generator) -> None:
    """Plant large trees, then small ones between them, none on a trail."""
    planter, few = config.planter, config.individuals
    for kind, count, spacing in (("large_tree", config.large_trees, 7.0), ("small_tree", config.small_trees, 4.0)):
        common, rare = planter.species(kind), planter.species(f"rare_{kind}")
        # The rare ones come second, so that each is planted even if there are few trees.
        names = [(kind, name, 0) for name in common] + [(f"rare_{kind}", name, 0) for name in rare if few > 1]
        names += [(kind, name, k) for k in range(1, few) for name in common]
        trees = [planter.individual(group, name, k, growth) for group, name, k in names]
        group = ObjectGroup(kind=kind, meshes=trees, count=count, spacing=spacing, scales=(0.9, 1.12), tint=0.07)
        _scatter_varied(builder, group, rng)


def _scatter_varied(builder: WorldBuilder, group: ObjectGroup, rng: np.random.Generator) -> None:
    """Scatter trees so that neighbours are different individuals and all are used about equally often.

    Draws ``TRIES`` positions at first; then for each candidate that keeps the spacing a scale, and for a placed tree
    yaw and tint.

    Raises:
        CrowdedWorldError: too few candidates are free even at about half the spacing.
    """
    darts = builder.random_positions(builder.tries(TRIES), rng)
    hits = darts[builder.trail_distance(darts) > OFF_TRAIL]
    planted: list[tuple[Array, int]] = []

    def attempt(xy: Array, number: int, apart: bool) -> Instance | None:
        if not apart:
            return None
        used = [row for _, row in planted]
        near = {row for other, row in planted if np.hypot(*(other - xy)) < ALIKE}
        row = min(range(len(group.meshes)), key=lambda k: (k in near, used.count(k), k))
        mesh, scale = group.meshes[row], float(rng.uniform(*group.scales))
        if not builder.is_free(xy, mesh.footprint * scale):
            return None
        planted.append((xy, row))
        yaw = float(rng.uniform(0.0, 2.0 * np.pi))
        return builder.add_upright(group.kind, mesh, xy, yaw=yaw, scale=scale, tint=random_tint(rng, group.tint))

    spacings = eased(group.spacing, (1.0, 0.85, 0.7, 0.55))
    group.check_complete(place_until_count(group.count, hits, attempt, spacings=spacings))


def plant_herbs(builder: WorldBuilder, beds: Sequence[Bed], config: Config, rng: np.random.Generator) -> None:
    """Scatter flowers and ornamental grass in the beds, long grass at trunks, posts and edges, and patches of meadow.

    ``config.herbs`` scales all densities; 0 plants none.
    """
    planter, share = config.planter, config.herbs
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

    rough = planter.grow("rough_meadow", rng) + planter.grow("rough_forest", rng)
    builder.scatter_swarm(planter.swarm("rough_grass", rough), rng, unmown)
    builder.scatter_swarm(planter.swarm("meadow_islands", planter.grow("meadow_island", rng)), rng, meadow)
    _plant_beds(builder, beds, config, rng)


def _plant_beds(builder: WorldBuilder, beds: Sequence[Bed], config: Config, rng: np.random.Generator) -> None:
    """Scatter flowers of one species along each bed's border, and a few high tufts among its bushes."""
    planter, share = config.planter, config.herbs
    flowers = planter.species("bed_flower")
    for k, name in enumerate(flowers):
        own = beds[k :: len(flowers)]
        if own:
            spec = planter.swarm(f"bed_{name}", planter.grow("bed_flower", rng, species=[name]), form="bed_flower")
            builder.scatter_swarm(spec, rng, _border(own, share, noise_map(builder.size, 1.7, rng, nodes=10)))

    def among_bushes(xy: Array) -> Array:
        return np.asarray((bed_distance(beds, xy) < -0.45) * min(share, 1.0))

    builder.scatter_swarm(planter.swarm("bed_grass", planter.grow("bed_grass", rng)), rng, among_bushes)


def _border(beds: Sequence[Bed], share: float, patch: Callable[[Array], Array]) -> Density:
    def density(xy: Array) -> Array:
        inside = bed_distance(beds, xy)
        return np.asarray(((inside < -0.16) & (inside > -0.75)) * np.clip(0.45 + 0.5 * patch(xy), 0.0, share))

    return density


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


def build(seed: int, corridors: Sequence[Line], config: Config) -> World:
    """Build a park; ``corridors`` stay free of obstacles. The same arguments give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    seeds = np.random.SeedSequence(seed).spawn(10)
    relief, plants, trees, bushes, furniture, cover, land, herbs = (np.random.default_rng(s) for s in seeds[:8])
    microrelief, layer = (np.random.default_rng(s) for s in seeds[9].spawn(2))
    trails = make_trails(config.trails, config.trail_width)
    builder = WorldBuilder(make_heights(config, trails, relief, microrelief), config.size, trails, corridors)
    stand_objects(builder, config.objects, class_table(config.classes))
    furnish(builder, config, furniture)
    plant_trees(builder, config, trees, plants)
    beds = lay_beds(builder, config, bushes)
    edge_beds(builder, beds, herbs)
    plant_herbs(builder, beds, config, herbs)
    terrain = with_layer(cover_ground(builder, beds, config.border_width, cover), layer)
    backdrop, far = make_surroundings(builder, terrain, config, land)
    return assemble(
        builder,
        terrain,
        name="park",
        seed=seed,
        textures=seeds[8],
        backdrop=backdrop,
        beyond=far,
        litter=config.litter,
        objects=config.objects,
    )

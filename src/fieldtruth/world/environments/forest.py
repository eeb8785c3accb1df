# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The dense forest (paper, 2.2.3): trees on uneven ground, two trails, high grass, stones, bushes, fallen trunks."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator
from scipy.ndimage import gaussian_filter

from fieldtruth.experiment.rig import Frozen, Positive
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import Cover, Land, make_backdrop, rolling_hills, strew_beyond
from fieldtruth.world.environments.layout import Count, Density, Individuals, Share, Size, Trails
from fieldtruth.world.grids import distance_beyond, grid_axes
from fieldtruth.world.model import Heightfield, Mesh, Raster, Swarm, Terrain, World
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.placement import CrowdedWorldError, Site, random_tint, rotations_to
from fieldtruth.world.plants import BUSHES, GRASSES, SPECIES, grow_bush, grow_clump, grow_tree
from fieldtruth.world.plants.deadwood import grow_log, grow_snag, grow_stump, room_along
from fieldtruth.world.relief import gentled, slope_limit
from fieldtruth.world.rocks import ROCKS, make_rock, scatter_rocks
from fieldtruth.world.trails import Line, Trail, signed_distance

Array = NDArray[np.float64]

AGES: Final[Mapping[str, tuple[float, float]]] = {"old": (15.0, 21.0), "grown": (9.0, 14.0), "young": (3.0, 6.0)}
"""Heights [m]."""
TREE_DETAIL: Final = {"old": 0.11, "grown": 0.11, "young": 0.35}
CLUMP_PER_M2: Final = 8.0
FERNS_TOGETHER: Final = 3
FAR_DETAIL: Final = 0.05
FAR_TREES: Final = 12.0
"""Distance [m] from the edge within which the forest goes on as trees; behind it its roof closes the view."""


class ForestConfig(Frozen):
    """How the forest is laid out; at most 500 things have names, so that a message of all poses stays small."""

    size: Size = (100.0, 50.0)  # [m] along x (north) and y (west)
    grid: Positive = 0.2  # [m] between the terrain's nodes
    relief: Positive = 0.55  # [m], standard deviation of the ground's height
    trails: Trails = (
        ((-60, -15), (-42, -9), (-31, -11), (-19, -4), (-8, -5), (4, 1), (15, 7), (27, 4), (38, 8), (60, 2)),
        ((-27, 36), (-19, 20), (-13, 13), (-9, 4), (-8, -5), (-1, -12), (10, -14), (21, -10), (29, -16), (34, -36)),
    )  # [m]
    trail_width: Positive = 1.7  # [m]
    old_trees: Count = 102
    grown_trees: Count = 140
    young_trees: Count = 110
    snags: Count = 14
    fallen_trunks: Count = 13
    stumps: Count = 8
    bushes: Count = 38
    rocks: Count = 36
    stones_per_m2: Density = 0.35
    grass_per_m2: Density = 5.0
    ferns_per_m2: Density = 0.75
    individuals: Individuals = 4  # of each species and age
    species: Mapping[str, Share] = Field(
        default={"spruce": 0.36, "beech": 0.26, "pine": 0.16, "birch": 0.1, "oak": 0.12},
        description="shares by species, each from 0 up to 1",
    )
    """Shares of the trees."""

    @field_validator("species")
    @classmethod
    def _known(cls, species: Mapping[str, float]) -> Mapping[str, float]:
        unknown = [name for name in species if name not in SPECIES]
        if unknown or not sum(species.values()) > 0:
            what = f"no species {unknown[0]!r}" if unknown else "no share above 0"
            raise ValueError(f"{what}; there is: {', '.join(sorted(SPECIES))}")
        return species


def build_forest(seed: int, corridors: Sequence[Line], config: ForestConfig | None = None) -> World:
    """Grow a forest; ``corridors`` are lines that robots drive and that stay free. Same arguments, same world."""
    config = config if config is not None else ForestConfig()
    seeds = np.random.SeedSequence(seed).spawn(10)
    relief, growth, woods, dead, shrubs, stones, herbs, cover, land = (np.random.default_rng(s) for s in seeds[:-1])
    trails = [Trail(Line.through(corners), config.trail_width) for corners in config.trails]
    field = _terrain(config, trails, relief)
    site = Site(field, config.size, trails, corridors)
    _lay_trunks(site, config, dead)
    _plant_trees(site, config, growth, woods)
    _lay_rocks(site, config, stones)
    _plant_bushes(site, config, shrubs)
    light = fractal_noise(*grid_axes(config.size, 0.5), wavelength=13.0, octaves=3, rng=herbs)
    glade = Raster(values=light.astype(np.float32), spacing=0.5, x0=-config.size[0] / 2, y0=-config.size[1] / 2)
    _strew_herbs(site, config, glade, herbs)
    backdrop = make_backdrop(
        field, config.size, ("needles", "canopy"), land, land=_canopy(config.size, land), cover=_far_cover(config.size)
    )
    return assemble(
        site,
        _ground(site, config, glade, cover),
        name="forest",
        seed=seed,
        textures=seeds[-1],
        backdrop=backdrop,
        beyond=_wood_beyond(site, config, backdrop, growth, land),
    )


def _terrain(config: ForestConfig, trails: Sequence[Trail], rng: np.random.Generator) -> Heightfield:
    """Swells, hollows and the mounds and pits that uprooted trees leave; trodden flat along the trails."""
    x, y = grid_axes(config.size, config.grid)
    swell = fractal_noise(x, y, wavelength=34.0, octaves=4, rng=rng, gain=0.45)
    mounds = np.abs(fractal_noise(x, y, wavelength=6.5, octaves=3, rng=rng, gain=0.5))
    bumps = fractal_noise(x, y, wavelength=1.7, octaves=3, rng=rng, gain=0.6)
    heights = config.relief * swell + 0.17 * mounds
    off_trail = signed_distance(trails, x, y).astype(np.float64)
    on_trail = 1.0 / (1.0 + np.exp((off_trail - 0.5) / 0.35))
    trodden = gaussian_filter(heights, 1.2 / config.grid) - 0.05
    heights = heights * (1.0 - on_trail) + trodden * on_trail
    heights = gentled(heights, config.grid, slope_limit(off_trail, within=10.0, beyond=32.0, near=0.6, far=5.0))
    heights += bumps * (0.028 - 0.018 * on_trail)
    return Heightfield(
        heights=(heights - heights.mean()).astype(np.float32), spacing=config.grid, x0=float(x[0]), y0=float(y[0])
    )


def _lay_trunks(site: Site, config: ForestConfig, rng: np.random.Generator) -> None:
    """Fallen trunks lie where they fell, off the trails; snags and stumps stand between the trees."""

    def off_trails(places: Array) -> NDArray[np.bool_]:
        return site.trail_distance(places) > 0.5

    names = list(config.species)
    logs = [
        grow_log(
            SPECIES[names[k % len(names)]], name=f"log_{k}", length=float(rng.uniform(3.0, 10.0)),
            radius=float(rng.uniform(0.11, 0.27)), rng=rng, detail=0.6,
        )
        for k in range(min(config.fallen_trunks, 8))
    ]  # fmt: skip
    for k in range(config.fallen_trunks):
        _lay_log(site, logs[k % len(logs)], rng)
    snags = [
        grow_snag(
            SPECIES[names[k % len(names)]], name=f"snag_{k}", height=float(rng.uniform(2.5, 13.0)), rng=rng, detail=0.5
        )
        for k in range(min(config.snags, 8))
    ]
    site.scatter("snag", snags, config.snags, rng=rng, allowed=off_trails, spacing=5.0, tint=0.1)
    stumps = [
        grow_stump(
            SPECIES[names[k % len(names)]], name=f"stump_{k}", radius=float(rng.uniform(0.12, 0.3)), rng=rng, detail=0.5
        )
        for k in range(min(config.stumps, 4))
    ]
    site.scatter("stump", stumps, config.stumps, rng=rng, allowed=off_trails, spacing=4.0, tint=0.1)


def _lay_log(site: Site, log: Mesh, rng: np.random.Generator, tries: int = 400) -> None:
    """Lay one fallen trunk along the ground where it finds room; bridges over hollows of 5 cm, and no higher."""
    room = np.array(room_along(log))
    for _ in range(tries):
        (x, y), yaw = rng.uniform(-0.5, 0.5, 2) * site.size, float(rng.uniform(0.0, 2.0 * np.pi))
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        along = room[:, 0]
        circles = np.column_stack([x + along * ahead[0], y + along * ahead[1], room[:, 2]])
        clear = (site.trail_distance(circles[:, :2]) > circles[:, 2] + 0.2).all()
        if not clear or not all(site.is_free(*circle) for circle in circles):
            continue
        ground = site.field.height_at(circles[:, 0], circles[:, 1])
        slope, middle = np.polyfit(along, ground, 1)
        gap = float((middle + slope * along - ground).max())
        pose = np.eye(4)
        turn = np.array([[ahead[0], -ahead[1], 0.0], [ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
        pose[:3, :3] = rotations_to(np.array([[-slope * ahead[0], -slope * ahead[1], 1.0]]))[0] @ turn
        pose[:3, 3] = x, y, middle - max(gap - 0.05, 0.0)
        site.stand("fallen_trunk", log, pose, [tuple(c) for c in circles.tolist()], tint=random_tint(rng, 0.1))
        return
    raise CrowdedWorldError(f"no room for {log.name} in the forest; ask for fewer fallen trunks")


def _plant_trees(site: Site, config: ForestConfig, growth: np.random.Generator, rng: np.random.Generator) -> None:
    """Old trees first at crown's distance, then what grows between them; none on a trail."""
    counts = {"old": config.old_trees, "grown": config.grown_trees, "young": config.young_trees}
    spacing = {"old": 3.0, "grown": 1.9, "young": 1.3}
    total = sum(config.species.values())

    def off_trails(places: Array) -> NDArray[np.bool_]:
        return site.trail_distance(places) > 0.55

    for age, heights in AGES.items():
        left = counts[age]
        for k, (name, share) in enumerate(config.species.items()):
            count = left if k == len(config.species) - 1 else min(left, round(counts[age] * share / total))
            left -= count
            trees = [
                grow_tree(
                    SPECIES[name], name=f"{name}_{age}_{n}", height=float(growth.uniform(*heights)), rng=growth,
                    detail=TREE_DETAIL[age], grown_in="stand",
                )
                for n in range(min(config.individuals, count))
            ]  # fmt: skip
            if trees:
                site.scatter(
                    name,
                    trees,
                    count,
                    rng=rng,
                    allowed=off_trails,
                    spacing=spacing[age],
                    scales=(0.88, 1.15),
                    tint=0.1,
                    quarters=True,
                )


def _lay_rocks(site: Site, config: ForestConfig, rng: np.random.Generator) -> None:
    """Field stones, in groups; small stones lie about."""
    groups = rng.uniform(-0.5, 0.5, (14, 2)) * site.size

    def near_groups(places: Array) -> Array:
        away = np.min(np.linalg.norm(places[:, None] - groups, axis=2), axis=1)
        return np.asarray((0.12 + 0.88 * np.exp(-((away / 2.6) ** 2))) * (site.trail_distance(places) > 0.3))

    rocks = [
        make_rock(ROCKS["fieldstone"], name=f"rock_{k}", size=float(size), rng=rng, triangles=700)
        for k, size in enumerate(np.geomspace(0.35, 1.5, 8))
    ]
    scatter_rocks(site, "rock", rocks, config.rocks, rng=rng, density=near_groups, spacing=0.6)
    stones = [
        make_rock(ROCKS["fieldstone"], name=f"stone_{k}", size=float(size), rng=rng, triangles=80, solid=False)
        for k, size in enumerate(np.geomspace(0.06, 0.22, 8))
    ]
    site.strew(
        "small_stones", "stone", stones, per_m2=config.stones_per_m2 * 3, rng=rng, scales=(0.7, 1.3), tint=0.12,
        density=lambda p: np.clip(1.4 * near_groups(p), 0.0, 1.0), tilt=1.0, clear=0.45,
    )  # fmt: skip


def _plant_bushes(site: Site, config: ForestConfig, rng: np.random.Generator) -> None:
    """Hazel and bramble, where the trails and glades let light in."""

    def allowed(places: Array) -> NDArray[np.bool_]:
        away = site.trail_distance(places)
        return (away > 0.9) & (rng.random(len(places)) < np.exp(-away / 6.0))

    kinds = [BUSHES[name] for name in ("hazel", "bramble") if name in BUSHES]
    for k, kind in enumerate(kinds):
        bushes = [
            grow_bush(
                kind, name=f"bush_{kind.name}_{n}", height=kind.grown.height * float(rng.uniform(0.6, 1.0)), rng=rng
            )
            for n in range(4)
        ]
        count = config.bushes // len(kinds) + (k < config.bushes % len(kinds))
        site.scatter("bush", bushes, count, rng=rng, allowed=allowed, spacing=1.2, scales=(0.7, 1.15), tint=0.1)


def _strew_herbs(site: Site, config: ForestConfig, glade: Raster, rng: np.random.Generator) -> None:
    """Grass where it is light, above all along the trails; ferns in the hollows' shade; nettles here and there."""

    def light(places: Array) -> Array:
        away = site.trail_distance(places)
        return 0.75 * np.exp(-np.maximum(away, 0.0) / 1.6) + 0.28 * glade.at(places[:, 0], places[:, 1])

    def grass(places: Array) -> Array:
        return np.clip(light(places), 0.02, 0.9) * (site.trail_distance(places) > -0.1)

    def ferns(places: Array) -> Array:
        shade = np.clip(0.55 - 0.9 * glade.at(places[:, 0], places[:, 1]), 0.0, 1.0)
        return shade * (site.trail_distance(places) > 0.25)

    def nettles(places: Array) -> Array:
        return np.clip(glade.at(places[:, 0], places[:, 1]) - 0.9, 0.0, 1.0) * (site.trail_distance(places) > 0.2)

    mixtures = {
        "grass": {GRASSES["forest"]: 0.9, GRASSES["sedge"]: 0.1},
        "nettles": {GRASSES["nettle"]: 0.7, GRASSES["forest"]: 0.3},
    }
    grasses, patches = (
        [
            grow_clump(
                kinds,
                name=f"{name}_{k}",
                radius=0.5,
                per_m2=CLUMP_PER_M2,
                rng=rng,
                size=0.2 + 0.15 * k,
                detail=0.6,
            )
            for k in range(5)
        ]
        for name, kinds in mixtures.items()
    )
    fronds = [
        grow_clump(
            {GRASSES["fern"]: 0.8, GRASSES["bracken"]: 0.2}, name=f"ferns_{k}", radius=0.75,
            per_m2=FERNS_TOGETHER / (np.pi * 0.75**2), rng=rng, size=0.15 * k,
        )
        for k in range(6)
    ]  # fmt: skip
    site.strew(
        "forest_grass", "high_grass", grasses, per_m2=config.grass_per_m2 / CLUMP_PER_M2, rng=rng, density=grass,
        scales=(0.7, 1.25), tint=0.14, tilt=1.0,
    )  # fmt: skip
    site.strew(
        "ferns", "fern", fronds, per_m2=config.ferns_per_m2 / FERNS_TOGETHER, rng=rng, density=ferns,
        scales=(0.65, 1.2), tint=0.14, tilt=1.0, clear=0.5,
    )  # fmt: skip
    site.strew(
        "nettles", "herb", patches, per_m2=0.35, rng=rng, density=nettles, scales=(0.7, 1.2), tint=0.12, tilt=1.0,
        clear=0.5,
    )  # fmt: skip


def _canopy(size: tuple[float, float], rng: np.random.Generator) -> Land:
    """Level ground below the trees, then the forest's roof, 10 m up at once, over hills that rise to the horizon."""
    hills = rolling_hills(size, rng, height=16.0)
    waves = [(*rng.normal(0.0, 0.5 / length, 2), rng.uniform(0, 6.3), 0.16 * length**0.7) for length in
             rng.uniform(2.0, 14.0, 24)]  # fmt: skip

    def land(x: Array, y: Array) -> Array:
        off = distance_beyond(size, x, y)
        bumps = sum(height * np.cos(6.3 * (kx * x + ky * y) + phase) for kx, ky, phase, height in waves)
        roof = 9.0 + 0.25 * np.minimum(off - FAR_TREES, 40.0) + bumps
        return np.asarray(hills(x, y) + np.where(off > FAR_TREES + 1.0, roof, 0.0))

    return land


def _far_cover(size: tuple[float, float]) -> Cover:
    """The forest's floor below the trees, its roof behind them."""

    def cover(x: Array, y: Array, slope: Array) -> NDArray[np.intp]:
        return (distance_beyond(size, x, y) > FAR_TREES - 1.0).astype(np.intp)

    return cover


def _wood_beyond(
    site: Site, config: ForestConfig, backdrop: Mesh, growth: np.random.Generator, rng: np.random.Generator
) -> list[tuple[Swarm, Sequence[Mesh]]]:
    """The forest goes on beyond the world's edge: trees of little detail, and bushes at the edge itself."""
    trees = [
        grow_tree(
            SPECIES[name], name=f"far_{name}_{k}", height=float(growth.uniform(9.0, 20.0)), rng=growth,
            detail=FAR_DETAIL, grown_in="stand",
        )
        for name in config.species
        for k in range(2)
    ]  # fmt: skip
    young = [
        grow_tree(SPECIES[name], name=f"far_young_{name}", height=5.0, rng=growth, detail=4 * FAR_DETAIL)
        for name in ("spruce", "beech")
    ]
    return [
        strew_beyond(
            site.field, config.size, backdrop, "far_trees", "tree", trees, per_m2=0.06, rng=rng, within=FAR_TREES,
            margin=0.8,
        ),
        strew_beyond(
            site.field, config.size, backdrop, "far_young_trees", "tree", young, per_m2=0.05, rng=rng, within=9.0,
            margin=0.8, scales=(0.5, 1.3),
        ),
    ]  # fmt: skip


def _ground(site: Site, config: ForestConfig, glade: Raster, rng: np.random.Generator) -> Terrain:
    """Needles below conifers, leaves below broadleaved trees, moss in patches, humus between."""
    x, y = grid_axes(config.size, 0.1)
    px, py = np.meshgrid(x, y, indexing="ij")
    distance = signed_distance(site.trails, x, y)
    fine = fractal_noise(x, y, wavelength=1.3, octaves=3, rng=rng, gain=0.7)
    patch = fractal_noise(x, y, wavelength=7.0, octaves=4, rng=rng, gain=0.6)
    conifers, broad = _crown_share(site, x, y)
    leaves = np.clip(0.5 + 0.55 * (broad - conifers) + 0.22 * patch, 0.05, 0.95)
    moss = np.clip(0.25 * patch + 0.3 * fine - 0.18 * glade.at(px, py) - 0.12, 0.0, 0.9) * (distance > 0.2)
    soil = np.clip(0.22 - 0.25 * patch + 0.2 * fine, 0.0, 0.5)
    rest = (1.0 - moss) * (1.0 - soil)
    cover = np.stack([rest * (1.0 - leaves), rest * leaves, moss, (1.0 - moss) * soil], axis=-1)
    ragged = distance + 0.16 * fine + 0.1 * patch
    x0, y0 = float(x[0]), float(y[0])
    return Terrain(
        field=site.field,
        trail_distance=Raster(values=ragged.astype(np.float32), spacing=0.1, x0=x0, y0=y0),
        cover=Raster(values=cover.astype(np.float32), spacing=0.1, x0=x0, y0=y0),
        ground_materials=("needles", "litter", "moss", "soil"),
        trail_material="path",
        border_material="path_edge",
        border_width=0.22,
    )


def _crown_share(site: Site, x: Array, y: Array) -> tuple[Array, Array]:
    """How far nodes lie below conifers and below broadleaved trees, 0 to 1, on the grid (len(x), len(y))."""
    step = round(0.5 / (x[1] - x[0]))
    shares = []
    for names in (("spruce", "pine"), ("beech", "birch", "oak")):
        marks = np.zeros((len(x[::step]), len(y[::step])))
        for instance in site.instances:
            if instance.kind in names:
                i, j = np.round((instance.world_from_object[:2, 3] - (x[0], y[0])) / 0.5).astype(int)
                marks[i, j] += 1.0
        spread = gaussian_filter(marks, 1.6 / 0.5) * 60.0
        coarse = Raster(values=np.clip(spread, 0, 1).astype(np.float32), spacing=0.5, x0=float(x[0]), y0=float(y[0]))
        shares.append(coarse.at(*np.meshgrid(x, y, indexing="ij")))
    return shares[0], shares[1]


__all__ = ["ForestConfig", "build_forest"]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The lake's shore (paper, 2.2.2): a lake, its shore, high grass, bushes and trees, two power poles with their wires.

The height of the ground depends on the distance to the water's edge: a beach or a scarp, then the bank, which flattens
into the meadow; under water a shelf, then the slope down to the bed. The land beyond the world's edge continues the
near shore and has a far shore and hills. The cover is rough grass, bare earth on the scarps, mud and pebbles.

Plants are distributed by the distance to the water and in groves and swathes. The power line crosses the world and goes
on beyond its edge, a row of poles with four wires from each to the next. Far shores have groves, woods and grass.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import Land, height_beyond, make_backdrop, scatter_beyond
from fieldtruth.world.classes import class_table
from fieldtruth.world.environments.lake.config import Config
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.grids import (
    COVER,
    Line,
    coarseness,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    noise_map,
)
from fieldtruth.world.materials import Roughness
from fieldtruth.world.model import Heightfield, Mesh, Raster, Terrain, World
from fieldtruth.world.objects.place import stand_objects
from fieldtruth.world.placement import (
    CrowdedWorldError,
    Density,
    FarSwarm,
    ObjectGroup,
    WorldBuilder,
    make_swarm,
    random_scales,
    upright_poses,
)
from fieldtruth.world.power_lines import BUNDLE_RADIUS, CONDUCTOR_RADIUS, hang, make_cable, wire_points
from fieldtruth.world.relief import with_layer, with_microrelief
from fieldtruth.world.water import add_water, make_flat_sheet


def basin_heights(config: Config, rng: np.random.Generator) -> Land:
    """Heights [m] of the land around the lake as a function of x, y [m] of any shape.

    The near shore runs along x at y = ``config.edge``. The far shore is 130 to 200 m away, the lake's ends 250 to
    350 m; hills rise behind the far shore. North and south of the world the lake bends towards the robot, so that water
    is visible ahead when it drives along the shore.
    """
    edge = config.edge
    far, ends = edge - rng.uniform(130.0, 170.0), (-rng.uniform(250.0, 330.0), rng.uniform(250.0, 330.0))
    near_bends, far_bends = _waves(rng, (70.0, 160.0, 420.0), 2.5), _waves(rng, (60.0, 140.0, 330.0), 13.0)
    bays = rng.uniform(9.0, 15.0, 2)
    along, across = _waves(rng, (340.0, 610.0, 1300.0), 0.26), _waves(rng, (420.0, 900.0), 0.2)
    rough = _waves(rng, (83.0, 121.0, 190.0), 1.0)

    def heights(x: Array, y: Array) -> Array:
        leaving = np.clip(np.abs(x) / 40.0 - 1.25, 0.0, 1.0) ** 2  # in front of the world the shore is straight
        bay = np.where(x < 0, bays[0], bays[1]) * np.clip(5.0 - np.abs(x) / 50.0, 0.0, 1.0)
        off_near = edge + leaving * (bay + near_bends(x)) - y
        off_far = y - far - far_bends(x)
        out = np.minimum(np.minimum(off_near, off_far), 0.6 * np.minimum(x - ends[0], ends[1] - x))
        depth, inland = np.maximum(out, 0.0), np.maximum(-out, 0.0)
        rise = config.bank * (1.0 - np.exp(-inland / 9.0))
        hilly = np.logaddexp(0.0, 3.0 * (1.0 + along(x + 0.4 * y) + across(y - 0.3 * x))) / 3.0
        beyond = np.where(y < edge, 44.0, 24.0)  # the robot's own side is flatter
        away = np.maximum(inland - 12.0, 0.0) / 400.0
        hills = (beyond * hilly + 2.2 * rough(x + 0.5 * y) * np.minimum(away, 1.0)) * away / np.hypot(1.0, away)
        return np.asarray(config.water_level + np.where(out > 0, -np.minimum(0.3 * depth, 6.0), rise + hills))

    return heights


def _waves(rng: np.random.Generator, lengths: tuple[float, ...], height: float) -> Callable[[Array], Array]:
    """Sum of sines of the given wavelengths [m] with random phases and deviation ``height``."""
    phases = rng.uniform(0.0, 2.0 * np.pi, len(lengths))
    scale = height * np.sqrt(2.0 / len(lengths))

    def at(x: Array) -> Array:
        return np.asarray(sum(scale * np.sin(2 * np.pi * x / w + p) for w, p in zip(lengths, phases, strict=True)))

    return at


DEPTH: Final = 3.5  # [m] of the lake's bed
DRY: Final = 6.0  # [m] of land between a corridor's centre line and the water
WORN: Final = 2.4
"""Distance [m] from a corridor's centre line within which the ground is smoothed."""


@dataclass(frozen=True, kw_only=True)
class Shore:
    """A lake's shore: the ground, the distance to the water, and the steepness of the bank."""

    field: Heightfield
    inland: Raster
    """Distance [m] to the water's edge, below 0 in the lake."""
    scarp: Raster
    """0 at a beach, 1 where the bank ends in a scarp."""


def make_shore(
    config: Config, corridors: Sequence[Line], rng: np.random.Generator, fine_rng: np.random.Generator
) -> Shore:
    """Shape a shore along x with the lake at negative y; ``corridors`` stay on land."""
    x, y = grid_axes(config.size, spacing := hills_spacing(config.size))
    coves = fractal_noise(x, y, wavelength=34.0, octaves=4, rng=rng, gain=0.46)
    inland = y[None, :] - config.edge + config.bends * coves
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    off_corridor = np.full(inland.shape, np.inf)
    for line in corridors:
        off_corridor = np.minimum(off_corridor, line.distance(nodes).reshape(inland.shape))
    inland = np.logaddexp(inland, DRY - off_corridor) if corridors else inland  # a smooth maximum
    inland = _signed_distance(inland > 0) * spacing
    turns = fractal_noise(x, y, wavelength=30.0, octaves=2, rng=rng, gain=0.4)
    scarp = 1.0 / (1.0 + np.exp(-2.4 * (turns + 0.15)))
    slumps = fractal_noise(x, y, wavelength=4.5, octaves=3, rng=rng, gain=0.45)
    swell = fractal_noise(x, y, wavelength=30.0, octaves=3, rng=rng, gain=0.4)
    above = _above(inland, scarp, slumps, config.bank) + config.relief * swell * np.clip(inland / 18.0, 0.0, 1.0)
    height = np.where(inland > 0, above, -_below(-inland, scarp))
    # Along corridors the bank has an even slope.
    worn = np.exp(-((off_corridor / WORN) ** 2))
    height += worn * (gaussian_filter(height, WORN / spacing, mode="nearest") - height)
    fine = grid_axes(config.size, config.grid)
    heights = with_microrelief(height + config.water_level, (x, y), fine, _cover(config, inland, height), fine_rng)
    return Shore(
        field=make_heightfield(heights, config.grid, *fine),
        inland=make_raster(inland, spacing, x, y),
        scarp=make_raster(scarp, spacing, x, y),
    )


def _cover(config: Config, inland: Array, height: Array) -> list[tuple[Roughness, Array]]:
    """Mud at and under the water, earth on the scarps, meadow elsewhere, with their shares of the ground."""
    mud = np.clip(1.5 - inland / 2.0, 0.0, 1.0)
    scarp = (1.0 - mud) * np.clip((np.hypot(*np.gradient(height, hills_spacing(config.size))) - 0.4) / 0.2, 0.0, 1.0)
    shares = {"mud": mud, "earth": scarp, "meadow": 1.0 - mud - scarp}
    return [(config.roughness_of(ground), share) for ground, share in shares.items()]


def _signed_distance(land: NDArray[np.bool_]) -> Array:
    """Distance [nodes] to the border of a mask, positive inside, smooth over the grid's steps."""
    inside, outside = distance_transform_edt(land), distance_transform_edt(~land)
    return np.asarray(gaussian_filter(np.where(land, inside - 0.5, 0.5 - outside), 2.5, mode="nearest"))


def _above(inland: Array, scarp: Array, slumps: Array, bank: float) -> Array:
    """Height [m] over the water at a distance [m] inland."""
    d = np.maximum(inland, 0.0)
    beach = 3.6 * (1.0 - scarp)
    rise = (bank - 0.8) * (1.0 - np.exp(-(np.maximum(d - beach, 0.0) ** 1.3) / 21.0)) + 0.022 * d
    strand = 0.09 * np.minimum(d, beach)
    # The scarp recedes where the bank has slumped.
    cut = np.clip((d - 0.4 - 0.5 * np.maximum(slumps, -0.6)) / 1.7, 0.0, 1.0)
    step = 1.0 * scarp**1.5 * cut * cut * (3.0 - 2.0 * cut) * np.exp(-np.maximum(d - 2.0, 0.0) / 7.0)
    return np.asarray(rise + strand + step + 0.03 * d * (d < 0.5))


def _below(out: Array, scarp: Array) -> Array:
    """Depth [m] at a distance [m] out from the water's edge."""
    d = np.maximum(out, 0.0)
    shelf = (0.09 + 0.16 * scarp) * d
    slope = 0.32 * np.maximum(d - 5.0, 0.0)
    return np.asarray(DEPTH * np.tanh((shelf + slope) / DEPTH))


def cover_ground(builder: WorldBuilder, shore: Shore, rng: np.random.Generator) -> Terrain:
    """Rough grass, drier on the swells, bare earth on the scarps; mud or pebbles at and under the water."""
    x, y = grid_axes(builder.size, node := COVER * coarseness(builder.size))
    nodes = np.meshgrid(x, y, indexing="ij")
    patch = fractal_noise(x, y, wavelength=15.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(x, y, wavelength=1.6, octaves=3, rng=rng, gain=0.7)
    stony = np.clip(0.5 + 1.6 * fractal_noise(x, y, wavelength=20.0, octaves=2, rng=rng) + 0.5 * fine, 0.0, 1.0)
    inland, height = shore.inland.at(*nodes), builder.field.height_at(*nodes)
    steep = np.hypot(*np.gradient(gaussian_filter(height, 0.3 / node, mode="nearest"), node))
    scarp = np.clip((steep - 0.5 + 0.12 * fine) / 0.2, 0.0, 1.0)
    wet = np.clip(1.0 - (inland - 0.9 - 1.6 * (1.0 - shore.scarp.at(*nodes)) + 0.55 * fine) / 0.7, 0.0, 1.0)
    litter = _below_crowns(builder, x, y, fine)
    dry = np.clip(0.28 + 0.3 * patch + 0.24 * fine, 0.0, 0.9)
    turf = (1.0 - wet) * (1.0 - scarp) * (1.0 - litter)
    drowned = np.clip(-inland / 3.0, 0.0, 0.85)
    cover = np.stack(
        [
            turf * (1.0 - dry),
            turf * dry,
            (1.0 - wet) * scarp * (1.0 - litter),
            (1.0 - wet) * litter,
            wet * (1.0 - stony * (1.0 - drowned)),
            wet * stony * (1.0 - drowned),
        ],
        axis=-1,
    )
    no_trail = np.full((2, 2), 1e3, np.float32)
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(no_trail, max(builder.size), x, y),
        cover=make_raster(cover, node, x, y),
        ground_materials=("rough_grass", "dry_grass", "soil", "litter", "mud", "pebbles"),
        trail_material="gravel",
        border_material="gravel",
    )


def _below_crowns(builder: WorldBuilder, x: Array, y: Array, fine: Array) -> Array:
    """Share of the ground [0, 1] covered by leaves, around trunks and bushes."""
    share = np.zeros((len(x), len(y)))
    for instance in builder.instances:
        if not instance.kind.endswith(("tree", "bush")):
            continue
        at = instance.world_from_object[:2, 3]
        radius = 1.1 if instance.kind.endswith("tree") else 0.7
        i, j = (np.flatnonzero(np.abs(axis - c) < radius + 1.0) for axis, c in zip((x, y), at, strict=True))
        away = np.hypot(*np.meshgrid(x[i] - at[0], y[j] - at[1], indexing="ij"))
        block = np.ix_(i, j)
        share[block] = np.maximum(share[block], np.clip((radius - away) / 0.5 + 0.8 * fine[block], 0.0, 1.0))
    return share


FAR_POLES: Final = 2  # on either side of the world
POLE_CLEARANCE: Final = 0.8  # [m] around a pole; the cross-arm is above all low objects
_TRIES: Final = 60


@dataclass(frozen=True)
class PowerLine:
    """Positions of the poles, and the swarms of the line's part beyond the world's edge."""

    poles: Array  # (n, 2) [m]
    beyond: tuple[FarSwarm, ...]

    def distance(self, xy: Array) -> Array:
        """Horizontal distance [m], (n,), of positions (n, 2) to the straight lines between the poles."""
        a, b = self.poles[:-1], self.poles[1:]
        along = np.einsum("nmi,mi->nm", xy[:, None] - a, b - a) / ((b - a) ** 2).sum(axis=1)
        foot = a + np.clip(along, 0.0, 1.0)[..., None] * (b - a)
        return np.asarray(np.linalg.norm(xy[:, None] - foot, axis=-1).min(axis=1))


def string_line(
    builder: WorldBuilder,
    config: Config,
    ground_height: Callable[[Array], Array],
    rng: np.random.Generator,
    *,
    far: int = FAR_POLES,
) -> PowerLine:
    """Add two poles inside the world and their cables, with ``far`` more poles on either side of the world.

    The spans that touch the world are named objects, four cables each; the others are swarms. ``ground_height`` is the
    height [m] of the ground at positions (n, 2), also beyond the edge.

    Raises:
        CrowdedWorldError: no pair of free positions for the poles.
    """
    poles = _free_positions(builder, config, far, rng)
    variant = int(rng.integers(2))
    pole, points = make_furniture(f"power_pole_{variant}"), wire_points(variant)
    headings = np.gradient(poles, axis=0)
    poses = np.tile(np.eye(4), (len(poles), 1, 1))
    poses[:, :2, 0] = headings / np.linalg.norm(headings, axis=1, keepdims=True)
    poses[:, 0, 1], poses[:, 1, 1] = -poses[:, 1, 0], poses[:, 0, 0]
    poses[:, :2, 3], poses[:, 2, 3] = poles, ground_height(poles)
    for row in (far, far + 1):
        x, y = poles[row]
        builder.add("power_pole", pole, poses[row], [(float(x), float(y), POLE_CLEARANCE)])
    held = np.einsum("nij,mj->nmi", poses, np.column_stack([points, np.ones(len(points))]))[..., :3]
    away: list[tuple[Mesh, Array]] = []
    for row, (first, last) in enumerate(pairwise(held)):
        for k, (start, end) in enumerate(zip(first, last, strict=True)):
            span = float(np.hypot(*(end - start)[:2]))
            # Wires of one span have about the same tension.
            wire = hang(start, end, sag=config.sag * span * float(rng.uniform(0.94, 1.06)))
            radius = BUNDLE_RADIUS if k == len(first) - 1 else CONDUCTOR_RADIUS
            mesh, pose = make_cable(f"cable_{row}_{k}", wire, radius=radius)
            if abs(row - far) <= 1:
                builder.add("cable", mesh, pose, [])
            else:
                away.append((mesh, pose))
    outer = np.r_[0:far, far + 2 : len(poles)]
    beyond: list[FarSwarm] = []
    if len(outer):
        beyond.append((make_swarm("power_poles_beyond", "power_pole", [pole], poses[outer], None), [pole]))
    if away:
        meshes = [mesh for mesh, _ in away]
        cable_poses = np.array([pose for _, pose in away])
        beyond.append((make_swarm("cables_beyond", "cable", meshes, cable_poses, None), meshes))
    return PowerLine(poles, tuple(beyond))


def _free_positions(builder: WorldBuilder, config: Config, far: int, rng: np.random.Generator) -> Array:
    """Positions (2 far + 2, 2) of poles near y = ``config.line_y``; the two inside the world are free."""
    y = config.line_y
    for _ in range(_TRIES):
        middle, turn = rng.uniform([-4.0, y - 0.8], [4.0, y + 0.8]), rng.normal(0.0, 0.012)
        along = config.pole_distance * (np.arange(2 * far + 2) - far - 0.5)
        spread = rng.normal(0.0, [0.8, 0.25], (len(along), 2))
        poles = middle + along[:, None] * [np.cos(turn), np.sin(turn)] + spread
        if all(builder.is_free(pole, POLE_CLEARANCE) for pole in poles[far : far + 2]):
            return np.asarray(poles)
    raise CrowdedWorldError(
        f"no two free positions for poles {config.pole_distance} m apart near y = {y} m; "
        "change line_y or pole_distance in the layout"
    )


BELOW_WIRES: Final = 3.4  # [m] from the power line to the nearest trunk
TRIES: Final = 9000


def plant_trees(
    builder: WorldBuilder,
    shore: Shore,
    line: PowerLine,
    config: Config,
    growth: np.random.Generator,
    rng: np.random.Generator,
) -> None:
    """Plant alders and willows near the water with gaps between them, groves in the meadow, none below the wires."""
    grove = noise_map(builder.size, 17.0, rng)
    for kind, count, (low, high) in (
        ("waterside_tree", config.waterside_trees, (0.9, 6.0)),
        ("meadow_tree", config.meadow_trees, (8.5, 99.0)),
    ):
        trees = config.planter.grow(kind, growth, count=config.individuals)

        def allowed(xy: Array, low: float = low, high: float = high) -> Mask:
            inland, thick = shore.inland.at(*xy.T), grove(xy)
            return (inland > low) & (inland < high) & (thick > -0.1) & (line.distance(xy) > BELOW_WIRES)

        group = ObjectGroup(kind=kind, meshes=trees, count=count, spacing=4.2, scales=(0.85, 1.15), tint=0.08)
        builder.scatter(group, rng, allowed, tries=TRIES)


def plant_bushes(builder: WorldBuilder, shore: Shore, config: Config, rng: np.random.Generator) -> None:
    """Plant grey willows along the water, hazel and brambles in the meadow, in thickets."""
    thicket = noise_map(builder.size, 12.0, rng)
    for kind, count, (low, high) in (
        ("waterside_bush", config.waterside_bushes, (0.6, 7.0)),
        ("meadow_bush", config.meadow_bushes, (5.0, 99.0)),
    ):
        bushes = config.planter.grow(kind, rng, count=config.individuals)

        def allowed(xy: Array, low: float = low, high: float = high) -> Mask:
            inland = shore.inland.at(*xy.T)
            return (inland > low) & (inland < high) & (thicket(xy) > -0.5)

        group = ObjectGroup(kind=kind, meshes=bushes, count=count, scales=(0.75, 1.15), tint=0.1)
        builder.scatter(group, rng, allowed, tries=TRIES)


def plant_grass(builder: WorldBuilder, shore: Shore, config: Config, rng: np.random.Generator) -> None:
    """Scatter reeds and cattails in the shallow water, sedges along it, long grass and herbs in the meadow."""
    planter, few = config.planter, config.individuals
    for group, density in _grass_areas(builder, shore, config, rng).items():
        meshes = planter.grow(group, rng, count=2 * few if group == "meadow_7" else few + 1)
        spec = planter.swarm(f"high_grass_{group}", meshes)
        builder.scatter_swarm(replace(spec, per_m2=spec.per_m2 * config.grass), rng, density)


def _grass_areas(builder: WorldBuilder, shore: Shore, config: Config, rng: np.random.Generator) -> dict[str, Density]:
    """Density of each group of grass and herbs, as a function of positions."""
    beds, swathe, thin = (noise_map(builder.size, wavelength, rng) for wavelength in (16.0, 9.0, 5.0))

    def depth(xy: Array) -> Array:
        return np.asarray(config.water_level - builder.field.height_at(*xy.T))

    def inland(xy: Array) -> Array:
        return shore.inland.at(*xy.T)

    def turf(xy: Array, start: float, thick: Array) -> Array:
        return np.asarray(np.clip(inland(xy) / 2.0 - start, 0, 1) * np.clip(thick, 0, 1))

    def reed(xy: Array) -> Array:
        return _within(depth(xy), -0.05, 0.5) * np.clip(2.0 * beds(xy) - 0.3, 0, 1)

    def cattail(xy: Array) -> Array:
        return _within(depth(xy), 0.02, 0.35) * np.clip(-1.5 * beds(xy) - 0.6, 0, 1)

    def sedge(xy: Array) -> Array:
        return _within(inland(xy), 0.45, 2.4) * np.clip(0.55 + 0.7 * thin(xy), 0, 1)

    return {
        "reed_1": reed,
        "cattail_2": cattail,
        "sedge_3": sedge,
        "meadow_4": lambda xy: turf(xy, 0.5, 0.3 + 0.7 * swathe(xy) + 0.25 * thin(xy)),
        "dry_5": lambda xy: turf(xy, 2.0, -0.15 - 0.7 * swathe(xy) + 0.4 * thin(xy)),
        "nettle_6": lambda xy: turf(xy, 2.0, 1.3 * beds(xy) - 1.2),
        "meadow_7": lambda xy: turf(xy, 0.5, 0.6 - 0.3 * swathe(xy)),
    }


def _within(value: Array, low: float, high: float) -> Array:
    """1 between two bounds, 0 outside."""
    return np.asarray((value > low) & (value < high), np.float64)


SPACING: Final = 7.0  # [m] mean distance between positions where a far tree may stand
WOODS_RADIUS: Final = 380.0  # [m] from the centre to the last trees
AREA: Final = (900.0, 900.0)  # [m] over which groves and woods vary


def make_lake_backdrop(builder: WorldBuilder, basin: Land, level: float, rng: np.random.Generator) -> Mesh:
    """The lake's bed and far shores: mud below the water where triangles are small enough, meadow elsewhere."""

    def cover(x: Array, y: Array, _slope: Array) -> Index:
        return np.asarray((basin(x, y) < level + 0.1) & (np.hypot(x, y) < 110.0), np.intp)

    return make_backdrop(builder.field, builder.size, ("meadow", "mud"), rng, land=basin, cover=cover)


def ground_height(builder: WorldBuilder, backdrop: Mesh) -> Callable[[Array], Array]:
    """Height [m] of the ground as a function of positions (n, 2), inside the world and beyond its edge."""
    beyond, half = height_beyond(builder.field, builder.size, backdrop), np.array(builder.size) / 2

    def height(xy: Array) -> Array:
        inside = np.asarray((np.abs(xy) < half).all(axis=1))
        x, y = np.where(inside[:, None], 2 * half, xy).T  # any valid position where the value is not used
        return np.where(inside, builder.field.height_at(*xy.T), beyond(x, y))

    return height


def scatter_far_plants(
    builder: WorldBuilder, config: Config, backdrop: Mesh, basin: Land, line: PowerLine, rng: np.random.Generator
) -> list[FarSwarm]:
    """Groves and grass near the edge, woods along the far shore and on its hills."""
    planter, level = config.planter, config.water_level
    far_trees, near_trees, grass = (planter.grow(group, rng) for group in ("far_tree", "near_tree", "far_grass"))
    grove, wood = noise_map(AREA, 45.0, rng), noise_map(AREA, 110.0, rng)

    def above_water(xy: Array) -> Array:
        return np.asarray(basin(*xy.T) - level)

    def near(xy: Array) -> Array:
        height, thick = above_water(xy), grove(xy)
        wooded = ((height > 0.5) & (height < 1.6) & (thick > 0.1)) | ((height > 2.0) & (thick > 0.35))
        return (wooded & (line.distance(xy) > BELOW_WIRES + 1.0)).astype(np.float64)

    def turf(xy: Array) -> Array:
        return np.asarray((above_water(xy) > 0.8) * np.clip(0.45 + 0.4 * grove(xy), 0.0, 1.0))

    def scrub(xy: Array) -> Array:
        return np.clip(0.8 * grove(xy) + 0.25 * (above_water(xy) > 0.5), 0.0, 1.0) * (above_water(xy) > 0.4)

    bushes = planter.grow("far_bush", rng)
    grass_spec, tree_spec = planter.swarm("high_grass_beyond", grass), planter.swarm("trees_beyond", near_trees)
    scrub_spec = planter.swarm("scrub_beyond", bushes)
    size, ground = builder.size, height_beyond(builder.field, builder.size, backdrop)
    return [
        scatter_beyond(size, ground, grass_spec, rng, within=14.0, margin=0.6, density=turf),
        scatter_beyond(size, ground, tree_spec, rng, within=90.0, margin=3.0, density=near),
        _far_woods(far_trees, basin, level, grove, wood, rng),
        scatter_beyond(size, ground, scrub_spec, rng, within=98.0, margin=5.0, density=scrub),
    ]


def _far_woods(
    trees: Sequence[Mesh], basin: Land, level: float, grove: Density, wood: Density, rng: np.random.Generator
) -> FarSwarm:
    """Trees in a belt along the far water and in woods above it, outside the blend from the world's edge.

    Draws independent positions, a third of them in groups of three, a number for each, scales, yaws, meshes and tints.
    """
    xy = rng.uniform(-WOODS_RADIUS, WOODS_RADIUS, (round((2 * WOODS_RADIUS / SPACING) ** 2), 2))
    third = len(xy) // 9
    xy[: 3 * third] = np.repeat(xy[:third], 3, axis=0) + rng.normal(0.0, 2.5, (3 * third, 2))
    height = basin(*xy.T)
    above, away = height - level, np.hypot(*xy.T)
    thick = np.where(above < 3.2, 0.75 + 0.3 * grove(xy), 0.45 + 0.5 * wood(xy))
    wooded = (above > 0.3) & (away > 115.0) & (away < WOODS_RADIUS) & (rng.random(len(xy)) < np.clip(thick, 0.04, 1))
    xy, height = xy[wooded], height[wooded]
    n = len(xy)
    scale = random_scales(rng, (0.45, 1.45), n)
    poses = upright_poses(xy, rng.uniform(0.0, 2 * np.pi, n), scale)
    poses[:, 2, 3] = height - 0.4  # the land's triangles are large there
    return make_swarm("woods_beyond", "tree", trees, poses, rng, tint=0.12), trees


def build(seed: int, corridors: Sequence[Line], config: Config) -> World:
    """Build a lake's shore; ``corridors`` stay dry and free of obstacles. The same arguments give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    seeds = np.random.SeedSequence(seed).spawn(10)
    shape, wires, growth, trees, bushes, grass, cover, land = (np.random.default_rng(s) for s in seeds[:8])
    microrelief, layer = (np.random.default_rng(s) for s in seeds[9].spawn(2))
    shore = make_shore(config, corridors, shape, microrelief)
    builder = WorldBuilder(shore.field, config.size, (), corridors)
    stand_objects(builder, config.objects, class_table(config.classes))
    basin = basin_heights(config, land)
    backdrop = make_lake_backdrop(builder, basin, config.water_level, land)
    _add_water(builder, config.water_level)
    line = string_line(builder, config, ground_height(builder, backdrop), wires)
    plant_trees(builder, shore, line, config, growth, trees)
    plant_bushes(builder, shore, config, bushes)
    plant_grass(builder, shore, config, grass)
    terrain = with_layer(cover_ground(builder, shore, cover), layer)
    far = [*line.beyond, *scatter_far_plants(builder, config, backdrop, basin, line, land)]
    return assemble(
        builder,
        terrain,
        name="lake",
        seed=seed,
        textures=seeds[8],
        backdrop=backdrop,
        beyond=far,
        litter=config.litter,
        objects=config.objects,
    )


def _add_water(builder: WorldBuilder, level: float) -> None:
    """Add one flat sheet that extends below the land, so that the water's edge is where the ground meets it."""
    x, y = (np.linspace(low, high, 25) for low, high in ((-900.0, 900.0), (-900.0, 40.0)))
    add_water(builder, level, [(make_flat_sheet("lake", x, y), level)])
    builder.instances[-1] = replace(builder.instances[-1], name="lake_1")

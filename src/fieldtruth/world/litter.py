# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Litter on the ground: leaves, twigs, cones, stones, tufts of short grass, as patches of shared meshes.

Patches lie on the surface that rays meet, in its mean slope. They have the class of the ground they lie on: those of a
trail lie wholly on it, the others wholly beside. Wheels do not feel them.

A shape makes n of a kind at once, as one surface: curled leaves, blades, twigs, stones.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final, Literal

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.experiment.fields import Positive
from fieldtruth.world.library import Entry, Section, validated
from fieldtruth.world.materials import GROUND_TYPES, MATERIALS
from fieldtruth.world.model import LITTER, Mesh, Swarm, Terrain, water_at
from fieldtruth.world.placement import WorldBuilder, jittered_grid, make_swarm, rotations_to, upright_poses
from fieldtruth.world.plants.grasses import discs, kites, spindles
from fieldtruth.world.plants.growth import Surface, gathered, merged, unit

Shape = Callable[[Array, Array, np.random.Generator], Surface]
"""Surface of n objects at foots (n, 3) [m] on level ground with sizes (n,) [m], their greatest extent."""
_GOLDEN: Final = (1.0 + np.sqrt(5.0)) / 2.0
_BALL: Final = unit(np.array([[s, t * _GOLDEN, 0.0] for s in (-1, 1) for t in (-1, 1)]))
_CORNERS: Final = np.concatenate([_BALL, np.roll(_BALL, 1, axis=1), np.roll(_BALL, 2, axis=1)])
"""Corners (12, 3) of an icosahedron."""


def _triangles() -> list[list[int]]:
    """Faces of the icosahedron: corners that are neighbours of each other, counterclockwise from outside."""
    near = np.linalg.norm(_CORNERS[:, None] - _CORNERS, axis=-1) < 1.1
    found = [(a, b, c) for a, b, c in combinations(range(12), 3) if near[a, b] and near[b, c] and near[a, c]]
    return [[a, b, c] if np.linalg.det(_CORNERS[[a, b, c]]) > 0 else [a, c, b] for a, b, c in found]


_FACES: Final = _triangles()


def leaves(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Dead leaves that lie askew: folded along the midrib, tips and margins bent up or down; two halves each."""
    n = len(foot)
    ahead, side, up = _askew(n, 18.0, rng)
    width = size * rng.uniform(0.38, 0.62, n)
    curl, fold = rng.normal(0.0, 0.12, n) * size, np.abs(rng.normal(0.12, 0.12, n)) * size
    flip = np.where(rng.random(n) < 0.5, -1.0, 1.0)
    rows = []
    for sign in (1.0, -1.0):
        for along, out, high in ((-0.5, 0.0, 1.0), (-0.2, 0.9, 0.0), (0.22, 0.75, 0.0), (0.5, 0.0, 1.0)):
            z = flip * (high * curl + (1.0 - high) * fold) + 0.25 * size * rng.normal(0.0, 0.25, n)
            rows.append(
                foot
                + (along * size)[:, None] * ahead
                + (0.5 * sign * out * width)[:, None] * side
                + (z + 0.3 * fold)[:, None] * up
            )
    vertices = np.stack(rows, axis=1)
    tilt = (0.5 * flip * fold / np.maximum(width, 1e-6))[:, None] * side
    normals = unit(np.stack([up - tilt] * 4 + [up + tilt] * 4, axis=1))
    half = [[0.5, 0.03], [0.96, 0.3], [0.9, 0.7], [0.5, 0.97]]
    uv = np.broadcast_to([*half, *([1.0 - u, v] for u, v in half)], (n, 8, 2))
    return gathered(vertices, normals, uv, [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]])


def blades(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Blades of grass in tufts of four, from upright to lying."""
    n = len(foot)
    tuft = np.repeat(rng.normal(0.0, 0.008, (n, 1, 2)), 4, axis=1) + rng.normal(0.0, 0.006, (n, 4, 2))
    base = np.concatenate([np.repeat(foot[:, None, :2], 4, axis=1) + tuft, np.full((n, 4, 1), -0.012)], axis=2)
    lean = np.radians(rng.uniform(12.0, 75.0, (n, 4)))
    turn = rng.uniform(0.0, 2.0 * np.pi, (n, 4))
    direction = np.stack([np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn), np.cos(lean)], axis=-1)
    length = (size[:, None] * rng.uniform(0.5, 1.0, (n, 4)) + 0.012).ravel()
    upper = np.broadcast_to([0.1, 0.05, 1.0], (4 * n, 3))
    return kites(base.reshape(-1, 3), direction.reshape(-1, 3), upper, length, np.full(4 * n, 0.005), 0.35)


def stems(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Needles and dry stalks that lie about, a tenth as wide as a leaf."""
    n = len(foot)
    ahead, _, up = _askew(n, 9.0, rng)
    return kites(foot - 0.5 * size[:, None] * ahead, ahead, up, size, np.maximum(0.02 * size, 0.0016), 0.5)


def flakes(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Pieces of bark and husks."""
    n = len(foot)
    ahead, _, up = _askew(n, 8.0, rng)
    return kites(foot - 0.5 * size[:, None] * ahead, ahead, up, size, size * rng.uniform(0.3, 0.7, n), 0.45)


def clover(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Three leaflets of a ``size`` on a stalk too thin to be seen."""
    n = len(foot)
    turn = rng.uniform(0.0, 2.0 * np.pi, n)[:, None] + 2.0 * np.pi * np.arange(3) / 3
    direction = unit(np.stack([np.cos(turn), np.sin(turn), rng.uniform(-0.1, 0.4, (n, 3))], axis=-1)).reshape(-1, 3)
    base = np.repeat(foot + np.array([0.0, 0.0, 0.022]), 3, axis=0)
    upper = np.broadcast_to([0.0, 0.0, 1.0], (3 * n, 3))
    return kites(base, direction, upper, np.repeat(size, 3), 0.9 * np.repeat(size, 3), 0.6)


def flowers(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Daisies that face the sky."""
    n = len(foot)
    normal = unit(np.concatenate([rng.normal(0.0, 0.25, (n, 2)), np.ones((n, 1))], axis=1))
    return discs(foot + np.array([0.0, 0.0, 0.04]), normal, 0.5 * size)


def twigs(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Twigs, an eightieth to a thirtieth as thick as long, in two straight pieces."""
    n = len(foot)
    ahead, side, up = _askew(n, 4.0, rng)
    thick = np.maximum(size * rng.uniform(1 / 80, 1 / 30, n), 0.002)
    bend = unit(ahead + rng.normal(0.0, 0.35, (n, 1)) * side + np.abs(rng.normal(0.0, 0.08, (n, 1))) * up)
    middle = foot + (0.3 * thick)[:, None] * up
    ends = middle - 0.55 * size[:, None] * ahead, middle + 0.45 * size[:, None] * bend
    joint = middle - 0.05 * size[:, None] * ahead
    low, high = np.concatenate([ends[0], joint]), np.concatenate([middle, ends[1]])
    return spindles(low, high, np.concatenate([0.5 * thick, 0.42 * thick]))


def stones(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Stones of twenty faces, flat and irregular, a third in the ground."""
    n = len(foot)
    axes = 0.5 * size[:, None] * np.stack([np.ones(n), rng.uniform(0.6, 0.95, n), rng.uniform(0.35, 0.7, n)], axis=1)
    ball = _CORNERS * rng.uniform(0.78, 1.12, (n, 12, 1))
    return _turned(foot + np.array([0.0, 0.0, 0.22]) * axes[:, 2:], ball, axes, rng)


def cones(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Fallen cones, half as thick as long."""
    n = len(foot)
    axes = 0.5 * size[:, None] * np.array([1.0, 0.5, 0.5])
    return _turned(foot + np.array([0.0, 0.0, 0.8]) * axes[:, 2:], np.tile(_CORNERS, (n, 1, 1)), axes, rng)


def _turned(middle: Array, ball: Array, axes: Array, rng: np.random.Generator) -> Surface:
    """Ellipsoids (n, 12, 3) with half axes (n, 3) [m], turned about the vertical."""
    turn = rng.uniform(0.0, 2.0 * np.pi, len(middle))
    cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]

    def rotated(v: Array) -> Array:
        return np.stack([cosine * v[..., 0] - sine * v[..., 1], sine * v[..., 0] + cosine * v[..., 1], v[..., 2]], -1)

    vertices = middle[:, None] + rotated(ball * axes[:, None])
    normals = unit(rotated(ball / axes[:, None]))
    uv = 8.0 * vertices[..., :2] + rng.random((len(middle), 1, 2))
    return gathered(vertices, normals, uv, _FACES)


def _askew(n: int, tilt_deg: float, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Axes ahead, aside and up (n, 3) of objects that lie in any direction, up to about ``tilt_deg`` from level."""
    turn, tilt = rng.uniform(0.0, 2.0 * np.pi, n), np.tan(np.radians(tilt_deg)) * rng.normal(0.0, 0.6, (n, 2))
    up = unit(np.concatenate([tilt, np.ones((n, 1))], axis=1))
    level = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)
    ahead = unit(level - (level * up).sum(axis=1, keepdims=True) * up)
    return ahead, np.cross(up, ahead), up


SHAPES: Final[Mapping[str, Shape]] = {
    each.__name__: each for each in (leaves, blades, stems, flakes, clover, flowers, twigs, stones, cones)
}
VARIANTS: Final = 6
"""Patches of each cover; with four quarter turns each is seen in 24 poses."""
NEAR: Final = 5.0
"""Distance [m] from a trail or a corridor within which there are most patches."""
FAR_SHARE: Final = 0.25
"""Share of the patches that remains far from them."""
MOST_AREA: Final = 20_000.0
"""Area [m^2] of a world from which the number of patches stops growing."""
UNDER_TREES: Final = 3.0
"""Distance [m] from a trunk over which fallen leaves become few."""
_TREE: Final = 2.5  # [m] least height
_AT_EDGE: Final = 0.3  # [m] from a trail's edge
_TINT: Final = 0.13
_SCALE: Final = 0.2  # greatest logarithm of a patch's scale
_SAMPLES: Final = 12  # of the surface below a patch
_BEARING: Final = 0.75


@dataclass(frozen=True)
class Item:
    """Leaves, stones or the like in a patch: least and greatest size [m], small ones more frequent; number per m2."""

    shape: str
    material: str
    sizes: tuple[Positive, Positive]
    per_m2: Positive


@dataclass(frozen=True)
class Cover:
    """Patches of items on a type of ground."""

    per_m2: Positive
    items: tuple[Item, ...]
    radius: Positive = 0.2  # [m]
    where: Literal["everywhere", "under trees", "at edges"] = "everywhere"


def _covers(name: str, entry: Entry, source: str) -> tuple[Cover, ...]:
    if name not in GROUND_TYPES:
        raise ConfigurationError(f"{source}: unknown ground type {name!r}; {suggestion(name, GROUND_TYPES)}")
    patches = entry.get("patches")
    if not isinstance(patches, list) or len(entry) > 1:
        raise ConfigurationError(f"{source} must have one key, patches, a list, got {entry!r}")
    covers = tuple(validated(Cover, each, f"{source}.patches[{k}]") for k, each in enumerate(patches))
    for item in (item for cover in covers for item in cover.items):
        if item.shape not in SHAPES:
            raise ConfigurationError(f"{source}: unknown shape {item.shape!r}; {suggestion(item.shape, SHAPES)}")
        for material in (f"litter_{item.material}", f"trail_{item.material}"):
            if material not in MATERIALS:
                raise ConfigurationError(f"{source}: no material {material}")
    return covers


LITTER_BY_GROUND: Final = Section("litter", _covers)
"""Covers by ground type, from the ``litter`` sections of the data files; ground of other types is bare."""


def scatter_litter(
    builder: WorldBuilder, terrain: Terrain, amount: float, rng: np.random.Generator
) -> list[tuple[Swarm, list[Mesh]]]:
    """Swarms of patches, off the trails and on them, with their meshes; ``amount`` scales their number."""
    area = builder.size[0] * builder.size[1]
    amount = amount * min(1.0, MOST_AREA / area)
    ground = [MATERIALS[name].ground_type for name in terrain.ground_materials]
    trail = MATERIALS[terrain.trail_material].ground_type if builder.trails and terrain.trail_material else ""
    trodden = {MATERIALS[n].ground_type for n in terrain.ground_materials if MATERIALS[n].label == Label.TRAIL}
    found: dict[bool, list[tuple[list[Mesh], Array]]] = {False: [], True: []}
    kinds = [
        (each, each in trodden, np.array([each == g for g in ground], np.float64)) for each in dict.fromkeys(ground)
    ]
    for name, on_trail, share in [*kinds, (trail, True, None)]:
        for row, cover in enumerate(LITTER_BY_GROUND.get(name, ())):
            meshes = [
                _patch(f"{name}_{row}_{k}{'_on_trail' * (on_trail and trail in ground)}", cover, rng, on_trail=on_trail)
                for k in range(VARIANTS)
            ]
            xy = _positions(builder, terrain, cover, share, amount, rng, on_trail=on_trail)
            found[on_trail].append((meshes, _poses(terrain, xy, cover.radius, rng)))
    return [
        _swarm("trail_litter" if on_trail else "ground_litter", parts, rng)
        for on_trail, parts in found.items()
        if sum(len(poses) for _, poses in parts)
    ]


def _patch(name: str, cover: Cover, rng: np.random.Generator, *, on_trail: bool) -> Mesh:
    """Items in a disc, denser towards its middle."""
    surfaces, rows, names = [], list[int](), list[str]()
    for item in cover.items:
        n = max(1, int(rng.poisson(item.per_m2 * np.pi * cover.radius**2)))
        low, high = item.sizes
        size = low * (high / low) ** (rng.random(n) ** 1.7)
        out, turn = cover.radius * rng.random(n) ** 0.6, rng.uniform(0.0, 2.0 * np.pi, n)
        foot = np.stack([out * np.cos(turn), out * np.sin(turn), np.zeros(n)], axis=1)
        surface = SHAPES[item.shape](foot, size, rng)
        material = f"{'trail' if on_trail else 'litter'}_{item.material}"
        if material not in names:
            names.append(material)
        surfaces.append(surface)
        rows += [names.index(material)] * len(surface[3])
    return merged(f"litter_{name}", surfaces, np.array(rows), names, footprint=cover.radius)


def _positions(
    builder: WorldBuilder,
    terrain: Terrain,
    cover: Cover,
    share: Array | None,
    amount: float,
    rng: np.random.Generator,
    *,
    on_trail: bool,
) -> Array:
    """Positions (n, 2) [m] of patches on ground of which ``share`` (materials,) is the type; None: any."""
    trees = _trees(builder) if cover.where == "under trees" else None

    def density(xy: Array) -> Array:
        edge = terrain.trail_distance.at(*xy.T)
        inside = edge < -(terrain.border_width + cover.radius) if on_trail else edge > cover.radius
        keep = inside * (1.0 if share is None else terrain.cover.at(*xy.T) @ share)
        if builder.water_level is not None:
            keep *= terrain.surface.height_at(*xy.T) > water_at(builder.water_level, *xy.T) + 0.03
        if trees is not None:
            keep *= np.exp(-((trees.query(xy)[0] / UNDER_TREES) ** 2)) if trees.n else 0.0
        if cover.where == "at edges":
            away = (edge + terrain.border_width + cover.radius) / _AT_EDGE
            return np.asarray(keep * np.exp(np.minimum(away, 50.0)))  # without trails the edge is far away
        return np.asarray(keep * (FAR_SHARE + (1.0 - FAR_SHARE) * _nearness(builder, edge, xy)))

    xy = jittered_grid(np.array(builder.size) - 2.0 * cover.radius, amount * cover.per_m2, rng, density)
    return xy[builder.off_solids(xy, 0.0)]


def _nearness(builder: WorldBuilder, edge: Array, xy: Array) -> Array:
    away = np.maximum(edge, 0.0) if builder.trails else np.full(len(xy), np.inf)
    for line in builder.corridors:
        away = np.minimum(away, line.distance(xy))
    return np.asarray(np.exp(-((away / NEAR) ** 2)))


def _trees(builder: WorldBuilder) -> cKDTree:
    high = {name for name, mesh in builder.meshes.items() if mesh.species and mesh.vertices[:, 2].max() > _TREE}
    return cKDTree(np.array([i.world_from_object[:2, 3] for i in builder.instances if i.mesh in high]).reshape(-1, 2))


def _poses(terrain: Terrain, xy: Array, radius: float, rng: np.random.Generator) -> Array:
    """Poses (n, 4, 4) on the plane through the surface around the patch, in quarter turns: narrow bounding boxes.

    Leaves lie on the bumps of grass and litter, not on their mean: a share of what is around remains above.
    """
    n, turn, x, y = len(xy), 2.0 * np.pi * np.arange(_SAMPLES) / _SAMPLES, xy[:, :1], xy[:, 1:]
    out = radius * np.where(np.arange(_SAMPLES) % 2, 0.4, 0.85)
    dx, dy = out * np.cos(turn), out * np.sin(turn)
    z = terrain.surface.height_at(x + dx, y + dy)
    slopes = z @ np.linalg.pinv(np.column_stack([dx, dy, np.ones(_SAMPLES)])).T  # (n, 3) of the plane through them
    above = np.quantile(z - slopes @ np.stack([dx, dy, np.ones(_SAMPLES)]), _BEARING, axis=1)
    poses = upright_poses(
        xy, (np.pi / 2) * rng.integers(4, size=n).astype(np.float64), np.exp(rng.uniform(-_SCALE, _SCALE, n))
    )
    poses[:, :3, :3] = rotations_to(np.column_stack([-slopes[:, :2], np.ones(n)])) @ poses[:, :3, :3]
    poses[:, 2, 3] = slopes[:, 2] + above
    return poses


def _swarm(name: str, parts: Sequence[tuple[list[Mesh], Array]], rng: np.random.Generator) -> tuple[Swarm, list[Mesh]]:
    meshes = [mesh for own, _ in parts for mesh in own]
    rows = np.concatenate(
        [VARIANTS * k + rng.integers(VARIANTS, size=len(poses)) for k, (_, poses) in enumerate(parts)]
    )
    poses = np.concatenate([own for _, own in parts])
    return make_swarm(name, LITTER, meshes, poses, rng, tint=_TINT, rows=rows), meshes

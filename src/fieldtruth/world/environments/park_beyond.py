# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The park beyond its edge: the trails go on between rows of trees, groups stand in the grass, woods close the view."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Land, height_beyond, make_backdrop, rolling_hills, strew_beyond
from fieldtruth.world.grids import distance_beyond
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh, Swarm, Terrain, merge_meshes
from fieldtruth.world.placement import Site, random_tints, upright_poses
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_clump, grow_tree
from fieldtruth.world.trails import Line, Trail

Strewn = tuple[Swarm, Sequence[Mesh]]

REACH: Final = 62.0
"""Distance [m] from the edge within which single trees stand and the trails go on."""
WOODS_FROM, WOODS_TO = 95.0, 260.0
"""Distance [m] from the edge of the nearest woods, and that of the last trees that stand at their rims as trees."""
EAVES, ROOF = 4.0, 10.5
"""Height [m] of a wood's mean roof at its rim, where trees hide it, and inside."""
NEAR: Final = 20.0
"""Distance [m] from the edge within which trees are drawn finer: from inside their leaves could be told apart."""
NEAR_DETAIL, DETAIL, BUSH_DETAIL = 0.12, 0.045, 0.25
SPECIES_BEYOND: Final = ("lime", "birch", "oak", "beech", "lime", "oak", "spruce", "pine")
LIFT: Final = 0.015  # [m] of a trail above the land's triangles at the edge, and 1 mm more with every metre
STEP: Final = 0.05  # [m] between the points of a trail's line


def make_land(size: tuple[float, float], rng: np.random.Generator) -> tuple[Land, Land, Land]:
    """Rolling land, the same with the roofs of its woods, and how far places are inside a wood (above 0; no unit)."""
    hills = rolling_hills(size, rng, height=11.0)
    broad, crowns = _waves(110.0, 260.0, rng), _waves(6.0, 26.0, rng)

    def wood(x: Array, y: Array) -> Array:
        off = distance_beyond(size, x, y)
        # Woods are islands near the park, and nearly everywhere at the horizon.
        thick = broad(x, y) - 0.35 + 2.0 * np.clip((off - 200.0) / 500.0, 0.0, 1.0)
        return np.asarray(np.minimum(thick, (off - WOODS_FROM) / 25.0))

    def wooded(x: Array, y: Array) -> Array:
        inside = wood(x, y)
        roof = EAVES + (ROOF - EAVES) * np.clip(inside / 0.4, 0.0, 1.0) + 1.2 * crowns(x, y)
        return np.asarray(hills(x, y) + (inside > 0) * np.maximum(roof, 0.7 * EAVES))

    return hills, wooded, wood


def _waves(shortest: float, longest: float, rng: np.random.Generator) -> Land:
    """Noise of unit deviation over the whole land: waves of these lengths [m] that run in all directions."""
    count = 16
    length, turn, phase = (rng.uniform(*pair, count) for pair in ((shortest, longest), (0.0, 6.3), (0.0, 6.3)))
    along_x, along_y = 2.0 * np.pi * np.cos(turn) / length, 2.0 * np.pi * np.sin(turn) / length

    def noise(x: Array, y: Array) -> Array:
        waves = (np.cos(a * x + b * y + c) for a, b, c in zip(along_x, along_y, phase, strict=True))
        return np.asarray(sum(waves) / np.sqrt(count / 2))

    return noise


def grow_beyond(site: Site, terrain: Terrain, share: float, rng: np.random.Generator) -> tuple[Mesh, list[Strewn]]:
    """The land down to the horizon, and what stands on it; ``share`` thins its trees and bushes, 0 is none."""
    hills, wooded, wood = make_land(site.size, rng)

    def cover(x: Array, y: Array, slope: Array) -> NDArray[np.intp]:
        inside = wood(x, y)
        return ((inside > 0) | ((inside > -0.4) & (slope > 0.3))).astype(np.intp)

    backdrop = make_backdrop(site.field, site.size, ("meadow", "canopy"), rng, land=wooded, cover=cover)
    lines = [line for trail in site.trails for line in _continued(trail, site.size, rng)]
    ground = height_beyond(site.field, site.size, backdrop)
    beyond: list[Strewn] = []
    if lines:
        ribbons = _ribbons(lines, site.trails[0].width, terrain, site.size, ground)
        backdrop = merge_meshes("backdrop", [backdrop, *ribbons], footprint=backdrop.footprint)
    if share > 0:
        near, far = (_individuals(name, detail, rng) for name, detail in (("near", NEAR_DETAIL), ("far", DETAIL)))
        rows = _rows(lines, share, rng)
        off = distance_beyond(site.size, *rows.T)
        beyond += [
            _planted("avenues_near", near, rows[off < NEAR], ground, 0.1, rng),
            _planted("avenues_beyond", far, rows[off >= NEAR], ground, 0.1, rng),
            _rims(far, hills, wood, site.size, share, rng),
            *_groups(site, backdrop, lines, near, far, share, rng),
        ]
    return backdrop, beyond


def _individuals(name: str, detail: float, rng: np.random.Generator) -> list[Mesh]:
    """One tree of each species, or two."""
    return [
        grow_tree(TREES[kind], name=f"{name}_{kind}_{k}", height=float(rng.uniform(8.5, 14.0)), rng=rng, detail=detail)
        for k, kind in enumerate(SPECIES_BEYOND)
    ]


def _continued(trail: Trail, size: tuple[float, float], rng: np.random.Generator) -> list[Line]:
    """What lies beyond the edge of a trail that leaves the world, led on for ``REACH`` [m] in an easy bend."""
    half = np.array(size) / 2
    lines = []
    for points in (trail.line.points, trail.line.points[::-1]):
        outside = np.asarray((np.abs(points) > half).any(axis=1))
        if not outside[-1]:
            continue
        first = len(points) - int(np.argmax(~outside[::-1])) - round(2.0 * trail.width / STEP)
        step = float(np.linalg.norm(points[-1] - points[-2]))
        heading = np.arctan2(*(points[-1] - points[-2])[::-1])
        s = np.arange(step, REACH, step)
        heading = heading + 0.5 * rng.choice([-1.0, 1.0]) * np.sin(s / REACH * rng.uniform(1.5, 3.5)) ** 2
        on = points[-1] + np.cumsum(step * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        whole = np.concatenate([points[max(first, 0) :], on])
        tangents = np.gradient(whole, axis=0)
        lines.append(Line(whole, tangents / np.linalg.norm(tangents, axis=1, keepdims=True)))
    return lines


def _ribbons(
    lines: Sequence[Line], width: float, terrain: Terrain, size: tuple[float, float], ground: Land
) -> list[Mesh]:
    """The trails as they look inside, clipped at the world's edge, a little above the land's triangles."""
    half, border = width / 2, terrain.border_width
    bands = [(-half, border - half, terrain.border_material), (half - border, half, terrain.border_material)]
    across: list[float] = np.linspace(border - half, half - border, 5).tolist()
    bands += [(low, high, terrain.trail_material) for low, high in pairwise(across)]
    return [_ribbon(line, low, high, name, size, ground) for line in lines for low, high, name in bands]


def _ribbon(line: Line, low: float, high: float, material: str, size: tuple[float, float], ground: Land) -> Mesh:
    """A band between two distances [m] to the left of a line; what would lie inside the world is drawn to its edge."""
    rows = np.arange(0, len(line.points), 5)
    left = np.stack([-line.tangents[rows, 1], line.tangents[rows, 0]], axis=1)
    places = np.stack([line.points[rows] + low * left, line.points[rows] + high * left], axis=1).reshape(-1, 2)
    half = np.array(size) / 2
    short = half - np.abs(places)  # to the edge, along x and y
    inside = (short > 0).all(axis=1)
    axis = np.argmin(short, axis=1)
    moved = np.where(places[np.arange(len(places)), axis] < 0, -half[axis], half[axis])
    places[inside, axis[inside]] = moved[inside]
    x, y = places.T
    k = 2 * np.arange(len(rows) - 1)
    faces = np.concatenate([np.stack([k, k + 2, k + 3], 1), np.stack([k, k + 3, k + 1], 1)])
    u, v = places[faces[:, 1]] - places[faces[:, 0]], places[faces[:, 2]] - places[faces[:, 0]]
    faces = faces[np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) > 1e-9]
    height = ground(x, y) + LIFT + 0.001 * distance_beyond(size, x, y)
    return Mesh(
        name=material,
        vertices=np.column_stack([x, y, height]).astype(np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (len(x), 1)),
        uv=(places / MATERIALS[material].repeat).astype(np.float32),
        faces=faces.astype(np.int32),
        material=np.zeros(len(faces), np.int32),
        materials=(material,),
    )


def _rows(lines: Sequence[Line], share: float, rng: np.random.Generator) -> Array:
    """Places (n, 2) of avenues: trees on both sides of the trails, with gaps where one fell."""
    places = [
        line.points[row] + side * 3.4 * np.array([-line.tangents[row, 1], line.tangents[row, 0]])
        for line in lines
        for side in (-1.0, 1.0)
        for row in range(220, len(line.points), 170)
        if rng.random() < 0.8 * share
    ]
    return np.array(places).reshape(-1, 2) + rng.normal(0.0, 0.25, (len(places), 2))


def _rims(
    trees: Sequence[Mesh], hills: Land, wood: Land, size: tuple[float, float], share: float, rng: np.random.Generator
) -> Strewn:
    """Trees along the rims of the woods: they hide that a far wood is a roof with walls."""
    cell, reach = 7.5, WOODS_TO + max(size) / 2
    axis = np.arange(-reach, reach, cell)
    places = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    places = places + rng.uniform(0.0, cell, places.shape)
    x, y = places.T
    off = distance_beyond(size, x, y)
    inside = wood(x, y)
    rim = (inside < 0.1) & (inside > -0.16) & (off > WOODS_FROM - 6) & (off < WOODS_TO)
    lone = (inside <= -0.16) & (off > 70.0) & (off < 220.0) & (rng.random(len(places)) < 0.02)
    spots = places[(rim | lone) & (rng.random(len(places)) < share)]
    return _planted("woods_beyond", trees, spots, hills, 0.4, rng)


def _planted(
    name: str, trees: Sequence[Mesh], places: Array, land: Land, sink: float, rng: np.random.Generator
) -> Strewn:
    """A swarm of trees at places (n, 2), ``sink`` [m] in the soil."""
    n = len(places)
    poses = upright_poses(places, rng.uniform(0.0, 2 * np.pi, n), np.exp(rng.uniform(np.log(0.7), np.log(1.25), n)))
    poses[:, 2, 3] = land(*places.T) - sink
    swarm = Swarm(
        name=name, kind="tree", object_id=0, meshes=tuple(mesh.name for mesh in trees),
        mesh=rng.integers(len(trees), size=n).astype(np.int32), world_from_object=poses, tint=random_tints(rng, 0.1, n),
    )  # fmt: skip
    return swarm, trees


def _groups(
    site: Site, backdrop: Mesh, lines: Sequence[Line], near: Sequence[Mesh], far: Sequence[Mesh], share: float,
    rng: np.random.Generator,
) -> list[Strewn]:  # fmt: skip
    """Loose groups of trees and bushes, and long grass between them, off the trails."""
    grove, thicket = _waves(24.0, 60.0, rng), _waves(9.0, 20.0, rng)

    def off_trails(places: Array, clear: float) -> NDArray[np.bool_]:
        return np.asarray(np.logical_and.reduce([np.ones(len(places), bool), *(
            line.distance(places) > clear for line in lines)]))  # fmt: skip

    def woods(places: Array) -> Array:
        return np.asarray(np.clip(0.35 + 0.6 * grove(*places.T), 0.03, 1.0) * off_trails(places, 5.0) * share)

    def bushes(places: Array) -> Array:
        return np.asarray(np.clip(thicket(*places.T) - 0.4, 0.0, 1.0) * off_trails(places, 3.0) * share)

    def grass(places: Array) -> Array:
        return np.asarray(np.clip(0.8 * thicket(*places.T) - 0.7, 0.0, 0.8) * off_trails(places, 2.2) * share)

    shrubs = [
        grow_bush(BUSHES[name], name=f"far_{name}", height=height, rng=rng, detail=BUSH_DETAIL)
        for name, height in (("hazel", 2.0), ("box", 1.0), ("bramble", 1.0))
    ]
    meadow = {GRASSES["meadow"]: 0.8, GRASSES["yarrow"]: 0.2}
    tufts = [
        grow_clump(meadow, name=f"far_meadow_{k}", radius=0.8, per_m2=7.0, rng=rng, size=0.2, detail=0.5)
        for k in range(3)
    ]
    field, size = site.field, site.size
    return [
        strew_beyond(
            field, size, backdrop, "trees_near", "tree", near, per_m2=0.007, rng=rng, within=NEAR, margin=4.0,
            density=woods, scales=(0.6, 1.2), sink=0.1,
        ),
        strew_beyond(
            field, size, backdrop, "trees_beyond", "tree", far, per_m2=0.011, rng=rng, within=REACH, margin=NEAR,
            density=woods, scales=(0.6, 1.2), sink=0.1,
        ),
        strew_beyond(
            field, size, backdrop, "bushes_beyond", "bush", shrubs, per_m2=0.022, rng=rng, within=40.0, margin=2.0,
            density=bushes, scales=(0.7, 1.3),
        ),
        strew_beyond(
            field, size, backdrop, "high_grass_beyond", "high_grass", tufts, per_m2=0.6, rng=rng, within=14.0,
            margin=1.0, density=grass, tilt=1.0,
        ),
    ]  # fmt: skip


__all__ = ["grow_beyond", "make_land"]

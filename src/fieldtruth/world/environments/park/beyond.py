# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The park beyond the world's edge: trails between rows of trees, groups of trees, woods in the distance."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.world.backdrop import Land, height_beyond, make_backdrop, rolling_hills, scatter_beyond
from fieldtruth.world.environments.park.config import Config
from fieldtruth.world.grids import Line, Trail, distance_beyond
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh, Terrain, make_mesh, merge_meshes
from fieldtruth.world.placement import FarSwarm, WorldBuilder, make_swarm, random_scales, upright_poses

TREES_TO: Final = 62.0
"""Distance [m] from the edge within which there are single trees and the trails continue."""
WOODS_FROM, WOODS_TO = 95.0, 260.0
"""Distance [m] from the edge of the nearest woods, and of the last single trees at their rims."""
EAVES, ROOF = 4.0, 10.5
"""Mean height [m] of a wood's canopy at its rim, where trees hide it, and inside."""
NEAR: Final = 20.0
"""Distance [m] from the edge within which trees have more detail, because single leaves are visible."""
LIFT: Final = 0.015  # [m] of a trail above the land's triangles at the edge, plus 1 mm per metre
STEP: Final = 0.05  # [m] between the points of a trail's line


def make_land(size: tuple[float, float], rng: np.random.Generator) -> tuple[Land, Land, Land]:
    """Heights of the rolling land without and with its woods, and a field that is positive inside woods (no unit)."""
    hills = rolling_hills(size, rng, height=11.0)
    broad, crowns = _waves(110.0, 260.0, rng), _waves(6.0, 26.0, rng)

    def wood(x: Array, y: Array) -> Array:
        outside = distance_beyond(size, x, y)
        # Single woods near the park, woods nearly everywhere at the horizon.
        thick = broad(x, y) - 0.35 + 2.0 * np.clip((outside - 200.0) / 500.0, 0.0, 1.0)
        return np.asarray(np.minimum(thick, (outside - WOODS_FROM) / 25.0))

    def wooded(x: Array, y: Array) -> Array:
        inside = wood(x, y)
        roof = EAVES + (ROOF - EAVES) * np.clip(inside / 0.4, 0.0, 1.0) + 1.2 * crowns(x, y)
        return np.asarray(hills(x, y) + (inside > 0) * np.maximum(roof, 0.7 * EAVES))

    return hills, wooded, wood


def _waves(shortest: float, longest: float, rng: np.random.Generator) -> Land:
    """Noise of unit deviation over the whole land: waves in random directions, of lengths between two bounds [m]."""
    count = 16
    length, turn, phase = (rng.uniform(*pair, count) for pair in ((shortest, longest), (0.0, 6.3), (0.0, 6.3)))
    along_x, along_y = 2.0 * np.pi * np.cos(turn) / length, 2.0 * np.pi * np.sin(turn) / length

    def noise(x: Array, y: Array) -> Array:
        waves = (np.cos(a * x + b * y + c) for a, b, c in zip(along_x, along_y, phase, strict=True))
        return np.asarray(sum(waves) / np.sqrt(count / 2))

    return noise


def make_surroundings(
    builder: WorldBuilder, terrain: Terrain, config: Config, rng: np.random.Generator
) -> tuple[Mesh, list[FarSwarm]]:
    """The land down to the horizon with its trails, and its swarms; ``config.beyond`` scales trees and bushes."""
    size, planter, share = builder.size, config.planter, float(config.beyond)
    hills, wooded, wood = make_land(size, rng)

    def cover(x: Array, y: Array, slope: Array) -> Index:
        inside = wood(x, y)
        return ((inside > 0) | ((inside > -0.4) & (slope > 0.3))).astype(np.intp)

    backdrop = make_backdrop(builder.field, size, ("meadow", "canopy"), rng, land=wooded, cover=cover)
    trails = [Trail(part, trail.width) for trail in builder.trails for part in trail.line.parts()]
    lines = [line for trail in trails for line in _continued(trail, size, rng)]
    ground = height_beyond(builder.field, size, backdrop)
    if lines:
        bands = _bands(builder.trails[0].width, terrain)
        ribbons = [_ribbon(line, band, size, ground) for line in lines for band in bands]
        backdrop = merge_meshes("backdrop", [backdrop, *ribbons], footprint=backdrop.footprint)
    if share == 0:
        return backdrop, []
    near, far = (planter.grow(group, rng) for group in ("near_tree", "far_tree"))
    avenues = _avenues(lines, share, rng)
    outside = distance_beyond(size, *avenues.T)
    return backdrop, [
        _tree_swarm("avenues_near", near, avenues[outside < NEAR], ground, 0.1, rng),
        _tree_swarm("avenues_beyond", far, avenues[outside >= NEAR], ground, 0.1, rng),
        _rims(far, hills, wood, size, share, rng),
        *_groups(size, ground, lines, (near, far), config, rng),
    ]


def _continued(trail: Trail, size: tuple[float, float], rng: np.random.Generator) -> list[Line]:
    """The part of a trail beyond the world's edge, continued for ``TREES_TO`` [m] in a slight bend."""
    half = np.array(size) / 2
    lines = []
    for points in (trail.line.points, trail.line.points[::-1]):
        outside = np.asarray((np.abs(points) > half).any(axis=1))
        if not outside[-1]:
            continue
        first = len(points) - int(np.argmax(~outside[::-1])) - round(2.0 * trail.width / STEP)
        step = float(np.linalg.norm(points[-1] - points[-2]))
        heading = np.arctan2(*(points[-1] - points[-2])[::-1])
        s = np.arange(step, TREES_TO, step)
        heading = heading + 0.5 * rng.choice([-1.0, 1.0]) * np.sin(s / TREES_TO * rng.uniform(1.5, 3.5)) ** 2
        on = points[-1] + np.cumsum(step * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        whole = np.concatenate([points[max(first, 0) :], on])
        tangents = np.gradient(whole, axis=0)
        lines.append(Line(whole, tangents / np.linalg.norm(tangents, axis=1, keepdims=True)))
    return lines


def _bands(width: float, terrain: Terrain) -> list[tuple[float, float, str]]:
    """Bands across a trail: distances [m] to the left of its centre line from and to, and material."""
    half, border = width / 2, terrain.border_width
    across: list[float] = np.linspace(border - half, half - border, 5).tolist()
    return [
        (-half, border - half, terrain.border_material),
        (half - border, half, terrain.border_material),
        *((low, high, terrain.trail_material) for low, high in pairwise(across)),
    ]


def _ribbon(line: Line, band: tuple[float, float, str], size: tuple[float, float], ground: Land) -> Mesh:
    """A band along a line, slightly above the land's triangles; vertices inside the world are moved to its edge."""
    low, high, material = band
    rows = np.arange(0, len(line.points), 5)
    left = np.stack([-line.tangents[rows, 1], line.tangents[rows, 0]], axis=1)
    xy = np.stack([line.points[rows] + low * left, line.points[rows] + high * left], axis=1).reshape(-1, 2)
    half = np.array(size) / 2
    short = half - np.abs(xy)  # to the edge, along x and y
    inside = (short > 0).all(axis=1)
    axis = np.argmin(short, axis=1)
    moved = np.where(xy[np.arange(len(xy)), axis] < 0, -half[axis], half[axis])
    xy[inside, axis[inside]] = moved[inside]
    x, y = xy.T
    k = 2 * np.arange(len(rows) - 1)
    faces = np.concatenate([np.stack([k, k + 2, k + 3], 1), np.stack([k, k + 3, k + 1], 1)])
    u, v = xy[faces[:, 1]] - xy[faces[:, 0]], xy[faces[:, 2]] - xy[faces[:, 0]]
    faces = faces[np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) > 1e-9]
    height = ground(x, y) + LIFT + 0.001 * distance_beyond(size, x, y)
    return make_mesh(
        material, np.column_stack([x, y, height]), np.tile([0, 0, 1], (len(x), 1)), xy / MATERIALS[material].repeat,
        faces, (material,),
    )  # fmt: skip


def _avenues(lines: Sequence[Line], share: float, rng: np.random.Generator) -> Array:
    """Positions (n, 2) of trees on both sides of the trails, with random gaps."""
    xy = [
        line.points[row] + side * 3.4 * np.array([-line.tangents[row, 1], line.tangents[row, 0]])
        for line in lines
        for side in (-1.0, 1.0)
        for row in range(220, len(line.points), 170)
        if rng.random() < 0.8 * share
    ]
    return np.array(xy).reshape(-1, 2) + rng.normal(0.0, 0.25, (len(xy), 2))


def _rims(
    trees: Sequence[Mesh], hills: Land, wood: Land, size: tuple[float, float], share: float, rng: np.random.Generator
) -> FarSwarm:
    """Trees along the rims of the woods, which hide the vertical sides of the canopy, and some single ones.

    Draws independent positions, one in 45 m2, two numbers for each, then what ``_tree_swarm`` draws.
    """
    half = WOODS_TO + max(size) / 2
    xy = rng.uniform(-half, half, (round((2 * half) ** 2 / 45.0), 2))
    outside, inside = distance_beyond(size, *xy.T), wood(*xy.T)
    rim = (inside < 0.1) & (inside > -0.16) & (outside > WOODS_FROM - 6) & (outside < WOODS_TO)
    single = (inside <= -0.16) & (outside > 70.0) & (outside < 220.0) & (rng.random(len(xy)) < 0.02)
    chosen = xy[(rim | single) & (rng.random(len(xy)) < share)]
    return _tree_swarm("woods_beyond", trees, chosen, hills, 0.4, rng)


def _tree_swarm(
    name: str, trees: Sequence[Mesh], xy: Array, land: Land, sink: float, rng: np.random.Generator
) -> FarSwarm:
    """A swarm of trees at positions (n, 2), ``sink`` [m] in the soil. Draws yaws, scales, meshes and tints."""
    n = len(xy)
    yaw = rng.uniform(0.0, 2 * np.pi, n)
    poses = upright_poses(xy, yaw, random_scales(rng, (0.55, 1.35), n))
    poses[:, 2, 3] = land(*xy.T) - sink
    return make_swarm(name, "tree", trees, poses, rng), trees


def _groups(
    size: tuple[float, float],
    ground: Land,
    lines: Sequence[Line],
    near_and_far: tuple[Sequence[Mesh], Sequence[Mesh]],
    config: Config,
    rng: np.random.Generator,
) -> list[FarSwarm]:
    """Loose groups of trees and bushes with long grass between them, off the trails."""
    planter, share = config.planter, float(config.beyond)
    grove, thicket = _waves(24.0, 60.0, rng), _waves(9.0, 20.0, rng)

    def off_trails(xy: Array, clear: float) -> Mask:
        return np.asarray(
            np.logical_and.reduce([np.ones(len(xy), bool), *(line.distance(xy) > clear for line in lines)])
        )

    def woods(xy: Array) -> Array:
        return np.asarray(np.clip(0.35 + 0.6 * grove(*xy.T), 0.03, 1.0) * off_trails(xy, 5.0) * share)

    def bushes(xy: Array) -> Array:
        return np.asarray(np.clip(thicket(*xy.T) - 0.4, 0.0, 1.0) * off_trails(xy, 3.0) * share)

    def grass(xy: Array) -> Array:
        return np.asarray(np.clip(0.8 * thicket(*xy.T) - 0.7, 0.0, 0.8) * off_trails(xy, 2.2) * share)

    near, far = near_and_far
    bush_spec = planter.swarm("bushes_beyond", planter.grow("far_bush", rng))
    grass_spec = planter.swarm("high_grass_beyond", planter.grow("far_meadow", rng))
    near_spec, far_spec = planter.swarm("trees_near", near), planter.swarm("trees_beyond", far)
    return [
        scatter_beyond(size, ground, near_spec, rng, within=NEAR, margin=4.0, density=woods),
        scatter_beyond(size, ground, far_spec, rng, within=TREES_TO, margin=NEAR, density=woods),
        scatter_beyond(size, ground, bush_spec, rng, within=40.0, margin=2.0, density=bushes),
        scatter_beyond(size, ground, grass_spec, rng, within=14.0, margin=1.0, density=grass),
    ]

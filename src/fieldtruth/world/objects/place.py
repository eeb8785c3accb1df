# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Own objects in a world: those with a place before all else grows, scattered ones where space is left.

An object stands so deep that no corner near its base is above the ground. Where it stands, nothing of a swarm grows.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import ClassTable
from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin, world_from_geodetic
from fieldtruth.world.model import Heightfield, Instance, Swarm, Terrain, water_at
from fieldtruth.world.objects.config import ObjectConfig, ScatterConfig
from fieldtruth.world.objects.make import OwnObject, circles_of, make_object
from fieldtruth.world.placement import CrowdedWorldError, WorldBuilder, eased, outside, place_until_count, upright_pose

TRIES: Final = 100
"""Positions to try for each copy that is wanted."""
_EASES: Final = (1.0, 0.8, 0.65, 0.5)
_SEED: Final = 4871
_BASE: Final = 0.1
"""Share of an object's height below which corners are near its base."""
_BARE: Final = 0.75
"""Radius without plants of a swarm, relative to that of a circle around a square."""


def stand_objects(
    builder: WorldBuilder, objects: Sequence[ObjectConfig], classes: ClassTable, origin: Origin = PAPER_ORIGIN
) -> None:
    """Read all objects, and add those that have a place; all that is placed later keeps off them.

    Raises:
        ConfigurationError: a file that cannot be used, or a place outside the world.
    """
    for k, config in enumerate(objects):
        own, where = make_object(config, f"layout.objects[{k}]", classes), f"layout.objects[{k}] ({config.title})"
        builder.meshes[own.mesh.name] = own.mesh
        builder.materials.update(own.materials)
        builder.textures.update(own.textures)
        half = np.array(builder.size) / 2
        for x, y, yaw, height in _poses(config, origin):
            if (np.abs([x, y]) > half).any():
                length, width = builder.size
                raise ConfigurationError(
                    f"{where}: must stand in the world of {length:g} m x {width:g} m, got x {x:.2f} m, y {y:.2f} m"
                )
            pose = _standing(own, upright_pose(x, y, np.radians(yaw), 1.0), builder.field)
            pose[2, 3] += height
            _add(builder, config, own, pose)


def scatter_objects(builder: WorldBuilder, terrain: Terrain, objects: Sequence[ObjectConfig], seed: int) -> None:
    """Add the objects with a rule, which ``stand_objects`` has read, and take away what grows where they stand.

    Raises:
        ConfigurationError: a surface that the world does not have.
        CrowdedWorldError: fewer than asked for fit.
    """
    for k, config in enumerate(objects):
        if config.scatter is not None:
            _scatter(builder, terrain, config, k, np.random.default_rng([seed, _SEED, k]))


def _scatter(builder: WorldBuilder, terrain: Terrain, config: ObjectConfig, k: int, rng: np.random.Generator) -> None:
    """Scatter the copies of the object number ``k``."""
    rule, where, (length, width) = config.scatter, f"layout.objects[{k}] ({config.title})", builder.size
    assert rule is not None
    mesh = builder.meshes[config.mesh]
    own = OwnObject(mesh, {}, {}, circles_of(mesh.vertices.astype(np.float64)))
    count = rule.count or max(1, round((rule.per_hectare or 0.0) * length * width / 1e4))
    darts = _darts(builder, rule, count, rng)
    darts = darts[_allowed(builder, terrain, rule, where, darts)]
    sizes = np.log(rule.scales)

    def attempt(xy: Array, _number: int, apart: bool) -> Instance | None:
        yaw, scale = rng.uniform(0.0, 2.0 * np.pi), np.exp(rng.uniform(*sizes))
        pose = upright_pose(float(xy[0]), float(xy[1]), float(yaw), float(scale))
        if not apart or not all(builder.is_free(circle[:2], circle[2]) for circle in _placed(own, pose)):
            return None
        return _add(builder, config, own, _standing(own, pose, builder.field))

    placed = place_until_count(count, darts, attempt, spacings=eased(rule.spacing, _EASES))
    if len(placed) < count:
        raise CrowdedWorldError(f"{where}: only {len(placed)} of {count} fit; ask for fewer, or less spacing")
    _clear_swarms(builder, placed, own)


def _poses(config: ObjectConfig, origin: Origin) -> list[tuple[float, float, float, float]]:
    """Position x, y [m], yaw [deg] and height [m] of each copy that has a place."""
    given = [(*each, 0.0, 0.0)[:4] for each in config.pose]
    for latitude, longitude, *others in config.degrees:
        x, y, _ = world_from_geodetic([latitude, longitude, origin.height], origin).tolist()
        given.append((x, y, *others, 0.0, 0.0)[:4])
    return [(x, y, yaw, height) for x, y, yaw, height in given]


def _add(builder: WorldBuilder, config: ObjectConfig, own: OwnObject, pose: Array) -> Instance:
    circles, before = [(x, y, r) for x, y, r in _placed(own, pose).tolist()], len(builder.solids)
    instance = builder.add(config.mesh, own.mesh, pose, circles, named=config.title)
    builder.solids[before:] = [(x, y, _BARE * r) for x, y, r in circles]  # not those around long colliders
    return instance


def _placed(own: OwnObject, pose: Array) -> Array:
    """Circles (n, 3) of an object at an upright pose."""
    scale = float(pose[2, 2])
    return np.column_stack([own.circles[:, :2] @ pose[:2, :2].T + pose[:2, 3], scale * own.circles[:, 2]])


def _standing(own: OwnObject, pose: Array, ground: Heightfield) -> Array:
    """The pose with the height at which no corner near the base is above the ground."""
    at = own.mesh.vertices.astype(np.float64)
    at = at[at[:, 2] <= _BASE * at[:, 2].max() + 1e-6] @ pose[:3, :3].T + pose[:3, 3]
    pose[2, 3] += float((ground.height_at(at[:, 0], at[:, 1]) - at[:, 2]).min())
    return pose


def _darts(builder: WorldBuilder, rule: ScatterConfig, count: int, rng: np.random.Generator) -> Array:
    """Positions (n, 2) to try, one after the other: over the whole world, or about the middles of clusters."""
    if rule.cluster == 1:
        return builder.random_positions(TRIES * count, rng)
    middles = builder.random_positions(-(-count // rule.cluster), rng)
    each = middles[np.arange(TRIES * count) % len(middles)]
    return np.asarray(each + rule.cluster_radius * rng.standard_normal(each.shape))


def _allowed(builder: WorldBuilder, terrain: Terrain, rule: ScatterConfig, where: str, xy: Array) -> Mask:
    """Mask (n,) of the positions whose surface and slope the rule allows, on dry land."""
    names = (*terrain.ground_materials, "trail")
    for unknown in (name for name in rule.surface if name not in names):
        raise ConfigurationError(f"{where}: scatter.surface: unknown surface {unknown!r}; {suggestion(unknown, names)}")
    field = terrain.field
    surface = np.argmax(terrain.cover.at(*xy.T), axis=-1)
    surface[terrain.trail_distance.at(*xy.T) < 0] = len(names) - 1
    wanted = [names.index(name) for name in rule.surface] or range(len(names) - 1)
    fits = np.isin(surface, wanted) & (np.hypot(*field.slope_at(*xy.T)) <= np.tan(np.radians(rule.slope)))
    return np.asarray(fits & (field.height_at(*xy.T) > water_at(builder.water_level, *xy.T)))


def _clear_swarms(builder: WorldBuilder, added: Sequence[Instance], own: OwnObject) -> None:
    """Take the members of swarms away that grow where objects were added."""
    circles = np.concatenate([_placed(own, each.world_from_object) for each in added]) * (1.0, 1.0, _BARE)
    builder.swarms[:] = [swarm for each in builder.swarms for swarm in _outside(each, circles)]


def _outside(swarm: Swarm, circles: Array) -> Iterator[Swarm]:
    """Yield a swarm without its members in some circles; none if no member is left."""
    off = outside(swarm.world_from_object[:, :2, 3], circles)
    if off.all():
        yield swarm
    elif off.any():
        yield replace(swarm, mesh=swarm.mesh[off], world_from_object=swarm.world_from_object[off], tint=swarm.tint[off])

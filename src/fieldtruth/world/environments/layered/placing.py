# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Objects and plants of an environment's layers: at random positions, in rows, along lines, or as a stand of trees."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from contourpy import contour_generator

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.environments.layered.config import Along, FarPlants, Objects, Plants, Rows
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields, rng_of
from fieldtruth.world.environments.layout import PLANTINGS
from fieldtruth.world.fallen import lay_log
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.grids import Line
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import (
    ObjectGroup,
    SwarmForm,
    SwarmSpec,
    WorldBuilder,
    random_tint,
    tilted,
    upright_pose,
)
from fieldtruth.world.stand import Stand

TRIES: Final = 6000
"""Random positions of a layer in a world as large as the built-in ones."""
_CORNER: Final = 4
"""Each of this number of a contour's corners, of which every cell of the grid has one, is a corner of its line."""
APART: Final = 1e-6
"""Distance [m] of a contour's corners, of which two are the same where it passes through a node of the grid."""
_BESIDE: Final = 0.2
"""Distance [m] from a contour at which its larger side is looked up."""


def place_objects(builder: WorldBuilder, fields: Fields, config: Any) -> None:
    """Place the objects of all layers in turn.

    Raises:
        CrowdedWorldError: a layer has more objects than fit into the world.
    """
    stand: Stand | None = None
    for name, layer in fields.description.objects.items():
        rng, amount = rng_of(fields.seed, f"objects.{name}"), getattr(config, name)
        if not amount:
            continue
        meshes = grown(fields, layer.group, config) if layer.group else [make_furniture(n) for n in layer.furniture]
        meshes = [replace(mesh, footprint=layer.footprint * mesh.footprint) for mesh in meshes]
        own: dict[str, Any] = {key: getattr(layer, key) for key in ("spacing", "scales", "tint")}
        group = ObjectGroup(kind=layer.kind or name, meshes=meshes, count=amount if layer.count else 0, **own)
        allowed = _chance(fields, layer, rng)
        if not layer.count:
            _place_all(builder, fields, layer, group, rng, amount)
        elif layer.group and PLANTINGS[config.environment].groups[layer.group].form == "log":
            _lay_all(builder, fields, layer, group, rng)
        elif layer.stand:
            stand = stand or Stand(builder)
            stand.plant(group, rng, allowed)
        else:
            darts = builder.random_positions(builder.tries(TRIES), rng)
            builder.place(group, rng, darts[allowed(darts)], pose=_pose(builder, layer))


def grown(fields: Fields, group: str, config: Any) -> list[Mesh]:
    """Individuals of a group, which all layers share.

    Raises:
        ConfigurationError: a species cannot be as high as the file says.
    """
    if group not in fields.meshes:
        try:
            fields.meshes[group] = config.planter.grow(group, rng_of(fields.seed, f"groups.{group}"))
        except ValueError as error:
            raise ConfigurationError(f"environment {config.environment}: groups.{group}: {error}") from error
    return fields.meshes[group]


def _chance(fields: Fields, layer: Objects | Plants, rng: np.random.Generator) -> Callable[[Array], Mask]:
    def allowed(xy: Array) -> Mask:
        return np.asarray(rng.random(len(xy)) < fields.at(layer.where, xy))

    return allowed


def _pose(builder: WorldBuilder, layer: Objects) -> Callable[[Array, float, float], Array] | None:
    """Pose of an object that leans with the slope or is sunk into it; None where it just stands."""
    if not layer.tilt and not layer.sink:
        return None

    def pose(xy: Array, yaw: float, scale: float) -> Array:
        x, y = xy
        dx, dy = builder.field.slope_at(x, y)
        found = upright_pose(x, y, yaw, scale)
        found[:3, :3] = tilted(found[None], dx, dy, layer.tilt)[0]
        found[2, 3] = float(builder.field.height_at(x, y)) - layer.sink * scale
        return found

    return pose


def _lay_all(
    builder: WorldBuilder, fields: Fields, layer: Objects, group: ObjectGroup, rng: np.random.Generator
) -> None:
    def lies(circles: Array) -> Mask:
        return np.asarray(rng.random() < fields.at(layer.where, circles[:, :2]))  # one chance for the whole trunk

    for k in range(group.count):
        lay_log(builder, group.mesh(k), rng, lies, kind=group.kind, tint=group.tint)


def _place_all(
    builder: WorldBuilder, fields: Fields, layer: Objects, group: ObjectGroup, rng: np.random.Generator, share: float
) -> None:
    """Place an object at each free position of rows or of a line; neighbours of the layer may touch each other."""
    if layer.rows is not None:
        candidates = in_rows(builder.size, layer.rows, rng)
    else:
        assert layer.along is not None
        candidates = along_line(builder, fields, layer.along, rng)
    candidates = candidates[rng.random(len(candidates)) < share * fields.at(layer.where, candidates[:, :2])]
    made = _pose(builder, layer)
    free = []
    for x, y, heading in candidates.tolist():
        mesh, scale = group.mesh(int(rng.integers(1 << 16))), float(rng.uniform(*group.scales))
        if builder.is_free((x, y), mesh.footprint * scale):
            free.append((x, y, heading, mesh, scale))
    for x, y, heading, mesh, scale in free:
        yaw = heading if layer.aligned else float(rng.uniform(0.0, 2.0 * np.pi))
        tint = random_tint(rng, layer.tint)
        if made is None:
            builder.add_upright(group.kind, mesh, (x, y), yaw=yaw, scale=scale, tint=tint)
        else:
            pose = made(np.array([x, y]), yaw, scale)
            builder.add(group.kind, mesh, pose, [(x, y, mesh.footprint * scale)], tint=tint)


def in_rows(size: tuple[float, float], rows: Rows, rng: np.random.Generator) -> Array:
    """Positions (n, 3): x, y [m] and the heading [rad] of parallel rows over a world, row by row."""
    angle, reach = np.radians(rows.angle), float(np.hypot(*size)) / 2
    across = np.arange(-np.ceil(reach / rows.spacing), np.ceil(reach / rows.spacing) + 1) * rows.spacing + rows.offset
    along = np.arange(-np.ceil(reach / rows.every), np.ceil(reach / rows.every) + 1) * rows.every
    v, u = np.meshgrid(across, along, indexing="ij")
    x, y = u * np.cos(angle) - v * np.sin(angle), u * np.sin(angle) + v * np.cos(angle)
    candidates = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, angle)])
    return _kept(candidates, size, rows.jitter, rows.gaps, rng)


def along_line(builder: WorldBuilder, fields: Fields, along: Along, rng: np.random.Generator) -> Array:
    """Positions (n, 3): x, y [m] and the heading [rad] along a line or contours, or on both sides of the trails."""
    lines: list[tuple[Line, float]]
    if along.line == "trail":
        edges = [(part, trail.width / 2 + along.offset) for trail in builder.trails for part in trail.line.parts()]
        lines = [(line, side * off) for line, off in edges for side in (-1.0, 1.0)]
    else:
        parts = contours(fields, along.contours, along.step) if along.contours else fields.lines[along.line].parts()
        lines = [(part, along.offset) for part in parts]
    found = [np.zeros((0, 3))]
    for line, left in lines:
        step = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line.points, axis=0), axis=1))])
        rows = np.searchsorted(step, np.arange(0.0, step[-1], along.every))
        (tx, ty), points = line.tangents[rows].T, line.points[rows]
        found.append(np.column_stack([points + left * np.column_stack([-ty, tx]), np.arctan2(ty, tx)]))
    return _kept(np.concatenate(found), builder.size, along.jitter, along.gaps, rng)


def contours(fields: Fields, name: str, step: float) -> list[Line]:
    """Lines along which a field is a multiple of ``step``; to their left it is larger."""
    rule = Expression(name)
    values, lines = fields.on(rule, fields.nodes), []
    traced = contour_generator(*fields.nodes, values.T)
    for level in np.arange(np.ceil(values.min() / step), np.floor(values.max() / step) + 1) * step:
        for corners in traced.lines(level):
            kept = np.asarray(corners)[np.unique([*range(0, len(corners), _CORNER), len(corners) - 1])]
            kept = kept[np.append(True, np.hypot(*np.diff(kept, axis=0).T) > APART)]
            if len(kept) < 3:
                continue
            line = Line.through(kept)
            middle = len(line.points) // 2
            left = line.points[middle] + line.tangents[middle, ::-1] * (-_BESIDE, _BESIDE)
            lines.append(line if fields.at(rule, left[None])[0] > level else Line.through(kept[::-1]))
    return lines


def _kept(candidates: Array, size: tuple[float, float], jitter: float, gaps: float, rng: np.random.Generator) -> Array:
    """Candidates (n, 3) inside the world, moved at random, some left out."""
    candidates[:, :2] += rng.normal(0.0, jitter, (len(candidates), 2))
    inside = (np.abs(candidates[:, :2]) < np.array(size) / 2).all(axis=1)
    return np.asarray(candidates[inside & (rng.random(len(candidates)) >= gaps)])


def scatter_plants(builder: WorldBuilder, fields: Fields, config: Any) -> None:
    """Scatter the swarms of all layers."""
    for name, layer in fields.description.plants.items():
        rng, amount = rng_of(fields.seed, f"plants.{name}"), getattr(config, name)
        if not amount:
            continue
        meshes = grown(fields, layer.group, config)
        spec = specified(name, layer, meshes, amount)
        if layer.rows is None:
            builder.scatter_swarm(spec, rng, lambda xy, rule=layer.where: fields.at(rule, xy))  # type: ignore[misc]
        else:
            candidates = in_rows(builder.size, layer.rows, rng)[:, :2]
            kept = rng.random(len(candidates)) < amount * fields.at(layer.where, candidates)
            builder.add_swarm_at(spec, candidates[kept], rng)


def specified(name: str, layer: Plants | FarPlants, meshes: Sequence[Mesh], per_m2: float) -> SwarmSpec:
    """Specify the swarm of a layer."""
    keys = {each.name for each in dataclasses.fields(SwarmForm)} & type(layer).model_fields.keys() - {"per_m2"}
    return SwarmSpec(name=name, meshes=meshes, per_m2=per_m2, **{key: getattr(layer, key) for key in keys})

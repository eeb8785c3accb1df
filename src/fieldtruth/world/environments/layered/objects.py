# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Objects of a layer: at random positions, in rows, along lines, or as a stand of trees."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, Final, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.fields import Boolean, Integer, Positive
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields, rng_of
from fieldtruth.world.environments.layered.plants import grown
from fieldtruth.world.environments.layered.positions import Along, Rows, along_line, in_rows
from fieldtruth.world.environments.layered.sections import Distance, Layer, Rule
from fieldtruth.world.environments.layout import PLANTINGS, Count, Share
from fieldtruth.world.fallen import lay_log
from fieldtruth.world.furniture import FURNITURE, make_furniture
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import EASES, ObjectGroup, Pose, WorldBuilder, random_tint, tilted, upright_pose
from fieldtruth.world.rocks import rock_pose
from fieldtruth.world.stand import Stand

EASED: Final = (*EASES, 0.3, 0.0)
"""Shares of the spacing of a layer that are tried in turn."""
TRIES: Final = 6000
"""Random positions of a layer in a world as large as the built-in ones."""


class Objects(Layer):
    """Objects of a kind: so many at random positions, in rows, or along a line."""

    group: str = ""  # of plants or rocks
    furniture: tuple[str, ...] = ()  # instead
    count: Annotated[Integer, Field(ge=0)] = 0
    rows: Rows | None = None
    along: Along | None = None
    where: Rule = Field(default=Expression("1"))  # chance of a position
    spacing: Distance = 0.0  # [m] between any two; eases where space is scarce
    scales: tuple[Positive, Positive] = (1.0, 1.0)
    tint: Distance = 0.08
    tilt: Share = 0.0  # share of the slope by which they lean
    sink: Distance = 0.0  # [m]
    bedded: Boolean = False  # rocks: inclined with the slope, and sunk until their whole rim is in the ground
    aligned: Boolean = False  # turned along their row or line; otherwise at random
    footprint: Positive = 1.0  # share of the footprint's radius that is kept free: crowns reach into each other below 1
    stand: Boolean = False  # trees that find light between those that stand

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if bool(self.group) == bool(self.furniture):
            raise ValueError("either group or furniture is required")
        if (self.count > 0) + (self.rows is not None) + (self.along is not None) != 1:
            raise ValueError("one of count, rows and along is required")
        for unknown in (name for name in self.furniture if name not in FURNITURE):
            raise ValueError(f"unknown furniture {unknown!r}; {suggestion(unknown, FURNITURE)}")
        return self

    def layout(self) -> tuple[Any, Any]:
        """Type and default of the number of objects, or of the share of positions that are planted."""
        return (Count, self.count) if self.count else (Share, 1.0)

    def groups(self) -> tuple[str, ...]:
        """Names of the groups of plants and rocks that it needs."""
        return (self.group,) if self.group else ()

    def place(self, builder: WorldBuilder, fields: Fields, config: Any, name: str) -> None:
        """Place the objects; see ``Layer.place``."""
        first = len(builder.instances)
        _place(builder, fields, config, self, name)
        placed = [each.world_from_object[:2, 3] for each in builder.instances[first:]]
        if placed:
            fields.near[name] = nearest(np.array(placed))


def nearest(points: Array) -> Callable[[Array], Array]:
    """Distance [m] to the nearest of points (m, 2) as a function of positions (n, 2)."""
    tree = cKDTree(points)
    return lambda xy: np.asarray(tree.query(xy)[0])


def _place(builder: WorldBuilder, fields: Fields, config: Any, layer: Objects, name: str) -> None:
    rng, amount = rng_of(fields.seed, f"objects.{name}"), getattr(config, name)
    if not amount:
        return
    meshes = grown(fields, layer.group, config) if layer.group else [make_furniture(n) for n in layer.furniture]
    meshes = [replace(mesh, footprint=layer.footprint * mesh.footprint) for mesh in meshes]
    own: dict[str, Any] = {key: getattr(layer, key) for key in ("spacing", "scales", "tint")}
    group = ObjectGroup(kind=layer.kind or name, meshes=meshes, count=amount if layer.count else 0, **own)

    def allowed(xy: Array) -> Mask:
        return np.asarray(rng.random(len(xy)) < fields.at(layer.where, xy))

    if not layer.count:
        _place_all(builder, fields, layer, group, rng, amount)
    elif layer.group and PLANTINGS[config.environment].groups[layer.group].form == "log":
        _lay_all(builder, fields, layer, group, rng)
    elif layer.stand:
        fields.stand = fields.stand or Stand(builder)
        fields.stand.plant(group, rng, allowed)
    else:
        darts = builder.random_positions(builder.tries(TRIES), rng)
        builder.place(group, rng, darts[allowed(darts)], eases=EASED, pose=_pose(builder, layer))


def _pose(builder: WorldBuilder, layer: Objects) -> Pose | None:
    """Pose of an object that leans with the slope or is sunk into it; None where it just stands."""
    if layer.bedded:
        return lambda mesh, xy, yaw, scale: rock_pose(builder.field, mesh, float(xy[0]), float(xy[1]), yaw, scale)
    if not layer.tilt and not layer.sink:
        return None

    def pose(_: Mesh, xy: Array, yaw: float, scale: float) -> Array:
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
            pose = made(mesh, np.array([x, y]), yaw, scale)
            builder.add(group.kind, mesh, pose, [(x, y, mesh.footprint * scale)], tint=tint)

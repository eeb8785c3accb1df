# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Objects of a layer: at random positions, in rows, along lines, or as a stand of trees."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.fields import Boolean, Frozen, Integer, Number, Positive
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields, rng_of
from fieldtruth.world.environments.layered.plants import Groups, grown
from fieldtruth.world.environments.layered.positions import Along, Rows, along_line, in_rows
from fieldtruth.world.environments.layered.sections import Between, Distance, Layer, Rule
from fieldtruth.world.environments.layered.trees import SPECIES, grouped
from fieldtruth.world.environments.layout import PLANTINGS, Count, LengthCount, Share
from fieldtruth.world.fallen import lay_log
from fieldtruth.world.furniture import FURNITURE, make_furniture
from fieldtruth.world.placement import EASES, ObjectGroup, WorldBuilder, random_tint, tilted, upright_pose
from fieldtruth.world.rocks import scatter_rocks
from fieldtruth.world.stand import Stand

EASED: Final = (*EASES, 0.3, 0.0)
"""Shares of the spacing of a layer that are tried in turn."""
TRIES: Final = 6000
"""Random positions of a layer in a world as large as the built-in ones."""


class Beside(Frozen):
    """Positions beside the objects of an earlier layer, in random order, with their heading: one at most at each."""

    layer: str
    aside: Positive  # [m] to either side
    ahead: Number = 0.0  # [m]


class Objects(Layer):
    """Objects of a kind: so many at random positions, in rows, or along a line."""

    group: Groups = ()  # of plants or rocks
    furniture: tuple[str, ...] = ()  # instead
    count: Annotated[Integer, Field(ge=0)] = 0
    grows: Literal["area", "length"] = "area"  # of a larger world, with which the count grows
    rows: Rows | None = None
    along: Along | None = None  # with a count: at so many of its positions
    beside: Beside | None = None  # as many of the count as there is space for; the others elsewhere
    where: Rule = Field(default=Expression("1"))  # chance of a position
    spacing: Distance = 0.0  # [m] between any two; eases where space is scarce
    scales: Between = (1.0, 1.0)
    tint: Distance = 0.08
    tilt: Share = 0.0  # share of the slope by which they lean
    sink: Distance = 0.0  # [m]
    aligned: Boolean = False  # turned along their row or line; otherwise at random
    footprint: Positive = 1.0  # share of the footprint's radius that is kept free: crowns reach into each other below 1
    bedded: Boolean = False  # rocks that lean with the slope, so deep that their whole rim is in the ground
    stand: Boolean = False  # trees that find light between those that stand
    differ: Distance = 0.0  # [m] within which no two are copies of one individual while another is left

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if bool(self.group) == bool(self.furniture):
            raise ValueError("either group or furniture is required")
        if SPECIES in self.kind and not self.count:
            raise ValueError(f"kind may have {SPECIES} where there is a count only")
        if (self.count > 0 or self.along is not None) + (self.rows is not None) != 1:
            raise ValueError("one of count, rows and along is required")
        if self.beside is not None and not self.count:
            raise ValueError("beside: a count is required")
        for name in (name for name in ("bedded", "stand") if getattr(self, name)):
            others = [k for k in ("rows", "along", "beside", "bedded", "stand") if k != name and getattr(self, k)]
            if self.furniture or others:
                excluded = ", ".join(others) or "furniture"
                raise ValueError(f"{name} is for a count of a group at random positions, and excludes {excluded}")
        for unknown in (name for name in self.furniture if name not in FURNITURE):
            raise ValueError(f"unknown furniture {unknown!r}; {suggestion(unknown, FURNITURE)}")
        return self

    def layout(self) -> tuple[Any, Any]:
        """Type and default of the number of objects, or of the share of positions that are planted."""
        return (LengthCount if self.grows == "length" else Count, self.count) if self.count else (Share, 1.0)

    def groups(self) -> tuple[str, ...]:
        """Names of the groups of plants and rocks that it needs."""
        return self.group

    def place(self, builder: WorldBuilder, fields: Fields, config: Any, name: str) -> None:
        """Place the objects; see ``Layer.place``."""
        first = len(builder.instances)
        _place(builder, fields, config, self, name)
        fields.placed[name] = placed = builder.instances[first:]
        if placed:
            fields.near[name] = nearest(np.array([each.world_from_object[:2, 3] for each in placed]))


def nearest(points: Array) -> Callable[[Array], Array]:
    """Distance [m] to the nearest of points (m, 2) as a function of positions (n, 2)."""
    tree = cKDTree(points)
    return lambda xy: np.asarray(tree.query(xy)[0])


def _place(builder: WorldBuilder, fields: Fields, config: Any, layer: Objects, name: str) -> None:
    rng, amount = rng_of(fields.seed, f"objects.{name}"), getattr(config, name)
    if not amount:
        return
    meshes = grown(fields, config, *layer.group) if layer.group else [make_furniture(n) for n in layer.furniture]
    meshes = [replace(mesh, footprint=layer.footprint * mesh.footprint) for mesh in meshes]
    own: dict[str, Any] = {key: getattr(layer, key) for key in ("spacing", "scales", "tint", "differ")}
    shares = config.planter.shares(layer.group[0]) if len(layer.group) == 1 else {}
    for group in grouped(layer.kind or name, meshes, amount if layer.count else 0, shares, **own):
        _place_group(builder, fields, config, layer, group, (rng, amount))


def _place_group(
    builder: WorldBuilder,
    fields: Fields,
    config: Any,
    layer: Objects,
    group: ObjectGroup,
    drawn: tuple[np.random.Generator, float],
) -> None:
    """Place the objects of one kind; ``drawn``: a generator, and the share of rows and lines."""
    rng, amount = drawn

    def allowed(xy: Array) -> Mask:
        return np.asarray(rng.random(len(xy)) < fields.at(layer.where, xy))

    if not layer.count:
        _place_all(builder, fields, layer, group, rng, amount)
    elif layer.group and PLANTINGS[config.environment].groups[layer.group[0]].form == "log":
        _lay_all(builder, fields, layer, group, rng)
    elif layer.bedded:
        scatter_rocks(builder, group, rng, lambda xy: fields.at(layer.where, xy))
    elif layer.stand:
        fields.stand = fields.stand or Stand(builder)
        fields.stand.plant(group, rng, allowed)
    else:
        if layer.beside is not None:
            group = replace(group, count=group.count - _place_beside(builder, fields, layer.beside, group, rng))
        if layer.along is None:
            darts = builder.random_positions(builder.tries(TRIES), rng)
        else:
            darts = rng.permutation(along_line(builder, fields, layer.along, rng))[:, : 3 if layer.aligned else 2]
        builder.place(group, rng, darts[allowed(darts[:, :2])], eases=EASED, pose=_pose(builder, layer))


def _place_beside(
    builder: WorldBuilder, fields: Fields, beside: Beside, group: ObjectGroup, rng: np.random.Generator
) -> int:
    """Place objects of a group at the first free side of others; return how many."""
    placed = 0
    for other in rng.permutation(np.array([each.world_from_object for each in fields.placed.get(beside.layer, ())])):
        mesh, yaw = group.mesh(placed), float(np.arctan2(other[1, 0], other[0, 0]))
        sides = [(other @ [beside.ahead, side * beside.aside, 0.0, 1.0])[:2] for side in (1.0, -1.0)]
        free = [xy for xy in sides if builder.is_free(xy, mesh.footprint)]
        if free and placed < group.count:
            builder.add_upright(group.kind, mesh, free[0], yaw=yaw, tint=random_tint(rng, group.tint))
            placed += 1
    return placed


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

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Swarms of an environment's layers, and the individuals of its groups."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Field, PlainValidator

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.fields import Boolean
from fieldtruth.world.environments.layered.expressions import Constant, Expression
from fieldtruth.world.environments.layered.fields import Fields, rng_of
from fieldtruth.world.environments.layered.positions import Along, Rows, in_rows
from fieldtruth.world.environments.layered.sections import Between, Distance, Rule, Ruled
from fieldtruth.world.environments.layout import Density, Share
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import SwarmForm, SwarmSpec, WorldBuilder

DENSEST: Final = 20.0
"""Greatest density [1/m^2] of a swarm."""


def _density(given: Any) -> float | Constant:
    """Return the density that a number or a rule gives; raises ValueError."""
    if isinstance(given, str):
        return Constant(given)
    if isinstance(given, bool) or not isinstance(given, int | float) or not 0 <= given <= DENSEST:
        raise ValueError(f"must be a number between 0 and {DENSEST:g}, or a rule of parameters, got {given!r}")
    return float(given)


def _names(given: Any) -> Any:
    return (given,) if isinstance(given, str) else given


Groups = Annotated[tuple[str, ...], BeforeValidator(_names), Field(description="the name of a group, or several")]


class Plants(Ruled):
    """A swarm of plants or stones; keys as of ``placement.SwarmForm``."""

    group: Groups
    kind: str
    per_m2: Annotated[float | Constant, PlainValidator(_density)] = 1.0  # a rule of parameters is no key of layouts
    mean: Boolean = False  # it is what ``where`` leaves in the mean over the world
    rows: Rows | None = None  # instead of a density
    where: Rule = Field(default=Expression("1"))
    scales: Between = (0.8, 1.25)
    tint: Distance = 0.1
    tilt: Share = 0.0
    lean_deg: Distance = 0.0
    sink: Distance = 0.0
    clear: Distance = 0.0
    aside: Distance = 0.0


class FarPlants(Ruled):
    """A swarm of plants or stones on the land beyond the edge."""

    group: Groups
    kind: str
    per_m2: Density = 1.0
    along: Along | None = None  # the trails beyond the edge, instead
    where: Rule = Field(default=Expression("1"))  # of x, y, beyond, land, the fields of the land and layers of objects
    scales: Between = (0.8, 1.25)
    tint: Distance = 0.1
    tilt: Share = 0.0
    sink: Distance = 0.0
    within: Distance = 80.0  # [m] from the edge
    margin: Distance = 1.5


def grown(fields: Fields, config: Any, *groups: str) -> list[Mesh]:
    """Individuals of groups, which all layers share; of several ones by turns as many of each as it has species.

    Raises:
        ConfigurationError: a species cannot be as high as the file says.
    """
    for group in groups:
        if group not in fields.meshes:
            rng = rng_of(fields.seed, f"groups.{group}")
            try:
                fields.meshes[group] = config.planter.grow(group, rng)
            except ValueError as error:
                raise ConfigurationError(f"environment {config.environment}: groups.{group}: {error}") from error
    if len(groups) == 1:
        return fields.meshes[groups[0]]
    turns = [
        (number // max(1, len(config.planter.species(group))), mesh)
        for group in groups
        for number, mesh in enumerate(fields.meshes[group])
    ]
    return [mesh for _, mesh in sorted(turns, key=lambda turn: turn[0])]


def density_of(fields: Fields, layer: Plants, given: float | None = None) -> float:
    """Density before it is thinned; ``given`` is that of the layout, if it has one."""
    wanted = layer.per_m2 if given is None else given
    wanted = fields.constant(wanted) if isinstance(wanted, Constant) else wanted
    if layer.mean:
        wanted /= max(float(fields.on(layer.where, fields.nodes).clip(0, 1).mean()), 1e-3)
    return min(max(wanted, 0.0), DENSEST)


def scatter_plants(builder: WorldBuilder, fields: Fields, config: Any, layers: Mapping[str, Plants]) -> None:
    """Scatter the swarms of all layers."""
    for name, layer in layers.items():
        rng, given = rng_of(fields.seed, f"plants.{name}"), getattr(config, name, None)
        amount = density_of(fields, layer, given) if layer.rows is None else given
        if not amount:
            continue
        meshes = grown(fields, config, *layer.group)
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

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Swarms of an environment's layers, and the individuals of its groups."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import Field

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.fields import Positive
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields, rng_of
from fieldtruth.world.environments.layered.positions import Rows, in_rows
from fieldtruth.world.environments.layered.sections import Amount, Distance, Rule, Ruled
from fieldtruth.world.environments.layout import Density, Share
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import SwarmForm, SwarmSpec, WorldBuilder


class Plants(Ruled):
    """A swarm of plants or stones; keys as of ``placement.SwarmForm``."""

    group: str
    kind: str
    per_m2: Density = 1.0
    times: Amount | None = None  # factor of the density or of what is planted of rows, instead of a key of the layout
    rows: Rows | None = None  # instead of a density
    where: Rule = Field(default=Expression("1"))
    scales: tuple[Positive, Positive] = (0.8, 1.25)
    tint: Distance = 0.1
    tilt: Share = 0.0
    lean_deg: Distance = 0.0
    sink: Distance = 0.0
    clear: Distance = 0.0
    aside: Distance = 0.0

    def layout(self) -> tuple[Any, Any] | None:
        """Type and default of its key of the layout; None if it has none."""
        if self.times is not None:
            return None
        return (Share, 1.0) if self.rows is not None else (Density, self.per_m2)

    def amount(self, fields: Fields, config: Any, name: str) -> float:
        """Plants to the square metre, or the share of rows that is planted."""
        if self.times is None:
            return float(getattr(config, name))
        return fields.constant(self.times) * (1.0 if self.rows is not None else self.per_m2)


class FarPlants(Ruled):
    """A swarm of plants or stones on the land beyond the edge."""

    group: str
    kind: str
    per_m2: Density = 1.0
    where: Rule = Field(default=Expression("1"))  # of x, y, beyond, land, the fields of the land and layers of objects
    scales: tuple[Positive, Positive] = (0.8, 1.25)
    tint: Distance = 0.1
    tilt: Share = 0.0
    sink: Distance = 0.0
    within: Distance = 80.0  # [m] from the edge
    margin: Distance = 1.5


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


def scatter_plants(builder: WorldBuilder, fields: Fields, config: Any, layers: Mapping[str, Plants]) -> None:
    """Scatter the swarms of all layers."""
    for name, layer in layers.items():
        rng, amount = rng_of(fields.seed, f"plants.{name}"), layer.amount(fields, config, name)
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

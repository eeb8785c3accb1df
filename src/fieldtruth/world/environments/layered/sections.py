# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of an environment's file that others are made of: rules, and layers of objects."""

from abc import abstractmethod
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import AfterValidator, Field, PlainValidator

from fieldtruth.experiment.fields import Frozen, Number, Positive
from fieldtruth.world.environments.layered.expressions import Constant, Expression
from fieldtruth.world.environments.layered.fields import Fields
from fieldtruth.world.placement import WorldBuilder

Rule = Annotated[Expression, PlainValidator(Expression)]
Amount = Annotated[Constant, PlainValidator(Constant)]
"""A number, or a rule of parameters."""
Distance = Annotated[Number, Field(ge=0)]


def ordered(pair: tuple[float, float]) -> tuple[float, float]:
    """Check that the first of two numbers is not above the second; raises ValueError."""
    if pair[0] > pair[1]:
        raise ValueError(f"the first must not be above the second, got [{pair[0]:g}, {pair[1]:g}]")
    return pair


Between = Annotated[tuple[Positive, Positive], AfterValidator(ordered)]
"""Least and greatest of numbers that are drawn."""


class Ruled(Frozen):
    """A part with rules."""

    def rules(self) -> Iterator[tuple[str, Expression]]:
        """Yield its rules by their keys."""
        for key in type(self).model_fields:
            if isinstance(rule := getattr(self, key), Expression):
                yield key, rule


class Layer(Ruled):
    """Objects of a kind, by rules of its type; its name is a key of the layout."""

    type: str = "objects"
    kind: str = ""  # by default the layer's name

    @abstractmethod
    def layout(self) -> tuple[Any, Any] | None:
        """Type and default of its key of the layout; None if it has none."""

    @abstractmethod
    def place(self, builder: WorldBuilder, fields: Fields, config: Any, name: str) -> None:
        """Place the objects, as many as ``config`` says under ``name``, and set ``fields.near``.

        Raises:
            CrowdedWorldError: there are more than fit into the world.
        """

    def groups(self) -> tuple[str, ...]:
        """Names of the groups of plants and rocks that it needs."""
        return ()

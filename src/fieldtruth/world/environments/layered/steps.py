# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Steps that change a relief in ways that no sum of rules can."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Final, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.fields import Number, PartError, Positive
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields, rng_of
from fieldtruth.world.environments.layered.sections import Rule, Ruled
from fieldtruth.world.relief import limit_slope, pits_and_mounds, slope_limit

Degrees = Annotated[Number, Field(gt=0, lt=90)]


class Step(Ruled):
    """A step of a relief; its rules know what the relief's do."""

    @abstractmethod
    def apply(self, fields: Fields, name: str) -> Array:
        """Return the heights (nx, ny) [m] that ``fields.height`` becomes; ``name`` is that of seeds."""


class Smooth(Step):
    """Takes a share of what is shorter than a length from the relief."""

    length: Positive  # [m], deviation of the Gaussian mean
    share: Rule = Field(default=Expression("1"))

    def apply(self, fields: Fields, name: str) -> Array:
        """Return the heights, smoothed."""
        assert fields.height is not None
        mean = gaussian_filter(fields.height, self.length / fields.spacing, mode="nearest")
        return np.asarray(fields.height + fields.draw(self.share, f"{name}.share") * (mean - fields.height))


class PitsAndMounds(Step):
    """Adds the pits and mounds that uprooted trees have left."""

    per_ha: Positive  # pairs to the hectare, before ``where``
    where: Rule = Field(default=Expression("1"))  # chance of a pair

    def apply(self, fields: Fields, name: str) -> Array:
        """Return the heights with pits and mounds."""
        assert fields.height is not None
        rng, size = rng_of(fields.seed, name), np.array(fields.size)
        positions = rng.uniform(-0.5, 0.5, (round(self.per_ha * float(size.prod()) / 1e4), 2)) * size
        kept = positions[rng.random(len(positions)) < fields.at(self.where, positions)]
        return np.asarray(fields.height + pits_and_mounds(*fields.nodes, kept, rng))


class LimitSlope(Step):
    """Makes a relief nowhere steeper than a limit, which rises with the distance from where it is least."""

    along: Rule = Field(default=Expression("corridor"))  # [m]
    within: Degrees  # up to ``near`` [m]
    beyond: Degrees  # from ``far`` [m] on
    near: Number
    far: Number

    @model_validator(mode="after")
    def _far_is_farther(self) -> Self:
        if self.far <= self.near:
            raise ValueError("far must be above near")
        return self

    def apply(self, fields: Fields, name: str) -> Array:
        """Return the heights whose slope is within the limit."""
        assert fields.height is not None
        own = self.model_dump(include={"within", "beyond", "near", "far"})
        limit = slope_limit(fields.draw(self.along, f"{name}.along"), **own)
        return limit_slope(fields.height, fields.spacing, limit)


STEPS: Final[dict[str, type[Step]]] = {"smooth": Smooth, "pits_and_mounds": PitsAndMounds, "limit_slope": LimitSlope}
"""Steps by the key under which a file has their values."""


def step_of(given: Any) -> Expression | Step:
    """Return the rule or the step of a layer of relief: ``0.3 * x`` or ``{smooth: {length: 2}}``.

    Raises:
        ValueError: it is neither.
    """
    if not isinstance(given, Mapping):
        return Expression(given)
    if len(given) != 1:
        raise ValueError(f"must be a rule, or one of the steps {', '.join(STEPS)} with its values")
    [(name, values)] = given.items()
    if name not in STEPS:
        raise ValueError(f"unknown step {name!r}; {suggestion(str(name), STEPS)}")
    try:
        return STEPS[name].model_validate(values)
    except ValidationError as report:
        raise PartError(STEPS[name], report, (name,)) from report

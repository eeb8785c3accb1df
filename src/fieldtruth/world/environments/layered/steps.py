# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Steps that change a relief in ways that no sum of rules can."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from pydantic import Field, ValidationError
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.fields import PartError, Positive
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields
from fieldtruth.world.environments.layered.sections import Rule, Ruled


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


STEPS: Final[dict[str, type[Step]]] = {"smooth": Smooth}
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

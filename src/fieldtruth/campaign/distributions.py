# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Distributions in a campaign file: wherever a value stands, a mapping with one of their keys may stand.

``{uniform: [low, high]}`` draws a number, ``{integers: [first, last]}`` an integer of which both ends count, and
``{choice: [...], weights: [...]}`` one of its values, all equally likely without weights. Values of a choice may hold
distributions themselves.
"""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Annotated, Any, Final, TypeVar

import numpy as np
from pydantic import Field, ValidationError, model_validator

from fieldtruth.experiment.fields import Frozen, Integer, Number, Positive
from fieldtruth.experiment.problems import configuration_error, shortened

Tree = Any
"""Plain values, lists and mappings as YAML has them, with distributions in them."""


D = TypeVar("D")
_Int64 = Annotated[Integer, Field(ge=-(2**63), le=2**63 - 1)]


class Uniform(Frozen):
    """A number between both ends."""

    uniform: Annotated[tuple[Number, Number], Field(description="[low, high]")]

    @model_validator(mode="after")
    def _ordered(self) -> "Uniform":
        return _ordered(self, self.uniform)

    def draw(self, rng: np.random.Generator) -> float:
        """Draw a number."""
        return float(rng.uniform(*self.uniform))

    def ends(self) -> list[Tree]:
        """Both ends."""
        return list(self.uniform)


class Integers(Frozen):
    """An integer between both ends, which count."""

    integers: Annotated[tuple[_Int64, _Int64], Field(description="[first, last], two integers")]

    @model_validator(mode="after")
    def _ordered(self) -> "Integers":
        return _ordered(self, self.integers)

    def draw(self, rng: np.random.Generator) -> int:
        """Draw an integer."""
        first, last = self.integers
        return int(rng.integers(first, last, endpoint=True))

    def ends(self) -> list[Tree]:
        """Both ends."""
        return list(self.integers)


class Choice(Frozen):
    """One of several values."""

    choice: Annotated[tuple[Any, ...], Field(min_length=1, description="a list with at least one value")]
    weights: Annotated[tuple[Positive, ...], Field(description="a number above 0 for each value")] | None = None

    @model_validator(mode="after")
    def _one_weight_each(self) -> "Choice":
        if self.weights is not None and len(self.weights) != len(self.choice):
            raise ValueError(f"choice has {len(self.choice)} values, but weights has {len(self.weights)}")
        for value in self.choice:
            check(value)
        return self

    def draw(self, rng: np.random.Generator) -> Any:
        """Draw a value, and then the distributions in it."""
        weights = np.ones(len(self.choice)) if self.weights is None else np.array(self.weights)
        return drawn(self.choice[int(rng.choice(len(weights), p=weights / weights.sum()))], rng)

    def ends(self) -> list[Tree]:
        """The values, with the ends of distributions in them."""
        return [end for value in self.choice for end in extremes(value)]


Distribution = Uniform | Integers | Choice
_KEYS: Final[dict[str, type[Distribution]]] = {"uniform": Uniform, "integers": Integers, "choice": Choice}


def distribution(value: object) -> Distribution | None:
    """Return the distribution that a mapping stands for; None for any other value.

    Raises:
        ValueError: a mapping with a distribution's key that is not a valid one.
    """
    if not isinstance(value, Mapping) or not (kinds := _KEYS.keys() & value.keys()):
        return None
    kind = _KEYS[min(kinds)]
    try:
        return kind.model_validate(value)
    except ValidationError as report:
        raise ValueError(str(configuration_error(kind, report))) from report


def check(tree: Tree) -> None:
    """Check every distribution in ``tree``.

    Raises:
        ValueError: an invalid one, with its keys.
    """
    if distribution(tree) is None:
        for key, part in _parts(tree):
            try:
                check(part)
            except ValueError as error:
                text = str(error)
                raise ValueError(f"{key}.{text}" if isinstance(key, str) else f"[{key}].{text}") from error


def drawn(tree: Tree, rng: np.random.Generator) -> Any:
    """Draw every distribution in ``tree``, in the order of the file."""
    found = distribution(tree)
    if found is not None:
        return found.draw(rng)
    if isinstance(tree, Mapping):
        return {key: drawn(part, rng) for key, part in tree.items()}
    return [drawn(part, rng) for part in tree] if isinstance(tree, list | tuple) else tree


MOST_EXTREMES: Final = 64
"""Combinations of one tree that ``extremes`` returns at most."""


def extremes(tree: Tree) -> list[Any]:
    """Return ``tree`` with each distribution at its ends, or at each value of a choice; one that has none as it is.

    Every end of every distribution occurs; all combinations only while there are few.
    """
    found = distribution(tree)
    if found is not None:
        return found.ends()
    if not isinstance(tree, Mapping | list | tuple) or not tree:
        return [tree]
    keys, parts = zip(*_parts(tree), strict=True)
    ends = [extremes(part) for part in parts]
    count = int(np.prod([len(values) for values in ends], dtype=float))
    longest = max(map(len, ends))
    rows = product(*ends) if count <= MOST_EXTREMES else ([v[i % len(v)] for v in ends] for i in range(longest))
    if isinstance(tree, Mapping):
        return [dict(zip(keys, row, strict=True)) for row in rows]
    return [list(row) for row in rows]


def _parts(tree: Tree) -> Iterator[tuple[str | int, Tree]]:
    if isinstance(tree, Mapping):
        yield from tree.items()
    elif isinstance(tree, list | tuple):
        yield from enumerate(tree)


def _ordered(model: D, ends: tuple[float, float]) -> D:
    if ends[0] > ends[1]:
        raise ValueError(f"the first end must be at most the second, got {shortened(list(ends))}")
    return model

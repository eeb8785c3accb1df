# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a campaign as frozen data: axes along which its runs differ, their distributions, and the split.

The runs are either the listed experiments, one each, or drawn: each takes one entry of every axis.

Wherever a value stands, a mapping with the key of a distribution may stand: ``{uniform: [low, high]}`` draws a number,
``{integers: [first, last]}`` an integer of which both ends count, and ``{choice: [...], weights: [...]}`` one of its
values, all equally likely without weights. Values of a choice may hold distributions themselves.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Annotated, Any, ClassVar, Final, Literal, Self, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, ValidationError, model_validator

from fieldtruth.experiment.config import Experiment, OneLine
from fieldtruth.experiment.fields import (
    Boolean,
    Frozen,
    Integer,
    LocatedError,
    Number,
    Positive,
    configuration_error,
    shortened,
)
from fieldtruth.experiment.sensor_config import known_switches

Tree = Any
"""Plain values, lists and mappings as YAML has them, with distributions in them."""
D = TypeVar("D")
_Int64 = Annotated[Integer, Field(ge=-(2**63), le=2**63 - 1)]
MOST_EXTREMES: Final = 64
"""Combinations of one tree that ``extremes`` returns at most."""
MOST_RUNS: Final = 100_000
BUILT_IN: Final = "built-in"
"""Entry of ``routes``: a route of the environment's built-in experiments."""
PRODUCT: Final = "product"
ROUTES: Final = (
    f"{BUILT_IN}, {{random: {{length_m: ...}}}}, {{metres: ...}}, {{frames: {{count: ...}}}}, or a list of these"
)
Words = Literal["ideal", "datasheet", "clean", "robot"]
SIGNALS: Final = "ideal, datasheet, clean, robot, or a mapping of sensors, or their kinds, to these or to figures"
DRAWN_ONLY: Final = ("environments", "layouts", "routes", "runs")
"""Keys that a campaign of listed experiments does not have."""
Share = Annotated[Number, Field(ge=0, le=1)]
CampaignName = Annotated[
    str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,55}$", description="a word of at most 56 letters, digits, - and _")
]
_ENTRIES: Final[dict[str, tuple[tuple[type, ...], str]]] = {
    "environments": ((str,), "a name or a list of names"),
    "seeds": ((int,), "an integer, a list of integers or {integers: [first, last]}"),
    "layouts": ((Mapping,), "a mapping of layout keys, or a list of mappings"),
    "routes": ((str, Mapping), ROUTES),
    "lights": ((str, Mapping), "a preset, a mapping of light keys, or a list of both"),
    "weathers": ((Mapping,), "a mapping of weather keys, or a list of mappings"),
    "rigs": ((Mapping,), "a mapping of rig keys, or a list of mappings"),
}


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


def _checked(tree: Tree) -> Tree:
    check(tree)
    return tree


Distributed = Annotated[Any, AfterValidator(_checked)]
"""A value, or a distribution of it."""


def axis(tree: Tree) -> Choice | Integers:
    """Return the entries of an axis: those of a list or a choice, the integers of a range, or one entry."""
    found = distribution(tree)
    if isinstance(found, Choice | Integers):
        return found
    return Choice(choice=tuple(tree) if isinstance(tree, list | tuple) else (tree,))


def entries(tree: Tree) -> Sequence[Tree]:
    """Return every entry of an axis, of a range as a range."""
    found = axis(tree)
    return found.choice if isinstance(found, Choice) else range(found.integers[0], found.integers[1] + 1)


class Split(Frozen):
    """Shares of the worlds; a world is in one split with all its runs. Folders of these names hold the runs."""

    train: Share = 0.0
    val: Share = 0.0
    test: Share = 0.0

    @model_validator(mode="after")
    def _whole(self) -> Self:
        total = math.fsum(self.shares.values())
        if abs(total - 1.0) > 1e-6:
            raise ValueError(f"train, val and test must add up to 1, got {total:g}")
        return self

    @property
    def shares(self) -> dict[str, float]:
        """Shares above 0 by name."""
        shares = {"train": self.train, "val": self.val, "test": self.test}
        return {name: share for name, share in shares.items() if share > 0}


class Campaign(Frozen):
    """Many runs: the complete input of a folder of data sets. Same campaign, same runs, same bytes."""

    besides: ClassVar = staticmethod(known_switches)

    name: CampaignName
    description: OneLine = ""
    seed: Annotated[Integer, Field(ge=0, le=2**63 - 1)] = 0
    """Root of what is drawn; worlds have seeds of their own."""
    runs: Annotated[
        Annotated[Integer, Field(ge=1, le=MOST_RUNS)] | Literal["product"] | None,
        Field(description=f"an integer between 1 and {MOST_RUNS}, or {PRODUCT} for every combination"),
    ] = None
    experiments: tuple[Experiment, ...] = ()
    """Experiments that are run as they are, in place of drawn ones; in a file, names or paths."""
    environments: Distributed = ()
    seeds: Distributed = None
    """Seeds of the worlds. None: 0, or those of the listed experiments."""
    layouts: Annotated[dict[str, Distributed], Field(description="a mapping of environments to layouts")] = Field(
        default_factory=dict
    )
    routes: Distributed = BUILT_IN
    lights: Distributed = Field(default_factory=dict)
    weathers: Distributed = Field(default_factory=dict)
    rigs: Distributed = Field(default_factory=dict)
    seconds: Distributed = None
    """End of each run [s] of simulated time."""
    switches: dict[str, Boolean] = Field(default_factory=dict, description="a mapping of switches to true or false")
    """Sensors with a switch that are simulated, or not; in a file as keys of their own, such as ``cameras: false``."""
    extras: tuple[str, ...] | None = None
    signal: Annotated[Words | dict[str, Any] | None, Field(description=SIGNALS)] = None
    split: Split | None = None
    """None: all runs in one folder."""

    @model_validator(mode="before")
    @classmethod
    def _switched(cls, given: Any) -> Any:
        if not isinstance(given, Mapping):
            return given
        keys = [key for key in known_switches() if key in given]
        for key in keys:
            if not isinstance(given[key], bool | None):
                raise LocatedError(f"must be true or false, got {shortened(given[key])}", [key])
        switches = dict(given.get("switches", {})) | {key: given[key] for key in keys if given[key] is not None}
        rest = {key: value for key, value in given.items() if key not in keys}
        return rest | {"switches": switches} if switches else rest

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = [key for key in DRAWN_ONLY if key in self.model_fields_set and getattr(self, key)]
        if self.experiments:
            if given:
                raise ValueError(f"experiments exclude {', '.join(given)}: each listed experiment is one run")
            if several := [experiment.name for experiment in self.experiments if experiment.robots]:
                raise ValueError(f"experiments must have one robot each, and {several[0]} has several")
            names = [experiment.name for experiment in self.experiments]
            if len(set(names)) < len(names):
                raise ValueError(f"experiments must have different names, got {', '.join(names)}")
        elif not self.environments:
            raise ValueError("environments or experiments is required: a list of names")
        elif self.runs is None:
            raise ValueError(f"runs is required: an integer between 1 and {MOST_RUNS}, or {PRODUCT}")
        return self

    @model_validator(mode="after")
    def _axes(self) -> Self:
        for key in ("environments", "seeds", "routes", "lights", "weathers", "rigs"):
            tree = getattr(self, key)
            if tree is not None and tree != ():
                self._check_axis(key, tree)
        for environment, tree in self.layouts.items():
            self._check_axis(f"layouts.{environment}", tree)
            if not self.experiments and environment not in entries(self.environments):
                raise ValueError(f"layouts.{environment}: {environment!r} is not one of the environments")
        return self

    def _check_axis(self, key: str, tree: Tree) -> None:
        found = axis(tree)
        if isinstance(found, Integers):
            if key != "seeds":
                raise ValueError(f"{key} must not be a range of integers")
            return
        allowed, condition = _ENTRIES[key.partition(".")[0]]
        for entry in found.choice:
            if not isinstance(entry, allowed) or isinstance(entry, bool):
                raise ValueError(f"{key} must be {condition}, got {shortened(entry)}")
        if not found.choice:
            raise ValueError(f"{key} must be {condition}, got an empty list")
        if self.runs == PRODUCT and found.weights is not None:
            raise ValueError(f"{key}: weights have no meaning with runs: {PRODUCT}, where every entry counts once")

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a campaign as frozen data: axes along which its runs differ, their distributions, and the split.

The runs are either the listed experiments, one each, or drawn: each takes one entry of every axis.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from fieldtruth.campaign.distributions import Choice, Integers, Tree, check, distribution
from fieldtruth.experiment.config import Experiment, OneLine
from fieldtruth.experiment.fields import Boolean, Frozen, Integer, Number
from fieldtruth.experiment.problems import shortened

MOST_RUNS: Final = 100_000
BUILT_IN: Final = "built-in"
"""Entry of ``routes``: a route of the environment's built-in experiments."""
PRODUCT: Final = "product"
ROUTES: Final = f"{BUILT_IN}, {{random: {{length_m: ...}}}}, {{frames: {{count: ...}}}}, or a list of these"
Words = Literal["ideal", "datasheet", "clean", "robot"]
SIGNALS: Final = "ideal, datasheet, clean, robot, or a mapping of sensors, or their kinds, to these or to figures"
DRAWN_ONLY: Final = ("environments", "layouts", "routes", "runs")
"""Keys that a campaign of listed experiments does not have."""

Share = Annotated[Number, Field(ge=0, le=1)]
CampaignName = Annotated[
    str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,55}$", description="a word of at most 56 letters, digits, - and _")
]


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
    cameras: Boolean | None = None
    lidar: Boolean | None = None
    extras: tuple[str, ...] | None = None
    signal: Annotated[Words | dict[str, Any] | None, Field(description=SIGNALS)] = None
    split: Split | None = None
    """None: all runs in one folder."""

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = [key for key in DRAWN_ONLY if key in self.model_fields_set and getattr(self, key)]
        if self.experiments:
            if given:
                raise ValueError(f"experiments exclude {', '.join(given)}: each listed experiment is one run")
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


_ENTRIES: Final[dict[str, tuple[tuple[type, ...], str]]] = {
    "environments": ((str,), "a name or a list of names"),
    "seeds": ((int,), "an integer, a list of integers or {integers: [first, last]}"),
    "layouts": ((Mapping,), "a mapping of layout keys, or a list of mappings"),
    "routes": ((str, Mapping), ROUTES),
    "lights": ((str, Mapping), "a preset, a mapping of light keys, or a list of both"),
    "weathers": ((Mapping,), "a mapping of weather keys, or a list of mappings"),
    "rigs": ((Mapping,), "a mapping of rig keys, or a list of mappings"),
}

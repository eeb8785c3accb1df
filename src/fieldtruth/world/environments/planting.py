# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants of the environments as data: which species make up each group of plants, and what each swarm is like.

``world/data/environments/NAME.yaml`` has ``groups`` (``PlantGroup``) and ``swarms`` (``SwarmForm``); the environment's
module says where they grow. The key ``plants`` of a layout names other species for a group.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.world.library import Entry, Library, validated
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import SwarmForm, SwarmSpec
from fieldtruth.world.plants.deadwood import grow_snag
from fieldtruth.world.plants.grasses import grow_clump, grow_tuft, tufts_in
from fieldtruth.world.plants.species import BUSHES, GRASSES, TREES, GrassSpecies, GrownIn, Species
from fieldtruth.world.plants.trees import grow_bush, grow_tree

Heights = float | tuple[float, float]
"""One height, or the least and the greatest."""

_LIBRARIES: Final[Mapping[str, Mapping[str, Any]]] = {
    "tree": TREES, "snag": TREES, "bush": BUSHES, "tuft": GRASSES, "clump": GRASSES,
}  # fmt: skip
_GROW: Final[Mapping[str, Callable[..., Mesh]]] = {
    "tree": grow_tree, "snag": grow_snag, "bush": grow_bush, "tuft": grow_tuft,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class PlantGroup:
    """Individuals of some species, as meshes: trees, bushes, single tufts of grass and herbs, or clumps of tufts."""

    form: Literal["tree", "snag", "bush", "tuft", "clump"]
    name: str  # of a mesh; ``{species}`` and ``{k}``, the number of the individual, are replaced
    species: Mapping[str, Heights] = field(default_factory=dict)  # heights [m], or shares of a clump's tufts
    heights: Heights | None = None  # [m] of species that are not listed; None: between those of the listed ones
    relative: bool = False  # heights are relative to that of a grown plant
    even: bool = False  # heights in equal steps from the least to the greatest, not random ones
    count: int = 1  # individuals of each species, or clumps
    in_turn: bool = False  # one of each species in turn, not all of one and then all of the next
    detail: float = 1.0
    grown_in: GrownIn = "open"  # trees
    radius: float = 0.0  # [m] of a clump
    per_m2: float = 0.0  # tufts of a clump
    size: float = 0.5  # of the first clump, as in ``grow_clump``
    larger: float = 0.0  # by which each further clump is larger

    def value(self, species: str) -> Heights:
        """Heights of a species, or its share of a clump."""
        listed = list(self.species.values())
        if species in self.species:
            return self.species[species]
        if self.heights is not None:
            return self.heights
        if self.form == "clump":
            return float(np.mean(listed))
        return float(np.min([np.min(each) for each in listed])), float(np.max([np.max(each) for each in listed]))


@dataclass(frozen=True, kw_only=True)
class Planting:
    """Groups of plants, and swarms, of an environment by name."""

    groups: Mapping[str, PlantGroup]
    swarms: Mapping[str, SwarmForm]


def _planting(name: str, content: Entry, path: Path) -> Planting:
    planting = validated(Planting, content, str(path))
    for key, group in planting.groups.items():
        known = _LIBRARIES[group.form]
        for unknown in (each for each in group.species if each not in known):
            raise ConfigurationError(f"{path}: groups.{key}: unknown species {unknown!r}; {suggestion(unknown, known)}")
    return planting


PLANTINGS: Final = Library("environments", _planting, lambda _: ())
"""Plants by environment, one data file each."""


def heights_of(kind: Species | GrassSpecies, height: float, grown_in: GrownIn) -> tuple[float, float]:
    """Least and greatest height [m] that a species can have, by the habit that it has at ``height``."""
    if isinstance(kind, GrassSpecies):
        return 0.5 * kind.height[0], 1.5 * kind.height[1]
    return 0.5 * kind.habit(height, grown_in).height, 2.0 * kind.habit(height, grown_in).height


def check_plants(environment: str, plants: Mapping[str, Sequence[str]]) -> None:
    """Check the species that a layout names by group; raises ValueError."""
    groups = {name: each for name, each in PLANTINGS[environment].groups.items() if each.species} if plants else {}
    for group, names in plants.items():
        if group not in groups:
            raise ValueError(f"unknown group {group!r}; {suggestion(group, groups)}")
        known = _LIBRARIES[groups[group].form]
        if not names:
            raise ValueError(f"{group} must name one species at least. Available: {', '.join(known)}")
        for unknown in (name for name in names if name not in known):
            raise ValueError(f"{group}: unknown species {unknown!r}; {suggestion(unknown, known)}")


class Planter:
    """Grows an environment's plants; ``plants`` are species by group, instead of the usual ones."""

    def __init__(self, environment: str, plants: Mapping[str, Sequence[str]]) -> None:
        self._planting = PLANTINGS[environment]
        self._plants = plants

    def species(self, group: str) -> tuple[str, ...]:
        """Names of a group's species."""
        return tuple(self._plants.get(group) or self._planting.groups[group].species)

    def grow(
        self, group: str, rng: np.random.Generator, *, count: int | None = None, species: Iterable[str] | None = None
    ) -> list[Mesh]:
        """Grow the individuals of a group, or of some species in it."""
        form, names = self._planting.groups[group], tuple(species if species is not None else self.species(group))
        numbers = range(form.count if count is None else count)
        if form.form == "clump":
            shares = {GRASSES[name]: float(np.mean(form.value(name))) for name in names}
            own: dict[str, Any] = {"radius": form.radius, "per_m2": form.per_m2, "rng": rng, "detail": form.detail}
            sizes = [form.size + form.larger * k for k in numbers]
            return [grow_clump(shares, name=form.name.format(k=k), size=size, **own) for k, size in enumerate(sizes)]
        if form.in_turn:
            return [self.individual(group, name, k, rng, count) for k in numbers for name in names]
        return [self.individual(group, name, k, rng, count) for name in names for k in numbers]

    def tufts(self, group: str) -> int:
        """Count the tufts in a clump of a group."""
        return tufts_in(self._planting.groups[group].per_m2, self._planting.groups[group].radius)

    def individual(
        self, group: str, species: str, number: int, rng: np.random.Generator, count: int | None = None
    ) -> Mesh:
        """Grow one individual; draws its height unless that is fixed or one of ``count`` equal steps."""
        form, heights = self._planting.groups[group], self._planting.groups[group].value(species)
        kind = _LIBRARIES[form.form][species]
        if not isinstance(heights, tuple):
            height = heights
        elif form.even:
            height = float(np.linspace(*heights, form.count if count is None else count)[number])
        else:
            height = float(rng.uniform(*heights))
        height *= kind.grown.height if form.relative else 1.0
        if species not in form.species:  # as high as others of the group, as far as it can be
            low, high = heights_of(kind, height, form.grown_in)
            height = min(max(height, low), high)
        own: dict[str, Any] = {"grown_in": form.grown_in} if form.form == "tree" else {}
        name = form.name.format(species=species, k=number)
        return _GROW[form.form](kind, name=name, height=height, rng=rng, detail=form.detail, **own)

    def swarm(
        self, name: str, meshes: Sequence[Mesh], *, form: str | None = None, per_m2: float | None = None
    ) -> SwarmSpec:
        """Specify a swarm of a form, by default that of its name, and of a density if it is not that of the form."""
        own = vars(self._planting.swarms[form or name])
        return SwarmSpec(name=name, meshes=meshes, **(own if per_m2 is None else {**own, "per_m2": per_m2}))

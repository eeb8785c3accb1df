# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Keys that the layouts of all environments share, and the plants and rocks of the environments as data.

Text and booleans are not accepted as numbers. ``world/data/environments/NAME.yaml`` says which species make up each
group of plants (``PlantGroup``) and, of a site, what each swarm is like (``SwarmForm``); the layers of the same file
say where they grow. The key ``plants`` of a layout names other species for a group.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.experiment.fields import Integer, Number, Positive
from fieldtruth.world.classes import ClassesConfig
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.grids import BUILT_IN, Line, coarseness
from fieldtruth.world.library import Entry, Library, validated
from fieldtruth.world.materials import ISO_CLASSES, Roughness, roughness_of
from fieldtruth.world.model import Mesh
from fieldtruth.world.objects.config import ObjectConfig
from fieldtruth.world.placement import SwarmForm, SwarmSpec
from fieldtruth.world.plants.deadwood import grow_log, grow_snag, grow_stump, grow_twigs
from fieldtruth.world.plants.grasses import grow_clump, grow_tuft, tufts_in
from fieldtruth.world.plants.species import BUSHES, GRASSES, TREES, GrownIn, heights_of
from fieldtruth.world.plants.trees import grow_bush, grow_tree
from fieldtruth.world.rocks import ROCK_TYPES, make_rock
from fieldtruth.world.seasons import SUMMER, USUAL, seasons

Heights = float | tuple[float, float]
"""One height, or the least and the greatest."""
_LIBRARIES: Final[Mapping[str, Mapping[str, Any]]] = {
    "tree": TREES, "snag": TREES, "log": TREES, "stump": TREES, "twigs": {}, "bush": BUSHES, "tuft": GRASSES,
    "clump": GRASSES, "rock": ROCK_TYPES,
}  # fmt: skip
_GROW: Final[Mapping[str, Callable[..., Mesh]]] = {
    "tree": grow_tree, "snag": grow_snag, "bush": grow_bush, "tuft": grow_tuft,
    "log": lambda kind, height, **own: grow_log(kind, length=height, **own),
    "stump": lambda kind, height, **own: grow_stump(kind, radius=height, **own),
}  # fmt: skip
_DEAD: Final = ("snag", "log", "stump")
"""Forms whose heights are not those of living plants."""


@dataclass(frozen=True, kw_only=True)
class PlantGroup:
    """Individuals of some species, as meshes: trees, bushes, single tufts of grass and herbs, or clumps of tufts.

    Rocks have types for species, and lengths for heights; so do fallen trunks (``log``), and stumps have radii. Fallen
    twigs lie in a disc and have no species.
    """

    form: Literal["tree", "snag", "log", "stump", "twigs", "bush", "tuft", "clump", "rock"]
    name: str  # of a mesh; ``{species}`` and ``{k}``, the number of the individual, are replaced
    species: Mapping[str, Heights] = field(default_factory=dict)  # heights [m], or shares of a clump's tufts
    mixture: str = ""  # key of the layout that has the shares of the species, instead
    mixed: tuple[str, ...] = ()  # species of one individual each, in this order, instead; names may occur again
    heights: Heights | None = None  # [m] of species that are not listed; None: between those of the listed ones
    relative: bool = False  # heights are relative to that of a grown plant
    even: bool = False  # heights in equal steps, of rocks ratios, from the least to the greatest, not random ones
    count: int | str = 1  # individuals of each species, or clumps; or a rule of the layout's numbers, ``2 * few``
    scaled: tuple[float, float] | None = None  # least and greatest scale of individuals that are smaller than they grow
    in_turn: bool = False  # one of each species in turn, not all of one and then all of the next
    detail: float = 1.0
    grown_in: GrownIn = "open"  # trees
    radius: float = (
        0.0  # [m] of a clump or a disc of twigs; of the thickest fallen trunk, others have half of it or more
    )
    per_m2: float = 0.0  # tufts of a clump, or twigs
    size: float = 0.5  # of the first clump, as in ``grow_clump``
    larger: float = 0.0  # by which each further clump is larger
    triangles: int = 720  # of a rock
    solid: bool = True  # with colliders

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
    """Groups of plants and rocks, and swarms, of an environment by name, and the corners [m] of its corridors."""

    groups: Mapping[str, PlantGroup] = field(default_factory=dict)
    swarms: Mapping[str, SwarmForm] = field(default_factory=dict)
    corridors: tuple[tuple[tuple[float, float], ...], ...] = ()


PLANTED: Final = tuple(each.name for each in fields(Planting))
"""Keys of an environment's file that are those of a ``Planting``; files of layers have others, ``ground`` for one."""


def _planting(name: str, content: Entry, path: Path) -> Planting:
    own = {key: value for key, value in content.items() if key in PLANTED} if "ground" in content else content
    planting = validated(Planting, own, str(path))
    for key, group in planting.groups.items():
        known = list(_LIBRARIES[group.form])  # names: no species is read
        for unknown in (each for each in (*group.species, *group.mixed) if each not in known):
            raise ConfigurationError(f"{path}: groups.{key}: unknown species {unknown!r}; {suggestion(unknown, known)}")
        if not group.species and group.heights is None and group.form != "twigs":
            raise ConfigurationError(f"{path}: groups.{key}: species or heights is missing")
        if set(re.findall(r"{.*?}|[{}]", group.name)) - {"{species}", "{k}"}:
            raise ConfigurationError(f"{path}: groups.{key}: name may have {{species}} and {{k}}, got {group.name!r}")
    return planting


PLANTINGS: Final = Library("environments", _planting, lambda _: ())
"""Plants, rocks and corridors by environment, one data file each."""


def check_shares(group: PlantGroup, shares: Mapping[str, float]) -> None:
    """Check the species of a mixture for a group; raises ValueError."""
    known = sorted(_LIBRARIES[group.form])
    for unknown in (name for name in shares if name not in known):
        raise ValueError(f"unknown species {unknown!r}; {suggestion(unknown, known)}")
    if not sum(shares.values()) > 0:
        raise ValueError(f"at least one share must be above 0. Available: {', '.join(known)}")


def check_plants(environment: str, plants: Mapping[str, Sequence[str]]) -> None:
    """Check the species that a layout names by group; raises ValueError."""
    known_groups = PLANTINGS[environment].groups.items() if plants else ()
    groups = {name: each for name, each in known_groups if each.species or each.mixed}
    for group, names in plants.items():
        if group not in groups:
            raise ValueError(f"unknown group {group!r}; {suggestion(group, groups)}")
        known = _LIBRARIES[groups[group].form]
        if not names:
            raise ValueError(f"{group} must name one species at least. Available: {', '.join(known)}")
        for unknown in (name for name in names if name not in known):
            raise ValueError(f"{group}: unknown species {unknown!r}; {suggestion(unknown, known)}")


class Planter:
    """Grows an environment's plants; ``plants`` are species by group, instead of the usual ones.

    ``numbers`` are the values of the layout, of which groups may have their counts and the shares of their species.
    """

    def __init__(
        self, environment: str, plants: Mapping[str, Sequence[str]], numbers: Mapping[str, Any] = MappingProxyType({})
    ) -> None:
        self._planting = PLANTINGS[environment]
        self._plants, self._numbers = plants, numbers

    def species(self, group: str) -> tuple[str, ...]:
        """Names of a group's species."""
        form = self._planting.groups[group]
        return tuple(self._plants.get(group) or self.shares(group) or form.mixed or form.species)

    def shares(self, group: str) -> Mapping[str, float]:
        """Shares by species of a group, without those that are 0; empty where all are as frequent."""
        found = self._numbers.get(self._planting.groups[group].mixture, {})
        return {name: share for name, share in found.items() if share > 0}

    def grow(
        self, group: str, rng: np.random.Generator, *, count: int | None = None, species: Iterable[str] | None = None
    ) -> list[Mesh]:
        """Grow the individuals of a group, or of some species in it."""
        form, names = self._planting.groups[group], tuple(species if species is not None else self.species(group))
        total = self.count(group) if count is None else count
        numbers = range(total)
        if form.form == "clump":
            shares = {GRASSES[name]: float(np.mean(form.value(name))) for name in names}
            own: dict[str, Any] = {"radius": form.radius, "per_m2": form.per_m2, "rng": rng, "detail": form.detail}
            sizes = [form.size + form.larger * k for k in numbers]
            return [grow_clump(shares, name=form.name.format(k=k), size=size, **own) for k, size in enumerate(sizes)]
        if form.form == "twigs":
            own = {"radius": form.radius, "count": tufts_in(form.per_m2, form.radius), "rng": rng}
            return [grow_twigs(name=form.name.format(k=k), **own) for k in numbers]
        if form.mixed:
            return [self.individual(group, name, k, rng, len(names)) for k, name in enumerate(names)]
        if form.in_turn:
            return [self.individual(group, name, k, rng, total) for k in numbers for name in names]
        return [self.individual(group, name, k, rng, total) for name in names for k in numbers]

    def count(self, group: str) -> int:
        """Count the individuals of each species of a group."""
        count = self._planting.groups[group].count
        if isinstance(count, str):
            value = float(Expression(count).values(lambda name: np.array(self._numbers[name])))
            if not math.isfinite(value):
                raise ConfigurationError(f"groups.{group}.count: {count!r} must be a finite number, got {value}")
            return max(1, round(value))
        return max(1, count)

    def tufts(self, group: str) -> int:
        """Count the tufts in a clump of a group."""
        return tufts_in(self._planting.groups[group].per_m2, self._planting.groups[group].radius)

    def individual(
        self, group: str, species: str, number: int, rng: np.random.Generator, count: int | None = None
    ) -> Mesh:
        """Grow one individual; draws its height unless that is fixed or one of ``count`` equal steps."""
        form, heights = self._planting.groups[group], self._planting.groups[group].value(species)
        kind, total = _LIBRARIES[form.form][species], self.count(group) if count is None else count
        if not isinstance(heights, tuple):
            height = heights
        elif form.even:
            steps = np.geomspace if form.form == "rock" else np.linspace
            height = float(steps(*heights, total)[number])
        else:
            height = float(rng.uniform(*heights))
        name = form.name.format(species=species, k=number)
        if form.form == "rock":
            return make_rock(kind, name=name, size=height, rng=rng, triangles=form.triangles, solid=form.solid)
        height *= kind.grown.height if form.relative else 1.0
        if species not in form.species and form.form not in _DEAD:  # as high as the others, as far as it can be
            low, high = heights_of(kind, height, form.grown_in)
            height = min(max(height, low), high)
        own: dict[str, Any] = {"grown_in": form.grown_in} if form.form == "tree" else {}
        if form.form == "log":
            own["radius"] = form.radius * float(rng.uniform(0.5, 1.0))
        scale = 1.0 if form.scaled is None else float(np.geomspace(*form.scaled, total)[number])
        own["detail"] = form.detail * scale**2  # as many leaves as have their real size in it
        mesh = _GROW[form.form](kind, name=name, height=height, rng=rng, **own)
        if form.scaled is not None:
            tufts = None if mesh.tufts is None else mesh.tufts * np.array([scale, scale, scale, 1.0], np.float32)
            vertices = np.float32(scale) * mesh.vertices
            joints = None if mesh.joints is None else np.float32(scale) * mesh.joints
            mesh = replace(mesh, vertices=vertices, footprint=scale * mesh.footprint, tufts=tufts, joints=joints)
        return mesh if form.solid and form.scaled is None else replace(mesh, colliders=())

    def swarm(
        self, name: str, meshes: Sequence[Mesh], *, form: str | None = None, per_m2: float | None = None
    ) -> SwarmSpec:
        """Specify a swarm of a form, by default that of its name, and of a density if it is not that of the form."""
        own = vars(self._planting.swarms[form or name])
        return SwarmSpec(name=name, meshes=meshes, **(own if per_m2 is None else {**own, "per_m2": per_m2}))


HILLS: Final = 0.2
"""Spacing [m] of the grid on which an environment shapes its hills; microrelief is added on that of the terrain."""
MOST: Final = 400
"""Objects of a kind in a built-in world, or in a smaller one, at most; larger ones have as many to the hectare."""
Size = Annotated[tuple[Positive, Positive], Field(description="[length, width], each a number above 0")]
Spacing = Annotated[Number, Field(ge=0.01, le=1)]
_NUMBER: Final = Field(ge=0, description="an integer between 0 and 400, or 800 to the hectare")
Count = Annotated[Integer, _NUMBER, "area"]
"""Of objects; where it is not given it grows with the world's area."""
LengthCount = Annotated[Integer, _NUMBER, "length"]
"""Of objects along a line across the world, along x; where it is not given it grows with the world's length."""
Density = Annotated[Number, Field(ge=0, le=20)]
Individuals = Annotated[Integer, Field(ge=1, le=32)]
Share = Annotated[Number, Field(ge=0, le=1)]
Corners = Annotated[tuple[tuple[Number, Number], ...], Field(min_length=2, description="a list of at least two [x, y]")]
Trails = Annotated[tuple[Corners, ...], Field(description="a list of lines, each a list of at least two [x, y]")]


class GroundConfig(ClassesConfig):
    """Keys of all layouts: the size of the world, the terrain's grid and the roughness of its ground."""

    grounds: ClassVar[tuple[str, ...]]
    """Ground types of the environment."""

    environment: ClassVar[str] = ""
    """Name of the data file of its plants; empty without one."""

    counted_in: ClassVar[tuple[float, float]] = BUILT_IN
    """Length and width [m] of the world for which the default counts are."""

    size: Size = BUILT_IN  # [m] along x (north) and y (west)
    grid: Spacing = 0.05  # [m] between the terrain's nodes
    roughness: Mapping[str, str] = Field(default={}, description="classes A to H of ISO 8608 by ground type")
    season: str = Field(default=SUMMER, description="a season: spring, summer, autumn or winter")
    drought: Share = USUAL  # 0 lush .. 1 dry: colours of grass
    snow_depth: Annotated[Number, Field(ge=0, le=0.3)] = 0.0  # [m], mean in the open
    plants: Mapping[str, tuple[str, ...]] = Field(default={}, description="lists of species by group of plants")
    litter: Annotated[Number, Field(ge=0, le=4)] = 1.0  # amount of leaves, twigs, stones, short grass on the ground
    objects: tuple[ObjectConfig, ...] = Field(default=(), description="a list of objects from files")

    @field_validator("roughness")
    @classmethod
    def _known_classes(cls, classes: Mapping[str, str]) -> Mapping[str, str]:
        for name, letter in classes.items():
            if name not in cls.grounds:
                raise ValueError(f"unknown ground type {name!r}; {suggestion(name, cls.grounds)}")
            if letter not in ISO_CLASSES:
                raise ValueError(f"{name} must be one of the classes {', '.join(ISO_CLASSES)}, got {letter!r}")
        return classes

    @field_validator("objects")
    @classmethod
    def _different_names(cls, objects: tuple[ObjectConfig, ...]) -> tuple[ObjectConfig, ...]:
        titles = [each.title for each in objects]
        for k, title in enumerate(titles):
            if title in titles[:k]:
                raise ValueError(f"two have the name {title!r}; give one of them a name of its own")
        return objects

    @field_validator("plants")
    @classmethod
    def _known_plants(cls, plants: Mapping[str, tuple[str, ...]]) -> Mapping[str, tuple[str, ...]]:
        check_plants(cls.environment, plants)
        return plants

    @field_validator("season")
    @classmethod
    def _known_season(cls, season: str) -> str:
        if season not in seasons():
            raise ValueError(f"unknown season {season!r}; {suggestion(season, seasons())}")
        return season

    @model_validator(mode="after")
    def _not_too_many(self) -> Self:
        most = int(MOST * max(1.0, self._larger(BUILT_IN)))
        for name in self._counts():
            if getattr(self, name) > most:
                raise ValueError(f"{name} must be at most {most} in a world of this size, got {getattr(self, name)}")
        return self

    @property
    def spacing(self) -> float:
        """Distance [m] between the terrain's nodes: ``grid``, in a large world more if it is not given."""
        return self.grid if "grid" in self.model_fields_set else self.grid * coarseness(self.size)

    def for_size(self) -> Self:
        """The layout with counts, grid and trails that suit its size, where they are not given."""
        longer = self.size[0] / self.counted_in[0]
        changes: dict[str, Any] = {"grid": self.spacing}
        for name, by in self._counts().items():
            changes[name] = round(getattr(self, name) * (longer if by == "length" else self._larger(self.counted_in)))
        if lines := getattr(self, "trails", ()):
            changes["trails"] = network(lines, self.size, self.counted_in)
        return self.model_copy(update={k: v for k, v in changes.items() if k not in self.model_fields_set})

    def _larger(self, than: tuple[float, float]) -> float:
        """Area relative to that of a world of another size [m]."""
        return self.size[0] * self.size[1] / (than[0] * than[1])

    @classmethod
    def _counts(cls) -> dict[str, str]:
        """Names of the counts, with what they grow with."""
        grow = {name: [m for m in info.metadata if m in ("area", "length")] for name, info in cls.model_fields.items()}
        return {name: found[0] for name, found in grow.items() if found}

    @property
    def planter(self) -> Planter:
        """Grows the plants of the environment, of the species that this layout names."""
        return Planter(self.environment, self.plants, dict(self))

    def roughness_of(self, ground: str) -> Roughness:
        """Roughness of a ground type in this layout."""
        return roughness_of(ground, self.roughness)


def hills_spacing(size: tuple[float, float]) -> float:
    """Spacing [m] of the grid on which hills are shaped: ``HILLS``, or twice that of the terrain if it is larger."""
    return max(HILLS, 0.1 * coarseness(size))


def network(lines: Trails, size: tuple[float, float], usual: tuple[float, float] = BUILT_IN) -> Trails:
    """Trails of a world of a size [m]: ``lines`` of a ``usual`` one, in a larger one continued by their mirror images.

    Each line is cut at the edge of the usual world and reflected there, again and again, so that trails go on.
    """
    cell = np.array(usual)
    if (np.array(size) <= cell).all():
        return lines
    reach = [range(-k, k + 1) for k in np.ceil((np.array(size) / cell - 1.0) / 2.0).astype(int)]
    pieces = []
    for corners in lines:
        points = Line.through(corners).points
        rows = np.flatnonzero((np.abs(points) <= cell / 2).all(axis=1))
        if not len(rows):
            continue
        piece = points[[*rows[:-20:40], rows[-1]]]
        for step in product(*reach):
            placed = piece * (-1.0) ** np.array(step) + cell * step
            if (np.abs(placed) < np.array(size) / 2).all(axis=1).any():
                pieces.append(tuple((float(x), float(y)) for x, y in placed))
    return tuple(pieces)

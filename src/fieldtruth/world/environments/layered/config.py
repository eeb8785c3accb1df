# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The file of an environment: fields, relief, lines, ground, objects, plants and the land beyond, and its layout.

Later sections know the results of earlier ones: ground and objects the relief, plants the crowns of objects. The names
of the layers of objects and plants are keys of the layout, with their counts and densities.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Set
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Self

from pydantic import Field, PlainValidator, ValidationError, create_model, model_validator

from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.experiment.fields import Boolean, Frozen, Integer, Number, Positive, configuration_error
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layout import (
    PLANTED,
    PLANTINGS,
    Count,
    Density,
    GroundConfig,
    Share,
    Size,
    Trails,
    check_plants,
)
from fieldtruth.world.furniture import FURNITURE
from fieldtruth.world.grids import BUILT_IN
from fieldtruth.world.library import Entry, Library
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.seasons import SUMMER, seasons

Rule = Annotated[Expression, PlainValidator(Expression)]
Distance = Annotated[Number, Field(ge=0)]
FLAT: Final = frozenset({"x", "y", "trail", "corridor", "edge"})
"""Fields that the relief may use: position [m], distance [m] to a trail's edge (below 0 on it), to the centre line of a
corridor, and to the world's edge."""
SHAPED: Final = frozenset({"height", "slope"})
"""Height [m] and slope [deg] of the relief."""
_NAME: Final = re.compile("[a-z][a-z0-9_]{0,63}")
LATE: Final = frozenset({"crown", "above_water"})
"""Fields of rules only: share to which a position is below crowns of objects, 0 before there are any, and height [m] of
the ground above the water, large where it is dry."""


class Rows(Frozen):
    """Parallel rows across the world."""

    spacing: Positive  # [m] between rows
    every: Positive  # [m] along a row
    angle: Number = 0.0  # [deg] to the x axis
    offset: Number = 0.0  # [m] of all rows to the left
    jitter: Distance = 0.0  # [m], standard deviation of the position
    gaps: Share = 0.0  # share of positions that are left out


class Along(Frozen):
    """Positions along a line of the environment, along its trails, or along the contour lines of a field."""

    line: str = ""
    contours: str = ""  # a field, instead
    step: Positive = 1.0  # of the field between its contours
    every: Positive  # [m]
    offset: Number = 0.0  # [m] to the left of the line, where a field is larger; of trails from their edge, both sides
    jitter: Distance = 0.0
    gaps: Share = 0.0


class Objects(Frozen):
    """Objects of a kind: so many at random positions, in rows, or along a line."""

    group: str = ""  # of plants or rocks
    furniture: tuple[str, ...] = ()  # instead
    kind: str = ""  # by default the layer's name
    count: Annotated[Integer, Field(ge=0)] = 0
    rows: Rows | None = None
    along: Along | None = None
    where: Rule = Field(default=Expression("1"))  # chance of a position
    spacing: Distance = 0.0  # [m] between any two; eases where space is scarce
    scales: tuple[Positive, Positive] = (1.0, 1.0)
    tint: Distance = 0.08
    tilt: Share = 0.0  # share of the slope by which they lean
    sink: Distance = 0.0  # [m]
    aligned: Boolean = False  # turned along their row or line; otherwise at random
    footprint: Positive = 1.0  # share of the footprint's radius that is kept free: crowns reach into each other below 1
    stand: Boolean = False  # trees that find light between those that stand

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if bool(self.group) == bool(self.furniture):
            raise ValueError("either group or furniture is required")
        if (self.count > 0) + (self.rows is not None) + (self.along is not None) != 1:
            raise ValueError("one of count, rows and along is required")
        for unknown in (name for name in self.furniture if name not in FURNITURE):
            raise ValueError(f"unknown furniture {unknown!r}; {suggestion(unknown, FURNITURE)}")
        return self


class Plants(Frozen):
    """A swarm of plants or stones; keys as of ``placement.SwarmForm``."""

    group: str
    kind: str
    per_m2: Density = 1.0
    rows: Rows | None = None  # instead of a density
    where: Rule = Field(default=Expression("1"))
    scales: tuple[Positive, Positive] = (0.8, 1.25)
    tint: Distance = 0.1
    tilt: Share = 0.0
    lean_deg: Distance = 0.0
    sink: Distance = 0.0
    clear: Distance = 0.0
    aside: Distance = 0.0


class FarPlants(Frozen):
    """A swarm of plants or stones on the land beyond the edge."""

    group: str
    kind: str
    per_m2: Density = 1.0
    scales: tuple[Positive, Positive] = (0.8, 1.25)
    tint: Distance = 0.1
    tilt: Share = 0.0
    sink: Distance = 0.0
    within: Distance = 80.0  # [m] from the edge
    margin: Distance = 1.5


class TrailSurface(Frozen):
    """Surface of the trails."""

    material: str = "path"
    border: str = "path_edge"
    border_width: Distance = 0.2  # [m] inwards from the edge


class Canopy(Frozen):
    """A closed forest beyond the edge: from afar its crowns are one surface."""

    height: Positive  # [m]
    behind: Positive  # [m] from the edge; single trees stand up to there
    material: str = "canopy"


class Beyond(Frozen):
    """The land beyond the world's edge."""

    material: str = "meadow"
    hills: Distance = 9.0  # [m] at the horizon
    land: Rule = Field(default=Expression("0"))  # height [m] that is added to them, of x and y
    canopy: Canopy | None = None
    swarms: Mapping[str, FarPlants] = {}


class Water(Frozen):
    """Water of one level over all ground that is lower."""

    level: Number  # [m]


class Puddles(Frozen):
    """Shallow hollows with water of their own."""

    count: Annotated[Integer, Field(ge=0)]
    where: Rule = Field(default=Expression("1"))
    radius: tuple[Positive, Positive] = (0.5, 1.4)  # [m]
    depth: tuple[Positive, Positive] = (0.04, 0.12)  # [m]
    material: str = "water"


class Description(Frozen):
    """An environment as its file describes it."""

    description: str
    sources: tuple[str, ...] = ()  # of the landscape's figures
    size: Size = BUILT_IN
    season: str = SUMMER
    fields: Mapping[str, Rule] = {}
    lines: Mapping[str, Trails] = {}  # ditches, hedges, walls ...: a field of each has the distance [m]
    trails: Trails = ()
    trail_width: Positive = 1.6
    trail: TrailSurface = TrailSurface()
    relief: Mapping[str, Rule] = {}  # heights [m] that are added in turn
    water: Water | None = None
    puddles: Puddles | None = None
    ground: Mapping[str, Rule]  # materials: each covers what is below it by its share
    objects: Mapping[str, Objects] = {}
    plants: Mapping[str, Plants] = {}
    seasonal: Mapping[str, Mapping[str, tuple[str, ...]]] = {}  # other species of groups by season: stages of crops
    litter_amount: Annotated[Number, Field(ge=0, le=4)] = 1.0
    beyond: Beyond = Beyond()

    @model_validator(mode="after")
    def _known(self) -> Self:
        for unknown in (name for name in (self.season, *self.seasonal) if name not in seasons()):
            raise ValueError(f"unknown season {unknown!r}; {suggestion(unknown, seasons())}")
        for key, names in self._materials():
            for name in (name for name in names if name not in MATERIALS):
                raise ValueError(f"{key}: unknown material {name!r}; {suggestion(name, MATERIALS)}")
        if self.water is not None and self.puddles is not None:
            raise ValueError("either water or puddles is allowed")
        self._check_names()
        for key, layer in self.objects.items():
            _check_along(f"objects.{key}.along", layer.along, self.lines, self.fields)
        early = FLAT | set(self.lines)
        flat = early | {name for name in self.fields if not self._is_shaped(name)}
        for section, allowed in (("fields", early | SHAPED | set(self.fields)), ("relief", flat | SHAPED)):
            for key, rule in getattr(self, section).items():
                _checked(f"{section}.{key}", rule, allowed, noise=True)
        known = early | SHAPED | LATE | set(self.fields)
        for key, rule in self._rules():
            _checked(key, rule, known, noise=False)
        _checked("beyond.land", self.beyond.land, {"x", "y"}, noise=False)
        return self

    def _check_names(self) -> None:
        """Check that no line, field, layer or swarm has a name that is taken; raises ValueError."""
        layers = {*GroundConfig.model_fields, "beyond", "trails", "trail_width"}
        fields, swarms = {*FLAT, *SHAPED, *LATE}, set[str]()
        for section, names, taken in (
            ("lines", self.lines, fields), ("fields", self.fields, fields),
            ("objects", self.objects, layers), ("plants", self.plants, layers),
            ("plants", self.plants, swarms), ("beyond.swarms", self.beyond.swarms, swarms),
        ):  # fmt: skip
            for name in names:
                if name in taken or not _NAME.fullmatch(name) or hasattr(GroundConfig, name):
                    raise ValueError(f"{section}.{name}: the name is taken, or not of letters, digits and _")
                taken.add(name)

    def _materials(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        yield "ground", tuple(self.ground)
        yield "trail", (self.trail.material, self.trail.border)
        yield "beyond", (self.beyond.material, *([self.beyond.canopy.material] if self.beyond.canopy else []))
        yield "puddles", (self.puddles.material,) if self.puddles is not None else ()

    def _rules(self) -> Iterator[tuple[str, Expression]]:
        yield from ((f"ground.{key}", rule) for key, rule in self.ground.items())
        yield from ((f"objects.{key}.where", layer.where) for key, layer in self.objects.items())
        yield from ((f"plants.{key}.where", layer.where) for key, layer in self.plants.items())
        yield from [("puddles.where", self.puddles.where)] if self.puddles is not None else []

    def _is_shaped(self, name: str, seen: frozenset[str] = frozenset()) -> bool:
        """Return True if a field follows from the relief; raises ValueError where fields follow from each other."""
        if name in seen:
            raise ValueError(f"fields.{name}: follows from itself")
        names = self.fields[name].names if name in self.fields else set()
        follows = [self._is_shaped(each, seen | {name}) for each in sorted(names)]  # all: each may follow from itself
        return bool(names & SHAPED) or any(follows)


def _checked(key: str, rule: Expression, known: Set[str], noise: bool) -> None:
    try:
        rule.check(known, noise=noise)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from error


def _check_along(key: str, along: Along | None, lines: Iterable[str], fields: Iterable[str]) -> None:
    if along is None:
        return
    if bool(along.line) == bool(along.contours):
        raise ValueError(f"{key}: either line or contours is required")
    kind, name, known = ("line", along.line, ("trail", *lines)) if along.line else ("field", along.contours, [*fields])
    if name not in known:
        raise ValueError(f"{key}: unknown {kind} {name!r}; {suggestion(name, known)}")


def _described(name: str, content: Entry, path: Path) -> Description:
    """Read the layers of an environment's file; those of its plants are in ``layout.PLANTINGS``."""
    layers = {key: value for key, value in content.items() if key not in PLANTED}
    try:
        description = Description.model_validate(layers)
    except ValidationError as report:
        raise configuration_error(Description, report, str(path)) from report
    for season, species in description.seasonal.items():
        try:
            check_plants(name, species)
        except ValueError as error:
            raise ConfigurationError(f"{path}: seasonal.{season}: {error}") from error
    groups = PLANTINGS[name].groups
    named = {f"objects.{key}": layer.group for key, layer in description.objects.items()}
    named |= {f"plants.{key}": plants.group for key, plants in description.plants.items()}
    named |= {f"beyond.swarms.{key}": plants.group for key, plants in description.beyond.swarms.items()}
    for key, group in named.items():
        if group not in ("", *groups):
            raise ConfigurationError(f"{path}: {key}: unknown group {group!r}; {suggestion(group, groups)}")
    return description


DESCRIPTIONS: Final = Library("environments", _described, lambda _: ())
"""Environments of layers by name, one data file each."""


@cache
def model_of(name: str) -> type[GroundConfig]:
    """Return the configuration of the layout of an environment of layers."""
    description = DESCRIPTIONS[name]
    keys: dict[str, Any] = {
        "size": (Size, description.size), "season": (str, description.season), "beyond": (Boolean, True),
    }  # fmt: skip
    if description.trails:
        keys |= {"trails": (Trails, description.trails), "trail_width": (Positive, description.trail_width)}
    for key, layer in description.objects.items():
        keys[key] = (Count, layer.count) if layer.count else (Share, 1.0)
    for key, plants in description.plants.items():
        keys[key] = (Share, 1.0) if plants.rows is not None else (Density, plants.per_m2)
    keys["litter"] = (Annotated[Number, Field(ge=0, le=4)], description.litter_amount)
    model = create_model("Config", __base__=GroundConfig, **keys)
    grounds = [MATERIALS[each].ground_type for each in (*description.ground, description.trail.material)]
    model.environment, model.counted_in = name, description.size
    model.grounds = tuple(dict.fromkeys(each for each in grounds if each))
    return model

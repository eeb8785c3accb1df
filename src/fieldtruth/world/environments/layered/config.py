# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The file of an environment: fields, relief, lines, ground, objects, plants and the land beyond, and its layout.

Later sections know the results of earlier ones: ground and objects the relief, plants the crowns of objects. The names
of the layers of objects and plants are keys of the layout, with their counts and densities.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Set
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, Final, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, create_model, model_validator

from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.experiment.fields import Boolean, Frozen, Integer, Number, Positive, part, validated_as
from fieldtruth.world.environments.layered.beds import Beds
from fieldtruth.world.environments.layered.expressions import DRAWN, Constant, Expression
from fieldtruth.world.environments.layered.land import PLACE, Beyond
from fieldtruth.world.environments.layered.objects import Objects
from fieldtruth.world.environments.layered.plants import Plants
from fieldtruth.world.environments.layered.positions import Along
from fieldtruth.world.environments.layered.power_line import PowerLine
from fieldtruth.world.environments.layered.sections import Amount, Between, Distance, Layer, Rule, Ruled
from fieldtruth.world.environments.layered.steps import Relief, rules_of
from fieldtruth.world.environments.layered.surroundings import Surroundings
from fieldtruth.world.environments.layout import (
    PLANTED,
    PLANTINGS,
    Density,
    GroundConfig,
    PlantGroup,
    Share,
    Size,
    Trails,
    check_plants,
    check_shares,
)
from fieldtruth.world.grids import BUILT_IN
from fieldtruth.world.library import Entry, Library
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.seasons import SUMMER, seasons

MOST_NODES: Final = 4_000_000
"""Nodes of a grid about a world of the environment's size."""
CONSTANTS: Final = frozenset({"trail_width", "spacing"})
"""Width [m] of the trails, and distance [m] between the nodes of the relief."""
FLAT: Final = frozenset({"x", "y", "trail", "left", "corridor", "edge"})
"""Fields that the relief may use: position [m], distance [m] to a trail's edge (below 0 on it), to the left of the
first trail's centre line, to the centre line of a corridor, and to the world's edge."""
HIDDEN: Final = frozenset({"edge", "left"})
"""Fields of ``FLAT`` whose names parameters may have; rules then see the parameter."""
SHAPED: Final = frozenset({"height", "slope", "drained"})
"""Height [m] and slope [deg] of the relief, and the area [m^2] that drains through a position."""
_NAME: Final = re.compile("[a-z][a-z0-9_]{0,63}")
LATE: Final = frozenset({"crown", "crown_needles", "crown_leaves", "foot", "above_water"})
"""Fields of rules only: share to which a position is below crowns of objects, of all or of those with needles or
leaves, 0 before there are any, distance [m] to the nearest of their trunks, posts and legs, and height [m] of the
ground above the water, large where it is dry."""


Wander = Annotated[Number, Field(ge=0, le=10)]
"""[m] by which the seed moves trails; more would fold them over themselves."""


class TrailSurface(Ruled):
    """Surface of the trails: of one material with a border, or as the rules of the ground paint it."""

    material: str = "path"
    border: str = "path_edge"
    border_width: Amount = Field(default=Constant("0.2"))  # [m] inwards from the edge
    ragged: Distance = 0.1  # [m] by which the edge deviates from a smooth line
    painted: Boolean = False  # the ground's rules also cover trails; the material is that of trails beyond the edge
    also: Rule = Field(default=Expression("1000"))  # the ground is trail where it is below 0, too: yards, for example


class Water(Ruled):
    """Water of one level over all ground that is lower."""

    level: Amount  # [m]
    name: str = "water"
    beyond: Distance = 60.0  # [m] from the edge, to which it goes on


class Parameter(Frozen):
    """A number of the environment: a key of its layout, and a constant in its rules."""

    value: Number
    low: Number | None = None
    above: Number | None = None  # a bound that is not allowed itself
    high: Number | None = None
    integer: Boolean = False

    @model_validator(mode="after")
    def _is_integer(self) -> Self:
        if self.integer and any(each is not None and each % 1 for each in (self.value, self.low, self.high)):
            raise ValueError("value, low and high of an integer must be integers")
        if not (self.low is None or self.value >= self.low) or not (self.high is None or self.value <= self.high):
            raise ValueError(f"value must be between low and high, got {self.value:g}")
        if self.above is not None and self.value <= self.above:
            raise ValueError(f"value must be above {self.above:g}, got {self.value:g}")
        return self

    def layout(self) -> tuple[Any, float]:
        """Type and default of its key of the layout."""
        given = {"ge": self.low, "gt": self.above, "le": self.high}
        limits: dict[str, Any] = {key: int(v) if v.is_integer() else v for key, v in given.items() if v is not None}
        kind = Integer if self.integer else Number
        return Annotated[kind, Field(**limits)], int(self.value) if self.integer else self.value


def _parameter(given: Any) -> Any:
    return given if isinstance(given, Mapping) else {"value": given}


def _layer(given: Any) -> Layer:
    """Return the layer of objects of the type that it names; raises ValueError."""
    kind = given.get("type", "objects") if isinstance(given, Mapping) else "objects"
    if not isinstance(kind, str) or kind not in LAYERS:
        raise ValueError(f"unknown type {kind!r}; {suggestion(str(kind), LAYERS)}")
    return part(LAYERS[kind], given)


LAYERS: Final[dict[str, type[Layer]]] = {"objects": Objects, "beds": Beds, "power_line": PowerLine}
"""Types of the layers of objects."""


class Puddles(Ruled):
    """Shallow hollows with water of their own."""

    count: Annotated[Integer, Field(ge=0)]
    where: Rule = Field(default=Expression("1"))
    radius: Between = (0.5, 1.4)  # [m]
    depth: Between = (0.04, 0.12)  # [m]
    material: str = "water"


class Description(Frozen):
    """An environment as its file describes it."""

    description: str
    sources: tuple[str, ...] = ()  # of the landscape's figures
    size: Size = BUILT_IN
    season: str = SUMMER
    parameters: Mapping[str, Annotated[Parameter, BeforeValidator(_parameter)]] = {}
    mixtures: Mapping[str, Mapping[str, Share]] = {}  # shares of species: keys of the layout
    fields: Mapping[str, Rule] = {}
    lines: Mapping[str, Trails] = {}  # ditches, hedges, walls ...: a field of each has the distance [m]
    trails: Trails = ()
    trail_width: Positive = 1.6
    trail: TrailSurface = TrailSurface()
    wander: Wander = 0.0  # [m] by which the seed moves the trails, in the mean square
    surroundings: Mapping[str, Surroundings] = {}  # grids about the world, the widest first
    relief: Mapping[str, Relief] = {}  # heights [m] that are added, and steps
    water: Water | None = None
    puddles: Puddles | None = None
    ground: Mapping[str, Rule]  # materials: each covers what is below it by its share
    tints: Mapping[str, tuple[Amount, Amount, Amount]] = {}  # factors on red, green, blue of materials
    objects: Mapping[str, Annotated[Layer, PlainValidator(_layer)]] = {}
    roots: tuple[str, ...] = ()  # layers of objects about whose trunks the ground rises
    plants: Mapping[str, Plants] = {}
    corridor_width: Positive = 2.0  # [m]
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
        if self.surroundings and self.beyond.canopy is not None:
            raise ValueError("either surroundings or beyond.canopy is allowed; a roof is for both")
        if sum(isinstance(layer, PowerLine) for layer in self.objects.values()) > 1:
            raise ValueError("objects: one power_line is allowed")
        self._check_grids()
        for unknown in (name for name in self.roots if name not in self.objects):
            raise ValueError(f"roots: unknown layer of objects {unknown!r}; {suggestion(unknown, self.objects)}")
        self._check_names()
        for key, layer in self.objects.items():
            if isinstance(layer, Objects):
                _check_along(f"objects.{key}.along", layer.along, self.lines, self.fields)
        for key, swarm in self.beyond.swarms.items():
            _check_along(f"beyond.swarms.{key}.along", swarm.along, (), ())
        self._check_beside()
        for name in self.beyond.fields:
            _check_cycle(f"beyond.fields.{name}", name, self.beyond.fields, frozenset())
        for key, rule, known, drawn in self._rules():
            try:
                if isinstance(rule, Constant):
                    rule.check(CONSTANTS | set(self.parameters))
                else:
                    rule.check(known, drawn)
            except ValueError as error:
                raise ValueError(f"{key}: {error}") from error
        return self

    def _check_grids(self) -> None:
        """Check that grids about the world have nodes for their splines, not too many, and the widest first."""
        margins = [grid.margin for grid in self.surroundings.values()]
        if margins != sorted(margins, reverse=True):
            raise ValueError("surroundings: the widest must be first")
        for name, grid in self.surroundings.items():
            nodes = np.prod([(side + 2.0 * grid.margin) / grid.spacing + 1.0 for side in self.size])
            if grid.margin < 2.0 * grid.spacing or nodes > MOST_NODES:
                raise ValueError(
                    f"surroundings.{name}: margin must be two spacings at least, and nodes at most {MOST_NODES:,}"
                )

    def _check_beside(self) -> None:
        earlier: list[str] = []
        for key, layer in self.objects.items():
            if isinstance(layer, Objects) and layer.beside is not None and layer.beside.layer not in earlier:
                raise ValueError(f"objects.{key}.beside: unknown layer before it: {layer.beside.layer!r}")
            earlier.append(key)

    def _check_names(self) -> None:
        """Check that no line, field, layer or swarm has a name that is taken; raises ValueError."""
        layers = {*GroundConfig.model_fields, "beyond", "trails", "trail_width", "wander"}
        known, swarms = {*CONSTANTS, *FLAT, *SHAPED, *LATE, *PLACE, "land"}, set[str]()
        fields = known | set(self.parameters)
        for section, names, taken in (
            ("parameters", self.parameters, known - HIDDEN),
            ("lines", self.lines, fields), ("fields", self.fields, fields),
            ("beyond.fields", self.beyond.fields, fields), ("objects", self.objects, fields),
            ("parameters", self.parameters, layers), ("mixtures", self.mixtures, layers),
            ("objects", self.objects, layers), ("plants", self.plants, layers),
            ("plants", self.plants, swarms), ("objects", self._swarms_of_beds(), swarms),
            ("beyond.swarms", self.beyond.swarms, swarms),
        ):  # fmt: skip
            for name in names:
                if name in taken or not _NAME.fullmatch(name) or hasattr(GroundConfig, name):
                    raise ValueError(f"{section}.{name}: the name is taken, or not of letters, digits and _")
                taken.add(name)

    def _swarms_of_beds(self) -> Iterator[str]:
        for layer in self.objects.values():
            if isinstance(layer, Beds) and layer.edging is not None:
                yield layer.edging.name

    def _materials(self) -> Iterator[tuple[str, tuple[str, ...]]]:
        yield "ground", tuple(self.ground)
        yield "trail", (self.trail.material, self.trail.border)
        yield "tints", tuple(self.tints)
        canopy = [self.beyond.canopy.material] if self.beyond.canopy else []
        yield "beyond", (self.beyond.material, *canopy, *self.beyond.materials)
        for key, layer in self.objects.items():
            yield f"objects.{key}.edging", (layer.edging.material,) if isinstance(layer, Beds) and layer.edging else ()
        yield "puddles", (self.puddles.material,) if self.puddles is not None else ()

    def _rules(self) -> Iterator[tuple[str, Expression, Set[str], Set[str]]]:
        """Yield all rules by their keys, with the fields and functions that each may use."""
        numbers, objects = CONSTANTS | set(self.parameters), set[str]()
        early = FLAT | numbers | set(self.lines)
        flat = early | SHAPED | {name for name in self.fields if not self._is_shaped(name)}
        known = early | SHAPED | LATE | set(self.fields)
        nodes = frozenset(DRAWN) - {"waves"}
        yield from (
            (f"fields.{key}", rule, early | SHAPED | set(self.fields), nodes) for key, rule in self.fields.items()
        )
        reliefs = {f"surroundings.{key}.relief": grid.relief for key, grid in self.surroundings.items()}
        for at, layers in {**reliefs, "relief": self.relief}.items():
            yield from ((f"{at}.{key}", rule, flat, nodes if drawn else set()) for key, rule, drawn in rules_of(layers))
        for section, each in (("water", self.water), ("trail", self.trail), ("puddles", self.puddles)):
            yield from ((f"{section}.{key}", rule, known, set()) for key, rule in (each.rules() if each else ()))
        for key, layer in self.objects.items():
            objects.add(key)  # its own: the border of beds
            yield from ((f"objects.{key}.{name}", rule, known | objects, set()) for name, rule in layer.rules())
        yield from ((f"ground.{key}", rule, known | objects, set()) for key, rule in self.ground.items())
        yield from ((f"tints.{key}", rule, numbers, set()) for key, rgb in self.tints.items() for rule in rgb)
        for key, plants in self.plants.items():
            yield from ((f"plants.{key}.{name}", rule, known | objects, set()) for name, rule in plants.rules())
        yield from self._rules_beyond(numbers, objects)

    def _rules_beyond(
        self, numbers: Set[str], objects: Set[str]
    ) -> Iterator[tuple[str, Expression, Set[str], Set[str]]]:
        place = PLACE | numbers | set(self.beyond.fields)
        late = objects | {"land", "trail"}
        yield from ((f"beyond.fields.{key}", rule, place, {"waves"}) for key, rule in self.beyond.fields.items())
        yield from ((f"beyond.{key}", rule, place, set()) for key, rule in self.beyond.rules())
        for key, rule in self.beyond.materials.items():
            yield f"beyond.materials.{key}", rule, place | {"land", "slope"}, set()
        for key, swarm in self.beyond.swarms.items():
            for name, rule in swarm.rules():
                yield f"beyond.swarms.{key}.{name}", rule, place | late, set()

    def _is_shaped(self, name: str, seen: frozenset[str] = frozenset()) -> bool:
        """Return True if a field follows from the relief; raises ValueError where fields follow from each other."""
        if name in seen:
            raise ValueError(f"fields.{name}: follows from itself")
        names = self.fields[name].names if name in self.fields else set()
        shaped = bool(names & SHAPED) or (name in self.fields and "uphill" in self.fields[name].drawn)
        follows = [self._is_shaped(each, seen | {name}) for each in sorted(names)]  # all: each may follow from itself
        return shaped or any(follows)


def _check_cycle(key: str, name: str, fields: Mapping[str, Expression], seen: frozenset[str]) -> None:
    """Check that a field does not follow from itself; raises ValueError."""
    if name in seen:
        raise ValueError(f"{key}: follows from itself")
    for each in sorted(fields[name].names & fields.keys()):
        _check_cycle(key, each, fields, seen | {name})


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
    description = validated_as(Description, layers, str(path))
    for season, species in description.seasonal.items():
        try:
            check_plants(name, species)
        except ValueError as error:
            raise ConfigurationError(f"{path}: seasonal.{season}: {error}") from error
    groups = PLANTINGS[name].groups
    _check_groups(groups, description, path)
    named = [(f"objects.{key}", group) for key, layer in description.objects.items() for group in layer.groups()]
    named += [(f"plants.{key}", group) for key, plants in description.plants.items() for group in plants.group]
    named += [
        (f"beyond.swarms.{key}", group) for key, each in description.beyond.swarms.items() for group in each.group
    ]
    for key, group in named:
        if group not in groups:
            raise ConfigurationError(f"{path}: {key}: unknown group {group!r}; {suggestion(group, groups)}")
    return description


def _check_groups(groups: Mapping[str, PlantGroup], description: Description, path: Path) -> None:
    """Check the keys of the layout that groups of plants name, and the species of mixtures."""
    for key, group in groups.items():
        at = f"groups.{key}.count"
        try:
            if isinstance(group.count, str):
                Expression(group.count).check(set(description.parameters))
            at, known = f"groups.{key}.mixture", description.mixtures
            if group.mixture and group.mixture not in known:
                raise ValueError(f"unknown mixture {group.mixture!r}; {suggestion(group.mixture, known)}")
            at = f"mixtures.{group.mixture}"
            if group.mixture:
                check_shares(group, known[group.mixture])
        except ValueError as error:
            raise ConfigurationError(f"{path}: {at}: {error}") from error


def _mixture(environment: str, name: str, shares: Mapping[str, float]) -> Mapping[str, float]:
    """Return the shares of species that a layout gives for a mixture; raises ValueError."""
    for group in PLANTINGS[environment].groups.values():
        if group.mixture == name:
            check_shares(group, shares)
    return shares


DESCRIPTIONS: Final = Library("environments", _described, lambda _: ())
"""Environments of layers by name, one data file each."""


@cache
def model_of(name: str) -> type[GroundConfig]:
    """Return the configuration of the layout of an environment of layers."""
    description = DESCRIPTIONS[name]
    season = Field(default=description.season, description=GroundConfig.model_fields["season"].description)
    keys: dict[str, Any] = {"size": (Size, description.size), "season": (str, season)}
    if description.trails:
        keys |= {"trails": (Trails, description.trails), "trail_width": (Positive, description.trail_width)}
        keys["wander"] = (Wander, description.wander)
    keys |= {key: parameter.layout() for key, parameter in description.parameters.items()}
    for key, shares in description.mixtures.items():
        info = Field(description="shares by species, each from 0 up to 1")
        keys[key] = (Annotated[Mapping[str, Share], info, AfterValidator(partial(_mixture, name, key))], shares)
    keys |= {key: own for key, layer in description.objects.items() if (own := layer.layout()) is not None}
    for key, plants in description.plants.items():
        if isinstance(plants.per_m2, Expression) and plants.rows is None:
            continue
        keys[key] = (Share, 1.0) if plants.rows is not None else (Density, plants.per_m2)
    keys["beyond"] = description.beyond.layout()
    keys["litter"] = (Annotated[Number, Field(ge=0, le=4)], description.litter_amount)
    model = create_model("Config", __base__=GroundConfig, **keys)
    of_trails = (description.trail.material,) if description.trails else ()
    grounds = [MATERIALS[each].ground_type for each in (*description.ground, *of_trails)]
    model.environment, model.counted_in = name, description.size
    model.grounds = tuple(dict.fromkeys(each for each in grounds if each))
    return model

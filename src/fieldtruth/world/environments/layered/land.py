# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The land beyond a world's edge: hills and what rules add to them, its materials, a closed forest, and swarms."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field

from fieldtruth.core.arrays import Array, Index
from fieldtruth.experiment.fields import Boolean, Frozen, Positive
from fieldtruth.world.backdrop import (
    Land,
    canopy,
    height_beyond,
    make_backdrop,
    rolling_hills,
    scatter_beyond,
    stand_beyond,
)
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import FAR, Fields, check_finite, rng_of
from fieldtruth.world.environments.layered.plants import FarPlants, grown, specified
from fieldtruth.world.environments.layered.positions import along_lines, beside_trails
from fieldtruth.world.environments.layered.sections import Distance, Rule, Ruled
from fieldtruth.world.environments.layered.trails_beyond import continued
from fieldtruth.world.environments.layout import Share
from fieldtruth.world.grids import Trail, distance_beyond
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import FarSwarm, WorldBuilder

PLACE: Final = frozenset({"x", "y", "beyond"})
"""Fields of the rules of the land: position [m], and distance [m] from the world's edge."""
JOINED: Final = 100.0
"""Distance [m] from the edge up to which swarms stand on the land's triangles, which the world's edge bends; those of
swarms that reach farther stand on the land as its rules say."""
WAVES: Final = 16


class Canopy(Frozen):
    """A closed forest beyond the edge: from afar its crowns are one surface."""

    height: Positive  # [m]
    behind: Positive  # [m] from the edge; single trees stand up to there
    material: str = "canopy"


class Beyond(Ruled):
    """The land beyond the world's edge."""

    material: str = "meadow"
    materials: Mapping[str, Rule] = {}  # others: each covers those before it where its rule is above 0.5
    hills: Distance = 9.0  # [m] at the horizon
    fields: Mapping[str, Rule] = {}
    land: Rule = Field(default=Expression("0"))  # height [m] that is added to the hills
    roof: Rule = Field(default=Expression("0"))  # height [m] of a closed forest's crowns above the land
    trails: Distance = 0.0  # [m] for which the trails go on
    planted: Share | None = None  # share of the swarms, a key of the layout
    canopy: Canopy | None = None
    swarms: Mapping[str, FarPlants] = {}

    def layout(self) -> tuple[Any, Any]:
        """Type and default of its key of the layout: false cuts the world at its edge."""
        if self.planted is None:
            return Boolean, True
        given = AfterValidator(lambda value: self.planted if value is True else value)
        return Annotated[Share | Boolean, given, Field(description="a number between 0 and 1, or false")], self.planted


class FarFields:
    """Values of the rules of the land at positions of any shape."""

    def __init__(self, fields: Fields, beyond: Beyond) -> None:
        self._fields, self._rules = fields, beyond.fields
        self.known: dict[str, Callable[[Array, Array], Array]] = {}
        """Further fields by name, as functions of x and y [m]."""

    def at(self, rule: Expression, x: Array, y: Array) -> Array:
        """Values of a rule at x, y [m]."""
        return self._values(rule, "", {"x": x, "y": y})

    def _values(self, rule: Expression, name: str, found: dict[str, Array]) -> Array:
        """Values of a rule; its waves have the seed of ``name``, ``found`` are the fields that are known there."""
        x, y, rng = found["x"], found["y"], rng_of(self._fields.seed, name)

        def lookup(each: str) -> Array:
            if each not in found:
                found[each] = self._known(each, found)
            return found[each]

        drawn = {"waves": lambda shortest, longest: waves(float(shortest), float(longest), rng)(x, y)}
        values = np.broadcast_to(rule.values(lookup, drawn), x.shape)
        check_finite(rule, values.ravel(), np.stack([x.ravel(), y.ravel()], axis=-1))
        return values

    def _known(self, each: str, found: dict[str, Array]) -> Array:
        x, y = found["x"], found["y"]
        if each == "beyond":
            return distance_beyond(self._fields.size, x, y)
        if each in self.known:
            return self.known[each](x, y)
        if each in self._rules:
            return self._values(self._rules[each], f"beyond.fields.{each}", found)
        return self._fields.anywhere(each, np.stack([x.ravel(), y.ravel()], axis=-1)).reshape(x.shape)


def waves(shortest: float, longest: float, rng: np.random.Generator) -> Land:
    """Noise of deviation 1 over all land: waves in random directions, of lengths between two bounds [m]."""
    length, turn, phase = (rng.uniform(*pair, WAVES) for pair in ((shortest, longest), (0.0, 6.3), (0.0, 6.3)))
    along_x, along_y = 2.0 * np.pi * np.cos(turn) / length, 2.0 * np.pi * np.sin(turn) / length

    def noise(x: Array, y: Array) -> Array:
        each = (np.cos(a * x + b * y + c) for a, b, c in zip(along_x, along_y, phase, strict=True))
        return np.asarray(sum(each) / np.sqrt(WAVES / 2))

    return noise


class LandBeyond(NamedTuple):
    """Land around a world: its triangles, its height [m] without roofs, and the trails that go on there."""

    mesh: Mesh
    height: Land
    trails: Sequence[Trail]


def make_land_beyond(builder: WorldBuilder, fields: Fields, beyond: Beyond) -> LandBeyond:
    """Make the land around the world: hills, behind the trees a canopy, if there is one, and trails."""
    rng, size, roof, far = rng_of(fields.seed, "beyond"), builder.size, beyond.canopy, FarFields(fields, beyond)
    names = [beyond.material, *([] if roof is None else [roof.material]), *beyond.materials]
    hills: Land = fields.land or (lambda x, _y: np.zeros_like(x))
    if roof is None and beyond.hills and fields.land is None:
        hills = rolling_hills(size, rng, height=beyond.hills)
    elif roof is not None:
        hills = canopy(size, rng, behind=roof.behind, roof=roof.height, hills=beyond.hills)

    def land(x: Array, y: Array) -> Array:
        return hills(x, y) + far.at(beyond.land, x, y)

    def cover(x: Array, y: Array, slope: Array) -> Index:
        far.known = {"land": land, "slope": lambda *_: np.degrees(slope)}
        chosen = np.zeros(len(x), np.intp)
        if roof is not None:
            chosen[distance_beyond(size, x, y) > roof.behind - 1.0] = 1
        for name, rule in beyond.materials.items():
            chosen[far.at(rule, x, y) > 0.5] = names.index(name)
        return chosen

    def roofed(x: Array, y: Array) -> Array:
        return land(x, y) + np.maximum(far.at(beyond.roof, x, y), 0.0)

    mesh = make_backdrop(builder.field, size, names, rng, land=roofed, cover=cover)
    trails = continued(builder.trails, size, beyond.trails, rng) if beyond.trails else []
    return LandBeyond(mesh, land, trails)


def ground_height(builder: WorldBuilder, land: LandBeyond) -> Callable[[Array], Array]:
    """Height [m] of the ground at positions (n, 2), inside the world and on the land beyond its edge."""
    joined, half = height_beyond(builder.field, builder.size, land.mesh), np.array(builder.size) / 2

    def height(xy: Array) -> Array:
        inside = np.asarray((np.abs(xy) < half).all(axis=1))
        x, y = np.where(inside[:, None], 2 * half, xy).T  # any valid position where the value is not used
        near = distance_beyond(builder.size, x, y) <= JOINED
        return np.where(inside, builder.field.height_at(*xy.T), np.where(near, joined(x, y), land.height(x, y)))

    return height


def swarms_beyond(
    builder: WorldBuilder, fields: Fields, config: Any, beyond: Beyond, land: LandBeyond
) -> list[FarSwarm]:
    """Scatter the swarms of the land."""
    share = 1.0 if beyond.planted is None else float(config.beyond)
    if not share:
        return []
    far, size = FarFields(fields, beyond), config.size
    joined, swarms = height_beyond(builder.field, size, land.mesh), []
    far.known = {"land": land.height, "trail": partial(_trail_distance, land.trails)}
    for name, layer in beyond.swarms.items():
        rng = rng_of(fields.seed, f"beyond.{name}")
        spec = specified(name, layer, grown(fields, config, *layer.group), layer.per_m2)
        ground = joined if layer.within <= JOINED else land.height

        def chance(xy: Array, rule: Expression = layer.where) -> Array:
            return share * far.at(rule, *xy.T)

        if layer.along is None:
            own: dict[str, Any] = {"within": layer.within, "margin": layer.margin}
            whole = share == 1.0 and layer.where.text == "1"
            swarms.append(scatter_beyond(size, ground, spec, rng, density=None if whole else chance, **own))
        else:
            xy = along_lines(beside_trails(land.trails, layer.along.offset), layer.along)[:, :2]
            outside = distance_beyond(size, *xy.T)
            xy = xy[(outside > layer.margin) & (outside <= layer.within)]
            xy = xy[rng.random(len(xy)) < (1.0 - layer.along.gaps) * chance(xy)]
            swarms.append(stand_beyond(ground, spec, xy + rng.normal(0.0, layer.along.jitter, xy.shape), rng))
    return swarms


def _trail_distance(trails: Sequence[Trail], x: Array, y: Array) -> Array:
    """Distance [m] to the nearest trail's edge."""
    xy = np.stack([x.ravel(), y.ravel()], axis=-1)
    each = [trail.line.distance(xy) - trail.width / 2 for trail in trails]
    return np.asarray(np.min([np.full(len(xy), FAR), *each], axis=0).reshape(x.shape))

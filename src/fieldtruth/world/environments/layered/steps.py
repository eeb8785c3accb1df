# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Steps that change a relief in ways that no sum of rules can."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Final, Self

import numpy as np
from pydantic import Field, PlainValidator, model_validator
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.fields import Integer, Number, Positive, part
from fieldtruth.world.environments.layered.expressions import Constant, Expression
from fieldtruth.world.environments.layered.fields import Fields, rng_of
from fieldtruth.world.environments.layered.sections import Amount, Distance, Rule, Ruled
from fieldtruth.world.relief import collapsed, eroded, limit_slope, pits_and_mounds, slope_limit

Rounds = Annotated[Integer, Field(ge=1, le=500)]
STEEPEST: Final = 80.0
"""Greatest slope [deg] of a profile and of limits."""
Slope = Annotated[Number, Field(ge=-STEEPEST, le=STEEPEST)]


class Step(Ruled):
    """A step of a relief; its rules know what the relief's do."""

    at_positions: ClassVar[frozenset[str]] = frozenset()
    """Its rules that are asked for anywhere, and so have no functions of the grid."""

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

    at_positions = frozenset({"where"})
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
    within: Amount  # [deg] up to ``near`` [m]
    beyond: Amount  # [deg] from ``far`` [m] on
    near: Number
    far: Number
    rounds: Rounds = 40

    @model_validator(mode="after")
    def _far_is_farther(self) -> Self:
        if self.far <= self.near:
            raise ValueError("far must be above near")
        return self

    def apply(self, fields: Fields, name: str) -> Array:
        """Return the heights whose slope is within the limit."""
        assert fields.height is not None
        within, beyond = (min(max(fields.constant(each), 0.0), STEEPEST) for each in (self.within, self.beyond))
        distance = fields.draw(self.along, f"{name}.along")
        limit = slope_limit(distance, within=within, beyond=beyond, near=self.near, far=self.far)
        return limit_slope(fields.height, fields.spacing, limit, rounds=self.rounds)


class Erode(Step):
    """Streams cut gullies, soil creeps, and what is too steep collapses; see ``world.relief``."""

    strength: Rule = Field(default=Expression("0.02"))  # [m] that a stream of 1 m2 cuts into a slope of 1 per step
    creep: Distance = 0.02  # [m2] per step, diffusion
    repose_deg: Amount = Field(default=Constant("36"))  # what is steeper collapses
    steps: Rounds = 30

    def apply(self, fields: Fields, name: str) -> Array:
        """Return the heights, eroded; those of the grid's border stay."""
        assert fields.height is not None
        strength, repose = fields.draw(self.strength, f"{name}.strength"), fields.constant(self.repose_deg)
        own: dict[str, Any] = {"repose_deg": repose, "creep": self.creep, "steps": self.steps}
        return eroded(fields.height, fields.spacing, strength=strength, **own).heights


class Collapse(Step):
    """Slopes that are too steep collapse into the lower ground."""

    repose_deg: Amount = Field(default=Constant("36"))
    steps: Rounds = 30

    def apply(self, fields: Fields, name: str) -> Array:
        """Return the heights after the collapse."""
        assert fields.height is not None
        return collapsed(fields.height, fields.spacing, repose_deg=fields.constant(self.repose_deg), steps=self.steps)


class Profile(Step):
    """Adds a profile of slopes, as across a valley and its ridges; its height is 0 where its coordinate is."""

    of: Rule  # [m], the coordinate
    slopes_deg: Annotated[tuple[tuple[Number, Slope], ...], Field(min_length=2)]  # by the coordinate; smooth in between

    @model_validator(mode="after")
    def _rising(self) -> Self:
        if not (np.diff([at for at, _ in self.slopes_deg]) > 0).all():
            raise ValueError("slopes_deg: each [coordinate, slope] must have a larger coordinate than the one before")
        return self

    def apply(self, fields: Fields, name: str) -> Array:
        """Return the heights with the profile, which goes on as straight lines beyond its ends."""
        assert fields.height is not None
        at, slopes = np.array(self.slopes_deg, np.float64).T
        slope = PchipInterpolator(at, np.tan(np.radians(slopes)))
        rise = slope.antiderivative()

        def profile(coordinate: Array) -> Array:
            inside = coordinate.clip(at[0], at[-1])
            return np.asarray(rise(inside) + slope(inside) * (coordinate - inside))

        return np.asarray(fields.height + profile(fields.draw(self.of, f"{name}.of")) - profile(np.zeros(())))


STEPS: Final[dict[str, type[Step]]] = {
    "smooth": Smooth, "pits_and_mounds": PitsAndMounds, "limit_slope": LimitSlope, "erode": Erode, "collapse": Collapse,
    "profile": Profile,
}  # fmt: skip
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
    return part(STEPS[name], values, name)


Relief = Annotated[Expression | Step, PlainValidator(step_of)]
"""A layer of relief: heights [m] that are added, or a step."""


def shape(fields: Fields, layers: Mapping[str, Expression | Step], start: Array, name: str) -> Array:
    """Heights [m] at the nodes: the layers in turn, each of which knows those before it; ``name`` is that of seeds."""
    height = start
    for key, layer in layers.items():
        fields.height, seed = height, f"{name}.{key}"
        height = height + fields.draw(layer, seed) if isinstance(layer, Expression) else layer.apply(fields, seed)
    return height


def rules_of(layers: Mapping[str, Expression | Step]) -> Iterator[tuple[str, Expression, bool]]:
    """Yield the rules of layers of relief by their keys, and whether they may have functions of the grid."""
    for key, layer in layers.items():
        if isinstance(layer, Expression):
            yield key, layer, True
        else:
            yield from ((f"{key}.{name}", rule, name not in layer.at_positions) for name, rule in layer.rules())

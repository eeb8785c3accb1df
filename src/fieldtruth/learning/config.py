# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Keyword arguments of the environments, as docs/learning.md describes them."""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, model_validator

from fieldtruth.core.errors import UnknownNameError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.fields import Frozen, Integer, LocatedError, Number, Positive, validated_as
from fieldtruth.experiment.files import validated
from fieldtruth.learning.rewards import Weights

TEST_WORLDS: Final = 1000
"""Seed from which on worlds are for tests; those below are for training."""
OBSERVATIONS: Final = (
    "state",
    "lidar",
    "lidar/class",
    "elevation",
    "elevation/seen",
    "camera/photo",
    "camera/label",
    "privileged",
)
"""Names; ``camera`` alone means both of its images."""
_ROUTE: Final = {"random": {"length_m": 20, "seed": 0}}
"""Of experiments, which need one."""
Share = Annotated[Number, Field(ge=0, le=1)]
Seed = Annotated[Integer, Field(ge=0, lt=2**63)]


def experiment_of(**values: Any) -> Experiment:
    """Return an experiment with these values in place of the usual ones; None keeps them."""
    given = {key: value for key, value in values.items() if value is not None}
    return validated({"name": "learning", "environment": "park", "route": _ROUTE} | given, "")


class SensorValues(Frozen):
    """Values of the small sensors that replace the usual ones."""

    lidar: Mapping[str, Any] = {}
    camera: Mapping[str, Any] = {}


class LearningConfig(Frozen):
    """Keyword arguments of the environments."""

    environment: str = "park"
    worlds: Annotated[
        Annotated[Integer, Field(ge=1, le=TEST_WORLDS)] | Annotated[tuple[Seed, ...], Field(min_length=1)],
        Field(description=f"a number of worlds from 1 to {TEST_WORLDS}, or a list of their seeds"),
    ] = 1
    split: Literal["train", "test"] = "train"
    episodes_per_world: Annotated[Integer, Field(ge=1)] = 20
    difficulty: Annotated[
        Share | tuple[Share, Share], Field(description="a number from 0 to 1, or the lowest and the highest")
    ] = (0.0, 1.0)
    observation: Annotated[
        str | Annotated[tuple[str, ...], Field(min_length=1)],
        Field(description=f"one or several of {', '.join(OBSERVATIONS)}"),
    ] = "state"
    action: Literal["speed", "wheels"] = "speed"
    reward: Weights = Weights()
    robot: Any = None
    sensors: SensorValues = SensorValues()
    light: Any = None
    season: str | None = None
    layout: Mapping[str, Any] = {}
    control_hz: Annotated[Number, Field(ge=1, le=200)] = 10.0
    physics_ms: Literal[1, 2, 4, 5] = 5
    time_limit: Positive | None = None

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Return the arguments.

        Raises:
            UnknownNameError: an observation that does not exist.
            ConfigurationError: another value that is not allowed.
        """
        made = validated_as(cls, values)
        for name in made.names:
            if name not in OBSERVATIONS:
                raise UnknownNameError("observation", name, OBSERVATIONS)
        return made

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        low, high = self.range
        if low > high:
            raise LocatedError(f"must have the lowest first, got {[low, high]}", ["difficulty"])
        steps = 1000.0 / self.control_hz / self.physics_ms
        if abs(steps - round(steps)) > 1e-9:
            what = f"must make whole steps of the physics of {self.physics_ms} ms, got {self.control_hz:g}"
            raise LocatedError(what, ["control_hz"])
        return self

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the worlds."""
        if isinstance(self.worlds, tuple):
            return self.worlds
        first = TEST_WORLDS if self.split == "test" else 0
        return tuple(range(first, first + self.worlds))

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest difficulty."""
        return self.difficulty if isinstance(self.difficulty, tuple) else (self.difficulty, self.difficulty)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the observations."""
        asked = (self.observation,) if isinstance(self.observation, str) else self.observation
        both = ("camera/photo", "camera/label")
        return tuple(dict.fromkeys(each for name in asked for each in (both if name == "camera" else (name,))))

    @property
    def steps(self) -> int:
        """Steps of the physics in a step of control."""
        return round(1000.0 / self.control_hz / self.physics_ms)

    def experiment(self) -> Experiment:
        """Return the experiment of world, light and robot."""
        layout = {**self.layout, **({} if self.season is None else {"season": self.season})}
        rig = None if self.robot is None else {"robot": self.robot}
        return experiment_of(environment=self.environment, layout=layout, rig=rig, light=self.light)

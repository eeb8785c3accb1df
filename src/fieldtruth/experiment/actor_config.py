# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Actors of an experiment: people, animals and vehicles that move, by name. See docs/actors.md."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Final, Literal, Self, get_args

from pydantic import Field, model_validator

from fieldtruth.core.classes import Label
from fieldtruth.experiment.fields import Frozen, Integer, LocatedError, Number, Positive

Kind = Literal["person", "dog", "deer", "cow", "cyclist", "car", "tractor", "robot", "multirotor"]
Behaviour = Literal["trails", "wander", "cross", "stand", "sit", "graze", "hover", "orbit", "pass"]
"""trails: along trails from junction to junction, to and fro. wander: from place to place on free ground. cross: over
the way of the robot, when it comes near. stand, sit: at one place. graze: slow steps with stops; flees from the robot.
hover, orbit, pass (over the robot's way): in the air."""

MOST_ACTORS: Final = 200
KINDS: Final[tuple[str, ...]] = get_args(Kind)
_GROUND: Final = ("trails", "wander", "cross", "stand")
BEHAVIOURS: Final[Mapping[str, tuple[str, ...]]] = {
    "person": (*_GROUND, "sit"),
    "dog": _GROUND,
    "deer": ("graze", "wander", "stand"),
    "cow": ("graze", "wander", "stand"),
    "cyclist": ("trails", "wander", "cross"),
    "car": ("trails", "wander", "cross", "stand"),
    "tractor": ("trails", "wander", "cross", "stand"),
    "robot": _GROUND,
    "multirotor": ("hover", "orbit", "pass"),
}
"""Behaviours of each kind, the default first."""
LABELS: Final[Mapping[str, tuple[Label, ...]]] = {
    "person": (Label.PERSON,),
    **dict.fromkeys(("dog", "deer", "cow"), (Label.ANIMAL,)),
    "cyclist": (Label.VEHICLE, Label.PERSON),
    **dict.fromkeys(("car", "tractor"), (Label.VEHICLE,)),
    "robot": (Label.ROBOT,),
    "multirotor": (Label.AERIAL_VEHICLE,),
}
"""Classes of each kind: of the whole, and of further parts."""
_Metre = Annotated[Number, Field(ge=-10_000, le=10_000)]


class ScriptPoint(Frozen):
    """Where an actor is at a time: it moves between two points at a constant speed, and stands before and after."""

    at_s: Annotated[Number, Field(ge=0, le=86_400)]
    xy: Annotated[tuple[_Metre, _Metre], Field(description="[x, y] in metres")]
    height_m: Annotated[Number, Field(ge=0, le=500)] | None = None
    """Above the ground, of a multirotor; None: that of the actor."""


class ActorConfig(Frozen):
    """One actor, or ``count`` equal ones."""

    kind: Annotated[Kind, Field(description=f"one of {', '.join(KINDS)}")]
    count: Annotated[Integer, Field(ge=1)] = 1
    """Above 1, the names are NAME_1, NAME_2 and so on."""
    behaviour: Annotated[Behaviour, Field(description=f"one of {', '.join(get_args(Behaviour))}")] | None = None
    """None: the first of the kind's; with a script, none."""
    together: bool = False
    """True: they go as a group."""
    speed: Positive | None = None
    """[m/s] when nothing is in the way; None: that of the kind. A person runs above 2 m/s."""
    start: Annotated[tuple[_Metre, _Metre], Field(description="[x, y] in metres")] | None = None
    """None: a random place that fits the behaviour, near the robot's way."""
    height_m: Annotated[Number, Field(ge=1, le=500)] = 8.0
    """Of a multirotor above the ground."""
    script: Annotated[tuple[ScriptPoint, ...], Field(description="a list of {at_s: ..., xy: [x, y]}")] = ()
    """Exact points and times, in place of a behaviour: straight lines, whatever is in the way."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        allowed = BEHAVIOURS[self.kind]
        if self.behaviour is not None and self.behaviour not in allowed:
            what = f"must be one of {', '.join(allowed)} for a {self.kind}, got {self.behaviour}"
            raise LocatedError(what, ("behaviour",))
        if not self.script:
            return self
        for key in ("behaviour", "start", "speed"):
            if getattr(self, key) is not None:
                raise LocatedError("and script exclude each other: the script says where the actor is", (key,))
        if self.count > 1:
            raise LocatedError("must be 1 with a script", ("count",))
        for k, (before, after) in enumerate(pairwise(self.script), 1):
            if after.at_s <= before.at_s:
                raise LocatedError(f"must be above that of the point before, {before.at_s:g}", ("script", k, "at_s"))
        return self

    @property
    def chosen_behaviour(self) -> str:
        """The behaviour, or "script"."""
        return "script" if self.script else self.behaviour or BEHAVIOURS[self.kind][0]


def actor_names(actors: Mapping[str, ActorConfig]) -> list[tuple[str, str]]:
    """Return the name of each actor, and that of its configuration."""
    numbered = ((name, k, config.count) for name, config in actors.items() for k in range(1, config.count + 1))
    return [(name if count == 1 else f"{name}_{k}", name) for name, k, count in numbered]

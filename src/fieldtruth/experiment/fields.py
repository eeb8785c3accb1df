# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Types of values in the configuration, the base of its classes, and one-line messages: key, condition, value."""

from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, NamedTuple, Self, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, Strict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError

Model = TypeVar("Model", bound=BaseModel)
UNKNOWN_KEY: Final = ("extra_forbidden", "invalid_key")
TYPES: Final = {bool: "true or false", int: "an integer", float: "a number", str: "a string"}
BOUNDS: Final = {"ge": "at least {}", "gt": "above {}", "le": "at most {}", "lt": "below {}"}
MAX_VALUE_LENGTH: Final = 60  # characters


class PartError(ValueError):
    """A part of a configuration that is not allowed: its model, its errors, and its position in the whole."""

    def __init__(self, model: type[BaseModel], report: ValidationError, at: Sequence[int | str] = ()) -> None:
        super().__init__(str(report))
        self.model, self.report, self.at = model, report, tuple(at)


class LocatedError(ValueError):
    """A rule between values that is broken; its text states the condition, ``at`` is the position of the value."""

    def __init__(self, text: str, at: Sequence[int | str]) -> None:
        super().__init__(text)
        self.at = tuple(at)


class _Problem(NamedTuple):
    """One error of pydantic: its part of the configuration, the position of that part, and that within it."""

    model: type[BaseModel]
    at: tuple[int | str, ...]
    loc: tuple[int | str, ...]
    error: ErrorDetails

    @property
    def key(self) -> str:
        """Position in the whole configuration."""
        return dotted((*self.at, *self.loc))


def _problems(model: type[BaseModel], report: ValidationError, at: tuple[int | str, ...] = ()) -> Iterator[_Problem]:
    for error in report.errors():
        loc = _without_tags(model, error["loc"])
        cause = error.get("ctx", {}).get("error")
        if isinstance(cause, PartError):
            yield from _problems(cause.model, cause.report, (*at, *loc, *cause.at))
        elif isinstance(cause, LocatedError):
            yield _Problem(model, at, (*loc, *cause.at), error)
        else:
            yield _Problem(model, at, loc, error)


def configuration_error(model: type[BaseModel], report: ValidationError, source: str = "") -> ConfigurationError:
    """Make one line of the first error of ``model``; ``source``, for example a file, is put in front."""
    # A misspelt key is also a missing one: report the cause, not its consequence.
    problems = sorted(_problems(model, report), key=lambda each: each.error["type"] not in UNKNOWN_KEY)
    where = {each.key for each in problems}  # one of several types: an error for each
    more = f" (and {len(where) - 1} more)" if len(where) > 1 else ""
    line = _message(problems[0])
    return ConfigurationError(f"{source}: {line}{more}" if source else f"{line}{more}")


def validated_as(model: type[Model], values: Mapping[str, Any], source: str = "") -> Model:
    """Return a configuration of values as in a file; ConfigurationError is as of ``configuration_error``."""
    try:
        return model.model_validate(dict(values))
    except ValidationError as report:
        raise configuration_error(model, report, source) from report


def part(model: type[Model], value: object, *at: int | str) -> Model:
    """Validate a value that belongs at ``at`` of the value that is validated around it.

    Raises:
        PartError: it is not allowed.
    """
    try:
        return model.model_validate(value)
    except ValidationError as report:
        raise PartError(model, report, at) from report


def _message(problem: _Problem) -> str:
    model, at, loc, error = problem
    kind, key = error["type"], problem.key
    if kind == "missing":
        return f"{key} is required: {condition_at(model, loc)}"
    if kind in UNKNOWN_KEY:
        parent, _ = _field(model, loc[:-1])
        known = [
            name
            for choice in models_of(parent)
            for name in (*getattr(choice, "also", ()), *choice.model_fields, *getattr(choice, "besides", tuple)())
        ]
        return _unknown_key((*at, *loc), known)
    if kind == "value_error":  # a rule across fields; its text states the condition
        text = error["msg"].removeprefix("Value error, ")
        located = isinstance(error.get("ctx", {}).get("error"), LocatedError)
        return f"{key}{'' if located else ':'} {text}" if key else text
    return f"{key or 'the configuration'} must be {condition_at(model, loc)}, got {shortened(error['input'])}"


def _unknown_key(loc: Sequence[int | str], known: Sequence[str]) -> str:
    # Only the last part is compared: with the common part in front, every key would look close.
    close = get_close_matches(str(loc[-1]).lower(), known, n=1)
    question = f"did you mean {dotted((*loc[:-1], close[0]))!r}? " if close else ""
    return f"unknown key {dotted((*loc[:-1], str(loc[-1])))!r}; {question}Available: {', '.join(known)}"


def dotted(loc: Sequence[int | str]) -> str:
    """Write the position of a value in the configuration: ``route.waypoints[3][0]``."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in loc).removeprefix(".")


def shortened(value: object) -> str:
    """``repr`` of at most 60 characters."""
    text = repr(value)
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[:MAX_VALUE_LENGTH]}..."


def models_of(annotation: Any) -> list[type[BaseModel]]:
    """Models of an annotation: one, or the choices of a union, which have different keys."""
    if get_origin(annotation) is Annotated:
        return models_of(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return [model for choice in get_args(annotation) for model in models_of(choice)]
    return [annotation] if isinstance(annotation, type) and issubclass(annotation, BaseModel) else []


def _without_tags(model: type[BaseModel], loc: Sequence[int | str]) -> tuple[int | str, ...]:
    """Position without the tags that pydantic adds where one of several types is chosen."""
    keys: tuple[int | str, ...] = ()
    at_choice = False
    for step in loc:
        if not at_choice:
            keys = (*keys, step)
        at_choice = not at_choice and _is_choice(_field(model, keys)[0])
    return keys


def _is_choice(annotation: Any) -> bool:
    """Return whether an annotation allows several types, None not counted."""
    if get_origin(annotation) is Annotated:
        return _is_choice(get_args(annotation)[0])
    is_union = get_origin(annotation) in (Union, UnionType)
    return is_union and sum(choice is not NoneType for choice in get_args(annotation)) > 1


def _field(model: Any, loc: Sequence[int | str]) -> tuple[Any, FieldInfo]:
    """Type and constraints at the position ``loc`` of ``model``, as deep as it exists."""
    annotation, info = model, FieldInfo()
    for step in loc:
        owners = [choice for choice in models_of(annotation) if step in choice.model_fields]
        if owners:
            info = owners[0].model_fields[str(step)]
        elif get_origin(annotation) is tuple and isinstance(step, int):
            items = get_args(annotation)
            info = FieldInfo.from_annotation(items[0 if Ellipsis in items else min(step, len(items) - 1)])
        elif get_origin(annotation) is Mapping and models_of(get_args(annotation)[1]):
            info = FieldInfo.from_annotation(get_args(annotation)[1])
        else:
            break
        annotation = info.annotation
        choices = [a for a in get_args(annotation) if a is not NoneType]
        if NoneType in get_args(annotation) and len(choices) == 1:
            info = FieldInfo.from_annotation(choices[0])
            annotation = info.annotation
    return annotation, info


def condition_at(model: type[BaseModel], loc: Sequence[int | str]) -> str:
    """State what is allowed at a position of the configuration: "an integer between 8 and 4096"."""
    annotation, info = _field(model, loc)
    if info.description:
        return info.description
    if models_of(annotation):
        return f"a mapping with the keys {', '.join(models_of(annotation)[0].model_fields)}"
    if get_origin(annotation) is Literal:
        *others, last = map(str, get_args(annotation))
        return f"{', '.join(others)} or {last}" if others else last
    if get_origin(annotation) is tuple:
        items = get_args(annotation)
        return "a list with at least one item" if Ellipsis in items else f"a list of {len(items)} numbers"
    return f"{TYPES.get(annotation, 'a value')}{_bounds(info)}"


def _bounds(info: FieldInfo) -> str:
    limits = {name: getattr(rule, name) for rule in info.metadata for name in (*BOUNDS, "multiple_of")
              if hasattr(rule, name)}  # fmt: skip
    multiple = f", a multiple of {limits.pop('multiple_of')}" if "multiple_of" in limits else ""
    if limits.keys() == {"ge", "le"}:
        return f" between {limits['ge']} and {limits['le']}{multiple}"
    parts = [text.format(limits[name]) for name, text in BOUNDS.items() if name in limits]
    of = " of" if limits.keys() & {"ge", "le"} == limits.keys() and parts else ""
    return f"{of} {' and '.join(parts)}{multiple}" if parts else multiple


# Strict: strings and booleans are not numbers.
Name = Annotated[
    str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$", description="a word of at most 64 letters, digits, - and _")
]
Number = Annotated[float, Strict()]
Integer = Annotated[int, Strict()]
Boolean = Annotated[bool, Strict()]
Positive = Annotated[Number, Field(gt=0)]
Range = Annotated[Number, Field(gt=0, le=100_000)]  # [m]; single precision resolves 1 cm there
Rate = Annotated[Number, Field(ge=0.01, le=1000)]  # [Hz]; the physics runs at 1 kHz


class Frozen(BaseModel):
    """Base of all configuration: immutable, finite numbers only, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values, which are not validated.

        Raises:
            TypeError: there is no such key; pydantic would ignore it.
        """
        if unknown := (update or {}).keys() - type(self).model_fields.keys():
            raise TypeError(f"{type(self).__name__} has no {', '.join(sorted(unknown))}")
        return super().model_copy(update=update, deep=deep)


class Mount(Frozen):
    """Pose of a frame in base_link: ``xyz`` [m]; ``rpy_deg`` roll, pitch, yaw about fixed axes [deg]."""

    xyz: tuple[Number, Number, Number]
    rpy_deg: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)

    @property
    def base_from_sensor(self) -> Array:
        """(4, 4) transform from the mounted frame to base_link."""
        return transforms.pose(self.xyz, self.rpy_deg)

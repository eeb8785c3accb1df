# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One line out of a validation report: which key, which value, and what is allowed there."""

from collections.abc import Sequence
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from fieldtruth.core.errors import ConfigurationError, nearest_first

UNKNOWN_KEY: Final = ("extra_forbidden", "invalid_key")
KINDS: Final = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
RULES: Final = {"ge": "from {}", "gt": "above {}", "le": "up to {}", "lt": "below {}", "multiple_of": "in steps of {}"}
LONGEST_VALUE: Final = 60  # characters


def configuration_error(model: type[BaseModel], report: ValidationError, source: str = "") -> ConfigurationError:
    """Make one line of the first complaint about ``model``; ``source`` (a file, say) is put in front."""
    # A misspelt key is also a missing one: tell the cause before its consequence.
    complaints = sorted(report.errors(), key=lambda c: c["type"] not in UNKNOWN_KEY)
    first = complaints[0]
    rest = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
    place = _without_tags(model, first["loc"])
    line = _complaint(model, first["type"], place, first["input"], first["msg"])
    return ConfigurationError(f"{source}: {line}{rest}" if source else f"{line}{rest}")


def _complaint(model: type[BaseModel], kind: str, loc: Sequence[int | str], value: object, message: str) -> str:
    key = dotted(loc)
    if kind == "missing":
        return f"{key} is missing; needed is {condition_at(model, loc)}"
    if kind in UNKNOWN_KEY:
        key = dotted((*loc[:-1], str(loc[-1])))
        parent, _ = _field(model, loc[:-1])
        keys = nearest_first(str(loc[-1]), [name for home in models_of(parent) for name in home.model_fields])
        return f"no key {key!r}; there is: {', '.join(dotted((*loc[:-1], k)) for k in keys)}"
    if kind == "value_error":  # a rule across fields, which says itself what is right
        text = message.removeprefix("Value error, ")
        return f"{key}: {text}" if key else text
    where = key or "the whole"
    return f"{where} is {shortened(value)}; allowed is {condition_at(model, loc)}"


def dotted(loc: Sequence[int | str]) -> str:
    """Write a place in the configuration as people do: ``route.waypoints[3][0]``."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in loc).removeprefix(".")


def shortened(value: object) -> str:
    """``repr`` on one line and of bearable length."""
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


def models_of(annotation: Any) -> list[type[BaseModel]]:
    """The model, or the several ones of which one is chosen; their keys differ."""
    if get_origin(annotation) is Annotated:
        return models_of(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return [model for choice in get_args(annotation) for model in models_of(choice)]
    return [annotation] if isinstance(annotation, type) and issubclass(annotation, BaseModel) else []


def _without_tags(model: type[BaseModel], loc: Sequence[int | str]) -> tuple[int | str, ...]:
    """The place as people write it: where one of several models is chosen, the report names the choice as well."""
    place: tuple[int | str, ...] = ()
    at_choice = False
    for step in loc:
        if not at_choice:
            place = (*place, step)
        at_choice = not at_choice and len(models_of(_field(model, place)[0])) > 1
    return place


def _field(model: Any, loc: Sequence[int | str]) -> tuple[Any, FieldInfo]:
    """Type and constraints of the place ``loc`` below ``model``, as far as it exists."""
    annotation, info = model, FieldInfo()
    for step in loc:
        homes = [home for home in models_of(annotation) if step in home.model_fields]
        if homes:
            info = homes[0].model_fields[str(step)]
        elif get_origin(annotation) is tuple and isinstance(step, int):
            items = get_args(annotation)
            info = FieldInfo.from_annotation(items[0 if Ellipsis in items else min(step, len(items) - 1)])
        else:
            break
        annotation = info.annotation
        choices = [a for a in get_args(annotation) if a is not NoneType]
        if NoneType in get_args(annotation) and len(choices) == 1:
            info = FieldInfo.from_annotation(choices[0])
            annotation = info.annotation
    return annotation, info


def condition_at(model: type[BaseModel], loc: Sequence[int | str]) -> str:
    """Say in words what is allowed at a place of the configuration."""
    annotation, info = _field(model, loc)
    if info.description:
        return info.description
    if models_of(annotation):
        return f"a mapping with the keys {', '.join(models_of(annotation)[0].model_fields)}"
    if get_origin(annotation) is tuple:
        items = get_args(annotation)
        return "a list of at least one" if Ellipsis in items else f"a list of {len(items)} numbers"
    return f"{KINDS.get(annotation, 'a value')}{_bounds(info)}"


def _bounds(info: FieldInfo) -> str:
    rules = {name: getattr(rule, name) for rule in info.metadata for name in RULES if hasattr(rule, name)}
    parts = [
        f" {RULES[name].format(bound)}" for name, bound in sorted(rules.items(), key=lambda r: list(RULES).index(r[0]))
    ]
    return "".join(parts)

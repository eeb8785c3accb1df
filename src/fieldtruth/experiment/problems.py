# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One line out of a validation report: which key, which value, and what is allowed there."""

from collections.abc import Sequence
from types import NoneType
from typing import Any, Final, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from fieldtruth.errors import ConfigurationError, nearest_first

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
    line = _complaint(model, first["type"], first["loc"], first["input"], first["msg"])
    return ConfigurationError(f"{source}: {line}{rest}" if source else f"{line}{rest}")


def _complaint(model: type[BaseModel], kind: str, loc: Sequence[int | str], value: object, message: str) -> str:
    key = dotted(loc)
    if kind == "missing":
        return f"{key} is missing; needed is {allowed_at(model, loc)}"
    if kind in UNKNOWN_KEY:
        key = dotted((*loc[:-1], str(loc[-1])))
        parent, _ = _field(model, loc[:-1])
        keys = nearest_first(str(loc[-1]), parent.model_fields) if _is_model(parent) else []
        return f"no key {key!r}; there is: {', '.join(dotted((*loc[:-1], k)) for k in keys)}"
    if kind == "value_error":  # a rule across fields, which says itself what is right
        text = message.removeprefix("Value error, ")
        return f"{key}: {text}" if key else text
    where = key or "the whole"
    return f"{where} is {shortened(value)}; allowed is {allowed_at(model, loc)}"


def dotted(loc: Sequence[int | str]) -> str:
    """Write a place in the configuration as people do: ``route.waypoints[3][0]``."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in loc).removeprefix(".")


def shortened(value: object) -> str:
    """``repr`` on one line and of bearable length."""
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _field(model: Any, loc: Sequence[int | str]) -> tuple[Any, FieldInfo]:
    """Type and constraints of the place ``loc`` below ``model``, as far as it exists."""
    annotation, info = model, FieldInfo()
    for step in loc:
        if _is_model(annotation) and step in annotation.model_fields:
            info = annotation.model_fields[str(step)]
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


def allowed_at(model: type[BaseModel], loc: Sequence[int | str]) -> str:
    """Say in words what is allowed at a place of the configuration."""
    annotation, info = _field(model, loc)
    if info.description:
        return info.description
    if _is_model(annotation):
        return f"a mapping with the keys {', '.join(annotation.model_fields)}"
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

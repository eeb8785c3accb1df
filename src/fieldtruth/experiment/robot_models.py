# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Robots by name, without heavy imports: a data file each, which states the source of every figure."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.yaml_io import parse_mapping


@cache
def robot_names() -> tuple[str, ...]:
    """Names of the robots, sorted."""
    folder = files(__package__) / "models" / "robot"
    return tuple(sorted(file.name.removesuffix(".yaml") for file in folder.iterdir() if file.name.endswith(".yaml")))


@cache
def robot_data(name: str) -> dict[str, Any]:
    """Data of a robot: ``description``, and ``figures`` with value and source by key of ``rig.robot``.

    Raises:
        ValueError: unknown name; the text suggests the closest one.
    """
    if name not in robot_names():
        raise ValueError(f"unknown robot {name!r}; {suggestion(name, robot_names())}")
    path = files(__package__) / "models" / "robot" / f"{name}.yaml"
    return parse_mapping(path.read_text(encoding="utf-8"), f"robot {path.name}")


def list_robots() -> dict[str, str]:
    """Name and one-line description of each robot."""
    return {name: str(robot_data(name)["description"]) for name in robot_names()}


def with_robot_model(given: Mapping[str, Any]) -> dict[str, Any]:
    """Complete values of ``rig.robot`` that name a model, also within ``wheels`` and ``caster``; what is given stays.

    Raises:
        ValueError: unknown model.
    """
    values: dict[str, Any] = {}
    for key, figure in robot_data(given["model"])["figures"].items():
        part, _, inner = key.partition(".")
        if inner:
            values.setdefault(part, {})[inner] = figure["value"]
        else:
            values[key] = figure["value"]
    for key, value in given.items():
        known = values.get(key)
        values[key] = {**known, **value} if isinstance(known, dict) and isinstance(value, Mapping) else value
    return values

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Robots by name, without heavy imports: a data file each, which states the source of every figure.

Those of the package are in ``models/robot``, others in folders ``robots`` of FIELDTRUTH_PATH, or named by entry points
of the group ``fieldtruth.robots``.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from fieldtruth.core.errors import suggestion
from fieldtruth.core.registry import Registry
from fieldtruth.core.yaml_io import read_data

ROBOTS: Final[Registry[dict[str, Any]]] = Registry(
    "robot", "robots", ".yaml", read_data, Path(__file__).parent / "models" / "robot"
)


def robot_names() -> tuple[str, ...]:
    """Names of the robots: those of the package, sorted, then added ones."""
    return tuple(ROBOTS)


def robot_data(name: str) -> dict[str, Any]:
    """Data of a robot: ``description``, and ``figures`` with value and source by key of ``rig.robot``.

    Raises:
        ValueError: unknown name; the text suggests the closest one.
    """
    if name not in ROBOTS:
        raise ValueError(f"unknown robot {name!r}; {suggestion(name, ROBOTS)}")
    return ROBOTS[name]


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

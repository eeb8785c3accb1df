# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Models of sensors, and robots, by name; data files state the source of each figure.

Those of the package are in ``models``. Others are in folders ``sensors/KIND`` and ``robots`` of FIELDTRUTH_PATH, or
named by entry points of ``fieldtruth.sensors.KIND`` and ``fieldtruth.robots``.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

from fieldtruth.core.errors import suggestion
from fieldtruth.core.registry import Registry
from fieldtruth.core.yaml_io import parse_mapping, read_data

_DATA: Final = Path(__file__).parent / "models"


@cache
def models(family: str) -> Registry[dict[str, Any]]:
    """Return the models of a family of sensors by name: of a kind, which may be another package's, or of several.

    Each has a ``description``, its ``figures``, ``noise`` and, not simulated, ``stored``: mappings of keys to ``value``
    and ``source``. Figures are keys of the sensor's configuration, with a few exceptions: a single camera has
    no ``baseline``, and a LiDAR with ``firing_cycle_ns`` has its ``columns`` from that and its rate.
    """
    return Registry(f"model of kind {family}", f"sensors/{family}", ".yaml", read_data, _DATA / family)


def list_models(family: str) -> dict[str, str]:
    """Name and one-line description of each model of a family of sensors."""
    return {name: str(model["description"]) for name, model in models(family).items()}


def figures_of(family: str, name: str) -> dict[str, Any]:
    """Values of the figures of a model by key.

    Raises:
        UnknownNameError: no model of that family has the name.
    """
    return {key: figure["value"] for key, figure in models(family).find(name)["figures"].items()}


def datasheet_of(family: str, name: str) -> dict[str, Any]:
    """Values of the ``noise`` of a model by key; empty if it has none."""
    return {key: figure["value"] for key, figure in models(family).get(name, {}).get("noise", {}).items()}


@cache
def preset_of(family: str, name: str) -> dict[str, Any]:
    """Values of a signal that is of no model, ``models/presets/FAMILY_NAME.yaml``, by key; empty without one."""
    path = _DATA / "presets" / f"{family}_{name}.yaml"
    if not path.is_file():
        return {}
    return {key: figure["value"] for key, figure in parse_mapping(path.read_text("utf-8"), path.name)["noise"].items()}


ROBOTS: Final[Registry[dict[str, Any]]] = Registry("robot", "robots", ".yaml", read_data, _DATA / "robot")
"""Each has a ``description``, and ``figures`` with value and source by key of ``rig.robot``."""


def list_robots() -> dict[str, str]:
    """Name and one-line description of each robot."""
    return {name: str(data["description"]) for name, data in ROBOTS.items()}


def with_robot_model(given: Mapping[str, Any]) -> dict[str, Any]:
    """Complete values of ``rig.robot`` that name a model, also within ``wheels`` and ``caster``; what is given stays.

    Raises:
        ValueError: unknown model; the text suggests the closest one.
    """
    if given["model"] not in ROBOTS:
        raise ValueError(f"unknown robot {given['model']!r}; {suggestion(given['model'], ROBOTS)}")
    values: dict[str, Any] = {}
    for key, figure in ROBOTS[given["model"]]["figures"].items():
        part, _, inner = key.partition(".")
        if inner:
            values.setdefault(part, {})[inner] = figure["value"]
        else:
            values[key] = figure["value"]
    for key, value in given.items():
        known = values.get(key)
        values[key] = {**known, **value} if isinstance(known, dict) and isinstance(value, Mapping) else value
    return values

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

TITLES: Final = {
    "lidar": "LiDARs (kind lidar)",
    "camera": "cameras (kinds camera and stereo)",
    "imu": "inertial measurement units (kind imu)",
    "gnss": "GNSS receivers (kind gnss)",
    "wheel_odometry": "wheel encoders (kind wheel_odometry)",
}
"""What the models of each folder are."""
_FOLDERS: Final = {"stereo": "camera"}
"""Folder of the kinds that do not have one of their own."""
_DATA: Final = Path(__file__).parent / "models"


@cache
def models(kind: str) -> Registry[dict[str, Any]]:
    """Return the models of a kind of sensor by name, which another package's kind may have, too.

    Each has a ``description``, its ``figures``, ``noise`` and, not simulated, ``stored``: mappings of keys to ``value``
    and ``source``. Figures are keys of the sensor's configuration, with a few exceptions: a single camera has
    no ``baseline``, and a LiDAR with ``firing_cycle_ns`` has its ``columns`` from that and its rate.
    """
    folder = _FOLDERS.get(kind, kind)
    if folder != kind:
        return models(folder)
    builtin: Path | dict[str, dict[str, Any]] = _DATA / folder if folder in TITLES else {}
    return Registry(f"model of kind {kind}", f"sensors/{folder}", ".yaml", read_data, builtin)


def list_models(kind: str) -> dict[str, str]:
    """Name and one-line description of each model of a kind of sensor."""
    return {name: str(model["description"]) for name, model in models(kind).items()}


def figures_of(kind: str, name: str) -> dict[str, Any]:
    """Values of the figures of a model by key.

    Raises:
        UnknownNameError: no model of that kind has the name.
    """
    return {key: figure["value"] for key, figure in models(kind).find(name)["figures"].items()}


def datasheet_of(kind: str, name: str) -> dict[str, Any]:
    """Values of the ``noise`` of a model by key; empty if it has none."""
    return {key: figure["value"] for key, figure in models(kind).get(name, {}).get("noise", {}).items()}


@cache
def preset_of(kind: str, name: str) -> dict[str, Any]:
    """Values of a signal that is of no model, ``models/presets/KIND_NAME.yaml``, by key; empty without one."""
    path = _DATA / "presets" / f"{_FOLDERS.get(kind, kind)}_{name}.yaml"
    if not path.is_file():
        return {}
    return {key: figure["value"] for key, figure in parse_mapping(path.read_text("utf-8"), path.name)["noise"].items()}


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

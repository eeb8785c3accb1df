# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors by name, without heavy imports: ``models/KIND/NAME.yaml`` states each figure with its source."""

from functools import cache
from importlib.resources import files
from typing import Any, Final

from fieldtruth.core.errors import UnknownNameError
from fieldtruth.experiment.yaml_io import parse_mapping

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


@cache
def models(kind: str) -> dict[str, dict[str, Any]]:
    """Return the models of a kind of sensor by name; none of a kind that is not the package's.

    Each has a ``description``, its ``figures``, ``noise`` and, not simulated, ``stored``: mappings of keys to ``value``
    and ``source``. Figures are keys of the sensor's configuration, with a few exceptions: a single camera has
    no ``baseline``, and a LiDAR with ``firing_cycle_ns`` has its ``columns`` from that and its rate.
    """
    folder = _FOLDERS.get(kind, kind)
    if folder not in TITLES:
        return {}
    entries = (files("fieldtruth.experiment") / "models" / folder).iterdir()
    found = sorted((entry for entry in entries if entry.name.endswith(".yaml")), key=lambda entry: entry.name)
    return {e.name.removesuffix(".yaml"): parse_mapping(e.read_text(encoding="utf-8"), e.name) for e in found}


def list_models(kind: str) -> dict[str, str]:
    """Name and one-line description of each model of a kind of sensor."""
    return {name: str(model["description"]) for name, model in models(kind).items()}


def figures_of(kind: str, name: str) -> dict[str, Any]:
    """Values of the figures of a model by key.

    Raises:
        UnknownNameError: no model of that kind has the name.
    """
    if name not in models(kind):
        raise UnknownNameError(f"model of kind {kind}", name, models(kind))
    return {key: figure["value"] for key, figure in models(kind)[name]["figures"].items()}


def datasheet_of(kind: str, name: str) -> dict[str, Any]:
    """Values of the ``noise`` of a model by key; empty if it has none."""
    return {key: figure["value"] for key, figure in models(kind).get(name, {}).get("noise", {}).items()}


@cache
def preset_of(kind: str, name: str) -> dict[str, Any]:
    """Values of a signal that is of no model, ``models/presets/KIND_NAME.yaml``, by key; empty without one."""
    path = files("fieldtruth.experiment") / "models" / "presets" / f"{_FOLDERS.get(kind, kind)}_{name}.yaml"
    if not path.is_file():
        return {}
    return {key: figure["value"] for key, figure in parse_mapping(path.read_text("utf-8"), path.name)["noise"].items()}

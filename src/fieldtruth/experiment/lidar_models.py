# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""LiDAR models by name, without heavy imports: a data file each, which states the source of every figure."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Final

from fieldtruth.core.errors import UnknownNameError
from fieldtruth.experiment.yaml_io import parse_mapping

CYCLE: Final = "firing_cycle_ns"
"""Time [ns] from one firing of a beam to its next, of models whose columns per scan depend on the rate."""


@cache
def _models() -> dict[str, dict[str, Any]]:
    folder = files("fieldtruth.experiment") / "models" / "lidar"
    entries = sorted((e for e in folder.iterdir() if e.name.endswith(".yaml")), key=lambda e: e.name)
    return {
        e.name.removesuffix(".yaml"): parse_mapping(e.read_text(encoding="utf-8"), f"LiDAR model {e.name}")
        for e in entries
    }


def list_lidars() -> dict[str, str]:
    """Name and one-line description of each LiDAR model."""
    return {name: str(model["description"]) for name, model in _models().items()}


def figures_of(name: str) -> dict[str, Any]:
    """Figures of a LiDAR model: keys of ``rig.lidar``, and ``firing_cycle_ns`` where columns depend on the rate.

    Raises:
        UnknownNameError: unknown name.
    """
    if name not in _models():
        raise UnknownNameError("LiDAR model", name, _models())
    return {key: figure["value"] for key, figure in _models()[name]["figures"].items()}


def with_lidar_model(given: Mapping[str, Any]) -> dict[str, Any]:
    """Complete values of ``rig.lidar`` that name a model; what is given, other than None, stays.

    Raises:
        UnknownNameError: unknown model.
    """
    own = {key: value for key, value in given.items() if value is not None}
    values = {"spinning": True} | figures_of(own["model"]) | own
    cycle, rate = values.pop(CYCLE, None), values["rate_hz"]
    if cycle is not None and isinstance(rate, int | float) and rate > 0:
        values.setdefault("columns", round(1e9 / rate / cycle))
    return values


def with_rings(given: Mapping[str, Any]) -> dict[str, Any]:
    """Complete values of ``rig.lidar`` that list elevations: their number, and the angle that they span [deg]."""
    angles = given.get("elevations_deg")
    if not isinstance(angles, list | tuple) or not all(_is_angle(angle) for angle in angles):
        return dict(given)  # the field reports it
    derived: dict[str, Any] = {"rings": len(angles)} if angles else {}
    if len(set(angles)) > 1:
        derived["vertical_fov_deg"] = round(float(max(angles) - min(angles)), 9)
    return derived | dict(given)


def _is_angle(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and -90 < value < 90

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cameras by name: ``models/camera/NAME.yaml`` has the data, with their source, that a user need not give."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.yaml_io import parse_mapping


@cache
def camera_names() -> tuple[str, ...]:
    """Names of the cameras, sorted."""
    folder = files(__package__) / "models" / "camera"
    return tuple(sorted(file.name.removesuffix(".yaml") for file in folder.iterdir() if file.name.endswith(".yaml")))


def list_cameras() -> dict[str, str]:
    """Name and one-line description of each camera model."""
    return {name: str(camera_data(name)["title"]) for name in camera_names()}


@cache
def camera_data(name: str) -> dict[str, Any]:
    """Data of a camera: ``title``, ``sources``, ``cameras`` (keys of rig.cameras) and ``baseline_m`` if it is a pair.

    Raises:
        ValueError: unknown name; the text suggests the closest one.
    """
    if name not in camera_names():
        raise ValueError(f"model: unknown camera {name!r}; {suggestion(name, camera_names())}")
    path = files(__package__) / "models" / "camera" / f"{name}.yaml"
    return parse_mapping(path.read_text(encoding="utf-8"), path.name)


def with_camera_model(given: Mapping[str, Any], is_pair: bool) -> dict[str, Any]:
    """Complete the values of a camera that name a model, with its baseline if it is a pair; what is given stays.

    A panorama without fields of view has the whole sphere.

    Raises:
        ValueError: unknown model.
    """
    values, name = dict(given), given.get("model")
    if isinstance(name, str):
        data = camera_data(name)
        pair = {"baseline": data["baseline_m"]} if is_pair and "baseline_m" in data else {}
        values = {**data["cameras"], **pair, **values}
    lens = values.get("lens")
    model = lens.get("model") if isinstance(lens, Mapping) else getattr(lens, "model", None)
    if model == "equirectangular":
        values = {"horizontal_fov_deg": 360.0, "vertical_fov_deg": 180.0, **values}
    return values

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cameras by name: ``models/camera/NAME.yaml`` has the data, with their source, that a user need not give."""

from functools import cache
from importlib.resources import files
from typing import Any, Final

from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.yaml_io import parse_mapping

_MOUNT: Final = {"xyz": [0.15, 0.0, 0.72], "rpy_deg": [0.0, 90.0, 0.0]}
"""Middle of the pair, as in the paper."""


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


def with_camera_model(values: dict[str, Any]) -> dict[str, Any]:
    """Return the keys of rig.cameras, with those of the named model where they are not given.

    A panorama without fields of view has the whole sphere.

    Raises:
        ValueError: unknown model.
    """
    name = values.get("model")
    if isinstance(name, str):
        data = camera_data(name)
        values = {**data["cameras"], **values}
        if "baseline_m" in data and not {"left", "right"} & values.keys():
            (x, y, z), half = _MOUNT["xyz"], data["baseline_m"] / 2.0
            values |= {"left": _MOUNT | {"xyz": [x, y + half, z]}, "right": _MOUNT | {"xyz": [x, y - half, z]}}
    lens = values.get("lens")
    model = lens.get("model") if isinstance(lens, dict) else getattr(lens, "model", None)
    if model == "equirectangular":
        values = {"horizontal_fov_deg": 360.0, "vertical_fov_deg": 180.0, **values}
    return values

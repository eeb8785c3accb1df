# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The cameras of a rig as Kalibr's camchain.yaml (its wiki, "yaml formats"), for SLAM that reads it.

Kalibr counts pixels as ROS and OpenCV do: the centre of the first is (0, 0), as it starts its search for the principal
point at (columns - 1) / 2. A pinhole is written as radtan with four zeros, which every version of Kalibr reads.
"""

import warnings
from typing import Any, Final

import numpy as np

from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_families import ImagingConfig

_HEADER: Final = """\
# Kalibr's camchain: T_cn_cnm1 takes points of the camera before to this one, T_cam_imu those of the IMU.
"""


def camchain_text(rig: Rig) -> str:
    """Return the text of camchain.yaml: cam0, cam1, ... are the views of the cameras, in the order of the rig.

    The IMU is the rig's first. Cameras with a lens that Kalibr does not have are left out, with a comment and a
    warning.

    Raises:
        ConfigurationError: no camera remains.
    """
    chain: dict[str, Any] = {}
    lines, last = [_HEADER], np.eye(4)
    missing: dict[str, str] = {}
    for imager in rig.imagers:
        lens = _lens(imager.config)
        if isinstance(lens, str):
            missing[imager.config.name] = lens
            continue
        name, base_from_cam = f"cam{len(chain)}", imager.base_from_optical
        entry = {**lens, "resolution": [imager.config.width, imager.config.height]}
        entry["rostopic"] = imager.topic_of("photograph")
        if chain:
            entry["T_cn_cnm1"] = _rows(frames.inverse(base_from_cam) @ last)
        if rig.imus:
            entry["T_cam_imu"] = _rows(frames.inverse(base_from_cam) @ rig.imus[0].mount.base_from_sensor)
            entry["timeshift_cam_imu"] = 0.0
        lines.append(f"# {name}: {imager.name}, frame {imager.optical_frame}\n")
        chain[name], last = entry, base_from_cam
    reasons = "; ".join(f"camera {name} has {lens}, which Kalibr does not have" for name, lens in missing.items())
    if not chain:
        raise ConfigurationError(f"rig.sensors: no camera for Kalibr: {reasons or 'the rig has none that is enabled'}")
    if missing:
        warnings.warn(f"left out of the camchain: {reasons}", FieldtruthWarning, stacklevel=2)
        lines.append(f"# Left out: {reasons}\n")
    return "".join(lines) + write_mapping(chain)


def _lens(config: ImagingConfig) -> dict[str, Any] | str:
    """Return the lens with Kalibr's keys, or what Kalibr does not have."""
    lens = config.projection
    if lens.model in ("pinhole", "plumb_bob"):
        k1, k2, p1, p2, k3 = lens.coefficients or (0.0,) * 5
        if k3 != 0.0:
            return f"the lens plumb_bob with k3 = {k3:g}"
        model, coefficients = "radtan", [k1, k2, p1, p2]
    elif lens.model == "equidistant":
        model, coefficients = "equidistant", list(lens.coefficients)
    else:
        return f"the lens {lens.model}"
    return {
        "camera_model": "pinhole",
        "intrinsics": [float(value) for value in (lens.fx, lens.fy, lens.cx, lens.cy)],
        "distortion_model": model,
        "distortion_coeffs": [float(value) for value in coefficients],
    }


def _rows(matrix: Array) -> list[list[float]]:
    rows: list[list[float]] = (np.round(matrix, 15) + 0.0).tolist()
    return rows

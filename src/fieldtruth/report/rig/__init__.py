# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rig of an experiment for other tools: tree of frames, table of sensors, URDF, Kalibr's files; and its picture.

- The URDF has the robot and the frames of its sensors, for RViz, robot_state_publisher and calibration tools. It has
  no plugins: the description that simulates the sensors in Gazebo is that of ``fieldtruth gazebo``.
- Kalibr's files follow its wiki, "yaml formats". It counts pixels as ROS and OpenCV do: the centre of the first is
  (0, 0), as it starts its search for the principal point at (columns - 1) / 2. A pinhole is written as radtan with four
  zeros, which every version of Kalibr reads.
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag.messages import WORLD, rig_transforms
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.core.lenses import Lens
from fieldtruth.core.readings import Inertial
from fieldtruth.core.templates import templates
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.experiment.rig import Rig, chassis_box, rollers, wheel_cylinders
from fieldtruth.experiment.sensor_config import BASE, SensorConfig

_HEAD: Final = ("frame", "x", "y", "z [m]", "roll", "pitch", "yaw [deg]", "of")
_HEADER: Final = """\
# Kalibr's camchain: T_cn_cnm1 takes points of the camera before to this one, T_cam_imu those of the IMU.
"""
_DIGITS: Final = 15  # behind the decimal point; less is rounding error


def tree_text(rig: Rig) -> str:
    """Return the frames of a rig, each below its parent, with their poses in it and the sensors that they belong to."""
    poses = rig_transforms(rig)
    owner = {name: each for each in rig.sensors for name in (*each.frames(), *each.optical_frames())}
    moving = [wheel.frame for wheel in wheel_cylinders(rig)]
    rows: list[Sequence[str]] = [_HEAD, (WORLD, *[""] * 7), (f"  {BASE}", *[""] * 6, "the robot, which moves")]

    def add(parent: str, depth: int) -> None:
        for (above, name), parent_from_child in poses.items():
            if above == parent:
                sensor = owner.get(name)
                what = "a wheel, which turns" if name in moving else _title(sensor) if sensor else "the robot"
                rows.append(("  " * depth + name, *_pose(parent_from_child), what))
                add(name, depth + 1)

    add(BASE, 2)
    return _aligned(rows, right=range(1, 7))


def sensor_table(rig: Rig) -> str:
    """Return a line for each sensor: name, kind, model, rate, topic and figures."""
    rows = [("sensor", "kind", "model", "rate [Hz]", "topic", "figures")]
    for sensor in rig.sensors:
        head = (sensor.name, sensor.kind, sensor.model or "-", f"{sensor.rate_hz:g}", sensor.topic)
        rows.append((*head, sensor.figures() if sensor.enabled else "off"))
    return _aligned(rows, right=(3,))


def _title(sensor: SensorConfig) -> str:
    own = sensor.kind if sensor.kind == sensor.name else f"{sensor.kind} {sensor.name}"
    return own if sensor.enabled else f"{own}, off"


def _pose(parent_from_child: Array) -> list[str]:
    angles = transforms.rpy_deg_from_rotation(parent_from_child[:3, :3])
    return [f"{value:g}" for value in np.round([*parent_from_child[:3, 3], *angles], 6) + 0.0]


def _aligned(rows: Sequence[Sequence[str]], right: Sequence[int]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = (
        "  ".join(
            cell.rjust(width) if i in right else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )
    return "".join(f"{line.rstrip()}\n" for line in lines)


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
    steering = rig.first(Inertial)
    for imager in rig.imagers:
        lens = kalibr_lens(imager.config.projection)
        if isinstance(lens, str):
            missing[imager.config.name] = lens
            continue
        name, base_from_cam = f"cam{len(chain)}", imager.base_from_optical
        entry = {**lens, "resolution": [imager.config.width, imager.config.height]}
        entry["rostopic"] = imager.topic_of("photograph")
        if chain:
            entry["T_cn_cnm1"] = _rows(transforms.inverse(base_from_cam) @ last)
        if steering.enabled:
            entry["T_cam_imu"] = _rows(transforms.inverse(base_from_cam) @ steering.mount.base_from_sensor)
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


def kalibr_lens(lens: Lens) -> dict[str, Any] | str:
    """Return the lens with Kalibr's keys, or what Kalibr does not have."""
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
    rows: list[list[float]] = (np.round(matrix, _DIGITS) + 0.0).tolist()
    return rows


def noise_text(rig: Rig) -> str:
    """Return the text of imu.yaml; of a rig with several IMUs, a document of each, since Kalibr takes a file of each.

    Raises:
        ConfigurationError: the rig has no IMU that is enabled.
    """
    documents = [text for sensor in rig.giving(Inertial) if (text := sensor.kalibr())]
    if not documents:
        raise ConfigurationError("rig.sensors: no IMU for Kalibr: the rig has none that is enabled")
    return "---\n".join(documents)


def urdf_text(rig: Rig) -> str:
    """Return the text of the URDF: base_link is its root, and every frame of the rig is a link.

    Frames of sensors are fixed; the wheels turn about continuous joints and have inertias.
    """
    robot = rig.robot
    joints = [
        (*names, pose[:3, 3], np.radians(transforms.rpy_deg_from_rotation(pose[:3, :3])))
        for names, pose in rig_transforms(rig).items()
    ]
    environment = templates("fieldtruth.report.rig", autoescape=True)
    environment.filters |= {"number": _number, "numbers": lambda values: " ".join(map(_number, values))}
    return environment.get_template("urdf.xml.jinja").render(
        rig=rig,
        base=BASE,
        chassis=chassis_box(rig),
        mass=robot.chassis_mass,
        moments=robot.chassis_moments,
        rollers=rollers(rig),
        wheels={wheel.frame: wheel for wheel in wheel_cylinders(rig)},
        joints=joints,
        quarter=math.pi / 2,
    )


def _number(value: float) -> str:
    rounded = round(float(value), _DIGITS) + 0.0
    return repr(int(rounded)) if rounded == int(rounded) else repr(rounded)


class Format(NamedTuple):
    """A format of ``fieldtruth rig --to``."""

    text: Callable[[Rig], str]
    endings: tuple[str, ...]
    """Of its files."""


_YAML: Final = (".yaml", ".yml")
FORMATS: Final[Mapping[str, Format]] = {
    "tree": Format(tree_text, (".txt", ".md")),
    "urdf": Format(urdf_text, (".urdf", ".xml")),
    "camchain": Format(camchain_text, _YAML),
    "imu": Format(noise_text, _YAML),
}
"""Formats by name; those of Kalibr have the names of its files."""

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rig as text: tree of frames, table of sensors, URDF, and camchain.yaml and imu.yaml of Kalibr.

- The URDF has the robot and the frames of its sensors, for RViz, robot_state_publisher and calibration tools. It has
  no plugins: the description that simulates the sensors in Gazebo is that of ``fieldtruth gazebo``.
- Kalibr's files follow its wiki, "yaml formats". It counts pixels as ROS and OpenCV do: the centre of the first is
  (0, 0), as it starts its search for the principal point at (columns - 1) / 2. A pinhole is written as radtan with four
  zeros, which every version of Kalibr reads.
- Kalibr refuses a noise of zero (``ConfigReader.py``, ``checkGyroStatistics``), and knows no bias instability and no
  axes. So of three densities the largest is written, and where there is no random walk, one that is as large as the
  bias instability: its Allan deviation K sqrt(tau / 3) meets the flat bottom B at the averaging time (N / B)^2 at which
  white noise does, K = sqrt(3) B^2 / N. Where a sensor has neither, or no noise at all, ``LEAST`` is written.
"""

import math
import warnings
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from fieldtruth.bag.messages import WORLD, rig_transforms
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.experiment.rig import Cylinder, Rig, chassis_box, rollers, wheel_cylinders
from fieldtruth.experiment.sensor_config import BASE, SensorConfig
from fieldtruth.experiment.sensor_families import ImagingConfig
from fieldtruth.sensors.imu.config import ImuConfig, ImuSignal
from fieldtruth.sensors.imu.sensing import Triad

_HEAD: Final = ("frame", "x", "y", "z [m]", "roll", "pitch", "yaw [deg]", "of")
_HEADER: Final = """\
# Kalibr's camchain: T_cn_cnm1 takes points of the camera before to this one, T_cam_imu those of the IMU.
"""
LEAST: Final = 1e-6
"""Written instead of zero, in the unit of the key: less than any IMU has, and enough for Kalibr to divide by."""
_UNITS: Final = {
    "accelerometer_noise_density": "m/s^2/sqrt(Hz)",
    "accelerometer_random_walk": "m/s^3/sqrt(Hz)",
    "gyroscope_noise_density": "rad/s/sqrt(Hz)",
    "gyroscope_random_walk": "rad/s^2/sqrt(Hz)",
}
_COLOURS: Final = {"hull": (0.8, 0.6, 0.05, 1.0), "tyre": (0.12, 0.12, 0.12, 1.0)}
_DIGITS: Final = 15


def tree_text(rig: Rig) -> str:
    """Return the frames of a rig, each below its parent, with their poses in it and the sensors that they belong to."""
    transforms = rig_transforms(rig)
    owner = {name: each for each in rig.sensors for name in (*each.frames(), *each.optical_frames())}
    moving = [wheel.frame for wheel in wheel_cylinders(rig)]
    rows: list[Sequence[str]] = [_HEAD, (WORLD, *[""] * 7), (f"  {BASE}", *[""] * 6, "the robot, which moves")]

    def add(parent: str, depth: int) -> None:
        for (above, name), parent_from_child in transforms.items():
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
    for imager in rig.imagers:
        lens = _lens(imager.config)
        if isinstance(lens, str):
            missing[imager.config.name] = lens
            continue
        name, base_from_cam = f"cam{len(chain)}", imager.base_from_optical
        entry = {**lens, "resolution": [imager.config.width, imager.config.height]}
        entry["rostopic"] = imager.topic_of("photograph")
        if chain:
            entry["T_cn_cnm1"] = _rows(transforms.inverse(base_from_cam) @ last)
        if rig.enabled(ImuConfig):
            base_from_imu = rig.enabled(ImuConfig)[0].mount.base_from_sensor
            entry["T_cam_imu"] = _rows(transforms.inverse(base_from_cam) @ base_from_imu)
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


def imu_text(rig: Rig) -> str:
    """Return the text of imu.yaml; of a rig with several IMUs, a document of each, since Kalibr takes a file of each.

    Raises:
        ConfigurationError: the rig has no IMU that is enabled.
    """
    if not rig.enabled(ImuConfig):
        raise ConfigurationError("rig.sensors: no IMU for Kalibr: the rig has none that is enabled")
    return "---\n".join(_document(config) for config in rig.enabled(ImuConfig))


def _document(config: ImuConfig) -> str:
    comments = [f"Kalibr's imu.yaml of {config.name}, frame {config.frame}"]
    noise: dict[str, float] = {}
    for name in ("accelerometer", "gyroscope"):
        triad = Triad.of(config.signal or ImuSignal(), name)
        density, walk, bottom = (float(figure.max()) for figure in (triad.density, triad.walk, triad.bottom))
        if not walk and bottom and density:
            walk = math.sqrt(3.0) * bottom**2 / density
            comments.append(f"{name}_random_walk stands for the bias instability, {bottom:.3g}")
        noise |= {f"{name}_noise_density": density, f"{name}_random_walk": walk}
    if zeros := [key for key, value in noise.items() if value < LEAST]:
        what = f"{config.name}: {', '.join(zeros)} below {LEAST:g}, which Kalibr needs and which is written instead"
        warnings.warn(what, FieldtruthWarning, stacklevel=3)
        comments.append(what)
    data: dict[str, Any] = {"rostopic": config.topic, "update_rate": config.rate_hz}
    data |= {key: max(value, LEAST) for key, value in noise.items()}
    lines = write_mapping(data).splitlines()
    units = [f"{line}  # {_UNITS[key]}" if (key := line.split(":")[0]) in _UNITS else line for line in lines]
    return "".join(f"# {comment}\n" for comment in comments) + "\n".join(units) + "\n"


class Inertia(NamedTuple):
    """Mass [kg], principal moments (3,) [kg m^2] along x, y, z, and centre of mass (3,) [m]."""

    mass: float
    moments: tuple[float, ...]
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)


def chassis_inertia(rig: Rig) -> Inertia:
    """Inertia of the robot without its wheels."""
    robot = rig.robot
    mass = robot.mass - len(rig.wheels.names) * rig.wheels.mass
    moments = np.array(robot.chassis_inertia) * (mass / robot.chassis_inertia_mass)
    return Inertia(mass, tuple(moments.tolist()), robot.chassis_centre)


def wheel_inertia(rig: Rig) -> Inertia:
    """Inertia of a driven wheel in its frame."""
    return Inertia(rig.wheels.mass, rig.wheels.inertia)


def urdf_text(rig: Rig) -> str:
    """Return the text of the URDF: base_link is its root, and every frame of the rig is a link.

    Frames of sensors are fixed; the wheels turn about continuous joints and have inertias.
    """
    robot = Element("robot", name=rig.robot.model)
    for name, rgba in _COLOURS.items():
        SubElement(SubElement(robot, "material", name=name), "color", rgba=_numbers(rgba))
    _add_base(robot, rig)
    wheels = {wheel.frame: wheel for wheel in wheel_cylinders(rig)}
    for (parent, child), parent_from_child in rig_transforms(rig).items():
        link = SubElement(robot, "link", name=child)
        joint = SubElement(robot, "joint", name=f"{child}_joint", type="continuous" if child in wheels else "fixed")
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)
        rpy = np.radians(transforms.rpy_deg_from_rotation(parent_from_child[:3, :3]))
        SubElement(joint, "origin", xyz=_numbers(parent_from_child[:3, 3]), rpy=_numbers(rpy))
        if child in wheels:
            SubElement(joint, "axis", xyz="0 1 0")
            _add_inertial(link, wheel_inertia(rig))
            _add_tyre(link, wheels[child])
    indent(robot)
    return '<?xml version="1.0"?>\n' + tostring(robot, encoding="unicode") + "\n"


def _add_base(robot: Element, rig: Rig) -> None:
    link = SubElement(robot, "link", name=BASE)
    _add_inertial(link, chassis_inertia(rig))
    box = chassis_box(rig)
    for kind in ("visual", "collision"):
        shape = SubElement(link, kind)
        SubElement(shape, "origin", xyz=_numbers(box.centre))
        SubElement(SubElement(shape, "geometry"), "box", size=_numbers(box.size))
        if kind == "visual":
            SubElement(shape, "material", name="hull")
    for roller in rollers(rig):
        if roller.frame == BASE:
            _add_tyre(link, roller, roller.centre)


def _add_tyre(link: Element, wheel: Cylinder, centre: Iterable[float] = (0.0, 0.0, 0.0)) -> None:
    rpy = _numbers((math.pi / 2, 0.0, 0.0))  # the axis of a cylinder is z, that of a wheel y
    for kind in ("visual", "collision"):
        shape = SubElement(link, kind)
        SubElement(shape, "origin", xyz=_numbers(centre), rpy=rpy)
        size = {"radius": _number(wheel.radius), "length": _number(wheel.width)}
        SubElement(SubElement(shape, "geometry"), "cylinder", size)
        if kind == "visual":
            SubElement(shape, "material", name="tyre")


def _add_inertial(link: Element, inertia: Inertia) -> None:
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_numbers(inertia.centre))
    SubElement(inertial, "mass", value=_number(inertia.mass))
    off = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
    SubElement(inertial, "inertia", dict(zip(("ixx", "iyy", "izz"), map(_number, inertia.moments), strict=True)) | off)


def _numbers(values: Iterable[float] | Array) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    rounded = round(float(value), _DIGITS) + 0.0
    return repr(int(rounded)) if rounded == int(rounded) else repr(rounded)

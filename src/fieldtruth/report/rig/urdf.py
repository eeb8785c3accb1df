# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A URDF of the robot with the frames of its sensors, for RViz, robot_state_publisher and calibration tools.

It has no plugins: the description that simulates the sensors in Gazebo is that of ``fieldtruth gazebo``.
"""

import math
from collections.abc import Iterable
from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from fieldtruth.bag.base_messages import BASE
from fieldtruth.bag.robot_messages import rig_transforms
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig
from fieldtruth.report.rig import body

_COLOURS: Final = {"hull": (0.8, 0.6, 0.05, 1.0), "tyre": (0.12, 0.12, 0.12, 1.0)}
_DIGITS: Final = 15


def urdf_text(rig: Rig) -> str:
    """Return the text of the URDF: base_link is its root, and every frame of the rig is a link.

    Frames of sensors are fixed; the wheels turn about continuous joints and have inertias.
    """
    robot = Element("robot", name=rig.robot.model)
    for name, rgba in _COLOURS.items():
        SubElement(SubElement(robot, "material", name=name), "color", rgba=_numbers(rgba))
    _add_base(robot, rig)
    wheels = {wheel.frame: wheel for wheel in body.wheels(rig)}
    for (parent, child), parent_from_child in rig_transforms(rig).items():
        link = SubElement(robot, "link", name=child)
        joint = SubElement(robot, "joint", name=f"{child}_joint", type="continuous" if child in wheels else "fixed")
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)
        rpy = np.radians(transforms.rpy_deg_from_rotation(parent_from_child[:3, :3]))
        SubElement(joint, "origin", xyz=_numbers(parent_from_child[:3, 3]), rpy=_numbers(rpy))
        if child in wheels:
            SubElement(joint, "axis", xyz="0 1 0")
            _add_inertial(link, body.wheel_inertia(rig))
            _add_tyre(link, wheels[child])
    indent(robot)
    return '<?xml version="1.0"?>\n' + tostring(robot, encoding="unicode") + "\n"


def _add_base(robot: Element, rig: Rig) -> None:
    link = SubElement(robot, "link", name=BASE)
    _add_inertial(link, body.chassis_inertia(rig))
    box = body.chassis(rig)
    for kind in ("visual", "collision"):
        shape = SubElement(link, kind)
        SubElement(shape, "origin", xyz=_numbers(box.centre))
        SubElement(SubElement(shape, "geometry"), "box", size=_numbers(box.size))
        if kind == "visual":
            SubElement(shape, "material", name="hull")
    for roller in body.rollers(rig):
        if roller.frame == BASE:
            _add_tyre(link, roller, roller.centre)


def _add_tyre(link: Element, wheel: body.Cylinder, centre: Iterable[float] = (0.0, 0.0, 0.0)) -> None:
    rpy = _numbers((math.pi / 2, 0.0, 0.0))  # the axis of a cylinder is z, that of a wheel y
    for kind in ("visual", "collision"):
        shape = SubElement(link, kind)
        SubElement(shape, "origin", xyz=_numbers(centre), rpy=rpy)
        size = {"radius": _number(wheel.radius), "length": _number(wheel.width)}
        SubElement(SubElement(shape, "geometry"), "cylinder", size)
        if kind == "visual":
            SubElement(shape, "material", name="tyre")


def _add_inertial(link: Element, inertia: body.Inertia) -> None:
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

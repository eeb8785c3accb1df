# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shape of a robot in base_link: the chassis between the wheels, the wheels and a caster."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig


class Box(NamedTuple):
    """An axis-aligned box in base_link: edge lengths (3,) [m] and centre (3,) [m]."""

    size: Array
    centre: Array


class Cylinder(NamedTuple):
    """A wheel or caster: its frame, its centre (3,) [m] in base_link, radius and width [m]; the axle is y."""

    frame: str
    centre: Array
    radius: float
    width: float

    @property
    def box(self) -> Box:
        """Smallest box around it."""
        return Box(np.array([2 * self.radius, self.width, 2 * self.radius]), self.centre)


def chassis_box(rig: Rig) -> Box:
    """Box of the robot's hull without wheels and sensors."""
    robot = rig.robot
    deck = robot.chassis_top
    return Box(np.array([robot.outline[0], robot.chassis_width, deck]), np.array([0.0, 0.0, deck / 2]))


def wheel_cylinders(rig: Rig) -> tuple[Cylinder, ...]:
    """The driven wheels, by ``rig.wheels.names``."""
    mounts, wheels = rig.mounts(), rig.wheels
    frames = (f"{name}_wheel" for name in wheels.names)
    return tuple(Cylinder(name, np.array(mounts[name].xyz), wheels.radius, wheels.width) for name in frames)


def rollers(rig: Rig) -> tuple[Cylinder, ...]:
    """All that touches the ground: the driven wheels, and the caster of a robot that has one, fixed in base_link."""
    caster = rig.robot.caster
    if caster is None:
        return wheel_cylinders(rig)
    centre = np.array([caster.x, 0.0, caster.radius - rig.robot.ground_clearance])
    return (*wheel_cylinders(rig), Cylinder("base_link", centre, caster.radius, caster.width))


def body_parts(rig: Rig) -> Sequence[Box | Cylinder]:
    """What of the robot hides what is behind it: chassis, wheels and caster; mast and housings have no known shape."""
    return (chassis_box(rig), *rollers(rig))


def visible_parts(rig: Rig) -> Sequence[Box | Cylinder]:
    """What of the robot its sensors see: nothing, unless ``rig.visible``."""
    return body_parts(rig) if rig.visible else ()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shape and masses of the robot for pictures and descriptions, all in base_link."""

from typing import NamedTuple

import numpy as np

from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_body import Box, Cylinder, rollers
from fieldtruth.experiment.robot_body import chassis_box as chassis
from fieldtruth.experiment.robot_body import wheel_cylinders as wheels

__all__ = [
    "Box",
    "Cylinder",
    "Inertia",
    "chassis",
    "chassis_inertia",
    "ground_height",
    "rollers",
    "wheel_inertia",
    "wheels",
]


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


def ground_height(rig: Rig) -> float:
    """Height [m] of flat ground on which the robot stands."""
    return rig.base_footprint.xyz[2]

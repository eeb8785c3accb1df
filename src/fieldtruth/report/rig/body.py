# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shape and masses of the robot for pictures and descriptions, all in base_link."""

from typing import NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.robot import Box as Box
from fieldtruth.drive.robot import body_boxes
from fieldtruth.experiment.rig import Rig


class Inertia(NamedTuple):
    """Mass [kg], principal moments (3,) [kg m^2] along x, y, z, and centre of mass (3,) [m]."""

    mass: float
    moments: tuple[float, ...]
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)


class Wheel(NamedTuple):
    """A wheel: its frame, centre (3,) [m], radius and width [m], and inertia in its frame; the axle is y."""

    frame: str
    centre: Array
    radius: float
    width: float
    inertia: Inertia

    @property
    def box(self) -> Box:
        """Smallest box around it."""
        return Box(np.array([2 * self.radius, self.width, 2 * self.radius]), self.centre)


def chassis(rig: Rig) -> Box:
    """Box of the robot's hull without wheels and sensors."""
    return body_boxes(rig)["chassis"]


def chassis_inertia(rig: Rig) -> Inertia:
    """Inertia of the robot without its wheels."""
    mass = rig.robot.mass - sum(wheel.inertia.mass for wheel in wheels(rig))
    moments = np.array(rig.robot.chassis_inertia) * (mass / rig.robot.chassis_inertia_mass)
    return Inertia(mass, tuple(moments.tolist()), rig.robot.chassis_centre)


def wheels(rig: Rig) -> tuple[Wheel, ...]:
    """The driven wheels."""
    mounts, figures = rig.mounts(), rig.wheels
    inertia, frames = Inertia(figures.mass, figures.inertia), [f"{name}_wheel" for name in figures.names]
    return tuple(Wheel(name, np.array(mounts[name].xyz), figures.radius, figures.width, inertia) for name in frames)


def ground_height(rig: Rig) -> float:
    """Height [m] of flat ground on which the robot stands."""
    return rig.base_footprint.xyz[2]

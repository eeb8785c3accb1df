# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shape and masses of the robot for pictures and descriptions, all in base_link."""

from typing import NamedTuple

import numpy as np

from fieldtruth.bag.base_messages import WHEEL_FRAMES
from fieldtruth.core.arrays import Array
from fieldtruth.drive import husky
from fieldtruth.drive.husky import Box as Box
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
    return husky.body_boxes(rig)["chassis"]


def chassis_inertia(rig: Rig) -> Inertia:
    """Inertia of the robot without its wheels."""
    mass = husky.MASS - sum(wheel.inertia.mass for wheel in wheels(rig))
    moments = np.array(husky.CHASSIS_INERTIA) * (mass / husky.CHASSIS_INERTIA_MASS)
    return Inertia(mass, tuple(moments.tolist()), husky.CHASSIS_CENTRE)


def wheels(rig: Rig) -> tuple[Wheel, ...]:
    """The driven wheels."""
    mounts, width = rig.mounts(), husky.wheel_width(rig.wheels)
    inertia = Inertia(husky.WHEEL_MASS, husky.WHEEL_INERTIA)
    return tuple(Wheel(name, np.array(mounts[name].xyz), rig.wheels.radius, width, inertia) for name in WHEEL_FRAMES)


def ground_height(rig: Rig) -> float:
    """Height [m] of flat ground on which the robot stands."""
    return rig.base_footprint.xyz[2]

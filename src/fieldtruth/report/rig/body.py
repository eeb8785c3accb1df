# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shape of the robot for pictures and descriptions: a box between the wheels, and the wheels, all in base_link."""

from typing import NamedTuple

import numpy as np

from fieldtruth.bag.base_messages import WHEEL_FRAMES
from fieldtruth.core.arrays import Array
from fieldtruth.drive import husky
from fieldtruth.experiment.rig import Rig


class Wheel(NamedTuple):
    """A wheel: its frame, centre (3,) [m] in base_link, radius and width [m]; the axle is y."""

    frame: str
    centre: Array
    radius: float
    width: float

    @property
    def box(self) -> husky.Box:
        """Smallest box around it."""
        return husky.Box(np.array([2 * self.radius, self.width, 2 * self.radius]), self.centre)


def chassis(rig: Rig) -> husky.Box:
    """Box of the robot's hull without wheels and sensors."""
    return husky.body_boxes(rig)["chassis"]


def wheels(rig: Rig) -> tuple[Wheel, ...]:
    """Its wheels."""
    mounts, width = rig.mounts(), husky.wheel_width(rig.wheels)
    return tuple(Wheel(name, np.array(mounts[name].xyz), rig.wheels.radius, width) for name in WHEEL_FRAMES)


def ground_height(rig: Rig) -> float:
    """Height [m] in base_link of flat ground on which the robot stands."""
    return rig.base_footprint.xyz[2]

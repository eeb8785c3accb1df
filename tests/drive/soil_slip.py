# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Slip of a wheel of the robot that climbs, in closed form: the root of traction less weight and resistance."""

import math

from scipy.optimize import brentq

from fieldtruth.drive.soil import soil_rows
from fieldtruth.experiment.robot_config import GRAVITY, RobotConfig
from fieldtruth.kernels.soil import Tyre, compaction, sinkage, slip_factor, traction

ROBOT = RobotConfig()
LOAD = ROBOT.mass * GRAVITY / 4  # [N]
TYRE: Tyre = (ROBOT.wheels.width, 2 * ROBOT.wheels.radius, ROBOT.wheels.tyre_stiffness)


def climbing_slip(ground_type: str, slope_deg: float) -> float:
    """Slip of a quarter of the robot at constant speed straight uphill; ValueError: it does not get up."""
    soil = soil_rows((ground_type,))[0]
    slope = math.radians(slope_deg)
    normal, demand = LOAD * math.cos(slope), LOAD * math.sin(slope)

    def surplus(slip: float) -> float:
        depth = sinkage(normal, TYRE, soil) * slip_factor(slip)
        return traction(slip, normal, depth, TYRE, soil) - demand - compaction(normal, depth, TYRE, soil)

    return float(brentq(surplus, 0.0, 1.0))

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How far sensors look beyond the stamp of their last reading."""

import math

from fieldtruth.drive.physics import STEP_NS
from fieldtruth.experiment.rig import Rig


def sweep_steps(rig: Rig) -> int:
    """Physics steps from a stamp until the last rays of its scan or photograph leave; see ``SensorConfig.late_s``."""
    late_s = max((sensor.late_s for sensor in rig.sensors if sensor.enabled), default=0.0)
    return math.ceil(round(1e9 * late_s, 3) / STEP_NS)

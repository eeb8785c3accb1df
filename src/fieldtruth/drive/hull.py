# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the ground is so near the chassis that MuJoCo must look for contacts between them.

On ground of 5 cm that search takes a quarter of a step's time, and nearly always finds nothing.
"""

from typing import Final

import numpy as np
from scipy.ndimage import maximum_filter

from fieldtruth.core.arrays import Array
from fieldtruth.drive.physics import STEP_S
from fieldtruth.drive.robot import body_boxes
from fieldtruth.experiment.rig import Rig
from fieldtruth.kernels.tyre import clearance
from fieldtruth.world.model import Heightfield

EVERY: Final = 20
"""Steps of the physics from one look at the ground to the next."""
NEAR: Final = 0.05
"""Distance [m] below the chassis; it comes nearer by less in ``EVERY`` steps: 4 cm at 5 m/s where a slope of 20 deg
begins."""
_PITCH: Final = 0.1
"""Greatest distance [m] between the points of the chassis at which the ground below is looked up."""


class Hull:
    """The underside of the chassis above ``field``."""

    def __init__(self, field: Heightfield, rig: Rig) -> None:
        # Half a pitch, a node, and what it moves until the next look: 2 cm at 1 m/s.
        faster = max(rig.robot.max_speed - 1.0, 0.0) * EVERY * STEP_S
        reach = int(np.ceil((_PITCH + faster) / field.spacing)) + 1
        self._highest = maximum_filter(field.heights, 2 * reach + 1, mode="nearest")
        self._field = field
        box = body_boxes(rig)["chassis"]
        low, high = box.centre - box.size / 2, box.centre + box.size / 2
        x, y = (np.linspace(low[k], high[k], int(np.ceil(box.size[k] / _PITCH)) + 1) for k in range(2))
        self._points = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), low[2])], axis=-1).reshape(-1, 3)

    def is_near_ground(self, qpos: Array) -> bool:
        """Whether some ground is less than ``NEAR`` below the chassis.

        ``qpos`` begins with base_link's position [m] and quaternion_wxyz.
        """
        return bool(
            clearance(self._highest, self._field.x0, self._field.y0, self._field.spacing, self._points, qpos) < NEAR
        )

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Contact of a tyre in Gazebo's ODE: rigid, because a soft one sways on a cylinder's changing contact points.

Our own physics has elastic tyres that envelop the ground (``drive.tyre``); only the friction is the same in both.
"""

from typing import Final

STIFFNESS: Final = 1e7  # [N/m]
DAMPING: Final = 1.0  # [N s/m]
MAX_CORRECTION: Final = 0.1  # [m/s] by which a penetration is undone
MIN_DEPTH: Final = 0.0005  # [m] that a contact may keep, so that it does not open and close

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tyres on the ground: one contact per wheel, with the plane that presses the tyre as the uneven ground does.

Ground. The cubic B-spline through the nodes of a heightfield: height, slope and curvature have no jumps, while the
triangles between the same nodes, which the sensors see, have an edge every cell. A control value lies beyond the
heights of the nodes around it by no more than a bump as curved as the wheel needs, so the spline does not swing beside
a step: there it rounds the edge by up to a cell instead of passing through the nodes.

Tyre. A pneumatic tyre envelops what is smaller than its contact patch. Here each tyre is a bed of springs: at points of
the unloaded tread, every 2 deg along and five across, the depth below the ground at right angles to it is a pressure
along the ground's normal. Their sum is the force of the bed. The equivalent ground plane (Davis 1975, A radial-spring
terrain-enveloping tire model, Vehicle System Dynamics 4, 55-69) has the direction of that force and lies as deep in the
tyre as a plane that makes the same force; on a plane it is that plane, whatever the number of points. The patch moves
over an edge bit by bit, so the plane has no jumps, and a wheel that loses the ground has no contact.

Stiffness. A thin tyre of radius R and section radius s that is pressed in by d has a contact area of about
2 pi sqrt(R s) d (two crossing circles), so at a pressure p its stiffness is 2 pi p sqrt(R s) (Hadekel 1952, The
mechanical characteristics of pneumatic tyres, quoted from memory). A Husky's tyre is 13 x 5.00-6: R = 0.165 m,
s = 0.064 m; at 90 kPa (13 psi, as mowers on tyres of this size have it) 58 kN/m. The carcass with its lugs is assumed
to add a fifth. Under 123 N it yields by 1.8 mm, in a patch of 5 cm. The radius of the rig's wheels is the loaded one.
Damping: a tenth of the critical one; free vibrations of tractor tyres decay with 0.05 to 0.15 (quoted from memory). So
the robot, which has no other springs, heaves at 12 Hz.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter, spline_filter

from fieldtruth.kernels.tyre import SmoothGround
from fieldtruth.world.model import Heightfield

DAMPING_RATIO: Final = 0.1

_MARGIN: Final = 3  # nodes added around the heightfield, with the heights of its edge


class Tread(NamedTuple):
    """Loaded radius, half width and deflection under the load at rest, each [m]."""

    radius: float
    half_width: float
    deflection: float


def smooth_ground(field: Heightfield, tread: Tread) -> SmoothGround:
    """Return the spline through the nodes of ``field``; the radius of ``tread`` bounds its overshoot."""
    heights = np.pad(field.heights.astype(np.float64), _MARGIN, mode="edge")
    beyond = field.spacing**2 / (6 * tread.radius)
    lowest, highest = minimum_filter(heights, 3) - beyond, maximum_filter(heights, 3) + beyond
    control = np.clip(spline_filter(heights, order=3, mode="mirror"), lowest, highest)
    # Cell (i, j) is shaped by the control values i - 1 to i + 2. Rounded up to single precision.
    ceiling = np.nextafter(maximum_filter(control, 4, origin=-1, mode="nearest").astype(np.float32), np.float32(np.inf))
    around = maximum_filter(ceiling, 2 * math.ceil(tread.half_width / field.spacing) + 1, mode="nearest")
    shift = _MARGIN * field.spacing
    return SmoothGround(control, ceiling, around, field.x0 - shift, field.y0 - shift, 1 / field.spacing)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Overhead lines along x: the four wires of their poles, a wooden one of 9 m and a spun-concrete one of 9.5 m.

Pin insulators hold three bare medium-voltage conductors, two on the cross-arm and one on top; a bracket on the side
holds an insulated bundle below them. Dimensions are those of European 20 kV lines with pin insulators.

A wire is a catenary in closed form with a thin tube along it. A rope that neither stretches nor resists bending hangs
as z = a cosh(x / a) (H. M. Irvine, Cable Structures, 1981, section 1.2), moved to pass through both points.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh
from fieldtruth.world.solids import make_tube

_WIRES: Final = ((8.62, 9.36, 0.21), (9.02, 9.85, 0.23))
"""Heights [m] of the wires on the cross-arm and of the one on top, and the bundle's distance from the pole's middle."""
_ARM: Final = 0.86  # [m] from the pole's middle to the outer insulators


def wire_points(variant: int) -> Array:
    """Attachment points (4, 3) [m] of the wires on ``power_pole_0`` or 1: right, left, top, and the bundle below."""
    arm, top, side = _WIRES[variant]
    return np.array([(0.0, -_ARM, arm), (0.0, _ARM, arm), (0.0, 0.0, top), (0.0, side, arm - 1.35)])


CONDUCTOR_RADIUS: Final = 0.0068
"""Radius [m] of a conductor 94-AL1/15-ST1A with 13.6 mm diameter (EN 50182)."""
BUNDLE_RADIUS: Final = 0.012
"""Radius [m] of a twisted bundle of insulated low-voltage conductors."""
CHORD_ERROR: Final = 0.001
"""Greatest distance [m] between the curve and a segment of the tube."""
_STEEPEST: Final = 20.0  # half the span over the parameter; a wire 10^7 times as long as its span


@dataclass(frozen=True)
class Catenary:
    """A wire between two points; x is the horizontal distance from ``start`` towards ``end``."""

    start: Array  # (3,) [m]
    end: Array  # (3,) [m]
    parameter: float  # [m], a in z = a cosh(x / a): horizontal tension over weight per length
    lowest: float  # [m], x of the curve's lowest point, which may be beyond the ends
    offset: float  # [m], added to a cosh((x - lowest) / a) to give the height

    @property
    def span(self) -> float:
        """Horizontal distance [m] between the ends."""
        return float(np.hypot(*(self.end - self.start)[:2]))

    def height_at(self, x: ArrayLike) -> Array:
        """Height [m] at horizontal distances [m] from the start (any shape)."""
        a = self.parameter
        return np.asarray(self.offset + a * np.cosh((np.asarray(x, np.float64) - self.lowest) / a))

    def points(self, x: ArrayLike) -> Array:
        """Points (n, 3) of the curve at horizontal distances (n,) [m] from the start."""
        along = np.asarray(x, np.float64)
        flat = self.start[:2] + along[:, None] / self.span * (self.end - self.start)[:2]
        return np.column_stack([flat, self.height_at(along)])


def hang(start: ArrayLike, end: ArrayLike, *, sag: float) -> Catenary:
    """Hang a wire between two points (3,) [m], by its sag [m] in the middle of the span.

    Raises ValueError unless the sag is positive and the points have a horizontal distance.
    """
    first, last = np.asarray(start, np.float64), np.asarray(end, np.float64)
    span, rise = float(np.hypot(*(last - first)[:2])), float(last[2] - first[2])
    if span <= 0:
        raise ValueError(f"the horizontal distance of the ends must be above 0 m, got {span}")

    # With t = span / (2 a), sum and difference of the ends' heights give the lowest point and the sag.
    def sag_of(t: float) -> float:
        return float(span / (2 * t) * np.hypot(1.0, rise * t / (span * np.sinh(t))) * 2 * np.sinh(t / 2) ** 2)

    if not sag_of(1e-5) < sag < sag_of(_STEEPEST):
        raise ValueError(f"sag must be above {sag_of(1e-5):.6g} m, got {sag}")
    t = float(brentq(lambda t: sag_of(t) - sag, 1e-5, _STEEPEST, xtol=1e-15, rtol=1e-14))
    a = span / (2 * t)
    lowest = span / 2 - a * float(np.arcsinh(rise / (2 * a * np.sinh(t))))
    return Catenary(first, last, a, lowest, float(first[2] - a * np.cosh(lowest / a)))


def make_cable(name: str, wire: Catenary, *, radius: float = CONDUCTOR_RADIUS, sides: int = 5) -> tuple[Mesh, Array]:
    """Mesh of a wire, a tube of ``sides`` with its corners at ``radius`` [m], and its world_from_object (4, 4).

    The object's origin is in the middle of the straight line between the ends, x along the wire. The tube's axis is
    within ``CHORD_ERROR`` of the curve. A wire has no collider: it is above the robot.
    """
    # A chord of horizontal width w is w^2 / (8 a) off the curve: the curvature is 1 / (a cosh^2), the arc w cosh.
    segments = max(2, int(np.ceil(wire.span / np.sqrt(8 * wire.parameter * CHORD_ERROR))))
    x = np.linspace(0.0, wire.span, segments + 1)
    height = (wire.start[2] + wire.end[2]) / 2
    path = np.column_stack([x - wire.span / 2, np.zeros_like(x), wire.height_at(x) - height])
    tube = make_tube("cable", path, radius, sides=sides)
    ahead = (wire.end - wire.start)[:2] / wire.span
    world_from_object = np.eye(4)
    world_from_object[:2, :2] = [[ahead[0], -ahead[1]], [ahead[1], ahead[0]]]
    world_from_object[:3, 3] = *((wire.start + wire.end) / 2)[:2], height
    axis = np.column_stack([path, np.full(len(path), radius)]).astype(np.float32)
    return replace(tube, name=name, axis=axis), world_from_object

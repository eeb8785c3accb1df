# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Overhead lines: poles with four wires along x, a wooden one of 9 m and a spun-concrete one of 9.5 m, and the wires.

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
from fieldtruth.core.transforms import pose
from fieldtruth.world.model import Collider, Mesh, merge_meshes
from fieldtruth.world.solids import check_variant, make_box, make_lathe, make_tube, placed, rounded

SUNK: Final = 1.6
"""Depth [m] of the pole in the soil: a tenth of the length and 0.6 m, the usual rule."""

_COLLIDER_TOP: Final = 3.0  # [m] above the ground
_ARM: Final = 0.86  # [m] from the pole's middle to the outer insulators
_SADDLE: Final = 0.166  # [m] from the base of an insulator to the axis of the wire in its groove
_PIN: Final = 0.1  # [m] of steel between the cross-arm and an insulator


def make_power_pole(variant: int) -> Mesh:
    """Power pole 0 (wood, wooden cross-arm, brown porcelain) or 1 (concrete, steel cross-arm, grey porcelain)."""
    arm, top = _heights(variant)
    parts, radius = (_wooden(arm, top) if variant == 0 else _concrete(arm, top)), 0.135 if variant == 0 else 0.172
    collider = Collider(shape="cylinder", size=(radius, SUNK + _COLLIDER_TOP), position=(0.0, 0.0, -SUNK))
    return replace(merge_meshes(f"power_pole_{variant}", parts, footprint=1.05), colliders=(collider,))


def wire_points(variant: int) -> Array:
    """Attachment points of the wires, (4, 3) [m] in the pole's frame: right, left, top, and the bundle below."""
    arm, top = _heights(variant)
    side = 0.21 if variant == 0 else 0.23
    return np.array([(0.0, -_ARM, arm), (0.0, _ARM, arm), (0.0, 0.0, top), (0.0, side, arm - 1.35)])


def _heights(variant: int) -> tuple[float, float]:
    """Height [m] of the wires on the cross-arm and of the wire on top."""
    heights = ((8.62, 9.36), (9.02, 9.85))
    check_variant("power pole", variant, len(heights))
    return heights[variant]


def _wooden(arm: float, top: float) -> list[Mesh]:
    """Larch trunk with a zinc cap, a beam bolted to it, and two flat braces."""
    end = top - _SADDLE - 0.16
    path = [(0.0, 0.0, z) for z in (-SUNK, 0.0, 2.5, 5.0, 7.5, end)]
    parts = [make_tube("post_wood", path, [0.135, 0.13, 0.12, 0.11, 0.1, 0.092], sides=16)]
    cap = [(0.0, end - 0.03), (0.098, end - 0.03), (0.101, end), (0.06, end + 0.03), (0.0, end + 0.05)]
    parts.append(make_lathe("post_steel", cap, sides=16))
    beam_top = arm - _SADDLE - _PIN
    beam = make_box("post_wood", (0.09, 2 * _ARM + 0.2, 0.115), bevel=0.008)
    parts.append(placed(beam, pose((0.135, 0.0, beam_top - 0.0575)), uv_shift=(0.31, 0.2)))
    for y in (-_ARM, _ARM):
        # The pin is bent back over the pole's middle, so that wires run straight past the pole.
        foot, head = (0.135, y, beam_top - 0.03), (0.0, y, beam_top + _PIN + 0.02)
        parts.append(make_tube("post_steel", rounded([foot, (0.135, y, beam_top + 0.04), head], 0.05), 0.011, sides=6))
        parts += _insulator("post_brown", (0.0, y, arm - _SADDLE))
    parts.append(make_tube("post_steel", [(0, 0, end), (0, 0, top - _SADDLE + 0.02)], 0.013, sides=6))
    parts += _insulator("post_brown", (0.0, 0.0, top - _SADDLE))
    for side in (-1.0, 1.0):
        parts.append(_flat_bar((0.189, side * 0.62, beam_top - 0.06), (0.112, side * 0.02, beam_top - 0.7)))
        parts.append(_bolt((0.193, side * 0.62, beam_top - 0.06)))
    parts += [_bolt((0.182, 0.0, beam_top - 0.0575)), _bolt((0.115, 0.0, beam_top - 0.7))]
    return [*parts, *_bracket(arm - 1.35, 0.098, 0.21), *_plate(0.121)]


def _concrete(arm: float, top: float) -> list[Mesh]:
    """Tapered shaft with a steel channel in two clamps."""
    end = top - _SADDLE - 0.22
    shaft = [(0.0, -SUNK), (0.172, -SUNK), (0.168, 0.0), (0.138, 4.5), (0.105, end - 0.02), (0.095, end), (0.0, end)]
    parts = [make_lathe("post_concrete", shaft, sides=20)]
    beam_top = arm - _SADDLE - _PIN
    for z, width in ((0.0, 0.1), (-0.092, 0.1)):  # flanges, then the web between them
        flange = make_box("post_steel", (width, 2 * _ARM + 0.24, 0.009), bevel=0.002)
        parts.append(placed(flange, pose((0.165, 0.0, beam_top - 0.0045 + z))))
    web = make_box("post_steel", (0.009, 2 * _ARM + 0.24, 0.09), bevel=0.002)
    parts.append(placed(web, pose((0.12, 0.0, beam_top - 0.05))))
    for z in (beam_top - 0.02, beam_top - 0.085, top - 0.5):
        clamp = [(0.1, z - 0.02), (0.122, z - 0.02), (0.122, z + 0.02), (0.1, z + 0.02), (0.1, z - 0.02)]
        parts.append(make_lathe("post_steel", clamp, sides=20))
    for y in (-_ARM, _ARM):
        foot, head = (0.165, y, beam_top - 0.02), (0.0, y, beam_top + _PIN + 0.02)
        parts.append(make_tube("post_steel", rounded([foot, (0.165, y, beam_top + 0.04), head], 0.05), 0.012, sides=6))
        parts += _insulator("post_grey", (0.0, y, arm - _SADDLE))
    parts.append(make_tube("post_steel", [(0, 0, end - 0.05), (0, 0, top - _SADDLE + 0.02)], 0.016, sides=8))
    parts += _insulator("post_grey", (0.0, 0.0, top - _SADDLE))
    for side in (-1.0, 1.0):
        parts.append(_flat_bar((0.165, side * 0.7, beam_top - 0.1), (0.118, side * 0.02, beam_top - 0.75)))
    parts.append(_bolt((0.12, 0.0, beam_top - 0.75)))
    return [*parts, *_bracket(arm - 1.35, 0.118, 0.23), *_plate(0.157)]


def _insulator(material: str, foot: tuple[float, float, float]) -> list[Mesh]:
    """Pin insulator, 0.15 m wide and 0.17 m high: two sheds, a neck for the binding wire, a groove on top."""
    outline = [
        (0.0, 0.012), (0.030, 0.012), (0.033, 0.0), (0.048, 0.0), (0.05, 0.012), (0.075, 0.018), (0.077, 0.026),
        (0.064, 0.048), (0.048, 0.060), (0.047, 0.068), (0.062, 0.074), (0.063, 0.081), (0.046, 0.104), (0.033, 0.117),
        (0.030, 0.128), (0.034, 0.138), (0.036, 0.147), (0.028, 0.157), (0.0, 0.159),
    ]  # fmt: skip
    at = pose(foot)
    tie = make_tube("post_steel", [(-0.11, 0.0, 0.164), (0.0, 0.0, 0.158), (0.11, 0.0, 0.164)], 0.004, sides=4)
    return [placed(make_lathe(material, outline, sides=16), at), placed(tie, at)]


def _flat_bar(first: tuple[float, float, float], last: tuple[float, float, float]) -> Mesh:
    """Brace of flat steel, 40 x 6 mm, between two points [m]; its flat side faces along x."""
    a, b = np.array(first), np.array(last)
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    across = np.cross(along, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    turned = np.eye(4)
    turned[:3, :3] = np.stack([np.cross(across, along), across, along], axis=1)
    turned[:3, 3] = (a + b) / 2
    return placed(make_box("post_steel", (0.006, 0.04, length + 0.05), bevel=0.002), turned)


def _bolt(position: tuple[float, float, float]) -> Mesh:
    """Hexagonal bolt head that faces +x."""
    head = make_lathe("post_steel", [(0.0, -0.02), (0.018, -0.02), (0.018, 0.012), (0.0, 0.012)], sides=6, faceted=True)
    return placed(head, pose(position, (0.0, 90.0, 0.0)))


def _bracket(z: float, radius: float, offset: float) -> list[Mesh]:
    """Bent rod on the side with a clamp for the insulated bundle, ``offset`` [m] from the pole's middle."""
    rod = rounded([(0.0, 0.0, z + 0.12), (0.0, offset - 0.02, z + 0.12), (0.0, offset, z + 0.015)], 0.06)
    clamp = make_box("post_steel", (0.12, 0.03, 0.045), bevel=0.008)
    band = [(r, z + h) for r, h in ((radius, 0.09), (radius + 0.008, 0.09), (radius + 0.008, 0.15), (radius, 0.15))]
    return [
        make_tube("post_steel", rod, 0.011, sides=6),
        placed(clamp, pose((0.0, offset, z))),
        make_lathe("post_steel", [*band, band[0]], sides=16),
    ]


def _plate(radius: float) -> list[Mesh]:
    """Yellow warning plate and number plate, at eye level and above, facing along x."""
    warning = make_box("post_yellow", (0.004, 0.13, 0.15), bevel=0.0015)
    number = make_box("post_grey", (0.004, 0.11, 0.07), bevel=0.0015)
    return [placed(warning, pose((radius + 0.004, 0, 2.2))), placed(number, pose((radius + 0.004, 0, 2.42)))]


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

    @property
    def sag(self) -> float:
        """Distance [m] in the middle of the span from the straight line between the ends down to the curve."""
        return float((self.start[2] + self.end[2]) / 2 - self.height_at(self.span / 2))

    @property
    def length(self) -> float:
        """Length [m] of the wire."""
        a = self.parameter
        return float(a * (np.sinh((self.span - self.lowest) / a) - np.sinh(-self.lowest / a)))

    def height_at(self, x: ArrayLike) -> Array:
        """Height [m] at horizontal distances [m] from the start (any shape)."""
        a = self.parameter
        return np.asarray(self.offset + a * np.cosh((np.asarray(x, np.float64) - self.lowest) / a))

    def points(self, x: ArrayLike) -> Array:
        """Points (n, 3) of the curve at horizontal distances (n,) [m] from the start."""
        along = np.asarray(x, np.float64)
        flat = self.start[:2] + along[:, None] / self.span * (self.end - self.start)[:2]
        return np.column_stack([flat, self.height_at(along)])


def hang(start: ArrayLike, end: ArrayLike, *, sag: float | None = None, length: float | None = None) -> Catenary:
    """Hang a wire between two points (3,) [m], by its sag [m] in the middle of the span or by its length [m].

    Raises ValueError unless exactly one of the two is given, the sag is positive, the wire is longer than the straight
    line, and the points have a horizontal distance.
    """
    first, last = np.asarray(start, np.float64), np.asarray(end, np.float64)
    span, rise = float(np.hypot(*(last - first)[:2])), float(last[2] - first[2])
    if span <= 0:
        raise ValueError(f"the horizontal distance of the ends must be above 0 m, got {span}")
    if (sag is None) == (length is None):
        raise ValueError(f"exactly one of sag and length must be given, got sag={sag} and length={length}")

    # With t = span / (2 a), sum and difference of the ends' heights give the lowest point and these two functions.
    def sag_of(t: float) -> float:
        return float(span / (2 * t) * np.hypot(1.0, rise * t / (span * np.sinh(t))) * 2 * np.sinh(t / 2) ** 2)

    def length_of(t: float) -> float:
        return float(np.hypot(rise, span * np.sinh(t) / t))

    key, function, wanted = ("sag", sag_of, sag) if sag is not None else ("length", length_of, length)
    assert wanted is not None
    if not function(1e-5) < wanted < function(_STEEPEST):
        raise ValueError(f"{key} must be above {function(1e-5):.6g} m, got {wanted}")
    t = float(brentq(lambda t: function(t) - wanted, 1e-5, _STEEPEST, xtol=1e-15, rtol=1e-14))
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

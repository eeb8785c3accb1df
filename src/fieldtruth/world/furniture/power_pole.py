# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Poles of an overhead line with four wires along x: a wooden one of 9 m and a spun-concrete one of 9.5 m.

Pin insulators hold three bare medium-voltage conductors, two on the cross-arm and one on top; a bracket on the side
holds an insulated bundle below them. Dimensions are those of European 20 kV lines with pin insulators.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose
from fieldtruth.world.furniture.outlines import rounded
from fieldtruth.world.furniture.shapes import check_variant, make_box, make_lathe, make_tube, placed
from fieldtruth.world.model import Collider, Mesh, merge_meshes

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

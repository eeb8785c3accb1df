# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Lamp posts of 4 to 5 m: a cast-iron column with a four-paned lantern, and a steel pole with a post-top luminaire."""

from dataclasses import replace

import numpy as np

from fieldtruth.core.transforms import pose
from fieldtruth.world.furniture.outlines import rounded
from fieldtruth.world.furniture.shapes import check_variant, make_box, make_lathe, make_tube, placed
from fieldtruth.world.model import Collider, Mesh, merge_meshes

SUNK = 0.1  # [m] depth of the base in the ground


def make_lamp_post(variant: int) -> Mesh:
    """Lamp post 0 (classic lantern, 4.6 m) or 1 (modern, 4.3 m)."""
    check_variant("lamp post", variant, 2)
    if variant == 0:
        parts = [*_cast_column(), *_lantern(3.62)]
        colliders = [_cylinder(0.2, -SUNK, 0.2), _cylinder(0.13, 0.2, 0.92), _cylinder(0.065, 0.92, 3.6)]
    else:
        parts = [*_steel_pole(), *_luminaire(3.85)]
        colliders = [_cylinder(0.15, -SUNK, 0.05), _cylinder(0.08, 0.05, 4.0)]
    return replace(merge_meshes(f"lamp_post_{variant}", parts, footprint=0.33), colliders=tuple(colliders))


def _cylinder(radius: float, bottom: float, top: float) -> Collider:
    return Collider(shape="cylinder", size=(radius, top - bottom), position=(0.0, 0.0, bottom))


def _cast_column() -> list[Mesh]:
    plinth = [(0.0, -SUNK), (0.2, -SUNK), (0.2, 0.08), (0.18, 0.11), (0.165, 0.18), (0.0, 0.18)]
    shaft = [
        (0.0, 0.16), (0.13, 0.16), (0.13, 0.22), (0.115, 0.25), (0.105, 0.60), (0.092, 0.74), (0.105, 0.76),
        (0.115, 0.80), (0.105, 0.84), (0.08, 0.87), (0.07, 0.92), (0.058, 0.97), (0.0, 0.97),
    ]  # fmt: skip
    pole = [
        (0.0, 0.95), (0.055, 0.95), (0.052, 1.6), (0.066, 1.615), (0.066, 1.645), (0.05, 1.66), (0.038, 3.18),
        (0.056, 3.20), (0.056, 3.23), (0.038, 3.25), (0.036, 3.42), (0.06, 3.45), (0.085, 3.52), (0.055, 3.56),
        (0.05, 3.62), (0.0, 3.62),
    ]  # fmt: skip
    parts = [make_lathe("lamp_iron", plinth, sides=8, faceted=True)]
    parts += [make_lathe("lamp_iron", shaft, sides=20), make_lathe("lamp_iron", pole, sides=18)]
    # Cast ribs around the shaft, and the ladder bar.
    for k in range(10):
        rib = make_box("lamp_iron", (0.016, 0.02, 0.36), bevel=0.006)
        parts.append(placed(rib, pose((0.0, 0.0, 0.0), (0.0, 0.0, 36.0 * k)) @ pose((0.108, 0.0, 0.43), (0, -1.6, 0))))
    parts.append(make_tube("lamp_iron", [(0.0, -0.24, 3.33), (0.0, 0.24, 3.33)], 0.013, sides=10))
    ball = [(0.026 * np.sin(a), -0.026 * np.cos(a)) for a in np.linspace(0, np.pi, 9)]
    ball[0] = ball[0][0] * 0, ball[0][1]
    for side in (-1, 1):
        parts.append(placed(make_lathe("lamp_iron", ball, sides=12), pose((0.0, side * 0.25, 3.33))))
    return parts


def _lantern(z: float) -> list[Mesh]:
    """Lantern of four inclined panes between iron bars, roof, vent and finial; ``z`` [m] is its lower end."""
    square = pose((0.0, 0.0, z), (0.0, 0.0, 45.0))
    low, high, tall = 0.155, 0.275, 0.48
    glass = [(0.0, 0.03), (low - 0.008, 0.03), (high - 0.008, tall - 0.02), (0.0, tall - 0.02)]
    sill = [(0.0, 0.0), (low - 0.03, 0.0), (low + 0.012, 0.02), (low + 0.012, 0.04), (0.0, 0.04)]
    eaves = [(0.0, tall - 0.03), (high, tall - 0.03), (high + 0.03, tall), (high + 0.03, tall + 0.015)]
    eaves += [(0.17, tall + 0.13), (0.10, tall + 0.19), (0.0, tall + 0.19)]
    parts = [
        placed(make_lathe("lamp_glass", glass, sides=4, faceted=True), square),
        placed(make_lathe("lamp_iron", sill, sides=4, faceted=True), square),
        placed(make_lathe("lamp_iron", eaves, sides=4, faceted=True), square),
    ]
    vent = [(0.0, 0.17), (0.085, 0.17), (0.085, 0.23), (0.11, 0.235), (0.105, 0.25), (0.05, 0.29), (0.02, 0.31)]
    vent += [(0.014, 0.33), (0.028, 0.35), (0.03, 0.365), (0.022, 0.385), (0.009, 0.40), (0.0, 0.46)]
    parts.append(placed(make_lathe("lamp_iron", vent, sides=16), pose((0.0, 0.0, z + tall))))
    for k in range(4):
        turn = np.radians(45 + 90 * k)
        foot, head = (np.array([r * np.cos(turn), r * np.sin(turn)]) for r in (low, high))
        bar = make_tube("lamp_iron", [(*foot, z + 0.02), (*head, z + tall - 0.01)], 0.012, sides=8)
        stay = rounded(
            [(0.045 * np.cos(turn), 0.045 * np.sin(turn), z - 0.12), (*(0.9 * foot), z - 0.09), (*foot, z + 0.01)],
            0.08,
        )
        parts += [bar, make_tube("lamp_iron", stay, 0.009, sides=8)]
    return parts


def _steel_pole() -> list[Mesh]:
    flange = [(0.0, -SUNK), (0.15, -SUNK), (0.15, 0.018), (0.145, 0.022), (0.0, 0.022)]
    pole = [(0.0, 0.0), (0.07, 0.0), (0.07, 1.02), (0.064, 1.06), (0.05, 1.09), (0.038, 3.87), (0.0, 3.87)]
    parts = [make_lathe("lamp_steel", flange, sides=24), make_lathe("lamp_steel", pole, sides=20)]
    door = make_box("lamp_steel", (0.012, 0.075, 0.34), bevel=0.004)
    parts.append(placed(door, pose((0.067, 0.0, 0.58))))
    for k in range(4):
        turn = np.radians(45 + 90 * k)
        bolt = make_lathe("lamp_steel", [(0.0, 0.02), (0.016, 0.02), (0.016, 0.045), (0.0, 0.045)], sides=6)
        parts.append(placed(bolt, pose((0.115 * np.cos(turn), 0.115 * np.sin(turn), 0.0))))
    return parts


def _luminaire(z: float) -> list[Mesh]:
    """Luminaire of collar, frosted bowl and wide shallow cap; ``z`` [m] is the pole's end."""
    collar = [(0.0, -0.04), (0.055, -0.04), (0.06, 0.02), (0.105, 0.06), (0.105, 0.08), (0.0, 0.08)]
    bowl = [(0.0, 0.075), (0.10, 0.075), (0.135, 0.15), (0.165, 0.25), (0.18, 0.33), (0.0, 0.33)]
    cap = [(0.0, 0.325), (0.31, 0.325), (0.325, 0.335), (0.325, 0.35), (0.27, 0.385), (0.17, 0.42)]
    cap += [(0.07, 0.435), (0.05, 0.45), (0.0, 0.455)]
    bodies = (("lamp_steel", collar, 24), ("lamp_glass", bowl, 28), ("lamp_steel", cap, 32))
    parts = [
        make_lathe(material, [(r, z + height) for r, height in profile], sides=sides)
        for material, profile, sides in bodies
    ]
    for k in range(3):
        turn = np.radians(120 * k)
        stay = [(r * np.cos(turn), r * np.sin(turn), z + h) for r, h in ((0.10, 0.06), (0.19, 0.20), (0.22, 0.335))]
        parts.append(make_tube("lamp_steel", rounded(stay, 0.3), 0.009, sides=8))
    return parts

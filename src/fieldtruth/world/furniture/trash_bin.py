# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trash bins, about 0.9 m high: a slatted steel basket around a drum, and a hooded sheet-metal bin on a post."""

from dataclasses import replace

from fieldtruth.core.transforms import pose
from fieldtruth.world.furniture.outlines import bar_outline, rounded
from fieldtruth.world.furniture.shapes import check_variant, make_box, make_extrusion, make_lathe, make_tube, placed
from fieldtruth.world.model import Collider, Mesh, merge_meshes

SUNK = 0.08  # [m] depth of the base in the ground


def make_trash_bin(variant: int) -> Mesh:
    """Trash bin 0 (slatted basket, open top) or 1 (hooded, on a post)."""
    check_variant("trash bin", variant, 2)
    if variant == 0:
        drum = Collider(shape="cylinder", size=(0.31, 0.9 + SUNK), position=(0.0, 0.0, -SUNK))
        return replace(merge_meshes("trash_bin_0", _slatted(), footprint=0.31), colliders=(drum,))
    body = Collider(shape="cylinder", size=(0.215, 0.67), position=(0.04, 0.0, 0.28))
    post = Collider(shape="cylinder", size=(0.09, 1.0 + SUNK), position=(-0.19, 0.0, -SUNK))
    return replace(merge_meshes("trash_bin_1", _hooded(), footprint=0.28), colliders=(body, post))


def _slatted() -> list[Mesh]:
    foot = [(0.0, -SUNK), (0.16, -SUNK), (0.16, 0.015), (0.07, 0.03), (0.06, 0.10), (0.0, 0.10)]
    tray = [(0.0, 0.09), (0.2, 0.09), (0.235, 0.11), (0.235, 0.13), (0.0, 0.13)]
    drum = [(0.0, 0.13), (0.205, 0.13), (0.215, 0.83), (0.222, 0.84), (0.212, 0.84), (0.2, 0.15), (0.0, 0.15)]
    rim = rounded(
        [(0.21, 0.87), (0.24, 0.845), (0.275, 0.845), (0.29, 0.87), (0.275, 0.895), (0.235, 0.895)], 0.015, steps=4
    )
    parts = [
        make_lathe("bin_iron", foot, sides=24),
        make_lathe("bin_iron", tray, sides=32),
        make_lathe("bin_inside", drum, sides=32),
        make_lathe("bin_iron", [*rim, rim[0]], sides=32),
    ]
    for z, radius in ((0.28, 0.25), (0.70, 0.254)):
        hoop = [(radius, z - 0.015), (radius, z + 0.015), (radius - 0.006, z + 0.015), (radius - 0.006, z - 0.015)]
        parts.append(make_lathe("bin_iron", [*hoop, hoop[0]], sides=24))
    path = rounded([(0.215, 0.11), (0.25, 0.16), (0.262, 0.45), (0.262, 0.74), (0.285, 0.865)], 0.12, steps=2)
    slat = make_extrusion("bin_iron", bar_outline(path, 0.008), 0.036)
    count = 24
    parts += [placed(slat, pose((0.0, 0.0, 0.0), (0.0, 0.0, 360.0 * k / count))) for k in range(count)]
    return parts


def _hooded() -> list[Mesh]:
    body = [(0.0, 0.30), (0.195, 0.30), (0.2, 0.31), (0.2, 0.76), (0.206, 0.765), (0.206, 0.785), (0.2, 0.79)]
    body += [(0.192, 0.785), (0.192, 0.32), (0.0, 0.32)]
    hood = [(0.0, 0.9), (0.195, 0.87), (0.205, 0.86), (0.212, 0.865), (0.212, 0.88), (0.19, 0.91), (0.12, 0.94)]
    hood += [(0.05, 0.955), (0.0, 0.957)]
    front = pose((0.04, 0.0, 0.0))
    parts = [
        placed(make_lathe("bin_iron", body, sides=36), front),
        placed(make_lathe("bin_iron", hood, sides=36), front),
    ]
    for height in (0.42, 0.66):
        band = [(0.2, height - 0.012), (0.2045, height - 0.008), (0.2045, height + 0.008), (0.2, height + 0.012)]
        parts.append(placed(make_lathe("bin_steel", band, sides=36), front))
    for turn in (60.0, -60.0, 180.0):
        strap = make_box("bin_iron", (0.006, 0.03, 0.14), bevel=0.002)
        parts.append(placed(strap, front @ pose((0.0, 0.0, 0.0), (0.0, 0.0, turn)) @ pose((0.197, 0.0, 0.83))))
    post = make_tube("bin_steel", [(-0.2, 0.0, -SUNK), (-0.2, 0.0, 0.98)], 0.03, sides=20)
    knob = [(0.0, 0.975), (0.034, 0.975), (0.034, 0.985), (0.02, 1.0), (0.0, 1.004)]
    plate = [(0.0, -SUNK), (0.085, -SUNK), (0.085, 0.012), (0.0, 0.012)]
    parts += [post, *(placed(make_lathe("bin_steel", p, sides=20), pose((-0.2, 0.0, 0.0))) for p in (knob, plate))]
    for height in (0.42, 0.66, 0.9):
        clamp = make_box("bin_steel", (0.07, 0.05, 0.03), bevel=0.003)
        parts.append(placed(clamp, pose((-0.165, 0.0, height))))
    return parts

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Park benches, 1.7 m wide, seat 0.45 m high, facing +x: cast-iron sides, concrete sides, and one without a back."""

from dataclasses import replace

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose
from fieldtruth.world.furniture.outlines import at_length, bar_outline, path_length, rounded
from fieldtruth.world.furniture.shapes import check_variant, make_box, make_extrusion, make_lathe, make_tube, placed
from fieldtruth.world.model import Collider, Mesh, merge_meshes

WIDTH = 1.7  # [m]
SUNK = 0.08  # [m] depth of the feet in the ground


def make_bench(variant: int) -> Mesh:
    """Bench 0 (cast-iron sides), 1 (concrete sides with a back) or 2 (concrete blocks, no back)."""
    makers = (_cast_iron, _concrete_sides, _backless)
    check_variant("bench", variant, len(makers))
    parts, depth, height = makers[variant]()
    middle = (depth[0] + depth[1]) / 2
    collider = Collider(shape="box", size=(depth[1] - depth[0], WIDTH, height + SUNK), position=(middle, 0.0, -SUNK))
    mesh = merge_meshes(f"bench_{variant}", parts, footprint=float(np.hypot(WIDTH / 2, max(np.abs(depth)))))
    return replace(mesh, colliders=(collider,))


def _slats(path: Array, count: int, thickness: float, gap: float, *, bolts_at: float | None) -> list[Mesh]:
    """Planks of the bench's width side by side along a curve of x and z, upper side to the left of it."""
    pitch = path_length(path) / count
    points, slopes = at_length(path, (np.arange(count) + 0.5) * pitch)
    parts = []
    for k, (point, slope) in enumerate(zip(points, slopes, strict=True)):
        raised = point + thickness / 2 * np.array([-np.sin(slope), np.cos(slope)])
        turned = pose((raised[0], 0.0, raised[1]), (0.0, -np.degrees(slope), 0.0))
        plank = make_box("bench_wood", (pitch - gap, WIDTH, thickness), bevel=0.005)
        parts.append(placed(plank, turned, uv_shift=(0.37 * k, 0.618 * k)))
        if bolts_at is not None:
            head = make_lathe("bench_iron", [(0.011, 0.0), (0.009, 0.004), (0.0, 0.006)], sides=8)
            parts += [
                placed(head, turned @ pose((0.0, side * bolts_at, thickness / 2 - 0.0005))) for side in (-1.0, 1.0)
            ]
    return parts


def _cast_iron() -> tuple[list[Mesh], tuple[float, float], float]:
    back = rounded([(-0.35, -SUNK), (-0.335, 0.04), (-0.25, 0.22), (-0.205, 0.43), (-0.25, 0.62), (-0.345, 0.87)], 0.5)
    front = rounded([(0.275, -SUNK), (0.262, 0.04), (0.185, 0.21), (0.225, 0.415)], 0.3)
    seat = rounded([(-0.21, 0.405), (-0.06, 0.388), (0.10, 0.398), (0.245, 0.425)], 0.6)
    arm = rounded(
        [(-0.28, 0.665), (-0.10, 0.69), (0.12, 0.67), (0.225, 0.655), (0.27, 0.61), (0.235, 0.555), (0.195, 0.585)],
        0.05,
        steps=4,
    )
    strut = rounded([(0.222, 0.40), (0.215, 0.50), (0.185, 0.655)], 0.4)
    stretcher = rounded([(-0.265, 0.165), (-0.17, 0.25), (-0.03, 0.285), (0.11, 0.25), (0.205, 0.165)], 0.2)
    bars = [(back, 0.036), (front, 0.036), (seat, 0.03), (arm, 0.026), (strut, 0.024), (stretcher, 0.02)]
    parts = []
    for side in (-1, 1):
        at = pose((0.0, side * 0.74, 0.0))
        parts += [placed(make_extrusion("bench_iron", bar_outline(p, t), 0.045), at) for p, t in bars]
        for foot in (back[0], front[0]):
            pad = make_box("bench_iron", (0.10, 0.075, 0.02))
            parts.append(placed(pad, at @ pose((foot[0] + 0.012, 0.0, 0.004))))
    parts.append(make_tube("bench_iron", [(-0.03, -0.74, 0.28), (-0.03, 0.74, 0.28)], 0.011, sides=8))
    top, lean = rounded([(-0.198, 0.402), (-0.06, 0.403), (0.10, 0.413), (0.262, 0.445)], 0.6), 0.018
    parts += _slats(top, 6, 0.03, 0.014, bolts_at=0.74)
    # The planks of the back are on the front of the uprights, upper side forward.
    upright = np.array([(x + lean, z) for x, z in back[::-1] if z > 0.47])
    upright = np.vstack([upright, [(-0.205 + lean, 0.495)]])
    parts += _slats(upright, 4, 0.028, 0.016, bolts_at=0.74)
    return parts, (-0.39, 0.32), 0.88


def _concrete_sides() -> tuple[list[Mesh], tuple[float, float], float]:
    outline = [
        (-0.34, -SUNK), (-0.16, -SUNK), (-0.10, 0.10), (0.08, 0.10), (0.12, -SUNK), (0.30, -SUNK), (0.27, 0.395),
        (-0.10, 0.375), (-0.17, 0.43), (-0.27, 0.84), (-0.35, 0.84), (-0.36, 0.80), (-0.31, 0.40),
    ]  # fmt: skip
    parts = []
    for side in (-1, 1):
        parts.append(placed(make_extrusion("bench_concrete", outline, 0.09), pose((0.0, side * 0.66, 0.0))))
    parts += _slats(np.array([(-0.115, 0.377), (0.27, 0.397)]), 4, 0.042, 0.016, bolts_at=0.66)
    parts += _slats(np.array([(-0.257, 0.82), (-0.192, 0.55)]), 2, 0.038, 0.03, bolts_at=0.66)
    return parts, (-0.38, 0.31), 0.86


def _backless() -> tuple[list[Mesh], tuple[float, float], float]:
    block = [
        (-0.19, -SUNK), (0.19, -SUNK), (0.19, 0.06), (0.13, 0.12), (0.13, 0.26), (0.21, 0.34), (0.21, 0.402),
        (-0.21, 0.402), (-0.21, 0.34), (-0.13, 0.26), (-0.13, 0.12), (-0.19, 0.06),
    ]  # fmt: skip
    parts = []
    for side in (-1, 1):
        parts.append(placed(make_extrusion("bench_concrete", block, 0.14), pose((0.0, side * 0.55, 0.0))))
    parts += _slats(np.array([(-0.24, 0.402), (0.24, 0.402)]), 4, 0.048, 0.014, bolts_at=0.55)
    return parts, (-0.24, 0.24), 0.45

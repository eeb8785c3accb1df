# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Street furniture: each function makes one of several variants as a mesh with its colliders, facing +x.

Park benches, 1.7 m wide, seat 0.45 m high: cast-iron sides, concrete sides, and one without a back. Lamp posts of 4 to
5 m: a cast-iron column with a four-paned lantern, and a steel pole with a post-top luminaire. Tables, 0.75 m high, long
side along y: planks on crossed legs, and a round chess table of concrete. Trash bins, about 0.9 m high: a slatted steel
basket around a drum, and a hooded sheet-metal bin on a post.
"""

from dataclasses import replace

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose
from fieldtruth.world.model import Collider, Mesh, merge_meshes
from fieldtruth.world.solids import (
    at_length,
    bar_outline,
    check_variant,
    make_box,
    make_extrusion,
    make_lathe,
    make_part,
    make_tube,
    path_length,
    placed,
    rounded,
)

WIDTH = 1.7  # [m]
SUNK = 0.08  # [m] depth of feet and bases in the ground


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


_LAMP_SUNK = 0.1  # [m] depth of a lamp post's base in the ground


def make_lamp_post(variant: int) -> Mesh:
    """Lamp post 0 (classic lantern, 4.6 m) or 1 (modern, 4.3 m)."""
    check_variant("lamp post", variant, 2)
    if variant == 0:
        parts = [*_cast_column(), *_lantern(3.62)]
        colliders = [_cylinder(0.2, -_LAMP_SUNK, 0.2), _cylinder(0.13, 0.2, 0.92), _cylinder(0.065, 0.92, 3.6)]
    else:
        parts = [*_steel_pole(), *_luminaire(3.85)]
        colliders = [_cylinder(0.15, -_LAMP_SUNK, 0.05), _cylinder(0.08, 0.05, 4.0)]
    return replace(merge_meshes(f"lamp_post_{variant}", parts, footprint=0.33), colliders=tuple(colliders))


def _cylinder(radius: float, bottom: float, top: float) -> Collider:
    return Collider(shape="cylinder", size=(radius, top - bottom), position=(0.0, 0.0, bottom))


def _cast_column() -> list[Mesh]:
    plinth = [(0.0, -_LAMP_SUNK), (0.2, -_LAMP_SUNK), (0.2, 0.08), (0.18, 0.11), (0.165, 0.18), (0.0, 0.18)]
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
            [(0.045 * np.cos(turn), 0.045 * np.sin(turn), z - 0.12), (*(0.9 * foot), z - 0.09), (*foot, z + 0.01)], 0.08
        )
        parts += [bar, make_tube("lamp_iron", stay, 0.009, sides=8)]
    return parts


def _steel_pole() -> list[Mesh]:
    flange = [(0.0, -_LAMP_SUNK), (0.15, -_LAMP_SUNK), (0.15, 0.018), (0.145, 0.022), (0.0, 0.022)]
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


HEIGHT = 0.75  # [m]


def make_table(variant: int) -> Mesh:
    """Table 0 (wooden planks, crossed legs, 0.8 x 1.8 m) or 1 (round, concrete, with a chess board)."""
    check_variant("table", variant, 2)
    if variant == 0:
        top = Collider(shape="box", size=(0.8, 1.8, HEIGHT + SUNK), position=(0.0, 0.0, -SUNK))
        return replace(merge_meshes("table_0", _crossed_legs(), footprint=0.99), colliders=(top,))
    disc = Collider(shape="cylinder", size=(0.5, HEIGHT + SUNK), position=(0.0, 0.0, -SUNK))
    return replace(merge_meshes("table_1", _chess_table(), footprint=0.5), colliders=(disc,))


def _crossed_legs() -> list[Mesh]:
    parts = []
    planks, gap, thickness = 6, 0.012, 0.042
    pitch = (0.8 + gap) / planks
    for k in range(planks):
        plank = make_box("table_wood", (pitch - gap, 1.8, thickness), bevel=0.005)
        at = pose(((k + 0.5) * pitch - (0.8 + gap) / 2, 0.0, HEIGHT - thickness / 2))
        parts.append(placed(plank, at, uv_shift=(0.37 * k, 0.618 * k)))
    for side in (-1, 1):
        batten = make_box("table_wood", (0.72, 0.045, 0.07))
        parts.append(placed(batten, pose((0.0, side * 0.56, HEIGHT - thickness - 0.035)), uv_shift=(0.2, 0.3 * side)))
        for lean in (-1, 1):
            # Crossed legs are beside each other, with a bolt through the middle.
            y = side * (0.56 + 0.045) if lean > 0 else side * (0.56 - 0.045)
            foot, head = np.array((lean * 0.37, -SUNK)), np.array((-lean * 0.27, HEIGHT - thickness - 0.002))
            parts.append(_beam(foot, head, y, 0.09, 0.045, shift=0.13 * lean + 0.29 * side))
        bolt = make_tube("table_steel", [(0.0, side * 0.48, 0.335), (0.0, side * 0.64, 0.335)], 0.012, sides=8)
        parts.append(bolt)
    stretcher = make_box("table_wood", (0.045, 1.07, 0.09))
    parts.append(placed(stretcher, pose((0.0, 0.0, 0.335))))
    for side in (-1, 1):
        start, stop = np.array((side * 0.10, 0.36)), np.array((side * 0.44, HEIGHT - thickness - 0.01))
        brace = _beam(start, stop, 0.0, 0.06, 0.04, shift=0.4 * side)
        parts.append(placed(brace, pose((0.0, 0.0, 0.0), (0.0, 0.0, 90.0))))
    return parts


def _beam(start: Array, stop: Array, y: float, depth: float, width: float, *, shift: float) -> Mesh:
    """Rectangular timber between two points of x and z [m], in the plane of the given y."""
    step = stop - start
    middle = (start + stop) / 2
    tilt = float(np.degrees(np.arctan2(step[1], step[0])))
    beam = make_box("table_wood", (float(np.hypot(*step)), width, depth))
    return placed(beam, pose((middle[0], y, middle[1]), (0.0, -tilt, 0.0)), uv_shift=(shift, 1.7 * shift))


def _chess_table() -> list[Mesh]:
    rim = rounded([(0.0, 0.675), (0.47, 0.675), (0.5, 0.70), (0.5, HEIGHT), (0.0, HEIGHT)], 0.012, steps=3)
    outline = [(0.0, -SUNK), (0.27, -SUNK), (0.27, 0.05), (0.16, 0.12)]
    outline += [(0.11, 0.35), (0.14, 0.58), (0.25, 0.68), (0.0, 0.68)]
    stem = rounded(outline, 0.04, steps=3)
    parts = [make_lathe("table_concrete", rim, sides=40), make_lathe("table_concrete", stem, sides=28)]
    return [*parts, *_chess_board(0.052, HEIGHT + 0.0015)]


def _chess_board(square: float, z: float) -> list[Mesh]:
    """Eight by eight inlaid squares of two kinds of stone, and a dark line around them."""
    corner = square * np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    quad = np.array([(0, 1, 2), (0, 2, 3)])
    parts = []
    for colour, material in enumerate(("table_stone_dark", "table_stone_light")):
        cells = square * np.array([(i - 4, j - 4) for i in range(8) for j in range(8) if (i + j) % 2 == colour])
        flat = (cells[:, None] + corner).reshape(-1, 2)
        vertices = np.column_stack([flat, np.full(len(flat), z)])
        faces = (4 * np.arange(len(cells))[:, None, None] + quad).reshape(-1, 3)
        parts.append(make_part(material, vertices, np.tile((0.0, 0.0, 1.0), (len(flat), 1)), flat, faces))
    half = 4 * square + 0.006
    for turn in range(4):
        edge = make_box("table_stone_dark", (2 * half + 0.012, 0.012, 0.004), bevel=0.001)
        at = pose((0.0, 0.0, 0.0), (0.0, 0.0, 90.0 * turn)) @ pose((0.0, half, HEIGHT))
        parts.append(placed(edge, at))
    return parts


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

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Park tables, 0.75 m high, long side along y: planks on crossed legs, and a round chess table of concrete."""

from dataclasses import replace

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose
from fieldtruth.world.furniture.outlines import rounded
from fieldtruth.world.furniture.shapes import check_variant, make_box, make_lathe, make_part, make_tube, placed
from fieldtruth.world.model import Collider, Mesh, merge_meshes

HEIGHT = 0.75  # [m]
SUNK = 0.08  # [m] depth of the feet in the ground


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

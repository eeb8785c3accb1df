# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Multirotors: four arms with spinning blades, a hull with a camera below, and legs.

Its thrust is along its z axis, so that it leans to the side to which it accelerates, by atan(a / g), and against the
wind of its own flight, by drag. Where it is, is given; how it leans, follows.
"""

import math
from typing import Final

import numpy as np

from fieldtruth.actors.figure import STEP, Figure, Ground, Joint, Placement, fitted
from fieldtruth.actors.limbs import Motion
from fieldtruth.actors.shapes import Colour, Surface, make_ball, make_loft, materials_of, part
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.world.model import Mesh
from fieldtruth.world.solids import make_box, make_lathe, make_tube, placed

DRAG: Final = 0.22
"""[1/s] of acceleration per speed: a lean of 15 deg at 12 m/s, as small multirotors fly."""
SPIN: Final = 95.0
"""[turns/s] of a rotor of 0.24 m that hovers, 5700 per minute: from knot to knot it seems to turn 18 deg backwards."""
_SMOOTH: Final = 0.12
"""[s] in which it leans."""
_COLOURS: Final[tuple[Colour, ...]] = ((0.62, 0.62, 0.60), (0.13, 0.135, 0.14), (0.03, 0.031, 0.034),
    (0.30, 0.06, 0.03))  # fmt: skip
ARM: Final = 0.23
"""[m] from the middle to a rotor."""


class MultirotorKind:
    """Makes multirotors."""

    def figure(self, name: str, rng: np.random.Generator) -> Figure:
        """Return a quadcopter of random size, 0.57 to 0.85 m wide, and colour."""
        scale, colour = float(rng.uniform(1.0, 1.5)), _COLOURS[rng.integers(len(_COLOURS))]
        surfaces = {"shell": Surface(colour, 0.5 if colour[0] > 0.5 else 0.1, 0.3),
            "dark": Surface((0.03, 0.03, 0.032), 0.08, 0.2), "lens": Surface((0.01, 0.01, 0.013), 0.05, 0.8),
            "lamp": Surface((0.6, 0.03, 0.02), 0.3, 0.3)}  # fmt: skip
        joints = tuple(Joint(f"rotor_{k + 1}", 1 + k, -1, (scale * ARM * x / math.sqrt(2),
            scale * ARM * y / math.sqrt(2), scale * 0.047), "z") for k, (x, y) in enumerate(_CORNERS))  # fmt: skip
        blades = [part(f"{name} rotor {k + 1}", *_rotor(name, scale, k % 2 == 0)) for k in range(4)]
        across = 2 * scale * (ARM / math.sqrt(2) + 0.12)
        figure = Figure(kind="multirotor", label=Label.AERIAL_VEHICLE,
            parts=(part(f"{name} hull", *_hull(name, scale)), *blades), joints=joints,
            materials=materials_of(name, Label.AERIAL_VEHICLE, surfaces), colliders=(), radius=across / math.sqrt(2),
            speed=4.0, top_speed=12.0, flies=True)  # fmt: skip
        return fitted(figure, self)

    def gait(self, figure: Figure, placement: Placement, ground: Ground, rng: np.random.Generator) -> "MultirotorGait":
        """Return the flight of a multirotor."""
        return MultirotorGait(placement, ground, rng)


_CORNERS: Final = ((1, 1), (1, -1), (-1, -1), (-1, 1))


def _hull(name: str, scale: float) -> list[Mesh]:
    def tube(key: str, path: list[tuple[float, float, float]], radius: float) -> Mesh:
        return make_tube(f"{name} {key}", scale * np.array(path), scale * radius, sides=8)

    def motor(x: float, y: float) -> Mesh:
        can = make_lathe(
            f"{name} dark", scale * np.array([(0, -0.015), (0.016, -0.015), (0.016, 0.03), (0.0, 0.033)]), sides=12
        )
        return placed(can, transforms.pose((scale * x, scale * y, scale * 0.012)))

    rows = [(-0.11, 0, 0.0, 0.030, 0.018), (-0.06, 0, 0.004, 0.050, 0.030), (0.03, 0, 0.006, 0.052, 0.034),
        (0.1, 0, 0.0, 0.036, 0.022)]  # fmt: skip
    found = [make_loft(f"{name} shell", scale * np.array(rows), axis=0, sides=14, square=3.0, bulge=0.6)]
    for x, y in _CORNERS:
        ex, ey = ARM * x / math.sqrt(2), ARM * y / math.sqrt(2)
        found += [tube("shell", [(0.04 * x, 0.03 * y, 0.008), (ex, ey, 0.012)], 0.011), motor(ex, ey)]
        key = "lamp" if x > 0 else "dark"
        found.append(
            make_ball(f"{name} {key}", [scale * ex, scale * ey, -scale * 0.006], [scale * 0.009] * 3, sides=6, rings=4)
        )
    for side in (0.055, -0.055):
        legs = [
            (-0.05, 0.5 * side, -0.02),
            (-0.06, 1.9 * side, -0.115),
            (0.06, 1.9 * side, -0.115),
            (0.05, 0.5 * side, -0.02),
        ]
        found.append(tube("dark", legs, 0.006))
    pod = make_ball(f"{name} dark", [scale * 0.075, 0, -scale * 0.05], [scale * 0.026] * 3)
    lens = placed(make_lathe(f"{name} lens", scale * np.array([(0, 0), (0.014, 0), (0.014, 0.03), (0, 0.03)]),
        sides=12), transforms.pose((scale * 0.077, 0, -scale * 0.05), (0, 90, 0)))  # fmt: skip
    return [*found, pod, lens, tube("dark", [(0.06, 0, 0), (0.07, 0, -0.05)], 0.012)]


def _rotor(name: str, scale: float, left: bool) -> list[Mesh]:
    """Return two twisted blades on a hub."""
    blades = []
    for turn in (0.0, 180.0):
        blade = make_box(f"{name} dark", [scale * 0.11, scale * 0.017, scale * 0.0022], bevel=scale * 0.0008)
        blade = placed(blade, transforms.pose((scale * 0.065, 0, 0), (10.0 if left else -10.0, 0, 0)))
        blades.append(placed(blade, transforms.pose((0, 0, 0), (0, 0, turn))))
    return [*blades, make_ball(f"{name} shell", (0, 0, 0), [scale * 0.011, scale * 0.011, scale * 0.007], sides=8,
        rings=4)]  # fmt: skip


class MultirotorGait:
    """Flight: leans by its acceleration, and turns its rotors."""

    def __init__(self, placement: Placement, ground: Ground, rng: np.random.Generator) -> None:
        self._ground = ground
        self.motion = Motion(placement)
        self._before = (self.motion.vx, self.motion.vy)
        self._ax = self._ay = 0.0
        self._turns = [float(rng.uniform(0, 1)) for _ in range(4)]
        self._rates = [float(SPIN * (1 - 2 * (k % 2)) * rng.uniform(0.98, 1.02)) for k in range(4)]

    def step(self, placement: Placement) -> tuple[Array, Array]:
        """Return world_from_root (4, 4) and the angles of the rotors at the next knot."""
        motion = self.motion
        motion.follow(placement)
        share = STEP / (_SMOOTH + STEP)
        self._ax += share * ((motion.vx - self._before[0]) / STEP - self._ax)
        self._ay += share * ((motion.vy - self._before[1]) / STEP - self._ay)
        self._before = (motion.vx, motion.vy)
        up = np.array([self._ax + DRAG * motion.vx, self._ay + DRAG * motion.vy, GRAVITY])
        up /= math.sqrt(up @ up)
        c, s = math.cos(motion.heading), math.sin(motion.heading)
        left = np.cross(up, (c, s, 0.0))
        left /= math.sqrt(left @ left)
        root = np.eye(4)
        root[:3, 0], root[:3, 1], root[:3, 2] = np.cross(left, up), left, up
        root[:3, 3] = motion.x, motion.y, self._ground(motion.x, motion.y) + placement.height
        self._turns = [turn + rate * STEP for turn, rate in zip(self._turns, self._rates, strict=True)]
        return root, math.tau * np.array(self._turns)

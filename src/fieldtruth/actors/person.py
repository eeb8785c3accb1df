# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""People: bodies of different size, build and clothes, who walk, jog, stand and sit.

Lengths are shares of the stature (Drillis and Contini 1966, as in Winter, Biomechanics and Motor Control of Human
Movement, 2009). Cadence grows with the power 0.58 of the speed (Grieve and Gear 1966) from 1.9 Hz at 1.4 m/s, so that
the walk ratio, length of a step over its rate, is 0.6 to 0.65 cm min (Sekiya and Nagasaki 1998). A foot carries for
62 % of a stride at that speed and for 39 % of one in a run of 3.2 m/s (Novacheck 1998). People begin to run at 2 m/s
(Thorstensson and Roberthson 1987). The foot rolls from the heel over the flat sole to the toes, which stay on the
ground until it is lifted.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from fieldtruth.actors.figure import STEP, Figure, Ground, Joint, Placement, fitted
from fieldtruth.actors.limbs import (
    Foot,
    Matrix,
    Motion,
    Point,
    Rhythm,
    Steps,
    applied,
    ease,
    pitched,
    softest,
    times,
    transposed,
    turned,
    two_links,
)
from fieldtruth.actors.shapes import CHECKS, CLOTH, Colour, Surface, make_ball, make_loft, materials_of, part
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.world.model import Collider, Mesh

THIGH, SHANK, ANKLE = 0.245, 0.246, 0.045
HIP, BALL, HEEL = 0.052, 0.070, -0.040
"""Half the distance of the hip joints; ball of the foot and heel from the ankle. ANKLE: height with the shoe's sole."""
UPPER_ARM, FOREARM, SHOULDER, SHOULDER_UP = 0.172, 0.146, 0.099, 0.209
_Make = Callable[..., Mesh]
_GENTLE: Final = 0.08
"""Slope up to which steps are as on level ground; on steep ones they are shorter (assumed: so legs reach)."""
_SEAT: Final = 0.45 + 0.085
"""[m] of the hip joints above the ground on a bench."""
_COATS: Final[tuple[Colour, ...]] = ((0.020, 0.030, 0.070), (0.035, 0.036, 0.040), (0.070, 0.075, 0.040),
    (0.33, 0.27, 0.18), (0.12, 0.020, 0.028), (0.20, 0.20, 0.21), (0.55, 0.55, 0.52), (0.020, 0.060, 0.040),
    (0.25, 0.090, 0.045), (0.06, 0.14, 0.24), (0.30, 0.062, 0.055), (0.42, 0.30, 0.085))  # fmt: skip
_TROUSERS: Final[tuple[Colour, ...]] = ((0.050, 0.080, 0.150), (0.025, 0.035, 0.070), (0.030, 0.030, 0.033),
    (0.13, 0.13, 0.14), (0.26, 0.20, 0.125), (0.090, 0.060, 0.038), (0.075, 0.078, 0.045))  # fmt: skip
_SKIN: Final[tuple[Colour, ...]] = ((0.56, 0.37, 0.28), (0.50, 0.31, 0.21), (0.37, 0.21, 0.13), (0.21, 0.105, 0.058),
    (0.10, 0.048, 0.028))  # fmt: skip
_HAIR: Final[tuple[Colour, ...]] = ((0.012, 0.010, 0.009), (0.035, 0.020, 0.012), (0.085, 0.048, 0.025),
    (0.27, 0.19, 0.09), (0.33, 0.32, 0.31))  # fmt: skip
_SHOES: Final[tuple[Colour, ...]] = ((0.025, 0.023, 0.022), (0.075, 0.042, 0.022), (0.45, 0.45, 0.44),
    (0.12, 0.12, 0.13))  # fmt: skip


class PersonKind:
    """Makes people."""

    def figure(self, name: str, rng: np.random.Generator) -> Figure:
        """Return a body of random size, build, clothes, skin and hair."""
        stature = float(np.clip(rng.normal(1.72, 0.09), 1.5, 1.95))
        surfaces = clothes(rng)
        figure = Figure(kind="person", label=Label.PERSON, parts=body(name, stature, rng), joints=joints_of(stature),
            materials=materials_of(name, Label.PERSON, surfaces),
            colliders=(Collider(shape="cylinder", size=(0.25, stature)),), radius=0.35, reach=0.5,
            speed=float(np.clip(rng.normal(1.35, 0.15), 1.0, 1.8)), top_speed=4.0, scale=stature)  # fmt: skip
        return fitted(figure, self)

    def gait(self, figure: Figure, placement: Placement, ground: Ground, rng: np.random.Generator) -> "PersonGait":
        """Return the motion of a person's limbs."""
        return PersonGait(figure.scale, placement, ground, rng)


def clothes(rng: np.random.Generator) -> dict[str, Surface]:
    """Return random surfaces of a person.

    Of a LiDAR's light skin reflects 0.5 to 0.6, also where it is dark (Anderson and Parrish 1981), and dyed cotton
    half, as dyes are clear there (assumed, as all else).
    """

    def one(colours: tuple[Colour, ...]) -> Colour:
        red, green, blue = (np.array(colours[rng.integers(len(colours))]) * rng.uniform(0.8, 1.2)).tolist()
        return red, green, blue

    coat, trousers, skin = one(_COATS), one(_TROUSERS), one(_SKIN)
    bare_arms, bare_legs = rng.random() < 0.2, rng.random() < 0.12
    top = Surface(coat, 0.5, texture=CHECKS if rng.random() < 0.2 else CLOTH)
    below = Surface(trousers, 0.5, texture=CLOTH)
    return {"coat": top, "sleeve": Surface(skin, 0.55) if bare_arms else top,
        "trousers": below, "leg": Surface(skin, 0.55) if bare_legs else below,
        "skin": Surface(skin, 0.55, 0.05), "hair": Surface(one(_HAIR), 0.25, 0.1),
        "eye": Surface((0.02, 0.015, 0.012), 0.1, 0.3), "shoe": Surface(one(_SHOES), 0.3, 0.1),
        "sole": Surface((0.035, 0.034, 0.033), 0.1), "pack": Surface(one(_COATS), 0.3, texture=CLOTH)}  # fmt: skip


def joints_of(stature: float) -> tuple[Joint, ...]:
    """Return the joints of a person."""
    h = stature
    pelvis, chest, head = 0, 1, 2
    found = [*(Joint(f"pelvis_{axis}", pelvis, -1, (0, 0, 0), axis) for axis in ("lift", "z", "y", "x")),
        *(Joint(f"chest_{axis}", chest, pelvis, (0, 0, 0.06 * h), axis) for axis in ("z", "y", "x")),
        *(Joint(f"head_{axis}", head, chest, (-0.004 * h, 0, 0.242 * h), axis) for axis in ("z", "y"))]  # fmt: skip
    for k, (side, y) in enumerate((("left", 1.0), ("right", -1.0))):
        arm = 3 + 2 * k
        found += [*(Joint(f"{side}_shoulder_{a}", arm, chest, (-0.004 * h, y * SHOULDER * h, SHOULDER_UP * h), a)
            for a in "yx"), Joint(f"{side}_elbow", arm + 1, arm, (0, 0, -UPPER_ARM * h), "y")]  # fmt: skip
    for k, (side, y) in enumerate((("left", 1.0), ("right", -1.0))):
        leg = 7 + 4 * k
        found += [*(Joint(f"{side}_hip_{axis}", leg, pelvis, (0, y * HIP * h, 0), axis) for axis in "zxy"),
            Joint(f"{side}_knee", leg + 1, leg, (0, 0, -THIGH * h), "y"),
            *(Joint(f"{side}_ankle_{axis}", leg + 2, leg + 1, (0, 0, -SHANK * h), axis) for axis in "yxz"),
            Joint(f"{side}_toes", leg + 3, leg + 2, (BALL * h, 0, -ANKLE * h), "y")]  # fmt: skip
    return tuple(found)


def body(name: str, stature: float, rng: np.random.Generator) -> tuple[Mesh, ...]:
    """Return the 15 parts of a person: pelvis, chest, head, two arms of two and two legs of four parts."""
    girth, woman = rng.uniform(0.94, 1.16), bool(rng.random() < 0.5)
    wide = 0.94 if woman else 1.0

    def loft(key: str, rows: Sequence[tuple[float, ...]], width: float = 1.0, **others: float) -> Mesh:
        full = np.array([(*row, row[3]) if len(row) == 4 else row for row in rows]) * stature
        full[:, 3:] *= width
        return make_loft(f"{name} {key}", full, **others)  # type: ignore[arg-type]

    def ball(key: str, centre: tuple[float, ...], radii: tuple[float, ...]) -> Mesh:
        return make_ball(f"{name} {key}", [stature * c for c in centre], [stature * r for r in radii], sides=6, rings=3)

    hips = girth * (1.06 if woman else 1.0)
    pelvis = loft("trousers", [(-0.03, 0, 0, 0.050, 0.074), (0.0, -0.004, 0, 0.064, 0.090),
        (0.03, 0, 0, 0.054, 0.076), (0.06, 0, 0, 0.044, 0.06)], hips, bulge=0.6)  # fmt: skip
    chest = loft("coat", [(-0.066, -0.004, 0, 0.078 * hips / girth, 0.104 * hips / girth),
        (-0.02, -0.002, 0, 0.068, 0.093), (0.03, 0, 0, 0.060, 0.084), (0.12, 0.002, 0, 0.066, 0.099 * wide),
        (0.19, -0.002, 0, 0.061, 0.112 * wide), (0.217, -0.004, 0, 0.050, 0.110 * wide),
        (0.236, -0.006, 0, 0.042, 0.082), (0.250, -0.006, 0, 0.038, 0.052),
        (0.262, -0.006, 0, 0.036, 0.037)], girth, sides=11, bulge=0.25)  # fmt: skip
    trunk = [chest]
    if rng.random() < 0.3:
        trunk.append(loft("pack", [(0.01, -0.085, 0, 0.040, 0.070), (0.09, -0.090, 0, 0.046, 0.078),
            (0.2, -0.078, 0, 0.030, 0.060)], sides=8, square=3.0, bulge=0.5))  # fmt: skip
    meshes = [pelvis, part("chest", *trunk), part("head", *_head(loft, ball, woman, rng))]
    for _ in "lr":
        upper = [(0.002, 0, 0, 0.028), (-0.05, 0, 0, 0.0315), (-UPPER_ARM, 0, 0, 0.0255)]
        meshes.append(loft("coat", upper, girth))
        y = 0.002
        hand = loft("skin", [(-0.146, 0, 0, 0.013, 0.013), (-0.175, 0.003, y, 0.020, 0.011),
            (-0.2, 0.003, y, 0.019, 0.010), (-0.232, 0.002, y, 0.012, 0.008)], sides=7)  # fmt: skip
        thumb = loft("skin", [(-0.165, 0.016, 0, 0.008), (-0.195, 0.026, 0, 0.006)], sides=5)
        meshes.append(part("forearm", loft("sleeve", [(0, 0, 0, 0.0255), (-0.05, 0, 0, 0.026), (-0.15, 0, 0, 0.019)],
            girth, bulge=0.8), hand, thumb))  # fmt: skip
    for _ in "lr":
        meshes.append(loft("trousers", [(0.0, 0, 0, 0.052, 0.050), (-0.1, 0, 0, 0.049, 0.047),
            (-THIGH, 0, 0, 0.036, 0.035)], girth))  # fmt: skip
        meshes.append(loft("leg", [(0.0, 0, 0, 0.0355), (-0.07, -0.004, 0, 0.036), (-0.15, -0.002, 0, 0.030),
            (-0.228, 0, 0, 0.0275)], girth, bulge=0.7))  # fmt: skip
        meshes += _shoe(loft)
    names = (
        "pelvis",
        "chest",
        "head",
        *(f"{s} {p}" for s in ("left", "right") for p in ("upper arm", "forearm")),
        *(f"{s} {p}" for s in ("left", "right") for p in ("thigh", "shank", "foot", "toes")),
    )
    return tuple(part(f"{name} {each}", mesh) for each, mesh in zip(names, meshes, strict=True))


def _head(loft: _Make, ball: _Make, woman: bool, rng: np.random.Generator) -> list[Mesh]:
    """Return neck, face and hair or a cap."""
    found = [loft("skin", [(-0.02, -0.004, 0, 0.034), (0.05, 0.004, 0, 0.031)]), loft("skin",
        [(0.040, 0.026, 0, 0.020, 0.020), (0.055, 0.014, 0, 0.040, 0.033), (0.085, 0.008, 0, 0.051, 0.041),
        (0.115, 0.002, 0, 0.054, 0.0425), (0.135, 0, 0, 0.046, 0.037)], sides=11, bulge=0.5),
        ball("skin", (0.058, 0, 0.083), (0.008, 0.006, 0.012))]  # fmt: skip
    for y in (1.0, -1.0):
        found.append(ball("skin", (0.0, 0.041 * y, 0.088), (0.010, 0.006, 0.016)))
        found.append(ball("eye", (0.0505, 0.018 * y, 0.099), (0.006, 0.008, 0.0045)))
    found.append(ball("eye", (0.056, 0, 0.062), (0.003, 0.013, 0.0025)))
    key = "pack" if rng.random() < 0.18 else "hair"
    found.append(loft(key, [(0.082, -0.024, 0, 0.036, 0.043), (0.108, -0.013, 0, 0.050, 0.047),
        (0.133, -0.002, 0, 0.0555, 0.0465), (0.150, -0.003, 0, 0.043, 0.036)], sides=11, bulge=0.45))  # fmt: skip
    if key == "pack":
        found.append(loft("pack", [(0.121, 0.045, 0, 0.042, 0.036), (0.125, 0.04, 0, 0.042, 0.036)], bulge=0.0))
    if woman and rng.random() < 0.75:
        found.append(loft("hair", [(0.0, -0.042, 0, 0.018, 0.036), (0.06, -0.040, 0, 0.024, 0.044),
            (0.11, -0.022, 0, 0.036, 0.046)], sides=7))  # fmt: skip
    return found


def _shoe(loft: _Make) -> list[Mesh]:
    """Return the shoe of the foot and that of the toes."""
    a = -ANKLE
    back = [(HEEL + 0.012, 0, a + 0.027, 0.020, 0.024), (0.0, 0, a + 0.032, 0.024, 0.031),
        (0.035, 0, a + 0.026, 0.026, 0.025), (BALL - 0.006, 0, a + 0.019, 0.027, 0.018)]  # fmt: skip
    front = [(0.0, 0, 0.019, 0.027, 0.018), (0.028, 0, 0.017, 0.025, 0.015), (0.045, 0, 0.015, 0.019, 0.011)]
    soles = [[(x, y, low + 0.005, 1.06 * wide, 0.005) for x, y, _, wide, _ in rows] for rows,
        low in ((back, a), (front, 0.0))]  # fmt: skip
    tops = [loft("shoe", rows, axis=0, square=2.4, bulge=bulge) for rows, bulge in ((back, 0.3), (front, 0.6))]
    return [part("shoe", top, loft("sole", sole, axis=0, sides=8, square=4.0, bulge=0.0)) for top,
        sole in zip(tops, soles, strict=True)]  # fmt: skip


def rhythm_of(speed: float, stature: float) -> Rhythm:
    """Return how a person steps at a speed [m/s]."""
    run = ease((speed - 1.9) / 0.3)
    walking = max(0.95 * (speed / 1.4) ** 0.58, 0.6)
    frequency = (walking + run * (1.33 + 0.06 * (speed - 2.5) - walking)) * math.sqrt(1.75 / stature)
    walk_duty = max(0.72 - 0.07 * speed, 0.56)
    duty = walk_duty + run * (max(0.42 - 0.03 * (speed - 2.2), 0.25) - walk_duty)
    return Rhythm(frequency, duty, stature * (0.02 + 0.01 * min(speed, 1.5) + 0.05 * run), 0.42 - 0.11 * run)


class PersonGait:
    """Walks, jogs, stands and sits."""

    def __init__(self, stature: float, placement: Placement, ground: Ground, rng: np.random.Generator) -> None:
        self._stature, self._ground = stature, ground
        self._out = float(rng.uniform(0.08, 0.18))
        self._sways = [float(rng.uniform(0, math.tau)) for _ in range(4)]
        self._arms = float(rng.uniform(0.8, 1.2))
        self._time = 0.0
        self._sit = 1.0 if placement.action == "sit" else 0.0
        self.motion = Motion(placement)
        self.feet = tuple(Foot((0.0, y * HIP * stature), 0.5 * k, y * self._out) for k, y in enumerate((1.0, -1.0)))
        self._rest()
        sole = (HEEL * stature, BALL * stature, 0.03 * stature)
        self._steps = Steps(self.feet, self.motion, ground, sole, rhythm_of(abs(placement.speed), stature))
        self._z = ground(placement.x, placement.y)
        c, s = 0.3 * math.cos(placement.heading), 0.3 * math.sin(placement.heading)
        self._slope = (ground(placement.x + c, placement.y + s) - self._z) / 0.3
        self._heel_up = [0.0, 0.0]
        """[rad] of each foot at its last knot on the ground."""

    def _rest(self) -> None:
        for foot in self.feet:
            foot.rest_x = (0.245 * self._sit - 0.01) * self._stature

    def step(self, placement: Placement) -> tuple[Array, Array]:
        """Return world_from_root (4, 4) and the joints' values at the next knot."""
        motion, h = self.motion, self._stature
        motion.follow(placement)
        self._time += STEP
        sits = STEP / 1.1 if placement.action == "sit" else -STEP / 0.9
        self._sit = min(max(self._sit + sits, 0.0), 1.0)
        self._rest()
        speed = math.hypot(motion.vx, motion.vy)
        z = self._ground(motion.x, motion.y)
        if motion.rolled > 1e-4:
            slope = min(max((z - self._z) / motion.rolled, -0.5), 0.5)
            self._slope += STEP / (0.25 + STEP) * (slope - self._slope)
        self._z = z
        rhythm = rhythm_of(speed, h)
        steep = 1.0 + 1.3 * abs(self._slope) * ease((abs(self._slope) - _GENTLE) / 0.08)
        rhythm = rhythm._replace(frequency=rhythm.frequency * steep, lead=rhythm.lead + 0.25 * self._slope)
        self._steps.step(rhythm, self._ground)
        values = self._limbs(z, speed, rhythm)
        c, s = math.cos(motion.heading), math.sin(motion.heading)
        root = np.array([[c, -s, 0.0, motion.x], [s, c, 0.0, motion.y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]])
        return root, np.array(values)

    def _limbs(self, z: float, speed: float, rhythm: Rhythm) -> list[float]:
        """Return the joints' values with the root at a height [m]."""
        motion, h, sit = self.motion, self._stature, ease(self._sit)
        c, s, leg = math.cos(motion.heading), math.sin(motion.heading), (THIGH + SHANK) * h
        run, walk = ease((speed - 1.9) / 0.3), min(speed / 1.2, 1.0)
        ahead = [((f.x - motion.x) * c + (f.y - motion.y) * s - f.rest_x) / leg for f in self.feet]
        swing = (ahead[1] - ahead[0]) * walk
        a, b = (math.sin(0.9 * self._time + self._sways[0]), math.sin(1.43 * self._time + self._sways[1]))
        pelvis = (0.07 * swing, 0.03 * run - 0.25 * sit + 0.004 * a, 0.004 * b)
        turn = turned(motion.heading + pelvis[0], pelvis[1], pelvis[2])
        stands = ANKLE * h + leg * (0.994 - 0.008 * walk - 0.035 * run)
        stands += sit * (_SEAT - stands)
        feet = [self._foot(k, rhythm, walk, run, turn, z + stands) for k in range(2)]
        hips = [applied(turn, 0.0, y * HIP * h, 0.0) for y in (1.0, -1.0)]
        reach = []
        for k, (foot, (place, *_)) in enumerate(zip(self.feet, feet, strict=True)):
            hip = hips[k]
            far = (motion.x + hip[0] - place[0]) ** 2 + (motion.y + hip[1] - place[1]) ** 2
            high = place[2] - hip[2] - z + math.sqrt(max((0.997 * leg) ** 2 - far, 0.0))
            if foot.carries and high < stands - 0.09 * leg and sit == 0.0 and self.feet[1 - k].carries:
                self._steps.lift(foot, (1.0 - rhythm.duty) / rhythm.frequency)
            share = foot.share  # in the air it may be drawn along for a while
            reach.append(high + 0.15 * ease(share / 0.3) * (1.0 - ease((share - 0.4) / 0.4)))
        bob = math.cos(4 * math.pi * (self._steps.phase - 1 + rhythm.duty / 2))
        lift = softest((stands - 0.02 * h * run * bob, *reach), 0.012)
        legs = []
        for k, hip in enumerate(hips):
            yaw = 0.5 * math.remainder(self.feet[k].yaw - motion.heading, math.tau)
            legs += leg_angles((motion.x + hip[0], motion.y + hip[1], z + lift + hip[2]), turn, feet[k], yaw, h)
        lean = 0.02 + 0.02 * walk + 0.11 * run
        look = (
            0.25
            * (1 - walk)
            * math.sin(0.31 * self._time + self._sways[2])
            * math.sin(0.13 * self._time + self._sways[3])
        )
        look += min(max(0.35 * motion.turn, -0.5), 0.5)
        chest = (-2.0 * pelvis[0], lean - pelvis[1] + 0.08 * sit, -pelvis[2] + 0.003 * a)
        values = [lift, *pelvis, *chest, look - pelvis[0] - chest[0], 0.05 * sit - 0.8 * lean]
        for k in range(2):
            forward = ahead[1 - k] * walk * (0.62 + 0.2 * run) * self._arms
            shoulder = -forward + 0.28 * run - 0.42 * sit + 0.05
            elbow = -0.22 - 0.35 * max(forward, 0.0) - 1.5 * run - 0.75 * sit
            values += [shoulder, (1 - 2 * k) * (0.10 + 0.02 * a), elbow]
        return values + legs

    def _foot(
        self, k: int, rhythm: Rhythm, walk: float, run: float, turn: Matrix, high: float
    ) -> tuple[Point, Matrix, float]:
        """Return where the ankle is, the foot's rotation, and the angle of the toes."""
        foot, motion, h = self.feet[k], self.motion, self._stature
        strike = 0.32 * walk * (1 - 0.6 * run)
        leg, y = (THIGH + SHANK) * h, (1 - 2 * k) * HIP * h
        dx, dy = motion.x + turn[1] * y - foot.x, motion.y + turn[4] * y - foot.y
        past, far = dx * math.cos(foot.yaw) + dy * math.sin(foot.yaw), math.hypot(dx, dy, high - foot.z - ANKLE * h)
        needed = 1.15 * ease((far / leg - 0.99) / 0.15) * ease(past / (0.2 * leg))
        if foot.carries:
            up = needed - strike * max(1.0 - foot.since * rhythm.frequency / 0.10, 0.0)
            self._heel_up[k] = up
            toes = -max(up, 0.0)
        else:
            share = foot.share
            kick = (0.25 + 1.05 * run) * walk * math.sin(math.pi * min(share / 0.75, 1.0)) ** 2
            up = self._heel_up[k] * (1.0 - ease(share / 0.7)) + kick - strike * ease((share - 0.55) / 0.45)
            if share < 0.5:
                up = max(up, needed * (1.0 - ease(share / 0.5)))
            toes = -max(up, 0.0) * (1.0 - ease(share / 0.45))
        flat = turned(foot.yaw, foot.pitch, foot.roll)
        own = pitched(flat, up)
        pivot = (BALL if up > 0.0 else HEEL) * h
        x, y, z = applied(own, -pivot, 0.0, ANKLE * h)
        return (foot.x + flat[0] * pivot + x, foot.y + flat[3] * pivot + y, foot.z + flat[6] * pivot + z), own, toes


def leg_angles(hip: Point, turn: Matrix, foot: tuple[Point, Matrix, float], yaw: float, stature: float) -> list[float]:
    """Return the angles of hip, knee, ankle and toes.

    ``hip`` [m] is the joint, ``turn`` the pelvis' rotation, and ``foot`` the ankle's place, the foot's rotation and the
    toes' angle [rad]; the leg turns outwards by ``yaw`` [rad] in the hip.
    """
    (ax, ay, az), own, toes = foot
    x, y, down = applied(transposed(turn), ax - hip[0], ay - hip[1], az - hip[2])
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = c * x + s * y, c * y - s * x
    roll = math.atan2(y, -down)
    thigh, knee = two_links(x, -math.hypot(y, down), THIGH * stature, SHANK * stature, 1.0)
    cr, sr = math.cos(roll), math.sin(roll)
    limb = times(turn, pitched((c, -s * cr, s * sr, s, c * cr, -c * sr, 0.0, sr, cr), thigh + knee))
    m = times(transposed(limb), own)
    ankle = (math.atan2(m[2], m[8]), math.asin(max(-1.0, min(1.0, -m[5]))), math.atan2(m[3], m[4]))
    return [yaw, roll, thigh, knee, *ankle, toes]

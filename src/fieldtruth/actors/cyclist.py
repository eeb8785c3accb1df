# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cyclists: a person on a bicycle, who pedals, steers and leans into curves by atan(v w / g).

The rider is of class person, the bicycle a vehicle. Both have one instance id.
"""

import math
from typing import Final

import numpy as np

from fieldtruth.actors.figure import STEP, Figure, Ground, Joint, Placement, fitted
from fieldtruth.actors.limbs import Motion, applied, ease, pitched, turned
from fieldtruth.actors.person import (
    ANKLE,
    BALL,
    FOREARM,
    HIP,
    SHANK,
    SHOULDER,
    SHOULDER_UP,
    THIGH,
    UPPER_ARM,
    body,
    clothes,
    joints_of,
    leg_angles,
)
from fieldtruth.actors.shapes import Colour, Surface, make_loft, materials_of, part
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.solids import make_box, make_lathe, make_tube, placed

RADIUS: Final = 0.34
"""[m] of a wheel, as all lengths here."""
REAR, FRONT = -0.50, 0.53
"""Axles from the middle."""
_CRANK: Final = 0.17
_AXLE: Final = (-0.07, 0.285)
"""Of the cranks: x and z."""
_HEAD: Final = (0.375, 0.80)
"""Where the fork turns: x and z."""
_RAKE: Final = 0.30
"""[rad] by which the fork leans back: a head angle of 73 deg."""
_GEAR: Final = 2.2
"""Turns of the wheel in a turn of the cranks: 60 per minute at 4.7 m/s."""
_GRIP: Final = (0.02, 0.26, 0.24)
"""Of the left hand, in the frame of the fork."""
_BARS: Final = 7
"""Parts of the bicycle, which come before those of the rider."""
_PELVIS, _CHEST = 0.42, 0.30
"""[rad] by which pelvis and chest lean forwards."""
_STANDS: Final = 0.1
"""[m/s] below which the left foot comes down."""
_DOWN: Final = (0.5, 1.2)
"""[s] of standing in which it does."""
_FOOT: Final = (-0.12, 0.36)
"""Where its ball is then, in an upright frame: x and y."""
_TIP: Final = 0.22
"""[rad] by which the bicycle leans to this side."""
_TIPTOE: Final = 0.55
"""[rad] by which the heel is up: the saddle is too high for a flat foot."""
_FRAMES: Final[tuple[Colour, ...]] = ((0.02, 0.02, 0.022), (0.30, 0.02, 0.018), (0.02, 0.07, 0.22), (0.5, 0.5, 0.49),
    (0.03, 0.14, 0.07))  # fmt: skip


class CyclistKind:
    """Makes cyclists."""

    def figure(self, name: str, rng: np.random.Generator) -> Figure:
        """Return a person of random size and clothes on a bicycle of random colour."""
        stature = float(np.clip(rng.normal(1.74, 0.08), 1.6, 1.9))
        colour = _FRAMES[rng.integers(len(_FRAMES))]
        surfaces = {key: each._replace(label=Label.PERSON) for key,
            each in clothes(rng).items()} | {"frame": Surface(colour, 0.3, 0.4),
            "rubber": Surface((0.022, 0.022, 0.021), 0.05), "metal": Surface((0.28, 0.28, 0.28), 0.3, 0.3),
            "helmet": Surface((0.45, 0.45, 0.44), 0.6, 0.3, Label.PERSON)}  # fmt: skip
        rider = body(name, stature, rng)
        helmet = make_loft(f"{name} helmet",
            stature * np.array([(0.122, 0.0, 0, 0.066, 0.053), (0.150, -0.002, 0, 0.056, 0.045)]), sides=12,
            bulge=0.4)  # fmt: skip
        rider = (*rider[:2], part(rider[2].name, rider[2], helmet), *rider[3:])
        height = _saddle(stature) + 0.44 * stature
        figure = Figure(kind="cyclist", label=Label.VEHICLE, parts=(*_bicycle(name, stature), *rider),
            joints=_joints(stature), materials=materials_of(name, Label.VEHICLE, surfaces),
            colliders=(Collider(shape="box", size=(1.7, 0.5, height)),), radius=0.9,
            speed=float(rng.uniform(3.5, 5.0)), top_speed=8.0, turn_radius=2.0, scale=stature)  # fmt: skip
        return fitted(figure, self)

    def gait(self, figure: Figure, placement: Placement, ground: Ground, rng: np.random.Generator) -> "CyclistGait":
        """Return the motion of a cyclist."""
        return CyclistGait(figure.scale, placement, ground, rng)


def _saddle(stature: float) -> float:
    """Height [m] of the hip joints, from which a leg that is nearly straight reaches the lower pedal."""
    return (
        _AXLE[1] - _CRANK + 0.02 + math.sqrt((0.955 * (THIGH + SHANK + ANKLE) * stature) ** 2 - (_AXLE[0] + 0.27) ** 2)
    )


def _joints(stature: float) -> tuple[Joint, ...]:
    down = (RADIUS - _HEAD[1]) * math.cos(_RAKE) - (FRONT - _HEAD[0]) * math.sin(_RAKE)
    out = (FRONT - _HEAD[0]) * math.cos(_RAKE) + (RADIUS - _HEAD[1]) * math.sin(_RAKE)
    own = [
        Joint("fork_y", 1, 0, (_HEAD[0], 0, _HEAD[1]), "y"),
        Joint("fork_steer", 1, 0, (_HEAD[0], 0, _HEAD[1]), "z"),
        Joint("front_wheel", 2, 1, (out, 0, down), "y"),
        Joint("rear_wheel", 3, 0, (REAR, 0, RADIUS), "y"),
        Joint("cranks", 4, 0, (_AXLE[0], 0, _AXLE[1]), "y"),
        Joint("left_pedal", 5, 4, (0, 0.12, -_CRANK), "y"),
        Joint("right_pedal", 6, 4, (0, -0.12, _CRANK), "y"),
    ]
    rider = []
    for joint in joints_of(stature):
        parent, origin = joint.parent + _BARS, joint.origin
        if joint.parent < 0:
            parent, origin = 0, (-0.27, 0.0, 0.0)
        rider.append(joint._replace(part=joint.part + _BARS, parent=parent, origin=origin))
    return (*own, *rider)


def _bicycle(name: str, stature: float) -> tuple[Mesh, ...]:
    """Return frame, fork with the bars, wheels, cranks and pedals."""

    def tube(key: str, path: list[tuple[float, float, float]], radius: float) -> Mesh:
        return make_tube(f"{name} {key}", path, radius, sides=8)

    seat, (ax, az), (hx, hz) = _saddle(stature) - 0.095, _AXLE, _HEAD
    top = (-0.235, 0.0, seat - 0.18)
    frame = [tube("frame", [(hx - 0.03, 0, hz + 0.10), (hx + 0.03, 0, hz - 0.10)], 0.021),
        tube("frame", [top, (hx - 0.02, 0, hz + 0.05)], 0.016),
        tube("frame", [(ax, 0, az), (hx + 0.02, 0, hz - 0.07)], 0.019), tube("frame", [(ax, 0, az), top], 0.016),
        tube("metal", [top, (-0.29, 0, seat - 0.02)], 0.013), make_loft(f"{name} rubber",
        [(-0.40, 0, seat, 0.075, 0.022), (-0.30, 0, seat, 0.055, 0.022), (-0.13, 0, seat + 0.005, 0.018, 0.018)],
        axis=0)]  # fmt: skip
    for y in (0.05, -0.05):
        frame += [tube("frame", [(ax, 0.4 * y, az), (REAR, y, RADIUS)], 0.009),
            tube("frame", [(top[0], 0.3 * y, top[2]), (REAR, y, RADIUS)], 0.008)]  # fmt: skip
    length = math.hypot(FRONT - hx, RADIUS - hz)
    bars = [(0.0, 0.0, 0.16), (_GRIP[0] + 0.03, 0.03, 0.23), (_GRIP[0] + 0.02, 0.18, _GRIP[2]),
        (_GRIP[0] - 0.04, 0.31, _GRIP[2])]  # fmt: skip
    fork = [tube("metal", [(0, 0, -0.08), (0, 0, 0.16)], 0.014)]
    for y in (1.0, -1.0):
        fork.append(tube("metal", [(x, y * across, z) for x, across, z in bars], 0.012))
        fork.append(tube("rubber", [(x, y * across, z) for x, across,
            z in ((_GRIP[0] - 0.045, 0.32, _GRIP[2]), (_GRIP[0], 0.22, _GRIP[2]))], 0.018))  # fmt: skip
        fork.append(tube("frame", [(0, 0.05 * y, -0.09), (0.005, 0.055 * y, -0.3), (0.02, 0.05 * y, -length)], 0.010))
    fork.append(tube("frame", [(0, 0.055, -0.09), (0, -0.055, -0.09)], 0.014))
    ring = placed(make_lathe(f"{name} metal", [(0.0, -0.004), (0.09, -0.004), (0.09, 0.004), (0.0, 0.004)], sides=24),
        transforms.pose((0, -0.06, 0), (90, 0, 0)))  # fmt: skip
    cranks = [ring, tube("metal", [(0, 0.08, 0), (0, -0.08, 0)], 0.018),
        tube("metal", [(0, 0.075, 0), (0, 0.08, -_CRANK)], 0.011),
        tube("metal", [(0, -0.075, 0), (0, -0.08, _CRANK)], 0.011)]  # fmt: skip
    pedal = make_box(f"{name} rubber", (0.09, 0.09, 0.022), bevel=0.004)
    wheel = _wheel(name)
    return (
        part(f"{name} frame", *frame),
        part(f"{name} fork", *fork),
        part(f"{name} front wheel", *wheel),
        part(f"{name} rear wheel", *wheel),
        part(f"{name} cranks", *cranks),
        part(f"{name} left pedal", pedal),
        part(f"{name} right pedal", pedal),
    )


def _wheel(name: str) -> list[Mesh]:
    """Return tyre, rim, hub and 12 spokes, about y."""
    turn = np.linspace(0, 2 * np.pi, 9)
    tyre = make_lathe(
        f"{name} rubber", np.stack([RADIUS - 0.018 + 0.018 * np.cos(turn), 0.018 * np.sin(turn)], 1), sides=40
    )
    rim = make_lathe(
        f"{name} metal", [(0.290, -0.011), (0.308, -0.011), (0.308, 0.011), (0.290, 0.011), (0.290, -0.011)], sides=40
    )
    hub = make_lathe(f"{name} metal", [(0, -0.045), (0.02, -0.045), (0.02, 0.045), (0, 0.045)], sides=10)
    spokes = []
    for k in range(12):
        c, s = math.cos(math.tau * k / 12), math.sin(math.tau * k / 12)
        spokes.append(
            make_tube(f"{name} metal", [(0, 0, 0.03 * (-1) ** k), (0.295 * c, 0.295 * s, 0)], 0.0025, sides=4)
        )
    return [placed(each, transforms.pose((0, 0, 0), (90, 0, 0))) for each in (tyre, rim, hub, *spokes)]


class CyclistGait:
    """Rides."""

    def __init__(self, stature: float, placement: Placement, ground: Ground, rng: np.random.Generator) -> None:
        self._stature, self._ground = stature, ground
        self.motion = Motion(placement)
        self._yaw, self._lean, self._steer = placement.heading, 0.0, 0.0
        self._stood = 0.0
        """[s] that it stands, at most those in which the foot comes down."""
        self._wheels = [0.0, 0.0]
        self._crank = float(rng.uniform(0, math.tau))

    def step(self, placement: Placement) -> tuple[Array, Array]:
        """Return world_from_root (4, 4) and the joints' values at the next knot."""
        motion = self.motion
        x0, y0, heading, before = motion.x, motion.y, motion.heading, self._yaw
        motion.follow(placement)
        dx, dy = motion.x - x0, motion.y - y0
        turn = motion.heading - heading
        if motion.rolled >= 0:
            turn = (dy * math.cos(before) - dx * math.sin(before)) / -REAR
        self._yaw = before + turn
        c, s = math.cos(before + turn / 2), math.sin(before + turn / 2)
        ahead, aside = dx * c + dy * s, dy * c - dx * s + turn * FRONT
        if abs(ahead) > 1e-6:
            self._steer = min(max(math.atan(aside / ahead), -0.7), 0.7)
        self._wheels[0] += math.hypot(ahead, aside) * math.copysign(1.0, ahead) / RADIUS
        self._wheels[1] += ahead / RADIUS
        self._crank += max(ahead, 0.0) / RADIUS / _GEAR
        stands = abs(motion.speed) < _STANDS
        self._stood = min(self._stood + STEP, _DOWN[1]) if stands else max(self._stood - 2 * STEP, 0.0)
        down = ease((self._stood - _DOWN[0]) / (_DOWN[1] - _DOWN[0]))
        leaning = math.atan(motion.speed * turn / STEP / GRAVITY) + _TIP * down
        self._lean += STEP / (0.25 + STEP) * (leaning - self._lean)
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        front, rear = (
            self._ground(motion.x + FRONT * c, motion.y + FRONT * s),
            self._ground(motion.x + REAR * c, motion.y + REAR * s),
        )
        root = np.eye(4)
        root[:3, :3] = np.array(turned(self._yaw, -math.atan2(front - rear, FRONT - REAR), -self._lean)).reshape(3, 3)
        root[:3, 3] = motion.x, motion.y, (front * -REAR + rear * FRONT) / (FRONT - REAR)
        cranks = self._crank
        bicycle = [-_RAKE, self._steer, self._wheels[0], self._wheels[1], cranks, -cranks, -cranks]
        x, y, _ = root[:3, 3] + root[:3, :3] @ [_FOOT[0], _FOOT[1], 0.0]
        rise = self._ground(x, y) - float(root[2, 3] + root[2, 0] * _FOOT[0])
        return root, np.array(bicycle + self._rider(down, rise))

    def _rider(self, down: float, rise: float) -> list[float]:
        """Return the angles of the rider's joints; all in the frame of the bicycle.

        The left foot is on the ground by the share ``down``, else on its pedal; there the ground is higher by ``rise``
        [m].
        """
        h, hips = self._stature, _saddle(self._stature)
        chest = _PELVIS + _CHEST
        values = [hips, 0.0, _PELVIS, 0.0, 0.0, _CHEST, 0.0, 0.3 * self._steer, -0.85 * chest]
        turn = turned(0.0, _PELVIS, 0.0)
        sx = -0.27 + h * (0.06 * math.sin(_PELVIS) + SHOULDER_UP * math.sin(chest) - 0.004 * math.cos(chest))
        sz = hips + h * (0.06 * math.cos(_PELVIS) + SHOULDER_UP * math.cos(chest) + 0.004 * math.sin(chest))
        for side in (1.0, -1.0):
            values += self._arm(side, (sx, side * SHOULDER * h, sz), chest)
        for side in (1.0, -1.0):
            angle = self._crank + (0.0 if side > 0 else math.pi)
            px, pz = _AXLE[0] - _CRANK * math.sin(angle), _AXLE[1] - _CRANK * math.cos(angle) + 0.016
            tilt = 0.20 + 0.22 * math.sin(angle)
            share = down if side > 0 else 0.0
            py, tilt = side * 0.115, tilt + share * (_TIPTOE - tilt)
            if share:
                c, s = math.cos(self._lean), math.sin(self._lean)
                y, z = _FOOT[1] * c - rise * s, _FOOT[1] * s + rise * c
                px, py, pz = px + share * (_FOOT[0] - px), py + share * (y - py), pz + share * (z - pz)
            own = pitched(turned(0.0, 0.0, share * self._lean), tilt)
            x, y, z = applied(own, BALL * h, 0.0, -ANKLE * h)
            ankle = (px - x, py - y, pz - z)
            values += leg_angles((-0.27, side * HIP * h, hips), turn, (ankle, own, -share * _TIPTOE), 0.0, h)
        return values

    def _arm(self, side: float, shoulder: tuple[float, float, float], chest: float) -> tuple[float, float, float]:
        """Return the angles of shoulder and elbow with which a hand is at its grip."""
        x, y, z = _GRIP[0], side * _GRIP[1], _GRIP[2] + 0.01
        c, s = math.cos(self._steer), math.sin(self._steer)
        x, y = c * x - s * y, s * x + c * y
        c, s = math.cos(_RAKE), math.sin(_RAKE)
        x, z = c * x - s * z + _HEAD[0] - shoulder[0], s * x + c * z + _HEAD[1] - shoulder[2]
        y -= shoulder[1]
        c, s = math.cos(chest), math.sin(chest)
        x, z = c * x - s * z, s * x + c * z
        upper, lower = UPPER_ARM * self._stature, (FOREARM + 0.045) * self._stature
        far = min(x * x + y * y + z * z, (0.995 * (upper + lower)) ** 2)
        elbow = -math.acos(max(-1.0, min(1.0, (far - upper * upper - lower * lower) / (2 * upper * lower))))
        out, down = -lower * math.sin(elbow), upper + lower * math.cos(elbow)
        aside = math.asin(max(-1.0, min(1.0, y / down)))
        return math.atan2(x, z) - math.atan2(out, -down * math.cos(aside)), aside, elbow

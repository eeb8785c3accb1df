# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What rolls on four wheels: car, tractor and robot. Wheels turn by their own way over the ground, without slip.

A vehicle that steers follows its placement as one that is drawn at its middle: the rear axle never moves sideways, so
that its heading in a curve is that of the way of the axle, and the front wheels point along their own motion.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.actors.figure import Figure, Ground, Joint, Placement, fitted
from fieldtruth.actors.limbs import Motion, turned
from fieldtruth.actors.shapes import Colour, Surface, make_ball, make_loft, materials_of, part
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.solids import bar_outline, make_box, make_extrusion, make_lathe, make_tube, placed

_MOST_STEER: Final = 0.7
"""[rad] of a front wheel."""


class Wheel(NamedTuple):
    """Centre of a wheel x, y [m], radius and width [m], and whether it steers."""

    x: float
    y: float
    radius: float
    width: float
    steers: bool = False


def _four(
    front: float, rear: float, half_track: float, sizes: Sequence[float], steers: bool = True
) -> tuple[Wheel, ...]:
    """Return the wheels front left, front right, rear left and rear right; sizes: radius and width of both axles."""
    return tuple(Wheel(x, side * half_track, sizes[k], sizes[k + 1], steers and k == 0) for x,
        k in ((front, 0), (-rear, 2)) for side in (1.0, -1.0))  # fmt: skip


_CAR: Final = _four(1.30, 1.30, 0.80, (0.32, 0.21, 0.32, 0.21))
_TRACTOR: Final = _four(1.15, 1.15, 0.80, (0.50, 0.34, 0.80, 0.46))
_PAINTS: Final[tuple[tuple[Colour, float], ...]] = (((0.62, 0.62, 0.61), 0.8), ((0.016, 0.016, 0.018), 0.05),
    ((0.30, 0.31, 0.32), 0.35), ((0.10, 0.105, 0.11), 0.15), ((0.030, 0.070, 0.20), 0.25),
    ((0.28, 0.018, 0.016), 0.5), ((0.05, 0.085, 0.060), 0.2))  # fmt: skip
"""Colours with the reflectance of a LiDAR's light: black and white paint of ECOSTRESS, the others assumed."""
_MAKES: Final[tuple[tuple[Colour, Colour], ...]] = (((0.025, 0.11, 0.022), (0.55, 0.42, 0.02)),
    ((0.36, 0.022, 0.016), (0.55, 0.55, 0.53)), ((0.022, 0.075, 0.24), (0.5, 0.5, 0.5)),
    ((0.11, 0.22, 0.03), (0.36, 0.02, 0.015)))  # fmt: skip
_RUBBER: Final = Surface((0.024, 0.023, 0.022), 0.05)
_GLASS: Final = Surface((0.014, 0.017, 0.019), 0.08, 0.8)
_DARK: Final = Surface((0.022, 0.022, 0.023), 0.08, 0.1)


class VehicleKind:
    """Makes cars, tractors or robots."""

    def __init__(self, name: str) -> None:
        self._name = name

    def figure(self, name: str, rng: np.random.Generator) -> Figure:
        """Return a vehicle of random colour."""
        make = {"car": _car, "tractor": _tractor, "robot": _robot}[self._name]
        return fitted(make(name, rng), self)

    def gait(self, figure: Figure, placement: Placement, ground: Ground, rng: np.random.Generator) -> "Rolling":
        """Return the motion of a vehicle on its wheels."""
        wheels = {"car": _CAR, "tractor": _TRACTOR, "robot": _robot_wheels()}[self._name]
        return Rolling(wheels, placement, ground)


class _Made(NamedTuple):
    """A vehicle as it is made: meshes of body and wheels, what they are made of, and how it goes."""

    wheels: tuple[Wheel, ...]
    parts: tuple[Mesh, ...]
    surfaces: dict[str, Surface]
    size: tuple[float, float, float]
    speeds: tuple[float, float]


def _figure(name: str, kind: str, made: _Made, label: Label) -> Figure:
    wheels, parts, surfaces, size, speeds = made
    joints = []
    for k, (wheel, side) in enumerate(
        zip(wheels, ("front_left", "front_right", "rear_left", "rear_right"), strict=True)
    ):
        for what, axis in (("steer", "z"), ("wheel", "y")) if wheel.steers else (("wheel", "y"),):
            joints.append(Joint(f"{side}_{what}", 1 + k, -1, (wheel.x, wheel.y, wheel.radius), axis))
    steers = wheels[0].steers
    return Figure(kind=kind, label=label, parts=parts, joints=tuple(joints),
        materials=materials_of(name, label, surfaces), colliders=(Collider(shape="box", size=size),),
        radius=math.hypot(size[0], size[1]) / 2, speed=speeds[0], top_speed=speeds[1],
        turn_radius=(wheels[0].x - wheels[2].x) / math.tan(_MOST_STEER) + wheels[0].y if steers else 0.0)  # fmt: skip


def _box(material: str, centre: Sequence[float], size: Sequence[float], bevel: float = 0.01) -> Mesh:
    return placed(make_box(material, size, bevel=min(bevel, 0.4 * min(size))), transforms.pose(tuple(centre)))


def _mirrored(mesh: Mesh) -> list[Mesh]:
    """A mesh and its mirror image in the plane y = 0."""
    flip = np.array([1, -1, 1], np.float32)
    return [mesh, replace(mesh, vertices=mesh.vertices * flip, normals=mesh.normals * flip, faces=mesh.faces[:, ::-1])]


def wheel_mesh(name: str, radius: float, width: float, *, rim: float = 0.64, bolts: int = 5, lugs: int = 0) -> Mesh:
    """Tyre, rim with spokes of a wheel about y, and the lugs of a tractor's."""
    half, inner = width / 2, rim * radius
    round_off = min(0.18 * width, 0.12 * radius)
    section = [
        (inner, -half * 0.8),
        (radius - round_off, -half),
        (radius, -half + round_off),
        (radius, half - round_off),
        (radius - round_off, half),
        (inner, half * 0.8),
    ]
    found = [make_lathe(f"{name} rubber", section, sides=36)]
    for side in (1.0, -1.0):
        dish = [(inner, 0.7 * half * side), (0.85 * inner, 0.45 * half * side), (0.3 * inner, 0.5 * half * side),
            (0.0, 0.55 * half * side)]  # fmt: skip
        found.append(make_lathe(f"{name} rim", dish if side > 0 else dish[::-1], sides=24))
        for k in range(bolts):
            angle = 360.0 * k / bolts
            hole = placed(make_box(f"{name} rubber", (0.34 * inner, 0.22 * inner, 0.02), bevel=0.005),
                transforms.pose((0.66 * inner, 0, 0.47 * half * side)))  # fmt: skip
            found.append(placed(hole, transforms.pose((0, 0, 0), (0, 0, angle))))
    for k in range(lugs):
        for side in (1.0, -1.0):
            lug = placed(make_box(f"{name} rubber", (0.06 * radius, 0.07 * radius, 0.55 * width), bevel=0.008),
                transforms.pose((0.965 * radius, 0, 0.25 * width * side), (35.0 * side, 0, 0)))  # fmt: skip
            found.append(
                placed(lug, transforms.pose((0, 0, 0), (0, 0, 360.0 * (k + (0.5 if side < 0 else 0.0)) / lugs)))
            )
    return placed(part(f"{name} wheel", *found), transforms.pose((0, 0, 0), (90.0, 0, 0)))


def _wheels(name: str, wheels: Sequence[Wheel], **others: Any) -> tuple[Mesh, ...]:
    meshes = (wheel_mesh(name, each.radius, each.width, **others) for each in wheels)
    return tuple(part(f"{name} wheel {k}", mesh) for k, mesh in enumerate(meshes, 1))


def _car(name: str, rng: np.random.Generator) -> Figure:
    """A car of 4.2 m with five doors, as a hatchback or an estate."""
    (colour, value), long = _PAINTS[rng.integers(len(_PAINTS))], 0.35 if rng.random() < 0.5 else 0.0
    surfaces = {"paint": Surface(colour, value, 0.5), "glass": _GLASS, "rubber": _RUBBER, "dark": _DARK,
        "rim": Surface((0.30, 0.30, 0.31), 0.3, 0.4), "lamp": Surface((0.62, 0.63, 0.62), 0.5, 0.8),
        "red": Surface((0.30, 0.012, 0.010), 0.4, 0.6), "plate": Surface((0.6, 0.6, 0.58), 0.7)}  # fmt: skip
    lower = [(-2.02, 0, 0.63, 0.76, 0.27), (-1.92, 0, 0.62, 0.83, 0.35), (-1.3, 0, 0.61, 0.875, 0.39),
        (0.3, 0, 0.61, 0.885, 0.385), (1.0, 0, 0.595, 0.88, 0.365), (1.6, 0, 0.565, 0.86, 0.325),
        (1.95, 0, 0.535, 0.80, 0.27), (2.08, 0, 0.52, 0.70, 0.21)]  # fmt: skip
    body = [make_loft(f"{name} paint", lower, axis=0, sides=28, square=4.5, bulge=0.12)]
    cabin = [(0.92, -0.42 - 0.4 * long, 0, 1.36 + 0.4 * long, 0.80),
        (1.16, -0.50 - 0.55 * long, 0, 1.13 + 0.55 * long, 0.735),
        (1.40, -0.60 - 0.7 * long, 0, 0.82 + 0.7 * long, 0.63)]  # fmt: skip
    body.append(make_loft(f"{name} glass", cabin, sides=28, square=6.0, bulge=0.0))
    roof = [(1.385, cabin[2][1], 0, cabin[2][3] + 0.03, 0.655), (1.44, cabin[2][1], 0, cabin[2][3] - 0.08, 0.56)]
    body.append(make_loft(f"{name} paint", roof, sides=28, square=5.0, bulge=0.03))
    (low, front, _, reach, _), top = cabin[0], cabin[2]
    for share_low, share_top in ((0.93, 0.95), (0.12, 0.08), (-0.95, -0.95)):
        foot = (front + share_low * reach, 0.775 if abs(share_low) < 0.5 else 0.72, low)
        head = (top[1] + share_top * top[3], 0.63 if abs(share_low) < 0.5 else 0.565, 1.385)
        body += _mirrored(make_tube(f"{name} paint", [foot, head], 0.036, sides=8))
    for wheel in _CAR:
        arch = [(0.352 * math.cos(a), 0.352 * math.sin(a)) for a in np.linspace(-0.2, math.pi + 0.2, 13)]
        arch_mesh = _strip(f"{name} dark", arch, 0.07, 0.02)
        body.append(placed(arch_mesh, transforms.pose((wheel.x, 0.876 * math.copysign(1, wheel.y), wheel.radius))))
    body += _mirrored(make_ball(f"{name} lamp", (1.995, 0.56, 0.66), (0.13, 0.17, 0.07), sides=14, rings=8))
    body += _mirrored(make_ball(f"{name} red", (-1.98, 0.62, 0.78), (0.09, 0.12, 0.11), sides=14, rings=8))
    body += _mirrored(make_ball(f"{name} paint", (0.72, 0.93, 1.0), (0.07, 0.10, 0.065)))
    body += _mirrored(_box(f"{name} dark", (0.0, 0.86, 0.28), (2.0, 0.06, 0.09)))
    for x in (0.55, -0.42):
        body += _mirrored(_box(f"{name} dark", (x, 0.881, 0.66), (0.010, 0.012, 0.58), 0.003))
    body += [_box(f"{name} dark", (2.06, 0, 0.42), (0.1, 1.1, 0.16), 0.02),
        _box(f"{name} dark", (2.09, 0, 0.62), (0.05, 0.7, 0.07), 0.02)]  # fmt: skip
    body += [_box(f"{name} plate", (2.12, 0, 0.42), (0.02, 0.52, 0.11), 0.004),
        _box(f"{name} plate", (-2.05, 0, 0.72), (0.03, 0.52, 0.11), 0.004)]  # fmt: skip
    body.append(_box(f"{name} dark", (-2.02, 0, 0.40), (0.1, 1.4, 0.14), 0.02))
    parts = (part(f"{name} body", *body), *_wheels(name, _CAR))
    return _figure(name, "car", _Made(_CAR, parts, surfaces, (4.2, 1.8, 1.46), (4.0, 14.0)), Label.VEHICLE)


def _tractor(name: str, rng: np.random.Generator) -> Figure:
    """A tractor of 3.9 m with a cab."""
    colour, rim = _MAKES[rng.integers(len(_MAKES))]
    surfaces = {"paint": Surface(colour, 0.35, 0.4), "glass": _GLASS, "rubber": _RUBBER, "dark": _DARK,
        "rim": Surface(rim, 0.5, 0.2), "lamp": Surface((0.62, 0.63, 0.62), 0.5, 0.7),
        "red": Surface((0.5, 0.16, 0.01), 0.4, 0.5)}  # fmt: skip
    hood = [(0.1, 0, 1.17, 0.40, 0.36), (0.9, 0, 1.14, 0.38, 0.34), (1.55, 0, 1.08, 0.34, 0.30),
        (1.75, 0, 1.05, 0.30, 0.26)]  # fmt: skip
    body = [make_loft(f"{name} paint", hood, axis=0, sides=20, square=4.0, bulge=0.12),
        _box(f"{name} dark", (0.2, 0, 0.74), (2.9, 0.46, 0.42), 0.05),
        _box(f"{name} dark", (1.79, 0, 1.02), (0.05, 0.48, 0.36), 0.02),
        _box(f"{name} glass", (-0.55, 0, 1.85), (1.18, 1.26, 1.26), 0.06),
        _box(f"{name} paint", (-0.55, 0, 2.56), (1.36, 1.42, 0.15), 0.05),
        _box(f"{name} paint", (-0.55, 0, 1.16), (1.24, 1.30, 0.24), 0.05), make_tube(f"{name} dark",
        [(0.95, -0.34, 1.3), (0.95, -0.44, 1.5), (0.95, -0.44, 2.35)], 0.045),
        make_ball(f"{name} red", (-1.0, 0.5, 2.70), (0.07, 0.07, 0.09))]  # fmt: skip
    for x in (0.03, -0.62, -1.13):
        body += _mirrored(_box(f"{name} dark", (x, 0.62, 1.86), (0.07, 0.07, 1.30), 0.01))
    rear, front = _TRACTOR[2], _TRACTOR[0]
    arc = [(math.cos(a) * 0.93, math.sin(a) * 0.93) for a in np.linspace(0.35, 2.75, 9)]
    fender = _strip(f"{name} paint", arc, 0.04, 0.52)
    body += _mirrored(placed(fender, transforms.pose((-1.15, rear.y, rear.radius))))
    body += _mirrored(make_ball(f"{name} lamp", (1.76, 0.22, 1.20), (0.06, 0.09, 0.06)))
    body += _mirrored(_box(f"{name} red", (-1.72, rear.y, 1.42), (0.05, 0.2, 0.1)))
    body.append(_box(f"{name} dark", (front.x, 0, front.radius), (0.16, 1.3, 0.16), 0.03))
    body.append(_box(f"{name} dark", (-1.15, 0, rear.radius), (0.3, 1.2, 0.3), 0.05))
    steps = [_box(f"{name} dark", (0.12, 0.62, z), (0.3, 0.22, 0.04)) for z in (0.5, 0.8)]
    parts = (part(f"{name} body", *body, *steps), *_wheels(name, _TRACTOR, lugs=14, rim=0.60, bolts=6))
    return _figure(name, "tractor", _Made(_TRACTOR, parts, surfaces, (3.9, 2.1, 2.75), (3.0, 9.0)), Label.VEHICLE)


def _strip(material: str, path: Sequence[tuple[float, float]], thickness: float, width: float) -> Mesh:
    """Bar along a path of x, z [m] that is as wide along y."""
    return make_extrusion(material, bar_outline(path, thickness), width)


def _robot_wheels() -> tuple[Wheel, ...]:
    w = Rig().wheels
    return _four(w.half_wheelbase, w.half_wheelbase, w.half_track, (w.radius, w.width) * 2, steers=False)


def _robot(name: str, rng: np.random.Generator) -> Figure:
    """The robot of the default rig, with a mast and a LiDAR."""
    wheels, robot = _robot_wheels(), Rig().robot
    accent = ((0.55, 0.36, 0.01), (0.40, 0.03, 0.02), (0.02, 0.10, 0.28))[rng.integers(3)]
    surfaces = {
        "paint": Surface((0.055, 0.057, 0.060), 0.05, 0.2),
        "rubber": Surface((0.030, 0.029, 0.028), 0.05),
        "dark": _DARK,
        "rim": Surface((0.20, 0.20, 0.19), 0.2),
        "accent": Surface(accent, 0.5, 0.3),
        "lens": _GLASS,
    }
    length, _, height = robot.outline
    wide, low = robot.chassis_width - wheels[0].width, robot.ground_clearance
    body = [_box(f"{name} paint", (0, 0, (low + height) / 2), (0.86 * length, wide, height - low), 0.03),
        _box(f"{name} accent", (0, 0, height - 0.06), (0.9 * length, wide + 0.02, 0.05), 0.01), _box(f"{name} paint",
        (0, 0, height + 0.01), (0.8 * length, 0.62, 0.02), 0.005),
        _box(f"{name} dark", (0.47 * length, 0, 0.24), (0.06, 0.40, 0.08), 0.02),
        _box(f"{name} dark", (-0.47 * length, 0, 0.24), (0.06, 0.40, 0.08), 0.02),
        make_tube(f"{name} rim", [(0.1, 0, height), (0.1, 0, height + 0.34)], 0.025),
        placed(make_lathe(f"{name} dark", [(0, 0), (0.052, 0), (0.052, 0.075), (0, 0.075)]),
        transforms.pose((0.1, 0, height + 0.34))),
        _box(f"{name} dark", (0.33, 0, height + 0.06), (0.05, 0.16, 0.05), 0.008)]  # fmt: skip
    body += _mirrored(make_ball(f"{name} lens", (0.355, 0.06, height + 0.06), (0.012, 0.018, 0.018), sides=8))
    parts = (part(f"{name} body", *body), *_wheels(name, wheels, rim=6 / 13, bolts=6))
    size = (length, robot.outline[1], height + 0.42)
    return _figure(name, "robot", _Made(wheels, parts, surfaces, size, (0.8, robot.max_speed)), Label.ROBOT)


class Rolling:
    """Motion on four wheels."""

    def __init__(self, wheels: Sequence[Wheel], placement: Placement, ground: Ground) -> None:
        self._wheels, self._ground = wheels, ground
        self.motion = Motion(placement)
        self._yaw, self._angles = placement.heading, [0.0] * len(wheels)
        self._steers = [0.0] * len(wheels)

    def step(self, placement: Placement) -> tuple[Array, Array]:
        """Return world_from_root (4, 4) and the angles of the wheels at the next knot."""
        motion, wheels = self.motion, self._wheels
        x0, y0, heading, before = motion.x, motion.y, motion.heading, self._yaw
        motion.follow(placement)
        dx, dy = motion.x - x0, motion.y - y0
        turn = motion.heading - (before if not wheels[0].steers else heading)  # backwards, as it heads
        if wheels[0].steers and motion.rolled >= 0:  # the rear axle does not move sideways
            turn = (dy * math.cos(before) - dx * math.sin(before)) / -wheels[2].x
        self._yaw = before + turn
        c, s = math.cos(before + turn / 2), math.sin(before + turn / 2)
        ahead, aside = dx * c + dy * s, dy * c - dx * s
        values = []
        for k, wheel in enumerate(wheels):
            along, across = ahead - turn * wheel.y, aside + turn * wheel.x
            if wheel.steers:
                if abs(along) > 1e-6:
                    self._steers[k] = min(max(math.atan(across / along), -_MOST_STEER), _MOST_STEER)
                steer = self._steers[k]
                along = along * math.cos(steer) + across * math.sin(steer)
                values.append(steer)
            self._angles[k] += along / wheel.radius
            values.append(self._angles[k])
        return self._root(), np.array(values)

    def _root(self) -> Array:
        """Return the pose that lies on the ground below the wheels."""
        return lie(self.motion.x, self.motion.y, self._yaw, self._wheels, self._ground)


def lie(x: float, y: float, yaw: float, wheels: Sequence[Wheel], ground: Ground) -> Array:
    """Return world_from_root (4, 4) of what lies with four wheels on the ground."""
    c, s = math.cos(yaw), math.sin(yaw)
    a, b, d, e = (ground(x + c * w.x - s * w.y, y + s * w.x + c * w.y) for w in wheels)
    front, rear = (a + b) / 2, (d + e) / 2
    base = wheels[0].x - wheels[2].x
    pitch = -math.atan2(front - rear, base)
    roll = math.atan2((a - b) / 2 + (d - e) / 2, wheels[0].y - wheels[1].y)
    root = np.eye(4)
    root[:3, :3] = np.array(turned(yaw, pitch, roll)).reshape(3, 3)
    root[:3, 3] = x, y, (front * -wheels[2].x + rear * wheels[0].x) / base
    return root

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clearpath Husky as a MuJoCo body: 50 kg, four wheels, each with a stiff speed servo, skid steering.

Sources of the parameters:

- Mass (50 kg), outline (0.99 x 0.67 x 0.39 m), wheel positions and radius: the paper, section 2.1 and Table 2.
- Mass and inertia of a wheel, inertia and centre of mass of the chassis, its width of 0.5709 m, limits of acceleration:
  the manufacturer's packages husky_description (husky.urdf.xacro, wheel.urdf.xacro) and husky_control (control.yaml).
  Two deviations: the URDF sets the centre of mass 85 mm to the right, here it is centred; it names the wheel's polar
  inertia izz although the axle is y, here it is on the axle.
- Torque limit: none is published. The manufacturer's brochure states a climb of 45 deg (quoted from memory); with a
  payload of 20 kg that takes 80 N m in all, 40 N m a side, where one motor turns both wheels. The tyres slip first, at
  0.68 x 200 N x 0.165 m = 22 N m, so the limit acts only when a wheel is jammed.
- Servo: our own, a speed servo with an integral part. Without one the torque of skidding reduces the turn rate (by 7 %
  at 1000 N m s/rad), and a proportional gain that is stiff enough hits the torque limit in every step and chatters.
  Rotor inertia: an assumed 1.6e-5 kg m^2 behind the gear's 79 : 1 (GP52-079, as users of the robot list it).
- A skid-steered turn is slower than the wheel speeds imply. For four equally loaded wheels whose friction opposes their
  slip, the moments about the middle balance at (commanded - actual) b^2 = actual a^2, with a half the wheel base and b
  half the track, at any speed. The wheels are driven faster by 1 + (a / b)^2 = 1.805 (the manufacturer's: 1.875).
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig, WheelConfig
from fieldtruth.experiment.topic import WHEELS

MASS: Final = 50.0  # [kg]
WHEEL_MASS: Final = 2.637  # [kg]
WHEEL_INERTIA: Final = (0.02467, 0.04411, 0.02467)  # [kg m^2], y is the axle
CHASSIS_CENTRE: Final = (-0.00065, 0.0, 0.062)  # [m], of mass, in base_link
CHASSIS_INERTIA: Final = (0.6022, 1.7386, 2.0296)  # [kg m^2], of the manufacturer's chassis ...
CHASSIS_INERTIA_MASS: Final = 46.034  # [kg], ... which weighs this

OUTLINE: Final = (0.99, 0.67, 0.39)  # [m]
CHASSIS_WIDTH: Final = 0.5709  # [m], between the wheels

SERVO_INTEGRAL_GAIN: Final = 5000.0  # [N m/rad]
SERVO_DAMPING: Final = 60.0  # [N m s/rad]
ROTOR_INERTIA: Final = 0.1  # [kg m^2], at the axle
MAX_TORQUE: Final = 40.0  # [N m] of one wheel
MAX_ACCELERATION: Final = 3.0  # [m/s^2]
MAX_TURN_ACCELERATION: Final = 6.0  # [rad/s^2]

CHASSIS_BIT: Final = 1
"""Collides with the ground."""
OUTLINE_BIT: Final = 2
"""Collides with obstacles."""

WHEEL_GEOMS: Final = tuple(f"{name}_wheel" for name in WHEELS)


def plane_geom(wheel_geom: str) -> str:
    """Name of the plane that a wheel rolls on, a geom and a body."""
    return f"plane_{wheel_geom}"


class Command(NamedTuple):
    """Controller output: forward speed [m/s] and turn rate [rad/s], positive to the left."""

    speed: float
    turn_rate: float


STOP: Final = Command(0.0, 0.0)


def skid_compensation(wheels: WheelConfig) -> float:
    """Factor by which the wheels' speeds must differ more than those of a robot that turns without skidding."""
    return 1.0 + (wheels.half_wheelbase / wheels.half_track) ** 2


def wheel_speeds(commands: ArrayLike, wheels: WheelConfig) -> Array:
    """Wheel speeds (..., 4) [rad/s], in the order of ``WHEELS``, for commands (..., 2) of speed and turn rate."""
    speed, turn_rate = np.moveaxis(np.asarray(commands, np.float64), -1, 0)
    side = turn_rate * wheels.half_track * skid_compensation(wheels)
    left, right = (speed - side) / wheels.radius, (speed + side) / wheels.radius
    return np.stack([left, right, left, right], axis=-1)


def ramp(current: Command, target: Command, times: ArrayLike) -> Array:
    """Commands (n, 2) at ``times`` (n,) [s] from now on, towards ``target`` within the acceleration limits."""
    change = np.asarray(times)[:, None] * (MAX_ACCELERATION, MAX_TURN_ACCELERATION)
    commands: Array = np.clip(np.asarray(target), np.asarray(current) - change, np.asarray(current) + change)
    return commands


def add_husky(spec: Any, rig: Rig) -> None:
    """Add the robot to ``spec`` (mujoco.MjSpec): body base_link with a free joint, wheels, actuators and geoms.

    Joints, actuators and geoms of the wheels are in the order of ``WHEELS``; joints and actuators have these names, the
    geoms those of ``WHEEL_GEOMS``. The wheels' geoms touch the ground only through explicit contact pairs.
    """
    base = spec.worldbody.add_body(name="base_link")
    base.add_freejoint()
    base.mass = MASS - 4 * WHEEL_MASS
    base.ipos = CHASSIS_CENTRE
    base.inertia = np.array(CHASSIS_INERTIA) * (base.mass / CHASSIS_INERTIA_MASS)
    base.explicitinertial = True
    _add_outline(base, rig)
    mounts = rig.mounts()
    for name, geom in zip(WHEELS, WHEEL_GEOMS, strict=True):
        _add_wheel(spec, base, name, geom, mounts[f"{name}_wheel"].xyz, rig.wheels)


class Box(NamedTuple):
    """An axis-aligned box in base_link: edge lengths (3,) [m] and centre (3,) [m]."""

    size: Array
    centre: Array


def body_boxes(rig: Rig) -> dict[str, Box]:
    """Boxes of the robot's body by name.

    ``chassis`` lies between the wheels, ``outline`` covers wheels and chassis, and ``mast`` encloses the sensors above
    the chassis, so that the robot does not pass under a table; a rig without sensors there has no mast.
    """
    ground_clearance = -rig.base_footprint.xyz[2]
    length, width, top = OUTLINE[0], OUTLINE[1], OUTLINE[2] - ground_clearance
    centre = np.array([0.0, 0.0, top / 2])
    boxes = {
        "chassis": Box(np.array([length, CHASSIS_WIDTH, top]), centre),
        "outline": Box(np.array([length, width, top]), centre),
    }
    mounts = np.array([m.xyz for m in rig.mounts().values() if m.xyz[2] > top])
    if len(mounts):
        low, high = mounts.min(axis=0) - 0.05, mounts.max(axis=0) + np.array([0.05, 0.05, 0.0])
        low[2] = top
        boxes["mast"] = Box(high - low, (high + low) / 2)
    return boxes


def wheel_width(wheels: WheelConfig) -> float:
    """Width [m] of a tread: the outline ends at the wheels' outer faces."""
    return 2 * max(OUTLINE[1] / 2 - wheels.half_track, 0.02)


def _add_outline(base: Any, rig: Rig) -> None:
    for name, box in body_boxes(rig).items():
        base.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=box.size / 2,
            pos=box.centre,
            contype=CHASSIS_BIT if name == "chassis" else OUTLINE_BIT,
            conaffinity=0,
        )


def _add_wheel(spec: Any, base: Any, name: str, geom: str, xyz: Sequence[float], wheels: WheelConfig) -> None:
    body = base.add_body(name=name, pos=xyz)
    body.mass, body.inertia, body.explicitinertial = WHEEL_MASS, WHEEL_INERTIA, True
    body.ipos = [0.0, 0.0, 0.0]  # on the axle; without it MuJoCo takes ``pos``, and the centre of mass orbits the axle
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], armature=ROTOR_INERTIA)
    # A tread is round across: an ellipsoid touches in one point that moves smoothly over the terrain's edges, where a
    # cylinder's rim would catch.
    size = [wheels.radius, wheel_width(wheels) / 2, wheels.radius]
    body.add_geom(name=geom, type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=size, contype=OUTLINE_BIT, conaffinity=0)
    servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    # The commanded angle is the integral of the commanded speed, so the mean speed is exact at any load.
    servo.dyntype, servo.gaintype = mujoco.mjtDyn.mjDYN_INTEGRATOR, mujoco.mjtGain.mjGAIN_FIXED
    servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    servo.gainprm[0], servo.biasprm[1:3] = SERVO_INTEGRAL_GAIN, (-SERVO_INTEGRAL_GAIN, -SERVO_DAMPING)
    servo.forcelimited, servo.forcerange = True, [-MAX_TORQUE, MAX_TORQUE]

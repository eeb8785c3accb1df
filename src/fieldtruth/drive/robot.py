# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot of a rig as a MuJoCo body: driven wheels, each with a stiff speed servo, and what else bears it.

The figures and their sources are in ``experiment/models/robot``.

- Torque limit: the tyres slip first (a Husky's at 0.68 x 123 N x 0.165 m = 14 N m), so it acts only when a wheel is
  jammed or the robot is on a steep climb.
- Servo: our own, a speed servo with an integral part. Without one the torque of skidding reduces the turn rate (by 7 %
  at 1000 N m s/rad), and a proportional gain that is stiff enough hits the torque limit in every step and chatters.
  Rotor inertia of a Husky: an assumed 1.6e-5 kg m^2 behind the gear's 79 : 1 (GP52-079, as users of the robot list it).
  What a servo moves is the mass m of the robot, at the radius r of its wheels: gains and rotor grow with m r^2, so that
  the servos of all robots have the same natural frequency and damping.
- A skid-steered turn is slower than the wheel speeds imply. For four equally loaded wheels whose friction opposes their
  slip, the moments about the middle balance at (commanded - actual) b^2 = actual a^2, with a half the wheel base and b
  half the track, at any speed. The wheels are driven faster by 1 + (a / b)^2: 1.805 of a Husky (the manufacturer's:
  1.875), 1 of a differential robot, whose wheels do not skid.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_body import Box as Box
from fieldtruth.experiment.robot_body import chassis_box
from fieldtruth.experiment.robot_config import GRAVITY, RobotConfig, WheelConfig

_HUSKY: Final = RobotConfig()
SERVO_INTEGRAL_GAIN: Final = 5000.0  # [N m/rad], of a Husky, as the two below
SERVO_DAMPING: Final = 60.0  # [N m s/rad]
ROTOR_INERTIA: Final = 0.1  # [kg m^2], at the axle

CHASSIS_BIT: Final = 1
"""Collides with the ground."""
OUTLINE_BIT: Final = 2
"""Collides with obstacles."""


class Support(NamedTuple):
    """What bears the robot: a wheel, or the caster, which is fixed to base_link and has no friction."""

    geom: str
    body: str
    hub: tuple[float, float, float]  # [m], in base_link
    radius: float  # [m], loaded
    width: float  # [m]
    share: float  # of the robot's weight

    def deflection(self, robot: RobotConfig) -> float:
        """Deflection [m] of the tyre at rest: its contact acts from this far above the loaded radius."""
        return robot.mass * GRAVITY * self.share / robot.wheels.tyre_stiffness


def supports(rig: Rig) -> tuple[Support, ...]:
    """What bears the robot: the wheels by ``names``, then the caster."""
    robot, wheels, mounts = rig.robot, rig.wheels, rig.mounts()
    share = (1 - robot.caster_share) / len(wheels.names)
    result = [
        Support(f"{name}_wheel", name, mounts[f"{name}_wheel"].xyz, wheels.radius, wheels.width, share)
        for name in wheels.names
    ]
    if (caster := robot.caster) is not None:
        hub = (caster.x, 0.0, caster.radius - robot.ground_clearance)
        result.append(Support("caster", "base_link", hub, caster.radius, caster.width, robot.caster_share))
    return tuple(result)


def plane_geom(support_geom: str) -> str:
    """Name of the plane that a wheel or caster rolls on, a geom and a body."""
    return f"plane_{support_geom}"


def servo_scale(robot: RobotConfig) -> float:
    """Moment of inertia of a robot's mass at its wheels, in that of a Husky."""

    def moved(figures: RobotConfig) -> float:
        return figures.mass * figures.wheels.radius**2

    return moved(robot) / moved(_HUSKY)


class Command(NamedTuple):
    """Controller output: forward speed [m/s] and turn rate [rad/s], positive to the left."""

    speed: float
    turn_rate: float


STOP: Final = Command(0.0, 0.0)


def skid_compensation(wheels: WheelConfig) -> float:
    """Factor by which the wheels' speeds must differ more than those of a robot that turns without skidding."""
    return 1.0 + (wheels.half_wheelbase / wheels.half_track) ** 2


def wheel_speeds(commands: ArrayLike, wheels: WheelConfig) -> Array:
    """Wheel speeds (..., n) [rad/s], by ``wheels.names``, for commands (..., 2) of speed and turn rate."""
    speed, turn_rate = np.moveaxis(np.asarray(commands, np.float64), -1, 0)
    side = turn_rate * wheels.half_track * skid_compensation(wheels)
    left, right = (speed - side) / wheels.radius, (speed + side) / wheels.radius
    return np.stack([left, right] * (len(wheels.names) // 2), axis=-1)


def ramp(current: Command, target: Command, times: ArrayLike, robot: RobotConfig) -> Array:
    """Commands (n, 2) at ``times`` (n,) [s] from now on, towards ``target`` within the robot's acceleration limits."""
    change = np.asarray(times)[:, None] * (robot.max_acceleration, robot.max_turn_acceleration)
    commands: Array = np.clip(np.asarray(target), np.asarray(current) - change, np.asarray(current) + change)
    return commands


def add_robot(spec: Any, rig: Rig) -> None:
    """Add the robot to ``spec`` (mujoco.MjSpec): body base_link with a free joint, wheels, actuators and geoms.

    Joints, actuators and geoms of the wheels are in the order of their names; joints and actuators have these names,
    the geoms those of ``supports``. The geoms of supports touch the ground only through explicit contact pairs.
    """
    robot = rig.robot
    base = spec.worldbody.add_body(name="base_link")
    base.add_freejoint()
    base.mass = robot.mass - len(robot.wheels.names) * robot.wheels.mass
    base.ipos = robot.chassis_centre
    base.inertia = np.array(robot.chassis_inertia) * (base.mass / robot.chassis_inertia_mass)
    base.explicitinertial = True
    _add_outline(base, rig)
    for support in supports(rig):
        body = base if support.body == "base_link" else _add_wheel(spec, base, support.body, support.hub, robot)
        # A tread is round across: an ellipsoid touches in one point that moves smoothly over the terrain's edges, where
        # a cylinder's rim would catch.
        body.add_geom(
            name=support.geom,
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            size=[support.radius, support.width / 2, support.radius],
            pos=support.hub if body is base else [0.0, 0.0, 0.0],
            contype=OUTLINE_BIT,
            conaffinity=0,
        )


def body_boxes(rig: Rig) -> dict[str, Box]:
    """Boxes of the robot's body by name.

    ``chassis`` lies between the wheels, ``outline`` covers wheels and chassis, and ``mast`` encloses the sensors above
    the chassis, so that the robot does not pass under a table; a rig without sensors there has no mast.
    """
    robot = rig.robot
    length, width, height = robot.outline
    top = height - robot.ground_clearance
    boxes = {
        "chassis": chassis_box(rig),
        "outline": Box(np.array([length, width, top]), np.array([0.0, 0.0, top / 2])),
    }
    mounts = np.array([m.xyz for m in rig.mounts().values() if m.xyz[2] > top])
    if len(mounts):
        low, high = mounts.min(axis=0) - 0.05, mounts.max(axis=0) + np.array([0.05, 0.05, 0.0])
        low[2] = top
        boxes["mast"] = Box(high - low, (high + low) / 2)
    return boxes


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


def _add_wheel(spec: Any, base: Any, name: str, hub: Sequence[float], robot: RobotConfig) -> Any:
    """Add a wheel with its servo; return its body."""
    body, scale = base.add_body(name=name, pos=hub), servo_scale(robot)
    body.mass, body.inertia, body.explicitinertial = robot.wheels.mass, robot.wheels.inertia, True
    body.ipos = [0.0, 0.0, 0.0]  # on the axle; without it MuJoCo takes ``pos``, and the centre of mass orbits the axle
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], armature=ROTOR_INERTIA * scale)
    servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    # The commanded angle is the integral of the commanded speed, so the mean speed is exact at any load.
    servo.dyntype, servo.gaintype = mujoco.mjtDyn.mjDYN_INTEGRATOR, mujoco.mjtGain.mjGAIN_FIXED
    servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    gain, damping = SERVO_INTEGRAL_GAIN * scale, SERVO_DAMPING * scale
    servo.gainprm[0], servo.biasprm[1:3] = gain, (-gain, -damping)
    servo.forcelimited, servo.forcerange = True, [-robot.max_torque, robot.max_torque]
    return body

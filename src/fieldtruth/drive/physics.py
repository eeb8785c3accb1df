# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot of a rig, and MuJoCo's model of it in a world: ground, obstacles, and the contact of tyre and soil.

The robot has driven wheels, each with a stiff speed servo, and possibly a caster.
Its figures and their sources are in ``experiment/models/robot``.

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

Each wheel, and a caster, touches one plane, which ``drive.surroundings`` lays before every step. The chassis collides
with the heightfield, the whole outline with the obstacles.

Friction 0.68 is the peak value of a tyre on a dry earth road (Wong, Theory of Ground Vehicles, table of average
coefficients of road adhesion): that of the chassis, and of wheels until ``drive.soil`` sets theirs in every
step, isotropic. MuJoCo's contact is soft and convex, and sliding pushes it apart: by mu * b_t * slip / (stiffness x R)
with b_t the decay of slip and R its regularization, here 0.1 mm for each m/s of slip. A stiff contact would lift off;
with a tyre's stiffness it does not. ``impratio`` keeps friction stiff: on a slope of 13 deg a standing robot creeps by
0.001 mm/s. Elliptic cones and Newton; pyramidal ones chatter.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose, quaternion_wxyz_from_rotation
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.track import STEP_S
from fieldtruth.experiment.rig import Box, Rig, chassis_box, rollers
from fieldtruth.experiment.robot_config import GRAVITY, RobotConfig, WheelConfig
from fieldtruth.kernels.stepping import ramp_commands, turn_wheels
from fieldtruth.world.model import Collider, Heightfield, World

_HUSKY: Final = RobotConfig()
SERVO_INTEGRAL_GAIN: Final = 5000.0  # [N m/rad], of a Husky, as the two below
SERVO_DAMPING: Final = 60.0  # [N m s/rad]
ROTOR_INERTIA: Final = 0.1  # [kg m^2], at the axle
_STIFF_STEP_S: Final = 0.002
"""Step of the physics [s] up to which the servos are stable; longer ones have rotors that are heavier by as much."""
CHASSIS_BIT: Final = 1
"""Collides with the ground."""
OUTLINE_BIT: Final = 2
"""Collides with obstacles."""
FRICTION: Final = 0.68
DAMPING_RATIO: Final = 0.1  # of a tyre; see drive.surroundings
_IMPEDANCE: Final = 0.01
_SLIP_DECAY: Final = 50.0  # [1/s]
_FRICTION_STIFFNESS: Final = 1e6
_SOLVER_ITERATIONS: Final = 100  # with 20, single steps have spikes in the acceleration
_NOWHERE: Final = -1e4  # [m], height of a robot that has no place yet
_BEDROCK: Final = 1.0  # [m] of solid ground below the lowest point


class Support(NamedTuple):
    """A wheel, or the caster, which is fixed to base_link and has no friction."""

    geom: str
    body: str
    hub: Array  # (3,) [m], in base_link
    radius: float  # [m], loaded
    width: float  # [m]
    share: float  # of the robot's weight

    def deflection(self, robot: RobotConfig) -> float:
        """Deflection [m] of the tyre at rest: its contact acts from this far above the loaded radius."""
        return robot.mass * GRAVITY * self.share / robot.wheels.tyre_stiffness


def supports(rig: Rig) -> tuple[Support, ...]:
    """Return the wheels by ``names``, then the caster: all that bears the robot."""
    caster, names = rig.robot.caster_share, rig.wheels.names
    bodies = [*((f"{name}_wheel", name, (1 - caster) / len(names)) for name in names), ("caster", "base_link", caster)]
    return tuple(
        Support(geom, body, roller.centre, roller.radius, roller.width, share)
        for (geom, body, share), roller in zip(bodies, rollers(rig), strict=False)
    )


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
    asked = np.asarray(commands, np.float64)
    speeds = np.empty((*asked.shape[:-1], len(wheels.names)))
    flat = np.ascontiguousarray(asked).reshape(-1, 2), speeds.reshape(-1, len(wheels.names))
    turn_wheels(flat[0], wheels.half_track, skid_compensation(wheels), wheels.radius, flat[1])
    return speeds


def ramp(current: Command, target: Command, times: ArrayLike, robot: RobotConfig) -> Array:
    """Commands (n, 2) at ``times`` (n,) [s] from now on, towards ``target`` within the robot's acceleration limits."""
    change = np.asarray(times)[:, None] * (robot.max_acceleration, robot.max_turn_acceleration)
    commands = np.empty(change.shape)
    ramp_commands((current.speed, current.turn_rate), (target.speed, target.turn_rate), change, commands)
    return commands


def add_robot(spec: Any, rig: Rig, step_s: float = STEP_S) -> None:
    """Add the robot to ``spec`` (mujoco.MjSpec): body base_link with a free joint, wheels, actuators and geoms.

    Joints, actuators and geoms of the wheels are in the order of their names; joints and actuators have these names,
    the geoms those of ``supports``. The geoms of supports touch the ground only through explicit contact pairs.
    """
    robot = rig.robot
    base = spec.worldbody.add_body(name="base_link")
    base.add_freejoint()
    base.mass, base.inertia = robot.chassis_mass, robot.chassis_moments
    base.ipos = robot.chassis_centre
    base.explicitinertial = True
    _add_outline(base, rig)
    for support in supports(rig):
        body = base if support.body == "base_link" else _add_wheel(spec, base, support, robot, step_s)
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


def _add_wheel(spec: Any, base: Any, support: Support, robot: RobotConfig, step_s: float) -> Any:
    """Add a wheel with its servo; return its body."""
    name, scale = support.body, servo_scale(robot)
    body = base.add_body(name=name, pos=support.hub)
    body.mass, body.inertia, body.explicitinertial = robot.wheels.mass, robot.wheels.inertia, True
    body.ipos = [0.0, 0.0, 0.0]  # on the axle; without it MuJoCo takes ``pos``, and the centre of mass orbits the axle
    rotor = ROTOR_INERTIA * scale * max(1.0, step_s / _STIFF_STEP_S)
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], armature=rotor)
    servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    # The commanded angle is the integral of the commanded speed, so the mean speed is exact at any load.
    servo.dyntype, servo.gaintype = mujoco.mjtDyn.mjDYN_INTEGRATOR, mujoco.mjtGain.mjGAIN_FIXED
    servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    gain, damping = SERVO_INTEGRAL_GAIN * scale, SERVO_DAMPING * scale
    servo.gainprm[0], servo.biasprm[1:3] = gain, (-gain, -damping)
    servo.forcelimited, servo.forcerange = True, [-robot.max_torque, robot.max_torque]
    return body


class Physics(NamedTuple):
    """Compiled MuJoCo model; ``obstacles`` maps the id of each obstacle's geom to the object's name."""

    model: Any
    obstacles: dict[int, str]


Other = Rig | tuple[Collider, ...]
"""What a robot meets that is moved: another robot, or the colliders of an actor in its own frame."""


def build_physics(world: World, rig: Rig, step_s: float = STEP_S, others: Mapping[str, Other] | None = None) -> Physics:
    """Build the robot of ``rig`` on the terrain of ``world``; every object with colliders is a fixed obstacle.

    ``step_s`` [s] is that of the physics. ``others`` are robots and actors by name, obstacles that are moved: their
    bodies are the last of MuJoCo's mocap bodies, in this order, and lie deep below the ground until they are placed.
    """
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep, option.gravity = step_s, [0.0, 0.0, -GRAVITY]
    # An implicit integrator changes the wheels' acceleration after the contacts were solved: a braking robot slid back
    # by 12 mm. Joints have no damping, so Euler is explicit here and keeps the solution of the contacts.
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, _FRICTION_STIFFNESS
    option.iterations, option.ls_iterations = _SOLVER_ITERATIONS, 50
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    add_terrain(spec, bearing_field(world))
    bearing = supports(rig)
    for support in bearing:
        # The plane that a wheel rolls on: a body that is moved before every step.
        body = spec.worldbody.add_body(name=plane_geom(support.geom), mocap=True)
        body.add_geom(name=body.name, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 1.0], contype=0, conaffinity=0)
    names = _add_obstacles(spec, world)
    for name, other in (others or {}).items():
        names |= dict.fromkeys(_add_other(spec, name, other), name)
    add_robot(spec, rig, step_s)
    for support in bearing:
        spec.add_pair(
            geomname1=plane_geom(support.geom),
            geomname2=support.geom,
            condim=1 if support.body == "base_link" else 3,
            friction=[FRICTION, FRICTION, 0.0, 0.0, 0.0],
            solimp=[_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 2.0],
            margin=support.deflection(rig.robot),
        )
    model = spec.compile()
    _set_stiffness(model, bearing, rig.robot)
    return Physics(model, {model.geom(geom).id: name for geom, name in names.items()})


def _set_stiffness(model: Any, bearing: Sequence[Support], robot: RobotConfig) -> None:
    """Give the contacts of the supports the tyre's stiffness and damping.

    MuJoCo's contact force is (k depth + b speed - acceleration) d / ((1 - d) A), with d the impedance and A the
    contact's inverse mass, a constant of the model. With small d it is a spring with a damper, in parallel a mass.
    """
    inverse_mass = model.body_invweight0[[model.body(support.body).id for support in bearing], 0]
    scale = (1 - _IMPEDANCE) * inverse_mass[:, None]
    stiffness, shares = robot.wheels.tyre_stiffness, np.array([support.share for support in bearing])
    damping = 2 * DAMPING_RATIO * np.sqrt(stiffness * robot.mass * shares)  # [N s/m]
    model.pair_solref[:] = -scale * np.column_stack([np.full(len(bearing), stiffness), damping])
    model.pair_solreffriction[:] = (-1.0, -_SLIP_DECAY * _IMPEDANCE)


def add_terrain(spec: Any, field: Heightfield) -> None:
    """Add ``field`` to ``spec`` (mujoco.MjSpec) as a geom named "ground" with the same triangles.

    MuJoCo's rows run along y and its columns along x; its cells are split from (x, y) to (x + 1, y + 1), as ours are.
    Its heights are 0 to 1 times a scale, above the geom's origin.
    """
    nx, ny = field.heights.shape
    low = float(field.heights.min())
    scale = max(float(field.heights.max()) - low, 1e-3)
    half = np.array([nx - 1, ny - 1]) * field.spacing / 2
    terrain = spec.add_hfield(name="terrain", nrow=ny, ncol=nx, size=[*half, scale, _BEDROCK])
    terrain.userdata = ((field.heights.astype(np.float64) - low) / scale).T.astype(np.float32).ravel()
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="terrain",
        pos=[field.x0 + half[0], field.y0 + half[1], low],
        contype=0,
        conaffinity=CHASSIS_BIT,
        friction=[FRICTION, 0.0, 0.0],
    )


def _add_obstacles(spec: Any, world: World) -> dict[str, str]:
    """Add the colliders of all instances; return the object's name for each geom's name."""
    names: dict[str, str] = {}
    for instance in world.instances:
        for collider in world.meshes[instance.mesh].colliders:
            geom = f"obstacle_{len(names)}"
            names[geom] = instance.name
            _add_collider(spec, geom, collider, instance.world_from_object)
    return names


def _add_other(spec: Any, name: str, other: Other) -> list[str]:
    """Add another robot, or an actor; return the names of its geoms."""
    body, geoms = spec.worldbody.add_body(name=other_body(name), mocap=True, pos=[0.0, 0.0, _NOWHERE]), list[str]()
    if not isinstance(other, Rig):
        for number, collider in enumerate(other):
            geoms.append(f"{body.name}_{number}")
            _add_collider(spec, geoms[-1], collider, np.eye(4), body)
        return geoms
    for part, box in body_boxes(other).items():
        if part != "chassis":  # inside the outline
            geoms.append(f"{body.name}_{part}")
            body.add_geom(
                name=geoms[-1],
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=box.size / 2,
                pos=box.centre,
                contype=0,
                conaffinity=OUTLINE_BIT,
            )
    return geoms


def other_body(name: str) -> str:
    """Name of the body of a robot or an actor that is moved."""
    return f"other_{name}"


def _add_collider(spec: Any, name: str, collider: Collider, world_from_object: Array, body: Any = None) -> None:
    height = collider.size[-1]
    scale = float(np.cbrt(np.linalg.det(world_from_object[:3, :3])))
    x, y, z = collider.position
    world_from_collider = world_from_object @ pose((x, y, z + height / 2), (0.0, 0.0, collider.yaw_deg))
    form: dict[str, Any]
    if collider.points:  # MuJoCo takes the convex hull of a mesh; its mass does not matter
        spec.add_mesh(
            name=name, uservert=np.ravel(collider.points) * scale, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        )
        form, world_from_collider = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": name}, world_from_object
    elif collider.shape == "cylinder":
        form = {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "size": np.array([collider.size[0], height / 2, 0.0]) * scale}
    else:
        form = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": np.array([s / 2 for s in collider.size]) * scale}
    (spec.worldbody if body is None else body).add_geom(
        name=name,
        pos=world_from_collider[:3, 3],
        quat=quaternion_wxyz_from_rotation(world_from_collider[:3, :3] / scale),
        contype=0,
        conaffinity=OUTLINE_BIT,
        **form,
    )


def resting_pose(field: Heightfield, xy: Array, yaw: float, rig: Rig) -> tuple[Array, Array]:
    """Position [m] and quaternion_wxyz of base_link just above the plane through the terrain below the wheels."""
    corners = np.array(rig.robot.corners)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    ground_xy = corners @ turn.T + xy
    heights = field.height_at(ground_xy[:, 0], ground_xy[:, 1])
    along, across, middle = np.linalg.lstsq(np.column_stack([corners, np.ones(4)]), heights, rcond=None)[0]
    normal = np.array([-along, -across, 1.0]) / np.hypot(1.0, np.hypot(along, across))
    forward = np.array([1.0, 0.0, along])
    forward /= np.linalg.norm(forward)
    attitude = np.column_stack([forward, np.cross(normal, forward), normal])
    rotation = Rotation.from_euler("z", yaw).as_matrix() @ attitude
    residual = float(np.max(heights - np.column_stack([corners, np.ones(4)]) @ (along, across, middle)))
    clearance = rig.robot.ground_clearance + residual
    position = np.array([*xy, middle]) + rotation[:, 2] * clearance
    return position, quaternion_wxyz_from_rotation(rotation)

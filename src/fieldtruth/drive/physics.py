# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""MuJoCo model of a world and the robot: ground, obstacles, and the contact of tyre and soil.

Each wheel, and a caster, touches one plane, which ``drive.wheel_contacts`` lays before every step as ``drive.tyre``
finds it. The chassis collides with the heightfield, the whole outline with the obstacles.

Friction 0.68 is the peak value of a tyre on a dry earth road (Wong, Theory of Ground Vehicles, table of average
coefficients of road adhesion): that of the chassis, and of wheels until ``drive.soil_contact`` sets theirs in every
step, isotropic. MuJoCo's contact is soft and convex, and sliding pushes it apart: by mu * b_t * slip / (stiffness x R)
with b_t the decay of slip and R its regularization, here 0.1 mm for each m/s of slip. A stiff contact would lift off;
with a tyre's stiffness it does not. ``impratio`` keeps friction stiff: on a slope of 13 deg a standing robot creeps by
0.001 mm/s. Elliptic cones and Newton; pyramidal ones chatter.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose, quaternion_wxyz_from_rotation
from fieldtruth.drive.bearing import bearing_field
from fieldtruth.drive.robot import CHASSIS_BIT, OUTLINE_BIT, Support, add_robot, plane_geom, supports
from fieldtruth.drive.tyre import DAMPING_RATIO
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import GRAVITY as GRAVITY
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.world.model import Collider, Heightfield, World

STEP_NS: Final = 1_000_000  # [ns]
STEP_S: Final = STEP_NS / 1e9
FRICTION: Final = 0.68

_IMPEDANCE: Final = 0.01
_SLIP_DECAY: Final = 50.0  # [1/s]
_FRICTION_STIFFNESS: Final = 1e6
_SOLVER_ITERATIONS: Final = 100  # with 20, single steps have spikes in the acceleration
_BEDROCK: Final = 1.0  # [m] of solid ground below the lowest point


class Physics(NamedTuple):
    """Compiled MuJoCo model; ``obstacles`` maps the id of each obstacle's geom to the object's name."""

    model: Any
    obstacles: dict[int, str]


def build_physics(world: World, rig: Rig) -> Physics:
    """Build the robot of ``rig`` on the terrain of ``world``; every object with colliders is a fixed obstacle."""
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep, option.gravity = STEP_S, [0.0, 0.0, -GRAVITY]
    # An implicit integrator changes the wheels' acceleration after the contacts were solved: a braking robot slid back
    # by 12 mm. Joints have no damping, so Euler is explicit here and keeps the solution of the contacts.
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, _FRICTION_STIFFNESS
    option.iterations, option.ls_iterations = _SOLVER_ITERATIONS, 50
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    add_terrain(spec, bearing_field(world))
    bearing = supports(rig)
    for support in bearing:
        _add_plane(spec, plane_geom(support.geom))
    names = _add_obstacles(spec, world)
    add_robot(spec, rig)
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


def _add_plane(spec: Any, name: str) -> None:
    """Add the plane that a wheel rolls on: a body that is moved before every step."""
    body = spec.worldbody.add_body(name=name, mocap=True)
    body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 1.0], contype=0, conaffinity=0)


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


def _add_collider(spec: Any, name: str, collider: Collider, world_from_object: Array) -> None:
    height = collider.size[-1]
    scale = float(np.cbrt(np.linalg.det(world_from_object[:3, :3])))
    x, y, z = collider.position
    world_from_collider = world_from_object @ pose((x, y, z + height / 2), (0.0, 0.0, collider.yaw_deg))
    if collider.shape == "cylinder":
        shape, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [collider.size[0], height / 2, 0.0]
    else:
        shape, size = mujoco.mjtGeom.mjGEOM_BOX, [s / 2 for s in collider.size]
    spec.worldbody.add_geom(
        name=name,
        type=shape,
        size=np.array(size) * scale,
        pos=world_from_collider[:3, 3],
        quat=quaternion_wxyz_from_rotation(world_from_collider[:3, :3] / scale),
        contype=0,
        conaffinity=OUTLINE_BIT,
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

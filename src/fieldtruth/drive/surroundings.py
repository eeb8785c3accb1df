# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot in the part of a world around it: contacts of tyres and hull with the ground; large worlds part by part.

Ground. The cubic B-spline through the nodes of a heightfield: height, slope and curvature have no jumps, while the
triangles between the same nodes, which the sensors see, have an edge every cell. A control value lies beyond the
heights of the nodes around it by no more than a bump as curved as the wheel needs, so the spline does not swing beside
a step: there it rounds the edge by up to a cell instead of passing through the nodes.

Tyre. A pneumatic tyre envelops what is smaller than its contact patch. Here each tyre is a bed of springs: at points of
the unloaded tread, every 2 deg along and five across, the depth below the ground at right angles to it is a pressure
along the ground's normal. Their sum is the force of the bed. The equivalent ground plane (Davis 1975, A radial-spring
terrain-enveloping tire model, Vehicle System Dynamics 4, 55-69) has the direction of that force and lies as deep in the
tyre as a plane that makes the same force; on a plane it is that plane, whatever the number of points. The patch moves
over an edge bit by bit, so the plane has no jumps, and a wheel that loses the ground has no contact.

Stiffness. A thin tyre of radius R and section radius s that is pressed in by d has a contact area of about
2 pi sqrt(R s) d (two crossing circles), so at a pressure p its stiffness is 2 pi p sqrt(R s) (Hadekel 1952, The
mechanical characteristics of pneumatic tyres, quoted from memory). A Husky's tyre is 13 x 5.00-6: R = 0.165 m,
s = 0.064 m; at 90 kPa (13 psi, as mowers on tyres of this size have it) 58 kN/m. The carcass with its lugs is assumed
to add a fifth. Under 123 N it yields by 1.8 mm, in a patch of 5 cm. The radius of the rig's wheels is the loaded one.
Damping: a tenth of the critical one; free vibrations of tractor tyres decay with 0.05 to 0.15 (quoted from memory). So
the robot, which has no other springs, heaves at 12 Hz.

Contacts. Before every step the plane of each wheel is laid, and the soil makes friction, drag and torque of load and
slip. The planes are bodies without a velocity for MuJoCo, so its contact damping sees the motion of the wheel alone; a
plane that is shifted or turned within itself moves nothing. MuJoCo looks for contacts between chassis and ground only
where the ground is near: on ground of 5 cm that search takes a quarter of a step's time, and nearly always finds
nothing. Steps that compiled code makes (``kernels.stepping``) look for contacts with obstacles only near these, too.

Parts. A part begins with the state of the one before. Its ground and obstacles are the same where both have them, but
MuJoCo's positions are relative to a part's corner and its obstacles have other numbers, so that a drive over several
parts differs from one in the whole world by rounding. Worlds up to ``WHOLE`` have one part.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter, spline_filter

from fieldtruth.core.arrays import Array
from fieldtruth.drive.ground import WorldParts, bearing_field
from fieldtruth.drive.physics import (
    CHASSIS_BIT,
    OUTLINE_BIT,
    Other,
    body_boxes,
    build_physics,
    other_body,
    plane_geom,
    supports,
)
from fieldtruth.drive.soil import SoilContact
from fieldtruth.drive.stepping import engine_of
from fieldtruth.drive.track import STEP_S
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.kernels.soil import OTHER, Wheels, pull, sort_loads
from fieldtruth.kernels.stepping import Bed, Obstacles, Record, Underside, make_steps
from fieldtruth.kernels.tyre import Patches, SmoothGround, clearance, press
from fieldtruth.world.model import Heightfield, World

_MARGIN: Final = 3  # nodes added around the heightfield, with the heights of its edge
WheelSoil = Callable[[Wheels], None]
"""Called before every step; it reads the wheels, and sets friction, drag, torque and sinkage in place."""
EVERY: Final = 20
"""Steps of the physics, of 1 ms, from one look at the ground to the next."""
NEAR: Final = 0.05
"""Distance [m] below the chassis; it comes nearer by less in ``EVERY`` steps: 4 cm at 5 m/s where a slope of 20 deg
begins."""
_FASTEST: Final = 25.0
"""Speed [m/s] at which a robot could come to an obstacle from one look to the next: that of a fall of 32 m."""
_PITCH: Final = 0.1
"""Greatest distance [m] between the points of the chassis at which the ground below is looked up."""
REACH: Final = 20.0
"""[m] of a part around the robot along x and y when it is made."""
EDGE: Final = 4.0
"""[m] to its edge at which the next part is made: the robot is within 1.2 m, a node has no effect beyond 2 m."""
_CREEP: Final = 0.05  # [m/s] below which a robot does not drive into another one
_ASIDE: Final = 0.3
"""Width [m] beside the robot that belongs to its way, too."""
_ABOVE: Final = 3.0
"""Height [m] above or below the robot from which on others are not in its way."""
_STATE: Final = mujoco.mjtState.mjSTATE_INTEGRATION


class Tread(NamedTuple):
    """Loaded radius, half width and deflection under the load at rest, each [m]."""

    radius: float
    half_width: float
    deflection: float


def smooth_ground(field: Heightfield, tread: Tread) -> SmoothGround:
    """Return the spline through the nodes of ``field``; the radius of ``tread`` bounds its overshoot."""
    heights = np.pad(field.heights.astype(np.float64), _MARGIN, mode="edge")
    beyond = field.spacing**2 / (6 * tread.radius)
    lowest, highest = minimum_filter(heights, 3) - beyond, maximum_filter(heights, 3) + beyond
    control = np.clip(spline_filter(heights, order=3, mode="mirror"), lowest, highest)
    # Cell (i, j) is shaped by the control values i - 1 to i + 2. Rounded up to single precision.
    ceiling = np.nextafter(maximum_filter(control, 4, origin=-1, mode="nearest").astype(np.float32), np.float32(np.inf))
    around = maximum_filter(ceiling, 2 * math.ceil(tread.half_width / field.spacing) + 1, mode="nearest")
    shift = _MARGIN * field.spacing
    return SmoothGround(control, ceiling, around, field.x0 - shift, field.y0 - shift, 1 / field.spacing)


class WheelContacts:
    """Lays the plane below each wheel and caster before a step (``update``), and reads the loads after it (``read``).

    ``model`` and ``data`` are MuJoCo's, ``field`` is what bears the wheels. A caster meets the ground as it is: no soil
    acts on it.
    """

    def __init__(self, model: Any, data: Any, field: Heightfield, rig: Rig, soil: WheelSoil | None = None) -> None:
        self._data = data
        self._soil = soil
        bearing, count, n = supports(rig), len(supports(rig)), len(rig.wheels.names)
        treads = np.array([Tread(s.radius, s.width / 2, s.deflection(rig.robot)) for s in bearing])
        patches = Patches(
            data.mocap_pos[:count], data.mocap_quat[:count], np.zeros((count, 3)), np.zeros((count, 2)), np.zeros(count)
        )
        # In a contact with the heightfield or a plane, that is always MuJoCo's first geom.
        kind, planes = np.full(model.ngeom, OTHER), [plane_geom(support.geom) for support in bearing]
        kind[[model.geom(name).id for name in (*planes, "ground")]] = range(count + 1)
        first = model.body(rig.wheels.names[0]).id
        self.bed = Bed(
            ground=smooth_ground(field, Tread(treads[:, 0].min(), treads[:, 1].max(), 0.0)),
            treads=treads,
            hubs=np.array([support.hub for support in bearing]),
            qpos=data.qpos,
            qvel=data.qvel,
            sinkage=np.zeros(count),
            patches=patches,
            load=np.zeros(count),
            force=data.xfrc_applied[first : first + n, :3],
            kind=kind,
        )
        self.wheels = Wheels(
            position=data.mocap_pos[:n],
            load=self.bed.load[:n],
            velocity=patches.velocity[:n],
            rolling=patches.rolling[:n],
            friction=model.pair_friction[:n, :2],
            drag=np.zeros(n),
            torque=data.qfrc_applied[-n:],
            sinkage=self.bed.sinkage[:n],
            ahead=patches.forward[:n],
        )

    def update(self) -> None:
        """Lay the planes for the next step, and let the soil act."""
        bed = self.bed
        press(bed.ground, bed.treads, bed.hubs, bed.qpos, bed.qvel, bed.sinkage, bed.patches)
        if self._soil is not None:
            self._soil(self.wheels)
            pull(bed.patches.forward, self.wheels.drag, bed.force)

    def read(self) -> bool:
        """Read the loads of the step that was made; return whether the robot touches more than the ground."""
        contacts = self._data.contact
        return sort_loads(contacts.geom1, contacts.efc_address, self._data.efc_force, self.bed.kind, self.bed.load)


class Hull:
    """The underside of the chassis above ``field``."""

    def __init__(self, field: Heightfield, rig: Rig) -> None:
        # Half a pitch, a node, and what it moves until the next look: 2 cm at 1 m/s.
        faster = max(rig.robot.max_speed - 1.0, 0.0) * EVERY * STEP_S
        reach = int(np.ceil((_PITCH + faster) / field.spacing)) + 1
        self._highest = maximum_filter(field.heights, 2 * reach + 1, mode="nearest")
        self._field = field
        box = body_boxes(rig)["chassis"]
        low, high = box.centre - box.size / 2, box.centre + box.size / 2
        x, y = (np.linspace(low[k], high[k], int(np.ceil(box.size[k] / _PITCH)) + 1) for k in range(2))
        self._points = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), low[2])], axis=-1).reshape(-1, 3)

    def underside(self, model: Any, ground: int) -> Underside:
        """Return it for compiled code; ``ground`` is the number of the geom in MuJoCo's model."""
        field, affinity = self._field, model.geom_conaffinity
        grid = self._highest, field.x0, field.y0, field.spacing
        return Underside(*grid, self._points, NEAR, affinity, ground, CHASSIS_BIT)

    def is_near_ground(self, qpos: Array) -> bool:
        """Return whether some ground is less than ``NEAR`` below the chassis.

        ``qpos`` begins with base_link's position [m] and quaternion_wxyz.
        """
        return bool(
            clearance(self._highest, self._field.x0, self._field.y0, self._field.spacing, self._points, qpos) < NEAR
        )


class Surroundings:
    """Model and state in MuJoCo, the wheels' contacts and hull of a robot in ``part`` of a world with ``others``."""

    def __init__(
        self,
        part: World,
        rig: Rig,
        soil: WheelSoil | None,
        step_s: float = STEP_S,
        others: Mapping[str, Other] | None = None,
    ) -> None:
        self.bearing: Heightfield = bearing_field(part)
        self.model, self._obstacles = build_physics(part, rig, step_s, others)
        self.data = mujoco.MjData(self.model)
        self._others = {name: int(self.model.body(other_body(name)).mocapid[0]) for name in others or {}}
        self._radii = {name: _radius(other) for name, other in (others or {}).items()}
        self.twists: Mapping[str, Array] = {}
        self._soil = soil
        if isinstance(soil, SoilContact):
            soil.enter(part)
        self.contacts = WheelContacts(self.model, self.data, self.bearing, rig, soil)
        self.hull = Hull(self.bearing, rig)
        self._ground = self.model.geom("ground").id
        # A law of a subclass is not that which is compiled.
        self._is_compiled = type(soil) is SoilContact and engine_of(self.model, self.data) is not None
        self._underside = self.hull.underside(self.model, self._ground)
        self._reach = _nearby(self.model, rig, step_s, moving=bool(others))

    @property
    def is_compiled(self) -> bool:
        """Return whether ``make_steps`` can be called."""
        return self._is_compiled

    def make_steps(self, record: Record, first: int, every: int, done: int) -> tuple[int, bool]:
        """Make the steps of a record that are not done, with a look at the ground every so many; see its kernel."""
        engine = engine_of(self.model, self.data)  # addresses of these, not of one that this is a copy of
        assert engine is not None
        assert isinstance(self._soil, SoilContact)
        soil, contacts = self._soil, self.contacts
        body = engine, contacts.bed, self._underside, self._reach
        return make_steps(body, (soil.mixture, contacts.wheels, soil.state), record, (first, every, soil.step_s), done)

    @property
    def is_near_ground(self) -> bool:
        """Return whether MuJoCo looks for contacts between chassis and ground."""
        return bool(self.model.geom_conaffinity[self._ground])

    @is_near_ground.setter
    def is_near_ground(self, near: bool) -> None:
        self.model.geom_conaffinity[self._ground] = CHASSIS_BIT if near else 0

    def place(self, world_from_others: Mapping[str, Array], twists: Mapping[str, Array]) -> None:
        """Put other robots where their base_link is, (4, 4) by name; they stay there.

        ``twists`` are their velocity [m/s] and turn rate [rad/s] in the world, (6,) by name: MuJoCo knows none.
        """
        self.twists = twists
        for name, pose in world_from_others.items():
            number = self._others[name]
            self.data.mocap_pos[number] = pose[:3, 3]
            mujoco.mju_mat2Quat(self.data.mocap_quat[number], np.ascontiguousarray(pose[:3, :3]).ravel())

    def gap_ahead(self, robot: RobotConfig) -> tuple[float, str]:
        """Distance [m] from the robot's front to the nearest other in its way, and its name; infinite without one.

        The way is as wide as the robot, and _ASIDE to both sides. An other is a circle around its middle.
        """
        length, width, _ = robot.outline
        world_from_base, nearest = np.empty(9), (math.inf, "")
        mujoco.mju_quat2Mat(world_from_base, self.data.qpos[3:7])
        for name, number in self._others.items():
            ahead, left, up = (self.data.mocap_pos[number] - self.data.qpos[:3]) @ world_from_base.reshape(3, 3)
            radius = self._radii[name]
            if ahead > 0 and abs(left) < width / 2 + radius + _ASIDE and abs(up) < _ABOVE:
                nearest = min(nearest, (max(0.0, float(ahead) - length / 2 - radius), name))
        return nearest

    def touched(self) -> tuple[str, float]:
        """Name of the object that the robot touches, and how fast [m/s] they came nearer before the step.

        Of several objects it is the one that is hit fastest.
        """
        found = [
            (self._closing(number, name, is_first=pair[0] in self._obstacles), name)
            for number, pair in enumerate(self.data.contact.geom.tolist())
            if (name := self._obstacles.get(pair[0]) or self._obstacles.get(pair[1])) is not None
        ]
        speed, name = max(found, key=lambda each: each[0])
        return name, speed

    def _closing(self, number: int, name: str, *, is_first: bool) -> float:
        """Speed [m/s] at which the robot and an object, the contact's first geom or its second, come nearer.

        The motion of another robot counts if this one drives into it: who stands and is driven into hits nothing.
        """
        row = int(self.data.contact.efc_address[number])
        apart = float(self.data.efc_vel[row]) if row >= 0 else 0.0
        if -apart > _CREEP and name in self.twists:
            contact, twist = self.data.contact[number], self.twists[name]
            arm = contact.pos - self.data.mocap_pos[self._others[name]]
            along = float(contact.frame[:3] @ (twist[:3] + np.cross(twist[3:], arm)))
            apart += -along if is_first else along
        return max(0.0, -apart)

    def reset(self) -> None:
        """Forget all motion: robot, wheels and soil are as they were made; other robots stay where they are."""
        placed = self.data.mocap_pos.copy(), self.data.mocap_quat.copy()
        mujoco.mj_resetData(self.model, self.data)
        for number in self._others.values():
            self.data.mocap_pos[number], self.data.mocap_quat[number] = placed[0][number], placed[1][number]
        self.contacts.wheels.load[:] = self.contacts.wheels.sinkage[:] = 0.0
        if isinstance(self._soil, SoilContact):
            self._soil.state[:] = 0.0
        self._look_everywhere()

    def _look_everywhere(self) -> None:
        """Let MuJoCo look for all contacts until the next look at what is near."""
        self.is_near_ground = True
        self._reach.contype[:] = self._reach.own

    def save(self) -> Array:
        """Return MuJoCo's state."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def restore(self, state: Array, load: Array, sinkage: Array) -> None:
        """Go on with a state of ``save``, here or in another part, and the wheels' load [N] and sinkage [m]."""
        mujoco.mj_setState(self.model, self.data, state, _STATE)
        self._look_everywhere()
        self.contacts.wheels.load[:] = load
        self.contacts.wheels.sinkage[:] = sinkage


def _nearby(model: Any, rig: Rig, step_s: float, *, moving: bool) -> Obstacles:
    """Return where a robot can touch obstacles before the next look; everywhere if some are ``moving``."""
    boxes, bearing = body_boxes(rig).values(), supports(rig)
    robot = max(
        *(float(np.linalg.norm(np.abs(box.centre) + box.size / 2)) for box in boxes),
        *(float(np.linalg.norm(each.hub)) + math.hypot(each.radius, each.width / 2) for each in bearing),
    )
    reach = robot + _FASTEST * max(EVERY * STEP_S, step_s)
    rows = np.flatnonzero(model.geom_conaffinity & OUTLINE_BIT)
    radii = np.full(len(rows), np.inf) if moving else model.geom_rbound[rows] + reach
    spheres = np.column_stack([model.geom_pos[rows], radii])
    return Obstacles(spheres, model.body_contype, model.body_contype.copy())


def _radius(other: Other) -> float:
    """Radius [m] of a circle around the middle of a robot or of the colliders of an actor."""
    if isinstance(other, Rig):
        return float(np.hypot(*other.robot.outline[:2])) / 2
    half = (each.size[0] if each.shape == "cylinder" else math.hypot(*each.size[:2]) / 2 for each in other)
    return max((r + math.hypot(*each.position[:2]) for r, each in zip(half, other, strict=True)), default=0.0)


class FollowingState(NamedTuple):
    """State of robot, wheels and soil, in the part around ``middle`` (2,) [m]."""

    middle: Array
    robot: Array
    load: Array
    sinkage: Array
    is_near_ground: bool
    soil: Array


class Following:
    """The surroundings of a robot that moves through ``world``."""

    def __init__(
        self,
        world: World,
        rig: Rig,
        soil: WheelSoil | None,
        step_s: float = STEP_S,
        others: Mapping[str, Other] | None = None,
    ) -> None:
        self._parts, self._rig, self._soil, self._step_s = WorldParts(world), rig, soil, step_s
        self._others = others
        self._middle = np.zeros(2)
        self._here: Surroundings | None = None

    @property
    def here(self) -> Surroundings:
        """Surroundings of the last point that was given."""
        return self.at(self._middle)

    def at(self, xy: Array) -> Surroundings:
        """Return the surroundings of a point (2,) [m]: those of the call before until it is near their edge."""
        before = self._here
        if before is not None and (self._parts.is_one or np.abs(xy - self._middle).max() <= REACH - EDGE):
            return before
        here = self._enter(xy)
        if before is not None:
            here.restore(before.save(), before.contacts.wheels.load, before.contacts.wheels.sinkage)
            here.twists = before.twists
        return here

    def _enter(self, xy: Array) -> Surroundings:
        part = self._parts.around(xy, REACH)
        self._here, self._middle = Surroundings(part, self._rig, self._soil, self._step_s, self._others), xy.copy()
        return self._here

    def save(self) -> FollowingState:
        """Return what ``restore`` needs to go on from here."""
        here = self.here
        wheels = here.contacts.wheels
        soil = self._soil.state.copy() if isinstance(self._soil, SoilContact) else np.zeros((len(wheels.load), 3))
        return FollowingState(
            self._middle, here.save(), wheels.load.copy(), wheels.sinkage.copy(), here.is_near_ground, soil
        )

    def restore(self, saved: FollowingState) -> None:
        """Go on from where ``save`` was called, in the part of that moment."""
        is_there = self._here is not None and (self._middle == saved.middle).all()
        here = self._here if is_there and self._here is not None else self._enter(saved.middle)
        here.restore(saved.robot, saved.load, saved.sinkage)
        here.is_near_ground = saved.is_near_ground
        if isinstance(self._soil, SoilContact):
            self._soil.state[:] = saved.soil

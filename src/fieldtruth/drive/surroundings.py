# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The physics of the robot and the part of a world around it; in large worlds it moves from part to part.

A part begins with the state of the one before. Its ground and obstacles are the same where both have them, but MuJoCo's
positions are relative to a part's corner and its obstacles have other numbers, so that a drive over several parts
differs from one in the whole world by rounding. Worlds up to ``parts.WHOLE`` have one part.
"""

from typing import Final, NamedTuple

import mujoco
import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.bearing import bearing_field
from fieldtruth.drive.hull import Hull
from fieldtruth.drive.parts import WorldParts
from fieldtruth.drive.physics import build_physics
from fieldtruth.drive.robot import CHASSIS_BIT
from fieldtruth.drive.soil_contact import SoilContact
from fieldtruth.drive.wheel_contacts import Soil, WheelContacts
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Heightfield, World

REACH: Final = 20.0
"""[m] of a part around the robot along x and y when it is made."""
EDGE: Final = 4.0
"""[m] to its edge at which the next part is made: the robot is within 1.2 m, a node has no effect beyond 2 m."""


_STATE: Final = mujoco.mjtState.mjSTATE_INTEGRATION


class Surroundings:
    """Model and state in MuJoCo, the wheels' contacts and the hull of a robot in ``part`` of a world."""

    def __init__(self, part: World, rig: Rig, soil: Soil | None) -> None:
        self.bearing: Heightfield = bearing_field(part)
        self.model, self._obstacles = build_physics(part, rig)
        self.data = mujoco.MjData(self.model)
        if isinstance(soil, SoilContact):
            soil.enter(part)
        self.contacts = WheelContacts(self.model, self.data, self.bearing, rig, soil)
        self.hull = Hull(self.bearing, rig)
        self._ground = self.model.geom("ground").id

    @property
    def is_near_ground(self) -> bool:
        """Whether MuJoCo looks for contacts between chassis and ground."""
        return bool(self.model.geom_conaffinity[self._ground])

    @is_near_ground.setter
    def is_near_ground(self, near: bool) -> None:
        self.model.geom_conaffinity[self._ground] = CHASSIS_BIT if near else 0

    def touched(self) -> str:
        """Name of the object that the robot touches."""
        geoms = self.data.contact.geom.ravel().tolist()
        return next(self._obstacles[geom] for geom in geoms if geom in self._obstacles)

    def save(self) -> Array:
        """Return MuJoCo's state."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def restore(self, state: Array, load: Array, sinkage: Array) -> None:
        """Go on with a state of ``save``, here or in another part, and the wheels' load [N] and sinkage [m]."""
        mujoco.mj_setState(self.model, self.data, state, _STATE)
        self.contacts.wheels.load[:] = load
        self.contacts.wheels.sinkage[:] = sinkage


class FollowingState(NamedTuple):
    """Robot, wheels and soil at a moment, in the part around ``middle`` (2,) [m]."""

    middle: Array
    robot: Array
    load: Array
    sinkage: Array
    is_near_ground: bool
    soil: Array


class Following:
    """The surroundings of a robot that moves through ``world``."""

    def __init__(self, world: World, rig: Rig, soil: Soil | None) -> None:
        self._parts, self._rig, self._soil = WorldParts(world), rig, soil
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
        return here

    def _enter(self, xy: Array) -> Surroundings:
        self._here, self._middle = Surroundings(self._parts.around(xy, REACH), self._rig, self._soil), xy.copy()
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

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The physics of the robot and the part of a world around it; in large worlds it moves from part to part.

A part begins with the state of the one before. Its ground and obstacles are the same where both have them, but MuJoCo's
positions are relative to a part's corner and its obstacles have other numbers, so that a drive over several parts
differs from one in the whole world by rounding. Worlds up to ``parts.WHOLE`` have one part.
"""

from typing import Final

import mujoco
import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.bearing import bearing_field
from fieldtruth.drive.hull import Hull
from fieldtruth.drive.parts import WorldParts
from fieldtruth.drive.physics import build_physics
from fieldtruth.drive.soil_contact import SoilContact
from fieldtruth.drive.wheel_contacts import Soil, WheelContacts
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Heightfield, World

REACH: Final = 20.0
"""[m] of a part around the robot along x and y when it is made."""
EDGE: Final = 4.0
"""[m] to its edge at which the next part is made: the robot is within 1.2 m, a node has no effect beyond 2 m."""


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
        self.ground = self.model.geom("ground").id

    def touched(self) -> str:
        """Name of the object that the robot touches."""
        geoms = self.data.contact.geom.ravel().tolist()
        return next(self._obstacles[geom] for geom in geoms if geom in self._obstacles)

    def take_over(self, before: "Surroundings") -> None:
        """Go on with the state of the part before."""
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(before.model, kind))
        mujoco.mj_getState(before.model, before.data, state, kind)
        mujoco.mj_setState(self.model, self.data, state, kind)
        self.contacts.wheels.load[:] = before.contacts.wheels.load
        self.contacts.wheels.sinkage[:] = before.contacts.wheels.sinkage


class Following:
    """The surroundings of a robot that moves through ``world``."""

    def __init__(self, world: World, rig: Rig, soil: Soil | None) -> None:
        self._parts, self._rig, self._soil = WorldParts(world), rig, soil
        self._middle = np.zeros(2)
        self._here: Surroundings | None = None

    def at(self, xy: Array) -> Surroundings:
        """Return the surroundings of a point (2,) [m]: those of the call before until it is near their edge."""
        before = self._here
        if before is not None and (self._parts.is_one or np.abs(xy - self._middle).max() <= REACH - EDGE):
            return before
        here = Surroundings(self._parts.around(xy, REACH), self._rig, self._soil)
        if before is not None:
            here.take_over(before)
        self._here, self._middle = here, xy.copy()
        return here

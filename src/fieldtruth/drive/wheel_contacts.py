# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The wheels' contacts before every step of the physics: planes from the tyres, and what a soil makes of load and slip.

The planes are bodies without a velocity for MuJoCo, so its contact damping sees the motion of the wheel alone; a plane
that is shifted or turned within itself moves nothing.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from fieldtruth.drive.robot import plane_geom, supports
from fieldtruth.drive.tyre import Tread, smooth_ground
from fieldtruth.experiment.rig import Rig
from fieldtruth.kernels.soil import OTHER, Wheels, pull, sort_loads
from fieldtruth.kernels.tyre import Patches, press
from fieldtruth.world.model import Heightfield

Soil = Callable[[Wheels], None]
"""Called before every step; it reads the wheels, and sets friction, drag, torque and sinkage in place."""


class WheelContacts:
    """Lays the plane below each wheel and caster before a step (``update``), and reads the loads after it (``read``).

    ``model`` and ``data`` are MuJoCo's, ``field`` is what bears the wheels. A caster meets the ground as it is: no soil
    acts on it.
    """

    def __init__(self, model: Any, data: Any, field: Heightfield, rig: Rig, soil: Soil | None = None) -> None:
        self._data = data
        self._soil = soil
        bearing, count, n = supports(rig), len(supports(rig)), len(rig.wheels.names)
        self._treads = np.array([Tread(s.radius, s.width / 2, s.deflection(rig.robot)) for s in bearing])
        self._ground = smooth_ground(field, Tread(self._treads[:, 0].min(), self._treads[:, 1].max(), 0.0))
        self._hubs = np.array([support.hub for support in bearing])
        self._patches = Patches(
            data.mocap_pos, data.mocap_quat, np.zeros((count, 3)), np.zeros((count, 2)), np.zeros(count)
        )
        self._load, self._sinkage = np.zeros(count), np.zeros(count)
        self.wheels = Wheels(
            position=data.mocap_pos[:n],
            load=self._load[:n],
            velocity=self._patches.velocity[:n],
            rolling=self._patches.rolling[:n],
            friction=model.pair_friction[:n, :2],
            drag=np.zeros(n),
            torque=data.qfrc_applied[-n:],
            sinkage=self._sinkage[:n],
        )
        # In a contact with the heightfield or a plane, that is always MuJoCo's first geom.
        self._kind = np.full(model.ngeom, OTHER)
        planes = [plane_geom(support.geom) for support in bearing]
        self._kind[[model.geom(name).id for name in (*planes, "ground")]] = range(count + 1)
        self._state = data.qpos, data.qvel
        first = model.body(rig.wheels.names[0]).id
        self._force = data.xfrc_applied[first : first + n, :3]

    def update(self) -> None:
        """Lay the planes for the next step, and let the soil act."""
        press(self._ground, self._treads, self._hubs, *self._state, self._sinkage, self._patches)
        if self._soil is not None:
            self._soil(self.wheels)
            pull(self._patches.forward, self.wheels.drag, self._force)

    def read(self) -> bool:
        """Read the loads of the step that was made; return whether the robot touches more than the ground."""
        contacts = self._data.contact
        return sort_loads(contacts.geom1, contacts.efc_address, self._data.efc_force, self._kind, self._load)

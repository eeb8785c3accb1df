# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The wheels' contacts before every step of the physics: planes from the tyres, and what a soil makes of load and slip.

The planes are bodies without a velocity for MuJoCo, so its contact damping sees the motion of the wheel alone; a plane
that is shifted or turned within itself moves nothing.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.drive.robot import plane_geom, supports
from fieldtruth.drive.tyre import Patches, Tread, press, smooth_ground
from fieldtruth.experiment.rig import Rig
from fieldtruth.kernels.compile import kernel
from fieldtruth.world.model import Heightfield


class Wheels(NamedTuple):
    """The n wheels before a step, in the order of their names; the last four are for a soil to set.

    The arrays are views of the simulation, so they can be read and written in compiled code.
    """

    position: Array
    """Point of contact (n, 3) [m] in the world."""
    load: Array
    """Normal force (n,) [N] of the step before; 0 in the air."""
    velocity: Array
    """Of the chassis at the contact (n, 2) [m/s], forwards and to the left along the ground."""
    rolling: Array
    """Wheel speed times radius (n,) [m/s], positive forwards; it exceeds the velocity by the slip."""
    friction: Array
    """Coefficient of friction (n, 2), the same in both columns."""
    drag: Array
    """Force (n,) [N] on the axle along the ground, positive forwards: negative for ground that resists."""
    torque: Array
    """Torque (n,) [N m] on the wheel, positive forwards: negative resistance for a wheel that rolls forwards."""
    sinkage: Array
    """Depth (n,) [m] by which the ground below a wheel is lowered; the tyre's damper misses 2 N at 1 cm/s."""


_OTHER: Final = -1

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
        self._kind = np.full(model.ngeom, _OTHER)
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
            _pull(self._patches.forward, self.wheels.drag, self._force)

    def read(self) -> bool:
        """Read the loads of the step that was made; return whether the robot touches more than the ground."""
        contacts = self._data.contact
        return _sort_loads(contacts.geom1, contacts.efc_address, self._data.efc_force, self._kind, self._load)


@kernel
def _pull(forward: Array, drag: Array, force: Array) -> None:
    for k in range(len(drag)):
        for axis in range(3):
            force[k, axis] = forward[k, axis] * drag[k]


@kernel
def _sort_loads(
    geoms: NDArray[np.int32], rows: NDArray[np.int32], forces: Array, kind: NDArray[np.int64], load: Array
) -> bool:
    load[:] = 0.0
    other = False
    for k in range(len(geoms)):
        wheel = kind[geoms[k]]
        if 0 <= wheel < len(load) and rows[k] >= 0:
            load[wheel] = forces[rows[k]]  # the first row of an elliptic cone is the normal
        other |= wheel == _OTHER
    return other

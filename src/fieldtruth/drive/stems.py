# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stems in the way of a driving robot: what it takes to push them over.

A stem is a rod of constant rigidity E I, clamped upright in the ground, that the lower edge of the robot's front pushes
over at the height h of the hull's underside, without friction. It is the elastica whose load stays at right angles to
its end (Frisch-Fay 1962, Flexible Bars; quoted from memory): with the inclination T of the stem at the edge,
G(T) the integral of sqrt(sin) from 0 to T and q = 2 sqrt(sin T) cos T + G sin T,

- the edge is ahead of the foot by h (2 sqrt(sin T) sin T - G cos T) / q: for small T by 2/3 h T, that of a cantilever;
- the load is q^2 / 2 E I / h^2 at right angles to the stem, so that its horizontal part is 3 E I x / h^3 at first;
- the moment at the foot is q sqrt(sin T) E I / h, the energy of bending G q / 2 E I / h.

At T = 90 deg the stem lies flat below the hull, x = 1.669 h. To press it down took the energy 0.718 E I / h, whatever
the speed. So n stems per square metre resist a front of width w with n w 0.718 E I / h in the mean: to push is a matter
of density, as that of the force to override stems in vehicle mobility models is of their diameter. A stem lets go
earlier if it is so short that the edge slides off its end. Its energy is lost: it does not push the robot from behind.
A stem that was pressed down resists again by the share that has recovered since.

A stem whose moment at the foot reaches that at which it breaks has a kink there from then on, a hinge with a share c of
this moment M (``kernels.stems.RESIDUAL``): straight, it resists with c M h / (x^2 + h^2). Once it lies, it is gone.

The sides of a hull that turns press stems down without a force. Wheels push as the hull does.
"""

import weakref
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import Any, Final

import mujoco
import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.physics import body_boxes
from fieldtruth.experiment.config import Through
from fieldtruth.experiment.rig import Rig
from fieldtruth.kernels.stems import NEVER, Edges, push_stems
from fieldtruth.world.model import LOOSE, Collider, Instance, World
from fieldtruth.world.stems import stems_of, yields_of

_NODES: Final = 513
_FINE: Final = 20_001
PRESSING: Final = 0.717769
"""Energy of pressing a stem down, over its rigidity and the height of the edge: G(90 deg)^2 / 2."""
_open: Final[dict[int, World]] = {}


@cache
def elastica() -> tuple[Array, float]:
    """Return the table (n, 5) of a stem and the travel in heights of its last row, where the stem lies flat.

    Rows are at equal steps of the travel. Columns are the load against the push and up, over rigidity / height^2; the
    length of the stem below the edge, over the height; the moment at its foot and its energy, over rigidity / height.
    """
    root = np.linspace(0.0, np.sqrt(np.pi / 2), _FINE)  # T = root^2: no integrand has a pole
    sine, cosine = np.sin(root**2), np.cos(root**2)
    ratio = np.sqrt(np.divide(root**2, sine, out=np.ones(_FINE), where=sine > 0))
    area, arc = (_integral(each, root) for each in (2 * root * np.sqrt(sine), 2 * ratio))
    q = 2 * np.sqrt(sine) * cosine + area * sine
    travel = np.divide(2 * np.sqrt(sine) * sine - area * cosine, q, out=np.zeros(_FINE), where=q > 0)
    length = np.divide(arc, q, out=np.ones(_FINE), where=q > 0)
    columns = q**2 / 2 * cosine, q**2 / 2 * sine, length, q * np.sqrt(sine), area * q / 2
    at = np.linspace(0.0, travel[-1], _NODES)
    return np.stack([np.interp(at, travel, column) for column in columns], axis=-1), float(travel[-1])


def _integral(values: Array, at: Array) -> Array:
    """Integral (n,) from the first point to each, by trapezia."""
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2 * np.diff(at))])


def open_world(world: World) -> World:
    """Return a world without the colliders of flexible plants; it is made once per world."""
    key = id(world)
    if key not in _open:
        bushes = {each.mesh for each in world.instances if yields_of(world.meshes[each.mesh]) == "flexible"}
        if not bushes:
            return world
        meshes = {name: replace(mesh, colliders=()) if name in bushes else mesh for name, mesh in world.meshes.items()}
        _open[key] = replace(world, meshes=meshes)
        weakref.finalize(world, _open.pop, key, None)
    return _open[key]


def world_through(world: World, through: Through, low: float) -> World:
    """Return a world whose colliders are what a route must not lead through.

    Without grass, each clump and tuft that is higher than ``low`` [m] is an obstacle, as wide as it is rooted.
    """
    if through == "flexible":
        return open_world(world)
    if through == "grass":
        return world
    meshes, instances = dict(world.meshes), list(world.instances)
    for swarm in (each for each in world.swarms if each.kind not in LOOSE):
        for row, name in enumerate(swarm.meshes):
            tufts = world.meshes[name].tufts
            if tufts is None:
                continue
            highest, key = float(tufts[:, 2].max()), f"obstacle {name}"
            solid = Collider(shape="cylinder", size=(world.meshes[name].footprint, highest))
            meshes[key] = replace(world.meshes[name], colliders=(solid,))
            for pose in swarm.world_from_object[swarm.mesh == row]:
                if highest * np.linalg.norm(pose[:3, 0]) > low:
                    grass = Instance(
                        name=swarm.name, kind=swarm.kind, mesh=key, object_id=swarm.object_id, world_from_object=pose
                    )
                    instances.append(grass)
    return replace(world, meshes=meshes, instances=tuple(instances))


class StemContact:
    """The stems of a world before the robot of a rig; call it before every step of the physics.

    ``pressed`` (n,) are the times [s] at which the stems were pressed down, ``work`` [J] is what that took: the work of
    the force on the robot, and so what bends the stems now, too.
    """

    def __init__(self, world: World, rig: Rig) -> None:
        self.stems, self._cells = stems_of(world)
        outline = body_boxes(rig)["outline"]
        front, half, _ = outline.size / 2
        x, _, z = outline.centre - (0.0, 0.0, outline.size[2] / 2)
        self._edges = Edges(float(x + front), float(x - front), float(half), float(z))
        self.pressed = np.full(len(self.stems), NEVER)
        self.work = 0.0
        self._velocity, self._force = np.zeros(6), np.zeros(6)

    def __call__(self, data: Any, time_s: float, step_s: float) -> None:
        """Let the stems act on the robot of MuJoCo's ``data`` in the step that begins at a time [s]."""
        velocity, force = data.qvel[:6], data.qfrc_applied[:6]
        self.work -= float(self._force @ (self._velocity + velocity)) / 2 * step_s
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, data.qpos[3:7])
        state = data.qpos, rotation.reshape(3, 3), time_s
        push_stems(self.stems, self._cells, elastica(), self._edges, state, self.pressed, force)
        self._velocity, self._force = velocity.copy(), force.copy()

    def share(self, others: Iterable["StemContact"]) -> None:
        """Have the stems pressed down that those of other robots of the same world have, and these those of all."""
        contacts = [self, *others]
        for contact in contacts[1:]:
            np.maximum(self.pressed, contact.pressed, out=self.pressed)
        for contact in contacts[1:]:
            contact.pressed[:] = self.pressed

    def reset(self) -> None:
        """Let all stems stand."""
        self.pressed[:] = NEVER
        self.work, self._velocity, self._force = 0.0, np.zeros(6), np.zeros(6)

    def save(self) -> tuple[Array, float, Array, Array]:
        """Return what ``restore`` needs to go on from here."""
        return self.pressed.copy(), self.work, self._velocity, self._force

    def restore(self, saved: tuple[Array, float, Array, Array]) -> None:
        """Go on from where ``save`` was called."""
        pressed, self.work, self._velocity, self._force = saved
        self.pressed[:] = pressed

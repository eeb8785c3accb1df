# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Steps of MuJoCo's physics with the contacts of tyre and soil, many in one call from Python.

Each step is the one of ``drive.simulate``: the same kernels and ``mj_step``, in the same order, so that bits are equal.
MuJoCo's contacts are read from its memory; ``drive.stepping`` finds out where they are.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.addresses import address_at, doubles_at, external, integer_at
from fieldtruth.kernels.compile import kernel
from fieldtruth.kernels.soil import OTHER, Mixture, Wheels, pull, step_soil
from fieldtruth.kernels.tyre import Patches, SmoothGround, clearance, press

_mj_step: Any = external("mj_step", 2)


class Engine(NamedTuple):
    """MuJoCo's model and data, and bytes from the data's address: number of contacts, pointers to them and to forces.

    A contact has ``size`` bytes, and in them the first geom and the first row of its forces.
    """

    model: int
    data: int
    ncon: int
    contacts: int
    forces: int
    size: int
    geom: int
    row: int


class Bed(NamedTuple):
    """What wheels stand on, see ``press``, and the kind of each geom, see ``sort_loads``."""

    ground: SmoothGround
    treads: Array
    hubs: Array
    qpos: Array
    qvel: Array
    sinkage: Array
    patches: Patches
    load: Array
    force: Array  # (wheels, 3) [N] on their bodies
    kind: NDArray[np.int64]


class Underside(NamedTuple):
    """The chassis above the ground, see ``clearance``: nearer than ``near`` [m], the geom ``ground`` has the bit."""

    highest: Float32Array
    x0: float
    y0: float
    spacing: float
    points: Array
    near: float
    affinity: NDArray[np.int32]
    ground: int
    bit: int


class Obstacles(NamedTuple):
    """Spheres (n, 4) [m]: the robot touches nothing while its origin is outside of all of them.

    ``contype`` is MuJoCo's, of each body, and ``own`` that of those of the robot, which it has inside a sphere.
    """

    spheres: Array
    contype: NDArray[np.int32]
    own: NDArray[np.int32]


class Record(NamedTuple):
    """Rows of each step: speeds of the wheels that are commanded; states and torques of the wheels after it."""

    driven: Array
    states: Array
    torques: Array
    ctrl: Array
    actuator_force: Array


@kernel
def _sort_loads(engine: Engine, kind: NDArray[np.int64], load: Array) -> bool:
    """Do as ``sort_loads`` with MuJoCo's memory."""
    contacts = address_at(engine.data + engine.contacts)
    forces = doubles_at(np.uint64(address_at(engine.data + engine.forces)))
    load[:] = 0.0
    other = False
    for k in range(integer_at(engine.data + engine.ncon)):
        contact = contacts + k * engine.size
        wheel, row = kind[integer_at(contact + engine.geom)], integer_at(contact + engine.row)
        if 0 <= wheel < len(load) and row >= 0:
            load[wheel] = forces[row]
        other |= wheel == OTHER
    return other


@kernel
def _step(engine: Engine, bed: Bed, mixture: Mixture, wheels: Wheels, state: Array, dt: float) -> bool:
    """Make a step of ``dt`` [s]; return whether the robot touches more than the ground."""
    press(bed.ground, bed.treads, bed.hubs, bed.qpos, bed.qvel, bed.sinkage, bed.patches)
    step_soil(mixture, wheels, state, dt)
    pull(bed.patches.forward, wheels.drag, bed.force)
    _mj_step(np.uint64(engine.model), np.uint64(engine.data))
    return _sort_loads(engine, bed.kind, bed.load)


@kernel
def _look(under: Underside, obstacles: Obstacles, qpos: Array) -> None:
    """Let MuJoCo look for contacts with the ground and with obstacles only where these are near."""
    is_low = clearance(under.highest, under.x0, under.y0, under.spacing, under.points, qpos) < under.near
    under.affinity[under.ground] = under.bit if is_low else 0
    meets = False
    for k in range(len(obstacles.spheres)):
        x, y, z, radius = obstacles.spheres[k]
        x, y, z = qpos[0] - x, qpos[1] - y, qpos[2] - z
        meets |= not x * x + y * y + z * z > radius * radius  # a state that is not finite is near
    for body in range(len(obstacles.own)):
        bits = obstacles.own[body]
        obstacles.contype[body] = bits if meets else bits & under.bit if is_low else 0


@kernel
def _copy(values: Array, first: int, end: int, out: Array, ahead: int) -> None:
    """Copy values from ``first`` to ``end`` to rows that are ``ahead`` of theirs."""
    for k in range(first, end):
        out[k + ahead] = values[k]


@kernel
def make_steps(
    body: tuple[Engine, Bed, Underside, Obstacles],
    soil: tuple[Mixture, Wheels, Array],
    record: Record,
    times: tuple[int, int, float],
    done: int,
) -> tuple[int, bool]:
    """Make the steps of a record that are not ``done``, up to one in which the robot touches more than the ground.

    Args:
        body: of the robot.
        soil: below it, with the state of ``step_soil``.
        record: of the steps.
        times: number of the first step of the record, steps from one look at the ground to the next, and ``dt`` [s].
        done: steps of the record.

    Returns:
        Steps that are done now, and whether the robot touched more in the last.
    """
    engine, bed, under, obstacles = body
    mixture, wheels, state = soil
    first, every, dt = times
    base, speeds = 7, len(bed.qvel)
    for n in range(done, len(record.driven)):
        _copy(record.driven[n], 0, len(record.ctrl), record.ctrl, 0)
        if (first + n) % every == 0:
            _look(under, obstacles, bed.qpos)
        touches = _step(engine, bed, mixture, wheels, state, dt)
        _copy(record.actuator_force, 0, len(record.ctrl), record.torques[n], 0)
        _copy(bed.qpos, 0, base, record.states[n], 0)
        _copy(bed.qvel, 0, speeds, record.states[n], base)
        _copy(bed.qpos, base, len(bed.qpos), record.states[n], speeds)
        if touches:
            return n + 1, True
    return len(record.driven), False


@kernel
def ramp_commands(now: tuple[float, float], target: tuple[float, float], most: Array, out: Array) -> None:
    """Write commands (n, 2) on the way from one to another, each at most by ``most`` (n, 2) from the first."""
    for n in range(len(out)):
        for k in range(2):
            out[n, k] = np.minimum(np.maximum(target[k], now[k] - most[n, k]), now[k] + most[n, k])


@kernel
def turn_wheels(commands: Array, half_track: float, skid: float, radius: float, out: Array) -> None:
    """Write speeds (n, wheels) [rad/s] of wheels, right and left in turn, for commands (n, 2)."""
    for n in range(len(out)):
        speed, side = commands[n, 0], commands[n, 1] * half_track * skid
        for k in range(out.shape[1]):
            out[n, k] = ((speed - side) if k % 2 == 0 else (speed + side)) / radius


@kernel
def motor_work(torques: Array, states: Array, first: int, dt: float) -> float:
    """Work [J] of torques (n, wheels) [N m] over steps whose states (n, m) have the wheels' speeds from ``first`` on.

    What a wheel gives back to its motor is lost.
    """
    total = 0.0
    for n in range(len(torques)):
        power = 0.0
        for k in range(torques.shape[1]):
            power += np.maximum(torques[n, k] * states[n, first + k], 0.0)
        total += power
    return total * dt

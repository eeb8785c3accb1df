# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Force with which a robot presses down an object, and how passable that makes it: 0 solid, 1 free.

The front passes over the middle of the object, at the height h of the hull's underside. The work W of pressing down a
stem is that of ``drive.stems``, 0.718 E I / h if it is long and does not break. Of the stems at a distance r from the
middle, a front of the width w meets the share s(r) = 1 up to w / 2, and 2 / pi asin(w / 2 r) beyond, the mean over all
headings. With D, twice the distance of the outermost stem, the mean force while the object resists is

    F = sum(s W) / (D + 1.669 h)

and the passability 1 - F / (GRIP m g), at least 0, with the greatest traction of the robot's mass m on level ground.
What is solid has an infinite force. Neighbours add their own: in a wide bed the force is n w 0.718 E I / h.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Index
from fieldtruth.core.classes import Label
from fieldtruth.drive.stems import elastica
from fieldtruth.experiment.robot_config import GRAVITY, RobotConfig
from fieldtruth.kernels.stems import BREAKS, COUNT, ENERGY, HEIGHT, LENGTH, MOMENT, RESIDUAL, RIGIDITY
from fieldtruth.world.model import LOOSE, Mesh, World
from fieldtruth.world.stems import rooted_in, spread, yields_of

GRIP: Final = 0.6
"""Greatest traction on level ground, over weight: that of dry lawn and of gravel in ``soils.yaml``."""
_BEARS: Final = frozenset({Label.GROUND, Label.TRAIL, Label.ROCK, Label.WATER})
"""Classes of objects without colliders that are ground to drive on, or water."""
_PLANTS: Final = (Label.TRUNK, Label.TREETOP, Label.BUSH, Label.HIGH_GRASS)
_AT_ONCE: Final = 256  # copies of a mesh


def pressing_work(stems: Array, low: float) -> Array:
    """Return the work [J] that presses down stems (..., 9), the columns of ``kernels.stems``, with an edge [m] high."""
    table, most = elastica()
    travel = np.linspace(0.0, most, len(table))
    soft, tallness = stems[..., RIGIDITY] / low, stems[..., HEIGHT] / low
    slides = np.interp(tallness, table[:, LENGTH], travel, left=0.0)
    rising = slice(int(np.argmax(table[:, MOMENT])) + 1)
    kinks = np.interp(stems[..., BREAKS] / soft, table[rising, MOMENT], travel[rising], right=np.inf)
    bent = np.interp(np.minimum(slides, kinks), travel, table[:, ENERGY]) * soft
    breaks = kinks < slides
    end = np.minimum(most, np.sqrt(np.maximum(tallness**2 - 1.0, 0.0)))
    turn = np.maximum(np.arctan(end) - np.arctan(np.where(breaks, kinks, 0.0)), 0.0)
    turned = RESIDUAL * np.where(breaks, stems[..., BREAKS], 0.0) * turn
    return np.asarray(stems[..., COUNT] * (bent + turned))


def forces_on(mesh: Mesh, poses: Array, robot: RobotConfig) -> Array:
    """Return the mean force [N] (n,) that presses down a mesh's stems at poses (n, 4, 4); 0 without stems."""
    width, low = robot.outline[1], robot.ground_clearance
    work, farthest = np.zeros(len(poses)), np.zeros(len(poses))
    for rooted in rooted_in(mesh, poses):
        stems = spread(rooted).reshape(*rooted.out.shape, 9)
        middle = np.linalg.norm(rooted.middle - poses[:, None, :2, 3], axis=2)
        away = np.hypot(middle[..., None], rooted.out)  # the root of the mean square over all turns of a tuft
        share = 2.0 / np.pi * np.arcsin(width / np.maximum(2.0 * away, width))
        work += (pressing_work(stems[:, :, 0], low)[..., None] * share).sum(axis=(1, 2))
        farthest = np.maximum(farthest, away.max(axis=(1, 2)))
    return work / (2.0 * farthest + elastica()[1] * low)


def forces_of_copies(world: World, kind: str, mesh: Mesh, poses: Array, robot: RobotConfig) -> Array:
    """Return the force [N] (n,) that presses down copies of a mesh, of objects of a kind, at poses (n, 4, 4).

    What is loose, passable by its mesh, or ground without a collider takes none; what is solid, an infinite one.
    """
    labels = {world.materials[name].label for name in mesh.materials}
    bears = not mesh.colliders and mesh.tufts is None and labels <= _BEARS
    if kind in LOOSE or mesh.passable or bears:
        return np.zeros(len(poses))
    if yields_of(mesh) == "solid":
        return np.full(len(poses), np.inf)
    blocks = [poses[first : first + _AT_ONCE] for first in range(0, len(poses), _AT_ONCE)]
    return np.concatenate([np.zeros(0), *(forces_on(mesh, block, robot) for block in blocks)])


def passability_of(force: Array, robot: RobotConfig) -> Array:
    """Return the passability (n,), 0 solid to 1 free, of what takes a force [N] (n,) to press down."""
    return np.maximum(1.0 - force / (GRIP * robot.mass * GRAVITY), 0.0)


def _forces(world: World, robot: RobotConfig) -> Iterator[Array]:
    """Yield the forces [N] of nothing, the terrain and the backdrop; of the objects; and of each swarm."""
    yield np.array([0.0, 0.0, np.inf][: 2 + (world.backdrop is not None)])
    names, forces = np.array([each.mesh for each in world.instances]), np.zeros(len(world.instances))
    for name in np.unique(names).tolist():
        copies = [world.instances[row] for row in np.flatnonzero(names == name)]
        poses = np.array([each.world_from_object for each in copies])
        forces[names == name] = forces_of_copies(world, copies[0].kind, world.meshes[name], poses, robot)
    yield forces
    for swarm in world.swarms:
        forces = np.zeros(len(swarm.mesh))
        for row, name in enumerate(swarm.meshes):
            of = swarm.mesh == row
            forces[of] = forces_of_copies(world, swarm.kind, world.meshes[name], swarm.world_from_object[of], robot)
        yield forces


class Passability:
    """Passability and force of the copies of all meshes of a world, for a robot. Threads may share it.

    A copy's ``number`` is its row in ``Scene.top_levels`` and 1 more; 0 is nothing, the robot, or a particle. Bodies
    that move are solid.

    Args:
        world: with the copies, in the order of ``Scene.top_levels``.
        robot: whose front pushes.
        bodies: number of bodies that move.
    """

    def __init__(self, world: World, robot: RobotConfig, bodies: int = 0) -> None:
        self._backdrop = 2 if world.backdrop is not None else -1
        force = np.concatenate([*_forces(world, robot), np.full(bodies, np.inf)])
        self.values: Float32Array = np.stack([passability_of(force, robot), force], axis=-1).astype(np.float32)
        """(numbers, 2) Passability, 0 solid to 1 free, and force [N]."""

    def of(self, number: NDArray[np.uint32] | Index, label: NDArray[np.uint8]) -> Float32Array:
        """Return passability and force [N], (..., 2), of copies by number and of their classes, of any shape.

        The backdrop has one number: its plants are solid, the rest of it is ground.
        """
        found = np.take(self.values, number, axis=0)
        found[(number == self._backdrop) & ~np.isin(label, _PLANTS)] = (1.0, 0.0)
        return found

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stems of a world's plants that a robot pushes over, and which plants are solid, flexible or passable.

A plant's species says so (``Species.yields``, ``Species.stems``). Where its file names no source, the numbers are
assumed: a rigidity is E I of a round stem of the diameter that the file names, with a modulus E of 8 GPa for dry culms
of reed and wheat and of 1 to 6 GPa for green stems and twigs. The rind of maize has 6 to 16 GPa (Al-Zube, Sun,
Robertson and Cook 2018, The elastic modulus for maize stems, Plant Methods 14, 11); a whole green stalk is taken as
1.5 GPa (assumed). Stems of marsh plants differ by orders of magnitude, tall ones such as reed are the stiffest (Zhu,
Yang and Bouma 2020, Biomechanical properties of marsh vegetation in space and time, Annals of Botany 125, 277-290).
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.stems import Cells
from fieldtruth.world.model import LOOSE, Mesh, Swarm, World
from fieldtruth.world.plants.species import BUSHES, GRASSES, TREES, GrassSpecies, Species, Stems, Yields

CELL: Final = 0.5
"""Side [m] of the squares by which stems are found."""
_ROWS: Final = {"flexible": 12, "passable": 4}
"""Rows for the stems of a tuft or bush at most; each row stands for as many stems."""
DEAD: Final = frozenset({"bark_torn", "bark_dead"})
"""Materials of dead wood, whose meshes have the species that it was."""
_STOOLS: Final[list[list[str]]] = [[], ["cylinder"]]
"""Shapes of the colliders of bushes that can yield."""
_TURN: Final = np.radians(137.5)


class StemRows(NamedTuple):
    """Upright stems: ``values`` (n, 9) are the columns of ``kernels.stems``, in the order of squares of ``cells``.

    Feet x, y, z [m] on the soil, number of stems that the row stands for, rigidity [N m^2] and breaking moment [N m] of
    one, infinite if it never breaks, height [m], share that recovers, and its time [s].
    """

    values: Array
    cells: Cells


def species_of(mesh: Mesh) -> list[Species | GrassSpecies | None]:
    """Return the species of a mesh's names, None for rocks."""
    libraries = (GRASSES,) if mesh.tufts is not None else (BUSHES, TREES)
    return [next((each[name] for each in libraries if name in each), None) for name in mesh.species]


def yields_of(mesh: Mesh) -> Yields:
    """Return what a mesh does to a robot; of a clump of several species, what the stiffest of them does.

    Dead wood is as its colliders are, and so is a bush with others than one cylinder, in which its stems would stand.
    """
    if mesh.tufts is None and (DEAD & set(mesh.materials) or [each.shape for each in mesh.colliders] not in _STOOLS):
        return "solid" if mesh.colliders else "passable"
    found = [each.yields for each in species_of(mesh) if each is not None]
    ranks: tuple[Yields, ...] = ("solid", "flexible", "passable")
    return next((rank for rank in ranks if rank in found), "passable" if mesh.passable else "solid")


def stems_of(world: World) -> StemRows:
    """Return the stems of all tufts and flexible bushes inside a world."""
    blocks = [np.zeros((0, 9)), *_of_swarms(world), *_of_bushes(world)]
    rows = np.concatenate(blocks)
    half = np.array(world.size) / 2
    rows = rows[(np.abs(rows[:, :2]) < half).all(axis=1)]
    rows[:, 2] = world.terrain.field.height_at(rows[:, 0], rows[:, 1])
    nx, ny = (int(np.ceil(side / CELL)) for side in world.size)
    cell = np.minimum(((rows[:, :2] + half) / CELL).astype(np.int64), (nx - 1, ny - 1)) @ (ny, 1)
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], np.arange(nx * ny + 1)).astype(np.int64)
    grid = (-float(half[0]), -float(half[1]), 1 / CELL, nx, ny)
    return StemRows(np.ascontiguousarray(rows[order]), Cells(first, grid))


def _of_swarms(world: World) -> Iterator[Array]:
    for swarm in (each for each in world.swarms if each.kind not in LOOSE):
        for row, name in enumerate(swarm.meshes):
            mesh = world.meshes[name]
            if mesh.tufts is not None:
                yield from _of_tufts(mesh, _inside(world, swarm, row))


def _inside(world: World, swarm: Swarm, row: int) -> Array:
    """Poses (n, 4, 4) of a swarm's copies of one mesh that are in the world."""
    inside = (np.abs(swarm.world_from_object[:, :2, 3]) < np.array(world.size) / 2 + 2.0).all(axis=1)
    return np.asarray(swarm.world_from_object[inside & (swarm.mesh == row)])


def _of_tufts(mesh: Mesh, poses: Array) -> Iterator[Array]:
    """Yield the stems of each species of a clump at poses."""
    assert mesh.tufts is not None
    scale = np.linalg.norm(poses[:, :3, 0], axis=1)
    for number, species in enumerate(species_of(mesh)):
        own = mesh.tufts[mesh.tufts[:, 3] == number].astype(np.float64)
        if not isinstance(species, GrassSpecies) or species.stems is None or not len(own) or not len(poses):
            continue
        middle = np.einsum("nij,kj->nki", poses[:, :2, :2], own[:, :2]) + poses[:, None, :2, 3]
        height = own[:, 2] * scale[:, None]
        radius = species.radius * np.sqrt(2 * own[:, 2] / sum(species.height)) * scale[:, None]
        usual = sum(species.height) / 2
        yield _spread(species.stems, _ROWS[species.yields], (middle.reshape(-1, 2), radius, height), usual)


def _of_bushes(world: World) -> Iterator[Array]:
    for instance in world.instances:
        mesh = world.meshes[instance.mesh]
        if mesh.tufts is None and yields_of(mesh) == "flexible" and mesh.colliders:
            species, collider = species_of(mesh)[0], mesh.colliders[0]
            assert isinstance(species, Species)
            assert species.stems is not None
            scale = float(np.linalg.norm(instance.world_from_object[:3, 0]))
            size = np.array(collider.size) * scale
            body = instance.world_from_object[None, :2, 3], size[:1], size[1:]
            yield _spread(species.stems, _ROWS["flexible"], body, species.grown.height)


def _spread(stems: Stems, most: int, bodies: tuple[Array, Array, Array], usual: float) -> Array:
    """Stems spread over discs: middles (n, 2), radii and heights [m] of n bodies, of a ``usual`` height."""
    count = min(stems.number, most)
    middle, radius, height = bodies[0], bodies[1].reshape(-1, 1), bodies[2].reshape(-1, 1)
    k = np.arange(count)
    turn = k * _TURN + np.arange(len(middle))[:, None]  # each body is turned otherwise
    out = radius * np.sqrt(k / count)
    stronger = (height / usual) ** 2
    columns = (
        middle[:, :1] + out * np.cos(turn),
        middle[:, 1:] + out * np.sin(turn),
        0.0,
        stems.number / count,
        stems.rigidity * stronger,
        (np.inf if stems.breaks is None else stems.breaks) * stronger,
        height,
        stems.recovers,
        stems.seconds,
    )
    return np.stack(np.broadcast_arrays(*columns), axis=-1).reshape(-1, 9)

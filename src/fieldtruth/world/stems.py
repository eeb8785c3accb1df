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

from fieldtruth.core.arrays import Array, Mask
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
THIN: Final = 0.02
"""Thickness [m] of a branch below which a robot bends it."""
SAPLING: Final = 3.0
"""Height [m] below which a tree or bush without a collider is a sapling, which bends."""
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
    Saplings of solid species are flexible: nothing of them stops a robot.
    """
    if mesh.tufts is None and (DEAD & set(mesh.materials) or [each.shape for each in mesh.colliders] not in _STOOLS):
        return "solid" if mesh.colliders else "passable"
    found = [each.yields for each in species_of(mesh) if each is not None]
    ranks: tuple[Yields, ...] = ("solid", "flexible", "passable")
    rank = next((rank for rank in ranks if rank in found), "passable" if mesh.passable else "solid")
    return "flexible" if rank == "solid" and found and _is_sapling(mesh) else rank


def _is_sapling(mesh: Mesh) -> bool:
    return mesh.tufts is None and not mesh.colliders and bool(mesh.vertices[:, 2].max() < SAPLING)


def bends(mesh: Mesh, thickness: Array) -> Mask:
    """Return whether stems and branches of a plant, (n,) [m] thick, bend before a robot, and do not stop it.

    A bush's species says so, and saplings bend. The collider of a tree is its trunk: its branches bend below a
    thickness, and so do those of plants without a species.
    """
    if any(name in BUSHES for name in mesh.species) or (mesh.species and _is_sapling(mesh)):
        return np.full(len(thickness), yields_of(mesh) != "solid")
    return np.asarray(thickness < THIN)


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


class Rooted(NamedTuple):
    """Stems of one species on n copies of a mesh: of the k tufts of a clump, or of a bush, k = 1."""

    stems: Stems
    yields: Yields
    middle: Array
    """(n, k, 2) [m] in the world."""
    radius: Array
    """(n, k) [m] of the disc in which they root."""
    height: Array
    """(n, k) [m]."""
    usual: float
    """Height [m] at which a stem has the rigidity of ``stems``."""

    @property
    def out(self) -> Array:
        """(n, k, r) Distances [m] of its rows from the middle."""
        count = min(self.stems.number, _ROWS[self.yields])
        return np.asarray(self.radius[..., None] * np.sqrt(np.arange(count) / count))


def rooted_in(mesh: Mesh, poses: Array) -> Iterator[Rooted]:
    """Yield the stems of each species of a mesh at poses (n, 4, 4): of tufts, and of flexible bushes."""
    if mesh.tufts is not None:
        yield from _in_tufts(mesh, poses)
    elif yields_of(mesh) == "flexible" and mesh.colliders:
        species, collider = species_of(mesh)[0], mesh.colliders[0]
        assert isinstance(species, Species)
        assert species.stems is not None
        scale = np.array([np.linalg.norm(pose[:3, 0]) for pose in poses])[:, None]
        radius, height = (scale * size for size in collider.size)
        yield Rooted(species.stems, species.yields, poses[:, None, :2, 3], radius, height, species.grown.height)


def _in_tufts(mesh: Mesh, poses: Array) -> Iterator[Rooted]:
    assert mesh.tufts is not None
    scale = np.linalg.norm(poses[:, :3, 0], axis=1)
    for number, species in enumerate(species_of(mesh)):
        own = mesh.tufts[mesh.tufts[:, 3] == number].astype(np.float64)
        if not isinstance(species, GrassSpecies) or species.stems is None or not len(own) or not len(poses):
            continue
        middle = np.einsum("nij,kj->nki", poses[:, :2, :2], own[:, :2]) + poses[:, None, :2, 3]
        height = own[:, 2] * scale[:, None]
        radius = species.radius * np.sqrt(2 * own[:, 2] / sum(species.height)) * scale[:, None]
        yield Rooted(species.stems, species.yields, middle, radius, height, sum(species.height) / 2)


def _of_swarms(world: World) -> Iterator[Array]:
    for swarm in (each for each in world.swarms if each.kind not in LOOSE):
        for row, name in enumerate(swarm.meshes):
            mesh = world.meshes[name]
            if mesh.tufts is not None:
                yield from map(spread, rooted_in(mesh, _inside(world, swarm, row)))


def _inside(world: World, swarm: Swarm, row: int) -> Array:
    """Poses (n, 4, 4) of a swarm's copies of one mesh that are in the world."""
    inside = (np.abs(swarm.world_from_object[:, :2, 3]) < np.array(world.size) / 2 + 2.0).all(axis=1)
    return np.asarray(swarm.world_from_object[inside & (swarm.mesh == row)])


def _of_bushes(world: World) -> Iterator[Array]:
    for instance in world.instances:
        mesh = world.meshes[instance.mesh]
        if mesh.tufts is None:
            yield from map(spread, rooted_in(mesh, instance.world_from_object[None]))


def spread(rooted: Rooted) -> Array:
    """Return rows (n * k * r, 9) of stems, those of a tuft one after another: upright in a disc, at height 0."""
    stems, middle, height = rooted.stems, rooted.middle.reshape(-1, 2), rooted.height.reshape(-1, 1)
    count = rooted.out.shape[-1]
    out = rooted.out.reshape(-1, count)
    turn = np.arange(count) * _TURN + np.arange(len(middle))[:, None]  # each body is turned otherwise
    stronger = (height / rooted.usual) ** 2
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

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export the world of a run as a sparse grid of voxels with classes: one NPZ file."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.run import Run
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import OutputError
from fieldtruth.exporters import Options
from fieldtruth.kernels.counting import VoxelMeshes, mark_ground, mark_meshes
from fieldtruth.local_maps import world_of_run
from fieldtruth.sense.scene import grid_of, terrain_nodes
from fieldtruth.world.model import Mesh, World

_TILE: Final = 128  # voxels along x and y that are in memory at once

_IDS: Final = 256
_BITS: Final = 32
"""Of a voxel, one for each class."""


class Voxels(NamedTuple):
    """Occupied voxels: a row for each class of each, sorted by x, y, z and class."""

    coords: NDArray[np.uint16]
    """(n, 3) numbers of the voxel along x, y and z."""
    label: NDArray[np.uint8]
    """(n,) class ids."""


class Lattice(NamedTuple):
    """A grid of cubes in the world frame."""

    origin: Array
    """(3,) [m], the lower corner of the first one."""
    voxel_m: float
    shape: tuple[int, int, int]


def lattice_of(world: World, voxel_m: float) -> Lattice:
    """Return the grid over the area of a world, as high as its ground and objects."""
    meshes = voxel_meshes(world)
    heights = world.terrain.surface.heights
    low, high = float(heights.min()), float(heights.max())
    if len(meshes.mesh):
        low, high = min(low, float(meshes.low[:, 2].min())), max(high, float(meshes.high[:, 2].max()))
    bottom = np.floor(low / voxel_m) * voxel_m
    origin = np.array([-world.size[0] / 2, -world.size[1] / 2, bottom])
    nx, ny = (int(np.ceil(side / voxel_m - 1e-9)) for side in world.size)
    return Lattice(origin, voxel_m, (nx, ny, int(np.floor((high - bottom) / voxel_m)) + 1))


def voxels_of(world: World, lattice: Lattice) -> Iterator[tuple[float, Voxels]]:
    """Yield the voxels of the columns along x in turn, with the share of the world that is done."""
    meshes, nodes = voxel_meshes(world), terrain_nodes(world.terrain.surface)
    trail, (nx, ny, nz), bits = grid_of(world.terrain.trail_distance), lattice.shape, bits_of(world)
    for x in range(0, nx, _TILE):
        found: list[NDArray[np.int64]] = []
        for y in range(0, ny, _TILE):
            size = min(_TILE, nx - x), min(_TILE, ny - y)
            start = lattice.origin + lattice.voxel_m * np.array([x, y, 0.0])
            end = start[:2] + lattice.voxel_m * np.array(size)
            near = (meshes.low[:, :2] < end).all(axis=1) & (meshes.high[:, :2] >= start[:2]).all(axis=1)
            grid = np.zeros((*size, nz), np.uint32)
            if world.terrain.visible:
                mark_ground(nodes, trail, start, lattice.voxel_m, grid)
            mark_meshes(meshes, np.flatnonzero(near), start, lattice.voxel_m, grid)
            cells = np.flatnonzero(grid)
            for label, bit in bits.items():
                own = cells[grid.reshape(-1)[cells] & np.uint32(1 << bit) != 0]
                i, j, k = np.unravel_index(own, grid.shape)
                found.append((((i + x) * ny + j + y) * nz + k) * _IDS + label)
        cell, label_ids = np.divmod(np.sort(np.concatenate(found)), _IDS)
        coords = np.stack(np.unravel_index(cell, lattice.shape), axis=-1).astype(np.uint16)
        yield min(1.0, (x + _TILE) / nx), Voxels(coords, label_ids.astype(np.uint8))


def bits_of(world: World) -> dict[int, int]:
    """Return the bit of each class in a voxel; those of the paper's classes are their ids.

    Raises:
        OutputError: more classes than bits.
    """
    own = sorted({int(material.label) for material in world.materials.values()} - {*Label})
    if (most := _BITS - len(Label)) < len(own):
        raise OutputError(f"voxels hold at most {most} own classes, and this world has {len(own)}")
    return {int(label): int(label) for label in Label} | {label: len(Label) + k for k, label in enumerate(own)}


def voxel_meshes(world: World) -> VoxelMeshes:
    """Return the meshes of a world and their copies, with the bits of their classes."""
    meshes: list[Mesh] = list(world.meshes.values())
    rows = {mesh.name: row for row, mesh in enumerate(meshes)}
    bit_of = bits_of(world)
    bits_by_name = {name: 1 << bit_of[int(material.label)] for name, material in world.materials.items()}
    mesh = [np.array([rows[each.mesh] for each in world.instances], np.int64)]
    pose = [np.array([each.world_from_object for each in world.instances]).reshape(-1, 4, 4)]
    for swarm in world.swarms:
        mesh.append(np.array([rows[name] for name in swarm.meshes], np.int64)[swarm.mesh])
        pose.append(swarm.world_from_object)
    starts = np.cumsum([0, *(len(each.vertices) for each in meshes)])
    bits = [np.array([bits_by_name[n] for n in each.materials], np.uint32)[each.material] for each in meshes]
    all_mesh, all_pose = np.concatenate(mesh), np.concatenate(pose)
    boxes = [(each.vertices.min(axis=0), each.vertices.max(axis=0)) for each in meshes]
    corners = np.array([[[a[0], b[1], c[2]] for a in box for b in box for c in box] for box in boxes], np.float64)
    turned = np.zeros((0, 8, 3))
    if len(all_mesh):
        turned = np.einsum("nij,nkj->nki", all_pose[:, :3, :3], corners[all_mesh]) + all_pose[:, None, :3, 3]
    return VoxelMeshes(
        vertices=np.concatenate([*(each.vertices for each in meshes), np.zeros((0, 3), np.float32)]),
        faces=np.concatenate(
            [*(each.faces + start for each, start in zip(meshes, starts, strict=False)), np.zeros((0, 3), np.int64)]
        ).astype(np.int64),
        bits=np.concatenate([*bits, np.zeros(0, np.uint32)]),
        ends=np.cumsum([0, *(len(each.faces) for each in meshes)]).astype(np.int64),
        mesh=all_mesh,
        pose=np.ascontiguousarray(all_pose),
        low=turned.min(axis=1, initial=np.inf),
        high=turned.max(axis=1, initial=-np.inf),
    )


LEAST_M: Final = 0.01
MOST_M: Final = 10.0
_MOST_CELLS: Final = 1 << 16


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the file: ``coords`` (n, 3) uint16, ``label`` (n,) uint8, ``origin``, ``voxel_m``, ``shape``, ``names``.

    Raises:
        BagError: the world of the run is not known.
        OutputError: a voxel that is too small or too large.
    """
    if not LEAST_M <= options.voxel_m <= MOST_M:
        raise OutputError(f"voxel must be between {LEAST_M} and {MOST_M} m, got {options.voxel_m:g}")
    (run,) = runs
    with options.progress.stage("build the world"):
        world = world_of_run(run)
    lattice = lattice_of(world, options.voxel_m)
    if max(lattice.shape) > _MOST_CELLS:
        raise OutputError(f"voxel must be so large that {_MOST_CELLS} span the world, got {options.voxel_m:g}")
    parts, before = [], 0.0
    with options.progress.stage("voxels", 1.0) as advance:
        for done, voxels in voxels_of(world, lattice):
            parts.append(voxels)
            advance(done - before)
            before = done
    coords, label = (np.concatenate(each) for each in zip(*parts, strict=True))
    target.parent.mkdir(parents=True, exist_ok=True)
    size = f"{len(label):,} voxels, {(coords.nbytes + label.nbytes) / 1e6:.0f} MB in memory"
    with options.progress.stage(f"compress {size}"), target.open("wb") as file:
        np.savez_compressed(
            file,
            coords=coords,
            label=label,
            origin=lattice.origin,
            voxel_m=np.float64(options.voxel_m),
            shape=np.array(lattice.shape, np.int64),
            names=np.array([row.name for row in options.classes]),
        )

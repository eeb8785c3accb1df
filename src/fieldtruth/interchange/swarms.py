# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Swarms as a few large meshes, for tools that are slow with many small objects."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.interchange.surfaces import Surface, merge_surfaces, mesh_surfaces, placed
from fieldtruth.world.model import Swarm, World

BEYOND_TILE: Final = 8
"""Side of a tile of members beyond the edge, in sides of a tile inside, because they are few and far."""


@dataclass(frozen=True, kw_only=True)
class SwarmTile:
    """Members of one swarm on one tile."""

    name: str
    swarm: Swarm
    members: NDArray[np.intp]
    """Rows of the swarm's arrays."""
    beyond: bool
    """Whether the members are beyond the world's edge."""

    def face_count(self, world: World) -> int:
        """Number of the members' triangles."""
        faces = np.array([len(world.meshes[name].faces) for name in self.swarm.meshes])
        return int(faces[self.swarm.mesh[self.members]].sum())


@dataclass(frozen=True, kw_only=True)
class MergedTile(SwarmTile):
    """Members of one swarm on one tile as a surface per material, in world coordinates."""

    surfaces: tuple[Surface, ...]


def beyond_edge(world: World, swarm: Swarm) -> NDArray[np.bool_]:
    """Whether the origin of each member (n,) is beyond the world's edge."""
    return np.asarray((np.abs(swarm.world_from_object[:, :2, 3]) > np.array(world.size) / 2).any(axis=1))


def merged_swarms(world: World, size_m: float = 25.0, *, beyond: bool) -> Iterator[MergedTile]:
    """Merge the members of each swarm tile by tile; with ``beyond`` also those beyond the world's edge.

    Tiles are those of ``tiles_of_swarms``; one tile is in memory at a time.
    """
    for tile in tiles_of_swarms(world, size_m, beyond=beyond):
        yield MergedTile(**vars(tile), surfaces=_merged(world, tile.swarm, tile.members))


def tiles_of_swarms(world: World, size_m: float = 25.0, *, beyond: bool) -> Iterator[SwarmTile]:
    """Group the members of each swarm by tile; with ``beyond`` also those beyond the world's edge.

    A member belongs to the tile that its origin is on. Tiles start in the world's corner and have a side of ``size_m``
    [m]; beyond the edge they are ``BEYOND_TILE`` times as large.
    """
    for swarm in world.swarms:
        outside = beyond_edge(world, swarm)
        yield from _tiles(world, swarm, np.flatnonzero(~outside), size_m, beyond=False)
        if beyond:
            yield from _tiles(world, swarm, np.flatnonzero(outside), size_m * BEYOND_TILE, beyond=True)


def _tiles(world: World, swarm: Swarm, members: NDArray[np.intp], side: float, *, beyond: bool) -> Iterator[SwarmTile]:
    tile = np.floor((swarm.world_from_object[members, :2, 3] + np.array(world.size) / 2) / side).astype(int)
    for i, j in np.unique(tile, axis=0).tolist():
        rows = members[(tile == (i, j)).all(axis=1)]
        name = f"{swarm.name}_beyond_{i}_{j}" if beyond else f"{swarm.name}_{i}_{j}"
        yield SwarmTile(name=name, swarm=swarm, members=rows, beyond=beyond)


def _merged(world: World, swarm: Swarm, members: NDArray[np.intp]) -> tuple[Surface, ...]:
    parts: dict[str, list[Surface]] = {}
    for row, mesh in enumerate(swarm.meshes):
        of_mesh = members[swarm.mesh[members] == row]
        if len(of_mesh):
            for surface in mesh_surfaces(world.meshes[mesh], world.materials):
                copies = placed(surface, swarm.world_from_object[of_mesh], swarm.tint[of_mesh])
                parts.setdefault(surface.material, []).append(copies)
    return tuple(merge_surfaces(found) for found in parts.values())

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A stand of trees: each grows where the trees before it have left some light."""

from collections.abc import Callable
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import ObjectGroup, WorldBuilder, random_tint

CELL: Final = 0.5  # [m]
EXTINCTION: Final = 0.5
"""Of leaves in all directions: light below is exp(-0.5 leaf area index) (Monsi and Saeki 1953, from memory)."""
LIGHT_BEYOND: Final = 0.3
"""Light that is left beyond the world's edge, where other trees stand."""
CHOICES: Final = 12
"""Free positions among which a tree has the best; more would make rows."""
ROUNDS: Final = 60
"""Sets of random positions that are drawn for a tree before the stand is full."""


class Stand:
    """The light that is left for further trees, from above, on a grid."""

    def __init__(self, builder: WorldBuilder) -> None:
        self._builder = builder
        self._inside = np.ceil(np.array(builder.size) / CELL).astype(int)
        self._margin = 24  # cells: half of the widest crown
        self._light = np.full(self._inside + 2 * self._margin, LIGHT_BEYOND)
        self._light[self._margin : -self._margin, self._margin : -self._margin] = 1.0

    def plant(self, group: ObjectGroup, rng: np.random.Generator, allowed: Callable[[Array], Mask]) -> None:
        """Add the trees of a group, in steps of 90 deg: the bounding box of a tall tree, which each passing ray enters,
        stays as narrow as the tree (7 to 11 % of the time for an image of a dense forest).

        Raises:
            CrowdedWorldError: too few positions are free.
        """
        turned = {mesh.name: _turned(_shade(mesh, self._margin)) for mesh in group.meshes}
        placed = []
        for number in range(group.count):
            mesh, scale = group.mesh(number), float(rng.uniform(*group.scales))
            free = self._free(mesh.footprint * scale, rng, allowed)
            if not len(free):
                break
            shades = turned[mesh.name]
            gains = np.stack([(self._window(xy) * shades).reshape(4, -1).sum(axis=1) for xy in free])
            best, turn = np.unravel_index(int(gains.argmax()), gains.shape)
            self._window(free[best])[...] *= 1.0 - shades[turn]
            tint = random_tint(rng, group.tint)
            pose = {"yaw": float(turn) * np.pi / 2, "scale": scale}
            placed.append(self._builder.add_upright(group.kind, mesh, free[best], **pose, tint=tint))
        group.check_complete(placed)

    def _free(self, radius: float, rng: np.random.Generator, allowed: Callable[[Array], Mask]) -> Array:
        """Up to ``CHOICES`` free positions (n, 2)."""
        found: list[Array] = []
        for _ in range(ROUNDS):
            darts = self._builder.random_positions(2 * CHOICES, rng)
            for xy in darts[allowed(darts)]:
                if self._builder.is_free(xy, radius):
                    found.append(xy)
                    if len(found) == CHOICES:
                        return np.array(found)
        return np.array(found).reshape(-1, 2)

    def _window(self, xy: Array) -> Array:
        """The light about a position, as wide as the shade of a crown."""
        i, j = np.rint((xy + np.array(self._builder.size) / 2) / CELL).astype(int)
        return self._light[i : i + 2 * self._margin, j : j + 2 * self._margin]


def _turned(shade: Array) -> Array:
    """The shade in the four steps of 90 deg (4, 2 half, 2 half)."""
    return np.stack([np.rot90(shade, k) for k in range(4)])


def _shade(mesh: Mesh, half: int) -> Array:
    """Share of the light from above that the mesh takes (2 half, 2 half) in the cells about its foot."""
    corner = mesh.vertices[mesh.faces].astype(np.float64)
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    edges = CELL * np.arange(-half, half + 1)
    middle = corner[..., :2].mean(axis=1)
    index, _, _ = np.histogram2d(middle[:, 0], middle[:, 1], bins=[edges, edges], weights=area / CELL**2)
    return np.asarray(1.0 - np.exp(-EXTINCTION * index))

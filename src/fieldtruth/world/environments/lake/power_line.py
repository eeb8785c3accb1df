# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A power line across the world and beyond its edge: a row of poles, four wires from each to the next."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.lake.config import Config
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import CrowdedWorldError, FarSwarm, WorldBuilder, make_swarm
from fieldtruth.world.power_lines import BUNDLE_RADIUS, CONDUCTOR_RADIUS, hang, make_cable, make_power_pole, wire_points

FAR_POLES: Final = 2  # on either side of the world
POLE_CLEARANCE: Final = 0.8  # [m] around a pole; the cross-arm is above all low objects
_TRIES: Final = 60


@dataclass(frozen=True)
class PowerLine:
    """Positions of the poles, and the swarms of the line's part beyond the world's edge."""

    poles: Array  # (n, 2) [m]
    beyond: tuple[FarSwarm, ...]

    def distance(self, xy: Array) -> Array:
        """Horizontal distance [m], (n,), of positions (n, 2) to the straight lines between the poles."""
        a, b = self.poles[:-1], self.poles[1:]
        along = np.einsum("nmi,mi->nm", xy[:, None] - a, b - a) / ((b - a) ** 2).sum(axis=1)
        foot = a + np.clip(along, 0.0, 1.0)[..., None] * (b - a)
        return np.asarray(np.linalg.norm(xy[:, None] - foot, axis=-1).min(axis=1))


def string_line(
    builder: WorldBuilder,
    config: Config,
    ground_height: Callable[[Array], Array],
    rng: np.random.Generator,
    *,
    far: int = FAR_POLES,
) -> PowerLine:
    """Add two poles inside the world and their cables, with ``far`` more poles on either side of the world.

    The spans that touch the world are named objects, four cables each; the others are swarms. ``ground_height`` is the
    height [m] of the ground at positions (n, 2), also beyond the edge.

    Raises:
        CrowdedWorldError: no pair of free positions for the poles.
    """
    poles = _free_positions(builder, config, far, rng)
    variant = int(rng.integers(2))
    pole, points = make_power_pole(variant), wire_points(variant)
    headings = np.gradient(poles, axis=0)
    poses = np.tile(np.eye(4), (len(poles), 1, 1))
    poses[:, :2, 0] = headings / np.linalg.norm(headings, axis=1, keepdims=True)
    poses[:, 0, 1], poses[:, 1, 1] = -poses[:, 1, 0], poses[:, 0, 0]
    poses[:, :2, 3], poses[:, 2, 3] = poles, ground_height(poles)
    for row in (far, far + 1):
        x, y = poles[row]
        builder.add("power_pole", pole, poses[row], [(float(x), float(y), POLE_CLEARANCE)])
    held = np.einsum("nij,mj->nmi", poses, np.column_stack([points, np.ones(len(points))]))[..., :3]
    away: list[tuple[Mesh, Array]] = []
    for row, (first, last) in enumerate(pairwise(held)):
        for k, (start, end) in enumerate(zip(first, last, strict=True)):
            span = float(np.hypot(*(end - start)[:2]))
            # Wires of one span have about the same tension.
            wire = hang(start, end, sag=config.sag * span * float(rng.uniform(0.94, 1.06)))
            radius = BUNDLE_RADIUS if k == len(first) - 1 else CONDUCTOR_RADIUS
            mesh, pose = make_cable(f"cable_{row}_{k}", wire, radius=radius)
            if abs(row - far) <= 1:
                builder.add("cable", mesh, pose, [])
            else:
                away.append((mesh, pose))
    outer = np.r_[0:far, far + 2 : len(poles)]
    beyond: list[FarSwarm] = []
    if len(outer):
        beyond.append((make_swarm("power_poles_beyond", "power_pole", [pole], poses[outer], None), [pole]))
    if away:
        meshes = [mesh for mesh, _ in away]
        cable_poses = np.array([pose for _, pose in away])
        beyond.append((make_swarm("cables_beyond", "cable", meshes, cable_poses, None), meshes))
    return PowerLine(poles, tuple(beyond))


def _free_positions(builder: WorldBuilder, config: Config, far: int, rng: np.random.Generator) -> Array:
    """Positions (2 far + 2, 2) of poles near y = ``config.line_y``; the two inside the world are free."""
    y = config.line_y
    for _ in range(_TRIES):
        middle, turn = rng.uniform([-4.0, y - 0.8], [4.0, y + 0.8]), rng.normal(0.0, 0.012)
        along = config.pole_distance * (np.arange(2 * far + 2) - far - 0.5)
        spread = rng.normal(0.0, [0.8, 0.25], (len(along), 2))
        poles = middle + along[:, None] * [np.cos(turn), np.sin(turn)] + spread
        if all(builder.is_free(pole, POLE_CLEARANCE) for pole in poles[far : far + 2]):
            return np.asarray(poles)
    raise CrowdedWorldError(
        f"no two free positions for poles {config.pole_distance} m apart near y = {y} m; "
        "change line_y or pole_distance in the layout"
    )

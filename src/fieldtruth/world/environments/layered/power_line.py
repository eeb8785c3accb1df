# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A power line across the world: a row of poles along x with four wires from each to the next, on beyond the edge."""

from collections.abc import Callable
from itertools import pairwise
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.fields import Integer
from fieldtruth.world.environments.layered.expressions import Constant
from fieldtruth.world.environments.layered.fields import Fields, rng_of
from fieldtruth.world.environments.layered.sections import Amount, Layer
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.grids import Line
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import CrowdedWorldError, FarSwarm, WorldBuilder, make_swarm
from fieldtruth.world.power_lines import BUNDLE_RADIUS, CONDUCTOR_RADIUS, hang, make_cable, wire_points

CLEARANCE: Final = 0.8
"""Distance [m] that is kept free around a pole; the cross-arm is above all low objects."""
_TRIES: Final = 60


class PowerLine(Layer):
    """Poles and wires across the world and on beyond its edge: those that are in it, or touch it, are objects."""

    type: Literal["power_line"] = "power_line"
    y: Amount  # [m]
    pole_distance: Amount = Field(default=Constant("46"))  # [m]
    sag: Amount = Field(default=Constant("0.018"))  # of a wire in the middle of its span, relative to that
    beyond: Annotated[Integer, Field(ge=0, le=20)] = 2  # poles on either side of the two in the middle

    def layout(self) -> None:
        """Return nothing: it has no key of its own."""

    def place(self, builder: WorldBuilder, fields: Fields, config: Any, name: str) -> None:
        """Set up the poles and string the wires.

        Raises:
            CrowdedWorldError: no pair of free positions for the poles.
        """
        rng = rng_of(fields.seed, f"objects.{name}")
        y, apart, sag = (fields.constant(rule) for rule in (self.y, self.pole_distance, self.sag))
        if not sag > 0.0 or not apart > 0.0:
            raise ConfigurationError(f"objects.{name}: sag and pole_distance must be above 0, got {sag:g}, {apart:g}")
        poles = _free_positions(builder, y, apart, self.beyond, rng)
        assert fields.ground is not None
        fields.far += string_line(builder, poles, sag, fields.ground, rng)
        fields.near[name] = Line.through(list(map(tuple, poles.tolist())), smooth=False).distance


def string_line(
    builder: WorldBuilder, poles: Array, sag: float, ground: Callable[[Array], Array], rng: np.random.Generator
) -> list[FarSwarm]:
    """Add the poles (n, 2) [m] in the world with their cables, and return the others as swarms.

    The spans that touch the world are named objects, four cables each. ``sag`` is relative to a span; ``ground`` is the
    height [m] of the ground at positions (n, 2), also beyond the edge.
    """
    within: Mask = np.asarray((np.abs(poles) < np.array(builder.size) / 2).all(axis=1))
    middle = len(poles) // 2
    within[middle - 1 : middle + 1] = True  # also where the world is shorter than a span
    variant = int(rng.integers(2))
    pole, points = make_furniture(f"power_pole_{variant}"), wire_points(variant)
    poses = _along(poles, ground(poles))
    for row in np.flatnonzero(within).tolist():
        x, y = poles[row].tolist()
        builder.add("power_pole", pole, poses[row], [(x, y, CLEARANCE)])
    held = np.einsum("nij,mj->nmi", poses, np.column_stack([points, np.ones(len(points))]))[..., :3]
    away: list[tuple[Mesh, Array]] = []
    for row, (first, last) in enumerate(pairwise(held)):
        for k, (start, end) in enumerate(zip(first, last, strict=True)):
            span = float(np.hypot(*(end - start)[:2]))
            # Wires of one span have about the same tension.
            wire = hang(start, end, sag=sag * span * float(rng.uniform(0.94, 1.06)))
            radius = BUNDLE_RADIUS if k == len(first) - 1 else CONDUCTOR_RADIUS
            mesh, pose = make_cable(f"cable_{row}_{k}", wire, radius=radius)
            if within[row : row + 2].any():
                builder.add("cable", mesh, pose, [])
            else:
                away.append((mesh, pose))
    beyond: list[FarSwarm] = []
    if not within.all():
        outer = make_swarm("power_poles_beyond", "power_pole", [pole], poses[~within], None)
        beyond.append((outer, [pole]))
    if away:
        meshes = [mesh for mesh, _ in away]
        cables = make_swarm("cables_beyond", "cable", meshes, np.array([pose for _, pose in away]), None)
        beyond.append((cables, meshes))
    return beyond


def _along(poles: Array, heights: Array) -> Array:
    """Poses (n, 4, 4) of poles (n, 2) [m] on ground of heights (n,) [m], turned along their line."""
    headings = np.gradient(poles, axis=0)
    poses = np.tile(np.eye(4), (len(poles), 1, 1))
    poses[:, :2, 0] = headings / np.linalg.norm(headings, axis=1, keepdims=True)
    poses[:, 0, 1], poses[:, 1, 1] = -poses[:, 1, 0], poses[:, 0, 0]
    poses[:, :2, 3], poses[:, 2, 3] = poles, heights
    return poses


def _free_positions(builder: WorldBuilder, y: float, apart: float, far: int, rng: np.random.Generator) -> Array:
    """Positions (2 far + 2, 2) of poles near a line along x; those inside the world are free."""
    for _ in range(_TRIES):
        middle, turn = rng.uniform([-4.0, y - 0.8], [4.0, y + 0.8]), rng.normal(0.0, 0.012)
        along = apart * (np.arange(2 * far + 2) - far - 0.5)
        spread = rng.normal(0.0, [0.8, 0.25], (len(along), 2))
        poles = middle + along[:, None] * [np.cos(turn), np.sin(turn)] + spread
        inside: Mask = np.asarray((np.abs(poles) < np.array(builder.size) / 2).all(axis=1))
        inside[far : far + 2] = True
        if all(builder.is_free(pole, CLEARANCE) for pole in poles[inside]):
            return np.asarray(poles)
    raise CrowdedWorldError(
        f"no two free positions for poles {apart:g} m apart near y = {y:g} m; change its y or pole_distance"
    )

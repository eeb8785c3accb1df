# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An aerial line across a world: poles in a row, four wires from each to the next, and on beyond the world's edge."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.furniture.cables import BUNDLE_RADIUS, CONDUCTOR_RADIUS, hang, make_cable
from fieldtruth.world.furniture.power_pole import make_power_pole, wire_points
from fieldtruth.world.model import Mesh, Swarm
from fieldtruth.world.placement import CrowdedWorldError, Site

POLE_ROOM: Final = 0.8  # [m] about a pole's middle that others keep; the cross-arm is above all that is low
_TRIES: Final = 60


@dataclass(frozen=True)
class PowerLine:
    """The poles' places and what of the line is beyond the world's edge."""

    poles: Array  # (n, 2) [m]
    beyond: tuple[tuple[Swarm, Sequence[Mesh]], ...]

    def distance(self, places: Array) -> Array:
        """Horizontal distance [m], (n,), of places (n, 2) to the straight lines between the poles."""
        a, b = self.poles[:-1], self.poles[1:]
        along = np.einsum("nmi,mi->nm", places[:, None] - a, b - a) / ((b - a) ** 2).sum(axis=1)
        foot = a + np.clip(along, 0.0, 1.0)[..., None] * (b - a)
        return np.asarray(np.linalg.norm(places[:, None] - foot, axis=-1).min(axis=1))


def string_line(
    site: Site, *, y: float, distance: float, sag: float, far: int, ground_at: Callable[[Array], Array],
    rng: np.random.Generator,
) -> PowerLine:  # fmt: skip
    """Set two poles ``distance`` [m] apart near the height ``y`` [m], and ``far`` more on either side of the world.

    The spans that touch the world are named objects, four cables each; the others are swarms. ``sag`` is relative to
    the span. ``ground_at`` gives the height [m] of the ground at places (n, 2) beyond the edge as well. Raises
    CrowdedWorldError where no pair of poles stands free.
    """
    poles = _free_places(site, y, distance, far, rng)
    variant = int(rng.integers(2))
    pole, points = make_power_pole(variant), wire_points(variant)
    headings = np.gradient(poles, axis=0)
    poses = np.tile(np.eye(4), (len(poles), 1, 1))
    poses[:, :2, 0] = headings / np.linalg.norm(headings, axis=1, keepdims=True)
    poses[:, 0, 1], poses[:, 1, 1] = -poses[:, 1, 0], poses[:, 0, 0]
    poses[:, :2, 3], poses[:, 2, 3] = poles, ground_at(poles)
    for row in (far, far + 1):
        x, y = poles[row]
        site.stand("power_pole", pole, poses[row], [(float(x), float(y), POLE_ROOM)])
    held = np.einsum("nij,mj->nmi", poses, np.column_stack([points, np.ones(len(points))]))[..., :3]
    away: list[tuple[Mesh, Array]] = []
    for row, (first, last) in enumerate(pairwise(held)):
        for k, (start, end) in enumerate(zip(first, last, strict=True)):
            span = float(np.hypot(*(end - start)[:2]))
            # Wires of one span are strung to one tension; those that men strung by hand differ a little.
            wire = hang(start, end, sag=sag * span * float(rng.uniform(0.94, 1.06)))
            radius = BUNDLE_RADIUS if k == len(first) - 1 else CONDUCTOR_RADIUS
            mesh, pose = make_cable(f"cable_{row}_{k}", wire, radius=radius)
            if abs(row - far) <= 1:
                site.stand("cable", mesh, pose, [])
            else:
                away.append((mesh, pose))
    outer = np.r_[0:far, far + 2 : len(poles)]
    beyond = []
    if len(outer):
        beyond.append((_swarm("power_poles_beyond", "power_pole", [pole], poses[outer]), [pole]))
    if away:
        meshes = [mesh for mesh, _ in away]
        beyond.append((_swarm("cables_beyond", "cable", meshes, np.array([pose for _, pose in away])), meshes))
    return PowerLine(poles, tuple(beyond))


def _free_places(site: Site, y: float, distance: float, far: int, rng: np.random.Generator) -> Array:
    """Places (2 far + 2, 2) of poles, those in the world where nothing else is."""
    for _ in range(_TRIES):
        middle, turn = rng.uniform([-4.0, y - 0.8], [4.0, y + 0.8]), rng.normal(0.0, 0.012)
        along = distance * (np.arange(2 * far + 2) - far - 0.5)
        spread = rng.normal(0.0, [0.8, 0.25], (len(along), 2))
        poles = middle + along[:, None] * [np.cos(turn), np.sin(turn)] + spread
        if all(site.is_free(float(a), float(b), POLE_ROOM) for a, b in poles[far : far + 2]):
            return np.asarray(poles)
    raise CrowdedWorldError(f"no two poles {distance} m apart stand free near y = {y} m; move the line or the routes")


def _swarm(name: str, kind: str, meshes: Sequence[Mesh], poses: Array) -> Swarm:
    """One thing for each pose; where there are several meshes, each is used once."""
    count = len(poses)
    return Swarm(
        name=name,
        kind=kind,
        object_id=0,  # known when all objects are
        meshes=tuple(mesh.name for mesh in meshes),
        mesh=(np.arange(count) % len(meshes)).astype(np.int32),
        world_from_object=poses,
        tint=np.ones((count, 3), np.float32),
    )

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures: articulated bodies, of rigid parts that turn about joints, and gaits, which move them from knot to knot.

The root of a figure on the ground is the point of the ground below its middle, x forward, z up; that of a flying one
is its middle. A gait is asked once for each knot of the motion (``sense.moving.KNOT_NS``), in their order. It knows
what was, and not what will be: an actor may react to the robot at any time. A foot that carries stays where it was put
down, until it is lifted.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Protocol

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.sense.moving import KNOT_NS
from fieldtruth.world.model import Collider, Material, Mesh

STEP: Final = KNOT_NS / 1e9
"""[s] between two knots."""
_OTHERS: Final = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}
"""Columns of a rotation that turn about an axis."""
Ground = Callable[[float, float], float]
"""Height [m] of the ground at x, y [m]."""


class Placement(NamedTuple):
    """Where an actor is to be at a knot, and what it does there."""

    x: float
    y: float
    """[m] in the world."""
    heading: float
    """[rad] about z, 0 along x."""
    speed: float
    """[m/s] along the heading."""
    height: float = 0.0
    """[m] of a flying one above the ground at x, y."""
    action: str = "walk"
    """walk (at any speed, also 0), sit, or graze (head down)."""


class Joint(NamedTuple):
    """A hinge of a part to its parent: at rest the part's frame is ``origin`` (3,) [m] in the parent's, not turned.

    ``axis`` is x, y or z of the part; several joints of equal part and parent turn one after the other.
    """

    name: str
    part: int
    parent: int
    """Row of the parent part; -1: the root."""
    origin: tuple[float, float, float]
    axis: str
    """x, y, z: an angle [rad]. lift: a height [m] along the parent's z."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """An articulated body. Meshes are in their part's frame; a part follows its parent in the list."""

    kind: str
    label: Label
    parts: tuple[Mesh, ...]
    joints: tuple[Joint, ...]
    materials: Mapping[str, Material]
    colliders: tuple[Collider, ...]
    """What a robot hits, in the root's frame."""
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Length, width and height [m] of its box, of which the base's middle (of a flying one the middle) is the root."""
    reach: float = 0.05
    """[m] by which limbs and wheels that move are outside of the box at most."""
    radius: float
    """[m] of the circle about the root that is its own on the ground."""
    speed: float
    """[m/s] at which it usually goes."""
    top_speed: float
    turn_radius: float = 0.0
    """[m] least radius of a curve of what rolls on wheels; 0: it turns on the spot."""
    flies: bool = False
    scale: float = 1.0
    """Of the lengths by which its gait knows it: stature [m] of a person, height of an animal's withers."""

    def poses(self, world_from_root: Array, angles: Array) -> Array:
        """Return world_from_part (n, parts, 4, 4) for poses (n, 4, 4) of the root and values (n, joints) of joints.

        A part without joints is fixed in the root.
        """
        found = np.repeat(np.asarray(world_from_root, np.float64)[:, None], len(self.parts), axis=1)
        cosine, sine = np.cos(angles)[..., None], np.sin(angles)[..., None]
        last = -1
        for row, (_, part, parent, origin, axis) in enumerate(self.joints):
            own = found[:, part]
            if part != last:
                if parent >= 0:
                    own[:] = found[:, parent]
                own[:, :3, 3] += own[:, :3, :3] @ np.array(origin)
                last = part
            if axis == "lift":
                own[:, :3, 3] += angles[:, row, None] * own[:, :3, 2]
                continue
            b, c = _OTHERS[axis]
            second, third = own[..., b].copy(), own[..., c].copy()
            own[..., b] = cosine[:, row] * second + sine[:, row] * third
            own[..., c] = cosine[:, row] * third - sine[:, row] * second
        return found


class Gait(Protocol):
    """Motion of one actor's limbs. Its state is all that it refers to, so that it can be copied and pickled."""

    def step(self, placement: Placement) -> tuple[Array, Array]:
        """Return world_from_root (4, 4) and the joints' values (joints,) at the next knot."""


class Kind(Protocol):
    """A kind of actor: makes figures and their gaits."""

    def figure(self, name: str, rng: np.random.Generator) -> Figure:
        """Return a body of random size and colours; the names of its meshes and materials begin with ``name``."""

    def gait(self, figure: Figure, placement: Placement, ground: Ground, rng: np.random.Generator) -> Gait:
        """Return the motion that begins at a placement, which is that of the first knot."""


def fitted(figure: Figure, kind: Kind) -> Figure:
    """Return a figure with the size of its box where it stands."""
    gait = kind.gait(figure, Placement(0.0, 0.0, 0.0, 0.0), lambda x, y: 0.0, np.random.default_rng(0))
    root, angles = gait.step(Placement(0.0, 0.0, 0.0, 0.0))
    poses = figure.poses(root[None], angles[None])[0]
    places = [mesh.vertices @ pose[:3, :3].T + pose[:3, 3] for mesh, pose in zip(figure.parts, poses, strict=True)]
    points = np.concatenate(places)
    length, width, height = (2 * np.abs(points).max(axis=0)).tolist()
    return replace(figure, size=(length, width, height if figure.flies else height / 2))

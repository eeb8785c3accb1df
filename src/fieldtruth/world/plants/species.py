# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers that make a kind of plant: how its stems branch, bend and taper, and what its leaves are like.

The parameters are those of Weber and Penn, "Creation and Rendering of Realistic Trees" (SIGGRAPH 1995), reduced to what
park plants need. Where they count branches per stem, we count those of the whole plant and give each stem its share by
length: so the number of triangles hardly differs between individuals.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

Outline = Literal["conical", "spherical", "hemispherical", "flame", "domed"]

_OUTLINES: Final[Mapping[Outline, Callable[[NDArray[np.float64]], NDArray[np.float64]]]] = {
    "conical": lambda r: 0.2 + 0.8 * r,
    "spherical": lambda r: 0.2 + 0.8 * np.sin(np.pi * r),
    "hemispherical": lambda r: 0.2 + 0.8 * np.sin(0.5 * np.pi * r),
    "flame": lambda r: 0.5 + 0.5 * np.where(r <= 0.7, r / 0.7, (1 - r) / 0.3),
    "domed": lambda r: 0.3 + 0.7 * np.sin(np.pi * (0.12 + 0.68 * r)),
}


def outline_ratio(outline: Outline, ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length of a limb relative to the longest, at ``ratio`` of the crown's depth: 1 at its base, 0 at its top.

    Weber and Penn's ShapeRatio (section 4.3; "flame" is their "tend flame"); "domed" is ours, for tall round crowns.
    """
    return _OUTLINES[outline](ratio)


@dataclass(frozen=True, kw_only=True)
class Order:
    """How the stems of one order grow on those of the order before: order 1 on the trunk, order 2 on the limbs, ...

    Pairs are (value at the foot, value at the tip): of the parent for ``angle``, of the stem itself for ``lift``.
    """

    number: int  # stems of this order on the whole plant before pruning, each parent's share by its length
    start: float = 0.0  # fraction of the parent's length below which none grows (order 1: see Habit.crown_base)
    length: float  # of the longest, relative to the parent's length (order 1: to the plant's height)
    length_spread: float = 0.15  # standard deviation of the logarithm
    angle: tuple[float, float]  # [deg] from the parent's axis
    angle_spread: float = 8.0  # [deg] standard deviation
    divergence: float = 137.5  # [deg] about the parent from one sibling to the next; 180: two ranks, left and right
    divergence_spread: float = 15.0  # [deg] standard deviation
    lift: tuple[float, float] = (0.0, 0.0)  # [rad per stem length] upward bending (down if negative)
    bend: float = 0.2  # [rad per stem length] standard deviation of one steady bend in any direction
    wander: float = 0.2  # [rad per stem length] standard deviation of the random walk of the direction
    thickness: float = 1.1  # radius relative to the parent's is the length relative to the parent's to this power
    collar: float = 0.25  # widening at the foot relative to the rest
    segments: int = 4  # per stem
    sides: int = 4  # of the tube
    foliage: float = 0.0  # leaves per length relative to other orders; 0: none
    leaf_start: float = 0.0  # fraction of the stem's length below which no leaf grows


@dataclass(frozen=True, kw_only=True)
class Leaf:
    """The form of a leaf: a kite of two triangles, folded along the midrib."""

    number: int  # on the whole plant before pruning
    length: float  # [m] of the blade, at ``Habit.height``
    width: float  # relative to the length
    size_spread: float = 0.18  # standard deviation of the logarithm
    widest: float = 0.4  # where along the midrib
    fold: float = 20.0  # [deg] by which each half rises from the plane
    stalk: float = 0.03  # [m]
    arrangement: float = 180.0  # [deg] about the twig from one leaf to the next
    droop: float = 0.5  # weight of "downwards" in the midrib's direction
    flatness: float = 1.0  # weight of "upwards" in the upper side's direction, against 1 for outwards


@dataclass(frozen=True, kw_only=True)
class Habit:
    """A way of growing at one stage of life."""

    height: float  # [m] of an individual with leaves of ``leaf.length``; they grow with the root of the height
    trunk_radius: float  # relative to the plant's height, at the ground without the root flare
    leader: float = 0.9  # length of the trunk relative to the plant's height
    clear: float  # [m] height below which only the trunk is: what dips below is pruned
    crown_base: float  # height of the lowest limb's foot relative to the plant's height
    outline: Outline
    lopsided: float = 0.15  # how much longer limbs are on the side of the light, relative
    trunk_lean: float = 2.0  # [deg] standard deviation
    trunk_wander: float = 0.12  # [rad per length]
    trunk_segments: int = 20
    trunk_sides: int = 14
    flare: float = 0.6  # widening at the ground relative to the trunk's radius
    stems: int = 1  # trunks from one root
    stem_splay: float = 0.0  # [deg] from upright of the outermost of several stems
    stem_circle: float = 0.0  # [m] radius of the circle in which several stems stand
    sheared: float = 0.0  # radius, relative to the height, of the dome to which it is clipped; 0: grows freely
    orders: tuple[Order, ...]
    leaf: Leaf


@dataclass(frozen=True, kw_only=True)
class Species:
    """A kind of plant: its materials, and its habits when grown and when young."""

    name: str
    latin: str
    wood: str  # name of the material
    foliage: str  # name of the material
    grown: Habit
    young: Habit | None = None
    young_below: float = 6.5  # [m] height below which the young habit applies

    def __str__(self) -> str:
        return self.name

    def habit(self, height: float) -> Habit:
        """The habit of an individual of this height [m]."""
        return self.young if self.young is not None and height < self.young_below else self.grown

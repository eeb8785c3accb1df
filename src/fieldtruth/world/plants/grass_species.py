# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of grasses and herbs: kinds of blades in one tuft, and the leaves, fronds and flowers on them.

Blades are up to twice as wide as in nature, and fewer by the same factor.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field


@dataclass(frozen=True, kw_only=True)
class Leaves:
    """Leaves or spikelets along a blade or stalk; sizes [m] hold at the species' mean height."""

    kind: Literal["leaves"] = "leaves"
    material: str
    number: int  # on each stalk
    length: float
    width: float
    start: float  # position of the lowest, fraction of the stalk
    end: float = 1.0  # position of the highest
    angle: float = 60.0  # [deg] from the stalk
    droop: float = 0.3  # weight of "down" in their direction
    arrangement: Literal["spiral", "pairs", "one side"] = "spiral"
    smallest: float = 0.5  # length of the highest relative to the lowest
    widest: float = 0.35  # position of the greatest width, fraction of the length
    broad: bool = False  # six triangles instead of two


@dataclass(frozen=True, kw_only=True)
class Frond:
    """Pinnae that make a blade a fern's frond."""

    kind: Literal["frond"] = "frond"
    material: str
    pairs: int
    length: float  # of the longest pinna, relative to the frond's
    start: float = 0.16  # position of the lowest pair, fraction of the frond


@dataclass(frozen=True, kw_only=True)
class Flower:
    """A disc at the tip of a stalk."""

    kind: Literal["flower"] = "flower"
    material: str
    radius: float  # [m]


@dataclass(frozen=True, kw_only=True)
class Spike:
    """A spindle about a stalk."""

    kind: Literal["spike"] = "spike"
    material: str
    radius: float  # [m]
    start: float  # fraction of the stalk
    end: float


Organ = Annotated[Leaves | Frond | Flower | Spike, Field(discriminator="kind")]


@dataclass(frozen=True, kw_only=True)
class Blades:
    """One kind of blades or stalks in a tuft; pairs of numbers are least and most."""

    material: str
    number: int
    length: tuple[float, float]  # along the midrib, relative to other kinds
    width: float  # [m] greatest, at the species' mean height
    lean: tuple[float, float]  # [deg] from vertical at the root, in the middle and at the rim of the tuft
    bend: tuple[float, float]  # [deg] by which the tip leans further than the root
    drift: float = 25.0  # [deg] standard deviation of the sweep to the side from root to tip
    roll: float = 40.0  # [deg] standard deviation of the turn about the midrib
    twist: float = 60.0  # [deg] standard deviation of the further turn from root to tip
    rim: float = 1.0  # radius, relative to the tuft's, within which they root
    kite: bool = False  # two triangles instead of six, for thin or short blades
    organs: tuple[Organ, ...] = ()


@dataclass(frozen=True, kw_only=True)
class GrassSpecies:
    """A species of grass or herb."""

    name: str
    latin: str
    height: tuple[float, float]  # [m] usual range
    radius: float  # [m] of the disc that a tuft roots in, at the mean height
    lopsided: float = 0.5  # weight of the direction in which a whole tuft leans, against 1 for outwards
    blades: tuple[Blades, ...]

    def __str__(self) -> str:
        return self.name

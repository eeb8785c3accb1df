# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Value types that the layouts of several environments share; text and booleans are not accepted as numbers."""

from collections.abc import Mapping
from itertools import product
from typing import Annotated, Any, ClassVar, Final, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.fields import Frozen, Integer, Number, Positive
from fieldtruth.world.environments.planting import Planter, check_plants
from fieldtruth.world.grids import BUILT_IN, Line, coarseness
from fieldtruth.world.materials import ISO_CLASSES, Roughness, roughness_of
from fieldtruth.world.seasons import SUMMER, USUAL, seasons

HILLS: Final = 0.2
"""Spacing [m] of the grid on which an environment shapes its hills; microrelief is added on that of the terrain."""
MOST: Final = 400
"""Objects of a kind in a built-in world, or in a smaller one, at most; larger ones have as many to the hectare."""

Size = Annotated[tuple[Positive, Positive], Field(description="[length, width], each a number above 0")]
Spacing = Annotated[Number, Field(ge=0.01, le=1)]
Count = Annotated[Integer, Field(ge=0, description="an integer between 0 and 400, or 800 to the hectare"), "area"]
"""Of objects; where it is not given it grows with the world's area."""
ShoreCount = Annotated[Integer, Field(ge=0, description="an integer between 0 and 400, or 800 to the hectare"), "shore"]
"""Of objects along a line across the world, along x; where it is not given it grows with the world's length."""
Density = Annotated[Number, Field(ge=0, le=20)]
Individuals = Annotated[Integer, Field(ge=1, le=32)]
Share = Annotated[Number, Field(ge=0, le=1)]
Corners = Annotated[tuple[tuple[Number, Number], ...], Field(min_length=2, description="a list of at least two [x, y]")]
Trails = Annotated[tuple[Corners, ...], Field(description="a list of lines, each a list of at least two [x, y]")]


class GroundConfig(Frozen):
    """Keys of all layouts: the size of the world, the terrain's grid and the roughness of its ground."""

    grounds: ClassVar[tuple[str, ...]]
    """Ground types of the environment."""

    environment: ClassVar[str] = ""
    """Name of the data file of its plants; empty without one."""

    size: Size = BUILT_IN  # [m] along x (north) and y (west)
    grid: Spacing = 0.05  # [m] between the terrain's nodes
    roughness: Mapping[str, str] = Field(default={}, description="classes A to H of ISO 8608 by ground type")
    season: str = Field(default=SUMMER, description="a season: spring, summer, autumn or winter")
    drought: Share = USUAL  # 0 lush .. 1 dry: colours of grass
    snow_depth: Annotated[Number, Field(ge=0, le=0.3)] = 0.0  # [m], mean in the open
    plants: Mapping[str, tuple[str, ...]] = Field(default={}, description="lists of species by group of plants")
    litter: Annotated[Number, Field(ge=0, le=4)] = 1.0  # amount of leaves, twigs, stones, short grass on the ground

    @field_validator("roughness")
    @classmethod
    def _known_classes(cls, classes: Mapping[str, str]) -> Mapping[str, str]:
        for name, letter in classes.items():
            if name not in cls.grounds:
                raise ValueError(f"unknown ground type {name!r}; {suggestion(name, cls.grounds)}")
            if letter not in ISO_CLASSES:
                raise ValueError(f"{name} must be one of the classes {', '.join(ISO_CLASSES)}, got {letter!r}")
        return classes

    @field_validator("plants")
    @classmethod
    def _known_plants(cls, plants: Mapping[str, tuple[str, ...]]) -> Mapping[str, tuple[str, ...]]:
        check_plants(cls.environment, plants)
        return plants

    @field_validator("season")
    @classmethod
    def _known_season(cls, season: str) -> str:
        if season not in seasons():
            raise ValueError(f"unknown season {season!r}; {suggestion(season, seasons())}")
        return season

    @model_validator(mode="after")
    def _not_too_many(self) -> Self:
        most = int(MOST * max(1.0, self._larger()))
        for name in self._counts():
            if getattr(self, name) > most:
                raise ValueError(f"{name} must be at most {most} in a world of this size, got {getattr(self, name)}")
        return self

    @property
    def spacing(self) -> float:
        """Distance [m] between the terrain's nodes: ``grid``, in a large world more if it is not given."""
        return self.grid if "grid" in self.model_fields_set else self.grid * coarseness(self.size)

    def for_size(self) -> Self:
        """The layout with counts, grid and trails that suit its size, where they are not given."""
        longer = self.size[0] / BUILT_IN[0]
        changes: dict[str, Any] = {"grid": self.spacing}
        for name, by in self._counts().items():
            changes[name] = round(getattr(self, name) * (longer if by == "shore" else self._larger()))
        if lines := getattr(self, "trails", ()):
            changes["trails"] = network(lines, self.size)
        return self.model_copy(update={k: v for k, v in changes.items() if k not in self.model_fields_set})

    def _larger(self) -> float:
        """Area relative to that of the built-in worlds."""
        return self.size[0] * self.size[1] / (BUILT_IN[0] * BUILT_IN[1])

    @classmethod
    def _counts(cls) -> dict[str, str]:
        """Names of the counts, with what they grow with."""
        grow = {name: [m for m in info.metadata if m in ("area", "shore")] for name, info in cls.model_fields.items()}
        return {name: found[0] for name, found in grow.items() if found}

    @property
    def planter(self) -> Planter:
        """Grows the plants of the environment, of the species that this layout names."""
        return Planter(self.environment, self.plants)

    def roughness_of(self, ground: str) -> Roughness:
        """Roughness of a ground type in this layout."""
        return roughness_of(ground, self.roughness)


def hills_spacing(size: tuple[float, float]) -> float:
    """Spacing [m] of the grid on which hills are shaped: ``HILLS``, or twice that of the terrain if it is larger."""
    return max(HILLS, 0.1 * coarseness(size))


def network(lines: Trails, size: tuple[float, float]) -> Trails:
    """Trails of a world of a size [m]: ``lines`` of a built-in one, in a larger one continued by their mirror images.

    Each line is cut at the edge of the built-in world and reflected there, again and again, so that trails go on.
    """
    cell = np.array(BUILT_IN)
    if (np.array(size) <= cell).all():
        return lines
    reach = [range(-k, k + 1) for k in np.ceil((np.array(size) / cell - 1.0) / 2.0).astype(int)]
    pieces = []
    for corners in lines:
        points = Line.through(corners).points
        rows = np.flatnonzero((np.abs(points) <= cell / 2).all(axis=1))
        piece = points[[*rows[:-20:40], rows[-1]]]
        for step in product(*reach):
            placed = piece * (-1.0) ** np.array(step) + cell * step
            if (np.abs(placed) < np.array(size) / 2).all(axis=1).any():
                pieces.append(tuple((float(x), float(y)) for x, y in placed))
    return tuple(pieces)

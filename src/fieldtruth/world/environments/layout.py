# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Value types that the layouts of several environments share; text and booleans are not accepted as numbers."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final

from pydantic import Field, field_validator

from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.rig import Frozen, Integer, Number, Positive
from fieldtruth.world.ground_types import ISO_CLASSES, Roughness, roughness_of

HILLS: Final = 0.2
"""Spacing [m] of the grid on which an environment shapes its hills; microrelief is added on that of the terrain."""

Size = Annotated[tuple[Positive, Positive], Field(description="[length, width], each a number above 0")]
Spacing = Annotated[Number, Field(ge=0.01, le=1)]
Count = Annotated[Integer, Field(ge=0, le=400)]
Density = Annotated[Number, Field(ge=0, le=20)]
Individuals = Annotated[Integer, Field(ge=1, le=32)]
Share = Annotated[Number, Field(ge=0, le=1)]
Corners = Annotated[tuple[tuple[Number, Number], ...], Field(min_length=2, description="a list of at least two [x, y]")]
Trails = Annotated[tuple[Corners, ...], Field(description="a list of lines, each a list of at least two [x, y]")]


class GroundConfig(Frozen):
    """What all layouts share: the size of the world, the terrain's grid and the roughness of its ground."""

    grounds: ClassVar[tuple[str, ...]]
    """Ground types of the environment."""

    size: Size = (100.0, 50.0)  # [m] along x (north) and y (west)
    grid: Spacing = 0.05  # [m] between the terrain's nodes
    roughness: Mapping[str, str] = Field(default={}, description="classes A to H of ISO 8608 by ground type")

    @field_validator("roughness")
    @classmethod
    def _known_classes(cls, classes: Mapping[str, str]) -> Mapping[str, str]:
        for name, letter in classes.items():
            if name not in cls.grounds:
                raise ValueError(f"unknown ground type {name!r}; {suggestion(name, cls.grounds)}")
            if letter not in ISO_CLASSES:
                raise ValueError(f"{name} must be one of the classes {', '.join(ISO_CLASSES)}, got {letter!r}")
        return classes

    def roughness_of(self, ground: str) -> Roughness:
        """Roughness of a ground type in this layout."""
        return roughness_of(ground, self.roughness)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout of a site: the files of its maps, where it is, and what grows where the maps say nothing."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator

from fieldtruth.core.errors import suggestion
from fieldtruth.core.geodesy import Origin
from fieldtruth.experiment.fields import Boolean, Frozen, Name, Number, Positive
from fieldtruth.world.environments.layout import Density, GroundConfig, Individuals, Share
from fieldtruth.world.plants import TREES

Latitude = Annotated[Number, Field(ge=-85, le=85)]
Longitude = Annotated[Number, Field(ge=-180, le=180)]


class MapFile(Frozen):
    """A file of a map, by its path, and the coordinate reference system of one that states none."""

    file: str
    crs: str | None = None

    @property
    def path(self) -> Path:
        """Path of the file."""
        return Path(self.file).expanduser()


class ElevationFile(MapFile):
    """Raster of heights, or laser points whose ground points have the class 2."""

    reference: Literal["ellipsoid", "geoid"] | None = None
    geoid_height: Annotated[Number, Field(ge=-120, le=100)] | None = None  # [m] above the ellipsoid


class TreesFile(MapFile):
    """Inventory of trees, raster of the canopy's height, or laser points."""

    columns: Mapping[str, str] = Field(default={}, description="names of columns of the file by x, y, height, ...")


class LandCoverFile(MapFile):
    """Raster of classes; their numbers by the use of the land. Others say nothing."""

    classes: Annotated[
        Mapping[int, Literal["lawn", "meadow", "forest_floor", "soil", "grass", "farmland", "heath", "scrub", "wood",
                             "orchard", "sand", "bare_rock", "scree", "wetland"]],
        Field(description="uses of the land, such as meadow or wood, by the raster's numbers"),
    ]  # fmt: skip


class Config(GroundConfig):
    """Layout of a site."""

    environment = "site"
    grounds = ("lawn", "meadow", "forest_floor", "earth", "gravel", "trodden_earth")

    name: Name = "site"  # of the world
    centre: Annotated[tuple[Latitude, Longitude], Field(description="[latitude, longitude], in degrees")]
    elevation: ElevationFile | None = None
    trees: TreesFile | None = None
    map: MapFile | None = None  # OpenStreetMap
    land_cover: LandCoverFile | None = None
    photo: MapFile | None = None  # from above, of the ground's colour
    species: Mapping[str, Share] = Field(
        default={"beech": 0.4, "spruce": 0.3, "oak": 0.15, "birch": 0.15},
        description="shares by species, each from 0 up to 1",
    )
    """Of trees whose species the maps do not say."""
    surface: Literal["lawn", "meadow", "forest_floor", "soil"] = "meadow"
    """Where the maps say nothing."""
    trees_per_m2: Annotated[Number, Field(ge=0, le=0.5)] = 0.05
    """In woods of map and land cover of which there are no trees."""
    trail_width: Positive = 1.6  # [m] of paths whose width the map does not say
    grass_per_m2: Density = 4.0
    individuals: Individuals = 3  # of each species and height
    beyond: Boolean = True

    @field_validator("species")
    @classmethod
    def _known(cls, species: Mapping[str, float]) -> Mapping[str, float]:
        for unknown in (name for name in species if name not in TREES):
            raise ValueError(f"unknown species {unknown!r}; {suggestion(unknown, sorted(TREES))}")
        if not sum(species.values()) > 0:
            raise ValueError(f"at least one share must be above 0. Available: {', '.join(sorted(TREES))}")
        return species

    @property
    def place(self) -> Origin:
        """Centre of the world, on the ellipsoid."""
        return Origin(*self.centre, 0.0)

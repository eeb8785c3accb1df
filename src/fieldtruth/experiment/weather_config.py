# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Weather of an experiment: what is in the air between a sensor and what it sees."""

from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from fieldtruth.experiment.fields import Frozen, Number

CLEAR_VISIBILITY_M: Final = 20_000.0
"""Meteorological optical range [m] of a clear summer day, where the international visibility code changes from clear
to very clear (Hulburt, J. Opt. Soc. Am. 31, 1941)."""


class WeatherConfig(Frozen):
    """Fog, rain, snow and dust, the same at all times; they add. Default: clear air.

    Cameras and LiDARs see it; a LiDAR with an ideal signal does not. See docs/weather.md.
    """

    visibility_m: Annotated[Number, Field(ge=5000, le=300_000)] = CLEAR_VISIBILITY_M
    """Meteorological optical range [m] of the air without fog, rain, snow and dust: haze of distant objects in
    photographs. The air itself, without aerosol, has about 300 km. LiDARs do not see it: their data sheets' ranges are
    those of clear air."""
    fog_visibility_m: Annotated[Number, Field(ge=10, le=5000)] | None = None
    """Meteorological optical range [m]: where a black object has 5 % contrast against the horizon (WMO-No. 8). Below
    1000 it is fog, above mist. None: no fog."""
    fog_height_m: Annotated[Number, Field(ge=1, le=500)] | None = None
    """Height [m] over which the fog thins to 1/e, above the lowest ground, where it has its visibility. None: as
    dense at every height."""
    rain_mm_h: Annotated[Number, Field(ge=0, le=200)] = 0.0
    """Rainfall rate [mm/h]: 2.5 light, 7.6 heavy (AMS Glossary of Meteorology)."""
    snow_mm_h: Annotated[Number, Field(ge=0, le=20)] = 0.0
    """Snowfall rate [mm/h of melted water]."""
    dust_g_m3: Annotated[Number, Field(ge=0, le=10)] = 0.0
    """Mass of dust in the air [g/m^3]."""

    @model_validator(mode="after")
    def _layer_of_fog(self) -> Self:
        if self.fog_height_m is not None and self.fog_visibility_m is None:
            raise ValueError("fog_visibility_m is required with fog_height_m")
        return self

    @property
    def text(self) -> str:
        """What is in the air, for people."""
        found = {"fog, visibility": self.fog_visibility_m, "rain": self.rain_mm_h, "snow": self.snow_mm_h}
        units = {"fog, visibility": "m", "rain": "mm/h", "snow": "mm/h", "dust": "g/m³"}
        if self.visibility_m != CLEAR_VISIBILITY_M:
            found, units = {"visibility": self.visibility_m, **found}, {"visibility": "m", **units}
        there = {name: value for name, value in (found | {"dust": self.dust_g_m3}).items() if value}
        return ", ".join(f"{name} {value:g} {units[name]}" for name, value in there.items()) or "clear air"

    @property
    def is_clear(self) -> bool:
        """Whether no fog, rain, snow or dust is in the air."""
        return not (self.fog_visibility_m or self.rain_mm_h or self.snow_mm_h or self.dust_g_m3)

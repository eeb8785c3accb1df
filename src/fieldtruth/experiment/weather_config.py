# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Weather of an experiment: what is in the air between a sensor and what it sees."""

from typing import Annotated

from pydantic import Field

from fieldtruth.experiment.fields import Frozen, Number


class WeatherConfig(Frozen):
    """Fog, rain, snow and dust, the same everywhere and at all times; they add. Default: clear air.

    Cameras and LiDARs see it; a LiDAR with an ideal signal does not. See docs/weather.md.
    """

    fog_visibility_m: Annotated[Number, Field(ge=10, le=5000)] | None = None
    """Meteorological optical range [m]: where a black object has 5 % contrast against the horizon (WMO-No. 8). Below
    1000 it is fog, above mist; 5400 in clear air. None: no fog."""
    rain_mm_h: Annotated[Number, Field(ge=0, le=200)] = 0.0
    """Rainfall rate [mm/h]: 2.5 light, 7.6 heavy (AMS Glossary of Meteorology)."""
    snow_mm_h: Annotated[Number, Field(ge=0, le=20)] = 0.0
    """Snowfall rate [mm/h of melted water]."""
    dust_g_m3: Annotated[Number, Field(ge=0, le=10)] = 0.0
    """Mass of dust in the air [g/m^3]."""

    @property
    def text(self) -> str:
        """What is in the air, for people."""
        found = {"fog, visibility": self.fog_visibility_m, "rain": self.rain_mm_h, "snow": self.snow_mm_h}
        units = {"fog, visibility": "m", "rain": "mm/h", "snow": "mm/h", "dust": "g/m³"}
        there = {name: value for name, value in (found | {"dust": self.dust_g_m3}).items() if value}
        return ", ".join(f"{name} {value:g} {units[name]}" for name, value in there.items()) or "clear air"

    @property
    def is_clear(self) -> bool:
        """Whether nothing is in the air."""
        return self == WeatherConfig()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light and weather of an experiment: where the sun is, what clouds there are, and what is in the air.

The sun's azimuth and elevation are right within 0.02 deg from 1950 to 2050: Meeus, Astronomical Algorithms (2nd
edition, 1998), chapters 7, 12, 13 and 25 (low accuracy), and the refraction of Bennett (1982, Journal of Navigation 35)
in the form of Saemundsson, which the book gives in chapter 16.
"""

import datetime
import re
from collections.abc import Mapping
from datetime import date
from math import asin, atan2, cos, degrees, radians, sin, tan
from typing import Annotated, Any, Final, Literal, NamedTuple, Self

from pydantic import Field, field_validator, model_validator

from fieldtruth.experiment.fields import Frozen, LocatedError, Number, shortened

_EPOCH: Final = date(2000, 1, 1)
_DELTA_T: Final = 70.0  # [s] of terrestrial time ahead of UTC, in 2020; a minute moves the sun by 0.7 arc seconds


def sun_position(day: date, hours: float, latitude: float, longitude: float) -> tuple[float, float]:
    """Return azimuth (clockwise from north, 0 to 360) and apparent elevation of the sun's centre [deg].

    Args:
        day: date in UTC.
        hours: time of the day in UTC [h]; may be outside 0 to 24.
        latitude: north is positive [deg].
        longitude: east is positive [deg].
    """
    days = (day - _EPOCH).days - 0.5 + hours / 24.0  # since noon of 1 January 2000
    ascension, declination = _equatorial((days + _DELTA_T / 86400.0) / 36525.0)
    centuries = days / 36525.0
    sidereal = 280.46061837 + 360.98564736629 * days + 0.000387933 * centuries**2
    angle = radians(sidereal + longitude) - ascension  # west of the meridian
    phi = radians(latitude)
    up = sin(phi) * sin(declination) + cos(phi) * cos(declination) * cos(angle)
    south = sin(phi) * cos(declination) * cos(angle) - cos(phi) * sin(declination)
    west = cos(declination) * sin(angle)
    return degrees(atan2(-west, -south)) % 360.0, _refracted(degrees(asin(max(-1.0, min(1.0, up)))))


def _equatorial(t: float) -> tuple[float, float]:
    """Apparent right ascension and declination [rad] after ``t`` Julian centuries from J2000."""
    mean = 280.46646 + 36000.76983 * t + 0.0003032 * t * t
    anomaly = radians(357.52911 + 35999.05029 * t - 0.0001537 * t * t)
    centre = (1.914602 - 0.004817 * t) * sin(anomaly) + 0.019993 * sin(2 * anomaly) + 0.000289 * sin(3 * anomaly)
    node = radians(125.04 - 1934.136 * t)
    longitude = radians(mean + centre - 0.00569 - 0.00478 * sin(node))
    obliquity = radians(23.4392911 - 0.0130042 * t + 0.00256 * cos(node))
    return atan2(cos(obliquity) * sin(longitude), cos(longitude)), asin(sin(obliquity) * sin(longitude))


def _refracted(elevation: float) -> float:
    """Apparent elevation [deg] of a true one; far below the horizon air makes no difference."""
    if elevation < -1.5:
        return elevation
    return elevation + 1.02 / tan(radians(elevation + 10.3 / (elevation + 5.11))) / 60.0


CloudKind = Literal["none", "cumulus", "broken", "cirrus", "stratus", "overcast"]
Preset = Literal["summer_day", "clear_morning", "noon", "low_sun", "dusk", "overcast", "after_rain", "fog"]
LOWEST_SUN: Final = -6
"""[deg] elevation at the end of civil twilight."""


class Light(NamedTuple):
    """A light with every value."""

    azimuth_deg: float
    elevation_deg: float
    clouds: CloudKind
    cover: float
    turbidity: float
    wetness: float


PRESETS: Final[dict[Preset, Light]] = {
    "summer_day": Light(118.0, 41.0, "cumulus", 0.25, 2.6, 0.0),
    "clear_morning": Light(94.0, 24.0, "none", 0.0, 2.2, 0.1),
    "noon": Light(178.0, 62.0, "cumulus", 0.2, 2.8, 0.0),
    "low_sun": Light(272.0, 7.0, "cirrus", 0.5, 2.6, 0.0),
    "dusk": Light(304.0, -3.0, "cirrus", 0.4, 2.4, 0.0),
    "overcast": Light(160.0, 42.0, "overcast", 1.0, 3.0, 0.1),
    "after_rain": Light(225.0, 33.0, "broken", 0.6, 1.8, 0.8),
    "fog": Light(110.0, 18.0, "stratus", 1.0, 5.0, 0.5),
}
_CLOCK: Final = re.compile(r"([01]?\d|2[0-3]):([0-5]\d)(?:([+-])([01]?\d):([0-5]\d))?")
_TIME: Final = 'hours of UTC such as 13.5, or a text such as "15:30+02:00"'


class LightConfig(Frozen):
    """Sun, clouds and haze; what is not given is the preset's. ``light: low_sun`` means ``{preset: low_sun}``.

    The sun is given either by its direction or by date, time and position. See docs/light.md.
    """

    preset: Preset = "summer_day"
    sun_azimuth_deg: Annotated[Number, Field(ge=-360, le=360)] | None = None
    """Clockwise from north."""
    sun_elevation_deg: Annotated[Number, Field(ge=LOWEST_SUN, le=90)] | None = None
    """Apparent elevation of the sun's centre; below 0 the sky alone gives light."""
    date: Annotated[str, Field(description="a date such as 2026-06-21")] | None = None
    time: Annotated[Number, Field(ge=-14, le=38, description=_TIME)] | None = None
    """Hours of UTC; a text may have its offset from UTC."""
    latitude: Annotated[Number, Field(ge=-90, le=90)] = 49.9
    longitude: Annotated[Number, Field(ge=-180, le=180)] = 8.9
    """Position for which date and time give the sun; it moves nothing else."""
    clouds: CloudKind | None = None
    cover: Annotated[Number, Field(ge=0, le=1)] | None = None
    """Share of the sky with clouds, of cumulus, broken and cirrus."""
    turbidity: Annotated[Number, Field(ge=1.2, le=10)] | None = None
    """Optical depth of the air over that of its molecules: 2 clear, 4 hazy, 8 very hazy."""
    wetness: Annotated[Number, Field(ge=0, le=1)] | None = None
    """Of the ground: 0 dry, 1 wet."""

    @model_validator(mode="before")
    @classmethod
    def _from_word(cls, given: Any) -> Any:
        return {"preset": given} if isinstance(given, str) else given

    @field_validator("date", mode="before")
    @classmethod
    def _iso(cls, given: Any) -> Any:
        """YAML reads 2026-06-21 as a date."""
        return given.isoformat() if type(given) is datetime.date else given

    @field_validator("date")
    @classmethod
    def _exists(cls, given: str | None) -> str | None:
        if given is not None:
            try:
                datetime.date.fromisoformat(given)
            except ValueError:
                raise LocatedError(f"must be a date such as 2026-06-21, got {shortened(given)}", []) from None
        return given

    @field_validator("time", mode="before")
    @classmethod
    def _hours(cls, given: Any) -> Any:
        """Convert a time of the day to hours; YAML reads 13:30 as 810, the minutes."""
        if type(given) is int and given >= 60:
            return given / 60.0
        found = _CLOCK.fullmatch(given) if isinstance(given, str) else None
        if found is None:
            return given
        hour, minute, sign, hours, minutes = found.groups()
        ahead = int(hours) + int(minutes) / 60.0 if sign else 0.0
        return int(hour) + int(minute) / 60.0 + (ahead if sign == "-" else -ahead)

    @model_validator(mode="after")
    def _one_sun(self) -> Self:
        timed = self.date is not None or self.time is not None
        if timed and (self.sun_azimuth_deg is not None or self.sun_elevation_deg is not None):
            raise ValueError("date and time exclude sun_azimuth_deg and sun_elevation_deg: they give the sun")
        if timed and (self.date is None or self.time is None):
            raise ValueError(f"date and time need each other: a date such as 2026-06-21, and {_TIME}")
        if timed and (found := self.values.elevation_deg) < LOWEST_SUN:
            what = f"must be one with the sun at {LOWEST_SUN:g} deg or higher; it is at {found:.1f} deg then"
            raise LocatedError(what, ["time"])
        return self

    @property
    def values(self) -> Light:
        """Every value, of the preset where none is given."""
        preset = PRESETS[self.preset]
        azimuth, elevation = self._sun(preset)
        given: Mapping[str, Any] = {"clouds": self.clouds, "turbidity": self.turbidity, "wetness": self.wetness}
        kind = self.clouds or preset.clouds
        cover = self.cover if self.cover is not None else preset.cover if kind == preset.clouds else COVERS[kind]
        found = preset._replace(azimuth_deg=azimuth, elevation_deg=elevation, cover=cover)
        return found._replace(**{key: value for key, value in given.items() if value is not None})

    @property
    def text(self) -> str:
        """Preset and clouds, for people."""
        found = self.values
        part = f", {100 * found.cover:g} %" if 0.0 < found.cover < 1.0 else ""
        return f"{self.preset}, clouds: {found.clouds}{part}"

    def _sun(self, preset: Light) -> tuple[float, float]:
        if self.date is not None and self.time is not None:
            day = datetime.date.fromisoformat(self.date)
            return sun_position(day, self.time, self.latitude, self.longitude)
        azimuth, elevation = self.sun_azimuth_deg, self.sun_elevation_deg
        return (
            preset.azimuth_deg if azimuth is None else azimuth,
            preset.elevation_deg if elevation is None else elevation,
        )


COVERS: Final[dict[CloudKind, float]] = {
    "none": 0.0,
    "cumulus": 0.25,
    "broken": 0.7,
    "cirrus": 0.5,
    "stratus": 1.0,
    "overcast": 1.0,
}
"""Share of the sky with clouds of a kind that differs from the preset's, unless ``cover`` is given."""
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
        """Fog, rain, snow and dust in words."""
        found = {"fog, visibility": self.fog_visibility_m, "rain": self.rain_mm_h, "snow": self.snow_mm_h}
        units = {"fog, visibility": "m", "rain": "mm/h", "snow": "mm/h", "dust": "g/m³"}
        if self.visibility_m != CLEAR_VISIBILITY_M:
            found, units = {"visibility": self.visibility_m, **found}, {"visibility": "m", **units}
        there = {name: value for name, value in (found | {"dust": self.dust_g_m3}).items() if value}
        return ", ".join(f"{name} {value:g} {units[name]}" for name, value in there.items()) or "clear air"

    @property
    def is_clear(self) -> bool:
        """True if no fog, rain, snow or dust is in the air."""
        return not (self.fog_visibility_m or self.rain_mm_h or self.snow_mm_h or self.dust_g_m3)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a GNSS receiver, and the figures of its signal, each without effect by default."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import AfterValidator, AwareDatetime, Field, model_validator

from fieldtruth.core.readings import Fix, Reading
from fieldtruth.experiment.fields import Boolean, Integer, Mount, Number, Rate
from fieldtruth.experiment.sensor_config import (
    FrameName,
    MountedConfig,
    Output,
    Section,
    SensorName,
    SignalConfig,
    TopicName,
)

ALMANAC: Final = datetime(2026, 7, 26, 17, 3, 42, tzinfo=UTC)
"""Time of the stored almanac."""
_VALID: Final = timedelta(days=180)


def _near_almanac(utc: datetime) -> datetime:
    if abs(utc - ALMANAC) > _VALID:
        raise ValueError(f"must lie within {_VALID.days} days of the almanac, {ALMANAC:%Y-%m-%d}")
    return utc


Metres = Annotated[Number, Field(ge=0, le=1000)]
Seconds = Annotated[Number, Field(ge=0, le=1e6)]
Decibels = Annotated[Number, Field(ge=0, le=100)]
Duration = Annotated[Number, Field(gt=0, le=1e6)]
System = Annotated[Literal["gps", "galileo"], Field(description="gps or galileo")]
SERVICE: Final = {"gps": 1, "galileo": 8}
"""Satellite systems, of sensor_msgs/NavSatStatus."""


class GnssSignal(SignalConfig):
    """Satellites, obstacles and errors of a receiver; see docs/gnss.md.

    The error of the range to a satellite is the sum of three. ``range_sigma_m`` remains of atmosphere, orbit and clock:
    at the zenith, more towards the horizon, and correlated over ``range_tau_s``. ``multipath_sigma_m`` comes from
    reflections, correlated over ``multipath_tau_s``, and ``white_sigma_m`` from thermal noise: both hold at 45 dB-Hz
    and grow as the amplitude of the signal falls.
    """

    mode: Literal["single", "sbas", "rtk"] = "single"
    """Receiver alone, with corrections by satellite, or with those of a base station for the carrier's phase."""
    utc: Annotated[
        AwareDatetime,
        AfterValidator(_near_almanac),
        Field(description="a time with its zone, like 2026-07-27T08:20:00Z"),
    ] = datetime(2026, 7, 27, 8, 20, tzinfo=UTC)
    """Time at simulated time 0."""
    constellations: Annotated[tuple[System, ...], Field(min_length=1, description="a list of gps, galileo")] = ("gps",)
    obstacles: Boolean = False
    """True if ground, hills, trunks and crowns block or weaken signals."""
    elevation_mask_deg: Annotated[Number, Field(ge=0, le=80)] = 0.0
    """Satellites below are not used."""
    pdop_max: Annotated[Number, Field(gt=0)] = 1e6
    """There is no fix above."""

    cn0_zenith_dbhz: Decibels = 48.0
    cn0_horizon_dbhz: Decibels = 38.0
    """Carrier-to-noise density ratio in the open at the zenith and at the horizon [dB-Hz]."""
    cn0_min_dbhz: Decibels = 0.0
    """Weaker satellites are not used."""
    leaf_db: Decibels = 0.0
    """Attenuation of every leaf surface that a ray crosses [dB]."""

    range_sigma_m: Metres = 0.0
    range_tau_s: Duration = 1800.0
    multipath_sigma_m: Metres = 0.0
    multipath_tau_s: Duration = 20.0
    white_sigma_m: Metres = 0.0

    filter_s: Seconds = 0.0
    """Time over which the receiver averages its solutions, less its motion."""

    rtk_float_sigma_m: Metres = 0.0
    """Error of a range while ambiguities are not whole numbers; correlated over ``multipath_tau_s``."""
    rtk_fixed_sigma_m: Metres = 0.0
    """The same when they are."""
    rtk_white_sigma_m: Metres = 0.0
    rtk_cn0_min_dbhz: Decibels = 0.0
    """The phase of weaker satellites cannot be followed."""
    rtk_min_satellites: Annotated[Integer, Field(ge=4, le=100)] = 4
    """With fewer whose phase is followed the ambiguities are lost."""
    rtk_losses_per_hour: Annotated[Number, Field(ge=0, le=3600)] = 0.0
    """Losses for other reasons."""
    rtk_fix_s: Seconds = 0.0
    """Time until they are found again, and until the phase of a satellite that was too weak is of use."""
    link_losses_per_hour: Annotated[Number, Field(ge=0, le=3600)] = 0.0
    """Losses of the corrections; the receiver is alone until they return."""
    link_loss_s: Seconds = 0.0
    """Mean duration of that."""

    @model_validator(mode="after")
    def _once(self) -> Self:
        if len(set(self.constellations)) < len(self.constellations):
            raise ValueError("constellations must differ")
        return self

    @property
    def service(self) -> int:
        """Its satellite systems, of sensor_msgs/NavSatStatus."""
        return sum(SERVICE[system] for system in self.constellations)

    @property
    def is_exact(self) -> bool:
        """Return whether every position is the true one."""
        sigmas = [self.range_sigma_m, self.multipath_sigma_m, self.white_sigma_m]
        if self.mode == "rtk":
            sigmas += [self.rtk_float_sigma_m, self.rtk_fixed_sigma_m, self.rtk_white_sigma_m]
        return not any(sigmas)


class GnssConfig(MountedConfig):
    """GNSS receiver; the mount is that of its antenna, by default the paper's GNSS_link."""

    topic_of_name: ClassVar[str] = "/{}/fix"
    noun: ClassVar[str] = "GNSS receiver"
    gives: ClassVar[type[Reading]] = Fix
    sees: ClassVar[bool] = False
    in_hull: ClassVar[bool] = False
    bag_order: ClassVar[float] = 2
    frame_order: ClassVar[float] = 1

    sections: ClassVar[Mapping[str, Section]] = {"gnss": Section()}
    datasheet: ClassVar[str] = "duro"

    kind: Literal["gnss"] = "gnss"
    name: SensorName = "gnss"
    topic: TopicName = "/navsat/fix"
    frame: FrameName = "GNSS_link"
    mount: Mount = Mount(xyz=(0.10, 0.0, 0.890))
    rate_hz: Rate = 2.0
    signal: GnssSignal | None = None

    def summary(self) -> str:
        """Return rate and frame."""
        return f"{self.rate_hz:g} Hz, antenna at `{self.frame}`."

    def outputs(self) -> tuple[Output, ...]:
        """Its positions, and the ideal ones if it is not ideal."""
        return self.with_truth(self.output(self.new_topic(self.topic, "sensor_msgs/msg/NavSatFix"), reading=Fix))

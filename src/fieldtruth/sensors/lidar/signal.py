# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of a real LiDAR: what its receiver sees, how exact it is, and how wide its beam is."""

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from fieldtruth.experiment.fields import Integer, Number, Positive, Range
from fieldtruth.experiment.signal_config import SignalConfig

MOST_SUB_RAYS: Final = 15
MOST_STEPS: Final = 8
Reflectance = Annotated[Number, Field(gt=0, le=2)]
Deviation = Annotated[Number, Field(ge=0, le=10)]
Returns = Literal["strongest", "last", "two"]
SubRays = Annotated[Integer, Field(ge=1, le=MOST_SUB_RAYS)]


class LidarSignal(SignalConfig):
    """Power, noise and beam of a LiDAR.

    The signal is counted in photons, whose number varies with its own square root (Poisson), and falls with the square
    of the range (``noise``). A pulse returns if at least ``signal_at_reach`` photons are counted.
    """

    reach: Annotated[
        tuple[tuple[Reflectance, Range], ...],
        Field(max_length=MOST_STEPS, description="a list of pairs [reflectance, range in metres]"),
    ] = ()
    """Range [m] at which half of the pulses return from a matt surface of a reflectance that faces the LiDAR.

    Of several pairs the mean in logarithm counts, as all of them follow from one figure. None: every pulse returns.
    """
    signal_at_reach: Positive = 12.0
    """Photons of a pulse from the end of the reach, and the least that are taken for a return."""
    range_noise: Annotated[
        tuple[tuple[Positive, Deviation], ...],
        Field(max_length=MOST_STEPS, description="a list of pairs [signal, standard deviation in metres]"),
    ] = ()
    """Standard deviation [m] of a range by signal [photon], rising signals; between them both logarithms are linear."""
    resolution: Annotated[Number, Field(ge=0, le=10)] = 0.0
    """Step [m] of the ranges that it reports. 0: none."""
    angle_noise_deg: Annotated[Number, Field(ge=0, le=5)] = 0.0
    """Standard deviation of the angles that it reports, across and along the ring."""
    divergence_deg: Annotated[Number, Field(ge=0, le=5)] = 0.0
    """Angle in which the beam has more than half of its greatest irradiance (FWHM); used with ``sub_rays``."""
    sub_rays: SubRays = 1
    """Rays that stand for the width of one beam: 1, or an odd number: one in the middle and a ring around it."""
    returns: Returns = "strongest"
    """Which echoes of a pulse are points: the strongest, the last, or two: the strongest and the last of the others."""
    pulse_length: Annotated[Number, Field(ge=0, le=100)] = 0.0
    """Distance [m] within which echoes of a pulse merge into one."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.sub_rays % 2 == 0:
            raise ValueError(f"sub_rays must be an odd number, got {self.sub_rays}")
        if self.sub_rays > 1 and self.divergence_deg == 0.0:
            raise ValueError(f"divergence_deg must be above 0 with {self.sub_rays} sub_rays, got 0")
        signals = [signal for signal, _ in self.range_noise]
        if sorted(set(signals)) != signals:
            raise ValueError(f"range_noise must have rising signals, got {', '.join(f'{s:g}' for s in signals)}")
        if any(deviation == 0.0 for _, deviation in self.range_noise):
            raise ValueError("range_noise must have deviations above 0; leave it out for exact ranges")
        return self

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of real wheel encoders; ``noise.py`` states what they do to angles, speeds and odometry."""

from typing import Annotated

from pydantic import Field

from fieldtruth.experiment.fields import Integer, Number
from fieldtruth.experiment.signal_config import SignalConfig


class WheelSignal(SignalConfig):
    """Real encoders, and wheels whose radii the robot does not know exactly."""

    counts_per_revolution: Annotated[Integer, Field(ge=1, le=10**9)] | None = None
    """Steps of an encoder in one turn of its wheel; None: continuous angles."""
    radius_error: Annotated[Number, Field(ge=0, le=0.2)] = 0.0
    """Standard deviation of the share by which the radius of each wheel differs from the one that the robot assumes."""

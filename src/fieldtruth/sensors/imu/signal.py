# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of a real inertial measurement unit: the noise, bias, scale, range and resolution of its two triads.

The names are those of Kalibr where it has one (its wiki, "IMU Noise Model"); the processes are those of IEEE Std 952,
annex C. ``noise.py`` states the formulas.
"""

from typing import Annotated

from pydantic import Field

from fieldtruth.experiment.fields import Boolean, Number, Positive
from fieldtruth.experiment.signal_config import SignalConfig

NotNegative = Annotated[Number, Field(ge=0)]
Share = Annotated[Number, Field(ge=0, le=0.5)]
Angle = Annotated[Number, Field(ge=0, le=0.5)]  # [rad]; the law of small angles
Axes = Annotated[
    NotNegative | tuple[NotNegative, NotNegative, NotNegative],
    Field(description="a number >= 0, or three of them for the axes x, y and z"),
]
"""A figure of all three axes, or one of each."""


class ImuSignal(SignalConfig):
    """A real IMU. Figures without a range are standard deviations of what is drawn once for each axis of a run.

    A reading is made of the true one in this order: scale and misalignment, bias, white noise, range, resolution.
    """

    gyroscope_noise_density: Axes = 0.0  # [rad/s/sqrt(Hz)], angle random walk
    gyroscope_random_walk: Axes = 0.0  # [rad/s^2/sqrt(Hz)], of the bias
    gyroscope_bias_instability: Axes = 0.0  # [rad/s], lowest point of the Allan deviation, as data sheets state it
    gyroscope_bias: Axes = 0.0  # [rad/s], when it is turned on
    gyroscope_scale_error: Share = 0.0
    gyroscope_misalignment: Angle = 0.0  # [rad], of each axis towards each other axis
    gyroscope_range: Positive | None = None  # [rad/s], greatest reading of either sign
    gyroscope_resolution: Positive | None = None  # [rad/s], readings are multiples of it
    accelerometer_noise_density: Axes = 0.0  # [m/s^2/sqrt(Hz)], velocity random walk
    accelerometer_random_walk: Axes = 0.0  # [m/s^3/sqrt(Hz)], of the bias
    accelerometer_bias_instability: Axes = 0.0  # [m/s^2], as that of the gyroscope
    accelerometer_bias: Axes = 0.0  # [m/s^2], when it is turned on
    accelerometer_scale_error: Share = 0.0
    accelerometer_misalignment: Angle = 0.0  # [rad]
    accelerometer_range: Positive | None = None  # [m/s^2]
    accelerometer_resolution: Positive | None = None  # [m/s^2]
    roll_pitch_error: Angle = 0.0  # [rad], of the attitude about the horizontal axes of the world
    yaw_error: Angle = 0.0  # [rad], of the attitude about the vertical
    attitude_correlation_s: Positive = 30.0
    """Time [s] after which an error of the attitude is forgotten to 1/e; no data sheet states it, so it is our choice:
    the order of the time in which an AHRS corrects its gyroscopes by gravity and magnetic field."""
    no_attitude: Boolean = False
    """Whether the sensor gives no attitude: ROS marks it by -1 as first number of its covariance."""

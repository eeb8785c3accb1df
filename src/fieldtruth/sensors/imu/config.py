# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of an inertial measurement unit, and the noise, bias, scale, range and resolution of a real one.

Figures have the names of Kalibr where it has one (its wiki, "IMU Noise Model"); the processes are those of IEEE Std
952, annex C. docs/imu_signal.md states the formulas.

Kalibr refuses a noise of zero (``ConfigReader.py``, ``checkGyroStatistics``), and knows neither bias instability nor
axes. So of three densities the largest is written, and where there is no random walk, one that is as large as the bias
instability: its Allan deviation K sqrt(tau / 3) meets the flat bottom B at the averaging time (N / B)^2 at which white
noise does, K = sqrt(3) B^2 / N. Where a sensor has neither, or no noise at all, ``LEAST`` is written.
"""

import math
import warnings
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.core.readings import Inertial, Reading
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.experiment.fields import Boolean, Mount, Number, Positive, Rate
from fieldtruth.experiment.sensor_config import (
    FrameName,
    MountedConfig,
    Output,
    Section,
    SensorName,
    SignalConfig,
    TopicName,
)

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
    """True if the sensor gives no attitude: ROS marks it by -1 as first number of its covariance."""


LEAST: Final = 1e-6
"""Written for Kalibr instead of zero, in the unit of the key: less than any IMU has, and enough to divide by."""
_UNITS: Final = {
    "accelerometer_noise_density": "m/s^2/sqrt(Hz)",
    "accelerometer_random_walk": "m/s^3/sqrt(Hz)",
    "gyroscope_noise_density": "rad/s/sqrt(Hz)",
    "gyroscope_random_walk": "rad/s^2/sqrt(Hz)",
}
_SAMPLING: Final = {
    "mean": "reads means over the interval that ends at the stamp, from the motion at 1 kHz: turns about all\n"
    "  axes are added up as rotations, and the specific force is expressed in `{frame}` at the stamp.",
    "instant": "reads the last millisecond before each stamp: what shakes faster than half its rate appears\n"
    "  as slower motion.",
}
_SHORT: Final = {"mean": "means between stamps", "instant": "the last millisecond before each stamp"}


class ImuConfig(MountedConfig):
    """Inertial measurement unit; by default the paper's, in imu_link."""

    topic_of_name: ClassVar[str] = "/{}/data"
    noun: ClassVar[str] = "IMU"
    gives: ClassVar[type[Reading]] = Inertial
    sees: ClassVar[bool] = False
    bag_order: ClassVar[float] = 1
    frame_order: ClassVar[float] = 4

    sections: ClassVar[Mapping[str, Section]] = {"imu": Section()}
    datasheet: ClassVar[str] = "3dm_gx5_25"

    kind: Literal["imu"] = "imu"
    name: SensorName = "imu"
    topic: TopicName = "/imu/data"
    frame: FrameName = "imu_link"
    mount: Mount = Mount(xyz=(0.19, 0.0, 0.149), rpy_deg=(0.0, -90.0, 180.0))
    rate_hz: Rate = 50.0
    sampling: Annotated[Literal["mean", "instant"], Field(description="mean or instant")] = "mean"
    """mean: over the interval between two readings, so that integrating gives the motion; instant: over the physics
    step that ends at the stamp, as in Gazebo."""
    signal: ImuSignal | None = None

    def figures(self) -> str:
        """Return how it samples the motion."""
        return "mean over the interval" if self.sampling == "mean" else "at the instant"

    def summary(self) -> str:
        """Return rate, frame and sampling."""
        return f"{self.rate_hz:g} Hz in `{self.frame}`, {_SHORT[self.sampling]}."

    def notes(self, named: str) -> list[str]:
        """Return how it samples the motion."""
        return [f"{named} {_SAMPLING[self.sampling].format(frame=self.frame)}"]

    def kalibr(self) -> str:
        """Return the text of Kalibr's imu.yaml."""
        comments = [f"Kalibr's imu.yaml of {self.name}, frame {self.frame}"]
        noise: dict[str, float] = {}
        for triad in ("accelerometer", "gyroscope"):
            figures = (f"{triad}_{name}" for name in ("noise_density", "random_walk", "bias_instability"))
            density, walk, bottom = (_largest(getattr(self.signal or ImuSignal(), name)) for name in figures)
            if not walk and bottom and density:
                walk = math.sqrt(3.0) * bottom**2 / density
                comments.append(f"{triad}_random_walk stands for the bias instability, {bottom:.3g}")
            noise |= {f"{triad}_noise_density": density, f"{triad}_random_walk": walk}
        if zeros := [key for key, value in noise.items() if value < LEAST]:
            what = f"{self.name}: {', '.join(zeros)} below {LEAST:g}, which Kalibr needs and which is written instead"
            warnings.warn(what, FieldtruthWarning, stacklevel=3)
            comments.append(what)
        data: dict[str, Any] = {"rostopic": self.topic, "update_rate": self.rate_hz}
        data |= {key: max(value, LEAST) for key, value in noise.items()}
        lines = write_mapping(data).splitlines()
        units = [f"{line}  # {_UNITS[key]}" if (key := line.split(":")[0]) in _UNITS else line for line in lines]
        return "".join(f"# {comment}\n" for comment in comments) + "\n".join(units) + "\n"

    def outputs(self) -> tuple[Output, ...]:
        """Its readings, and the ideal ones if it is not ideal."""
        return self.with_truth(self.output(self.new_topic(self.topic, "sensor_msgs/msg/Imu"), reading=Inertial))


def _largest(figure: float | tuple[float, ...]) -> float:
    """Return that of the axis with the largest."""
    return max(figure) if isinstance(figure, tuple) else figure

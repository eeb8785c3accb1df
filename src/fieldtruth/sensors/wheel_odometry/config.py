# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of wheel odometry: encoders, what the robot's driver computes from them, and figures of real ones.

docs/imu_signal.md states what the figures do to angles, speeds and odometry.
"""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Literal

from pydantic import Field

from fieldtruth.core.readings import Joints, Odometry, Reading, WheelSpeeds
from fieldtruth.experiment.fields import Boolean, Frozen, Integer, Number, Rate
from fieldtruth.experiment.robot_config import WHEELS, RobotConfig
from fieldtruth.experiment.sensor_config import (
    BASE,
    ODOM,
    Output,
    Section,
    SensorConfig,
    SensorName,
    SignalConfig,
    TopicName,
)


class WheelSignal(SignalConfig):
    """Real encoders, and wheels whose radii the robot does not know exactly."""

    counts_per_revolution: Annotated[Integer, Field(ge=1, le=10**9)] | None = None
    """Steps of an encoder in one turn of its wheel; None: continuous angles."""
    radius_error: Annotated[Number, Field(ge=0, le=0.2)] = 0.0
    """Standard deviation of the share by which the radius of each wheel differs from the one that the robot assumes."""


WHEEL_SPEEDS: Final = tuple(f"/gazebo_client/{wheel}_speed" for wheel in WHEELS)
JOINT_STATES: Final = "/joint_states"


class TachometerSection(Frozen):
    """Tachometers of the four wheels, in the short form of a rig."""

    enabled: Boolean = True
    rate_hz: Rate = 10.0


class OdometrySection(Frozen):
    """Wheel odometry and joint states, in the short form of a rig."""

    rate_hz: Rate = 50.0


class WheelOdometryConfig(SensorConfig):
    """Speeds of the wheels, joint states and wheel odometry; a rig has one of these or none."""

    noun: ClassVar[str] = "wheel encoders"
    gives: ClassVar[type[Reading]] = Odometry
    sees: ClassVar[bool] = False
    needs_wheels: ClassVar[bool] = True
    bag_order: ClassVar[float] = 3

    sections: ClassVar[Mapping[str, Section]] = {
        "tachometers": Section(TachometerSection, {"rate_hz": "tachometer_rate_hz"}),
        "odometry": Section(OdometrySection),
    }
    datasheet: ClassVar[str] = "husky_a200"

    kind: Literal["wheel_odometry"] = "wheel_odometry"
    name: SensorName = "wheel_odometry"
    topic: TopicName = "/odometry/wheel"
    rate_hz: Rate = 50.0  # of odometry and joint states; husky_control, control.yaml
    tachometer_rate_hz: Rate = 10.0  # of the wheels' speeds
    signal: WheelSignal | None = None

    def outputs(self) -> tuple[Output, ...]:
        """Wheel speeds, joint states and odometry; a robot with two wheels has the first two speeds only.

        The ideal ones follow if it is not ideal.
        """
        speeds = [self.new_topic(name, "std_msgs/msg/Float32", self.tachometer_rate_hz) for name in WHEEL_SPEEDS]
        by_wheel = dict(zip(WHEELS, speeds, strict=True))
        joints = self.new_topic(JOINT_STATES, "sensor_msgs/msg/JointState")
        odometry = self.new_topic(self.topic, "nav_msgs/msg/Odometry")
        return self.with_truth(
            self.output(*speeds, part="speeds", clock="tachometers", reading=WheelSpeeds)._replace(fields=by_wheel),
            self.output(joints, part="joints", frame=BASE, reading=Joints),
            self.output(odometry, part="odometry", frame=ODOM, reading=Odometry),
        )

    def figures(self) -> str:
        """Return the rate of the wheels' speeds."""
        return f"wheel speeds at {self.tachometer_rate_hz:g} Hz"

    def notes(self, named: str) -> list[str]:
        """Return what the error of its odometry is."""
        of, driver = "is exact in what it measures, the angles of the wheels: all", "are the constants"
        if self.signal is not None:
            of = "adds up the angles that its encoders read, errors included: the rest"
            driver = "are those of these errors, added to the constants"
        return [
            f"Wheel odometry (`{self.topic}`) {of} of its error is slip and\n  skidding. "
            f"Its covariances {driver} of a real Husky's driver. The frame `odom` is not in `/tf`."
        ]

    def outputs_on(self, robot: RobotConfig) -> tuple[Output, ...]:
        """Its outputs with a speed for each wheel of the robot."""
        count = len(robot.wheels.names)
        return tuple(
            each._replace(topics=each.topics[:count]) if each.part == "speeds" else each for each in self.outputs()
        )

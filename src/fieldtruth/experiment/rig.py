# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the robot and its sensors; by default the paper's (Tables 1, 2 and 5)."""

import itertools
from collections.abc import Callable, Collection, Mapping
from typing import Annotated, Any, ClassVar, Self, TypeVar

from pydantic import BeforeValidator, Field, SerializeAsAny, model_validator

from fieldtruth.core.readings import Reading
from fieldtruth.experiment.fields import Boolean, Frozen, Mount
from fieldtruth.experiment.rig_check import check_sensors
from fieldtruth.experiment.robot_config import RobotConfig, WheelConfig
from fieldtruth.experiment.sections import (
    PAPER_SENSORS,
    ROBOT_SECTIONS,
    SECTIONS,
    with_robot,
    with_sections,
)
from fieldtruth.experiment.sensor_config import MountedConfig, SensorConfig, sensor_of
from fieldtruth.experiment.sensor_families import Imager, ImagingConfig
from fieldtruth.experiment.urdf import KEY as URDF
from fieldtruth.experiment.urdf import with_urdf_mounts
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.stereo_config import StereoConfig
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.wheel_odometry.config import WHEEL_SPEEDS, WheelOdometryConfig

_Config = TypeVar("_Config", bound=SensorConfig)
Sensor = Annotated[SerializeAsAny[SensorConfig], BeforeValidator(sensor_of)]


class Rig(Frozen):
    """The robot with its sensors."""

    also: ClassVar = (*SECTIONS, URDF, *ROBOT_SECTIONS)

    robot: Annotated[
        RobotConfig, Field(description="a name from `fieldtruth list robots`, or a mapping with the key model")
    ] = RobotConfig()
    sensors: Annotated[
        tuple[Sensor, ...],
        Field(max_length=64, description="a list of at most 64 sensors: mappings with the keys kind, name, ..."),
    ] = PAPER_SENSORS

    visible: Annotated[Boolean, Field(description="true or false")] = False
    """Whether the sensors see the robot's chassis and wheels: class robot, instance id 0."""

    @model_validator(mode="before")
    @classmethod
    def _listed(cls, given: Any) -> Any:
        return with_sections(with_robot(with_urdf_mounts(given))) if isinstance(given, Mapping) else given

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_sensors(self.sensors, self._own_frames(), self.robot)
        return self

    @property
    def wheels(self) -> WheelConfig:
        """The robot's wheels."""
        return self.robot.wheels

    @property
    def wheel_speed_topics(self) -> tuple[str, ...]:
        """Topics of the speeds of its wheels."""
        return WHEEL_SPEEDS[: len(self.wheels.names)]

    @property
    def base_footprint(self) -> Mount:
        """Frame on the ground below base_link."""
        return self.robot.footprint

    def giving(self, reading: type[Reading]) -> tuple[MountedConfig, ...]:
        """Return the sensors in a frame of their own that are enabled and whose readings are of a type."""
        return tuple(each for each in self.enabled(MountedConfig) if issubclass(each.gives, reading))

    def first(self, reading: type[Reading]) -> MountedConfig:
        """Return the first sensor whose readings are of a type; of a rig without one the paper's, not enabled.

        The first that gives ``Inertial`` and the first that gives ``Fix`` steer the robot.
        """
        own = [each for each in self.sensors if isinstance(each, MountedConfig) and issubclass(each.gives, reading)]
        if own:
            return next((each for each in own if each.enabled), own[0])
        paper = (each for each in PAPER_SENSORS if isinstance(each, MountedConfig) and issubclass(each.gives, reading))
        return next(paper).model_copy(update={"enabled": False})

    def rate_of(self, reading: type[Reading]) -> float | None:
        """Return the rate [Hz] of the first series of readings of a type; None if no enabled sensor has one."""
        outputs = (output for each in self.sensors if each.enabled for output in each.outputs_on(self.robot))
        return next((output.rate_hz for output in outputs if issubclass(output.reading, reading)), None)

    @property
    def lidars(self) -> tuple[LidarConfig, ...]:
        """The LiDARs that are enabled."""
        return self.enabled(LidarConfig)

    @property
    def cameras(self) -> tuple[CameraConfig, ...]:
        """The cameras and stereo pairs that are enabled."""
        return self.enabled(CameraConfig)

    @property
    def imagers(self) -> tuple[Imager, ...]:
        """The views of the sensors that are enabled."""
        return tuple(imager for sensor in self.enabled(ImagingConfig) for imager in sensor.imagers())

    @property
    def imus(self) -> tuple[ImuConfig, ...]:
        """The inertial measurement units that are enabled."""
        return self.enabled(ImuConfig)

    @property
    def antennas(self) -> tuple[GnssConfig, ...]:
        """The GNSS receivers that are enabled."""
        return self.enabled(GnssConfig)

    @property
    def wheel_odometry(self) -> WheelOdometryConfig | None:
        """The wheel odometry, if it is enabled."""
        return next(iter(self.enabled(WheelOdometryConfig)), None)

    @property
    def reports_wheels(self) -> bool:
        """Whether a sensor reports of the robot's wheels; then its commands are published, too."""
        return any(sensor.needs_wheels and sensor.enabled for sensor in self.sensors)

    @property
    def lidar(self) -> LidarConfig:
        """The first LiDAR; of a rig without one the paper's, not enabled."""
        return self._first(LidarConfig)

    @property
    def stereo(self) -> StereoConfig:
        """The first stereo pair; of a rig without one the paper's, not enabled."""
        return self._first(StereoConfig)

    @property
    def imu(self) -> ImuConfig:
        """The IMU that steers the robot: the first; of a rig without one the paper's, not enabled."""
        return self._first(ImuConfig)

    @property
    def gnss(self) -> GnssConfig:
        """The receiver that steers the robot: the first; of a rig without one the paper's, not enabled."""
        return self._first(GnssConfig)

    def enabled(self, config: type[_Config]) -> tuple[_Config, ...]:
        """The sensors of a class, or of one derived from it, that are enabled."""
        return tuple(sensor for sensor in self.sensors if isinstance(sensor, config) and sensor.enabled)

    def in_order(self) -> tuple[SensorConfig, ...]:
        """The sensors that are enabled, in the order in which their topics are in a bag."""
        return tuple(sorted((each for each in self.sensors if each.enabled), key=lambda each: each.bag_order))

    def with_sensors(self, config: type[SensorConfig], **values: Any) -> Self:
        """Return a rig in which all sensors of a class, or of one derived from it, have other values."""
        return self.with_each(lambda sensor: values if isinstance(sensor, config) else {})

    def switched(self, **on: bool) -> Self:
        """Return a rig with all sensors of a ``switch`` on or off: ``switched(cameras=False)``."""
        return self.with_each(lambda sensor: {"enabled": on[sensor.switch]} if sensor.switch in on else {})

    def with_extras(self, names: Collection[str]) -> Self:
        """Return a rig whose sensors publish these of their ``extras``, and no others."""
        return self.with_each(lambda sensor: {name: name in names for name in sensor.extras})

    def with_each(self, change: Callable[[SensorConfig], Mapping[str, Any]]) -> Self:
        """Return a rig in which each sensor has the values that ``change`` returns for it."""
        changed = tuple(sensor.model_copy(update=change(sensor)) for sensor in self.sensors)
        return self.model_copy(update={"sensors": changed})

    def mounts(self) -> dict[str, Mount]:
        """Every frame that is fixed in base_link by name: those of the sensors and of the robot."""
        sensors = sorted(self.sensors, key=lambda sensor: sensor.frame_order)
        return dict(frame for sensor in sensors for frame in sensor.frames().items()) | self._own_frames()

    def _own_frames(self) -> dict[str, Mount]:
        w = self.wheels
        sides = {"left": w.half_track, "right": -w.half_track}
        axles = {"front": w.half_wheelbase, "rear": -w.half_wheelbase}
        wheels = {
            f"{axle}_{side}_wheel": Mount(xyz=(axles[axle], sides[side], w.axle_height))
            for side, axle in itertools.product(("right", "left"), ("front", "rear"))
            if f"{axle}_{side}" in w.names
        }
        return wheels | {"base_footprint": self.base_footprint}

    def _first(self, config: type[_Config]) -> _Config:
        enabled = self.enabled(config)
        own = enabled or [sensor for sensor in self.sensors if isinstance(sensor, config)]
        return own[0] if own else config.model_validate({"enabled": False})


def paper_rig(
    *,
    imu: ImuConfig | None = None,
    gnss: GnssConfig | None = None,
    wheel_odometry: WheelOdometryConfig | None = None,
    lidar: LidarConfig | None = None,
    stereo: StereoConfig | None = None,
) -> Rig:
    """Return the paper's rig, with other settings of the sensors that are given."""
    given = (imu, gnss, wheel_odometry, lidar, stereo)
    return Rig(sensors=tuple(own or paper for own, paper in zip(given, PAPER_SENSORS, strict=True)))

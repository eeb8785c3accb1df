# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configurations of the package's kinds of sensors, which become known by their import, and a list of all models."""

from typing import Final, TypeVar

from fieldtruth.experiment.catalogue import list_models
from fieldtruth.experiment.sensor_config import KINDS, SensorConfig, load_added_kinds
from fieldtruth.sensors.camera.config import CameraConfig, StereoConfig
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig

CONFIGS: Final[tuple[type[SensorConfig], ...]] = (
    ImuConfig, GnssConfig, WheelOdometryConfig, LidarConfig, CameraConfig, StereoConfig
)  # fmt: skip
"""In the order of their topics in a bag."""
_Config = TypeVar("_Config", bound=SensorConfig)


class FirstOfKinds:
    """The first sensor of each of the package's kinds in a rig; of a rig without one the paper's, not enabled."""

    def first_of(self, config: type[_Config]) -> _Config:
        """Return the first sensor of a class."""
        raise NotImplementedError

    @property
    def lidar(self) -> LidarConfig:
        """The first LiDAR."""
        return self.first_of(LidarConfig)

    @property
    def stereo(self) -> StereoConfig:
        """The first stereo pair."""
        return self.first_of(StereoConfig)

    @property
    def imu(self) -> ImuConfig:
        """The first IMU, which steers the robot."""
        return self.first_of(ImuConfig)

    @property
    def gnss(self) -> GnssConfig:
        """The first GNSS receiver, which steers the robot."""
        return self.first_of(GnssConfig)


def list_sensors() -> dict[str, dict[str, str]]:
    """Return name and description of the models of each family, and of the kinds that others have added, by title."""
    load_added_kinds()
    lists = {}
    for family in dict.fromkeys(config.family for config in (*CONFIGS, *KINDS.values())):
        kinds = [kind for kind, config in KINDS.items() if config.family == family]
        noun = KINDS[kinds[0]].noun
        many = noun if noun.endswith("s") else f"{noun}s"
        lists[f"{many} (kind{'s' * (len(kinds) > 1)} {' and '.join(kinds)})"] = list_models(family)
    added = {kind: config for kind, config in sorted(KINDS.items()) if config not in CONFIGS}
    described = {kind: (config.__doc__ or "").strip().partition("\n")[0] for kind, config in added.items()}
    return {**lists, "kinds of other packages and of FIELDTRUTH_PATH": described}

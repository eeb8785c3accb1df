# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors of a rig, of whatever kind, and photographs without a rig; the package's own kinds are imported here."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.lenses import Lens
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.render.bake import BakedScene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import IdealCamera
from fieldtruth.sensors.camera.sensor import CameraSensor
from fieldtruth.sensors.gnss.sensor import Gnss
from fieldtruth.sensors.imu.sensor import Imu
from fieldtruth.sensors.kind import SENSORS, Sensor, SensorWorld
from fieldtruth.sensors.lidar.sensor import LidarSensor
from fieldtruth.sensors.wheel_odometry.sensor import Wheels

OWN: Final = (Imu, Gnss, Wheels, LidarSensor, CameraSensor)
"""Kinds of the package."""


def photograph(
    baked: BakedScene, world_from_optical: Array, exposure: float, **lens: float
) -> tuple[NDArray[np.uint8], Lens]:
    """Render a photograph (h, w, 3) with an ideal pinhole, of which ``lens`` has size and fields of view; and its lens.

    ``exposure`` is relative to that of an open meadow.
    """
    config = CameraConfig.model_validate(lens)
    return IdealCamera(config, baked, exposure=exposure).render(world_from_optical).photo, config.projection


def sensor_class(config: SensorConfig) -> type[Sensor]:
    """Return the class of the sensors with a configuration."""
    return next(SENSORS[each] for each in type(config).__mro__ if each in SENSORS)


def new_sensors(sensor_world: SensorWorld, rig: Rig | None = None) -> dict[str, Sensor]:
    """Return the enabled sensors of a rig, by default its own, by name in the order of a bag; for one thread."""
    return {config.name: sensor_class(config)(config, sensor_world) for config in (rig or sensor_world.rig).in_order()}

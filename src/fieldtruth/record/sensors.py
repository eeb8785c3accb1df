# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sensors of a rig in a world, one set per worker thread."""

from collections.abc import Callable

from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_body import visible_parts
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.record.stream import Sensors
from fieldtruth.render.bake import bake
from fieldtruth.sense.robot_view import robot_views
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.scene_sensor import SCENE_SENSORS
from fieldtruth.sensors.camera.signal_camera import new_camera
from fieldtruth.sensors.lidar.measuring import new_lidar
from fieldtruth.world.model import World


def sensor_factory(world: World, rig: Rig, light: LightConfig, weather: WeatherConfig) -> Callable[[], Sensors]:
    """Build the scene and bake its light, and return the function that makes sensors in it."""
    scene = Scene(world)
    wide_ids = world.has_wide_ids
    baked = bake(scene, light, weather) if rig.cameras else None
    parts, views = visible_parts(rig), robot_views(rig)

    def make() -> Sensors:
        lidars = {config.name: new_lidar(config, scene, weather, parts) for config in rig.lidars}
        cameras = {} if baked is None else {c.name: new_camera(c, baked) for c in rig.cameras}
        others = {config.name: SCENE_SENSORS[config.kind](config, scene) for config in rig.scene_sensors}
        return Sensors(lidars, cameras, others, views, wide_ids)

    return make

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sensors of a rig in a world, one set per worker thread."""

from collections.abc import Callable

from fieldtruth.experiment.camera_config import CameraConfig
from fieldtruth.experiment.config import LightConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.streams import Sensors
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.render.camera import Camera
from fieldtruth.sense.lidar import Lidar
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.scene_sensor import SCENE_SENSORS
from fieldtruth.sensors.camera.signal_camera import SignalCamera
from fieldtruth.world.model import World


def sensor_factory(world: World, rig: Rig, light: LightConfig) -> Callable[[], Sensors]:
    """Build the scene and bake its light, and return the function that makes sensors in it."""
    scene = Scene(world)
    wide_ids = world.has_wide_ids
    baked = bake(scene, light) if rig.cameras else None

    def make() -> Sensors:
        lidars = {config.name: Lidar(config, scene) for config in rig.lidars}
        cameras = {} if baked is None else {c.name: camera_of(c, baked) for c in rig.cameras}
        others = {config.name: SCENE_SENSORS[config.kind](config, scene) for config in rig.scene_sensors}
        return Sensors(lidars, cameras, others, wide_ids)

    return make


def camera_of(config: CameraConfig, baked: BakedScene) -> Camera:
    """Return a camera of a baked scene, with its signal if it has one; for one thread."""
    if config.signal is None:
        return Camera(config, baked, reuse=True)
    return SignalCamera(config, baked, baked.scene.world.seed, reuse=True)

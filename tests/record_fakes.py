# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fake world, drive and sensors, fast and with known values."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.bag.topics import topics_of
from fieldtruth.core import geodesy, transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.progress import Progress
from fieldtruth.drive.plan import expected_seconds
from fieldtruth.drive.track import (
    Base,
    Commands,
    Motion,
    Track,
    WheelMotion,
    stamps_at_rate,
)
from fieldtruth.experiment.config import Experiment, RouteConfig
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.pipeline import PreparedHere
from fieldtruth.record.slices import Slices
from fieldtruth.record.streams import Sensors, streams_of
from fieldtruth.sensors.camera.config import CameraConfig, StereoConfig
from fieldtruth.sensors.camera.sensor import CameraSensor
from fieldtruth.sensors.kind import Sensor, SensorWorld
from fieldtruth.sensors.known import sensor_class
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import sweep_times_ns
from fieldtruth.sensors.lidar.sensor import LidarSensor
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.world.model import Heightfield, Instance, Raster, Terrain, World

SMALL = paper_rig(cameras=StereoConfig(width=64, height=48))


def make_experiment(seconds: float = 2.5, seed: int = 0, rig: Rig = SMALL, name: str = "tiny") -> Experiment:
    start, end = geodesy.geodetic_from_world([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])[:, :2]
    route = RouteConfig(start=(start[0], start[1]), waypoints=((end[0], end[1]),))
    return Experiment(name=name, environment="park", seed=seed, seconds=seconds, route=route, rig=rig)


def make_world(environment: str = "park", seed: int = 0, objects: int = 5) -> World:
    """One square metre of ground with objects: object i is at (i, seed, 0), scaled by 1 + i / 10."""
    raster = Raster(values=np.ones((2, 2), np.float32), spacing=1.0, x0=0.0, y0=0.0)
    field = Heightfield(heights=np.zeros((2, 2), np.float32), spacing=1.0, x0=0.0, y0=0.0)
    instances = []
    for i in range(2, 2 + objects):
        matrix = transforms.pose((float(i), float(seed), 0.0), (0.0, 0.0, 20.0 * i))
        matrix[:3, :3] *= 1.0 + i / 10.0
        instances.append(Instance(name=f"tree_{i}", kind="tree", mesh="tree", object_id=i, world_from_object=matrix))
    return World(
        name=environment,
        seed=seed,
        size=(1.0, 1.0),
        terrain=Terrain(
            field=field,
            trail_distance=raster,
            cover=raster,
            ground_materials=("grass",),
            trail_material="sand",
            border_material="kerb",
        ),
        meshes={},
        instances=tuple(instances),
        materials={},
        textures={},
        object_names=("husky", "ground", *(instance.name for instance in instances)),
    )


def make_track(world: World, experiment: Experiment) -> Track:
    """A circle at 0.3 m/s on a slope, with a rolling and pitching robot; every row differs from its neighbours."""
    rig = experiment.rig
    duration_ns = round((experiment.seconds or 1.0) * 1e9)
    stamps = stamps_at_rate(1000.0, duration_ns)
    t = stamps / 1e9
    heading = 0.1 * t
    position = np.stack([3.0 * np.sin(heading), 3.0 * (1.0 - np.cos(heading)), 0.13 + 0.01 * t], axis=-1)
    rpy = np.stack([0.1 * np.sin(t), 0.05 * np.cos(t), heading], axis=-1)
    rotation = np.stack([transforms.pose((0, 0, 0), np.degrees(row).tolist())[:3, :3] for row in rpy])
    speed = np.stack([0.3 * np.cos(heading), 0.3 * np.sin(heading), np.full_like(t, 0.01)], axis=-1)
    turn = np.stack([0.1 * np.cos(t), -0.05 * np.sin(t), np.full_like(t, 0.1)], axis=-1)
    motion = Motion(
        stamps_ns=stamps,
        position=position,
        quaternion_wxyz=transforms.quaternion_wxyz_from_rotation(rotation),
        linear_velocity=speed,
        angular_velocity=turn,
    )
    imu_stamps = stamps_at_rate(rig.imu.rate_hz, duration_ns)
    wheels = WheelMotion(angle=np.outer(t, (1.0, 2.0, 1.1, 2.2)), speed=np.tile((1.0, 2.0, 1.1, 2.2), (len(t), 1)))
    commands = Commands(stamps_ns=imu_stamps, command=np.column_stack([imu_stamps / 1e10, -imu_stamps / 1e9]))
    return Track(motion=motion, swept=motion, base=Base(wheels=wheels, commands=commands))


@dataclass(frozen=True)
class FakeScan:
    xyz: NDArray[np.float32]
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    ring: NDArray[np.uint16]
    column: NDArray[np.uint16]
    t_ns: NDArray[np.uint32]


@dataclass(frozen=True)
class FakeImages:
    photo: NDArray[np.uint8]
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    depth: NDArray[np.float32]


class FakeScene:
    def __init__(self, world: World, *_: object) -> None:
        self.world = world


class FakeLidar:
    """Returns a number of points that changes from scan to scan, on a line that depends on the LiDAR's pose."""

    def __init__(
        self, config: LidarConfig, scene: FakeScene, robot: object = (), weather: object = None, *, seed: int = 0
    ) -> None:
        self.config = config

    def scan(self, world_from_lidar: NDArray[np.float64], stamp_ns: int = 0, number: int = 0) -> FakeScan:
        n = 50 + int(world_from_lidar[0, 3] * 1e4) % 50
        k = np.arange(n)
        return FakeScan(
            xyz=transforms.transform(world_from_lidar, np.stack([k, 2.0 * k, np.ones(n)], axis=-1)).astype(np.float32),
            label=(k % 13 + 1).astype(np.uint8),
            instance=(k * 600).astype(np.uint32),
            ring=(k % 64).astype(np.uint16),
            column=(k // 64).astype(np.uint16),
            t_ns=(k * 100_000_000).astype(np.uint32),
        )


class FakeCamera:
    """A gradient that depends on the camera's pose, and stripes of all classes; ``pause`` [s] makes it slow."""

    pause = 0.0

    def __init__(self, config: CameraConfig, scene: FakeScene, *, reuse: bool = False, seed: int = 0) -> None:
        self.config = config

    def render(self, world_from_optical: NDArray[np.float64], robot: object = None, stamp_ns: int = 0) -> FakeImages:
        time.sleep(self.pause)
        height, width = self.config.height, self.config.width
        x, y, z = transforms.transform(world_from_optical, [[0.2, 0.4, 1.0]])[0]
        shade = np.add.outer(np.arange(height), np.arange(width)) + 1000 * (x + 2 * y + 3 * z)
        label = (np.arange(width) % int(Label.SKY) + 1).astype(np.uint8)
        return FakeImages(
            photo=np.repeat((shade.astype(int) % 200).astype(np.uint8)[..., None], 3, axis=-1),
            label=np.broadcast_to(label, (height, width)),
            instance=np.broadcast_to(label.astype(np.uint32) * 300, (height, width)),
            depth=(shade % 50).astype(np.float32),
        )


def make_slices(folder: Path, experiment: Experiment, slice_ns: int = 10**9) -> Slices:
    """Slices of the fake recording, by default of a second."""
    world = make_world(seed=experiment.seed)
    track, rig = make_track(world, experiment), experiment.rig
    return Slices(
        folder, streams_of(world, track, rig), topics_of(rig), lambda: fake_sensors(world, rig), slice_ns=slice_ns
    )


def fake_sensors(world: World, rig: Rig, lidar: Any = FakeLidar, camera: Any = FakeCamera) -> Sensors:
    """Sensors of a rig with fake LiDARs and cameras."""
    sensor_world, sensors = SensorWorld(world, rig, reuse=True), dict[str, Sensor]()
    for config in rig.in_order():
        if isinstance(config, LidarConfig):
            sensors[config.name] = FakeLidarSensor(config, sensor_world, lidar)
        elif isinstance(config, CameraConfig):
            sensors[config.name] = FakeCameraSensor(config, sensor_world, camera)
        else:
            sensors[config.name] = sensor_class(config)(config, sensor_world)
    return sensors


class FakeLidarSensor(LidarSensor):
    """The sensor of a fake LiDAR."""

    def __init__(self, config: LidarConfig, sensor_world: SensorWorld, lidar: Any) -> None:
        Sensor.__init__(self, config, sensor_world)
        self._lidar, self._sweep_ns = lidar(config, None), sweep_times_ns(config)


class FakeCameraSensor(CameraSensor):
    """The sensor of a fake camera."""

    def __init__(self, config: CameraConfig, sensor_world: SensorWorld, camera: Any) -> None:
        Sensor.__init__(self, config, sensor_world)
        self._camera, self._views = camera(config, None), {imager.side: imager for imager in config.imagers()}


@dataclass(frozen=True)
class FakeEngine:
    """An engine of ``generate_by`` with a fake world, drive and sensors."""

    world: Callable[[Experiment], World] = lambda experiment: make_world(experiment.environment, experiment.seed)
    track: Callable[[World, Experiment], Track] = make_track
    lidar: Any = FakeLidar
    camera: Any = FakeCamera

    def __call__(self, simulation: Simulation, progress: Progress) -> PreparedHere:
        experiment = simulation.experiment
        with progress.stage("build the world"):
            world = self.world(experiment)
        with progress.stage("drive", expected_seconds(experiment)):
            track = self.track(world, experiment)
        sensors = partial(fake_sensors, world, experiment.rig, self.lidar, self.camera)
        return PreparedHere(experiment, world, track, new_sensors=sensors)


def use_fakes(patch: pytest.MonkeyPatch) -> None:
    """Replace world building, driving and sensing for the command line and workers, which make runs by themselves."""
    patch.setattr("fieldtruth.simulation.stepped.world_of", FakeEngine.world)
    patch.setattr(
        "fieldtruth.simulation.motion.plan_and_drive", lambda world, experiment, _: make_track(world, experiment)
    )
    patch.setattr("fieldtruth.sensors.kind.Scene", FakeScene)
    patch.setattr("fieldtruth.sensors.kind.bake", lambda scene, light, weather: scene)
    patch.setattr("fieldtruth.sensors.lidar.sensor.Lidar", FakeLidar)
    patch.setattr("fieldtruth.sensors.camera.sensor.Camera", FakeCamera)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Class shares, data card and benchmark of a kind of sensor that another package adds: a radar that gives clouds."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from report_worlds import plain
from small_park import RIG

from fieldtruth.bench.sensors import measure_sensors, stretches_of
from fieldtruth.core.classes import Label
from fieldtruth.core.readings import Cloud, Reading
from fieldtruth.drive.plan import pose_on_ground
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.config import Experiment, route_from_metres
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import KINDS, MountedConfig, Output
from fieldtruth.report.card import sensor_lines
from fieldtruth.report.drawing.style import sensor_nouns
from fieldtruth.report.shares import count_classes
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import SENSORS, At, Rays, Sensor
from fieldtruth.simulation.stepped import Driven

FAN = np.array([[np.cos(a), np.sin(a), -0.1] for a in np.linspace(-0.5, 0.5, 8)])[None] / np.hypot(1.0, 0.1)


@pytest.fixture
def radar() -> Iterator[Callable[[], MountedConfig]]:
    """Configuration of a kind that is known during the test."""

    class RadarConfig(MountedConfig):
        gives: ClassVar[type[Reading]] = Cloud
        kind: Literal["radar"] = "radar"
        name: str = "radar"
        topic: str = "/radar"
        frame: str = "radar_link"
        mount: Mount = Mount(xyz=(0.3, 0.0, 0.4))
        rate_hz: float = 10.0

        def outputs(self) -> tuple[Output, ...]:
            return (self.output(self.new_topic(self.topic, "sensor_msgs/msg/PointCloud2"), reading=Cloud),)

        def figures(self) -> str:
            return "8 beams"

    class Radar(Sensor):
        config_type = RadarConfig

        def truth(self, output: Output, at: At) -> Cloud:
            pose = at.movement.pose(at.stamp_ns) @ self.config.mount.base_from_sensor
            hits = self.sensor_world.scene.cast(pose[:3, 3], FAN[0] @ pose[:3, :3].T, 30.0)
            hit = np.isfinite(hits.range_m)
            xyz = (FAN[0] * np.where(hit, hits.range_m, 0.0)[:, None])[hit].astype(np.float32)
            return Cloud(**at.stamps, frame=output.frame, xyz=xyz, label=hits.label[hit])

        def messages(self, output: Output, number: int, reading: Any) -> Iterable[bytes]:
            yield b""

        def rays(self) -> Rays:
            scene = self.sensor_world.scene

            def sweep(pose: Any) -> object:
                return scene.cast(pose[:3, 3], FAN[0] @ pose[:3, :3].T, 30.0)

            return Rays(FAN.astype(np.float32), 30.0, ({"sweep": sweep},))

    yield RadarConfig
    del KINDS["radar"], SENSORS[RadarConfig]


def test_points_of_another_kind_are_counted_and_named(radar: Callable[[], MountedConfig]) -> None:
    rig, world = Rig(sensors=(radar(),)), plain()
    poses = [pose_on_ground(world.terrain.field, np.array([x, 3.0, 0.4]), RIG) for x in (0.0, 10.0)]
    shares = count_classes(Scene(world), rig, poses)
    assert shares.points[:, Label.GROUND].tolist() == [8, 8]
    assert shares.points.sum() == 16
    assert not shares.pixels.any()
    assert sensor_lines(rig) == ["- Radar: 8 beams"]
    nouns = ["1 IMU", "1 GNSS receiver", "wheel encoders", "1 LiDAR", "1 stereo camera", "2 radars"]
    assert sensor_nouns([*RIG.in_order(), radar(), radar()]) == nouns


def test_rays_of_another_kind_are_measured(radar: Callable[[], MountedConfig]) -> None:
    rig, world = Rig(sensors=(radar(),)), plain()
    route = route_from_metres((0.0, 0.0), [(8.0, 0.0)])
    experiment = Experiment(name="radar", environment="park", rig=rig, route=route)
    stamps = np.arange(1, 2001, dtype=np.int64) * 1_000_000
    still = np.zeros((2000, 3))
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (2000, 1))
    motion = Motion(
        stamps_ns=stamps,
        position=still + np.array([0.0, 0.0, 0.2]),
        quaternion_wxyz=quaternion,
        linear_velocity=still,
        angular_velocity=still,
    )
    driven = Driven(experiment, world, Track(motion=motion, swept=motion, base=None, is_frames=False))
    found = measure_sensors(driven, rig.sensors, stretches_of(2.0, 4, 1), 1)
    assert list(found) == ["radar_mrays_per_s", "radar_bare_mrays_per_s", "sweep_over_bare"]
    assert all(type(value) is float and value > 0 for value in found.values())

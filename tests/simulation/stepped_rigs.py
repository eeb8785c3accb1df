# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A small rig with every kind of sensor, a small world, and messages of frames as they are in a bag."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from drive_worlds import make_experiment
from rosbags.rosbag1 import Reader
from sense_worlds import at, box, make_world

from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.sensors.known import new_sensors
from fieldtruth.simulation.due import Frame
from fieldtruth.world.model import World

WORLD = make_world(
    [(box("near", (0.3, 0.3, 0.6)), at(2.5, 1.0, 0.6)), (box("wall", (0.2, 8.0, 1.5), "bark"), at(9.0, 0.0, 1.5))],
    side=40.0,
    height=lambda x, y: 0.03 * x * (abs(y) < 30),
)
SCENE = Scene(WORLD)
_SIZE = {"width": 64, "height": 48}
CLOCK = {"offset_s": 0.003, "drift_ppm": 30.0, "jitter_s": 0.0005, "drop_share": 0.2}


def sensors(*, signal: bool = False, clock: bool = False) -> list[dict[str, Any]]:
    """Items of ``rig.sensors``: ideal, or with all that a real sensor adds."""
    real: dict[str, Any] = {"signal": "datasheet"} if signal else {}
    if clock:
        real["clock"] = CLOCK
    camera = real | _SIZE
    images = {"depth": True, "instances": True, "normals": True, "flow": True}
    return [
        {"kind": "lidar", "name": "turning", "columns": 64, "rings": 8, "spinning": True, "mount": _up(0.9), **real},
        {"kind": "lidar", "name": "flash", "columns": 32, "rings": 8, "rate_hz": 7.0, "mount": _up(0.7), **real},
        {"kind": "stereo", "name": "zed", "baseline": 0.1, "rate_hz": 10.0, "mount": _up(0.6), **images, **camera},
        {"kind": "camera", "name": "front", "rate_hz": 15.0, "mount": _up(0.5), **camera},
        {"kind": "imu", "name": "imu", "rate_hz": 300.0, "mount": _up(0.1) | {"rpy_deg": [10.0, 20.0, 30.0]}, **real},
        {"kind": "gnss", "name": "gnss", "rate_hz": 10.0, "mount": _up(1.0), **real},
        {"kind": "wheel_odometry", "rate_hz": 40.0, **real},
    ]


def _up(height: float) -> dict[str, Any]:
    return {"xyz": [0.1, 0.0, height]}


def experiment(*, seconds: float = 0.4, signal: bool = False, clock: bool = False, seed: int = 0) -> Experiment:
    rig = Rig.model_validate({"sensors": sensors(signal=signal, clock=clock), "visible": True})
    return make_experiment([(3.0, 0.5)], seconds=seconds, rig=rig, seed=seed)


def messages_of(frames: Iterable[Frame], made: Experiment, world: World = WORLD) -> dict[str, list[tuple[int, bytes]]]:
    """Messages of the readings of frames by topic, each with its stamp [ns]."""
    sensor_world = SensorWorld(world, made.rig, scene=SCENE if world is WORLD else None)
    outputs = {
        output.name: (sensor, output)
        for sensor in new_sensors(sensor_world, made.rig).values()
        for output in sensor.config.outputs_on(made.rig.robot)
    }
    found: dict[str, list[tuple[int, bytes]]] = {}
    for frame in frames:
        for name, readings in frame.all.items():
            sensor, output = outputs[name]
            for reading in readings:
                number = round(reading.stamp_ns * output.rate_hz / 1e9) - 1
                made_of = sensor.messages(output, number, reading)
                for topic, data in zip(output.topics, made_of, strict=True):
                    found.setdefault(topic.name, []).append((reading.stamp_ns, bytes(data)))
    return found


def messages_in(bag: Path, made: Experiment) -> dict[str, list[tuple[int, bytes]]]:
    """Messages of the sensors in a bag, in the same form."""
    topics = {topic.name for config in made.rig.in_order() for topic in config.topics()}
    found: dict[str, list[tuple[int, bytes]]] = {}
    with Reader(bag) as reader:
        kept = [connection for connection in reader.connections if connection.topic in topics]
        for connection, stamp_ns, data in reader.messages(kept):
            found.setdefault(connection.topic, []).append((stamp_ns, bytes(data)))
    return found

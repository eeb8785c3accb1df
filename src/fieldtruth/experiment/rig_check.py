# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rules between the sensors of a rig and its robot: names, topics and frames differ; none sees from inside the hull."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.problems import LocatedError
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.experiment.sensor_families import ImagingConfig

OWN_TOPICS: Final = (
    "/clock",
    "/tf",
    "/tf_static",
    "/gazebo/model_states",
    "/gazebo/static_model_states",
    "/ground_truth/odom",
    "/cmd_vel",
)
MOST_JITTER: Final = 0.2
"""Of a clock, in periods of the sensor; with more, stamps would no longer rise by themselves."""
OWN_FRAMES: Final = ("world", "odom", "base_link")


def check_sensors(sensors: Sequence[SensorConfig], own_frames: Mapping[str, Mount], robot: RobotConfig) -> None:
    """Check the list of sensors of a robot with these frames of its own.

    Raises:
        LocatedError: the key of the sensor, and what it has in common with which other.
    """
    of_wheels = [i for i, sensor in enumerate(sensors) if sensor.needs_wheels]
    if len(of_wheels) > 1:
        second = of_wheels[1]
        raise LocatedError(f"must differ: a rig has at most one {sensors[second].kind}", ("sensors", second, "kind"))
    _differ(sensors, "name", [(sensor.name,) for sensor in sensors], {})
    views = [
        [imager.name for imager in sensor.imagers()] if isinstance(sensor, ImagingConfig) else [] for sensor in sensors
    ]
    _differ(sensors, "name", views, {}, "the name of a camera")
    topics = [[topic.name for topic in sensor.topics()] for sensor in sensors]
    _differ(sensors, "topic", topics, dict.fromkeys(OWN_TOPICS, "the robot"))
    frames = [[*sensor.frames(), *sensor.optical_frames()] for sensor in sensors]
    _differ(sensors, "frame", frames, dict.fromkeys((*OWN_FRAMES, *own_frames), "the robot"))
    for i, sensor in enumerate(sensors):
        if sensor.clock is not None and sensor.clock.jitter_s > (most := MOST_JITTER / sensor.rate_hz):
            at = ("sensors", i, "clock", "jitter_s")
            raise LocatedError(f"must be at most {most:g}, a fifth of the period; got {sensor.clock.jitter_s:g}", at)
        if sensor.enabled and (sensor.sees or not sensor.in_hull):
            for frame, mount in sensor.frames().items():
                _check_outside(mount, frame, robot, ("sensors", i, "mount"))


def _differ(
    sensors: Sequence[SensorConfig], key: str, values: Sequence[Iterable[str]], taken: dict[str, str], what: str = ""
) -> None:
    what = what or f"a {key}"
    for i, own in enumerate(values):
        for value in own:
            if value in taken:
                raise LocatedError(f"{value!r} is already {what} of {taken[value]}", ("sensors", i, key))
            taken[value] = f"sensors[{i}]"


def _check_outside(mount: Mount, frame: str, robot: RobotConfig, at: tuple[str | int, ...]) -> None:
    """Check that a frame is not inside the chassis."""
    x, y, z = mount.xyz
    length, width, top = robot.outline[0], robot.chassis_width, robot.chassis_top
    if abs(x) < length / 2 and abs(y) < width / 2 and 0.0 < z < top:
        raise LocatedError(
            f"{frame} is inside the robot's hull at {list(mount.xyz)}: it spans x -{length / 2:g} to {length / 2:g} m, "
            f"y -{width / 2:g} to {width / 2:g} m, z 0 to {top:g} m in base_link",
            at,
        )

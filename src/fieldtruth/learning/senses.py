# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Observations of a robot: their spaces, known before a world is loaded, and their values in a world.

The sensors are those of rigs: a LiDAR of few rays, a small camera, and one behind the robot that renders.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from fieldtruth.core import readings, transforms
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.drive.traversability import CELL, obstacle_height
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig, Topic
from fieldtruth.kernels.height_maps import crop_heights, raise_to_points
from fieldtruth.kernels.packets import Grid
from fieldtruth.learning.config import OBSERVATIONS, LearningConfig, SensorValues, experiment_of
from fieldtruth.learning.robot import EpisodeRobot, Now
from fieldtruth.learning.task_world import OBSTACLE_HEIGHT, TaskWorld
from fieldtruth.learning.tasks import Task
from fieldtruth.sensors.kind import At, Sensor, standing
from fieldtruth.sensors.known import sensor_class
from fieldtruth.world.model import World

_MAP: Final = 64  # cells along each side of an elevation map
_MAP_LIMIT: Final = 2.0  # [m]
_FAR: Final = 1000.0  # [m] to a goal
_FAST: Final = 20.0  # [m/s]
_SPIN: Final = 20.0  # [rad/s]
_WHEEL: Final = 200.0  # [rad/s]
_LOAD: Final = 1e5  # [N]
_ELEVATIONS: Final = [float(degrees) for degrees in np.linspace(5.0, -25.0, 16)]
"""Of the rays [deg]: those that go up are as many as tell a low branch."""
_SCAN: Final = {
    **{"kind": "lidar", "name": "lidar", "columns": 180, "rings": 16, "spinning": False},
    **{"max_range": 20.0, "elevations_deg": _ELEVATIONS},
}
_VIEW: Final = {"kind": "camera", "name": "camera", "width": 96, "height": 54}
_BEHIND: Final = {
    **{"kind": "camera", "name": "behind", "width": 480, "height": 270},
    "mount": {"xyz": [-2.4, 0.0, 1.7], "rpy_deg": [0.0, 22.0, 0.0]},
}


class Rigs(NamedTuple):
    """The robot with the sensors of observations, and with the camera that renders, which sees the robot."""

    observing: Rig
    rendering: Rig


def rigs_of(rig: Rig, changed: SensorValues) -> Rigs:
    """Return the rigs of a robot; ``changed`` are values of the small sensors.

    They are where the rig has its own, the small camera at the first view, or above the middle of the robot.

    Raises:
        ConfigurationError: a value that is not allowed.
    """
    above = Mount(xyz=(0.0, 0.0, rig.robot.chassis_top + 0.3))
    scanners = rig.giving(readings.Cloud)
    scanner = scanners[0].mount if scanners else above
    view = _mount_of(rig.imagers[0].base_from_view) if rig.imagers else above
    sensors = [
        {**base, "mount": mount.model_dump(), **own_values}
        for base, mount, own_values in ((_SCAN, scanner, changed.lidar), (_VIEW, view, changed.camera))
    ]
    robot = rig.robot.model_dump()

    def made(each: list[dict[str, Any]], *, visible: bool) -> Rig:
        return experiment_of(rig={"robot": robot, "sensors": each, "visible": visible}).rig

    return Rigs(made(sensors, visible=rig.visible), made([dict(_BEHIND)], visible=True))


def _mount_of(base_from_view: Array) -> Mount:
    """Mount of a camera that looks along its x axis: of the paper's pair, z looks ahead."""
    x, y, z = base_from_view[:3, 3].tolist()
    roll, pitch, yaw = np.round(transforms.rpy_deg_from_rotation(base_from_view[:3, :3]), 9).tolist()
    return Mount(xyz=(x, y, z), rpy_deg=(roll, pitch, yaw))


def _box(limits: list[float]) -> spaces.Box:
    high = np.array(limits, np.float32)
    return spaces.Box(-high, high, dtype=np.float32)


class Senses:
    """What the robot of an environment observes: a ``space``, and values in it.

    Args:
        config: names the observations; one of them is a Box, several are a Dict.
        rigs: the sensors.
        has_goal: whether ``state`` begins with a goal.
    """

    def __init__(self, config: LearningConfig, rigs: Rigs, *, has_goal: bool) -> None:
        self.names, self._rigs, self._has_goal = config.names, rigs, has_goal
        self.others: dict[str, Array] = {}
        """Poses (4, 4) world_from_base of other robots, by name."""
        self._single = isinstance(config.observation, str) and len(self.names) == 1
        self._scan_config, self._view_config = rigs.observing.sensors
        self._heights: Grid | None = None
        self._sensed: TaskWorld | None = None
        self._sensors: dict[str, Sensor] = {}
        self._parts: dict[str, Callable[[], Any]] = {
            "state": self._state,
            "lidar": self._ranges,
            "lidar/class": lambda: self._spread(self.cloud.label),
            "elevation": self._elevation,
            "elevation/seen": self._seen,
            "camera/photo": lambda: self._image.photo,
            "camera/label": lambda: self._label,
            "privileged": self._privileged,
        }
        self._boxes = {name: self._space_of(name) for name in OBSERVATIONS}
        boxes: dict[str, spaces.Space[Any]] = {name: self._boxes[name] for name in self.names}
        self.space: spaces.Space[Any] = boxes[self.names[0]] if self._single else spaces.Dict(boxes)

    def _space_of(self, name: str) -> spaces.Box:
        wheels = len(self._rigs.observing.wheels.names)
        state = [_FAR] * (2 * self._has_goal) + [_FAST, _FAST, _SPIN, np.pi, np.pi] + [_WHEEL] * wheels + [1.0]
        shape = (int(self._scan_config.rings), int(self._scan_config.columns))  # type: ignore[attr-defined]
        image = (int(self._view_config.height), int(self._view_config.width))  # type: ignore[attr-defined]
        match name:
            case "state":
                return _box(state)
            case "privileged":
                own = [_FAR] * 3 + [1.0, 1.0, 1e4, 100.0] + wheels * [_LOAD] + wheels * [10.0] + wheels * [1.0]
                return _box(state + own)
            case "lidar":
                far = float(self._scan_config.max_range)  # type: ignore[attr-defined]
                return spaces.Box(0.0, far, shape, np.float32)
            case "elevation":
                return spaces.Box(-_MAP_LIMIT, _MAP_LIMIT, (_MAP, _MAP), np.float32)
            case "elevation/seen":
                return spaces.Box(-_MAP_LIMIT, _MAP_LIMIT, (2, _MAP, _MAP), np.float32)
            case "camera/photo":
                return spaces.Box(0, 255, (*image, 3), np.uint8)
            case _:
                return spaces.Box(0, 255, shape if name == "lidar/class" else image, np.uint8)

    def begin(self, made: TaskWorld, robot: EpisodeRobot, task: Task) -> None:
        """Begin an episode."""
        self._made, self._robot, self._task = made, robot, task
        self._once: dict[str, Any] = {}
        self._number = -1
        if self._sensed is not made:
            self._sensed, self._sensors = made, {}
        self._heights = made.unknown_heights() if "elevation/seen" in self.names else None

    def read(self) -> Any:
        """Return the observation after a step of control, in new arrays."""
        self._once, self._number = {}, self._number + 1
        values = {name: self._parts[name]() for name in self.names}
        return values[self.names[0]] if self._single else values

    @property
    def world(self) -> World:
        """The world of the episode."""
        return self._made.world

    @property
    def rig(self) -> Rig:
        """The robot with the small sensors."""
        return self._rigs.observing

    @property
    def scan_topics(self) -> tuple[Topic, ...]:
        """Topics of the scan's messages."""
        return tuple(self._output(self._scan_config).topics)

    def scan_messages(self) -> list[bytes]:
        """Return the scan after the last step as messages, one for each of ``scan_topics``."""
        output = self._output(self._scan_config)
        return [*self._sensor(self._scan_config).messages(output, self._number, self.cloud)]

    @property
    def _now(self) -> Now:
        return self._robot.now

    def _at(self) -> At:
        self._made.others, stamp_ns = self.others, round(1e9 * self._robot.seconds)
        return At(self._number, stamp_ns, stamp_ns, standing(self._now.world_from_base))

    def _kept(self, name: str, make: Callable[[], Any]) -> Any:
        """Return what is made once after a step of control."""
        if name not in self._once:
            self._once[name] = make()
        return self._once[name]

    def _sensor(self, config: SensorConfig) -> Sensor:
        """Return a sensor, made at its first reading in a world: without one, no ray tracer is built."""
        if config.name not in self._sensors:
            self._sensors[config.name] = sensor_class(config)(config, self._made.sensed_by(self._rigs.observing))
        return self._sensors[config.name]

    def _output(self, config: SensorConfig) -> Any:
        return config.outputs_on(self._rigs.observing.robot)[0]

    @property
    def cloud(self) -> readings.Cloud:
        """The scan after the last step."""
        cloud: readings.Cloud = self._kept(
            "cloud", lambda: self._sensor(self._scan_config).read(self._output(self._scan_config), self._at())
        )
        return cloud

    @property
    def scan(self) -> tuple[readings.Cloud, Array] | None:
        """The scan after the last step with its base_from_lidar (4, 4); None if no observation needs it."""
        mount = self._scan_config.mount  # type: ignore[attr-defined]
        return (
            (self.cloud, mount.base_from_sensor) if {"lidar", "lidar/class", "elevation/seen"} & {*self.names} else None
        )

    @property
    def world_from_scanner(self) -> Array:
        """Pose (4, 4) of the scan."""
        return self._now.world_from_base @ self._scan_config.mount.base_from_sensor  # type: ignore[attr-defined, no-any-return]

    @property
    def _image(self) -> readings.Image:
        image: readings.Image = self._kept(
            "image", lambda: self._sensor(self._view_config).read(self._output(self._view_config), self._at())
        )
        return image

    @property
    def _label(self) -> NDArray[np.uint8]:
        if "camera/photo" in self.names:
            assert self._image.label is not None
            return self._image.label
        return self._sensor(self._view_config).labels(self._output(self._view_config), self._at())

    def _spread(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values (n,) of the cloud's points as an image: upper rings first, from left to right, ahead in the middle."""
        space, cloud = self._boxes["lidar"], self.cloud
        assert cloud.ring is not None
        assert cloud.column is not None
        rings, columns = space.shape
        image = np.zeros((rings, columns), values.dtype)
        image[cloud.ring, (cloud.column.astype(np.intp) + columns // 2) % columns] = values
        return image

    def _ranges(self) -> Float32Array:
        return self._spread(np.sqrt(np.einsum("ij,ij->i", self.cloud.xyz, self.cloud.xyz)))

    def _crop(self, grid: Grid) -> tuple[Float32Array, NDArray[np.bool_]]:
        height, known = np.empty((_MAP, _MAP), np.float32), np.empty((_MAP, _MAP), np.bool_)
        now, clearance = self._now, self._rigs.observing.robot.ground_clearance
        pose = np.array([*now.xy, now.heading, now.world_from_base[2, 3] - clearance])
        crop_heights(grid, pose, CELL, _MAP_LIMIT, height, known)
        return height, known

    def _elevation(self) -> Float32Array:
        """Return the map around the robot; other robots are ``OBSTACLE_HEIGHT`` above the ground, as any obstacle."""
        height, _ = self._crop(self._made.heights)
        if not self.others:
            return height
        robot, now = self._rigs.observing.robot, self._now
        ahead, left = np.meshgrid(*2 * [CELL * np.arange(_MAP)[::-1] - 0.5 * CELL * (_MAP - 1)], indexing="ij")
        cos, sin = np.cos(now.heading), np.sin(now.heading)
        points = np.stack([cos * ahead - sin * left, sin * ahead + cos * left], axis=-1) + now.xy
        for pose in self.others.values():
            own = (points - pose[:2, 3]) @ pose[:2, :2]
            top = pose[2, 3] - now.world_from_base[2, 3] + OBSTACLE_HEIGHT
            inside = (np.abs(own) <= np.array(robot.outline[:2]) / 2).all(axis=-1)
            height[inside] = np.clip(top, -_MAP_LIMIT, _MAP_LIMIT)
        return height

    def _seen(self) -> Float32Array:
        assert self._heights is not None
        top = float(self._now.world_from_base[2, 3]) + obstacle_height(self._rigs.observing)
        raise_to_points(self._heights, self.world_from_scanner, self.cloud.xyz, top)
        return np.stack(self._crop(self._heights)).astype(np.float32)

    def _state(self) -> Float32Array:
        now, goal = self._now, self._task.goal
        values = [*now.velocity[:2], now.turn_rate, now.roll, now.pitch, *now.wheel_speeds, now.slip]
        if self._has_goal and goal is not None:
            values = [*self._in_robot(goal), *values]
        return self._clipped("state", values)

    def _in_robot(self, point: Array) -> tuple[float, float]:
        """Return how far [m] ahead and to the left of the robot a point (2,) is, horizontally."""
        (x, y), (cos, sin) = point - self._now.xy, (np.cos(self._now.heading), np.sin(self._now.heading))
        return float(cos * x + sin * y), float(cos * y - sin * x)

    def _privileged(self) -> Float32Array:
        now, task, wheels = self._now, self._task, self._robot.physics.surroundings.contacts.wheels
        ahead = task.ahead(now.xy)
        along = np.zeros(2) if ahead is None else np.array(self._in_robot(ahead))
        along = along / max(float(np.linalg.norm(along)), 1e-9)
        left, clearance = task.left(now.xy), self._made.ground.clearance_at(now.xy)[0]
        own = [*now.world_from_base[:3, 3], *along, left if np.isfinite(left) else 1e4, max(clearance, -100.0)]
        return self._clipped(
            "privileged", [*self._state(), *own, *wheels.load, *wheels.friction[:, 0], *wheels.sinkage]
        )

    def _clipped(self, name: str, values: list[Any]) -> Float32Array:
        box = self._boxes[name]
        return np.clip(np.nan_to_num(np.array(values, np.float32)), box.low, box.high)

    def rendered(self) -> NDArray[np.uint8]:
        """Return the photograph (270, 480, 3) of the camera behind the robot."""
        rig = self._rigs.rendering
        world = self._made.sensed_by(rig)
        viewer: Sensor = world.once("renders", lambda: sensor_class(rig.sensors[0])(rig.sensors[0], world))
        photo: NDArray[np.uint8] = viewer.read(self._output(rig.sensors[0]), self._at()).photo
        return photo

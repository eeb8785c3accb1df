# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world with what tasks need of it: ray tracer, light, the planner's map and free nodes, heights.

A process keeps the last few of them, as one takes seconds to load; environments of one process share them.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.ground import bearing_field, slopes
from fieldtruth.drive.routes import RouteGrid
from fieldtruth.drive.soil import sinkage_at
from fieldtruth.drive.traversability import CELL, Blockage, Traversability
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.kernels.packets import Grid
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.robots import robot_body, with_robots
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.world.model import World

KEPT: Final = 4
"""Worlds in memory, 0.6 GB each of a park with its scene."""
OBSTACLE_HEIGHT: Final = 1.0
"""Height [m] above the ground that obstacles have in the map of heights."""
NOWHERE: Final = transforms.pose((0.0, 0.0, -1e4))
"""Pose of a robot that another one neither meets nor sees."""
_LARGEST: Final = 400.0  # [m] side of a world with a map of heights
_ROWS: Final = 256  # of the map that are looked up at once


class TaskWorld:
    """A world, with what is made of it at the first use.

    Args:
        world: the world.
        rig: the robot.
        light: of photographs.
        robots: names of robots, each of which the others see.
    """

    def __init__(self, world: World, rig: Rig, light: LightConfig, robots: Sequence[str] = ()) -> None:
        self.world, self.rig, self.light = with_robots(world, robots) if robots else world, rig, light
        self.others: Mapping[str, Array] = {}
        """Poses (4, 4) world_from_base of the robots that the next reading sees, by name."""
        self._moving = Moving([robot_body(self.world, name, rig, partial(self._pose_of, name)) for name in robots])
        self.ground = Traversability(world, rig)
        self.grid = RouteGrid(self.ground)
        self._sensed: dict[bool, SensorWorld] = {}

    def _pose_of(self, name: str, stamps_ns: NDArray[np.int64]) -> Array:
        return np.broadcast_to(self.others.get(name, NOWHERE), (len(stamps_ns), 4, 4))

    @cached_property
    def scene(self) -> Scene:
        """The world in the ray tracer, with its robots."""
        return Scene(self.world, self._moving)

    def sensed_by(self, rig: Rig) -> SensorWorld:
        """Return the world in which the sensors of a rig read; they see the robot if the rig is visible."""
        if rig.visible not in self._sensed:
            other = next(iter(self._sensed.values()), None)
            baked = other.baked if other is not None and rig.visible else None
            given: dict[str, Any] = {"scene": self.scene, "baked": baked, "moving": self._moving}
            self._sensed[rig.visible] = SensorWorld(self.world, rig, self.light, **given)
        return self._sensed[rig.visible]

    @cached_property
    def heights(self) -> Grid:
        """Heights [m] of the ground with its stones, every CELL; obstacles are ``OBSTACLE_HEIGHT`` above it.

        Raises:
            ConfigurationError: the world is too large.
        """
        if max(self.world.size) > _LARGEST:
            what = f"{self.world.size[0]:g} m x {self.world.size[1]:g} m"
            raise ConfigurationError(f"elevation needs a world of at most {_LARGEST:g} m x {_LARGEST:g} m, got {what}")
        ground, field = self.ground, bearing_field(self.world)
        x, y = (start + CELL * np.arange(count) for start, count in zip(ground.corner, ground.shape, strict=True))
        heights = np.empty(ground.shape, np.float32)
        for first in range(0, len(x), _ROWS):
            rows = slice(first, first + _ROWS)
            points = np.stack(np.meshgrid(x[rows], y, indexing="ij"), axis=-1)
            solid = ground.blockage_at(points.reshape(-1, 2)) == Blockage.OBSTACLE
            raised = OBSTACLE_HEIGHT * solid.reshape(points.shape[:2])
            heights[rows] = field.height_at(points[..., 0], points[..., 1]) + raised
        return Grid(heights, float(x[0]), float(y[0]), 1 / CELL)

    def unknown_heights(self) -> Grid:
        """Return a map like ``heights`` in which nothing is known."""
        grid = self.heights
        return grid._replace(values=np.full_like(grid.values, np.nan))

    @cached_property
    def _slope(self) -> Array:
        return np.hypot(*slopes(self.world.terrain.field, self.rig.robot.outline[0]))

    def slope_at(self, points: Array) -> Array:
        """Slope [deg] over the length of the robot at points (..., 2) [m]."""
        field, shape = self.world.terrain.field, self._slope.shape
        i, j = (
            np.clip(np.rint((points[..., k] - start) / field.spacing).astype(int), 0, shape[k] - 1)
            for k, start in enumerate((field.x0, field.y0))
        )
        return np.asarray(np.degrees(np.arctan(self._slope[i, j])))

    def sinkage_at(self, points: Array) -> Array:
        """Depth [m] to which a standing wheel sinks at points (..., 2) [m]."""
        robot = self.rig.robot
        load = robot.mass * GRAVITY * (1 - robot.caster_share) / len(robot.wheels.names)
        return sinkage_at(self.world, robot.wheels, load, points[..., 0], points[..., 1])


_worlds: Final[dict[Hashable, TaskWorld]] = {}


def kept(key: Hashable, make: Callable[[], TaskWorld]) -> TaskWorld:
    """Return the world of a key, made if it is not one of the last ``KEPT`` that were asked for in this process."""
    found = _worlds.pop(key, None) or make()
    _worlds[key] = found
    if len(_worlds) > KEPT:
        del _worlds[next(iter(_worlds))]
    return found

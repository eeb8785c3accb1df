# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A stream of messages, and the sensors that make its readings.

A reading depends only on its number, so parts of a recording can be made in any order and by any thread.
"""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Stamps
from fieldtruth.sense.robot_view import RobotView
from fieldtruth.sense.scene_sensor import SceneSensor
from fieldtruth.sensors.camera.config import Imager
from fieldtruth.sensors.lidar.message import Scan

PoseAt = Callable[[int | Stamps], Array]
"""``world_from_base`` (4, 4) at a stamp [ns], or (n, 4, 4) at n."""


class CameraImages(Protocol):
    """Result of a camera: ``photo`` (h, w, 3) RGB, and ``label``, ``instance``, ``depth`` (h, w)."""

    @property
    def photo(self) -> NDArray[np.uint8]: ...  # noqa: D102
    @property
    def label(self) -> NDArray[np.uint8]: ...  # noqa: D102
    @property
    def instance(self) -> NDArray[np.uint32]: ...  # noqa: D102
    @property
    def depth(self) -> NDArray[np.float32]: ...  # noqa: D102


class Lidar(Protocol):
    """A LiDAR in a scene."""

    def scan(self, world_from_lidar: Array, stamp_ns: int = 0, number: int = 0) -> Scan:
        """Scan from a pose (4, 4), or from those at each column's beginning and at the end, (columns + 1, 4, 4).

        The number of the scan matters to a LiDAR with a signal only.
        """
        ...


class Camera(Protocol):
    """A camera in a scene."""

    def render(self, world_from_optical: Array, robot: RobotView | None = None) -> CameraImages:
        """Render from a pose (4, 4), with what the view sees of the robot."""
        ...


class SignalCamera(Camera, Protocol):
    """A camera with the signal of a real one."""

    def capture(
        self, imager: Imager, number: int, stamp_ns: int, world_from_base: PoseAt, robot: RobotView | None = None
    ) -> CameraImages:
        """Photograph ``number`` of a view at a stamp [ns]; the other images are those of the pose at the stamp."""
        ...


class Sensors(NamedTuple):
    """The sensors of one worker; they own buffers, so threads must not share them."""

    lidars: Mapping[str, Lidar] = MappingProxyType({})
    cameras: Mapping[str, Camera] = MappingProxyType({})
    others: Mapping[str, SceneSensor] = MappingProxyType({})
    """By name of the sensor; both views of a pair have the same camera."""
    robot: Mapping[str, RobotView] = MappingProxyType({})
    """What the views see of the robot, by name of the view; empty if they do not see it."""
    wide_ids: bool = False
    """Whether instance ids of their world need more than 16 bits."""


class Stream(NamedTuple):
    """Readings of one source: reading k is taken at ``stamps_ns[k]`` and makes one message for each of ``topics``."""

    topics: tuple[str, ...]
    stamps_ns: Stamps
    messages: Callable[[int, Sensors], Iterable[bytes]]

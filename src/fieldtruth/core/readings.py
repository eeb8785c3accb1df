# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of sensors as arrays, wherever they come from: a bag, or a simulation that is stepped.

Points are in the sensor's frame, which is x forward, y left, z up; of images in the optical frame: x right, y down, z
forward. Stamps are integers in nanoseconds. None stands for what a sensor does not measure, or a bag does not have.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array

Ids = NDArray[np.uint16] | NDArray[np.uint32]
"""Instance ids: rows of the list of objects; 0 is the robot, or no object."""
Stamps = Any
"""Stamp [ns]: int of a reading, (n,) int64 of a series of readings, whose arrays have n rows."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """Base of all readings; those of small sensors may be a series of n readings, with arrays of n rows."""

    stamp_ns: Stamps
    """Time of the reading [ns], of the run's clock."""
    header_ns: Stamps
    """Stamp of its message [ns], by the sensor's own clock: equal to ``stamp_ns`` of a sensor without one."""
    frame: str = ""
    """Name of the frame that it is in."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloud(Reading):
    """Points with finite coordinates, n of them, in the order in which they were measured."""

    xyz: NDArray[np.float32]
    """(n, 3) [m]."""
    label: NDArray[np.uint8]
    """(n,) class ids."""
    instance: NDArray[Any] | None = None
    """(n,) instance ids."""
    ring: NDArray[Any] | None = None
    column: NDArray[Any] | None = None
    """(n,) the ray that measured the point."""
    t_ns: NDArray[Any] | None = None
    """(n,) time [ns] of the ray after the stamp."""
    others: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """(n,) by name: other fields, such as ``reflectivity``."""
    names: tuple[str, ...] = ()
    """Of all fields as they are recorded, in their order."""

    def fields(self) -> dict[str, NDArray[Any]]:
        """Return all fields (n,) by name, as a bag has them: x, y, z, label, instance, ring, column, t, ..."""
        own: dict[str, NDArray[Any] | None] = dict(zip("xyz", self.xyz.T, strict=True))
        own |= {"label": self.label, "instance": self.instance, "ring": self.ring, "column": self.column}
        own |= {"t": self.t_ns, **self.others}
        return {name: values for name in self.names or own if (values := own.get(name)) is not None}


@dataclass(frozen=True, kw_only=True, eq=False)
class Image(Reading):
    """Images of one view of a camera, (h, w), from the same rays."""

    photo: NDArray[np.uint8] | None = None
    """(h, w, 3) RGB."""
    jpeg: bytes | None = None
    """The photograph as it is stored, if it is a JPEG."""
    label: NDArray[np.uint8] | None = None
    """(h, w) class ids."""
    depth: NDArray[np.float32] | None = None
    """(h, w) [m] along the optical axis; infinite for the sky."""
    instance: Ids | None = None
    """(h, w) instance ids."""
    normal: NDArray[np.float32] | None = None
    """(h, w, 3) unit normals of the surfaces towards the camera, in its optical frame; 0 for the sky."""
    flow: NDArray[np.float32] | None = None
    """(h, w, 2) [pixel] to the right and down to the camera's next image; NaN where that does not show the point."""
    part: NDArray[np.uint8] | None = None
    """(h, w) ``PlantPart``; 0 where no plant is."""
    passability: NDArray[np.float32] | None = None
    """(h, w, 2) Passability, 0 solid to 1 free, and the force [N] that presses the object down, infinite if solid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Inertial(Reading):
    """Reading of an inertial measurement unit in its own frame (REP-145)."""

    angular_velocity: Array
    """(3,) [rad/s]."""
    linear_acceleration: Array
    """(3,) specific force [m/s^2]: 9.81 upwards at rest."""
    orientation_wxyz: Array
    """(4,) unit quaternion from its frame to the world."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fix(Reading):
    """Position of the antenna of a GNSS receiver."""

    geodetic: Array
    """(3,) latitude, longitude [deg], ellipsoidal height [m]; NaN without a position."""
    covariance: Array
    """(3, 3) of east, north, up [m^2]; zeros if it is not known."""
    status: Any
    """Of sensor_msgs/NavSatStatus; negative without a position."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WheelSpeeds(Reading):
    """Angular speeds of wheels."""

    speed: Array
    """(wheels,) [rad/s], positive forwards."""
    names: tuple[str, ...] = ()
    """Of the wheels, like ``front_left``."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Joints(Reading):
    """State of joints."""

    names: tuple[str, ...]
    angle: Array
    """(joints,) [rad]."""
    speed: Array
    """(joints,) [rad/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Odometry(Reading):
    """Pose of a body in ``frame`` and its velocity in its own frame."""

    position: Array
    """(3,) [m]."""
    quaternion_wxyz: Array
    """(4,) from the body to ``frame``."""
    linear_velocity: Array
    """(3,) [m/s]."""
    angular_velocity: Array
    """(3,) [rad/s]."""
    child: str = ""
    """Name of the body's frame."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Message(Reading):
    """Message of any other type."""

    value: Any
    """With ROS's field names."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """Readings with the same stamp, by name of the sensor: ``frame["lidar"].xyz``."""

    stamp_ns: int
    readings: Mapping[str, Any]
    pose: Array | None = None
    """(4, 4) true ``world_from_base`` at the stamp, if it is known."""

    def __getitem__(self, sensor: str) -> Any:
        return self.readings[sensor]

    def __contains__(self, sensor: object) -> bool:
        return sensor in self.readings

    def __iter__(self) -> Iterator[str]:
        return iter(self.readings)

    def __len__(self) -> int:
        return len(self.readings)

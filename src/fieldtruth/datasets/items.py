# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Items of a sample: for each its sensor, its stream, and the conversion of the message to an array."""

from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag.reader import BagError
from fieldtruth.core.arrays import Array, Counts

Sensor = Literal["camera", "lidar"]


class Sample(TypedDict, total=False):
    """One frame: ``run`` and ``stamp_ns``, and the keys of the requested items.

    Arrays are new and may be changed. The camera's optical frame has x right, y down, z forward; the LiDAR's frame and
    ``base_link`` have x forward, y left, z up.
    """

    run: str
    """Name of the run."""
    stamp_ns: int
    """Stamp [ns] of the anchor sensor's message."""
    camera_stamp_ns: int
    """Stamp [ns] of the image items."""
    lidar_stamp_ns: int
    """Stamp [ns] of the cloud items."""
    image: NDArray[np.uint8]
    """(3, h, w) RGB of the photograph."""
    mask: Counts
    """(h, w) class ids."""
    depth: NDArray[np.float32]
    """(h, w) [m] along the optical axis; infinite for the sky."""
    instance_mask: NDArray[np.int32]
    """(h, w) instance ids; 0 for sky and robot."""
    normals: NDArray[np.float32]
    """(3, h, w) unit normals of the surfaces, towards the camera, in its optical frame; 0 for the sky."""
    flow: NDArray[np.float32]
    """(2, h, w) [pixel] motion to the right and down to the camera's next image; NaN where that does not show it."""
    cloud: NDArray[np.float32]
    """(n, 3) x, y, z [m] of the returns in the LiDAR's frame; n varies."""
    labels: Counts
    """(n,) class ids."""
    instances: NDArray[np.int32]
    """(n,) instance ids."""
    reflectivity: NDArray[np.float32]
    """(n,) reflectance of a matt surface that faces the LiDAR and is as bright; 0 of a LiDAR without a signal."""
    rays: Counts
    """(n, 3) ring, column, and time [ns] after ``lidar_stamp_ns``: 0 where the cloud has no field ``t``."""
    world_from_base: Array
    """(4, 4) true pose of base_link at ``stamp_ns``."""
    world_from_camera: Array
    """(4, 4) true pose of the camera's optical frame at ``camera_stamp_ns``."""
    world_from_lidar: Array
    """(4, 4) true pose of the LiDAR's frame at ``lidar_stamp_ns``."""
    K: Array
    """(3, 3) pinhole matrix [pixel] of the camera; the centre of the first pixel is (0, 0). Of a panorama zeros."""
    D: Array
    """(n,) coefficients of the lens, as in CameraInfo."""
    distortion_model: str
    """Model of the lens, as in CameraInfo: plumb_bob with five zeros is a pinhole."""
    base_from_camera: Array
    """(4, 4) mount of the camera's optical frame."""
    base_from_lidar: Array
    """(4, 4) mount of the LiDAR's frame."""


class Item(NamedTuple):
    """Sensor, what it publishes, and conversion to an array from the message and the output ids by class."""

    sensor: Sensor
    stream: str
    """Of a camera, as in ``Imager.topics``; of a LiDAR ``points``."""
    value: Callable[[Any, Counts], NDArray[Any]]


def _image(message: Any, ids: Counts) -> NDArray[np.uint8]:
    return np.ascontiguousarray(read.image(message).transpose(2, 0, 1))


def _mask(message: Any, ids: Counts) -> Counts:
    mask: Counts = np.take(ids, read.labels(read.image(message)))
    return mask


def _depth(message: Any, ids: Counts) -> NDArray[np.float32]:
    return read.depth(message).astype(np.float32)


def _instance_mask(message: Any, ids: Counts) -> NDArray[np.int32]:
    return read.instances(message).astype(np.int32)


def _normals(message: Any, ids: Counts) -> NDArray[np.float32]:
    return np.ascontiguousarray(read.normals(message).transpose(2, 0, 1), np.float32)


def _flow(message: Any, ids: Counts) -> NDArray[np.float32]:
    return np.ascontiguousarray(read.flow(message).transpose(2, 0, 1), np.float32)


def _cloud(message: Any, ids: Counts) -> NDArray[np.float32]:
    return _columns(_returns(message), ("x", "y", "z"), np.dtype(np.float32))


def _labels(message: Any, ids: Counts) -> Counts:
    """Return class ids; clouds of the paper's data set have no field for them and store them as intensity."""
    points = _returns(message)
    field = "label" if "label" in (points.dtype.names or ()) else "intensity"
    exact = _columns(points, (field,), np.dtype(np.float64))[:, 0]
    label = exact.astype(np.intp)
    wrong = (label != exact) | (label < 0) | (label >= len(ids))
    if wrong.any():
        raise BagError(f"{field} of a point must be a class id, got {exact[wrong][0]:g}")
    found: Counts = np.take(ids, label)
    return found


def _instances(message: Any, ids: Counts) -> NDArray[np.int32]:
    return _columns(_returns(message), ("instance",), np.dtype(np.int32))[:, 0]


def _rays(message: Any, ids: Counts) -> Counts:
    points = _returns(message)
    rays = np.zeros((len(points), 3), np.int64)
    rays[:, :2] = _columns(points, ("ring", "column"), np.dtype(np.int64))
    if "t" in (points.dtype.names or ()):
        rays[:, 2] = points["t"]
    return rays


def _reflectivity(message: Any, ids: Counts) -> NDArray[np.float32]:
    return read.reflectivity(_returns(message))


def _returns(message: Any) -> NDArray[np.void]:
    """Return the points with finite coordinates; organised clouds have NaN for rays without a return."""
    points = read.points(message)
    finite = np.isfinite(_columns(points, ("x", "y", "z"), np.dtype(np.float32))).all(axis=1)
    return points if finite.all() else points[finite]


def _columns(points: NDArray[np.void], fields: tuple[str, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return fields of a structured array as (n, len(fields))."""
    known = points.dtype.names or ()
    for field in fields:
        if field not in known:
            raise BagError(f"points of the cloud have no field {field!r}; available: {', '.join(known)}")
    values = np.empty((len(points), len(fields)), dtype)
    for column, field in enumerate(fields):
        values[:, column] = points[field]
    return values


ITEMS: Final[dict[str, Item]] = {
    "image": Item("camera", "photograph", _image),
    "mask": Item("camera", "tag", _mask),
    "depth": Item("camera", "depth", _depth),
    "instance_mask": Item("camera", "instances", _instance_mask),
    "normals": Item("camera", "normals", _normals),
    "flow": Item("camera", "flow", _flow),
    "cloud": Item("lidar", "points", _cloud),
    "labels": Item("lidar", "points", _labels),
    "instances": Item("lidar", "points", _instances),
    "reflectivity": Item("lidar", "points", _reflectivity),
    "rays": Item("lidar", "points", _rays),
}
"""Items that are readings of a sensor."""

GEOMETRY: Final = ("pose", "calibration")
"""Items about the sensors of the other items."""

RAGGED: Final = frozenset(name for name, item in ITEMS.items() if item.sensor == "lidar")
"""Items whose length varies from frame to frame."""

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Items of a sample: for each its sensor, and the conversion of its reading to an array."""

from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.errors import BagError
from fieldtruth.bag.readings import reflectivity
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.readings import Cloud

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
    """Sensor, part of its reading, and conversion to an array from the reading and the output ids by class."""

    sensor: Sensor
    part: str
    """Of a camera the field of ``Image``; of a LiDAR ``main``."""
    value: Callable[[Any, Counts], NDArray[Any]]


def _channels_first(image: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(image.transpose(2, 0, 1))


def _ids(label: NDArray[np.uint8], ids: Counts) -> Counts:
    mapped: Counts = np.take(ids, label)
    return mapped


def _field(cloud: Cloud, field: str) -> NDArray[Any]:
    values: NDArray[Any] | None = getattr(cloud, field)
    if values is None:
        raise BagError(f"points of the cloud have no field {field!r}; available: {', '.join(cloud.fields())}")
    return values


def _rays(cloud: Cloud, ids: Counts) -> Counts:
    t = np.zeros(len(cloud.xyz), np.int64) if cloud.t_ns is None else cloud.t_ns
    return np.stack([_field(cloud, "ring"), _field(cloud, "column"), t], axis=1, dtype=np.int64)


ITEMS: Final[dict[str, Item]] = {
    "image": Item("camera", "photo", lambda image, ids: _channels_first(image.photo)),
    "mask": Item("camera", "label", lambda image, ids: _ids(image.label, ids)),
    "depth": Item("camera", "depth", lambda image, ids: image.depth.astype(np.float32)),
    "instance_mask": Item("camera", "instance", lambda image, ids: image.instance.astype(np.int32)),
    "normals": Item("camera", "normal", lambda image, ids: _channels_first(image.normal).astype(np.float32)),
    "flow": Item("camera", "flow", lambda image, ids: _channels_first(image.flow).astype(np.float32)),
    "cloud": Item("lidar", "main", lambda cloud, ids: cloud.xyz.astype(np.float32)),
    "labels": Item("lidar", "main", lambda cloud, ids: _ids(cloud.label, ids)),
    "instances": Item("lidar", "main", lambda cloud, ids: _field(cloud, "instance").astype(np.int32)),
    "reflectivity": Item("lidar", "main", lambda cloud, ids: reflectivity(cloud)),
    "rays": Item("lidar", "main", _rays),
}
"""Items that are readings of a sensor."""

GEOMETRY: Final = ("pose", "calibration")
"""Items about the sensors of the other items."""

RAGGED: Final = frozenset(name for name, item in ITEMS.items() if item.sensor == "lidar")
"""Items whose length varies from frame to frame."""

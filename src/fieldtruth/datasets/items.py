# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Items of samples: what they are, and how they are made of readings."""

from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.file import BagError
from fieldtruth.bag.movers import Movers
from fieldtruth.bag.readings import reflectivity
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.readings import Cloud, Image, Reading

Anchor = Literal["camera", "lidar"]


class Role(NamedTuple):
    """Names of the sensors whose readings have one type, whatever their kind, in arguments, samples and messages."""

    key: Anchor
    """Argument of ``RunDataset``, and word in keys of samples."""
    noun: str
    part: str
    """Main part of a reading, which an anchor without items has."""
    item: str
    """Item of that part."""


ROLES: Final[dict[type[Reading], Role]] = {
    Image: Role("camera", "camera", "photo", "image"),
    Cloud: Role("lidar", "LiDAR", "main", "cloud"),
}


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
    moving_mask: NDArray[np.bool_]
    """(h, w) whether the object there moves at ``camera_stamp_ns``."""
    normals: NDArray[np.float32]
    """(3, h, w) unit normals of the surfaces, towards the camera, in its optical frame; 0 for the sky."""
    flow: NDArray[np.float32]
    """(2, h, w) [pixel] motion to the right and down to the camera's next image; NaN where that does not show it."""
    part_mask: Counts
    """(h, w) ``PlantPart``; 0 where no plant is."""
    passability_mask: NDArray[np.float32]
    """(2, h, w) passability, 0 solid to 1 free, and force [N], infinite where solid."""
    cloud: NDArray[np.float32]
    """(n, 3) x, y, z [m] of the returns in the LiDAR's frame; n varies."""
    labels: Counts
    """(n,) class ids."""
    instances: NDArray[np.int32]
    """(n,) instance ids."""
    moving: NDArray[np.bool_]
    """(n,) whether the object of the point moves at ``lidar_stamp_ns``."""
    parts: Counts
    """(n,) ``PlantPart``; 0 where no plant is."""
    passability: NDArray[np.float32]
    """(n, 2) passability, 0 solid to 1 free, and force [N], infinite where solid."""
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


class Meaning(NamedTuple):
    """What the readings of a run mean."""

    ids: Counts
    """Output ids by class."""
    movers: Movers = Movers()
    """What moves."""


class Item(NamedTuple):
    """Type and part of a reading, and conversion to an array from the reading and what it means."""

    reading: type[Reading]
    part: str
    """Field of an ``Image``; of a ``Cloud`` always ``main``."""
    value: Callable[[Any, Meaning], NDArray[Any]]


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


def _extra(cloud: Cloud, field: str, extra: str) -> NDArray[Any]:
    if field not in cloud.others:
        how = f"`fieldtruth generate NAME --extras {extra}` records it"
        raise BagError(f"points of the cloud have no field {field!r}; {how}")
    return cloud.others[field]


def _passability(cloud: Cloud) -> NDArray[np.float32]:
    return np.stack([_extra(cloud, field, "passability") for field in ("passability", "force")], 1, dtype=np.float32)


def _moving(reading: Cloud | Image, meaning: Meaning) -> NDArray[np.bool_]:
    instance: Any = _field(reading, "instance") if isinstance(reading, Cloud) else reading.instance
    return meaning.movers.moving(instance, reading.stamp_ns)


def _rays(cloud: Cloud, meaning: Meaning) -> Counts:
    t = np.zeros(len(cloud.xyz), np.int64) if cloud.t_ns is None else cloud.t_ns
    return np.stack([_field(cloud, "ring"), _field(cloud, "column"), t], axis=1, dtype=np.int64)


ITEMS: Final[dict[str, Item]] = {
    "image": Item(Image, "photo", lambda image, meaning: _channels_first(image.photo)),
    "mask": Item(Image, "label", lambda image, meaning: _ids(image.label, meaning.ids)),
    "depth": Item(Image, "depth", lambda image, meaning: image.depth.astype(np.float32)),
    "instance_mask": Item(Image, "instance", lambda image, meaning: image.instance.astype(np.int32)),
    "moving_mask": Item(Image, "instance", _moving),
    "normals": Item(Image, "normal", lambda image, meaning: _channels_first(image.normal).astype(np.float32)),
    "flow": Item(Image, "flow", lambda image, meaning: _channels_first(image.flow).astype(np.float32)),
    "part_mask": Item(Image, "part", lambda image, meaning: image.part.astype(np.int64)),
    "passability_mask": Item(Image, "passability", lambda image, meaning: _channels_first(image.passability)),
    "cloud": Item(Cloud, "main", lambda cloud, meaning: cloud.xyz.astype(np.float32)),
    "labels": Item(Cloud, "main", lambda cloud, meaning: _ids(cloud.label, meaning.ids)),
    "instances": Item(Cloud, "main", lambda cloud, meaning: _field(cloud, "instance").astype(np.int32)),
    "moving": Item(Cloud, "main", _moving),
    "parts": Item(Cloud, "main", lambda cloud, meaning: _extra(cloud, "part", "parts").astype(np.int64)),
    "passability": Item(Cloud, "main", lambda cloud, meaning: _passability(cloud)),
    "reflectivity": Item(Cloud, "main", lambda cloud, meaning: reflectivity(cloud)),
    "rays": Item(Cloud, "main", _rays),
}
"""Items that are readings of a sensor."""
GEOMETRY: Final = ("pose", "calibration")
"""Items about the sensors of the other items."""
RAGGED: Final = frozenset(name for name, item in ITEMS.items() if item.reading is Cloud)
"""Items whose length varies from frame to frame."""
DEFAULT_ITEMS: Final = ("image", "mask")

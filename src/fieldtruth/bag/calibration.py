# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Mounts of the sensors and projection of the cameras, from /tf_static and CameraInfo."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import matrix
from fieldtruth.bag.reader import BagError, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.sensors.camera.config import Imager
from fieldtruth.sensors.lidar.config import LidarConfig

BASE: Final = "base_link"


@dataclass(frozen=True)
class StaticFrames:
    """The fixed frames of a robot: ``parents[child]`` is the parent and ``parent_from_child`` (4, 4)."""

    parents: Mapping[str, tuple[str, Array]]
    source: str
    """The bag, or other source, for error messages."""

    def base_from(self, frame: str) -> Array:
        """Return base_link from ``frame``, (4, 4), composed along their chains of parents.

        Raises:
            BagError: unknown frame, or one that is not connected to base_link.
        """
        frame = frame.strip("/")
        known = {BASE, *self.parents, *(parent for parent, _ in self.parents.values())}
        if frame not in known:
            raise BagError(f"/tf_static of {self.source} has no frame {frame!r}; available: {', '.join(sorted(known))}")
        (root, root_from_frame), (base_root, root_from_base) = self._to_root(frame), self._to_root(BASE)
        if root != base_root:
            raise BagError(f"/tf_static of {self.source} does not connect {frame!r} with {BASE!r}")
        return frames.inverse(root_from_base) @ root_from_frame

    def _to_root(self, frame: str) -> tuple[str, Array]:
        """Return the root of a frame's tree, and ``root_from_frame``."""
        root_from_frame: Array = np.eye(4)
        for _ in self.parents:
            if frame not in self.parents:
                break
            frame, parent_from_child = self.parents[frame]
            root_from_frame = parent_from_child @ root_from_frame
        if frame in self.parents:
            raise BagError(f"/tf_static of {self.source} has a cycle at {frame!r}")
        return frame, root_from_frame


@dataclass(frozen=True)
class Calibration:
    """Geometry of a camera with one or two views, and of a LiDAR; views by name: left and right of the paper's pair."""

    width: int
    height: int
    """Size [pixel] of the images of all views."""
    projection: Mapping[str, Array]
    """P (3, 4) [pixel] by view, of points [m] in the optical frame of the first; the right one holds the baseline."""
    base_from_lidar: Array
    """(4, 4) from the frame of the clouds."""
    base_from_optical: Mapping[str, Array]
    """(4, 4) by view, from the optical frame (x right, y down, z forward)."""
    static: StaticFrames

    def base_from(self, frame: str) -> Array:
        """Return base_link from any frame of /tf_static, (4, 4).

        Raises:
            BagError: unknown frame, or one that is not connected to base_link.
        """
        return self.static.base_from(frame)


def read_calibration(run: Run, imagers: Sequence[Imager], lidar: LidarConfig) -> Calibration:
    """Read the calibration of the views of a camera, and of a LiDAR, of a run.

    Raises:
        BagError: /tf_static or a CameraInfo is missing or invalid, or the views differ in size.
    """
    topics = {imager.name: imager.topic_of("camera_info") for imager in imagers}
    run.require(table.TF_STATIC, *topics.values())
    static = read_static_frames(run)
    infos = {name: first_message(run, topic) for name, topic in topics.items()}
    projection = {name: np.asarray(info.P, np.float64).reshape(3, 4) for name, info in infos.items()}
    for name, matrix34 in projection.items():
        fx, fy = matrix34[0, 0], matrix34[1, 1]
        if not (np.isfinite(matrix34).all() and fx > 0.0 and fy > 0.0):
            raise BagError(f"{topics[name]} of {run.bag} has an invalid projection: P has fx {fx}, fy {fy}")
    sizes = [(int(info.width), int(info.height)) for info in infos.values()]
    if len({*sizes}) > 1:
        raise BagError(f"the cameras of {run.bag} differ in size: {sizes[0]} and {sizes[1]}")
    return Calibration(
        *sizes[0],
        projection,
        base_from_lidar(run, static, lidar),
        {name: static.base_from(info.header.frame_id) for name, info in infos.items()},
        static,
    )


def read_static_frames(run: Run) -> StaticFrames:
    """Read the fixed frames of a run.

    Raises:
        BagError: the bag has no /tf_static, or is damaged.
    """
    run.require(table.TF_STATIC)
    with open_bag(run.bag) as bag:
        decode = decoder(bag)
        stamped = [each for raw in bag.messages([table.TF_STATIC]) for each in decode(raw).transforms]
    parents: dict[str, tuple[str, Array]] = {}
    for each in stamped:  # of one that is published again, the last counts
        parent, child = each.header.frame_id.strip("/"), each.child_frame_id.strip("/")
        try:
            parent_from_child = matrix(each.transform)
        except BagError as error:
            raise BagError(f"/tf_static of {run.bag}: {parent!r} to {child!r}: {error}") from error
        if (before := parents.setdefault(child, (parent, parent_from_child))[0]) != parent:
            raise BagError(
                f"/tf_static of {run.bag} has {child!r} below both {before!r} and {parent!r}; one is allowed"
            )
        parents[child] = parent, parent_from_child
    return StaticFrames(parents, str(run.bag))


def base_from_lidar(run: Run, static: StaticFrames, lidar: LidarConfig) -> Array:
    """Return base_link from the frame of a LiDAR's clouds, (4, 4), or from that of its configuration without clouds.

    Raises:
        BagError: /tf_static does not connect the frame with base_link.
    """
    has_clouds = lidar.topic in run.counts
    return static.base_from(first_message(run, lidar.topic).header.frame_id if has_clouds else lidar.frame)


def first_message(run: Run, topic: str) -> Any:
    """Read the first message of a topic of the run, with ROS's field names.

    Raises:
        BagError: the bag is damaged.
    """
    with open_bag(run.bag) as bag:
        return decoder(bag)(next(bag.messages([topic])))

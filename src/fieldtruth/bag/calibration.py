# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Mounts of the sensors and projection of the cameras, from /tf_static and CameraInfo."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.bag_file import BagFile
from fieldtruth.bag.decode import matrix
from fieldtruth.bag.reader import BagError, decoder, open_bag
from fieldtruth.bag.sources import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array

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
        return transforms.inverse(root_from_base) @ root_from_frame

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


class Lens(NamedTuple):
    """What a camera publishes of its images: CameraInfo."""

    frame: str
    width: int
    height: int
    K: Array
    """(3, 3) [pixel]; the centre of the first pixel is (0, 0). Of a panorama zeros."""
    R: Array
    """(3, 3) rotation to the rectified frame."""
    P: Array
    """(3, 4) [pixel] of points [m] in the optical frame of the left camera; the right one holds the baseline."""
    D: Array
    """(n,) coefficients."""
    model: str
    """plumb_bob, equidistant, ..."""

    @property
    def is_pinhole(self) -> bool:
        """Whether K alone describes it."""
        return self.model in ("", "plumb_bob") and not self.D.any()


class Calibration:
    """Mounts of the sensors and lenses of the cameras, by name of the sensor; each is read when it is first asked."""

    def __init__(self, run: BagFile, sensors: Mapping[str, Source]) -> None:
        self._run, self._sensors = run, sensors
        self._lenses: dict[str, Lens] = {}

    def has_lens(self, sensor: str) -> bool:
        """Whether the bag has the lens of a view."""
        return self._sensors[sensor].info in self._run.counts

    def lens(self, sensor: str) -> Lens:
        """Return the lens of a view.

        Raises:
            BagError: the bag has none, or is damaged.
        """
        if sensor not in self._lenses:
            topic = self._sensors[sensor].info
            self._run.require(topic)
            m = first_message(self._run, topic)
            k, r, p = (np.array(getattr(m, name), np.float64).reshape(3, -1) for name in "KRP")
            d = np.array(m.D, np.float64)
            size = int(m.width), int(m.height)
            self._lenses[sensor] = Lens(str(m.header.frame_id), *size, k, r, p, d, str(m.distortion_model))
        return self._lenses[sensor]

    def projection(self, sensor: str) -> Array:
        """Return P (3, 4) [pixel] of a rectified view.

        Raises:
            BagError: the bag has none, or one that is no projection.
        """
        p = self.lens(sensor).P
        if not (np.isfinite(p).all() and p[0, 0] > 0.0 < p[1, 1]):
            topic = self._sensors[sensor].info
            raise BagError(f"{topic} of {self._run.bag} has an invalid projection: P has fx {p[0, 0]}, fy {p[1, 1]}")
        return p

    def frame(self, sensor: str) -> str:
        """Return the frame of a sensor's readings: that of its first message, without any that of its configuration."""
        source = self._sensors[sensor]
        topic = next((t for t in (source.info, *source.topics.values()) if t in self._run.counts), None)
        return source.frame if topic is None else str(first_message(self._run, topic).header.frame_id)

    def base_from(self, sensor: str) -> Array:
        """Return base_link from the frame of a sensor's readings, (4, 4).

        Raises:
            BagError: /tf_static is missing, or does not connect the frame with base_link.
        """
        return self.static.base_from(self.frame(sensor))

    @cached_property
    def static(self) -> StaticFrames:
        """The fixed frames."""
        return read_static_frames(self._run)


def read_static_frames(run: BagFile) -> StaticFrames:
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


def first_message(run: BagFile, topic: str) -> Any:
    """Read the first message of a topic of the run, with ROS's field names.

    Raises:
        BagError: the bag is damaged.
    """
    with open_bag(run.bag) as bag:
        return decoder(bag)(next(bag.messages([topic])))

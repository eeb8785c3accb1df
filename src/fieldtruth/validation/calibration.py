# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Where sensors sit and how cameras project: /tf_static and CameraInfo against the rig and against each other."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import matrix
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.robot_messages import rig_transforms
from fieldtruth.bag.sensor_messages import camera_matrix, optical_frame, projection_matrix
from fieldtruth.core import frames
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.experiment.rig import CameraConfig
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.subject import Examiner, Subject, place_of

F8 = NDArray[np.float64]

MOUNT_BOUND: Final = 1e-9
"""[m] and of a rotation's matrix, whose way through a quaternion rounds at 1e-16."""
PIXEL_BOUND: Final = 1e-6
"""[pixel] of focal lengths, centres and the baseline's product, which are up to some thousands."""
UNIT_BOUND: Final = 1e-6


class Calibration(Examiner):
    """Fixed frames and cameras."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self.topics = [
            name for name in (table.TF_STATIC, *map(table.camera_info, table.SIDES)) if name in subject.run.counts
        ]
        self._mounts = subject.law("frames sit where the rig has them", MOUNT_BOUND, "m or of a rotation")
        self._unit = subject.law("fixed rotations are unit quaternions", UNIT_BOUND, "from length 1", minor=True)
        self._once = subject.law("/tf_static is there once", minor=True)
        self._lens = subject.law("K and P are those of the fields of view", PIXEL_BOUND, "pixel")
        self._plain = subject.law("cameras are rectified pinholes: R is the identity, D zero, P is K, nothing is cut")
        self._baseline = subject.law(
            "the baseline in P is the one between the frames of /tf_static", PIXEL_BOUND, "pixel"
        )
        self._same = subject.law("CameraInfo never changes")
        self._first: dict[str, tuple[bytes, Any]] = {}
        self._published = 0
        self._metres = 0.0

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        if raw.topic == table.TF_STATIC:
            self._published += 1
            for each in message.transforms:
                q = each.transform.rotation
                length = float(np.linalg.norm([q.w, q.x, q.y, q.z]))
                if self._unit.measure(length - 1.0, f"{place_of(raw)}: {each.child_frame_id!r}"):
                    self._subject.parents[each.child_frame_id] = (each.header.frame_id, matrix(each.transform))
            return
        side = "left" if raw.topic == table.camera_info("left") else "right"
        body = raw.data[16 + len(message.header.frame_id.encode()) :]
        if side in self._first:
            self._same.see(body == self._first[side][0], lambda: place_of(raw))
        else:
            self._first[side] = (body, message)
            self._judge_lens(side, message)

    def finish(self) -> None:
        """See the end of the bag."""
        if self._subject.binding and table.TF_STATIC in self.topics:
            self._once.see(self._published == 1, f"{self._published} messages of {table.TF_STATIC}")
        if self._subject.parents:
            self._judge_mounts()
        if len(self._first) == len(table.SIDES):
            self._judge_baseline()

    def results(self) -> list[Check]:
        """Calibration."""
        parts = [f"{self._mounts.seen} frames sit as in the rig ({self._mounts.margin})"] * bool(self._mounts.seen)
        if self._lens.seen:
            parts.append(f"K and P of {len(self._first)} cameras: {self._lens.margin}")
        if self._baseline.seen:
            parts.append(f"baseline {self._metres:.4f} m in P as in /tf_static")
        laws = [self._mounts, self._unit, self._once, self._lens, self._plain, self._baseline, self._same]
        return [check_of("calibration", laws, "; ".join(parts), "there is neither /tf_static nor CameraInfo")]

    def _judge_mounts(self) -> None:
        parents = self._subject.parents
        for (parent, child), true in rig_transforms(self._subject.rig).items():
            told = parents.get(child)
            if told is None or told[0] != parent:
                self._mounts.measure(np.nan, f"{child!r} is no child of {parent!r}")
            else:
                self._mounts.measure(float(np.abs(told[1] - true).max()), f"{child!r} in {parent!r}")

    def _judge_lens(self, side: str, info: Any) -> None:
        place = f"camera {side}"
        k, p = np.reshape(info.K, (3, 3)), np.reshape(info.P, (3, 4))
        roi = info.roi
        cut = (info.binning_x, info.binning_y, roi.x_offset, roi.y_offset, roi.height, roi.width, int(roi.do_rectify))
        plain = np.array_equal(np.reshape(info.R, (3, 3)), np.eye(3)) and not np.any(info.D) and not any(cut)
        self._plain.see(plain and info.distortion_model == "plumb_bob" and np.array_equal(p[:, :3], k), place)
        config = self._subject.rig.cameras
        size = (info.width, info.height)
        if self._subject.binding:
            self._lens.see(size == (config.width, config.height), f"{place}: {size[0]} x {size[1]} pixels")
        else:  # the fields of view of the default camera, whatever its size
            config = CameraConfig.model_construct(**{**dict(config), "width": info.width, "height": info.height})
        residual = max(
            float(np.abs(k - camera_matrix(config)).max()),
            float(np.abs(p - projection_matrix(config, "left" if side == "left" else "right")).max()),
        )
        self._lens.measure(residual, place)

    def _judge_baseline(self) -> None:
        p = {side: np.reshape(info.P, (3, 4)) for side, (_, info) in self._first.items()}
        try:
            static = self._subject.frames
            left, right = (static.base_from(optical_frame(side)) for side in table.SIDES)
        except FieldtruthError:
            return  # what is wrong with the frames is told by the mounts
        self._metres = float((frames.inverse(left) @ right)[0, 3])
        residual = p["right"][0, 3] + p["right"][0, 0] * self._metres, p["left"][0, 3]
        self._baseline.measure(float(np.abs(residual).max()), f"{self._metres:.6f} m between the cameras")

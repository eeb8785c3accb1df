# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A run's calibration as YAML, for people and programs: how the cameras project and where every sensor sits."""

from contextlib import suppress
from typing import Any

import numpy as np
import yaml

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import BASE, first_message, read_static_frames
from fieldtruth.bag.reader import BagError
from fieldtruth.bag.run import Run
from fieldtruth.bag.types import F8
from fieldtruth.core import frames

_HEADER = """\
# K, R, P, D: as in ROS's CameraInfo [pixel]; (0, 0) is the centre of the first pixel.
# frames: translation [m] and quaternion of the frame in its parent; base_link_from_frame takes points to base_link.
# base_link: x forward, y left, z up. Optical frames: x right, y down, z forward.
"""


def calibration_yaml(run: Run) -> str:
    """YAML of CameraInfo and /tf_static; what the run lacks of them is not there, empty if that is all.

    Raises:
        BagError: the bag is damaged.
    """
    sides = [side for side in table.SIDES if table.camera_info(side) in run.counts]
    cameras = {side: first_message(run, table.camera_info(side)) for side in sides}
    content: dict[str, Any] = {}
    if cameras:
        content["cameras"] = {side: _camera(info) for side, info in cameras.items()}
    if "right" in cameras and cameras["right"].P[0]:
        content["baseline_m"] = float(-cameras["right"].P[3] / cameras["right"].P[0])
    if table.TF_STATIC in run.counts:
        content["frames"] = _frames(run)
    if not content:
        return ""
    return _HEADER + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)


def _camera(info: Any) -> dict[str, Any]:
    return {
        "frame": str(info.header.frame_id),
        "width": int(info.width),
        "height": int(info.height),
        "distortion_model": str(info.distortion_model),
        "D": np.asarray(info.D, np.float64).tolist(),
        **{name: np.reshape(np.asarray(getattr(info, name), np.float64), (3, -1)).tolist() for name in ("K", "R", "P")},
    }


def _frames(run: Run) -> dict[str, Any]:
    static = read_static_frames(run)
    described: dict[str, Any] = {}
    for frame, (parent, parent_from_frame) in static.parents.items():
        wxyz = frames.quaternion_wxyz_from_rotation(parent_from_frame[:3, :3])
        described[frame] = {
            "parent": parent,
            "translation": _rounded(parent_from_frame[:3, 3]),
            "quaternion_xyzw": _rounded(frames.xyzw_from_wxyz(wxyz)),
        }
        with suppress(BagError):  # a frame that hangs on none of the robot's
            described[frame][f"{BASE}_from_frame"] = _rounded(static.base_from(frame))
    return described


def _rounded(values: F8) -> Any:
    """Values as lists; what is below 1e-12 is rounding and becomes 0."""
    return (np.round(values, 12) + 0.0).tolist()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Static frames are chained to base_link, and the calibration of a run matches the paper."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import StaticFrames
from fieldtruth.bag.run import open_run

F8 = NDArray[np.float64]


def moved(x: float, yaw_deg: float = 0.0) -> F8:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", yaw_deg, degrees=True).as_matrix()
    pose[0, 3] = x
    return pose


def test_static_frames_are_chained_to_base_link() -> None:
    static = StaticFrames(
        {
            "base_link": ("base_footprint", moved(10.0)),
            "mast": ("base_link", moved(1.0, 90.0)),
            "lidar": ("mast", moved(2.0)),
            "stray": ("nowhere", moved(0.0)),
        },
        "a.bag",
    )
    # The mast is 1 m ahead and rotated to the left, so that the LiDAR, 2 m along it, is 2 m to the left.
    assert np.allclose(static.base_from("lidar")[:3, 3], [1.0, 2.0, 0.0])
    assert np.allclose(static.base_from("lidar")[:3, 0], [0.0, 1.0, 0.0])
    assert np.allclose(static.base_from("base_footprint")[:3, 3], [-10.0, 0.0, 0.0])
    assert np.array_equal(static.base_from("base_link"), np.eye(4))
    with pytest.raises(BagError, match=r"a\.bag has no frame 'velodyne'; available: base_footprint, base_link, "):
        static.base_from("velodyne")
    with pytest.raises(BagError, match="does not connect 'stray' with 'base_link'"):
        static.base_from("stray")
    circle = StaticFrames({"a": ("b", moved(1.0)), "b": ("a", moved(1.0)), "base_link": ("b", moved(1.0))}, "a.bag")
    with pytest.raises(BagError, match="has a cycle at "):
        circle.base_from("a")


def test_calibration_of_a_run_matches_the_paper(small_run: Path) -> None:
    run = open_run(small_run)
    calibration = run.calibration
    assert calibration.lens("stereo/left")[1:3] == (160, 92)
    assert np.allclose(calibration.base_from("lidar")[:3], np.c_[np.eye(3), [0.09, 0.0, 0.826]])
    axes = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # right, down, forward
    for side, y in (("left", 0.06), ("right", -0.06)):
        assert np.allclose(calibration.base_from(f"stereo/{side}")[:3], np.c_[axes, [0.15, y, 0.72]], atol=1e-12)
    assert calibration.projection("stereo/right")[0, 3] / calibration.projection("stereo/right")[0, 0] == pytest.approx(
        -0.12
    )
    assert np.allclose(calibration.static.base_from("GNSS_link")[:3, 3], [0.10, 0.0, 0.89])

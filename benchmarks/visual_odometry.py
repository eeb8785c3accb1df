# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Visual odometry on a stereo pair with OpenCV alone, against the true poses of the left camera.

Run: python benchmarks/visual_odometry.py RUN [--out estimate.tum]      (pip install opencv-python-headless evo)

Corners of the left photograph (Shi and Tomasi) are tracked to the right one, which gives their position, and to the
next left one (Lucas and Kanade); the motion is that which explains the tracks of most (RANSAC). No map, no loop.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from evo.core.trajectory import PoseTrajectory3D
from numpy.typing import NDArray
from slam import compared, show

import fieldtruth as ft
from fieldtruth.bag.decode import image
from fieldtruth.bag.geometry import first_message, read_static_frames, seconds
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.arrays import Array
from fieldtruth.exporters.frames import first_views

Grey = NDArray[np.uint8]
Points = NDArray[np.float32]

CORNERS: Final = 1500
WINDOW: Final = (21, 21)  # [pixel]
BACK: Final = 0.5
"""Greatest distance [pixel] of a corner from where it comes back to, tracked forth and back."""
LEAST: Final = 1.0
"""Least disparity [pixel], where the depth is known to some 20 %."""


class Pair(NamedTuple):
    """Photographs of one stamp."""

    stamp_ns: int
    left: Grey
    right: Grey


def pairs(run: Run) -> Iterator[Pair]:
    """Grey photographs of the first stereo pair."""
    topics = [view.topics["photo"] for view in first_views(run)]
    waiting: dict[int, dict[str, Any]] = {}
    for reading in ft.read_bag(run.bag, topics):
        found = waiting.setdefault(reading.stamp_ns, {})
        found[reading.topic] = cv2.cvtColor(image(reading.message), cv2.COLOR_RGB2GRAY)
        if len(found) == 2:
            del waiting[reading.stamp_ns]
            yield Pair(reading.stamp_ns, *(found[topic] for topic in topics))


def tracked(first: Grey, second: Grey, corners: Points) -> tuple[Points, NDArray[np.bool_]]:
    """Positions (n, 2) of corners in a second image, and which of them come back."""
    there, ok, _ = cv2.calcOpticalFlowPyrLK(first, second, corners, corners.copy(), winSize=WINDOW, maxLevel=4)
    back, ok_back, _ = cv2.calcOpticalFlowPyrLK(second, first, there, corners.copy(), winSize=WINDOW, maxLevel=4)
    close = np.linalg.norm(back - corners, axis=1) < BACK
    return np.asarray(there, np.float32), close & (ok.ravel() == 1) & (ok_back.ravel() == 1)


def motion(before: Pair, after: Pair, matrix: Array, scale: float) -> Array:
    """Pose (4, 4) of the left camera ``after`` in the one ``before``; 1 if too little was tracked."""
    found = cv2.goodFeaturesToTrack(before.left, CORNERS, 0.005, 8)
    corners = np.asarray(found, np.float32).reshape(-1, 2)
    in_right, seen = tracked(before.left, before.right, corners)
    later, kept = tracked(before.left, after.left, corners)
    disparity = corners[:, 0] - in_right[:, 0]
    good = seen & kept & (disparity > LEAST) & (np.abs(corners[:, 1] - in_right[:, 1]) < 1.0)
    if good.sum() < 12:
        return np.eye(4)
    depth = scale / disparity[good].astype(np.float64)
    rays = np.column_stack([corners[good], np.ones(good.sum())]) @ np.linalg.inv(matrix).T
    ok, turn, shift, _ = cv2.solvePnPRansac(
        rays * depth[:, None], later[good], matrix, None, iterationsCount=300, reprojectionError=1.0, confidence=0.999
    )
    after_from_before = np.eye(4)
    if ok:
        after_from_before[:3, :3], after_from_before[:3, 3] = cv2.Rodrigues(turn)[0], shift.ravel()
    return ft.transforms.inverse(after_from_before)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--out", type=Path, default=Path("estimate.tum"))
    options = parser.parse_args()
    run = open_run(options.run)
    left, right = first_views(run)
    info = first_message(run, left.info)
    matrix = np.asarray(info.K, np.float64).reshape(3, 3)
    scale = -float(first_message(run, right.info).P[3])
    cv2.setRNGSeed(0)
    poses, stamps, last = [np.eye(4)], list[int](), None
    for pair in pairs(run):
        if last is not None:
            poses.append(poses[-1] @ motion(last, pair, matrix, scale))
        stamps.append(pair.stamp_ns)
        last = pair
    times = np.array([float(seconds(stamp)) for stamp in stamps])
    estimate = PoseTrajectory3D(poses_se3=poses, timestamps=times)
    lines = np.column_stack([times, estimate.positions_xyz, np.roll(estimate.orientations_quat_wxyz, -1, axis=1)])
    np.savetxt(options.out, lines, fmt="%.9f")
    mount = read_static_frames(run).base_from(info.header.frame_id)
    trajectory = run.trajectory
    truth = PoseTrajectory3D(poses_se3=[trajectory.world_from_base(s) @ mount for s in stamps], timestamps=times)
    show(f"{run.name}, stereo", compared(truth, estimate), header=True)


if __name__ == "__main__":
    main()

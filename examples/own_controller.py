# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A controller that keeps the robot on a trail by the label image; docs/live.md has the same as a node of ROS 2."""

import sys

import numpy as np

import fieldtruth as ft


def follow(label: np.ndarray) -> tuple[float, float]:
    """Speed [m/s] and turn rate [rad/s] towards the middle of the trail in the lower half of a label image (h, w)."""
    height, width = label.shape
    columns = np.nonzero(label[height // 2 : height * 9 // 10] == ft.Label.TRAIL)[1]
    if not len(columns):
        return 0.0, 0.5  # look for it to the left
    return 0.5, 2.0 * (0.5 - float(columns.mean()) / width)


def main() -> None:
    """Drive along the trail of the park for some seconds, by default 60, and say where the robot was."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    rig = ft.paper_rig(cameras=ft.StereoConfig(width=160, height=90, rate_hz=10.0))
    sim = ft.Simulation("park_1", rig=rig, sensors=["stereo/left"])
    start = sim.reset(seed=0).pose[:3, 3]
    command, on_trail, steps = (0.0, 0.0), 0, 0
    while sim.seconds < seconds and not sim.done:
        frame = sim.step(0.1, command)
        if "stereo/left" in frame:
            command = follow(frame["stereo/left"].label)
        below = sim.scene.cast(frame.pose[:3, 3] + [0.0, 0.0, 0.5], [[0.0, 0.0, -1.0]])
        on_trail, steps = on_trail + int(below.label[0] == ft.Label.TRAIL), steps + 1
    far = np.linalg.norm(frame.pose[:3, 3] - start)
    print(f"{sim.seconds:.1f} s, {far:.1f} m from the start, {100 * on_trail / steps:.0f} % of the time on the trail")


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A controller of your own in the loop: it turns away from what the LiDAR sees ahead, and goes back in time once."""

import sys

import numpy as np

import fieldtruth as ft


def avoid(cloud: ft.Cloud) -> tuple[float, float]:
    """Speed [m/s] and turn rate [rad/s] from the points ahead that are no ground."""
    x, y = cloud.xyz[~np.isin(cloud.label, [ft.Label.GROUND, ft.Label.TRAIL]), :2].T
    ahead = (x > 0.0) & (np.hypot(x, y) < 5.0)
    side = float(np.sign(y[ahead].sum())) if ahead.any() else 0.0
    return 0.5, -0.4 * side


def main() -> None:
    """Drive in the park by the LiDAR for some seconds, by default 3."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3.0
    sim = ft.Simulation("park_1", sensors=["lidar", "imu"])
    start = sim.reset(seed=0).pose

    command, middle = (0.0, 0.0), None
    while sim.seconds < seconds and not sim.done:
        frame = sim.step(0.1, command)
        command = avoid(frame["lidar"])
        if middle is None and sim.seconds >= seconds / 2:
            middle = sim.save()
    end = sim.robot.pose[0]
    print(f"{sim.seconds:.1f} s, {np.linalg.norm(end - start[:3, 3]):.2f} m from the start by the own controller")

    assert middle is not None
    sim.restore(middle)
    while sim.seconds < seconds:
        sim.step(0.1, sensors=[])  # the follower of the route, and nothing is sensed
    print(f"{np.linalg.norm(sim.robot.pose[0] - end):.2f} m from there, if the follower drives from the middle on")


if __name__ == "__main__":
    main()

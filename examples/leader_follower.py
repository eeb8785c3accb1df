# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Two robots in one world: the second keeps 3 m behind the first by what its own LiDAR sees of it."""

import argparse

import numpy as np

import fieldtruth as ft

KEEP = 3.0
"""Distance [m] from the LiDAR to the leader."""
DUO = """
name: leader_follower
environment: park
rig: {lidar: {columns: 512, rings: 32}}
robots:
  leader: {route: {metres: {start: [-26, -5.5], waypoints: [[-17, -3], [-8, 0.5]]}}}
  follower:
    rig: {robot: jackal, lidar: {columns: 512, rings: 32}}
    route: {metres: {start: [-31, -5.9], waypoints: [[-17, -3], [-8, 0.5]]}}  # its start counts
"""


def follow(cloud: ft.Cloud) -> tuple[float, float]:
    """Speed [m/s] and turn rate [rad/s] towards the points of class robot; without any the robot stands."""
    points = cloud.xyz[cloud.label == ft.Label.ROBOT]
    if not len(points):
        return 0.0, 0.0
    x, y = points[:, :2].mean(axis=0)
    return float(np.clip(0.8 * (np.hypot(x, y) - KEEP), 0.0, 1.0)), float(np.clip(2.0 * np.arctan2(y, x), -1.0, 1.0))


def main() -> None:
    """Drive in the park for some seconds, and say how far they are apart."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", nargs="?", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    fleet = ft.Fleet(ft.parse_experiment(DUO), sensors=["lidar"])
    frames, command = fleet.reset(seed=0), (0.0, 0.0)
    while fleet.seconds < seconds and not fleet.done:
        frames = fleet.step(0.1, {"follower": command})
        command = follow(frames["follower"]["lidar"])
    apart = np.linalg.norm(frames["leader"].pose[:3, 3] - frames["follower"].pose[:3, 3])
    print(f"{fleet.seconds:.1f} s, {apart:.2f} m from base to base")


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Other sensors on the same robot: python own_sensors.py [OUT [SECONDS]]."""

import sys

import fieldtruth as ft


def main(out: str = "data", seconds: str = "2") -> None:
    """Record with a 32-ring LiDAR on a mast and a smaller, slower stereo camera that looks down a little."""
    park = ft.load_experiment("park_1")
    lidar = ft.LidarConfig(columns=1024, rings=32, max_range=80.0, mount=ft.Mount(xyz=(0.0, 0.0, 1.2)))
    down = (0.0, 100.0, 0.0)  # roll, pitch, yaw [deg]; 90 looks straight ahead
    camera = ft.StereoConfig(
        width=640,
        height=360,
        rate_hz=10.0,
        depth=True,
        baseline=0.2,
        mount=ft.Mount(xyz=(0.3, 0.0, 0.5), rpy_deg=down),
    )
    rig = ft.paper_rig(lidar=lidar, cameras=camera)
    experiment = park.model_copy(update={"name": "my_sensors", "rig": rig, "seconds": float(seconds)})

    bag = ft.generate(experiment, out)
    cloud = next(ft.read_bag(bag, topics=["/os1_cloud_node/points"]))
    points = ft.bag.points(cloud.message)
    print(f"{camera.baseline:.2f} m baseline, {len(points)} points on {points['ring'].max() + 1} rings")


if __name__ == "__main__":
    main(*sys.argv[1:])

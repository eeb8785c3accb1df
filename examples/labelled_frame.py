# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One LiDAR scan and one photograph of the park, labelled, from a pose of your choice."""

import numpy as np

import fieldtruth as ft


def main() -> None:
    """Look west from the middle of the park and count what is seen."""
    world = ft.load_world("park", seed=0)
    scene = ft.Scene(world)
    lidar = ft.Lidar(ft.LidarConfig(), scene)
    camera = ft.Camera(ft.CameraConfig(), ft.bake(scene))

    ground = float(world.terrain.field.height_at(0, 0))
    world_from_lidar = ft.transforms.pose((0, 0, ground + 0.96), (0, 0, 90))  # x, y, z [m]; roll, pitch, yaw [deg]
    scan = lidar.scan(world_from_lidar)  # scan.xyz, scan.label, scan.instance
    images = camera.render(world_from_lidar @ ft.OPTICAL)  # images.photo, .label, .depth, .instance

    points = np.bincount(scan.label, minlength=len(ft.CLASSES)) / scan.label.size
    pixels = np.bincount(images.label.ravel(), minlength=len(ft.CLASSES)) / images.label.size
    print(f"{'class':<18}{'points':>8}{'pixels':>8}")
    for semantic_class in ft.CLASSES:
        i = semantic_class.label
        if points[i] or pixels[i]:
            print(f"{semantic_class.name:<18}{points[i]:>8.1%}{pixels[i]:>8.1%}")


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Make the README's image: what the robot sees in the park as photograph, tag image and labelled cloud.

Run: python docs/park_picture.py [docs/park.jpg]
"""

import sys
from pathlib import Path

import numpy as np
import simplejpeg
from numpy.typing import NDArray

import fieldtruth as ft

CELL = 0.04  # [m] of ground that one pixel of the cloud's plan shows


def plan(points: NDArray[np.float32], label: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """Points (n, 3) with classes (n,) from above in their classes' flat colours, north-east up, (height, width, 3)."""
    image = np.full((height, width, 3), 60, np.uint8)
    order = np.argsort(points[:, 2])  # what is higher hides what is lower
    rows = np.rint(height / 2 - points[order, 0] / CELL).astype(int)
    columns = np.rint(width / 2 - points[order, 1] / CELL).astype(int)
    colours = ft.PALETTE[label[order]]
    for down in (0, 1):
        for right in (0, 1):
            inside = (rows + down >= 0) & (rows + down < height) & (columns + right >= 0) & (columns + right < width)
            image[rows[inside] + down, columns[inside] + right] = colours[inside]
    return image


def main(path: Path) -> None:
    """Render, scan, join side by side, write."""
    world = ft.load_world("park", seed=0)
    scene = ft.Scene(world)
    x, y = -12.0, -1.5
    ground = float(world.terrain.field.height_at(x, y))
    world_from_base = ft.transforms.pose((x, y, ground + 0.13228), (0.0, 0.0, 22.0))
    rig = ft.Rig()
    cameras, lidar = rig.enabled(ft.CameraConfig)[0], rig.enabled(ft.LidarConfig)[0]
    world_from_optical = world_from_base @ cameras.imagers()[0].base_from_optical
    images = ft.Camera(cameras, ft.bake(scene)).render(world_from_optical)
    scan = ft.Lidar(lidar, scene).scan(world_from_base @ lidar.mount.base_from_sensor)
    tags = ft.tag_image(images.label)
    left = np.concatenate([images.photo, tags])[::2, ::2]
    both = np.concatenate([left, plan(scan.xyz, scan.label, left.shape[0], 560)], axis=1)
    path.write_bytes(simplejpeg.encode_jpeg(np.ascontiguousarray(both), quality=78, colorspace="RGB"))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "park.jpg"))

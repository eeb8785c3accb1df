# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""LiDAR and camera in meshes of your own: a room of boxes, and the same furniture from a glTF file."""

import sys
from pathlib import Path
from typing import Any

import numpy as np

import fieldtruth as ft

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
FACES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]]  # fmt: skip
Z_UP = [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]  # glTF has y up


def box(name: str, label: str, size: tuple[float, float, float], at: tuple[float, float, float]) -> ft.MeshPart:
    """Make a box of a class that stands at a position [m]."""
    return ft.MeshPart((CORNERS * size + at, FACES), label=label, name=name, colour=(0.5, 0.4, 0.3))


def look(world: ft.World) -> None:
    """Print how many points of a scan, and pixels of a photograph, each object has."""
    scene = ft.Scene(world)
    world_from_lidar = ft.transforms.pose((0, 0, 1.5), (0, 0, 0))  # x, y, z [m]; roll, pitch, yaw [deg]
    scan = ft.Lidar(ft.LidarConfig(), scene).scan(world_from_lidar)
    images = ft.Camera(ft.CameraConfig(width=320, height=180), ft.bake(scene)).render(world_from_lidar @ ft.OPTICAL)
    for k, name in enumerate(world.object_names):
        points, pixels = np.sum(scan.instance == k), np.sum((images.instance == k) & (images.label != ft.Label.SKY))
        if points or pixels:
            print(f"{name:<14}{points:>8} points{pixels:>8} pixels")


def main() -> None:
    """Look around in a room, and in front of a file's meshes on flat ground."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    north_south = [box(f"{side} wall", "rock", (0.2, 6, 3), (x, 0, 0)) for side, x in (("north", 4), ("south", -4))]
    east_west = [box(f"{side} wall", "rock", (8, 0.2, 3), (0, y, 0)) for side, y in (("west", 3), ("east", -3))]
    floor = box("floor", "ground", (8, 6, 0.1), (0, 0, -0.1))
    furniture = [box("desk", "table", (1, 2, 0.8), (2, 0, 0)), box("bin", "trash bin", (0.4, 0.4, 0.9), (3, 2, 0))]
    look(ft.World.from_meshes([floor, *north_south, *east_west, *furniture]))

    try:
        import trimesh
    except ImportError:
        return
    scene: Any = trimesh.Scene()
    for part in furniture:
        scene.add_geometry(trimesh.Trimesh(*part.mesh), node_name=part.name)
    scene.apply_transform(np.linalg.inv(Z_UP))
    scene.export(folder / "furniture.glb")
    loaded = trimesh.load(folder / "furniture.glb")
    look(ft.World.from_meshes([ft.MeshPart(loaded, {"desk": "table", "*": "trash bin"}, pose=Z_UP)], ground=0.0))


if __name__ == "__main__":
    main()

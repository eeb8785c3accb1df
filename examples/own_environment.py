# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A forest of your own: python own_environment.py [OLD_TREES [SEED]]."""

import sys

import numpy as np

import fieldtruth as ft


def main(old_trees: str = "30", seed: str = "5") -> None:
    """Build a forest with fewer old trees, and compare what the LiDAR sees with the default forest."""
    experiment = ft.load_experiment("forest_1")
    layouts = {"default": {}, f"{old_trees} old trees": {"old_trees": int(old_trees)}}
    for name, layout in layouts.items():
        world = ft.load_world("forest", int(seed), layout)
        lidar = ft.Lidar(experiment.rig.lidar, ft.Scene(world))
        ground = float(world.terrain.field.height_at(0, 0))
        scan = lidar.scan(ft.transforms.pose((0, 0, ground + 0.96)))
        share = np.bincount(scan.label, minlength=len(ft.CLASSES)) / len(scan.label)
        trees = share[ft.Label.TRUNK] + share[ft.Label.TREETOP]
        distance = float(np.median(np.linalg.norm(scan.xyz, axis=1)))
        objects = f"{name:<16}{len(world.object_names):>5} objects"
        print(f"{objects}, {trees:.0%} of the points on trees, at a median range of {distance:.1f} m")


if __name__ == "__main__":
    main(*sys.argv[1:])

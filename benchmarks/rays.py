# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bare Embree on the rays of camera and LiDAR in the park in every packet mode. Run: python benchmarks/rays.py"""

from time import perf_counter

import numpy as np

import fieldtruth as ft
from fieldtruth.bench.bare import MODES, BareTracer
from fieldtruth.bench.sensors import pixel_directions, poses_on_route
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.sensors.lidar.sensing import ray_directions

VIEWS, TRIES = 6, 3


def main() -> None:
    experiment = ft.load_experiment("park_1")
    world = ft.load_world(experiment.environment, experiment.seed)
    scene, rig = ft.Scene(world), experiment.rig
    poses = poses_on_route(experiment.route, world, rig, VIEWS)
    from_camera = [pose @ rig.imagers[0].base_from_optical for pose in poses]
    from_lidar = [pose @ rig.lidar.mount.base_from_sensor for pose in poses]
    pixels, beams = pixel_directions(rig.stereo), ray_directions(rig.lidar).astype(np.float32)

    def mrays_per_s(tracer: BareTracer, directions: Float32Array, poses: list[Array]) -> float:
        total = 0.0
        for pose in poses:
            tries = []
            for _ in range(TRIES):
                start = perf_counter()
                tracer.trace(pose)
                tries.append(perf_counter() - start)
            total += min(tries)
        return len(poses) * directions.size / 3 / total / 1e6

    print("Mrays/s; a tile is rows x columns of pixels, or columns x rings of the LiDAR")
    print(f"{'lanes':>5}{'tile':>8}{'coherent':>10}{'camera':>9}{'LiDAR':>9}")
    for mode in MODES:
        camera = BareTracer(scene.rays.handle, pixels, rig.stereo.far, mode)
        lidar = BareTracer(scene.rays.handle, beams, rig.lidar.max_range, mode)
        tile = f"{mode.rows} x {mode.lanes // mode.rows}"
        camera_rate, lidar_rate = mrays_per_s(camera, pixels, from_camera), mrays_per_s(lidar, beams, from_lidar)
        print(f"{mode.lanes:>5}{tile:>8}{mode.coherent!s:>10}{camera_rate:>9.2f}{lidar_rate:>9.2f}")


if __name__ == "__main__":
    main()

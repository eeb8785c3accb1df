# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bare Embree on the rays of camera and LiDAR in the park in every packet mode, and ``Scene.cast`` beside it.

Run: python benchmarks/rays.py [cast] [--millions N]; with ``cast``, the latter alone: N * 2^20 random rays from NumPy.
Bare Embree has them in packet order already and keeps the distance only.
"""

import argparse
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numba import njit
from views import poses_on_route

import fieldtruth as ft
from fieldtruth.bench.sensors import MODES, BareTracer
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.packets import Packet, new_packet, set_ray
from fieldtruth.sensors.camera.sensor import pixel_directions
from fieldtruth.sensors.lidar.sensing import ray_directions

VIEWS, TRIES = 6, 3
LANES = packets.LANES
_OX, _OY, _OZ, _DX, _DY, _DZ = packets.ORG_X, packets.ORG_Y, packets.ORG_Z, packets.DIR_X, packets.DIR_Y, packets.DIR_Z
_FAR, _GEOM, _INST, _MISS = packets.TFAR, packets.GEOM_ID, packets.INST_ID, packets.MISS
_intersect: Any = packets.intersect


@njit(nogil=True, error_model="numpy")
def bare_random(scene: np.uint64, packet: Packet, rays: Float32Array, out: Float32Array) -> None:
    """Trace rays (n / LANES, 6, LANES); of the hits only the distance is kept."""
    ray, words, valid, arguments = packet
    for lane in range(LANES):
        set_ray(packet, lane, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0, np.inf)
    for k in range(len(rays)):
        for lane in range(LANES):
            ray[_OX + lane], ray[_OY + lane], ray[_OZ + lane] = rays[k, 0, lane], rays[k, 1, lane], rays[k, 2, lane]
            ray[_DX + lane], ray[_DY + lane], ray[_DZ + lane] = rays[k, 3, lane], rays[k, 4, lane], rays[k, 5, lane]
            ray[_FAR + lane] = np.inf
            words[_GEOM + lane], words[_INST + lane] = _MISS, _MISS
        _intersect(valid.ctypes, scene, ray.ctypes, arguments.ctypes)
        for lane in range(LANES):
            out[k, lane] = ray[_FAR + lane]


def compare_cast(name: str, scene: ft.Scene, low: tuple[float, ...], high: tuple[float, ...], count: int) -> float:
    """Print the rates of random rays from a box, and return the time of ``Scene.cast`` over that of bare Embree."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = np.concatenate([rng.uniform(low, high, (count, 3)), directions], axis=1).astype(np.float32)
    packed = np.ascontiguousarray(rays.reshape(-1, LANES, 6).transpose(0, 2, 1))
    packet, out = new_packet(coherent=False), np.zeros((len(packed), LANES), np.float32)
    origins, ahead = np.ascontiguousarray(rays[:, :3]), np.ascontiguousarray(rays[:, 3:])
    wide = origins.astype(np.float64), ahead.astype(np.float64)
    calls: dict[str, Callable[[], object]] = {
        "bare": lambda: bare_random(scene.rays.handle, packet, packed, out),
        "cast, float32": lambda: scene.cast(origins, ahead, workers=1),
        "cast, float64": lambda: scene.cast(*wide, workers=1),
        "occluded": lambda: scene.occluded(origins, ahead, workers=1),
        "cast, all cores": lambda: scene.cast(origins, ahead),
    }
    times: dict[str, list[float]] = {call: [] for call in calls}
    for _ in range(TRIES + 1):  # in turns, so that other load slows all of them; the first compiles
        for call, trace in calls.items():
            start = perf_counter()
            trace()
            times[call].append(perf_counter() - start)
    least = {call: min(tries[1:]) for call, tries in times.items()}
    np.testing.assert_allclose(scene.cast(origins, ahead, workers=1).range_m, out.ravel(), rtol=1e-3)
    for call, seconds in least.items():
        print(
            f"{name:<10}{call:<18}{count / seconds / 1e6:>7.2f} Mrays/s{seconds / least['bare']:>7.2f} of bare's time"
        )
    return least["cast, float32"] / least["bare"]


def compare_casts(count: int) -> None:
    park = ft.Scene(ft.load_world("park", 0))
    compare_cast("park", park, (-45.0, -20.0, 0.5), (45.0, 20.0, 5.0), count)
    compare_cast("above", park, (-45.0, -20.0, 30.0), (45.0, 20.0, 40.0), count)  # half of the rays hit nothing


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("only", nargs="?", choices=["cast"])
    parser.add_argument("--millions", type=int, default=1, help="random rays, in units of 2^20 (default: 1)")
    arguments = parser.parse_args()
    if arguments.millions < 1:
        parser.error(f"argument --millions: must be at least 1, got {arguments.millions}")
    compare_casts(arguments.millions << 20)
    if arguments.only:
        return
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

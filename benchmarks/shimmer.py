# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shimmer of the ground: how much a pixel of it changes when the camera moves or turns a little.

    python benchmarks/shimmer.py [--environment park] [--poses 3] [--cost]

Each picture is taken twice, and the second is warped onto the first by depth and poses. Printed is the mean absolute
difference [1/255] of the brightness of ground that both show, by distance, and beside it the standard deviation of the
brightness in blocks of 16 pixels, of which a sharper picture has more. Run it on two versions to compare them.
``--cost`` prints the CPU time of a picture with and without the relief of the ground, in turns.
"""

import argparse
from itertools import pairwise
from time import process_time

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from views import poses_on_route

import fieldtruth as ft
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.experiment.files import load_experiment
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import world_of

BANDS = (0.0, 3.0, 6.0, 10.0, 20.0, 60.0)
MOVES = {"forward 1 cm": (0.01, 0.0), "forward 10 cm": (0.10, 0.0), "turned 0.3 deg": (0.0, 0.3)}


def brightness(photo: NDArray[np.uint8]) -> Array:
    """Mean of the channels (h, w), 0 to 255."""
    return np.asarray(photo.astype(np.float64).mean(axis=-1))


def difference(camera: ft.Camera, lens: object, first: Array, second: Array) -> tuple[Array, Array, Array]:
    """Distance, absolute difference and local contrast of each ground pixel of the first picture that both show."""
    a, b = camera.render(first), camera.render(second)
    height, width = a.depth.shape
    v, u = np.mgrid[0:height, 0:width].astype(np.float64)
    fx, fy, cx, cy = (float(getattr(lens, name)) for name in ("fx", "fy", "cx", "cy"))
    z = a.depth.astype(np.float64)
    points = np.stack([(u - cx) / fx * z, (v - cy) / fy * z, z, np.ones_like(z)], axis=-1)
    moved = points @ (np.linalg.inv(second) @ first).T
    u2, v2 = fx * moved[..., 0] / moved[..., 2] + cx, fy * moved[..., 1] / moved[..., 2] + cy
    seen = map_coordinates(b.depth.astype(np.float64), [v2, u2], order=1, mode="nearest")
    ground = np.isin(a.label, [Label.GROUND, Label.TRAIL])
    near = np.abs(seen - moved[..., 2]) < 0.01 * moved[..., 2]
    inside = (u2 > 1) & (u2 < width - 2) & (v2 > 1) & (v2 < height - 2)
    light = brightness(a.photo)
    changed = np.abs(map_coordinates(brightness(b.photo), [v2, u2], order=1, mode="nearest") - light)
    blocks = light[: height // 16 * 16, : width // 16 * 16].reshape(height // 16, 16, width // 16, 16)
    contrast = np.kron(blocks.std(axis=(1, 3)), np.ones((16, 16)))
    whole = np.zeros_like(light)
    whole[: contrast.shape[0], : contrast.shape[1]] = contrast
    mask = ground & near & inside & (z > 0)
    return z[mask], changed[mask], whole[mask]


def cost(scene: BakedScene, poses: list[Array]) -> None:
    """Print the CPU time of a picture with and without relief, its least over several turns."""
    materials = scene.shading.materials
    flat = materials._replace(relief=np.zeros_like(materials.relief), patch=np.zeros_like(materials.patch))
    config = ft.Rig().enabled(ft.CameraConfig)[0]
    cameras = {
        "with relief": ft.Camera(config, scene),
        "without": ft.Camera(config, BakedScene(scene=scene.scene, shading=scene.shading._replace(materials=flat))),
    }
    least = dict.fromkeys(cameras, 0.0)
    for pose in poses:
        times = {name: list[float]() for name in cameras}
        for _ in range(6):
            for name, camera in cameras.items():
                start = process_time()
                camera.render(pose)
                times[name].append(process_time() - start)
        least = {name: least[name] + min(times[name]) / len(poses) for name in cameras}
    print("  ".join(f"{name}: {1e3 * seconds:.1f} ms" for name, seconds in least.items()))


def main() -> None:
    """Measure one environment."""
    parser = argparse.ArgumentParser(description="Shimmer of the ground in photographs.")
    parser.add_argument("--environment", default="park", choices=["park", "lake", "forest", "hillside"])
    parser.add_argument("--poses", type=int, default=3)
    parser.add_argument("--cost", action="store_true")
    options = parser.parse_args()
    experiment = load_experiment(f"{options.environment}_1")
    world = world_of(experiment)
    scene = bake(Scene(world), experiment.light)
    config = ft.Rig().enabled(ft.CameraConfig)[0]
    camera = ft.Camera(config, scene)
    on_robot = ft.transforms.pose(config.imagers()[0].mount.xyz) @ ft.OPTICAL
    poses = [np.asarray(p) for p in poses_on_route(experiment.route, world, experiment.rig, options.poses)]
    if options.cost:
        cost(scene, [p @ on_robot for p in poses])
    print(f"{options.environment}: mean |difference| (local contrast) [1/255] by distance [m]")
    print(f"{'':16}" + "".join(f"{f'{a:.0f} to {b:.0f}':>16}" for a, b in pairwise(BANDS)))
    for name, (along, turn) in MOVES.items():
        parts = [
            difference(
                camera, camera.intrinsics, p @ on_robot, p @ ft.transforms.pose((along, 0, 0), (0, 0, turn)) @ on_robot
            )
            for p in poses
        ]
        distance, changed, contrast = (np.concatenate(column) for column in zip(*parts, strict=True))
        cells = []
        for a, b in pairwise(BANDS):
            own = (distance >= a) & (distance < b)
            cells.append(f"{changed[own].mean():7.2f} ({contrast[own].mean():5.2f})" if own.any() else "-")
        print(f"{name:16}" + "".join(f"{cell:>16}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors against bare Embree: the same rays from the same poses, in turns, so that other load slows both equally."""

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from fieldtruth.bench.bare import BareTracer, best_mode
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.lenses import directions
from fieldtruth.drive.physics import resting_pose
from fieldtruth.experiment.camera_config import CAMERA_FROM_OPTICAL, CameraConfig
from fieldtruth.experiment.config import Route
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.camera import Camera
from fieldtruth.sense.lidar import Lidar, ray_directions
from fieldtruth.sense.scene import Scene
from fieldtruth.world.model import World

_TRIAL_POSES = 4
_LIDAR_TRIES = 4  # per try of a camera: scans are short, so that a single interruption matters


def poses_on_route(route: Route | None, world: World, rig: Rig, count: int) -> list[Array]:
    """Poses world_from_base (4, 4) of the robot at rest, evenly spaced on the route and facing along it."""
    corners = metres_from_route(route)
    legs = np.diff(corners, axis=0)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(legs, axis=1))])
    poses = []
    for at in travelled[-1] * (np.arange(count) + 0.5) / count:
        leg = int(np.searchsorted(travelled, at)) - 1
        xy = np.array([np.interp(at, travelled, corners[:, axis]) for axis in range(2)])
        yaw = float(np.arctan2(legs[leg, 1], legs[leg, 0]))
        poses.append(frames.pose_from_quaternion_wxyz(*resting_pose(world.terrain.field, xy, yaw, rig)))
    return poses


def pixel_directions(config: CameraConfig) -> Float32Array:
    """Unit directions (h, w, 3) through the pixel centres in the optical frame."""
    u, v = np.arange(config.width), np.arange(config.height)[:, None]
    return np.asarray(directions(config.projection, u, v), np.float32)


def measure_lidar(scene: Scene, rig: Rig, poses: Sequence[Array], repeats: int) -> dict[str, float]:
    """Rates of labelled scans and of bare rays from poses world_from_base."""
    config = rig.lidar
    lidar, directions = Lidar(config, scene), ray_directions(config).astype(np.float32)
    poses_of = [pose @ config.mount.base_from_sensor for pose in poses]
    bare, scan = _against_bare(scene, directions, config.max_range, poses_of, [lidar.scan], _LIDAR_TRIES * repeats)
    mrays = len(poses_of) * directions.size / 3 / 1e6
    return {
        "lidar_mrays_per_s": mrays / scan,
        "lidar_bare_mrays_per_s": mrays / bare,
        "lidar_over_bare": scan / bare,
    }


def measure_cameras(baked: BakedScene, rig: Rig, poses: Sequence[Array], repeats: int) -> dict[str, float]:
    """Label images and photographs of both cameras against bare rays, from poses world_from_base."""
    config = rig.stereo
    camera, directions = Camera(config, baked, reuse=True), pixel_directions(config)
    mounts = [mount.base_from_sensor @ CAMERA_FROM_OPTICAL for mount in (config.left, config.right)]
    poses_of = [pose @ mount for pose in poses for mount in mounts]
    bare, label, photo = _against_bare(
        baked.scene, directions, config.far, poses_of, [camera.label, camera.render], repeats
    )
    return {
        "camera_bare_mrays_per_s": len(poses_of) * directions.size / 3 / 1e6 / bare,
        "label_image_over_bare": label / bare,
        "photograph_over_bare": photo / bare,
    }


def _against_bare(
    scene: Scene,
    directions: Float32Array,
    far: float,
    poses: Sequence[Array],
    sensors: Sequence[Callable[[Array], object]],
    repeats: int,
) -> list[float]:
    """Total time [s] of bare Embree in its best mode and of each sensor; the best try of each pose counts."""
    trial_poses = poses[:: -(-len(poses) // _TRIAL_POSES)]
    handle = scene.rays.handle
    tracer = BareTracer(handle, directions, far, best_mode(handle, directions, far, trial_poses))
    total = np.zeros(1 + len(sensors))
    for sensor in sensors:
        sensor(poses[0])  # compiled before the clock runs
    for pose in poses:
        tries = [[_seconds(sensor, pose) for sensor in (tracer.trace, *sensors)] for _ in range(repeats)]
        total += np.min(tries, axis=0)
    return [float(seconds) for seconds in total]


def _seconds(sensor: Callable[[Array], object], pose: Array) -> float:
    start = perf_counter()
    sensor(pose)
    return perf_counter() - start

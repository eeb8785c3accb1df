# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors against bare Embree: the same rays from the same poses, in turns, so that a busy machine slows both alike."""

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from fieldtruth.bench.bare import BareTracer, Rays, best_mode
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.drive.physics import resting_pose
from fieldtruth.experiment.config import Route
from fieldtruth.experiment.rig import CAMERA_FROM_OPTICAL, CameraConfig, Rig
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.camera import Camera
from fieldtruth.sense.lidar import Lidar, ray_directions
from fieldtruth.sense.pinhole import pinhole
from fieldtruth.sense.scene import Scene
from fieldtruth.world.model import World

_TRIAL_POSES = 4
_LIDAR_TRIES = 4  # for one of a camera: a scan is so short that one disturbance spoils it


def poses_along(route: Route, world: World, rig: Rig, count: int) -> list[Array]:
    """Poses world_from_base (4, 4) of a robot that stands on the route and faces along it, evenly from end to end."""
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


def pixel_directions(config: CameraConfig) -> Rays:
    """Unit directions (h, w, 3) through the pixels' centres, in the optical frame."""
    lens = pinhole(config)
    rays = np.empty((config.height, config.width, 3), np.float32)
    rays[..., 0] = (np.arange(config.width) - lens.cx) / lens.fx
    rays[..., 1] = (np.arange(config.height)[:, None] - lens.cy) / lens.fy
    rays[..., 2] = 1.0
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return rays


def measure_lidar(scene: Scene, rig: Rig, poses: Sequence[Array], repeats: int) -> dict[str, float]:
    """Whole scans against bare rays, from robot poses world_from_base."""
    config = rig.lidar
    lidar, directions = Lidar(config, scene), ray_directions(config).astype(np.float32)
    seen_from = [pose @ config.mount.base_from_sensor for pose in poses]
    bare, scan = _against_bare(scene, directions, config.max_range, seen_from, [lidar.scan], _LIDAR_TRIES * repeats)
    mrays = len(seen_from) * directions.size / 3 / 1e6
    return {
        "lidar_mrays_per_s": mrays / scan,
        "lidar_bare_mrays_per_s": mrays / bare,
        "lidar_over_bare": scan / bare,
    }


def measure_cameras(baked: BakedScene, rig: Rig, poses: Sequence[Array], repeats: int) -> dict[str, float]:
    """Label images, and photographs with labels, of both cameras against bare rays, from poses world_from_base."""
    config = rig.cameras
    camera, directions = Camera(config, baked, reuse=True), pixel_directions(config)
    mounts = [mount.base_from_sensor @ CAMERA_FROM_OPTICAL for mount in (config.left, config.right)]
    seen_from = [pose @ mount for pose in poses for mount in mounts]
    bare, label, photo = _against_bare(
        baked.scene, directions, config.far, seen_from, [camera.label, camera.render], repeats
    )
    return {
        "camera_bare_mrays_per_s": len(seen_from) * directions.size / 3 / 1e6 / bare,
        "label_image_over_bare": label / bare,
        "realistic_image_over_bare": photo / bare,
    }


def _against_bare(
    scene: Scene,
    directions: Rays,
    far: float,
    poses: Sequence[Array],
    sensors: Sequence[Callable[[Array], object]],
    repeats: int,
) -> list[float]:
    """Time [s] of bare Embree in its best mode and of each sensor, over all poses; of each pose the best try counts."""
    some = poses[:: -(-len(poses) // _TRIAL_POSES)]
    handle = scene.rays.handle
    tracer = BareTracer(handle, directions, far, best_mode(handle, directions, far, some))
    total = np.zeros(1 + len(sensors))
    for pose in poses:
        tries = [[_seconds(look, pose) for look in (tracer.trace, *sensors)] for _ in range(repeats)]
        total += np.min(tries, axis=0)
    return [float(seconds) for seconds in total]


def _seconds(look: Callable[[Array], object], pose: Array) -> float:
    start = perf_counter()
    look(pose)
    return perf_counter() - start

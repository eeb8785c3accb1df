# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors against bare Embree: the same rays from the same poses, in turns, so that other load slows both equally."""

from collections.abc import Callable, Sequence
from functools import partial
from time import perf_counter
from typing import Final

import numpy as np

from fieldtruth.bench.bare import BareTracer, best_mode
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.lenses import directions
from fieldtruth.drive.physics import resting_pose
from fieldtruth.experiment.config import Route
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.render.bake import BakedScene
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.camera.sensing import IdealCamera
from fieldtruth.sensors.lidar.sensing import IdealLidar, ray_directions
from fieldtruth.world.model import World

_TRIAL_POSES = 4
_STEP: Final = frames.pose((0.01, 0.0, 0.04), (0.0, 0.5, 0.0))
"""From an optical frame to that of the next image: 1 m/s and 12 deg/s at 25 Hz."""
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
    """Unit directions (h, w, 3) through the pixel centres in the optical frame.

    Pixels for which the lens has no ray get the optical axis, because bare Embree traces rows and columns.
    """
    u, v = np.arange(config.width), np.arange(config.height)[:, None]
    found = np.asarray(directions(config.projection, u, v), np.float32)
    return np.where(np.isnan(found), np.array([0.0, 0.0, 1.0], np.float32), found)


def measure_lidars(scene: Scene, rig: Rig, poses: Sequence[Array], repeats: int) -> dict[str, float]:
    """Rates of labelled scans of all LiDARs and of bare rays from poses world_from_base; empty without LiDAR."""
    mrays, total = 0.0, np.zeros(2)
    for config in rig.lidars:
        lidar, directions = IdealLidar(config, scene), ray_directions(config).astype(np.float32)
        poses_of = [pose @ config.mount.base_from_sensor for pose in poses]
        mrays += len(poses_of) * directions.size / 3 / 1e6
        total += _against_bare(scene, directions, config.max_range, poses_of, [lidar.scan], _LIDAR_TRIES * repeats)
    bare, scan = total.tolist()
    if not rig.lidars:
        return {}
    return {
        "lidar_mrays_per_s": mrays / scan,
        "lidar_bare_mrays_per_s": mrays / bare,
        "lidar_over_bare": scan / bare,
    }


def measure_cameras(baked: BakedScene, rig: Rig, poses: Sequence[Array], repeats: int) -> dict[str, float]:
    """Label images and photographs of all cameras against bare rays from poses world_from_base; empty without one."""
    mrays, total = 0.0, np.zeros(5)
    for config in rig.cameras:
        camera, directions = IdealCamera(config, baked, reuse=True), pixel_directions(config)
        geometry = LabelCamera(config.model_copy(update={"normals": True}), baked.scene, reuse=True)
        poses_of = [pose @ imager.base_from_optical for pose in poses for imager in config.imagers()]
        mrays += len(poses_of) * directions.size / 3 / 1e6
        sensors: list[Callable[[Array], object]] = [camera.label, camera.render]
        sensors += [geometry.label, partial(_flow, geometry)]
        total += _against_bare(baked.scene, directions, config.far, poses_of, sensors, repeats)
    bare, label, photo, normals, flow = total.tolist()
    if not rig.cameras:
        return {}
    return {
        "camera_bare_mrays_per_s": mrays / bare,
        "label_image_over_bare": label / bare,
        "photograph_over_bare": photo / bare,
        "normals_over_bare": normals / bare,
        "flow_over_bare": flow / bare,
    }


def _flow(camera: LabelCamera, pose: Array) -> object:
    """Flow from the labels that the camera has just made from the same pose."""
    assert camera.last is not None
    return camera.flow(camera.last, pose, pose @ _STEP)


def _against_bare(
    scene: Scene,
    directions: Float32Array,
    far: float,
    poses: Sequence[Array],
    sensors: Sequence[Callable[[Array], object]],
    repeats: int,
) -> Array:
    """Total times [s] of bare Embree in its best mode and of each sensor; the best try of each pose counts."""
    trial_poses = poses[:: -(-len(poses) // _TRIAL_POSES)]
    handle = scene.rays.handle
    tracer = BareTracer(handle, directions, far, best_mode(handle, directions, far, trial_poses))
    total: Array = np.zeros(1 + len(sensors))
    for sensor in sensors:
        sensor(poses[0])  # compiled before the clock runs
    for pose in poses:
        tries = [[_seconds(sensor, pose) for sensor in (tracer.trace, *sensors)] for _ in range(repeats)]
        total += np.min(tries, axis=0)
    return total


def _seconds(sensor: Callable[[Array], object], pose: Array) -> float:
    start = perf_counter()
    sensor(pose)
    return perf_counter() - start

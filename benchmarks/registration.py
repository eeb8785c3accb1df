# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drift of KISS-ICP over seeds of a world, and of point-to-plane registration of the same clouds: docs/slam.md.

Run: python benchmarks/registration.py [--environment hillside] [--seeds 1 ... 10] [--seconds 20] [--out DIR]

It needs: pip install kiss-icp. For each seed it records the environment's first experiment without cameras and prints a
row: path, KISS-ICP with its default settings, with the true motion as its first guess, with voxels of 0.5 m; then ours,
point to plane against the map so far, and against a map at the true poses. Errors are rms of positions [m], of whole
trajectories after rigid alignment; those against the map at the true poses need no alignment. Bags that DIR has already
are used again.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import fieldtruth as ft
from fieldtruth.bag.decode import points
from fieldtruth.bag.run import open_run
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.exporters.slam_configs import read_facts
from fieldtruth.pipeline import generate

TOPIC: Final = "/os1_cloud_node/points"
VOXEL, SPARSE = 0.25, 0.5
"""Sides [m] of the voxels that maps and clouds are thinned with, one point in each."""
REACH: Final = 40.0
"""Range [m] of the points that are registered."""
SCANS: Final = 25
"""Clouds in the map."""
NEIGHBOURS: Final = 12
"""Points that a plane goes through."""
FLAT: Final = 0.05
"""Planes have a smaller variance across than this share of the middle one; grass, leaves and single rings have none."""
FAR: Final = 0.3
"""Distance [m] from a plane above which a point belongs to something else."""
ROUNDS: Final = 8
EVERY: Final = 5
"""Clouds from one that is registered in the map at the true poses to the next."""


class Drive(NamedTuple):
    """Clouds (n, 3) [m] of a LiDAR, and its true poses (k, 4, 4) as seen from the first."""

    clouds: list[Array]
    poses: Array


def recorded(environment: str, seed: int, length_s: float, out: Path) -> Path:
    """Bag of a run, which is made unless it is there."""
    folder = out / str(seed) / f"{environment}_1"
    if not (bag := folder / f"{folder.name}.bag").exists():
        experiment = with_overrides(load_experiment(folder.name), seconds=length_s, seed=seed, cameras=False)
        generate(experiment, folder.parent)
    return bag


def drive_of(bag: Path) -> Drive:
    """Read the clouds and the true poses of a run."""
    run = open_run(bag)
    sensor = read_facts(run).cloud
    assert sensor is not None
    clouds, poses = [], []
    for reading in ft.read_bag(bag, [TOPIC]):
        rows = points(reading.message)
        xyz = np.stack([rows[axis] for axis in "xyz"], axis=1).astype(np.float64)
        clouds.append(xyz[np.isfinite(xyz).all(axis=1)])
        poses.append(run.trajectory.world_from_base(reading.stamp_ns) @ sensor.base_from_sensor)
    return Drive(clouds, np.asarray(np.linalg.inv(poses[0]) @ np.array(poses), np.float64))


def aligned_error(found: Array, true: Array) -> float:
    """Rms distance [m] of positions (k, 3) after the rigid alignment of Umeyama."""
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    turn, _ = Rotation.align_vectors(b, a)
    return float(np.sqrt(((turn.apply(a) - b) ** 2).sum(axis=1).mean()))


def kiss(drive: Drive, voxel: float | None = None, true_guess: bool = False) -> Array:
    """Poses (k, 4, 4) of KISS-ICP, with its defaults but for the side of its voxels and its first guess."""
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP

    config = load_config(None)
    config.mapping.voxel_size = voxel or config.mapping.voxel_size
    odometry, poses = KissICP(config), []
    for k, cloud in enumerate(drive.clouds):
        if true_guess and k:
            odometry.last_delta = np.linalg.inv(drive.poses[k - 1]) @ drive.poses[k]
        odometry.register_frame(cloud, np.array([]))
        poses.append(odometry.last_pose)
    return np.array(poses)


# ---------------------------------------------------------------------------------------------------------------------
# Point to plane


def thinned(cloud: Array, voxel: float) -> Array:
    """One point (m, 3) of each voxel."""
    index = np.floor((cloud - cloud.min(axis=0)) / voxel).astype(np.int64)
    _, first = np.unique((index[:, 0] << 40) + (index[:, 1] << 20) + index[:, 2], return_index=True)
    thin: Array = cloud[first]
    return thin


def moved(pose: Array, cloud: Array) -> Array:
    """Points (n, 3) in the frame that the pose leads to."""
    there: Array = cloud @ pose[:3, :3].T + pose[:3, 3]
    return there


class Planes:
    """Planes through the neighbours of each point of a map."""

    def __init__(self, clouds: Sequence[Array]) -> None:
        self.points = thinned(np.concatenate(clouds), VOXEL)
        self.tree = cKDTree(self.points)

    def of(self, places: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Middles and normals (m, 3) of the planes next to places (n, 3), and which have one (n,)."""
        found = self.tree.query(places, NEIGHBOURS, distance_upper_bound=1.0)
        far, rows = np.asarray(found[0]), np.asarray(found[1])
        known: NDArray[np.bool_] = np.isfinite(far).all(axis=1)
        near = self.points[rows[known]]
        middle = near.mean(axis=1)
        spread = np.einsum("nki,nkj->nij", near - middle[:, None], near - middle[:, None])
        variance, axes = np.linalg.eigh(spread)
        flat = variance[:, 0] < FLAT * variance[:, 1]
        known[known] = flat
        return middle[flat], axes[flat, :, 0], known


def registered(cloud: Array, planes: Planes, guess: Array) -> Array:
    """Pose (4, 4) of a cloud whose points lie in the planes of a map."""
    pose, thin = guess, thinned(cloud, SPARSE)
    for _ in range(ROUNDS):
        here = moved(pose, thin)
        middle, normal, known = planes.of(here)
        here = here[known]
        distance = ((here - middle) * normal).sum(axis=1)
        weight = np.maximum(1.0 - (distance / FAR) ** 2, 0.0) ** 2  # Tukey
        lever = np.concatenate([np.cross(here - pose[:3, 3], normal), normal], axis=1)
        step = np.linalg.lstsq(lever * np.sqrt(weight)[:, None], -distance * np.sqrt(weight), rcond=None)[0]
        pose = pose.copy()
        pose[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix() @ pose[:3, :3]
        pose[:3, 3] += step[3:]
        if np.linalg.norm(step) < 1e-4:
            break
    return pose


def point_to_plane(drive: Drive) -> Array:
    """Poses (k, 4, 4) of each cloud against those before it, at the poses that were found; the motion goes on."""
    near = near_of(drive)
    poses, motion, known = [np.eye(4)], np.eye(4), [near[0]]
    for cloud in near[1:]:
        found = registered(cloud, Planes(known[-SCANS:]), poses[-1] @ motion)
        motion = np.linalg.inv(poses[-1]) @ found
        poses.append(found)
        known.append(moved(found, cloud))
    return np.array(poses)


def offsets(drive: Drive) -> Array:
    """Distances [m] from the true positions at which clouds fit best to those before them, at their true poses."""
    near = near_of(drive)
    known = [moved(pose, cloud) for pose, cloud in zip(drive.poses, near, strict=True)]
    rows = range(SCANS, len(near), EVERY)
    found = [registered(near[k], Planes(known[k - SCANS : k]), drive.poses[k]) for k in rows]
    off: Array = np.linalg.norm(
        [pose[:3, 3] - drive.poses[k, :3, 3] for k, pose in zip(rows, found, strict=True)], axis=1
    )
    return off


def near_of(drive: Drive) -> list[Array]:
    """Clouds within reach, thinned."""
    return [thinned(cloud[(cloud**2).sum(axis=1) < REACH**2], VOXEL) for cloud in drive.clouds]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--environment", default="hillside", choices=["park", "lake", "forest", "hillside"])
    parser.add_argument("--seeds", nargs="+", type=int, default=list(range(1, 11)))
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated time of each run")
    parser.add_argument("--out", type=Path, default=Path("registration"))
    options = parser.parse_args()
    if not 1.0 <= options.seconds <= 3600.0:
        parser.error(f"argument --seconds: must be between 1 and 3600, got {options.seconds:g}")
    print("| seed | path m | KISS-ICP | true first guess | voxels 0.5 m | point to plane | in the true map |")
    print("|---" * 7 + "|", flush=True)
    for seed in options.seeds:
        drive = drive_of(recorded(options.environment, seed, options.seconds, options.out))
        true = drive.poses[:, :3, 3]
        path = float(np.linalg.norm(np.diff(true, axis=0), axis=1).sum())
        row = [aligned_error(kiss(drive, *how)[:, :3, 3], true) for how in ((), (None, True), (0.5,))]
        row.append(aligned_error(point_to_plane(drive)[:, :3, 3], true))
        row.append(float(np.sqrt((offsets(drive) ** 2).mean())))
        print(f"| {seed} | {path:.2f} | " + " | ".join(f"{value:.3f}" for value in row) + " |", flush=True)


if __name__ == "__main__":
    main()

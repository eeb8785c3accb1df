# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""LiDAR odometry on a run, compared with ground truth: python slam_input.py RUN (needs: pip install kiss-icp evo)."""

import sys

import numpy as np
from evo.core.metrics import APE, PoseRelation
from evo.core.trajectory import PoseTrajectory3D
from kiss_icp.config import load_config
from kiss_icp.kiss_icp import KissICP

import fieldtruth as ft


def main(run: str) -> None:
    """Feed every cloud to KISS-ICP with its default settings and print the absolute pose error."""
    samples = ft.RunDataset(run, items=("cloud", "pose"), anchor="lidar")
    odometry = KissICP(load_config(None))
    estimated, true, seconds = [], [], []
    for sample in samples:
        odometry.register_frame(sample["cloud"].astype(np.float64), np.empty(0))
        estimated.append(odometry.last_pose)
        true.append(sample["world_from_lidar"])
        seconds.append(sample["stamp_ns"] / 1e9)

    first_from_world = ft.transforms.inverse(true[0])
    reference = PoseTrajectory3D(poses_se3=[first_from_world @ pose for pose in true], timestamps=np.array(seconds))
    estimate = PoseTrajectory3D(poses_se3=estimated, timestamps=np.array(seconds))
    error = APE(PoseRelation.translation_part)
    error.process_data((reference, estimate))
    rmse = float(np.sqrt(np.mean(np.square(error.error))))
    print(f"{len(seconds)} clouds, {reference.path_length:.2f} m driven, {rmse:.3f} m RMSE")


if __name__ == "__main__":
    main(*sys.argv[1:])

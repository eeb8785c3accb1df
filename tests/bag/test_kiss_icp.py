# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""KISS-ICP with its default settings on default bags: it runs to the end and finds the true trajectory.

Where it drifts by centimetres, planes through the same clouds lie where the true poses say.
"""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import file_interface
from registration import drive_of, offsets
from rosbags.rosbag1 import Reader

from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.pipeline import generate

pytest.importorskip("kiss_icp", reason="pip install kiss-icp")

SECONDS = 20
MOUNT = [0.09, 0.0, 0.826]
"""Position [m] of the LiDAR in base_link; its axes are those of base_link."""
BOUNDS = {"forest": 0.015, "hillside": 0.06}
"""RMSE [m] of the position after rigid alignment, over 6 m of driving; measured: 0.008, 0.046.

The forest's trunks hold the estimate to the millimetre. On the hillside most points are ground, as in the park and at
the lake: its rings move with the sensor, and point-to-point registration matches them to themselves unless the robot
tilts (docs/physics.md). That error is the method's own: point to plane, the same clouds give less than a centimetre
(docs/slam.md).
"""
FIT = {"hillside": 0.01}
"""Rms distance [m] from the true position at which a cloud fits best to those before it; measured: 0.005."""


def estimated_trajectory(bag: Path, out: Path) -> PoseTrajectory3D:
    """Run the program as its users do; it aborts the process when it fails."""
    command = ["kiss_icp_pipeline", "--topic", "/os1_cloud_node/points", str(bag)]
    environment = os.environ | {"kiss_icp_out_dir": str(out)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return file_interface.read_tum_trajectory_file(out / "latest" / f"{bag.stem}_poses_tum.txt")


def true_trajectory(bag: Path) -> PoseTrajectory3D:
    """Poses of the LiDAR in the world."""
    with Reader(bag) as reader:
        trajectory = file_interface.read_bag_trajectory(reader, "/ground_truth/odom")
    base_from_lidar = np.eye(4)
    base_from_lidar[:3, 3] = MOUNT
    trajectory.transform(base_from_lidar, right_mul=True)
    return trajectory


@pytest.mark.slow
@pytest.mark.parametrize("environment", BOUNDS)
def test_kiss_icp_finds_the_true_trajectory(environment: str, tmp_path: Path) -> None:
    bag = generate(with_overrides(load_experiment(f"{environment}_1"), seconds=SECONDS, cameras=False), tmp_path)
    estimate = estimated_trajectory(bag, tmp_path / "kiss_icp")
    truth, estimate = sync.associate_trajectories(true_trajectory(bag), estimate, max_diff=1e-4)
    assert truth.num_poses == estimate.num_poses == 10 * SECONDS
    assert truth.path_length > 5.0
    estimate.align(truth)
    error = metrics.APE(metrics.PoseRelation.translation_part)
    error.process_data((truth, estimate))
    assert error.get_statistic(metrics.StatisticsType.rmse) < BOUNDS[environment]
    if environment in FIT:
        assert np.sqrt((offsets(drive_of(bag)) ** 2).mean()) < FIT[environment]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The trajectory as evo reads it from the text file and from the bag."""

from pathlib import Path

import numpy as np
import pytest
import ros_types as ros
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import file_interface
from export_bags import bag_of, without
from rosbags.rosbag1 import Reader
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance
from rosbags.typesys.stores.ros1_noetic import nav_msgs__msg__Odometry as Odometry

from fieldtruth.bag.file import BagError
from fieldtruth.exporters import export


@pytest.fixture(scope="module")
def text_file(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(small_run, "tum", out=tmp_path_factory.mktemp("tum") / "park.tum")


@pytest.fixture(scope="module")
def in_bag(small_run: Path) -> PoseTrajectory3D:
    with Reader(small_run / "park_1.bag") as reader:
        return file_interface.read_bag_trajectory(reader, "/ground_truth/odom")


def odometry(stamp_ns: int, xyz: tuple[float, float, float], xyzw: tuple[float, float, float, float]) -> Odometry:
    pose = ros.Pose(ros.Point(*xyz), ros.Quaternion(*xyzw))
    twist = ros.Twist(ros.Vector3(0.0, 0.0, 0.0), ros.Vector3(0.0, 0.0, 0.0))
    zeros = np.zeros(36)
    head = ros.header(0, stamp_ns, "world")
    return Odometry(head, "base_link", PoseWithCovariance(pose, zeros), TwistWithCovariance(twist, zeros))


def test_evo_reads_the_odometry_in_the_bag(in_bag: PoseTrajectory3D) -> None:
    valid, details = in_bag.check()
    assert valid, details
    assert in_bag.num_poses == 60  # 1.2 s at 50 Hz
    assert in_bag.meta["frame_id"] == "world"
    assert in_bag.timestamps == pytest.approx(np.arange(1, 61) / 50.0, abs=1e-9)


def test_evo_finds_no_difference_between_file_and_bag(text_file: Path, in_bag: PoseTrajectory3D) -> None:
    from_file = file_interface.read_tum_trajectory_file(text_file)
    assert from_file.check()[0]
    assert from_file.timestamps == pytest.approx(in_bag.timestamps, abs=1e-12)
    np.testing.assert_array_equal(from_file.positions_xyz, in_bag.positions_xyz)
    np.testing.assert_array_equal(from_file.orientations_quat_wxyz, in_bag.orientations_quat_wxyz)
    reference, estimate = sync.associate_trajectories(in_bag, from_file, max_diff=1e-9)
    assert reference.num_poses == in_bag.num_poses
    error = metrics.APE(metrics.PoseRelation.translation_part)
    error.process_data((reference, estimate))
    assert error.get_statistic(metrics.StatisticsType.max) == 0.0
    turn = metrics.APE(metrics.PoseRelation.rotation_angle_deg)
    turn.process_data((reference, estimate))
    assert turn.get_statistic(metrics.StatisticsType.max) < 1e-5


def test_all_digits_of_stamps_and_numbers_are_kept(tmp_path: Path) -> None:
    stamps = [1_700_000_000_123_456_789, 1_700_000_001_000_000_001]  # a double resolves such stamps to 256 ns
    third = 1.0 / 3.0
    poses = [
        odometry(stamps[0], (third, -2e-17, 1e5 + third), (0.1, 0.2, 0.3, np.sqrt(0.86))),
        odometry(stamps[1], (1.0, 2.0, 3.0), (0.0, 0.0, 1.0, 0.0)),
    ]
    late = 10**9 + 7  # the stamp in the bag differs from the header's
    bag = bag_of(tmp_path / "run.bag", [("/ground_truth/odom", late + k, pose) for k, pose in enumerate(poses)])
    lines = export(bag, "tum").read_text().splitlines()
    rows = [line.split(" ") for line in lines if not line.startswith("#")]
    assert [row[0] for row in rows] == ["1700000000.123456789", "1700000001.000000001"]
    assert list(map(float, rows[0][1:])) == [third, -2e-17, 1e5 + third, 0.1, 0.2, 0.3, np.sqrt(0.86)]
    assert rows[1][1:] == ["1.0", "2.0", "3.0", "0.0", "0.0", "1.0", "0.0"]


def test_poses_are_read_from_model_states_without_odometry(small_run: Path, tmp_path: Path) -> None:
    bag = without(small_run / "park_1.bag", tmp_path / "bare.bag", "/ground_truth/odom")
    every_step = file_interface.read_tum_trajectory_file(export(bag, "tum"))
    assert every_step.num_poses == 1200
    with Reader(small_run / "park_1.bag") as reader:
        odom = file_interface.read_bag_trajectory(reader, "/ground_truth/odom")
    np.testing.assert_array_equal(every_step.positions_xyz[19::20], odom.positions_xyz)


def test_bytes_do_not_depend_on_workers(small_run: Path, text_file: Path, tmp_path: Path) -> None:
    again = export(small_run, "tum", out=tmp_path / "again.tum", workers=1)
    assert again.read_bytes() == text_file.read_bytes()


def test_bag_without_poses_is_refused_in_one_line(small_run: Path, tmp_path: Path) -> None:
    bag = without(small_run / "park_1.bag", tmp_path / "bare.bag", "/ground_truth/odom", "/gazebo/model_states")
    with pytest.raises(
        BagError, match=r"bare\.bag has no /ground_truth/odom, nor /gazebo/model_states in its place; available: /clock"
    ):
        export(bag, "tum")
    assert [path.name for path in tmp_path.iterdir()] == ["bare.bag"]

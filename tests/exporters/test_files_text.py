# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Format ``files``: clouds, lines of text, calibration and README against the bag."""

import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from export_bags import without
from files_reader import (
    IMU,
    MODELS,
    ODOMETRY,
    POINTS,
    SIDES,
    WHEELS,
    camera,
    cloud_columns,
    header_ns,
    messages,
    table,
)

from fieldtruth.bag.run import open_run
from fieldtruth.exporters import export
from fieldtruth.exporters.files import points_csv
from fieldtruth.sensors.gnss.config import GnssConfig


@pytest.fixture(scope="module")
def made(exported: Callable[[str], Path]) -> Path:
    return exported("files")


# ---------------------------------------------------------------------------------------------------------------------
# Clouds


def test_clouds_round_trip_bit_for_bit(made: Path, bag: Path) -> None:
    for _, message in messages(bag, POINTS)[::5]:
        path = made / "lidar" / f"{header_ns(message)}.csv"
        back = np.loadtxt(path, delimiter=",", dtype=np.float32)
        assert back.shape == (message.width, 4)
        assert back.tobytes() == cloud_columns(message).tobytes()
        lines = path.read_text().splitlines()
        assert {line.count(",") for line in lines} == {3}
        assert {line.rsplit(",", 1)[1] for line in lines} <= {str(k) for k in range(1, 14)}


def test_floats_of_every_magnitude_round_trip() -> None:
    rng = np.random.default_rng(0)
    bits = rng.integers(0, 2**32, (5000, 4), dtype=np.uint32)
    special = np.array([[0x80000000, 1, 0x007FFFFF, 0x00800000], [0x7F7FFFFF, 0xFF7FFFFF, 0x3F800000, 0]], np.uint32)
    values = np.vstack([special, bits]).view(np.float32)
    values = values[np.isfinite(values).all(axis=1)]
    text = points_csv(values)
    back = np.loadtxt(io.BytesIO(text), delimiter=",", dtype=np.float32)
    assert back.tobytes() == values.tobytes()
    exact = [[np.float32(number) for number in line.split(",")] for line in text.decode().splitlines()]
    assert np.array(exact, np.float32).tobytes() == values.tobytes()


def test_csv_of_known_points() -> None:
    points = np.array([[1.5, -0.25, 3.0, 7.0], [0.1, 100.0, -2.0, 10.0], [0.0, 1e-9, 1e20, 2.5]], np.float32)
    assert points_csv(points) == b"1.5,-0.25,3.0,7\n0.1,100.0,-2.0,10\n0.0,1e-9,1e+20,2.5\n"
    assert points_csv(points[:0]) == b""
    assert points_csv(np.array([[1.0, 2.0, 3.0, np.nan]], np.float32)) == b"1.0,2.0,3.0,nan\n"


# ---------------------------------------------------------------------------------------------------------------------
# Lines


def test_imu_lines_match_the_bag(made: Path, bag: Path) -> None:
    stamps, values = table(made / "imu_data.txt")
    expected = [
        (q.x, q.y, q.z, q.w, w.x, w.y, w.z, a.x, a.y, a.z)
        for m in (m for _, m in messages(bag, IMU))
        for q, w, a in [(m.orientation, m.angular_velocity, m.linear_acceleration)]
    ]
    assert stamps == [header_ns(m) for _, m in messages(bag, IMU)]
    assert values.tolist() == [list(row) for row in expected]


def test_gnss_lines_match_the_bag(made: Path, bag: Path) -> None:
    stamps, values = table(made / "GNSS_data.txt")
    fixes = [m for _, m in messages(bag, "/navsat/fix")]
    assert stamps == [header_ns(m) for m in fixes]
    assert values.tolist() == [[m.latitude, m.longitude, m.altitude] for m in fixes]
    assert values[0, :2] == pytest.approx([49.9, 8.9], abs=0.01)
    first = next(m for _, m in messages(bag, ODOMETRY)).pose.pose.position
    antenna = next(each.mount.xyz[2] for each in open_run(bag).rig.enabled(GnssConfig))
    assert values[0, 2] == pytest.approx(first.z + antenna, abs=0.02)


def test_wheel_speeds_match_the_bag(made: Path, bag: Path) -> None:
    speeds = {}
    for wheel in WHEELS:
        stamps, values = table(made / "tacho_data" / f"{wheel}.txt")
        sent = messages(bag, f"/gazebo_client/{wheel}_speed")
        assert stamps == [stamp for stamp, _ in sent]
        assert values.shape == (len(stamps), 1)
        assert values[:, 0].astype(np.float32).tolist() == [m.data for _, m in sent]
        speeds[wheel] = tuple(values[:, 0])
    assert len(set(speeds.values())) == 4


def test_joint_states_wheel_odometry_and_commands(made: Path, bag: Path) -> None:
    stamps, values = table(made / "joint_states.txt")
    joints = [m for _, m in messages(bag, "/joint_states")]
    assert stamps == [header_ns(m) for m in joints]
    assert values.tolist() == [[*m.position, *m.velocity] for m in joints]
    poses = [m.pose.pose for _, m in messages(bag, "/odometry/wheel")]
    expected = [[p.position.x, p.position.y, 0.0, 0.0, 0.0, p.orientation.z, p.orientation.w] for p in poses]
    assert table(made / "wheel_odometry.txt")[1].tolist() == expected
    commands = messages(bag, "/cmd_vel")
    stamps, values = table(made / "commands.txt")
    assert stamps == [stamp for stamp, _ in commands]
    assert values.tolist() == [[m.linear.x, m.angular.z] for _, m in commands]


def test_poses_match_model_states(made: Path, bag: Path) -> None:
    stamps, values = table(made / "pose_ground_truth.txt")
    assert stamps == list(range(1_000_000, 1_200_000_001, 1_000_000))
    sent = messages(bag, MODELS, 40)
    row = sent[0][1].name.index("husky")
    poses = [m.pose[row] for _, m in sent]
    expected = [[p.position.x, p.position.y, p.position.z] for p in poses]
    turns = [[q.x, q.y, q.z, q.w] for q in (p.orientation for p in poses)]
    assert stamps[::40] == [stamp for stamp, _ in sent]
    assert values[::40].tolist() == np.hstack([expected, turns]).tolist()


def test_poses_match_odometry_without_model_states(bag: Path, tmp_path: Path) -> None:
    images = [camera(side, name) for side in SIDES for name in ("real/compressed", "tag/img_raw", "depth")]
    found = export(without(bag, tmp_path / "bag" / "b.bag", MODELS, *images), "files", out=tmp_path / "found")
    stamps, values = table(found / "pose_ground_truth.txt")
    sent = [m for _, m in messages(bag, ODOMETRY)]
    assert stamps == [header_ns(m) for m in sent]
    poses = [m.pose.pose for m in sent]
    assert values[:, :3].tolist() == [[p.position.x, p.position.y, p.position.z] for p in poses]
    assert values[:, 3:].tolist() == [[q.x, q.y, q.z, q.w] for q in (p.orientation for p in poses)]
    assert not (found / "instances.csv").exists()


# ---------------------------------------------------------------------------------------------------------------------
# Calibration and README


def test_calibration_yaml_matches_the_bag(made: Path, bag: Path) -> None:
    found = yaml.safe_load((made / "calibration.yaml").read_text())
    for side in SIDES:
        info, stated = messages(bag, camera(side, "camera_info"))[0][1], found["cameras"][side]
        assert (stated["width"], stated["height"]) == (info.width, info.height) == (160, 92)
        for name, shape in (("K", (3, 3)), ("R", (3, 3)), ("P", (3, 4)), ("D", (5,))):
            assert np.reshape(getattr(info, name), shape).tolist() == stated[name]
        assert stated["frame"] == f"{side}_camera_optical"
    assert found["baseline_m"] == pytest.approx(0.12, abs=1e-12)
    poses = {name: np.array(frame["base_link_from_frame"]) for name, frame in found["frames"].items()}
    ahead = np.array([0.0, 0.0, 2.0, 1.0])  # in optical frames; in base_link that is along x
    assert np.allclose(poses["left_camera_optical"] @ ahead, [2.15, 0.06, 0.72, 1.0], atol=1e-9)
    assert np.allclose(poses["right_camera_optical"] @ ahead, [2.15, -0.06, 0.72, 1.0], atol=1e-9)
    assert found["frames"]["os1_lidar"]["translation"] == [0.09, 0.0, 0.826]
    assert found["frames"]["GNSS_link"]["translation"] == [0.1, 0.0, 0.89]
    imu = found["frames"]["imu_link"]
    assert np.allclose(imu["quaternion_xyzw"], np.array([1, 0, 1, 0]) / 2**0.5, atol=1e-9)
    assert len(poses) == 8


def test_readme_lists_all_files_and_columns(made: Path) -> None:
    text = (made / "README.txt").read_text()
    for name in {path.name for path in made.iterdir()} - {"README.txt"}:
        assert name in text
    lines = [line.split(maxsplit=1) for line in text.splitlines() if " t_ns " in line]
    assert len(lines) == 10
    for name, columns in lines:
        assert len(columns.split()) == np.loadtxt(made / name, ndmin=2).shape[1]
    missing = re.findall(r"\((/\S+)\)", text.partition("Missing")[2])
    assert {topic.split("/")[-1] for topic in missing} == {
        "normals",
        "flow",
        "parts",
        "passability",
    }  # which the run lacks
    assert max(map(len, text.splitlines())) <= 120


def test_readme_lists_missing_topics(bag: Path, tmp_path: Path) -> None:
    of_cameras = ("real/compressed", "tag/img_raw", "depth", "instances", "camera_info")
    images = [camera(side, name) for side in SIDES for name in of_cameras]
    lean = without(bag, tmp_path / "b.bag", "/tf_static", "/navsat/fix", MODELS, ODOMETRY, *images)
    found = export(lean, "files", out=tmp_path / "found")
    assert {path.name for path in found.iterdir()} == {
        "README.txt", "lidar", "imu_data.txt", "tacho_data", "joint_states.txt", "wheel_odometry.txt",
        "commands.txt", "data_proportion.xlsx"
    }  # fmt: skip
    missing = (found / "README.txt").read_text().partition("Missing")[2]
    for name in ("img_left/", "img_right_tag/", "depth_left/", "instances_right/", "GNSS_data.txt", "pose_ground"):
        assert name in missing
    assert "lidar/" not in missing

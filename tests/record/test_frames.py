# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of separate frames: each is a pair and a cloud with exact labels, and readers, exports and checks take them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.rosbag1 import Reader

from fieldtruth.bag.run import open_run
from fieldtruth.cli import main
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.datasets import RunDataset
from fieldtruth.degradation import degrade
from fieldtruth.drive.standing import standing_robot
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.pipeline import generate
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.validation.runner import validate

SMALL = {"cameras": {"width": 128, "height": 72, "instances": True}}
SKIPPED = {"motion", "imu", "gnss", "wheels", "wheel odometry", "commands", "depth"}


def frames_experiment(**values: Any) -> Experiment:
    data = {"name": "frames", "environment": "park", "frames": {"count": 4}, "rig": SMALL}
    return Experiment.model_validate({**data, **values})


@pytest.fixture(scope="module")
def frames_run(in_park: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return generate(frames_experiment(), tmp_path_factory.mktemp("frames")).parent


def test_every_frame_has_a_pair_and_a_cloud_and_nothing_that_needs_motion(frames_run: Path) -> None:
    stamps: dict[str, list[int]] = {}
    with Reader(open_run(frames_run).bag) as reader:
        for connection, stamp, _ in reader.messages():
            stamps.setdefault(connection.topic, []).append(stamp)
    assert stamps.pop("/tf_static") == [100_000_000]
    assert set(map(tuple, stamps.values())) == {(100_000_000, 200_000_000, 300_000_000, 400_000_000)}
    cameras = [
        f"/stereo/camera/{side}/{name}"
        for side in ("left", "right")
        for name in ("camera_info", "real/compressed", "tag/img_raw", "instances")
    ]
    truth = ["/clock", "/gazebo/model_states", "/ground_truth/odom", "/tf", "/os1_cloud_node/points"]
    assert sorted(stamps) == sorted(truth + cameras)
    card = (frames_run / "DATASET.md").read_text()
    assert "4 frames of the environment *park*" in card
    assert "/imu/data" not in card


@pytest.mark.usefixtures("in_park")
def test_validate_passes_and_says_what_does_not_apply(frames_run: Path) -> None:
    checks = validate(frames_run, full=True, samples=4)
    assert {check.name: check.text for check in checks if check.passed is False} == {}
    skipped = {check.name: check.text for check in checks if check.passed is None}
    assert set(skipped) == SKIPPED
    assert skipped["motion"] == "separate frames: the robot does not move from one to the next"


@pytest.mark.slow
def test_the_frames_are_made_again_by_their_own_experiment(frames_run: Path, tmp_path: Path) -> None:
    again = generate(load_experiment(frames_run / "experiment.yaml"), tmp_path)
    assert again.read_bytes() == open_run(frames_run).bag.read_bytes()


def test_they_stay_as_they_are_if_only_a_sensor_of_motion_gets_noise(frames_run: Path, tmp_path: Path) -> None:
    made = degrade(frames_run, tmp_path, signal={"imu": "datasheet"})
    assert made.read_bytes() == open_run(frames_run).bag.read_bytes()


@pytest.mark.parametrize(
    ("form", "suffix", "count"), [("semantickitti", ".bin", 4), ("pcd", ".pcd", 4), ("mmseg", ".jpg", 8)]
)
def test_exports_have_every_frame(frames_run: Path, form: str, suffix: str, count: int, tmp_path: Path) -> None:
    assert main(["export", str(frames_run), "--to", form, "--out", str(tmp_path / "out")]) == 0
    assert sum(path.suffix == suffix for path in (tmp_path / "out").rglob("*")) == count


@pytest.mark.parametrize("form", ["kitti", "tum"])
def test_formats_of_a_motion_refuse_them(
    frames_run: Path, form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(frames_run), "--to", form, "--out", str(tmp_path / "out")]) == 2
    *_, error = capsys.readouterr().err.splitlines()
    expected = f"frames.bag has separate frames, and format '{form}' is a motion; data sets of frames: webdataset, "
    assert expected in error
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"frames": {"count": 0}}, "frames.count must be an integer between 1 and 864000, got 0"),
        ({"frames": {}}, "frames.count is required"),
        ({"frames": {"count": 4, "step": 1}}, "unknown key 'frames.step'"),
        ({"seconds": 3}, "frames exclude drive and seconds: frames.count says how many there are"),
        ({"drive": {"track": "a.tum"}}, "frames exclude drive and seconds: frames.count says how many there are"),
        ({"rig": {"lidar": {"spinning": True}}}, "frames need spinning: false of lidar, as the robot stands still"),
        ({"frames": None}, "or frames: {count: NUMBER}"),
    ],
)
def test_errors_are_one_line_and_leave_nothing(
    values: dict[str, Any], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "frames.yaml"
    file.write_text(yaml.safe_dump({"name": "frames", "environment": "park", "frames": {"count": 4}, **values}))
    assert main(["generate", str(file), "--out", str(tmp_path / "data")]) == 2
    *_, error = capsys.readouterr().err.splitlines()
    assert error.startswith("error: ")
    assert expected in error
    assert not (tmp_path / "data").exists()


def test_a_duration_cannot_be_given_to_frames() -> None:
    with pytest.raises(ConfigurationError, match="frames exclude drive and seconds"):
        with_overrides(frames_experiment(), seconds=2.0)


def test_the_reader_gives_each_frame_its_own_pose(frames_run: Path, park: SensorWorld) -> None:
    frames = RunDataset(frames_run, ["image", "mask", "cloud", "labels", "instances", "pose"])
    assert len(frames) == 4
    expected = standing_robot(park.world, frames_experiment()).motion
    poses = np.array([frame["world_from_base"] for frame in frames])
    np.testing.assert_allclose(poses[:, :3, 3], expected.position, atol=1e-9)
    assert np.linalg.norm(np.diff(poses[:, :2, 3], axis=0), axis=1).min() > 2.0

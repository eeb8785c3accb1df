# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs along a track file: the track of a drive gives its images and clouds, and the run makes itself again."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.rosbag1 import Reader, Writer
from small_park import LAYOUT

from fieldtruth.bag.decode import points, read_bag
from fieldtruth.bag.run import open_run
from fieldtruth.bag.topics import PAPER_TOPICS
from fieldtruth.cli import main
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning, OutputError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.pipeline import generate
from fieldtruth.validation.runner import validate

pytestmark = pytest.mark.usefixtures("in_park")

IMU, ODOMETRY = "/imu/data", "/ground_truth/odom"
BARE = {"cameras": {"enabled": False}, "lidar": {"enabled": False}}
LINE = "\n".join(f"{t} {-33 + t} -6 0.2 0 0 0 1" for t in np.arange(0, 1.05, 0.1))


def written(folder: Path, text: str = LINE, name: str = "flight", **values: Any) -> Path:
    """A track file ``line.tum`` and an experiment of its own beside it."""
    folder.mkdir(exist_ok=True)
    (folder / "line.tum").write_text(text)
    data = {"name": name, "environment": "park", "rig": BARE, "drive": {"track": "line.tum"}, **values}
    (folder / f"{name}.yaml").write_text(yaml.safe_dump(data))
    return folder / f"{name}.yaml"


def messages_of(run: Path, *topics: str) -> dict[str, list[tuple[int, Any]]]:
    found: dict[str, list[tuple[int, Any]]] = {}
    for reading in read_bag(open_run(run).bag, topics):
        found.setdefault(reading.topic, []).append((reading.stamp_ns, reading.message))
    return found


@pytest.fixture(scope="module")
def again(lean_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lean run sensed along its own model states, at the rate of the physics."""
    folder = tmp_path_factory.mktemp("again")
    states = folder / "states.bag"
    with Reader(open_run(lean_run).bag) as source, Writer(states) as target:
        chosen = [c for c in source.connections if c.topic == "/gazebo/model_states"]
        copies = {
            c.id: target.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest) for c in chosen
        }
        for connection, stamp, data in source.messages(chosen):
            target.write(copies[connection.id], stamp, data)
    values = load_experiment(lean_run / "experiment.yaml").model_dump(mode="json")
    values |= {"name": "again", "route": None, "drive": {"track": "states.bag", "start_s": 0.0}}
    (folder / "again.yaml").write_text(yaml.safe_dump(values))
    generate(load_experiment(folder / "again.yaml"), folder)
    return folder / "again"


def test_images_clouds_and_fixes_are_those_of_the_drive_byte_for_byte(lean_run: Path, again: Path) -> None:
    present, expected = (set(open_run(run).counts) for run in (again, lean_run))
    assert expected - present == {topic.name for topic in PAPER_TOPICS if topic.kind == "wheel_odometry"}
    exact = sorted(topic for topic in present if topic.startswith(("/stereo", "/os1", "/navsat", "/clock")))
    assert len(exact) == 13
    own, followed = messages_of(lean_run, *exact), messages_of(again, *exact)
    for topic in exact:
        assert [stamp for stamp, _ in own[topic]] == [stamp for stamp, _ in followed[topic]]
        for (_, one), (_, other) in zip(own[topic], followed[topic], strict=True):
            assert repr(one) == repr(other) if not hasattr(one, "data") else np.array_equal(one.data, other.data)
    assert len(points(followed["/os1_cloud_node/points"][0][1])) > 10_000


def test_the_imu_is_that_of_the_drive_but_for_rounding(lean_run: Path, again: Path) -> None:
    own, followed = messages_of(lean_run, IMU)[IMU], messages_of(again, IMU)[IMU]
    assert len(own) == len(followed) == 26
    # The first reading begins with the first pose, before which there is no other one that states its velocity.
    for (_, one), (_, other) in zip(own[1:], followed[1:], strict=True):
        for part, tolerance in (("linear_acceleration", 1e-7), ("angular_velocity", 1e-10)):
            a, b = (np.array([getattr(getattr(m, part), axis) for axis in "xyz"]) for m in (one, other))
            np.testing.assert_allclose(a, b, atol=tolerance)


def test_a_run_along_a_track_is_valid(again: Path) -> None:
    checks = {check.name: check for check in validate(again, samples=1)}
    assert {name for name, check in checks.items() if check.passed is False} == set()
    assert {name for name, check in checks.items() if check.passed is None} == {
        "wheels", "wheel odometry", "commands", "photographs",
    }  # fmt: skip
    assert checks["checksums"].text.startswith("5 files")
    assert checks["drive"].text.endswith("0.52 s as in the experiment")


def test_a_changed_track_file_fails_the_validation(tmp_path: Path) -> None:
    run = generate(load_experiment(written(tmp_path)), tmp_path).parent
    stored = run / "track.csv"
    stored.write_text(stored.read_text().replace("-32.5,", "-32.49,"))
    checks = {check.name: check for check in validate(run, quick=True)}
    assert "track.csv has changed" in checks["checksums"].text
    assert checks["drive"].passed is False
    assert "1 of 10 mismatch, first at 500000000 ns: 0.01 m or of a rotation" in checks["drive"].text


def test_the_run_makes_itself_again_without_the_file(tmp_path: Path) -> None:
    own = written(tmp_path / "mine", drive={"track": "line.tum", "pose_of": "os1_lidar", "start_s": 0.3}, name="low")
    (tmp_path / "mine/line.tum").write_text(LINE.replace(" 0.2 ", " 1.2 "))
    first = generate(load_experiment(own), tmp_path / "data")
    (tmp_path / "mine/line.tum").unlink()
    (tmp_path / "data").rename(tmp_path / "moved")
    second = generate(load_experiment(tmp_path / "moved/low/experiment.yaml"), tmp_path / "again")
    for name in ("low.bag", "experiment.yaml", "track.csv", "SHA256SUMS", "DATASET.md", "made_by.json"):
        one, other = ((bag.parent / name) for bag in (tmp_path / "moved/low/low.bag", second))
        assert hashlib.sha256(one.read_bytes()).digest() == hashlib.sha256(other.read_bytes()).digest(), name
    assert first.name == second.name
    stored = load_experiment(tmp_path / "moved/low/experiment.yaml")
    assert stored.drive is not None
    assert (stored.drive.pose_of, stored.drive.start_s, stored.rig.reports_wheels) == ("os1_lidar", 0.3, False)
    (stamp, pose), *_, last = messages_of(second.parent, ODOMETRY)[ODOMETRY]
    at = pose.pose.pose.position
    np.testing.assert_allclose((at.x, at.y, at.z), (-33 + 0.3 + 0.02 - 0.09, -6.0, 1.2 - 0.826), atol=1e-9)
    assert (stamp, last[0]) == (20_000_000, 700_000_000)


def test_another_content_of_the_file_is_another_run(tmp_path: Path) -> None:
    experiment = load_experiment(written(tmp_path))
    bag = generate(experiment, tmp_path)
    bag.unlink()  # as if the run had been interrupted
    (tmp_path / "line.tum").write_text(LINE.replace(" 0.2 ", " 0.3 "))
    with pytest.raises(OutputError, match=r"holds another experiment \(different: track\.csv\)"):
        generate(experiment, tmp_path)
    generate(experiment, tmp_path, overwrite=True)
    heights = {m.pose.pose.position.z for _, m in messages_of(tmp_path / "flight", ODOMETRY)[ODOMETRY]}
    np.testing.assert_allclose(sorted(heights), 0.3)


def test_a_gap_is_a_warning(tmp_path: Path) -> None:
    lines = LINE.splitlines()
    with pytest.warns(FieldtruthWarning, match=r"line\.tum: no pose for 0\.7 s after 0\.200 s"):
        generate(load_experiment(written(tmp_path, "\n".join([*lines[:3], *lines[9:]]))), tmp_path)


@pytest.mark.parametrize(
    ("values", "text", "expected"),
    [
        ({}, LINE.replace(" -6 ", " -60 "), "line.tum: at 0.001 s base_link is at x -33.00 m, y -60.00 m, z 0.20 m, "),
        ({}, LINE.replace(" 0.2 ", " -3 "), "line.tum: from 0.001 s on base_link is below the ground, up to 2."),
        ({"drive": {"track": "gone.tum"}}, LINE, "gone.tum: No such file or directory"),
        ({"drive": {"track": "line.tum", "start_s": 5}}, LINE, "drive.start_s must be between, got 5.000 s"),
        ({"drive": {"track": "line.tum", "pose_of": "gps"}}, LINE, "unknown frame 'gps'"),
        ({"drive": {"path": "line.tum"}}, LINE, "unknown key 'drive.path'"),
        ({"drive": {}}, LINE, "drive.track is required: the path of a TUM or CSV file, a bag or the folder of a run"),
        ({"drive": None}, LINE, "route is required"),
        ({"route": {"random": {"length_m": 50, "seed": 1}}}, LINE, "route and drive exclude each other"),
    ],
)  # fmt: skip
def test_errors_are_one_line_and_leave_nothing(
    values: dict[str, Any], text: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["generate", str(written(tmp_path / "mine", text, **values)), "--out", str(tmp_path / "data")]) == 2
    *_, error = capsys.readouterr().err.splitlines()
    assert error.startswith("error: ")
    assert expected in error
    assert not (tmp_path / "data").exists()


def test_shares_need_a_route(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["shares", str(written(tmp_path, layout=LAYOUT))]) == 2
    assert "error: the experiment has no route: it follows a track file" in capsys.readouterr().err


def test_an_experiment_in_python_takes_a_path_from_the_current_folder() -> None:
    experiment = Experiment.model_validate({"name": "a", "environment": "park", "drive": {"track": "line.tum"}})
    assert experiment.drive is not None
    assert experiment.drive.track == "line.tum"
    with pytest.raises(ConfigurationError, match="cannot read"):
        load_experiment(Path("nowhere.yaml"))

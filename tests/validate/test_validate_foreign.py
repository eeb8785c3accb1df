# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of which nobody says what made them: a law that most obey is held against the others; no other law is."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__Imu as Imu
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointCloud2 as PointCloud2
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointField as PointField
from rosbags.typesys.stores.ros1_noetic import std_msgs__msg__String as String
from validate_bags import Change, add, bag_in, failures, only, points_in, rewritten

from fieldtruth.bag import topics as table
from fieldtruth.bag import types as ros
from fieldtruth.bag.reader import RawMessage
from fieldtruth.validation import Check, validate
from fieldtruth.validation.law import Law, check_of


def alone(run: Path, target: Path) -> Path:
    """A run's bag without the files beside it, under another name."""
    target.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copy(bag_in(run), target / "alone.bag"))


def by_name(checks: list[Check]) -> dict[str, Check]:
    return {check.name: check for check in checks}


def test_a_run_s_bag_alone_passes_all_that_needs_no_experiment(lean_run: Path, tmp_path: Path) -> None:
    checks = validate(alone(lean_run, tmp_path))
    needs_experiment = {
        "checksums", "experiment", "world", "drive", "retraced clouds", "retraced images", "photographs",
        "independent rays",
    }  # fmt: skip
    assert {check.name for check in checks if check.passed is None} == needs_experiment
    assert not failures(checks)
    assert all(check.text for check in checks)


def a_bench(data: bytearray) -> None:
    points_in(data)["label"][9] = points_in(data)["intensity"][9] = 11


def later(raw: RawMessage, k: int) -> RawMessage:
    return raw._replace(stamp_ns=raw.stamp_ns + 1) if raw.topic == table.IMU and k == 5 else raw


@pytest.mark.parametrize(
    ("check", "change"),
    [
        ("objects", only(table.POINTS, 2, a_bench)),
        ("pose streams", only(table.ODOMETRY, 5, add(34, 1e-3))),
        ("stamps", later),
    ],
)
def test_what_breaks_a_law_that_the_others_obey_is_found(
    lean_run: Path, tmp_path: Path, check: str, change: Change
) -> None:
    changed = alone(rewritten(lean_run, tmp_path, change), tmp_path / "alone")
    assert check in failures(validate(changed))


def recorded(path: Path, *, jump: float = 0.0) -> Path:
    """Half a second as a simulator's recorder might have it: stamps jitter, other frames, fields and numbers."""
    rng, zeros = np.random.default_rng(0), np.zeros(9)
    still, level = ros.Vector3(0.0, 0.0, 0.0), ros.Quaternion(0.0, 0.0, 0.0, 1.0)
    fields = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate(("x", "y", "z", "intensity"))]
    with Writer(path) as bag:
        topics = {
            table.MODEL_STATES: "gazebo_msgs/msg/ModelStates",
            table.IMU: "sensor_msgs/msg/Imu",
            table.POINTS: "sensor_msgs/msg/PointCloud2",
            "/chatter": "std_msgs/msg/String",
        }
        to = {name: bag.add_connection(name, kind, typestore=ros.STORE) for name, kind in topics.items()}
        for k in range(500):
            stamp = 7 * 10**9 + k * 1_000_000 + int(rng.integers(300_000))
            x = 3e-4 * k + jump * (k >= 250)
            robot = ros.Pose(ros.Point(x, 0.0, 0.0), level)
            poses, names = [ros.Pose(ros.Point(5.0, 1.0, 0.0), level), robot], ["oak", "husky"]
            twists = [ros.Twist(still, still), ros.Twist(ros.Vector3(0.3, 0.0, 0.0), still)]
            messages: list[tuple[str, object]] = [(table.MODEL_STATES, ros.ModelStates(names, poses, twists))]
            if k % 20 == 19:
                noise = [ros.vector(rng.normal(size=3)) for _ in range(2)]
                head = ros.header(900 + k, stamp - 4_000, "base_imu")
                messages.append((table.IMU, Imu(head, level, zeros, noise[0], zeros, noise[1], zeros)))
                messages.append(("/chatter", String("hello")))
            if k % 100 == 99:
                data = rng.integers(1, 13, (50, 4)).astype("<f4").view(np.uint8).reshape(-1)
                head = ros.header(k, 0, "os0")
                messages.append((table.POINTS, PointCloud2(head, 1, 50, fields, False, 16, 800, data, True)))
            for topic, message in messages:
                bag.write(to[topic], stamp, ros.serialize(message, topics[topic]))
    return path


def test_a_simulator_s_bag_is_not_judged_by_laws_that_are_not_its_own(tmp_path: Path) -> None:
    checks = by_name(validate(recorded(tmp_path / "gazebo.bag")))
    assert not failures(list(checks.values()))
    passed = {name for name, check in checks.items() if check.passed}
    assert passed == {"structure", "messages", "topics", "stamps", "still objects", "motion", "labels"}
    assert "/chatter" in checks["topics"].text
    assert checks["motion"].text == "0.15 m without a jump"
    assert "25 of 25 are otherwise" in checks["imu"].text
    assert "3 topics follow another clock" in checks["stamps"].text
    assert "left out" not in checks["stamps"].text
    assert checks["counts"].text == "no topic keeps its rate"


def test_a_jump_is_found_in_any_bag(tmp_path: Path) -> None:
    text = failures(validate(recorded(tmp_path / "gazebo.bag", jump=0.2)))["motion"]
    assert "does not jump: 1 of 499 breaks this" in text


def test_a_bag_of_other_topics_has_little_to_check(tmp_path: Path) -> None:
    path = tmp_path / "talk.bag"
    with Writer(path) as bag:
        talk = bag.add_connection("/chatter", "std_msgs/msg/String", typestore=ros.STORE)
        bag.write(talk, 5, ros.serialize(String("hello"), "std_msgs/msg/String"))
    checks = by_name(validate(path))
    assert {name for name, check in checks.items() if check.passed is not None} == {"structure", "messages"}
    assert not failures(list(checks.values()))


def test_laws_bind_or_are_learnt() -> None:
    """Of 100 items one, or eleven, are otherwise: that is wrong for a law that binds; eleven make another law."""
    for binding, broken, passed in [(True, 1, False), (True, 11, False), (False, 1, False), (False, 11, None)]:
        law = Law("they are so", binding=binding)
        for k in range(100):
            law.see(k >= broken, f"item {k}")
        assert law.passed is passed
        check = check_of("x", [law], "all is well", "nothing was seen")
        assert check.passed is passed
        assert "first item 0" in check.text or (passed is None and f"{broken} of 100 are otherwise" in check.text)
    assert check_of("x", [Law("they are so")], "all is well", "nothing was seen") == Check(
        "x", None, "nothing was seen"
    )


def test_a_residual_that_is_no_number_breaks_its_law() -> None:
    law = Law("they are small", 1.0, "m")
    assert law.measure(1.0, "here")
    assert not law.measure(float("nan"), "there")
    law.measure_all(np.array([0.5, -1.5, np.nan]), lambda k: f"row {k}")
    assert (law.seen, law.broken, law.worst) == (5, 3, 1.0)
    assert law.first == "there: nan m, at most 1 is allowed"

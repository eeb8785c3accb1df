# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bags without an experiment: a rule that most items meet is applied to the others, another one is not."""

import shutil
from pathlib import Path

import numpy as np
import ros_types as ros
from changed_bags import IMU, POINTS, Edits, add, bag_in, edited, failures, points_in, rewritten
from rosbags.rosbag1 import Writer
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__Imu as Imu
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointCloud2 as PointCloud2
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointField as PointField
from rosbags.typesys.stores.ros1_noetic import std_msgs__msg__String as String

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.validation import Check
from fieldtruth.validation.check import Count, Rule, Spec, Tally
from fieldtruth.validation.runner import validate


def alone(run: Path, target: Path) -> Path:
    """A run's bag without the files beside it, under another name."""
    target.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copy(bag_in(run), target / "alone.bag"))


def by_name(checks: list[Check]) -> dict[str, Check]:
    return {check.name: check for check in checks}


def test_bag_alone_passes_all_checks_that_need_no_experiment(lean_run: Path, tmp_path: Path) -> None:
    checks = validate(alone(lean_run, tmp_path))
    needs_experiment = {
        "checksums", "experiment", "world", "drive", "retraced clouds", "retraced images", "photographs",
        "independent rays", "commands",
    }  # fmt: skip
    assert {check.name for check in checks if check.passed is None} == needs_experiment
    assert not failures(checks)
    assert all(check.text for check in checks)


def bench(data: bytearray) -> None:
    points_in(data)["label"][9] = points_in(data)["intensity"][9] = 11


def test_mismatch_of_a_rule_that_the_others_meet_is_found(lean_run: Path, tmp_path: Path) -> None:
    """A class, a pose and a stamp: each is the only one of its stream."""
    edits: Edits = {(POINTS, 2): bench, (table.ODOMETRY, 5): add(34, 1e-3)}

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        if (raw.topic, k) == (IMU, 5):
            return raw._replace(stamp_ns=raw.stamp_ns + 1)
        return edited(edits)(raw, k)

    changed = alone(rewritten(lean_run, tmp_path, change), tmp_path / "alone")
    assert {"object classes", "poses", "stamps"} <= set(failures(validate(changed)))


def recorded(path: Path, *, jump: float = 0.0) -> Path:
    """Half a second as recorded from Gazebo: jittering stamps, and other frames, fields and sequence numbers."""
    rng, zeros = np.random.default_rng(0), np.zeros(9)
    still, level = ros.Vector3(0.0, 0.0, 0.0), ros.Quaternion(0.0, 0.0, 0.0, 1.0)
    fields = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate(("x", "y", "z", "intensity"))]
    with Writer(path) as bag:
        topics = {
            table.MODEL_STATES: "gazebo_msgs/msg/ModelStates",
            IMU: "sensor_msgs/msg/Imu",
            POINTS: "sensor_msgs/msg/PointCloud2",
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
                messages.append((IMU, Imu(head, level, zeros, noise[0], zeros, noise[1], zeros)))
                messages.append(("/chatter", String("hello")))
            if k % 100 == 99:
                data = rng.integers(1, 13, (50, 4)).astype("<f4").view(np.uint8).reshape(-1)
                head = ros.header(k, 0, "os0")
                messages.append((POINTS, PointCloud2(head, 1, 50, fields, False, 16, 800, data, True)))
            for topic, message in messages:
                bag.write(to[topic], stamp, ros.serialize(message, topics[topic]))
    return path


def test_rules_of_this_package_do_not_apply_to_a_recording_of_gazebo(tmp_path: Path) -> None:
    checks = by_name(validate(recorded(tmp_path / "gazebo.bag")))
    assert not failures(list(checks.values()))
    passed = {name for name, check in checks.items() if check.passed}
    assert passed == {"structure", "messages", "topics", "stamps", "static objects", "motion", "labels"}
    assert "/chatter" in checks["topics"].text
    assert "0.15 m driven" in checks["motion"].text
    assert "25 of 25 mismatch" in checks["imu"].text
    assert "3 topics follow another clock" in checks["stamps"].text
    assert "missing" not in checks["stamps"].text
    assert checks["counts"].text == "no topic has its rate"


def test_jump_is_found_in_any_bag(tmp_path: Path) -> None:
    text = failures(validate(recorded(tmp_path / "gazebo.bag", jump=0.2)))["motion"]
    assert "does not jump: 1 of 499 mismatch" in text


def test_bag_of_other_topics_has_few_checks(tmp_path: Path) -> None:
    path = tmp_path / "talk.bag"
    with Writer(path) as bag:
        talk = bag.add_connection("/chatter", "std_msgs/msg/String", typestore=ros.STORE)
        bag.write(talk, 5, ros.serialize(String("hello"), "std_msgs/msg/String"))
    checks = by_name(validate(path))
    assert {name for name, check in checks.items() if check.passed is not None} == {"structure", "messages"}
    assert not failures(list(checks.values()))


def test_rules_are_strict_or_need_a_majority() -> None:
    """Of 100 items one, or eleven, mismatch: either fails a strict rule; with eleven another rule does not apply."""
    rule = Rule("items are red")
    for strict, wrong, passed in [(True, 1, False), (True, 11, False), (False, 1, False), (False, 11, None)]:
        tally = Tally(Spec("x", (rule,), "items"), strict)
        for k in range(100):
            tally[rule].see(k >= wrong, f"item {k}")
        check = tally.result()
        assert tally[rule].passed is check.passed is passed
        assert "first item 0" in check.text or (passed is None and f"{wrong} of 100 mismatch" in check.text)
    assert Tally(Spec("x", (rule,), "items", "no items")).result() == Check("x", None, "no items")


def test_nan_breaks_a_rule() -> None:
    count = Count(Rule("items are small", 1.0, "m"))
    assert count.measure(1.0, "here")
    assert not count.measure(float("nan"), "there")
    count.measure_all(np.array([0.5, -1.5, np.nan]), lambda k: f"row {k}")
    assert (count.seen, count.wrong, count.worst) == (5, 3, 1.0)
    assert count.first == "there: nan m, tolerance 1"

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A pose that is off by a millimetre or a milliradian is found in every stream, though all checksums fit."""

import struct
from pathlib import Path

import numpy as np
import pytest
from changed_bags import GNSS, IMU, LEFT, RIGHT, WHEEL_ODOMETRY, Edit, Edits, add, edited, failures_of, first_message
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.reader import RawMessage
from fieldtruth.sensors.wheel_odometry.config import JOINT_STATES, WHEEL_SPEEDS

MILLI = 1e-3
HEADER = 4 + 8 + 4  # number, stamp, length of the frame's name
ODOM_POSE = HEADER + len("world") + 4 + len("base_link")
TF_POSE = 4 + ODOM_POSE
IMU_ATTITUDE = HEADER + len("imu_link")
LEFT_INFO, RIGHT_INFO = (imager.topic_of("camera_info") for imager in (LEFT, RIGHT))


def turned(offset: int, angle: float) -> Edit:
    """Turn a quaternion (x, y, z, w) by an angle [rad] about z; it stays of unit length."""

    def edit(data: bytearray) -> None:
        at = offset % len(data)
        q = Rotation.from_quat(struct.unpack_from("<4d", data, at)) * Rotation.from_rotvec([0, 0, angle])
        struct.pack_into("<4d", data, at, *q.as_quat())

    return edit


def longer(offset: int) -> Edit:
    """Scale a quaternion by 1 + 1e-6; the rotation stays the same."""

    def edit(data: bytearray) -> None:
        at = offset % len(data)
        q = np.array(struct.unpack_from("<4d", data, at))
        struct.pack_into("<4d", data, at, *(q * (1 + 1e-6)))

    return edit


def both(*edits: Edit) -> Edit:
    return lambda data: [edit(data) for edit in edits]


@pytest.fixture(scope="module")
def offsets(lean_run: Path) -> tuple[int, int]:
    """Bytes from the first pose and from the first twist to the end of a message of /gazebo/model_states."""
    data, reader = first_message(lean_run, table.MODEL_STATES).data, ModelStatesReader()
    count = len(reader.poses(data))
    return -(104 * count + 4), -48 * count


@pytest.fixture(scope="module")
def states(lean_run: Path, tmp_path_factory: pytest.TempPathFactory, offsets: tuple[int, int]) -> dict[str, str]:
    """Failed checks of changed model states: the first message, some in between, and the last."""
    poses, twists = offsets
    shift, turn = add(poses + 8, MILLI), turned(poses + 24, MILLI)
    edits: Edits = {
        (table.MODEL_STATES, 0): both(shift, turn),
        (table.MODEL_STATES, 301): shift,
        (table.MODEL_STATES, 401): turn,
        (table.MODEL_STATES, 333): add(twists, MILLI),
        (table.MODEL_STATES, 444): both(add(poses + 56 * 3 + 16, MILLI), longer(poses + 24)),
        (table.MODEL_STATES, 519): both(shift, turn, add(twists + 48 * 4, MILLI), longer(poses + 24)),
    }
    return failures_of(lean_run, tmp_path_factory.mktemp("states"), edits)


def test_pose_of_the_robot_is_found(states: dict[str, str]) -> None:
    """At either end one step mismatches, two in between; a changed velocity is one more."""
    unit, moves, turns = states["motion"].split("; ")
    assert unit.startswith("attitudes are unit quaternions: 2 of 520 mismatch")
    assert moves.startswith("the robot moves by velocity times time step: 5 of 519 mismatch")
    assert "2000000 ns: 0.001 m, tolerance 1e-09" in moves
    assert turns.startswith("the robot turns by turn rate times time step: 4 of 519 mismatch")
    assert "2000000 ns: 0.001 rad" in turns


def test_pose_and_twist_of_an_object_are_found_and_named(states: dict[str, str]) -> None:
    assert "2 of 520 mismatch" in states["static objects"]
    assert "445000000 ns: the pose of 'lamp_post_2'" in states["static objects"]


@pytest.fixture(scope="module")
def streams(lean_run: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Failed checks of changed streams that repeat or measure the motion, and of changed calibration."""
    focal = bytearray(first_message(lean_run, LEFT_INFO).data)
    add(-17 - 8 - 96 - 72 - 72, 1.0)(focal)  # fx in K, in all messages

    def mount(data: bytearray) -> None:
        add(bytes(data).index(b"os1_lidar") + len("os1_lidar"), MILLI)(data)

    def wheel(data: bytearray) -> None:
        data[:] = struct.pack("<f", struct.unpack("<f", data)[0] + 3.0)  # 0.5 m/s

    edits: Edits = {
        (table.ODOMETRY, 0): add(ODOM_POSE + 16, MILLI),
        (table.ODOMETRY, 25): turned(ODOM_POSE + 24, MILLI),
        (table.ODOMETRY, 12): add(ODOM_POSE + 56 + 288 + 40, MILLI),
        (table.TF, 0): turned(TF_POSE + 24, MILLI),
        (table.TF, 25): add(TF_POSE, MILLI),
        (IMU, 0): turned(IMU_ATTITUDE, MILLI),
        (IMU, 1): add(IMU_ATTITUDE + 32 + 72, MILLI),
        (IMU, 25): add(IMU_ATTITUDE + 32 + 72 + 24 + 72, MILLI),
        (IMU, 9): add(IMU_ATTITUDE + 32, MILLI),
        (GNSS, 0): add(-97, 1e-8),  # latitude [deg]: 1.1 mm
        (WHEEL_SPEEDS[3], 3): wheel,
        (table.TF_STATIC, 0): mount,
        (RIGHT_INFO, 8): add(-17 - 8 - 96 + 24, 1.0),  # the baseline in P, once
    }

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        if raw.topic == LEFT_INFO:
            return raw._replace(data=raw.data[:12] + bytes(focal)[12:])
        return edited(edits)(raw, k)

    return failures_of(lean_run, tmp_path_factory.mktemp("streams"), change)


def test_only_the_changed_streams_fail(streams: dict[str, str]) -> None:
    """The mount of the LiDAR moves its points in the images as well; joints, fix and heading have a second check."""
    changed = {"poses", "imu", "gnss", "wheels", "wheel odometry", "commands", "calibration"}
    assert changed <= set(streams) <= changed | {"lidar and cameras"}


def test_poses_and_twist_of_odometry_and_tf_are_found(streams: dict[str, str]) -> None:
    poses, transforms, twists = streams["poses"].split("; ")
    assert "the pose of odometry is that of model states: 2 of 26" in poses
    assert f"{table.ODOMETRY} at 20000000 ns: 0.001" in poses
    assert "the pose of /tf is that of model states: 2 of 26" in transforms
    assert "the twist of odometry is that of model states in base_link: 1 of 26" in twists
    assert "260000000 ns: 0.001" in twists


def test_imu_readings_are_found(streams: dict[str, str]) -> None:
    rules = ["attitude", "gyroscope", "accelerometer", "covariances"]
    for text, rule, stamp in zip(streams["imu"].split("; "), rules, (20, 40, 520, 200), strict=True):
        assert rule in text
        assert f"1 of 26 mismatch, first {IMU} at {stamp}000000 ns" in text


def test_fix_a_millimetre_off_is_found(streams: dict[str, str]) -> None:
    assert streams["gnss"].startswith("the fix is the true position of the antenna: not met")
    assert "0.00111 m, tolerance 1e-06" in streams["gnss"]


def test_altitude_a_millimetre_off_is_found(lean_run: Path, tmp_path: Path) -> None:
    assert list(failures_of(lean_run, tmp_path, {(GNSS, 0): add(-81, MILLI)})) == ["gnss"]


def test_wheel_that_turns_alone_is_found(streams: dict[str, str]) -> None:
    assert "1 of 5 mismatch, first" in streams["wheels"]
    assert "tachometers read the speeds of /joint_states: 1 of 20" in streams["wheel odometry"]


def test_each_part_of_what_the_base_reports_is_found(lean_run: Path, tmp_path: Path) -> None:
    """A joint's angle, a position, a twist, a wheel in /tf, and a command, each in one message."""
    edits: Edits = {
        (JOINT_STATES, 5): add(-72, MILLI),
        (WHEEL_ODOMETRY, 10): add(HEADER + len("odom") + 4 + len("base_link"), MILLI),
        (WHEEL_ODOMETRY, 12): add(-288 - 48, MILLI),
        (table.TF, 20): turned(-32, MILLI),
        (table.COMMANDS, 7): add(-8, MILLI),
    }
    found = failures_of(lean_run, tmp_path, edits)
    assert set(found) == {"wheel odometry", "commands"}
    pose, twist, wheels = found["wheel odometry"].split("; ")
    # The next difference takes the angle back; what was moved in another direction meanwhile remains.
    assert "adds up what the wheels turn: 21 of 26 mismatch, first /odometry/wheel at 120000000 ns" in pose
    assert "is its change: 3 of 26 mismatch" in twist
    assert "the angles of /joint_states: 2 of 26 mismatch" in wheels
    assert "1 of 26 mismatch, first /cmd_vel at 160000000 ns: 0.001 m/s or rad/s" in found["commands"]


def test_mount_a_millimetre_off_is_found(streams: dict[str, str]) -> None:
    assert "'os1_lidar' in 'base_link': 0.001" in streams["calibration"]


def test_changed_camera_matrix_is_found(streams: dict[str, str]) -> None:
    """Once, the baseline in P of the right camera; and fx in K of the left camera in all of the run."""
    text = streams["calibration"]
    assert "field of view: 1 of 4 mismatch, first camera left: 1 pixel" in text
    assert f"CameraInfo does not change: 1 of 26 mismatch, first {RIGHT_INFO} at 360000000 ns" in text


def test_edits_change_the_intended_values() -> None:
    data = bytearray(np.array([0.0, 0.0, 0.0, 1.0, 5.0]).tobytes())
    turned(0, MILLI)(data)
    add(-8, MILLI)(data)
    x, y, z, w, five = np.frombuffer(data)
    assert (x, y, five) == (0.0, 0.0, 5.001)
    assert 2 * np.arctan2(z, w) == pytest.approx(MILLI)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A pose that is off by a millimetre or a milliradian is found, wherever it stands, though all checksums fit."""

import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from validate_bags import Change, Edit, add, each, first_message, only, quick_failures, rewritten

from fieldtruth.bag import topics as table
from fieldtruth.bag.model_states import ModelStatesReader
from fieldtruth.bag.reader import RawMessage

MILLI = 1e-3
HEADER = 4 + 8 + 4  # number, stamp, length of the frame's name
ODOM_POSE = HEADER + len("world") + 4 + len("base_link")
TF_POSE = 4 + ODOM_POSE
IMU_ATTITUDE = HEADER + len("imu_link")


def turned(offset: int, angle: float) -> Edit:
    """Turn a quaternion (x, y, z, w) by an angle [rad] about z; it stays of unit length."""

    def edit(data: bytearray) -> None:
        at = offset % len(data)
        q = Rotation.from_quat(struct.unpack_from("<4d", data, at)) * Rotation.from_rotvec([0, 0, angle])
        struct.pack_into("<4d", data, at, *q.as_quat())

    return edit


@pytest.fixture(scope="module")
def offsets(lean_run: Path) -> tuple[int, int]:
    """Where the poses and the twists begin in a message of /gazebo/model_states, from its end."""
    data, reader = first_message(lean_run, table.MODEL_STATES).data, ModelStatesReader()
    count = len(reader.poses(data))
    return -(104 * count + 4), -48 * count


def found(lean_run: Path, target: Path, change: Change) -> dict[str, str]:
    return quick_failures(rewritten(lean_run, target, change))


def test_a_millimetre_and_a_milliradian_in_model_states_are_found(
    lean_run: Path, tmp_path: Path, offsets: tuple[int, int]
) -> None:
    """In the first message, in any, and in the last: one step breaks at either end, two in between."""
    where = {"moves": (0, 300, 519), "turns": (0, 400, 519)}
    edits: dict[tuple[str, int], Edit] = {}
    for number in {*where["moves"], *where["turns"]}:

        def edit(data: bytearray, number: int = number) -> None:
            if number in where["moves"]:
                add(offsets[0] + 8, MILLI)(data)
            if number in where["turns"]:
                turned(offsets[0] + 24, MILLI)(data)

        edits[table.MODEL_STATES, number] = edit
    first, second = found(lean_run, tmp_path, each(edits))["motion"].split("; ")
    assert "moves by its velocity times the step: 4 of 519 break this" in first
    assert "2000000 ns: 0.001 m" in first
    assert "turns by its turn rate times the step: 4 of 519 break this" in second
    assert "2000000 ns: 0.001 rad" in second


def test_an_attitude_that_is_no_unit_quaternion_is_found(
    lean_run: Path, tmp_path: Path, offsets: tuple[int, int]
) -> None:
    """Longer by 1e-6, in the first message and in the last: the turn that it stands for is the same."""

    def longer(data: bytearray) -> None:
        q = struct.unpack_from("<4d", data, offsets[0] % len(data) + 24)
        struct.pack_into("<4d", data, offsets[0] % len(data) + 24, *(np.array(q) * (1 + 1e-6)))

    edits: dict[tuple[str, int], Edit] = {(table.MODEL_STATES, 0): longer, (table.MODEL_STATES, 519): longer}
    text = found(lean_run, tmp_path, each(edits))["motion"]
    assert text.startswith("attitudes are unit quaternions: 2 of 520 break this")


def test_a_velocity_that_is_not_the_motions_is_found(lean_run: Path, tmp_path: Path, offsets: tuple[int, int]) -> None:
    texts = found(lean_run, tmp_path, only(table.MODEL_STATES, 333, add(offsets[1], MILLI)))
    assert list(texts) == ["motion"]
    assert "moves by its velocity times the step: 1 of 519" in texts["motion"]


def test_an_object_that_moves_by_a_millimetre_is_found_and_named(
    lean_run: Path, tmp_path: Path, offsets: tuple[int, int]
) -> None:
    edits = {
        (table.MODEL_STATES, 444): add(offsets[0] + 56 * 3 + 16, MILLI),
        (table.MODEL_STATES, 519): add(offsets[1] + 48 * 4, MILLI),
    }
    texts = found(lean_run, tmp_path, each(edits))
    assert list(texts) == ["still objects"]
    assert "2 of 520 break this" in texts["still objects"]
    assert "445000000 ns: the pose of 'lamp_post_2'" in texts["still objects"]


def test_poses_and_twists_in_odometry_and_tf_are_found(lean_run: Path, tmp_path: Path) -> None:
    edits = {
        (table.ODOMETRY, 0): add(ODOM_POSE + 16, MILLI),
        (table.ODOMETRY, 25): turned(ODOM_POSE + 24, MILLI),
        (table.ODOMETRY, 12): add(ODOM_POSE + 56 + 288 + 40, MILLI),
        (table.TF, 0): turned(TF_POSE + 24, MILLI),
        (table.TF, 25): add(TF_POSE, MILLI),
    }
    texts = found(lean_run, tmp_path, each(edits))
    assert list(texts) == ["pose streams"]
    poses, transforms, twists = texts["pose streams"].split("; ")
    assert "the pose of odometry is the true one, bit by bit: 2 of 26" in poses
    assert f"{table.ODOMETRY} at 20000000 ns: 0.001" in poses
    assert "the pose of /tf is the true one, bit by bit: 2 of 26" in transforms
    assert "the twist of odometry is the true one in base_link: 1 of 26" in twists
    assert "260000000 ns: 0.001" in twists


def test_imu_readings_that_are_not_the_motions_are_found(lean_run: Path, tmp_path: Path) -> None:
    edits = {
        (table.IMU, 0): turned(IMU_ATTITUDE, MILLI),
        (table.IMU, 1): add(IMU_ATTITUDE + 32 + 72, MILLI),
        (table.IMU, 25): add(IMU_ATTITUDE + 32 + 72 + 24 + 72, MILLI),
        (table.IMU, 9): add(IMU_ATTITUDE + 32, MILLI),
    }
    texts = found(lean_run, tmp_path, each(edits))
    assert list(texts) == ["imu"]
    laws = ["attitude", "gyroscope", "accelerometer", "covariances"]
    for told, law, stamp in zip(texts["imu"].split("; "), laws, (20, 40, 520, 200), strict=True):
        assert law in told
        assert f"1 of 26 breaks this, first {table.IMU} at {stamp}000000 ns" in told


@pytest.mark.parametrize(("offset", "amount"), [(-97, 1e-8), (-81, 1e-3)])
def test_a_fix_that_is_a_millimetre_off_is_found(lean_run: Path, tmp_path: Path, offset: int, amount: float) -> None:
    """1e-8 deg of latitude are 1.1 mm."""
    texts = found(lean_run, tmp_path, only(table.NAVSAT, 0, add(offset, amount)))
    assert list(texts) == ["gnss"]


def test_a_wheel_that_turns_alone_is_found(lean_run: Path, tmp_path: Path) -> None:
    def edit(data: bytearray) -> None:
        data[:] = struct.pack("<f", struct.unpack("<f", data)[0] + 3.0)  # 0.5 m/s

    assert list(found(lean_run, tmp_path, only(table.WHEEL_SPEEDS[3], 3, edit))) == ["wheels"]


def test_a_mount_that_is_a_millimetre_off_is_found(lean_run: Path, tmp_path: Path) -> None:
    def edit(data: bytearray) -> None:
        add(bytes(data).index(b"os1_lidar") + len("os1_lidar"), MILLI)(data)

    texts = found(lean_run, tmp_path, only(table.TF_STATIC, 0, edit))
    assert "'os1_lidar' in 'base_link': 0.001" in texts["calibration"]


def test_a_camera_matrix_that_changes_is_found(lean_run: Path, tmp_path: Path) -> None:
    """Once, the baseline in P; and for all of a run, fx in K."""
    left, right = map(table.camera_info, table.SIDES)
    focal = bytearray(first_message(lean_run, left).data)
    add(-17 - 8 - 96 - 72 - 72, 1.0)(focal)

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        if raw.topic == left:
            return raw._replace(data=raw.data[:12] + bytes(focal)[12:])
        return only(right, 8, add(-17 - 8 - 96 + 24, 1.0))(raw, k)

    text = found(lean_run, tmp_path, change)["calibration"]
    assert "K and P are those of the fields of view: 1 of 4 breaks this, first camera left: 1 pixel" in text
    assert "CameraInfo never changes: 1 of 24 breaks this" in text
    assert f"{right} at 360000000 ns" in text


def test_the_edits_are_what_they_say() -> None:
    data = bytearray(np.array([0.0, 0.0, 0.0, 1.0, 5.0]).tobytes())
    turned(0, MILLI)(data)
    add(-8, MILLI)(data)
    x, y, z, w, five = np.frombuffer(data)
    assert (x, y, five) == (0.0, 0.0, 5.001)
    assert 2 * np.arctan2(z, w) == pytest.approx(MILLI)

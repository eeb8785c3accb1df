# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A pose that is off by a millimetre or a milliradian is found, wherever it stands, though all checksums fit."""

import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from validate_bags import Change, Edit, add, first_message, only, quick_failures, rewritten

from fieldtruth.record import topics as table
from fieldtruth.record.model_states import ModelStatesReader

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


@pytest.mark.parametrize("number", [0, 300, 519])
def test_a_millimetre_in_model_states_is_found(
    lean_run: Path, tmp_path: Path, offsets: tuple[int, int], number: int
) -> None:
    """In the first message, any, and the last."""
    texts = found(lean_run, tmp_path, only(table.MODEL_STATES, number, add(offsets[0] + 8, MILLI)))
    stamp = max(number + 1, 2) * 1_000_000  # the first one shows when the second does not follow from it
    assert f"{stamp} ns: 0.001 m" in texts["motion"]


@pytest.mark.parametrize("number", [0, 519])
def test_a_milliradian_in_model_states_is_found(
    lean_run: Path, tmp_path: Path, offsets: tuple[int, int], number: int
) -> None:
    texts = found(lean_run, tmp_path, only(table.MODEL_STATES, number, turned(offsets[0] + 24, MILLI)))
    assert "turns by its turn rate" in texts["motion"]
    assert "0.001 rad" in texts["motion"]


def test_a_velocity_that_is_not_the_motions_is_found(lean_run: Path, tmp_path: Path, offsets: tuple[int, int]) -> None:
    texts = found(lean_run, tmp_path, only(table.MODEL_STATES, 333, add(offsets[1], MILLI)))
    assert "moves by its velocity" in texts["motion"]


def test_an_object_that_moves_by_a_millimetre_is_found_and_named(
    lean_run: Path, tmp_path: Path, offsets: tuple[int, int]
) -> None:
    texts = found(lean_run, tmp_path, only(table.MODEL_STATES, 444, add(offsets[0] + 56 * 3 + 16, MILLI)))
    assert list(texts) == ["still objects"]
    assert "the pose of 'lamp_post_2'" in texts["still objects"]
    texts = found(lean_run, tmp_path / "twist", only(table.MODEL_STATES, 444, add(offsets[1] + 48 * 4, MILLI)))
    assert "the twist of 'lamp_post_3'" in texts["still objects"]


@pytest.mark.parametrize("number", [0, 25])
@pytest.mark.parametrize(
    ("topic", "pose_at", "name"), [(table.ODOMETRY, ODOM_POSE, "odometry"), (table.TF, TF_POSE, "/tf")]
)
def test_a_pose_in_odometry_or_tf_is_found(
    lean_run: Path, tmp_path: Path, topic: str, pose_at: int, name: str, number: int
) -> None:
    edit = add(pose_at + 16, MILLI) if number else turned(pose_at + 24, MILLI)
    texts = found(lean_run, tmp_path, only(topic, number, edit))
    assert list(texts) == ["pose streams"]
    assert f"the pose of {name}" in texts["pose streams"]
    assert f"{(number + 1) * 20_000_000} ns" in texts["pose streams"]


def test_a_twist_in_odometry_is_found(lean_run: Path, tmp_path: Path) -> None:
    texts = found(lean_run, tmp_path, only(table.ODOMETRY, 20, add(ODOM_POSE + 56 + 288 + 40, MILLI)))
    assert "the twist of odometry" in texts["pose streams"]


@pytest.mark.parametrize(
    ("offset", "law"),
    [(IMU_ATTITUDE, "attitude"), (IMU_ATTITUDE + 32 + 72, "gyroscope"), (IMU_ATTITUDE + 32 + 72 + 24 + 72, "g")],
)
def test_an_imu_reading_that_is_not_the_motions_is_found(lean_run: Path, tmp_path: Path, offset: int, law: str) -> None:
    edit = turned(offset, MILLI) if law == "attitude" else add(offset, MILLI)
    texts = found(lean_run, tmp_path, only(table.IMU, 17, edit))
    assert list(texts) == ["imu"]
    assert law in texts["imu"]
    assert "360000000 ns: 0.001" in texts["imu"]


@pytest.mark.parametrize(("offset", "amount"), [(-97, 1e-8), (-89, 1e-8), (-81, 1e-3)])
def test_a_fix_that_is_a_millimetre_off_is_found(lean_run: Path, tmp_path: Path, offset: int, amount: float) -> None:
    """1e-8 deg of latitude are 1.1 mm, of longitude 0.7 mm."""
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


@pytest.mark.parametrize("edit", [add(-17 - 8 - 96 + 24, 1.0), add(-17 - 8 - 96 - 72 - 72, 1.0)])
def test_a_camera_matrix_that_changes_is_found(lean_run: Path, tmp_path: Path, edit: Edit) -> None:
    """The baseline in P, and fx in K, in one message and in all."""
    topic = table.camera_info("right")
    texts = found(lean_run, tmp_path, only(topic, 8, edit))
    assert "CameraInfo never changes" in texts["calibration"]
    (tmp_path / "all").mkdir()
    data = bytearray(first_message(lean_run, topic).data)
    edit(data)
    texts = found(lean_run, tmp_path / "all", lambda raw, k: raw._replace(data=raw.data[:12] + bytes(data)[12:])
                  if raw.topic == topic else raw)  # fmt: skip
    assert "K and P are those of the fields of view" in texts["calibration"]
    assert "never" not in texts["calibration"]


def test_the_edits_are_what_they_say() -> None:
    data = bytearray(np.array([0.0, 0.0, 0.0, 1.0, 5.0]).tobytes())
    turned(0, MILLI)(data)
    add(-8, MILLI)(data)
    x, y, z, w, five = np.frombuffer(data)
    assert (x, y, five) == (0.0, 0.0, 5.001)
    assert 2 * np.arctan2(z, w) == pytest.approx(MILLI)

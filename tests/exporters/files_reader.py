# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Read exported files and the bag with independent readers."""

import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rosbags.highlevel import AnyReader

SIDES = ("left", "right")
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
POINTS = "/os1_cloud_node/points"
IMU = "/imu/data"
MODELS = "/gazebo/model_states"
ODOMETRY = "/ground_truth/odom"


def camera(side: str, name: str) -> str:
    """Topic of a camera."""
    return f"/stereo/camera/{side}/{name}"


@cache
def messages(bag: Path, topic: str, every: int = 1) -> list[tuple[int, Any]]:
    """Stamp in the bag [ns] and message, of every ``every``-th message; copy before changing one."""
    with AnyReader([bag]) as reader:
        chosen = [connection for connection in reader.connections if connection.topic == topic]
        raw = list(reader.messages(connections=chosen))[::every]
        return [(stamp, reader.deserialize(data, connection.msgtype)) for connection, stamp, data in raw]


def header_ns(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def cloud_columns(message: Any) -> NDArray[np.float32]:
    """x, y, z, intensity of a cloud, point by point at the offsets of its fields."""
    offsets = [field.offset for name in ("x", "y", "z", "intensity") for field in message.fields if field.name == name]
    data, step = message.data.tobytes(), message.point_step
    rows = [[struct.unpack_from("<f", data, k * step + at)[0] for at in offsets] for k in range(message.width)]
    return np.array(rows, np.float32)


def table(path: Path) -> tuple[list[int], NDArray[np.float64]]:
    """Stamps of a text file as integers, and the other columns."""
    rows = np.loadtxt(path, dtype=str, ndmin=2)
    return [int(stamp) for stamp in rows[:, 0]], rows[:, 1:].astype(np.float64)


def names(folder: Path, ending: str) -> list[int]:
    """Stamps in the file names of a folder."""
    paths = list(folder.iterdir())
    assert {path.suffix for path in paths} == {ending}
    return sorted(int(path.stem) for path in paths)


def read_image(path: Path) -> NDArray[Any]:
    with Image.open(path) as image:
        return np.asarray(image)

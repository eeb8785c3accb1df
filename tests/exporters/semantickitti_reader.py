# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Read SemanticKITTI folders as semantic-kitti-api does, and copy bags with changed messages."""

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
import paper_topics
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import read_bag, stamp_ns, static_transforms
from fieldtruth.bag.messages import STORE
from fieldtruth.bag.reader import open_bag

F8 = NDArray[np.float64]
LIDAR_ONLY = (paper_topics.POINTS, table.TF_STATIC, table.ODOMETRY)


def read_scan(folder: Path, number: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Points (n, 4) and labels (n,), as every reader of the format takes them from the files."""
    scan = np.fromfile(folder / "velodyne" / f"{number:06d}.bin", np.float32).reshape(-1, 4)
    return scan, np.fromfile(folder / "labels" / f"{number:06d}.label", np.uint32)


def read_calib(folder: Path) -> dict[str, F8]:
    """calib.txt as generate_sequential.py reads it: every line 12 numbers, completed to (4, 4)."""
    matrices = {}
    for line in (folder / "calib.txt").read_text().splitlines():
        key, content = line.strip().split(":")
        values = [float(v) for v in content.split()]
        assert len(values) == 12
        matrices[key] = np.vstack([np.reshape(values, (3, 4)), [0, 0, 0, 1]])
    return matrices


def read_poses(folder: Path) -> F8:
    """Poses (n, 4, 4) of cam0 in poses.txt."""
    rows = np.loadtxt(folder / "poses.txt", ndmin=2).reshape(-1, 3, 4)
    return np.concatenate([rows, np.broadcast_to([[[0.0, 0.0, 0.0, 1.0]]], (len(rows), 1, 4))], axis=1)


def lidar_poses(folder: Path) -> F8:
    """Poses of the LiDAR as semantic-kitti-api computes them: inv(Tr) @ pose @ Tr."""
    transform = read_calib(folder)["Tr"]
    return np.linalg.inv(transform) @ read_poses(folder) @ transform


def true_lidar_poses(bag: Path) -> F8:
    """world_from_lidar (n, 4, 4) at the clouds' stamps, by SciPy from the numbers in the bag's messages."""
    at = {}
    for reading in read_bag(bag, [table.ODOMETRY]):
        p, q = reading.message.pose.pose.position, reading.message.pose.pose.orientation
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        pose[:3, 3] = p.x, p.y, p.z
        at[stamp_ns(reading.message.header)] = pose
    base_from_lidar = static_transforms(bag)["base_link", "os1_lidar"]
    stamps = [stamp_ns(reading.message.header) for reading in read_bag(bag, [paper_topics.POINTS])]
    return np.array([at[stamp] @ base_from_lidar for stamp in stamps])


def rewritten(bag: Path, target: Path, topics: Collection[str], **changes: Callable[[Any], None]) -> Path:
    """Copy some topics of a bag; ``points`` and ``camera_info`` change the messages of those kinds."""
    with open_bag(bag) as stored, Writer(target) as writer:
        types = {topic: stored.msgtypes[topic] for topic in sorted(topics)}
        connections = {topic: writer.add_connection(topic, kind, typestore=STORE) for topic, kind in types.items()}
        for raw in stored.messages(sorted(topics)):
            data = raw.data
            change = changes.get(raw.topic.rpartition("/")[2])
            if change is not None:
                message = STORE.deserialize_ros1(data, raw.msgtype)
                change(message)
                data = bytes(STORE.serialize_ros1(message, raw.msgtype))
            writer.write(connections[raw.topic], raw.stamp_ns, data)
    return target

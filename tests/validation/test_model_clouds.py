# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds of LiDAR models pass the checks of their rays, and one wrong value does not."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from fieldtruth.bag import decode as read
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.classes import CLASSES
from fieldtruth.sensors.lidar import check as clouds
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import ray_directions, ray_times_ns
from fieldtruth.sensors.lidar.sensor import point_cloud
from fieldtruth.validation.check import Rule, Tally

STAMP = 1_700_000_000_123_456_789


def counts(message: Any, config: LidarConfig) -> dict[str, int]:
    """Number of mistakes by rule."""
    classes: Any = SimpleNamespace(has_wide_ids=False, see=lambda *_: None, classes=CLASSES)
    labels, rays = Tally(clouds.LABELS), Tally(clouds.RAYS)
    clouds._check_cloud(RawMessage(STAMP, "here", "", b""), message, config, labels, rays, classes)
    return {rule.text: tally[rule].wrong for tally in (labels, rays) for rule in tally.spec.rules}


@pytest.mark.parametrize(
    ("model", "field", "rule"),
    [
        ("vlp_16", "time", clouds.TIME),
        ("xt32", "timestamp", clouds.TIME),
        ("os1_64_gen1", "t", clouds.TIME),
        ("os1_64_gen1", "range", clouds.RANGE),
        ("os1_64_gen1", "reflectivity", clouds.INTENSITY),
        ("os1_64_gen1", "ambient", clouds.INTENSITY),
        ("mid_360", "t", clouds.TIME),
        ("mid_360", "timestamp", clouds.TIME),
        ("mid_360", "line", clouds.LAYOUT),
    ],
)
def test_one_wrong_value_of_a_model_is_found(model: str, field: str, rule: Rule) -> None:
    config = LidarConfig(model=model)
    rays = ray_directions(config, STAMP)
    column, ring = (index.ravel().astype(np.uint16) for index in np.indices(rays.shape[:2]))
    scan: Any = SimpleNamespace(
        xyz=(rays * 10).reshape(-1, 3).astype(np.float32),
        label=np.full(len(ring), 2, np.uint8),
        instance=np.ones(len(ring), np.uint32),
        ring=ring,
        column=column,
        t_ns=ray_times_ns(config).ravel().astype(np.uint32),
    )
    data = point_cloud(1, STAMP, scan, config)
    message: Any = get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(data, "sensor_msgs/msg/PointCloud2")
    assert set(counts(message, config).values()) == {0}
    points = read.points(message).copy()
    points[field][5] += 1e-4 if field == config.time_field else 1000 if field == "timestamp" else 1
    message.data = points.view(np.uint8).ravel()
    assert {text for text, wrong in counts(message, config).items() if wrong} == {rule.text}

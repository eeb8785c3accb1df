# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Points of the LiDAR models against the fields that programs declare for the makers' drivers.

PCL copies a field of a message into a program's struct if name and type are those of the struct, at any offset
(``pcl::FieldMatches``); others keep their zeros.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from fieldtruth.bag import decode as read
from fieldtruth.experiment.catalogue import list_models
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensor import point_cloud

STAMP = 1_700_000_000_123_456_789
UINT8, UINT16, UINT32, FLOAT32, FLOAT64 = 2, 4, 6, 7, 8  # sensor_msgs/PointField
XYZI = {"x": FLOAT32, "y": FLOAT32, "z": FLOAT32, "intensity": FLOAT32}

FAST_LIO2 = {
    "velodyne": XYZI | {"time": FLOAT32, "ring": UINT16},
    "ouster": XYZI | {"t": UINT32, "reflectivity": UINT16, "ring": UINT8, "ambient": UINT16, "range": UINT32},
}
"""hku-mars/FAST_LIO 7cc4175, src/preprocess.h: velodyne_ros::Point and ouster_ros::Point."""
LIO_SAM = {
    "velodyne": XYZI | {"ring": UINT16, "time": FLOAT32},
    "ouster": XYZI | {"t": UINT32, "reflectivity": UINT16, "ring": UINT8, "range": UINT32},
}
"""TixiaoShan/LIO-SAM 0be1fbe, src/imageProjection.cpp, without ``noise``, which is declared and not used."""
DRIVERS = {
    "velodyne": XYZI | {"ring": UINT16, "time": FLOAT32},
    "hesai": XYZI | {"ring": UINT16, "timestamp": FLOAT64},
    "robosense": XYZI | {"ring": UINT16, "timestamp": FLOAT64},
    "livox": XYZI | {"tag": UINT8, "line": UINT8, "timestamp": FLOAT64},
}
"""ros-drivers/velodyne 29abd0e, pointcloudXYZIRT.cc; HesaiTechnology/HesaiLidar_ROS_2.0 e7e112f,
source_driver_ros1.hpp; RoboSense-LiDAR/rslidar_sdk 78d2abb, source_pointcloud_ros.hpp; Livox-SDK/livox_ros_driver2
13eb05e, lddc.cpp."""
KISS_ICP_TIMES = {"t", "timestamp", "time"}
"""PRBonn/kiss-icp 4bd9a10, python/kiss_icp/tools/point_cloud2.py and ros/src/Utils.hpp."""


def maker(name: str) -> str:
    """Maker of a model."""
    return list_models("lidar")[name].split()[0].lower()


def message(config: LidarConfig) -> Any:
    """A cloud of three points of a LiDAR: 10, 20 and 30 m ahead, 1, 2 and 3 ms after the stamp."""
    steps = np.arange(1, 4)
    scan: Any = SimpleNamespace(
        xyz=steps[:, None] * np.array([[10.0, 0.0, 0.0]], np.float32),
        label=steps.astype(np.uint8),
        instance=steps.astype(np.uint32) + 100,
        ring=(config.rings - steps).astype(np.uint16),
        column=steps.astype(np.uint16),
        t_ns=(steps * 1_000_000).astype(np.uint32),
    )
    data = point_cloud(1, STAMP, scan, config)
    return get_typestore(Stores.ROS1_NOETIC).deserialize_ros1(data, "sensor_msgs/msg/PointCloud2")


@pytest.mark.parametrize("name", list_models("lidar"))
def test_programs_find_every_field_that_they_declare_for_the_maker(name: str) -> None:
    fields = {field.name: field.datatype for field in message(LidarConfig(model=name)).fields}
    for declared in (FAST_LIO2, LIO_SAM, DRIVERS):
        assert declared.get(maker(name), {}).items() <= fields.items()
    assert fields.keys() & KISS_ICP_TIMES
    assert {"column": UINT16, "label": UINT16, "instance": UINT16}.items() <= fields.items()


def test_an_ousters_fields_have_the_order_of_its_driver() -> None:
    cloud = message(LidarConfig(model="os1_128"))
    names = [field.name for field in cloud.fields]
    assert names == [*FAST_LIO2["ouster"], "column", "label", "instance"]
    ends = [field.offset + np.dtype(read._NUMPY[field.datatype]).itemsize for field in cloud.fields]
    starts = [field.offset for field in cloud.fields]
    assert all(end <= start for end, start in zip(ends, starts[1:], strict=False))
    assert ends[-1] <= cloud.point_step


def test_an_ousters_values() -> None:
    points = read.points(message(LidarConfig(model="os1_128")))
    assert points["range"].tolist() == [10_000, 20_000, 30_000]  # [mm]
    assert points["ring"].tolist() == [127, 126, 125]
    assert points["reflectivity"].tolist() == points["label"].tolist() == points["intensity"].tolist() == [1, 2, 3]
    assert points["ambient"].tolist() == [0, 0, 0]
    assert points["t"].tolist() == [1_000_000, 2_000_000, 3_000_000]


def test_a_livoxs_values() -> None:
    config = LidarConfig(model="mid_360")
    points = read.points(message(config))
    assert points["line"].tolist() == points["ring"].tolist() == [3, 2, 1]
    assert points["tag"].tolist() == [0, 0, 0]
    due = [STAMP + k * 1_000_000 for k in (1, 2, 3)]
    assert points["timestamp"].astype(np.int64) == pytest.approx(due, abs=128)  # [ns]; a double resolves 256 ns


def test_the_fields_of_an_instantaneous_ouster_have_no_time() -> None:
    names = [field.name for field in message(LidarConfig(model="os1_128", spinning=False)).fields]
    assert names == [*(name for name in FAST_LIO2["ouster"] if name != "t"), "column", "label", "instance"]


def test_the_papers_cloud_has_no_makers_fields() -> None:
    names = [field.name for field in message(LidarConfig()).fields]
    assert names == ["x", "y", "z", "intensity", "ring", "column", "label", "instance"]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration files of LiDAR odometry: KISS-ICP, LIO-SAM, FAST-LIO2 and RKO-LIO.

Keys and conventions are those of the sources named at each function. A function returns the files by name, or in one
line why the program cannot read these sensors.
"""

from typing import Any, Final

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.exporters.slam_facts import Facts

Files = dict[str, str]
"""Text by name of the file."""

_LEAST_VARIANCE: Final = (0.1, 0.1, 1e-4, 1e-4)
"""acc_cov, gyr_cov, b_acc_cov, b_gyr_cov in every file of hku-mars/FAST_LIO 7cc4175: with room for vibration and for
what the filter neglects, more than most IMUs have of noise."""
_MARSIM, _VELODYNE, _OUSTER = 4, 2, 3
"""FAST-LIO2's lidar_type: points without time, with ``time``, with ``t``."""
_SECOND, _NANOSECOND = 0, 3
"""Its timestamp_unit."""


def numbers(values: Any) -> list[float]:
    """Row by row, without rounding errors of a rotation by right angles."""
    flat: list[float] = (np.round(np.asarray(values, np.float64), 12) + 0.0).ravel().tolist()
    return flat


def kiss_icp(facts: Facts) -> Files | str:
    """KISS-ICP 1.3 (PRBonn/kiss-icp 4bd9a10, config/config.py). Its poses are those of the LiDAR's frame."""
    if (lidar := facts.lidar) is None:
        return "no LiDAR"
    data = {"max_range": lidar.max_range, "min_range": lidar.min_range, "deskew": lidar.has_t}
    head = f"# KISS-ICP: kiss_icp_pipeline --topic {lidar.topic} --config kiss_icp.yaml BAG\n"
    return {"kiss_icp.yaml": head + write_mapping({"data": data})}


def rko_lio(facts: Facts) -> Files | str:
    """RKO-LIO 0.4 (PRBonn/rko_lio a335c17, config.py): mounts in the base frame, here that of the LiDAR."""
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    lidar_from_imu = transforms.inverse(lidar.base_from_lidar) @ imu.base_from_imu
    values = {
        "deskew": lidar.has_t,
        "min_range": lidar.min_range,
        "max_range": lidar.max_range,
        "extrinsic_lidar2base_quat_xyzw_xyz": _quaternion_and_position(np.eye(4)),
        "extrinsic_imu2base_quat_xyzw_xyz": _quaternion_and_position(lidar_from_imu),
    }
    head = f"# RKO-LIO: rko_lio --config rko_lio.yaml --lidar {lidar.topic} --imu {imu.topic} FOLDER_OF_THE_BAG\n"
    return {"rko_lio.yaml": head + write_mapping(values)}


def lio_sam(facts: Facts) -> Files | str:
    """LIO-SAM (TixiaoShan/LIO-SAM 0be1fbe, config/params.yaml, include/utility.h, src/imuPreintegration.cpp).

    ``extrinsicRot`` turns readings of the IMU into the LiDAR's axes, and so does ``extrinsicRPY`` for the orientation;
    ``extrinsicTrans`` is the IMU's position in the LiDAR's frame: the LiDAR's pose is multiplied by it from the right.
    """
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    if lidar.pattern is not None:
        return "it orders points by ring and azimuth, which a Livox does not have"
    if lidar.has_short_ring and lidar.has_t:
        sensor = "ouster"
    elif not lidar.has_short_ring and (lidar.has_time or not lidar.has_t):
        sensor = "velodyne"
    else:
        return "it reads a ring of 8 bits with t, or of 16 bits with time; set time_field: time or point_fields: ouster"
    lidar_from_imu = transforms.inverse(lidar.base_from_lidar) @ imu.base_from_imu
    rotation, noise = numbers(lidar_from_imu[:3, :3]), imu.noise
    values = {
        "pointCloudTopic": lidar.topic, "imuTopic": imu.topic, "odomTopic": "odometry/imu", "gpsTopic": "odometry/gpsz",
        "lidarFrame": lidar.frame, "baselinkFrame": "base_link", "odometryFrame": "odom", "mapFrame": "map",
        "useImuHeadingInitialization": False, "useGpsElevation": False,
        "sensor": sensor, "N_SCAN": lidar.rings, "Horizon_SCAN": lidar.columns, "downsampleRate": 1,
        "lidarMinRange": lidar.min_range, "lidarMaxRange": lidar.max_range,
        "imuAccNoise": noise.accelerometer, "imuGyrNoise": noise.gyroscope,
        "imuAccBiasN": noise.accelerometer_walk, "imuGyrBiasN": noise.gyroscope_walk,
        "imuGravity": GRAVITY, "imuRPYWeight": 0.01,
        "extrinsicTrans": numbers(lidar_from_imu[:3, 3]), "extrinsicRot": rotation, "extrinsicRPY": list(rotation),
        "edgeThreshold": 1.0, "surfThreshold": 0.1, "edgeFeatureMinValidNum": 10, "surfFeatureMinValidNum": 100,
        "odometrySurfLeafSize": 0.4, "mappingCornerLeafSize": 0.2, "mappingSurfLeafSize": 0.4,
        "z_tollerance": 1000.0, "rotation_tollerance": 1000.0, "numberOfCores": 4, "mappingProcessInterval": 0.15,
        "loopClosureEnableFlag": True, "loopClosureFrequency": 1.0, "surroundingKeyframeSize": 50,
    }  # fmt: skip
    head = "# LIO-SAM: config/params.yaml. Its other keys keep their defaults.\n" + _about_noise(facts)
    return {"lio_sam.yaml": head + write_mapping({"lio_sam": values})}


def fast_lio2(facts: Facts) -> Files | str:
    """FAST-LIO2 (hku-mars/FAST_LIO 7cc4175, config/*.yaml, src/preprocess.cpp): the LiDAR's pose in the IMU's frame.

    Its clouds must be PointCloud2: those of a Livox are read by their ``t``, as an Ouster's. Variances are those of a
    reading, and of the bias's change over the time between two, as its prediction multiplies both by that time.
    """
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    imu_from_lidar = transforms.inverse(imu.base_from_imu) @ lidar.base_from_lidar
    kind, unit = (_OUSTER, _NANOSECOND) if lidar.has_t else (_MARSIM, _SECOND)
    if lidar.has_time:
        kind, unit = _VELODYNE, _SECOND
    noise = imu.noise
    densities = (noise.accelerometer, noise.gyroscope, noise.accelerometer_walk, noise.gyroscope_walk)
    variances = [max(d * d * imu.rate_hz, least) for d, least in zip(densities, _LEAST_VARIANCE, strict=True)]
    values = {
        "common": {
            "lid_topic": lidar.topic, "imu_topic": imu.topic, "time_sync_en": False, "time_offset_lidar_to_imu": 0.0,
        },
        "preprocess": {
            "lidar_type": kind, "scan_line": lidar.rings, "scan_rate": round(lidar.rate_hz), "timestamp_unit": unit,
            "blind": lidar.min_range,
        },
        "mapping": {
            **dict(zip(("acc_cov", "gyr_cov", "b_acc_cov", "b_gyr_cov"), variances, strict=True)),
            "fov_degree": 90.0 if lidar.pattern == "avia" else 180.0,
            "det_range": lidar.max_range,
            "extrinsic_est_en": False,
            "extrinsic_T": numbers(imu_from_lidar[:3, 3]),
            "extrinsic_R": numbers(imu_from_lidar[:3, :3]),
        },
        "publish": {
            "path_en": True, "scan_publish_en": True, "dense_publish_en": True, "scan_bodyframe_pub_en": True,
        },
        "pcd_save": {"pcd_save_en": False, "interval": -1},
    }  # fmt: skip
    head = "# FAST-LIO2: a file for its folder config; *_cov are at least those of its own files.\n"
    return {"fast_lio2.yaml": head + _about_noise(facts) + write_mapping(values)}


def _about_noise(facts: Facts) -> str:
    """A comment where the IMU reads exactly."""
    if facts.imu is None or not facts.imu.assumed:
        return ""
    return "# The IMU reads exactly; its noise here is assumed, because filters divide by it.\n"


def _quaternion_and_position(a_from_b: Array) -> list[float]:
    return numbers(
        [*transforms.xyzw_from_wxyz(transforms.quaternion_wxyz_from_rotation(a_from_b[:3, :3])), *a_from_b[:3, 3]]
    )

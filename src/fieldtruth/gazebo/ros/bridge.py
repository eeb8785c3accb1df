# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of the newer Gazebo and of ROS 2, for ros_gz_bridge."""

from typing import Any

from fieldtruth.bag import topics
from fieldtruth.experiment.rig import Rig


def bridge_table(rig: Rig) -> list[dict[str, Any]]:
    """Return the rows of ros_gz_bridge's table; images go through ros_gz_image, see ``image_topics``."""
    rows = [
        _row(topics.CLOCK, "rosgraph_msgs/msg/Clock", "Clock"),
        _row(topics.TF, "tf2_msgs/msg/TFMessage", "Pose_V"),
        _row(topics.ODOMETRY, "nav_msgs/msg/Odometry", "Odometry"),
        _row(topics.IMU, "sensor_msgs/msg/Imu", "IMU"),
        _row(topics.NAVSAT, "sensor_msgs/msg/NavSatFix", "NavSat"),
        _row("/joint_states", "sensor_msgs/msg/JointState", "Model"),
        _row("/cmd_vel", "geometry_msgs/msg/Twist", "Twist", direction="ROS_TO_GZ"),
    ]
    if rig.lidar.enabled:
        rows.append(_row(topics.POINTS, "sensor_msgs/msg/PointCloud2", "PointCloudPacked"))
    if rig.stereo.enabled:
        infos = [topics.camera_info(side) for side in topics.SIDES]
        rows += [_row(f"{t}_gazebo", "sensor_msgs/msg/CameraInfo", "CameraInfo", gz=t) for t in infos]
    return rows


def image_topics(rig: Rig) -> list[str]:
    """Topics of images, the same in Gazebo and ROS; ROS's image transport adds the compressed ones."""
    if not rig.stereo.enabled:
        return []
    photographs = [topics.photograph(side).removesuffix("/compressed") for side in topics.SIDES]
    kinds = ("labels_map", "colored_map")
    return [*photographs, *(f"/stereo/camera/{side}/segmentation/{kind}" for side in topics.SIDES for kind in kinds)]


def _row(ros: str, ros_type: str, gz_type: str, *, gz: str = "", direction: str = "GZ_TO_ROS") -> dict[str, Any]:
    return {
        "ros_topic_name": ros,
        "gz_topic_name": gz or ros,
        "ros_type_name": ros_type,
        "gz_type_name": f"gz.msgs.{gz_type}",
        "direction": direction,
    }

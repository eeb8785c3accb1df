# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of the newer Gazebo and of ROS 2, for ros_gz_bridge."""

from typing import Any

from fieldtruth.bag import topics
from fieldtruth.experiment.rig import Rig
from fieldtruth.gazebo.robot.parts import cloud_topic
from fieldtruth.sensors.wheel_odometry.config import JOINT_STATES


def bridge_table(rig: Rig) -> list[dict[str, Any]]:
    """Return the rows of ros_gz_bridge's table; images go through ros_gz_image, see ``image_topics``."""
    infos = [imager.topic_of("camera_info") for imager in rig.imagers]
    return [
        _row(topics.CLOCK, "rosgraph_msgs/msg/Clock", "Clock"),
        _row(topics.TF, "tf2_msgs/msg/TFMessage", "Pose_V"),
        _row(topics.ODOMETRY, "nav_msgs/msg/Odometry", "Odometry"),
        *(_row(imu.topic, "sensor_msgs/msg/Imu", "IMU") for imu in rig.imus),
        *(_row(antenna.topic, "sensor_msgs/msg/NavSatFix", "NavSat") for antenna in rig.antennas),
        _row(JOINT_STATES, "sensor_msgs/msg/JointState", "Model"),
        _row(topics.COMMANDS, "geometry_msgs/msg/Twist", "Twist", direction="ROS_TO_GZ"),
        *(
            _row(lidar.topic, "sensor_msgs/msg/PointCloud2", "PointCloudPacked", gz=f"{cloud_topic(lidar)}/points")
            for lidar in rig.lidars
        ),
        *(_row(f"{info}_gazebo", "sensor_msgs/msg/CameraInfo", "CameraInfo", gz=info) for info in infos),
    ]


def image_topics(rig: Rig) -> list[str]:
    """Topics of images, the same in Gazebo and ROS; ROS's image transport adds the compressed ones."""
    photographs = [imager.topic_of("photograph").removesuffix("/compressed") for imager in rig.imagers]
    kinds = ("labels_map", "colored_map")
    return [*photographs, *(f"{imager.topic}/segmentation/{kind}" for imager in rig.imagers for kind in kinds)]


def _row(ros: str, ros_type: str, gz_type: str, *, gz: str = "", direction: str = "GZ_TO_ROS") -> dict[str, Any]:
    return {
        "ros_topic_name": ros,
        "gz_topic_name": gz or ros,
        "ros_type_name": ros_type,
        "gz_type_name": f"gz.msgs.{gz_type}",
        "direction": direction,
    }

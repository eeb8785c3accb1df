# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of the robot's base, read back, against the numbers from which they were made."""

from typing import Any

import numpy as np
import pytest
from record_fakes import make_experiment, make_track, make_world
from series import odometry_along, reading_of

from fieldtruth.bag import messages
from fieldtruth.bag import messages as ros
from fieldtruth.bag.decode import matrix, stamp_ns
from fieldtruth.experiment.rig import Rig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensor import joint_states, wheel_odometry, wheel_speeds

TRACK = make_track(make_world(), make_experiment(2.5))
RIG = Rig()
WHEELS = WheelOdometryConfig()


def back(data: bytes, msgtype: str) -> Any:
    return ros.STORE.deserialize_ros1(data, msgtype)


def test_wheel_speed() -> None:
    assert [back(data, "std_msgs/msg/Float32").data for data in wheel_speeds(np.array([-1.8125, 2.5]))] == [
        -1.8125,
        2.5,
    ]


def test_joint_states_name_the_joints_of_the_urdf() -> None:
    assert TRACK.base is not None
    message = back(joint_states(9, reading_of(WHEELS, TRACK, 9, "joints"))[0], "sensor_msgs/msg/JointState")
    assert (message.header.seq, stamp_ns(message.header), message.header.frame_id) == (9, 200_000_000, "base_link")
    assert message.name[:2] == ["front_left_wheel_joint", "front_right_wheel_joint"]
    np.testing.assert_allclose(message.position, (0.2, 0.4, 0.22, 0.44), atol=1e-15)
    np.testing.assert_array_equal(message.velocity, (1.0, 2.0, 1.1, 2.2))
    assert not len(message.effort)


def test_wheel_odometry_is_a_planar_pose_in_odom() -> None:
    assert TRACK.base is not None
    odometry = odometry_along(TRACK)
    message = back(wheel_odometry(99, reading_of(WHEELS, TRACK, 99, "odometry"))[0], "nav_msgs/msg/Odometry")
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    x, y, yaw = odometry.pose[99]
    pose, twist = message.pose.pose, message.twist.twist
    assert [pose.position.x, pose.position.y, pose.position.z] == [x, y, 0.0]
    assert 2 * np.arctan2(pose.orientation.z, pose.orientation.w) == pytest.approx(yaw, abs=1e-12)
    assert [twist.linear.x, twist.angular.z] == odometry.twist[99].tolist()
    assert np.diag(message.pose.covariance.reshape(6, 6)).tolist() == [0.001] * 5 + [0.03]


def test_command() -> None:
    assert TRACK.base is not None
    message = back(messages.commands(TRACK.base.commands.command[4:5])[0], "geometry_msgs/msg/Twist")
    assert [message.linear.x, message.angular.z] == TRACK.base.commands.command[4].tolist()


def test_a_wheel_that_rolls_forwards_turns_its_top_forwards() -> None:
    turned = messages.wheel_transforms(messages.wheel_mounts(RIG), np.array([0.0, np.pi / 2, -np.pi / 2, 7.0]))
    assert list(turned) == ["front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"]
    top = {name: base_from_wheel[:3, :3] @ (0.0, 0.0, 1.0) for name, base_from_wheel in turned.items()}
    np.testing.assert_allclose(top["front_left_wheel"], (0.0, 0.0, 1.0), atol=1e-15)
    np.testing.assert_allclose(top["front_right_wheel"], (1.0, 0.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(top["rear_left_wheel"], (-1.0, 0.0, 0.0), atol=1e-15)
    for name, base_from_wheel in turned.items():
        assert tuple(base_from_wheel[:3, 3]) == RIG.mounts()[name].xyz


def test_tf_has_base_link_and_the_wheels() -> None:
    wheels = messages.wheel_transforms(messages.wheel_mounts(RIG), np.array([1.0, 2.0, 3.0, 4.0]))
    data = messages.tf(24, TRACK.motion.at(np.array([499])), wheels)[0]
    base, *turning = back(data, "tf2_msgs/msg/TFMessage").transforms
    assert (base.header.frame_id, base.child_frame_id) == ("world", "base_link")
    for each, (name, base_from_wheel) in zip(turning, wheels.items(), strict=True):
        assert (each.header.frame_id, each.child_frame_id, each.header.seq) == ("base_link", name, 24)
        np.testing.assert_allclose(matrix(each.transform), base_from_wheel, atol=1e-15)

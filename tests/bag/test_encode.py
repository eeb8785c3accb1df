# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
from typing import Any

import numpy as np
import pytest
from record_fakes import FakeScan, make_experiment, make_track, make_world
from series import fixes_along, imu_along, reading_of

from fieldtruth.bag import decode as read
from fieldtruth.bag import messages
from fieldtruth.bag import messages as ros
from fieldtruth.bag.topics import PAPER_TOPICS
from fieldtruth.core import transforms
from fieldtruth.core.classes import PALETTE
from fieldtruth.drive.track import Motion, state_at
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig
from fieldtruth.sensors.camera import sensor as camera
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, StereoConfig
from fieldtruth.sensors.gnss.sensor import navsat
from fieldtruth.sensors.imu.sensor import imu
from fieldtruth.sensors.lidar.config import LidarConfig, TimeField
from fieldtruth.sensors.lidar.sensor import point_cloud

MD5 = {  # as rosmsg prints them
    "gazebo_msgs/msg/ModelStates": "48c080191eb15c41858319b4d8a609c2",
    "geometry_msgs/msg/Twist": "9f195f881246fdfa2798d1d3eebca84a",
    "nav_msgs/msg/Odometry": "cd5e73d190d741a2f92e81eda573aca7",
    "rosgraph_msgs/msg/Clock": "a9c97c1d230cfc112e270351a944ee47",
    "sensor_msgs/msg/CameraInfo": "c9a58c1b0b154e0e6da7578cb991d214",
    "sensor_msgs/msg/CompressedImage": "8f7a12909da2c9d3332d540a0977563f",
    "sensor_msgs/msg/Image": "060021388200f6f0f447d0fcd9c64743",
    "sensor_msgs/msg/Imu": "6a62c6daae103f4ff57a132d6f95cec2",
    "sensor_msgs/msg/JointState": "3066dcd76a6cfaef579bd0f34173e9fd",
    "sensor_msgs/msg/NavSatFix": "2d3a8cd499b9b4a0249fb98fd05cfa48",
    "sensor_msgs/msg/PointCloud2": "1158d486dd51d683ce2f1be655c3c181",
    "std_msgs/msg/Float32": "73fcbf46b49191e672908e50842a83d4",
    "tf2_msgs/msg/TFMessage": "94810edda583a504dfda3829e70d7eec",
}

STAMP = 12_345_678_901
WORLD = make_world()
TRACK, RIG = make_track(WORLD, make_experiment(1.0)), Rig()


def back(data: bytes, msgtype: str) -> Any:
    return ros.STORE.deserialize_ros1(data, msgtype)


def xyz(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def wxyz(q: Any) -> list[float]:
    return [q.w, q.x, q.y, q.z]


def test_types_are_those_of_ros() -> None:
    assert {topic.msgtype for topic in PAPER_TOPICS} == set(MD5)
    for msgtype, md5 in MD5.items():
        assert ros.STORE.generate_msgdef(msgtype)[1] == md5, msgtype


def test_clock() -> None:
    clock = back(messages.clocks(np.array([STAMP]))[0], "rosgraph_msgs/msg/Clock").clock
    assert (clock.sec, clock.nanosec) == (12, 345_678_901)


def test_imu_is_in_imu_link_with_quaternions_in_ros_order() -> None:
    message = back(imu(7, reading_of(RIG.imu, TRACK, 7))[0], "sensor_msgs/msg/Imu")
    assert (message.header.seq, read.stamp_ns(message.header)) == (7, 160_000_000)
    assert message.header.frame_id == "imu_link"
    assert wxyz(message.orientation) == imu_along(TRACK).quaternion_wxyz[7].tolist()
    assert xyz(message.angular_velocity) == imu_along(TRACK).angular_velocity[7].tolist()
    assert xyz(message.linear_acceleration) == imu_along(TRACK).linear_acceleration[7].tolist()
    assert not message.orientation_covariance.any()


def test_navsat() -> None:
    message = back(navsat(1, reading_of(RIG.gnss, TRACK, 1))[0], "sensor_msgs/msg/NavSatFix")
    assert (message.header.frame_id, read.stamp_ns(message.header)) == ("GNSS_link", 10**9)
    assert [message.latitude, message.longitude, message.altitude] == fixes_along(TRACK).geodetic[1].tolist()
    assert message.status.status == message.status.STATUS_FIX


def test_twist_of_odometry_is_in_base_link() -> None:
    # The robot looks north-west and moves to the west: half of it forwards, half of it to its left.
    q = transforms.quaternion_wxyz_from_rotation(transforms.pose((0, 0, 0), (0, 0, 45.0))[:3, :3])
    position, linear, angular = np.array([[[1.0, 2.0, 3.0]], [[0.0, 1.0, 0.5]], [[1.0, 0.0, 0.25]]])
    motion = Motion(
        stamps_ns=np.array([STAMP]),
        position=position,
        quaternion_wxyz=q[None],
        linear_velocity=linear,
        angular_velocity=angular,
    )
    message = back(messages.odometry(3, motion)[0], "nav_msgs/msg/Odometry")
    half = np.sqrt(0.5)
    assert (message.header.frame_id, message.child_frame_id, message.header.seq) == ("world", "base_link", 3)
    assert xyz(message.pose.pose.position) == [1.0, 2.0, 3.0]
    assert wxyz(message.pose.pose.orientation) == q.tolist()
    assert xyz(message.twist.twist.linear) == pytest.approx([half, half, 0.5], abs=1e-15)
    assert xyz(message.twist.twist.angular) == pytest.approx([half, -half, 0.25], abs=1e-15)


def test_tf() -> None:
    (stamped,) = back(messages.tf(24, TRACK.motion.at(np.array([499])), {})[0], "tf2_msgs/msg/TFMessage").transforms
    assert (stamped.header.frame_id, stamped.child_frame_id, stamped.header.seq) == ("world", "base_link", 24)
    assert xyz(stamped.transform.translation) == TRACK.motion.position[499].tolist()
    assert wxyz(stamped.transform.rotation) == TRACK.motion.quaternion_wxyz[499].tolist()


def test_model_states_are_the_robot_and_every_object_by_its_id() -> None:
    writer = messages.ModelStatesWriter(WORLD)
    message = back(writer.message(499, TRACK.motion), "gazebo_msgs/msg/ModelStates")
    assert message.name == ["husky", "ground", "tree_2", "tree_3", "tree_4", "tree_5", "tree_6"]
    assert xyz(message.pose[0].position) == TRACK.motion.position[499].tolist()
    assert wxyz(message.pose[0].orientation) == TRACK.motion.quaternion_wxyz[499].tolist()
    assert xyz(message.twist[0].linear) == TRACK.motion.linear_velocity[499].tolist()
    assert xyz(message.twist[0].angular) == TRACK.motion.angular_velocity[499].tolist()
    assert xyz(message.pose[1].position) == [0.0, 0.0, 0.0]
    for i in range(2, 7):
        pose = transforms.pose((float(i), 0.0, 0.0), (0.0, 0.0, 20.0 * i))
        np.testing.assert_allclose(read.pose_matrix(message.pose[i]), pose, atol=1e-12)
        assert xyz(message.twist[i].linear) == [0.0, 0.0, 0.0]


def test_model_states_encode_names_as_utf8() -> None:
    world = make_world(objects=1)
    odd = world.__class__(**{**world.__dict__, "object_names": ("husky", "Böden", "bäume")})
    message = back(messages.ModelStatesWriter(odd).message(0, TRACK.motion), "gazebo_msgs/msg/ModelStates")
    assert message.name == ["husky", "Böden", "bäume"]
    assert xyz(message.pose[0].position) == TRACK.motion.position[0].tolist()
    assert xyz(message.twist[0].angular) == TRACK.motion.angular_velocity[0].tolist()


def fake_scan(n: int) -> Any:
    k = np.arange(n)
    return FakeScan(
        xyz=np.random.default_rng(1).normal(size=(n, 3)).astype(np.float32),
        label=(k % 13 + 1).astype(np.uint8),
        instance=(k * 200).astype(np.uint16),
        ring=(k % 64).astype(np.uint16),
        column=(k + 200).astype(np.uint16),
        t_ns=(k * 10_000_000).astype(np.uint32),
    )


@pytest.mark.parametrize("spinning", [False, True])
def test_cloud(spinning: bool) -> None:
    scan = fake_scan(300)
    message = back(point_cloud(5, STAMP, scan, LidarConfig(spinning=spinning)), "sensor_msgs/msg/PointCloud2")
    points = read.points(message)
    assert (message.header.frame_id, message.height, message.width) == ("os1_lidar", 1, 300)
    assert message.is_dense
    np.testing.assert_array_equal(np.stack([points["x"], points["y"], points["z"]], -1), scan.xyz)
    np.testing.assert_array_equal(points["intensity"], scan.label.astype(np.float32))
    for name in ("ring", "column", "label", "instance"):
        np.testing.assert_array_equal(points[name], getattr(scan, name))
    if spinning:
        np.testing.assert_array_equal(points["t"], scan.t_ns)


@pytest.mark.parametrize(("spinning", "size"), [(False, 24), (True, 28)])
def test_only_the_points_of_a_spinning_lidar_have_times(spinning: bool, size: int) -> None:
    message = back(point_cloud(5, STAMP, fake_scan(300), LidarConfig(spinning=spinning)), "sensor_msgs/msg/PointCloud2")
    time = {"t": (16, 6)} if spinning else {}
    assert {f.name: (f.offset, f.datatype) for f in message.fields} == {
        "x": (0, 7),
        "y": (4, 7),
        "z": (8, 7),
        "intensity": (12, 7),
        **time,
        "ring": (size - 8, 4),
        "column": (size - 6, 4),
        "label": (size - 4, 4),
        "instance": (size - 2, 4),
    }
    assert (message.point_step, message.row_step) == (size, size * 300)


@pytest.mark.parametrize(("clock", "datatype", "start_ns"), [("time", 7, 0), ("timestamp", 8, STAMP)])
def test_the_time_of_a_point_as_its_makers_driver_has_it(clock: TimeField, datatype: int, start_ns: int) -> None:
    """Seconds after the stamp (32 bits) or in all (64 bits), beside t; none without a spinning LiDAR."""
    scan = fake_scan(30)
    message = back(
        point_cloud(5, STAMP, scan, LidarConfig(spinning=True, time_field=clock)), "sensor_msgs/msg/PointCloud2"
    )
    assert {f.name: f.datatype for f in message.fields}[clock] == datatype
    seconds = read.points(message)[clock].astype(np.float64)
    due = (start_ns + np.arange(30) * 10_000_000) * 1e-9
    np.testing.assert_allclose(seconds, due, rtol=6e-8 if clock == "time" else 2e-16, atol=0)
    np.testing.assert_array_equal(read.points(message)["t"], scan.t_ns)
    still = back(
        point_cloud(5, STAMP, scan, LidarConfig(spinning=False, time_field=clock)), "sensor_msgs/msg/PointCloud2"
    )
    assert not {clock, "t"} & {f.name for f in still.fields}


def test_empty_cloud() -> None:
    none = np.zeros(0)
    scan: Any = FakeScan(np.zeros((0, 3), np.float32), *(none.astype(t) for t in ("u1", "u2", "u2", "u2", "u4")))
    message = back(point_cloud(0, STAMP, scan, LidarConfig()), "sensor_msgs/msg/PointCloud2")
    assert (message.width, len(read.points(message))) == (0, 0)


def test_tag_is_exact() -> None:
    label = np.arange(48 * 64).reshape(48, 64) % 15 + 1
    message = back(camera.tag(0, STAMP, "left_camera_optical", label.astype(np.uint8)), "sensor_msgs/msg/Image")
    assert (message.encoding, message.step, message.header.frame_id) == ("rgb8", 192, "left_camera_optical")
    np.testing.assert_array_equal(read.image(message), PALETTE[label])


def test_photograph_is_close_to_its_pixels() -> None:
    y, x = np.mgrid[:48, :64]
    photo = np.stack([2 * x + 50, 3 * y + 20, x + y], axis=-1).astype(np.uint8)
    data = camera.photograph(0, STAMP, "right_camera_optical", photo, StereoConfig(jpeg_quality=95))
    message = back(data, "sensor_msgs/msg/CompressedImage")
    assert (message.format, message.header.frame_id) == ("jpeg", "right_camera_optical")
    assert np.abs(read.image(message).astype(int) - photo).max() <= 6


def test_calibration_of_the_zed() -> None:
    config = StereoConfig()
    left, right = (
        back(camera.camera_info(0, STAMP, imager), "sensor_msgs/msg/CameraInfo") for imager in config.imagers()
    )
    fx, fy = 640 / np.tan(np.radians(34.5)), 360 / np.tan(np.radians(21.0))
    assert left.K.tolist() == pytest.approx([fx, 0, 639.5, 0, fy, 359.5, 0, 0, 1], rel=1e-14)
    assert left.P.tolist() == pytest.approx([fx, 0, 639.5, 0, 0, fy, 359.5, 0, 0, 0, 1, 0], rel=1e-14)
    assert right.P.tolist() == pytest.approx([fx, 0, 639.5, -0.12 * fx, 0, fy, 359.5, 0, 0, 0, 1, 0], rel=1e-12)
    assert (left.width, left.height, left.distortion_model) == (1280, 720, "plumb_bob")
    assert not left.D.any()
    assert left.D.size == 5
    assert (left.header.frame_id, right.header.frame_id) == ("left_camera_optical", "right_camera_optical")


def test_the_outer_pixel_edges_span_the_field_of_view() -> None:
    k = camera.camera_matrix(StereoConfig())
    corner = np.linalg.inv(k) @ [-0.5, -0.5, 1.0]
    assert np.degrees(np.arctan(corner[:2])).tolist() == pytest.approx([-34.5, -21.0], rel=1e-12)


def test_projection_matrices_agree_with_the_transforms() -> None:
    config = StereoConfig(baseline=0.3, mount=Mount(xyz=(0.3, -0.05, 0.7), rpy_deg=(0, 90, 0)))
    point_base = np.array([[5.0, 0.7, 1.1]])
    in_left, in_right = (
        transforms.transform(transforms.inverse(mount.base_from_sensor @ CAMERA_FROM_OPTICAL), point_base)[0]
        for mount in (config.left, config.right)
    )
    pixel = camera.camera_matrix(config) @ in_right
    projected = camera.projection_matrix(config.imagers()[1]) @ [*in_left, 1.0]
    np.testing.assert_allclose(projected / projected[2], pixel / pixel[2], atol=1e-9)


def test_fixed_frames_are_those_of_the_paper_and_the_optical_frames() -> None:
    fixed = messages.rig_transforms(Rig())
    assert len(fixed) == 12
    turning = {pair[1] for pair in fixed.keys() - messages.fixed_transforms(Rig()).keys()}
    assert turning == {"front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"}
    forward, right, down = [0, 0, 1], [1, 0, 0], [0, 1, 0]
    base_from_optical = fixed["base_link", "left_camera"] @ fixed["left_camera", "left_camera_optical"]
    np.testing.assert_allclose(base_from_optical[:3, :3] @ forward, [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(base_from_optical[:3, :3] @ right, [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(base_from_optical[:3, :3] @ down, [0, 0, -1], atol=1e-15)


def test_state_between_two_rows() -> None:
    middle = state_at(TRACK.motion, 500_250_000)
    before, after = TRACK.motion.position[499:501]
    np.testing.assert_allclose(middle.position, 0.75 * before + 0.25 * after, rtol=1e-15)
    # roll, pitch and yaw of the fake drive at that stamp, to second order in 1 ms
    t = 0.50025
    attitude = transforms.pose((0, 0, 0), np.degrees([0.1 * np.sin(t), 0.05 * np.cos(t), 0.1 * t]).tolist())
    np.testing.assert_allclose(middle.world_from_base[:3, :3], attitude[:3, :3], atol=1e-7)


def test_state_between_two_rows_of_opposite_sign() -> None:
    motion = TRACK.motion
    flipped = motion.quaternion_wxyz.copy()
    flipped[500] *= -1
    turned = motion.__class__(**{**motion.__dict__, "quaternion_wxyz": flipped})
    same = state_at(motion, 500_250_000).world_from_base
    np.testing.assert_allclose(state_at(turned, 500_250_000).world_from_base, same, atol=1e-15)


@pytest.mark.parametrize(("stamp", "row"), [(1, 0), (1_000_000, 0), (7_000_000, 6), (10**9, 999), (2 * 10**9, 999)])
def test_state_at_and_beyond_rows(stamp: int, row: int) -> None:
    assert state_at(TRACK.motion, stamp).position.tolist() == TRACK.motion.position[row].tolist()

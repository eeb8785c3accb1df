# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A node of its own process, with types written by hand: dds_node.py WHAT; prints lines until its input is closed."""

# mypy: disable-error-code="misc, call-arg"
import json
import math
import sys
import threading
import time
import zlib
from dataclasses import dataclass
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, int64, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

CONFIG = """<CycloneDDS><Domain>
<General>
  <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces><AllowMulticast>false</AllowMulticast>
</General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Field(IdlStruct, typename="sensor_msgs::msg::dds_::PointField_"):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@dataclass
class PointCloud2(IdlStruct, typename="sensor_msgs::msg::dds_::PointCloud2_"):
    header: Header
    height: uint32
    width: uint32
    fields: sequence[Field]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]
    is_dense: bool


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped]


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    header: Header
    twist: Twist


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Vector3  # a Point has the same fields
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


@dataclass
class Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    data: bool


@dataclass
class Int64(IdlStruct, typename="std_msgs::msg::dds_::Int64_"):
    data: int64


V1 = Policy.DataRepresentation(use_cdrv0_representation=True)
RELIABLE = Policy.Reliability.Reliable(10**9)
SENSOR = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(5), V1)
STATIC = Qos(RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(1), V1)
COMMAND = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(10), V1)


def main() -> None:
    domain = int(sys.argv[1])
    made = Domain(domain, CONFIG)
    node = DomainParticipant(domain)
    ended = threading.Event()
    threading.Thread(target=wait_for_end, args=[ended], daemon=True).start()
    {"hear": hear, "drive": drive, "wrong": wrong, "reach": reach}[sys.argv[2]](node, ended)
    del made


def wait_for_end(ended: threading.Event) -> None:
    sys.stdin.read()
    ended.set()


def hear(node: Any, ended: threading.Event) -> None:
    clouds = DataReader(node, Topic(node, "rt/turning/points", PointCloud2), SENSOR)
    static = DataReader(node, Topic(node, "rt/tf_static", TFMessage), STATIC)
    while not ended.is_set():
        for m in clouds.take(10):
            stamp = m.header.stamp.sec * 10**9 + m.header.stamp.nanosec
            fields = [field.name for field in m.fields]
            row = {"stamp": stamp, "frame": m.header.frame_id, "fields": fields, "sum": zlib.adler32(bytes(m.data))}
            print(json.dumps(row), flush=True)
        for m in static.take(1):
            print(json.dumps({"static": [each.child_frame_id for each in m.transforms]}), flush=True)
        time.sleep(0.01)


def drive(node: Any, ended: threading.Event) -> None:
    writer = DataWriter(node, Topic(node, "rt/cmd_vel", TwistStamped), COMMAND)
    header = Header(Time(0, 0), "base_link")
    while not ended.is_set():
        writer.write(TwistStamped(header, Twist(Vector3(-0.5), Vector3(z=0.1))))
        time.sleep(0.05)


def wrong(node: Any, ended: threading.Event) -> None:
    nan = DataWriter(node, Topic(node, "rt/cmd_vel", Twist), COMMAND)
    other = DomainParticipant(int(sys.argv[1]))
    text = DataWriter(other, Topic(other, "rt/cmd_vel", Int64), COMMAND)
    pause = DataWriter(node, Topic(node, "rt/fieldtruth/pause", Bool), COMMAND)
    while not ended.is_set():
        nan.write(Twist(Vector3(math.nan), Vector3()))
        text.write(Int64(1))
        if pause.get_matched_subscriptions():
            pause.write(Bool(True))
        time.sleep(0.1)


def is_message(sample: Any) -> bool:
    """Return whether it is one, and not the end of a publisher."""
    return isinstance(sample, IdlStruct)


def reach(node: Any, ended: threading.Event) -> None:
    """Turn to the goal and drive there, as the follower of the package does, and tell each goal and the first cloud."""
    goals = DataReader(node, Topic(node, "rt/goal_pose", PoseStamped), STATIC)
    states = DataReader(node, Topic(node, "rt/ground_truth/odom", Odometry), COMMAND)
    clouds = DataReader(node, Topic(node, "rt/os1_cloud_node/points", PointCloud2), SENSOR)
    writer = DataWriter(node, Topic(node, "rt/cmd_vel", Twist), COMMAND)
    goal, heard = None, False
    while not ended.is_set():
        for m in filter(is_message, goals.take(1)):
            goal = m.pose.position
            print(json.dumps({"goal": [goal.x, goal.y], "frame": m.header.frame_id}), flush=True)
        for m in filter(is_message, clouds.take(1)):
            if not heard:
                heard = True
                row = {"points": m.width, "fields": [field.name for field in m.fields]}
                print(json.dumps(row), flush=True)
        for m in filter(is_message, states.take(1)):
            if goal is not None:
                at, q = m.pose.pose.position, m.pose.pose.orientation
                heading = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
                angle = math.remainder(math.atan2(goal.y - at.y, goal.x - at.x) - heading, 2 * math.pi)
                turn_rate = 2.0 * min(max(angle, -1.0), 1.0)
                writer.write(Twist(Vector3(0.8 * max(0.0, 1.0 - abs(angle))), Vector3(z=turn_rate)))
        time.sleep(0.001)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The server for Foxglove, by its protocol (foxglove.sdk.v1) as the library websockets speaks it."""

import json
import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import pytest
from live_runs import Run, running, wait_for
from stepped_rigs import WORLD, experiment

from fieldtruth.bag.messages import STORE
from fieldtruth.bag.topics import COMMANDS
from fieldtruth.core.errors import OutputError
from fieldtruth.experiment.rig import Rig
from fieldtruth.live.commands import Inbox

pytest.importorskip("foxglove")
client = pytest.importorskip("websockets.sync.client")
from fieldtruth.live.foxglove import SCENE, FoxgloveSink  # noqa: E402

CLOUDS, IMU, TF_STATIC = "/turning/points", "/imu/data", "/tf_static"
POSE = struct.Struct("<IIII7d")


class Client:
    """A client that subscribes to what it is told."""

    def __init__(self, port: int, topics: set[str] | None = None) -> None:
        self._opened = client.connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"], max_size=None)
        self.socket = self._opened.__enter__()
        self.topics, self.channels, self.services = topics, dict[str, Any](), dict[str, int]()
        self.heard, self.answers = dict[str, list[tuple[int, bytes]]](), dict[int, bytes]()
        self.info: dict[str, Any] = {}

    def hear(self, until: Callable[[], object], seconds: float = 20.0) -> None:
        end = time.monotonic() + seconds
        while not until():
            assert time.monotonic() < end, (self.heard.keys(), self.answers)
            try:
                message = self.socket.recv(0.1)
            except TimeoutError:
                continue
            if isinstance(message, str):
                self._text(json.loads(message))
            elif message[0] == 1:
                number, stamp = struct.unpack_from("<IQ", message, 1)
                topic = next(t for t, c in self.channels.items() if c["id"] == number)
                self.heard.setdefault(topic, []).append((stamp, message[13:]))
            elif message[0] == 3:
                _, call, length = struct.unpack_from("<III", message, 1)
                self.answers[call] = message[13 + length :]

    def _text(self, message: dict[str, Any]) -> None:
        if message["op"] == "serverInfo":
            self.info = message
        elif message["op"] == "advertiseServices":
            self.services |= {each["name"]: each["id"] for each in message["services"]}
        elif message["op"] == "advertise":
            for each in message["channels"]:
                self.channels[each["topic"]] = each
                if self.topics is None or each["topic"] in self.topics:
                    self.say(op="subscribe", subscriptions=[{"id": each["id"], "channelId": each["id"]}])

    def say(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def advertise(self, number: int, topic: str, schema: str, encoding: str = "json") -> None:
        row = {"id": number, "topic": topic, "encoding": encoding, "schemaName": schema}
        self.say(op="advertise", channels=[row])

    def publish(self, number: int, data: bytes) -> None:
        self.socket.send(struct.pack("<BI", 1, number) + data)

    def call(self, number: int, name: str, request: bytes) -> tuple[bool, str]:
        self.hear(lambda: name in self.services)
        self.socket.send(struct.pack("<BIII", 2, self.services[name], number, 4) + b"ros1" + request)
        self.hear(lambda: number in self.answers)
        answer = self.answers[number]
        return bool(answer[0]), answer[5:].decode()


@contextmanager
def server(rate: float = 1.0) -> Iterator[tuple[int, Run]]:
    def connect(inbox: Inbox) -> FoxgloveSink:
        return FoxgloveSink(inbox, port=0)

    with running(connect, rate=rate) as (sink, run):
        assert isinstance(sink, FoxgloveSink)
        assert sink.where.endswith(", for this machine only")
        yield int(sink.where.removeprefix("ws://127.0.0.1:").partition(",")[0]), run


def decoded(topic: str, heard: Client) -> Any:
    msgtype = heard.channels[topic]["schemaName"].replace("/", "/msg/")
    return STORE.deserialize_ros1(heard.heard[topic][-1][1], msgtype)


def test_a_client_hears_the_bags_messages() -> None:
    with server() as (port, _):
        heard = Client(port)
        heard.hear(lambda: all(len(heard.heard.get(topic, ())) >= 3 for topic in (CLOUDS, IMU, "/clock", "/tf")))
        heard.hear(lambda: {TF_STATIC, SCENE} <= heard.heard.keys())
        assert {"clientPublish", "services", "time"} <= set(heard.info["capabilities"])
        imu = heard.channels[IMU]
        assert (imu["encoding"], imu["schemaName"]) == ("ros1", "sensor_msgs/Imu")
        assert imu["schema"].startswith("std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n")
        cloud = decoded(CLOUDS, heard)
        assert (cloud.header.frame_id, [each.name for each in cloud.fields][:4]) == (
            "turning_link",
            ["x", "y", "z", "intensity"],
        )
        assert cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec == heard.heard[CLOUDS][-1][0]
        stamps = [stamp for stamp, _ in heard.heard["/clock"]]
        assert all(after - before == 20_000_000 for before, after in pairwise(stamps))


def test_those_who_come_late_hear_what_is_latched_and_a_killed_client_is_no_end() -> None:
    with server() as (port, run):
        wait_for(lambda: run.simulation.seconds > 0.1)
        first, second = Client(port, {IMU, TF_STATIC}), Client(port, {IMU, SCENE})
        first.hear(lambda: {IMU, TF_STATIC} <= first.heard.keys())
        second.hear(lambda: {IMU, SCENE} <= second.heard.keys())
        frames = {each.child_frame_id for each in decoded(TF_STATIC, first).transforms}
        assert {"imu_link", "turning_link"} <= frames
        first.socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        first.socket.socket.close()  # without a goodbye
        count = len(second.heard[IMU])
        second.hear(lambda: len(second.heard[IMU]) > count + 100)
        assert not run.lines


def test_a_client_drives_and_wrong_commands_are_lines() -> None:
    with server() as (port, run):
        driver = Client(port, {"/ground_truth/odom"})
        driver.advertise(1, COMMANDS, "geometry_msgs/Twist")
        driver.advertise(2, COMMANDS, "geometry_msgs/msg/TwistStamped", "ros1")
        driver.advertise(3, "/etc/passwd", "std_msgs/String")
        command = json.dumps({"linear": {"x": 0.7, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0.0}}).encode()

        def speed() -> float:
            return float(decoded("/ground_truth/odom", driver).twist.twist.linear.x)

        def fast() -> bool:
            driver.publish(1, command)
            return speed() > 0.6

        driver.hear(lambda: "/ground_truth/odom" in driver.heard)
        driver.hear(fast)
        stamped = struct.pack("<IIII", 0, 0, 0, 0) + struct.pack("<6d", -0.5, 0, 0, 0, 0, 0)

        def backwards() -> bool:
            driver.publish(2, stamped)
            return speed() < -0.4

        driver.hear(backwards)
        driver.hear(lambda: abs(speed()) < 0.01)  # no command any more
        driver.publish(1, b'{"linear": {"x": NaN}, "angular": {"z": 0}}')
        driver.publish(2, b"\xff" * 20)
        wait_for(lambda: len(run.lines) == 3)
        driver.publish(77, b"of no channel")
        at = run.simulation.seconds
        wait_for(lambda: run.simulation.seconds > at + 0.3)
        assert run.lines[:2] == [
            "/etc/passwd: must be no topic, got 'std_msgs/String in json'; it is ignored",
            "/cmd_vel: a command must be finite, got nan m/s and 0.0 rad/s; it is ignored",
        ]
        assert run.lines[2].startswith("/cmd_vel: is no geometry_msgs/msg/TwistStamped in ros1: ")
        assert len(run.lines) == 3


def test_services_pause_step_and_reset() -> None:
    with server() as (port, run):
        heard = Client(port, set())
        assert heard.call(1, "/fieldtruth/pause", b"\1")[0]
        at = run.simulation.seconds
        assert heard.call(2, "/fieldtruth/step", struct.pack("<d", 0.05)) == (True, f"steps to {at + 0.05:.3f} s")
        wait_for(lambda: run.simulation.seconds == pytest.approx(at + 0.05))
        assert heard.call(3, "/fieldtruth/reset", struct.pack("<q", -1)) == (True, "reset, seed 0")
        assert run.simulation.seconds == 0.0
        assert heard.call(4, "/fieldtruth/reset_pose", POSE.pack(0, 0, 0, 0, -3.0, 1.0, 0, 0, 0, 0, 1))[0]
        assert run.simulation.robot.pose[0][:2] == pytest.approx([-3.0, 1.0], abs=0.05)
        success, reason = heard.call(5, "/fieldtruth/reset_pose", POSE.pack(0, 0, 0, 0, 1e3, 1.0, 0, 0, 0, 0, 1))
        assert not success
        assert "outside the world" in reason
        assert not heard.call(6, "/fieldtruth/step", b"no number")[0]


def test_a_frame_that_says_it_is_huge_ends_its_connection_alone() -> None:
    with server() as (port, run):
        other = Client(port, {IMU})
        liar = Client(port, set())
        raw = liar.socket.socket
        raw.sendall(b"\x82\xff" + struct.pack(">Q", 2**40) + b"\0\0\0\0")  # binary, masked, a terabyte
        wait_for(lambda: _is_closed(raw))
        other.hear(lambda: len(other.heard.get(IMU, ())) > 50)
        assert not run.lines


def _is_closed(raw: socket.socket) -> bool:
    try:
        raw.settimeout(0.1)
        while raw.recv(65536):
            pass
        return True
    except TimeoutError:
        return False
    except OSError:
        return True


def test_a_port_that_is_taken_is_one_line() -> None:
    inbox = Inbox(Rig().robot, print)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(
            OutputError, match=rf"cannot listen on port {port} of 127\.0\.0\.1: .*choose another --port"
        ):
            FoxgloveSink(inbox, port=port)
    with pytest.raises(OutputError, match=r"cannot listen on port 0 of 203\.0\.113\.9"):
        FoxgloveSink(inbox, "203.0.113.9", 0)


def test_the_scene_has_the_ground_every_object_and_the_robot() -> None:
    from fieldtruth.live.scene import scene_update

    text = repr(scene_update(WORLD, experiment().rig))
    assert text.count("CubePrimitive") == len(WORLD.instances) + 1 + 4  # the chassis and its wheels
    assert text.count("SceneEntity") >= 3

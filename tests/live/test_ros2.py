# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of ROS 2 over DDS, heard and driven by another process: with Cyclone DDS, and with Fast DDS where it is built.

Fast DDS is ROS 2's default middleware; its node is C++ that fastddsgen generates from the types in ``fastdds/ros.idl``.
"""

import json
import os
import shutil
import socket
import subprocess
import sys
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
import pytest
from live_runs import Run, running, wait_for

import fieldtruth as ft
from fieldtruth.bag.messages import STORE
from fieldtruth.core.errors import ConfigurationError, OutputError
from fieldtruth.experiment.rig import Rig
from fieldtruth.live.commands import Inbox
from fieldtruth.live.messages import Message

pytest.importorskip("cyclonedds")
from fieldtruth.live.ros2 import Ros2Sink, domain_id, udp_sockets

HERE = Path(__file__).parent
FASTDDS = HERE / "fastdds"
Once = Callable[[str, Callable[[Path], object]], Path]


@pytest.fixture(autouse=True)
def _own_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(30 + os.getpid() % 60))


@contextmanager
def sent_and_driven(made: ft.Experiment | None = None) -> Iterator[tuple[Run, list[Message]]]:
    """Yield a run whose messages are kept when they are sent."""
    kept = list[Message]()

    class Kept(Ros2Sink):
        def send(self, message: Message) -> None:
            kept.append(message)
            super().send(message)

    with running(Kept, made) as (_, run):
        yield run, kept


@contextmanager
def other_node(what: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, str(HERE / "dds_node.py"), str(domain_id()), what]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def decoded(message: Message) -> Any:
    return STORE.deserialize_ros1(message.data, "sensor_msgs/msg/PointCloud2")


def rows(process: subprocess.Popen[str], count: int) -> list[Any]:
    assert process.stdout is not None
    return [json.loads(process.stdout.readline()) for _ in range(count)]


def test_clouds_and_latched_frames_reach_another_process_unchanged() -> None:
    with sent_and_driven() as (run, kept), other_node("hear") as node:
        heard = rows(node, 12)
    [static] = [row["static"] for row in heard if "static" in row]
    assert {"imu_link", "turning_link"} <= set(static)
    true = {
        m.stamp_ns: STORE.deserialize_ros1(m.data, "sensor_msgs/msg/PointCloud2") for m in kept if "turning" in m.topic
    }
    clouds = [row for row in heard if "sum" in row]
    assert len(clouds) == 11
    for row in clouds:
        cloud: Any = true[row["stamp"]]
        assert row["frame"] == "turning_link"
        assert row["fields"] == [field.name for field in cloud.fields]
        assert row["sum"] == zlib.adler32(cloud.data.tobytes())
    assert not run.lines


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="descriptors are listed by Linux")
def test_the_search_for_sockets_leaves_no_descriptor_open() -> None:
    with TemporaryFile(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("0.0.0.0", 0))
        before = sorted(path.name for path in Path("/proc/self/fd").iterdir())
        assert own.fileno() in udp_sockets()
        assert sorted(path.name for path in Path("/proc/self/fd").iterdir()) == before


@pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="Linux before 5.7 lets only root bind")
def test_all_sockets_are_bound_to_the_loopback_interface() -> None:
    before = udp_sockets()
    sink = Ros2Sink(Inbox(Rig().robot, print))
    opened = udp_sockets() - before
    assert len(opened) >= 2
    for number in opened:
        with socket.socket(fileno=os.dup(number)) as each:
            device = each.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
            assert device.rstrip(b"\0") == b"lo", each.getsockname()
    assert sink.where.endswith(" at 127.0.0.1, for this machine only")
    sink.close()


@pytest.mark.slow
def test_late_second_and_killed_subscribers() -> None:
    with sent_and_driven() as (run, _):
        wait_for(lambda: run.simulation.seconds > 0.2)
        with other_node("hear") as first, other_node("hear") as second:
            for node in (first, second):
                assert any("static" in row for row in rows(node, 5))
            first.kill()
            assert len(rows(second, 5)) == 5
        at = run.simulation.seconds
        wait_for(lambda: run.simulation.seconds > at + 0.5)
        assert not run.lines


def test_stamped_commands_drive() -> None:
    with sent_and_driven() as (run, _), other_node("drive"):
        wait_for(lambda: run.simulation.robot.velocity[0][0] < -0.4)
        assert run.inbox.command(run.simulation.seconds) == (-0.5, 0.1)


def test_wrong_commands_are_one_line_each_and_pause_is_heard() -> None:
    with sent_and_driven() as (run, _), other_node("wrong"):
        wait_for(lambda: len(run.lines) == 2 and "paused" in run.live.state)
        assert run.inbox.command(0.0) is None
    assert sorted(run.lines) == [
        "/cmd_vel: a command must be finite, got nan m/s and 0.0 rad/s; it is ignored",
        "/cmd_vel: must be geometry_msgs/msg/Twist or geometry_msgs/msg/TwistStamped, "
        "got 'std_msgs::msg::dds_::Int64_'; it is ignored",
    ]


@pytest.mark.parametrize("domain", ["x", "-1", "233", "1.0"])
def test_a_wrong_domain_is_one_line(domain: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    with pytest.raises(ConfigurationError, match=f"^ROS_DOMAIN_ID must be a number from 0 to 232, got '{domain}'$"):
        Ros2Sink(Inbox(Rig().robot, print))


def test_an_address_of_another_machine_is_one_line() -> None:
    with pytest.raises(OutputError, match=r"^DDS domain \d+ cannot be joined at 203\.0\.113\.9: .* choose another"):
        Ros2Sink(Inbox(Rig().robot, print), "203.0.113.9")


@pytest.fixture(scope="module")
def fast_node(once: Once) -> Path:
    """The node, compiled."""
    if missing := [name for name in ("fastddsgen", "g++") if shutil.which(name) is None]:
        pytest.skip(f"needs Debian's libfastrtps-dev, fastddsgen and g++; missing: {', '.join(missing)}")

    def build(folder: Path) -> None:
        for path in FASTDDS.iterdir():
            shutil.copy(path, folder)
        subprocess.run(["fastddsgen", "-replace", "ros.idl"], cwd=folder, check=True, capture_output=True)
        sources = ["node.cpp", "ros.cxx", "rosPubSubTypes.cxx"]
        command = ["g++", "-std=c++17", "-O1", "-o", "node", *sources, "-lfastrtps", "-lfastcdr"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)

    return once("fastdds", build) / "node"


HEARD = ("/turning/points", "/zed/left/tag/img_raw", "/clock", "/tf", "/imu/data")


@pytest.mark.slow
def test_fast_dds_hears_clouds_images_and_frames_and_drives(fast_node: Path, tmp_path: Path) -> None:
    """Nothing is lost while it listens; checksums are those of what was sent."""
    file = tmp_path / "heard.txt"

    def lines() -> list[list[str]]:
        return [line.split() for line in file.read_text().splitlines(keepends=True) if line.endswith("\n")]

    def has_heard() -> bool:
        counts = Counter(topic for topic, *_ in lines())
        return min(counts[topic] for topic in HEARD) > 10 and counts["/tf_static"] > 0

    with sent_and_driven() as (run, kept):
        wait_for(lambda: run.simulation.seconds > 0.2, 120.0)
        with file.open("w") as output, subprocess.Popen([fast_node, "300", "-0.4", "0.2"], stdout=output) as node:
            try:
                wait_for(has_heard, 120.0)
                wait_for(lambda: np.linalg.norm(run.simulation.robot.velocity[0]) > 0.3, 120.0)
            finally:
                node.kill()
    sent = {(m.topic, m.stamp_ns): m for m in kept}
    for topic in HEARD:
        stamps = [int(stamp) for name, stamp, *_ in lines() if name == topic]
        expected = sorted(stamp for name, stamp in sent if name == topic and stamps[0] <= stamp <= stamps[-1])
        assert stamps == expected, topic
    for topic, stamp, frame, size, checksum in lines():
        if topic == "/turning/points":
            points = decoded(sent[topic, int(stamp)]).data
            assert (frame, int(size), int(checksum)) == ("turning_link", len(points), zlib.adler32(points.tobytes()))

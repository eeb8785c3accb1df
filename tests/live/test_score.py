# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A node on the fixed benchmark, which drives as the built-in follower does; waiting, and requests that are refused."""

import json
import os
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_worlds import make_world, obstacle
from live_runs import Recorder, wait_for

from fieldtruth import cli
from fieldtruth.bag.messages import STORE
from fieldtruth.bag.topics import CLOCK, ODOMETRY, TF_STATIC
from fieldtruth.experiment.rig import Rig
from fieldtruth.learning.benchmark import BenchmarkTask, drive_task
from fieldtruth.learning.environment import Reach
from fieldtruth.learning.policies import policy_of
from fieldtruth.live.commands import Inbox, Reset
from fieldtruth.live.score import GOAL, NodeDriver

FREE = BenchmarkTask(0, "blocks", 0, 0.2, (-10.0, -10.0), 0.5, (-5.0, -10.0), 5.0)
BLOCKED = BenchmarkTask(1, "blocks", 0, 0.5, (0.0, 0.0), 0.0, (12.0, 0.0), 15.25)
STRAIGHT = policy_of("straight")


@pytest.fixture(scope="module")
def blocks() -> Any:
    """Level ground with a wall across the straight line of ``BLOCKED``."""
    return make_world(size=(40.0, 40.0), obstacles=[obstacle("wall", "box", (1.0, 6.0, 2.0), 6.0, 0.0)])


def test_a_node_over_dds_drives_as_the_same_function_does(blocks: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cyclonedds")
    from fieldtruth.live.ros2 import Ros2Sink, domain_id

    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + os.getpid() % 60))
    lines = list[str]()
    inbox = Inbox(Rig().robot, lines.append)
    command = [sys.executable, str(Path(__file__).parent / "dds_node.py"), str(domain_id()), "reach"]
    with (
        closing(Ros2Sink(inbox)) as sink,
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as node,
    ):
        try:
            driver = NodeDriver("ros2", sink, inbox, 2.0, lines.append)
            env = Reach(world=blocks, observation=driver.observation)
            found = [drive_task(env, task, driver) for task in (FREE, BLOCKED)]
        finally:
            node.kill()
        assert node.stdout is not None
        heard = [json.loads(line) for line in node.stdout]
    assert lines == ["waits until something publishes /cmd_vel; Ctrl-C ends it"]
    goals = [row for row in heard if "goal" in row]
    assert goals == [{"goal": [*task.goal], "frame": "world"} for task in (FREE, BLOCKED)]
    [cloud] = [row for row in heard if "points" in row]
    assert cloud["points"] > 500
    assert "label" in cloud["fields"]
    env = Reach(world=blocks, observation=STRAIGHT.observation)
    expected = [drive_task(env, task, STRAIGHT) for task in (FREE, BLOCKED)]
    assert [each["cause"] for each in found] == [each["cause"] for each in expected] == ["reached", "hit an obstacle"]
    for own, other in zip(found, expected, strict=True):
        assert own["length_m"] == pytest.approx(other["length_m"], rel=0.03)
        assert own["seconds"] == pytest.approx(other["seconds"], abs=0.5)


class Answering(Recorder):
    """Has a publisher of commands after it was asked some times."""

    def __init__(self, inbox: Inbox, *, waits: int = 0) -> None:
        super().__init__()
        self.inbox, self.waits = inbox, waits

    def is_commanded(self) -> bool:
        self.waits -= 1
        return self.waits < 0

    def of(self, topic: str) -> list[int]:
        return [message.stamp_ns for message in self.messages if message.topic == topic]


def begun(blocks: Any, *, waits: int = 0) -> tuple[Any, Reach, Answering, Inbox, list[str]]:
    lines = list[str]()
    inbox = Inbox(Rig().robot, lines.append)
    sink = Answering(inbox, waits=waits)
    driver = NodeDriver("ros2 mine", sink, inbox, 0.0, lines.append)
    env = Reach(world=blocks, observation=driver.observation)
    env.reset(seed=0, options={"start": FREE.start, "goal": FREE.goal, "heading": FREE.heading})
    return driver, env, sink, inbox, lines


def test_time_begins_anew_with_each_task_and_a_command_holds_half_a_second(blocks: Any) -> None:
    driver, env, sink, inbox, lines = begun(blocks)
    for task in range(2):
        act = driver.begin(env)
        assert act(None).tolist() == [0.0, 0.0]
        inbox._drive(0.5, -4.0)
        actions = []
        for _ in range(8):
            actions.append(act(None).tolist())
            env.step(actions[-1])
        assert actions == [[0.5, -1.0]] * 6 + [[0.0, 0.0]] * 2
        assert sink.of(GOAL) == sink.of(TF_STATIC) == [0] * (task + 1)
        env.reset(options={"start": FREE.start, "goal": FREE.goal, "heading": FREE.heading})
    clock = np.array(sink.of(CLOCK))
    assert {*np.diff(clock)} == {0, 100_000_000, -700_000_000}
    assert len(lines) == 1
    [last] = [message for message in sink.messages if message.topic == ODOMETRY][-1:]
    pose: Any = STORE.deserialize_ros1(last.data, "nav_msgs/msg/Odometry")
    assert pose.pose.pose.position.x == pytest.approx(FREE.start[0], abs=0.6)
    assert {topic.name for topic in sink.topics} == {message.topic for message in sink.messages}


def test_the_first_task_waits_for_a_publisher_and_sends_its_state_meanwhile(blocks: Any) -> None:
    driver, env, sink, _, lines = begun(blocks, waits=5)
    driver.begin(env)
    assert sink.of(ODOMETRY) == [0] * 5
    sink.waits = 10**6
    began = threading.Thread(target=driver.begin, args=[env])
    began.start()  # a later one, at most two seconds
    wait_for(lambda: not began.is_alive(), 20.0)
    assert 5 < len(sink.of(ODOMETRY)) <= 26
    assert lines == ["waits until something publishes /cmd_vel; Ctrl-C ends it"]


def test_a_task_can_not_be_reset(blocks: Any) -> None:
    driver, env, _, inbox, lines = begun(blocks)
    act = driver.begin(env)
    answer = inbox._ask(Reset())
    act(None)
    assert str(answer.exception(0)) == "a score can be neither paused nor stepped nor reset"
    assert lines[1:] == ["/fieldtruth: a score can be neither paused nor stepped nor reset; it is ignored"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([], "give POLICY, --ros2 or --ros1"),
        (["straight", "--ros2"], "not allowed with argument"),
        (["--ros2", "--ros1"], "not allowed with argument"),
        (["straight", "--name", "mine"], "--name is for --ros2 and --ros1"),
        (["--ros2", "--observation", "state"], "--observation is for a POLICY"),
        (["--ros2", "--rate", "-1"], "--rate must be from 0 to 1000, got -1"),
        (["--ros2", "--host", "here"], "--host must be an IPv4 address of this machine, got 'here'"),
        (["--ros2"], "cyclonedds is not installed; run: pip install 'fieldtruth[live]'"),
        (["--ros1"], "rospy is not installed for this Python"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "cyclonedds.core", None)
    monkeypatch.setitem(sys.modules, "rosgraph", None)
    assert cli.main(["score", *arguments]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert text in err

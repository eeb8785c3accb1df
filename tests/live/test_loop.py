# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The loop: messages are those of the bag, commands are checked, and simulated time is slowed, not readings lost."""

import math
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drive_worlds import make_experiment
from live_runs import Recorder, running, simulation_of, wait_for
from rosbags.rosbag1 import Reader
from stepped_rigs import SCENE, experiment, sensors

import fieldtruth as ft
from fieldtruth.bag.messages import STORE
from fieldtruth.bag.topics import CLOCK, COMMANDS, MODEL_STATES
from fieldtruth.core.errors import ConfigurationError, RouteError
from fieldtruth.drive.physics import Command
from fieldtruth.experiment.rig import Rig
from fieldtruth.live.commands import HOLD_S, STAMPED, TWIST, Inbox, Pause, Request, Reset, Step, answer_of
from fieldtruth.live.loop import Live, Pace

POSE, BOOL = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/Bool"


def inbox_of(lines: list[str] | None = None) -> Inbox:
    return Inbox(Rig().robot, ([] if lines is None else lines).append)


def twist(speed: Any, turn_rate: Any) -> SimpleNamespace:
    return SimpleNamespace(linear=SimpleNamespace(x=speed), angular=SimpleNamespace(z=turn_rate))


def pose_at(x: Any, y: float = 0.0, heading: float = 0.0) -> SimpleNamespace:
    q = SimpleNamespace(x=0.0, y=0.0, z=math.sin(heading / 2), w=math.cos(heading / 2))
    return SimpleNamespace(pose=SimpleNamespace(position=SimpleNamespace(x=x, y=y), orientation=q))


def test_messages_are_those_of_the_bag_byte_for_byte(tmp_path: Path) -> None:
    """As the follower drives; the clock and the models' states come at 50 Hz instead of 1000 Hz."""
    made = experiment(signal=True, clock=True)
    recorder = Recorder()
    Live(simulation_of(made), recorder, inbox_of(), 0.0, print).run(lambda state: None)
    found: dict[str, list[tuple[int, bytes]]] = {}
    for stamp, topic, data in recorder.messages:
        found.setdefault(topic, []).append((stamp, data))
    expected: dict[str, list[tuple[int, bytes]]] = {}
    with Reader(ft.generate(made, tmp_path, scene=SCENE, workers=1)) as bag:
        for connection, stamp, data in bag.messages():
            if connection.topic not in (CLOCK, MODEL_STATES) or stamp % 20_000_000 == 0:
                expected.setdefault(connection.topic, []).append((stamp, bytes(data)))
    del expected[COMMANDS]
    assert {topic.name for topic in recorder.topics} == expected.keys()
    assert found.keys() == expected.keys()
    for topic, messages in expected.items():
        assert found[topic] == messages, topic
    assert [stamp for stamp, _ in found[CLOCK]] == list(range(20_000_000, 400_000_001, 20_000_000))


def test_what_nobody_wants_is_not_sensed(monkeypatch: pytest.MonkeyPatch) -> None:
    read = list[str]()
    usual = ft.Sensor.read

    def noted(self: ft.Sensor, output: Any, at: ft.At) -> Any:
        read.append(output.name)
        return usual(self, output, at)

    monkeypatch.setattr(ft.Sensor, "read", noted)
    recorder = Recorder({"/turning/points", CLOCK})
    simulation = simulation_of(experiment())
    topic = next(t.name for c in simulation.experiment.rig.in_order() if c.name == "turning" for t in c.topics())
    recorder.wanted = {topic}
    Live(simulation, recorder, inbox_of(), 0.0, print).run(lambda state: None)
    assert set(read) == {"turning"}
    assert {message.topic for message in recorder.messages} == {topic, CLOCK, "/tf_static"}


def test_an_end_of_the_route_is_no_end() -> None:
    rig = Rig.model_validate({"sensors": [each for each in sensors() if each["kind"] in ("imu", "gnss")]})
    made = make_experiment([(1.1, 0.0)], rig=rig, seconds=6.0)
    simulation = simulation_of(made)
    Live(simulation, Recorder(set()), inbox_of(), 0.0, print).run(lambda state: None)
    assert simulation.seconds == 6.0
    assert np.linalg.norm(simulation.robot.velocity[0]) < 1e-3


def test_a_command_is_cut_to_the_limits_and_holds_for_half_a_second() -> None:
    lines: list[str] = []
    inbox = inbox_of(lines)
    assert inbox.command(0.0) is None
    inbox.take(COMMANDS, TWIST, twist(99.0, -99.0))
    robot = Rig().robot
    limits = Command(robot.max_speed, -robot.max_turn_rate)
    assert inbox.command(3.0) == inbox.command(3.0 + HOLD_S) == limits
    assert inbox.command(3.01 + HOLD_S) == Command(0.0, 0.0)
    inbox.take(COMMANDS, STAMPED, SimpleNamespace(twist=twist(0.5, 0.25)))
    assert inbox.command(9.0) == Command(0.5, 0.25)
    inbox.forget()
    assert inbox.command(9.0) is None
    assert not lines


@pytest.mark.parametrize(
    ("topic", "msgtype", "message", "reason"),
    [
        (COMMANDS, TWIST, twist(math.nan, 0.0), "a command must be finite, got nan m/s and 0.0 rad/s"),
        (COMMANDS, TWIST, twist(0.0, math.inf), "a command must be finite, got 0.0 m/s and inf rad/s"),
        (COMMANDS, TWIST, twist("x", 0.0), "could not convert string to float: 'x'"),
        (COMMANDS, STAMPED, twist(0.1, 0.0), "object has no attribute 'twist'"),
        ("/fieldtruth/step", "std_msgs/msg/Float64", SimpleNamespace(data=math.nan), "from 0.001 to 3600 s, got nan"),
        ("/fieldtruth/step", "std_msgs/msg/Float64", SimpleNamespace(data=1e9), "from 0.001 to 3600 s"),
        ("/fieldtruth/reset", "std_msgs/msg/Int64", SimpleNamespace(data=None), "not supported between"),
        ("/fieldtruth/reset_pose", POSE, pose_at("x"), "could not convert string to float: 'x'"),
        ("/fieldtruth/reset", "std_msgs/msg/Int64", SimpleNamespace(data=2**63), "seed must be from 0 to 92233"),
    ],
)
def test_a_wrong_command_is_one_line(topic: str, msgtype: str, message: Any, reason: str) -> None:
    lines: list[str] = []
    inbox = inbox_of(lines)
    for _ in range(50):
        assert inbox.take(topic, msgtype, message) is None
    assert inbox.command(0.0) is None
    assert not inbox.requests()
    [line] = lines
    assert line.startswith(f"{topic}: ")
    assert reason in line
    assert line.endswith("; it is ignored")


def test_letters_that_move_the_cursor_are_not_printed() -> None:
    lines: list[str] = []
    inbox_of(lines).refuse_type("/\x1b[2J\n", "\x1b]0;x\x07")
    assert lines == ["/ [2J : must be no topic, got '\\x1b]0;x\\x07'; it is ignored"]


@pytest.mark.parametrize("data", [b"", b"\1" * 47, bytes(10**7)], ids=["empty", "short", "long"])
def test_bytes_that_are_no_message_are_one_line(data: bytes) -> None:
    lines: list[str] = []
    for encoding in ("ros1", "json"):
        inbox = inbox_of(lines)
        assert inbox.take_bytes(COMMANDS, TWIST, data, encoding) is None
        assert inbox.command(0.0) is None
    assert len(lines) == 2


def test_at_most_a_hundred_requests_wait() -> None:
    lines: list[str] = []
    inbox = inbox_of(lines)
    for _ in range(200):
        inbox.take("/fieldtruth/pause", BOOL, SimpleNamespace(data=True))
    assert len(inbox.requests()) == 100
    assert lines == ["/fieldtruth/pause: 100 requests are waiting, and no more may; it is ignored"]


def asked(inbox: Inbox, request: Request) -> tuple[bool, str]:
    """Ask as a front end does, and wait for the answer."""
    if isinstance(request, Reset) and request.start is not None:
        return answer_of(inbox.take("/fieldtruth/reset_pose", POSE, pose_at(*request.start)))
    topic, value = {
        Pause: ("/fieldtruth/pause", getattr(request, "paused", None)),
        Step: ("/fieldtruth/step", getattr(request, "seconds", None)),
        Reset: ("/fieldtruth/reset", -1),
    }[type(request)]
    return answer_of(inbox.take(topic, "-", SimpleNamespace(data=value)))


def test_pause_step_and_reset() -> None:
    with running(lambda _: Recorder(set())) as (sink, run):
        assert isinstance(sink, Recorder)
        wait_for(lambda: run.simulation.seconds > 0.1)
        paused = asked(run.inbox, Pause(True))
        at = run.simulation.seconds
        assert paused == (True, f"paused at {at:.3f} s")
        time.sleep(0.1)
        assert run.simulation.seconds == at
        assert asked(run.inbox, Step(0.055)) == (True, f"steps to {at + 0.055:.3f} s")
        wait_for(lambda: run.simulation.seconds > at + 0.05)
        time.sleep(0.1)
        assert run.simulation.seconds == pytest.approx(at + 0.055)
        assert asked(run.inbox, Step(0.0014))[0]  # a step of the physics, and no half one
        wait_for(lambda: run.simulation.seconds > at + 0.0555)
        assert asked(run.inbox, Pause(False))[0]
        wait_for(lambda: run.simulation.seconds > at + 0.2)
        shown = sink.shown
        assert asked(run.inbox, Reset()) == (True, "reset, seed 0")
        assert run.simulation.seconds < at
        assert sink.shown == shown + 1
    assert not run.lines


def test_a_reset_puts_the_robot_where_it_is_told() -> None:
    with running(lambda _: Recorder(set()), rate=0.05) as (_, run):
        assert asked(run.inbox, Reset(start=(-4.0, 2.0, 1.0)))[0]
        (x, y, _), (w, _, _, z) = run.simulation.robot.pose
        assert (x, y) == pytest.approx((-4.0, 2.0), abs=0.05)
        assert 2 * math.atan2(z, w) == pytest.approx(1.0, abs=0.03)
        before = run.simulation.seconds
        for x, reason in ((1e3, "outside the world"), (1e308, "up to 10000"), (math.nan, "up to 10000")):
            success, text = asked(run.inbox, Reset(start=(x, 0.0, 0.0)))
            assert (success, reason in text) == (False, True)
            assert run.lines[-1] == text
        assert run.simulation.seconds >= before  # the drive goes on
    with pytest.raises(RouteError):
        run.simulation.reset(start=(9.0, 0.0, 0.0))  # in the wall
    with pytest.raises(ConfigurationError):
        run.simulation.reset(start=(math.nan, 0.0, 0.0))


def test_a_robot_that_leaves_the_world_is_a_line_and_a_reset_goes_on() -> None:
    """It drives out of the world by command."""
    with running(lambda _: Recorder(set()), rate=0.0) as (_, run):
        asked(run.inbox, Reset(start=(-15.0, 0.0, math.pi)))

        def drive() -> object:
            run.inbox.take(COMMANDS, TWIST, twist(1.0, 0.0))
            return run.lines

        wait_for(drive, 60.0)
        [line] = run.lines
        assert line.startswith("robot outside the world at ")
        assert asked(run.inbox, Pause(True)) == (False, "the drive has ended; reset begins another")
        assert asked(run.inbox, Reset())[0]
        wait_for(lambda: 0.5 < run.simulation.seconds < 5.0)


def test_pace_holds_to_the_rate_and_forgets_what_is_late() -> None:
    pace = Pace(2.0)
    began = time.monotonic()
    for k in range(1, 11):
        pace.wait(0.04 * k)
    assert 0.19 < time.monotonic() - began < 2.0
    time.sleep(1.0)  # of 2 s that are late, at most 0.2 s of wall clock may be caught up
    began = time.monotonic()
    for k in range(11, 31):
        pace.wait(0.04 * k)
    assert time.monotonic() - began > 0.1
    assert 0.2 < pace.factor < 2.0


def test_a_slow_sink_slows_simulated_time_and_loses_nothing() -> None:
    class Slow(Recorder):
        def send(self, message: Any) -> None:
            time.sleep(0.002)
            super().send(message)

    slow = Slow()
    began = time.monotonic()
    Live(simulation_of(experiment(seconds=0.2)), slow, inbox_of(), 100.0, print).run(lambda state: None)
    usual = Recorder()
    Live(simulation_of(experiment(seconds=0.2)), usual, inbox_of(), 0.0, print).run(lambda state: None)
    assert sorted(slow.messages) == sorted(usual.messages)
    assert time.monotonic() - began > 0.002 * len(slow.messages)


def test_latched_topics_come_first_and_decode() -> None:
    recorder = Recorder(set())
    Live(simulation_of(experiment(seconds=0.05)), recorder, inbox_of(), 0.0, print).run(lambda state: None)
    first = recorder.messages[1]
    decoded: Any = STORE.deserialize_ros1(first.data, "tf2_msgs/msg/TFMessage")
    frames = {each.child_frame_id for each in decoded.transforms}
    assert {"imu_link", "GNSS_link", "turning_link"} <= frames

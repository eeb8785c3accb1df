# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Commands from outside: the topics on which they come, what they ask for, and those that wait to be done.

They can drive the robot, pause, step and reset, and nothing else. A wrong one is a line on the screen.
"""

import json
import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from time import monotonic
from types import SimpleNamespace
from typing import Any, Final

from fieldtruth.bag.messages import STORE
from fieldtruth.bag.topics import COMMANDS
from fieldtruth.core.errors import ConfigurationError, FieldtruthError
from fieldtruth.drive.physics import STOP, Command
from fieldtruth.experiment.robot_config import RobotConfig

HOLD_S: Final = 0.5
"""Simulated time [s] for which a command holds, as in the controllers of real robots; then the robot stops."""
PATIENCE_S: Final = 120.0
"""Wall clock [s] that a service may take: a reset with another seed builds a world."""
_MOST_REQUESTS: Final = 100
_MOST_SECONDS: Final = 3600.0
_LONGEST: Final = 64 * 1024
"""Bytes of a command."""
_APART_S: Final = 10.0
"""Wall clock [s] between two lines that begin alike."""
_MOST_LINES: Final = 10
"""Lines in that time."""


@dataclass(frozen=True)
class Pause:
    """Stop or go on."""

    paused: bool


@dataclass(frozen=True)
class Step:
    """Go on by some simulated time [s], and pause then."""

    seconds: float

    def __post_init__(self) -> None:
        if not 0.001 <= self.seconds <= _MOST_SECONDS:  # also false for nan
            raise ConfigurationError(f"step must be from 0.001 to {_MOST_SECONDS:g} s, got {self.seconds!r}")


@dataclass(frozen=True)
class Reset:
    """Begin again at time 0, with another seed or at a start of x, y [m] and heading [rad] if they are given."""

    seed: int | None = None
    start: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.seed is not None and not 0 <= self.seed < 2**63:
            raise ConfigurationError(f"seed must be from 0 to {2**63 - 1}, got {self.seed}")


Request = Pause | Step | Reset


def _at_pose(message: Any) -> Request:
    """Return the reset to a PoseStamped in the world frame, of which position and heading matter."""
    at, q = message.pose.position, message.pose.orientation
    heading = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
    return Reset(None, (float(at.x), float(at.y), heading))


TWIST: Final = "geometry_msgs/msg/Twist"
STAMPED: Final = "geometry_msgs/msg/TwistStamped"
CONTROLS: Final[Mapping[str, tuple[str, Callable[[Any], Request]]]] = {
    "/fieldtruth/pause": ("std_msgs/msg/Bool", lambda message: Pause(bool(message.data))),
    "/fieldtruth/step": ("std_msgs/msg/Float64", lambda message: Step(float(message.data))),
    "/fieldtruth/reset": ("std_msgs/msg/Int64", lambda m: Reset(None if m.data < 0 else int(m.data))),
    "/fieldtruth/reset_pose": ("geometry_msgs/msg/PoseStamped", _at_pose),
}
"""Type by topic, and the request of a message; a reset below 0 keeps the seed."""
ALLOWED: Final[Mapping[str, tuple[str, ...]]] = {
    COMMANDS: (TWIST, STAMPED),
    **{topic: (msgtype,) for topic, (msgtype, _) in CONTROLS.items()},
}
"""Types of messages by topic on which commands may come."""


class Inbox:
    """Commands that wait to be taken; threads may share it.

    Args:
        robot: whose limits hold; a faster command is cut to them.
        say: prints a line about a command that is refused, of those that begin alike one in ten seconds.
    """

    def __init__(self, robot: RobotConfig, say: Callable[[str], None]) -> None:
        self._limits, self._say = (robot.max_speed, robot.max_turn_rate), say
        self._lock, self._said = threading.Lock(), dict[str, float]()
        self._requests = deque[tuple[Request, Future[str]]]()
        self._command: Command | None = None
        self._is_new, self._since_s = False, 0.0

    def refuse(self, topic: str, why: str) -> None:
        """Say in a line why something of a topic is not done."""
        with self._lock:
            now, key = monotonic(), f"{topic}: {why[:10]}"
            self._said = {key: at for key, at in self._said.items() if now - at < _APART_S}
            if key in self._said or len(self._said) >= _MOST_LINES:
                return
            self._said[key] = now
        text = f"{topic}: {why[:300]}; it is ignored"
        self._say("".join(letter if letter.isprintable() else " " for letter in text))

    def refuse_type(self, topic: str, msgtype: str) -> None:
        """Say that messages of a topic have another type than they must."""
        self.refuse(topic[:60], f"must be {' or '.join(ALLOWED.get(topic, ['no topic']))}, got {msgtype[:60]!r}")

    def take(self, topic: str, msgtype: str, message: Any) -> "Future[str] | None":
        """Take a decoded message of an allowed type; None if it drives, or is refused."""
        try:
            if topic == COMMANDS:
                twist = message.twist if msgtype == STAMPED else message
                self._drive(float(twist.linear.x), float(twist.angular.z))
                return None
            return self._ask(CONTROLS[topic][1](message))
        except (FieldtruthError, ArithmeticError, AttributeError, TypeError, ValueError) as error:
            self.refuse(topic, str(error))
            return None

    def take_bytes(self, topic: str, msgtype: str, data: bytes, encoding: str = "ros1") -> "Future[str] | None":
        """Take a message as ROS 1 or JSON has it."""
        try:
            if len(data) > _LONGEST:
                raise ValueError(f"has {len(data)} bytes, allowed are {_LONGEST}")
            if encoding == "ros1":
                message = STORE.deserialize_ros1(data, msgtype)
            else:
                message = json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
        except Exception as error:  # generated code raises any exception on invalid bytes
            self.refuse(topic, f"is no {msgtype} in {encoding}: {error}")
            return None
        return self.take(topic, msgtype, message)

    def _drive(self, *values: float) -> None:
        """Take a forward speed [m/s] and a turn rate [rad/s]; from now on the follower drives no more."""
        if not all(map(math.isfinite, values)):
            raise ConfigurationError(f"a command must be finite, got {values[0]} m/s and {values[1]} rad/s")
        cut = (min(max(value, -limit), limit) for value, limit in zip(values, self._limits, strict=True))
        with self._lock:
            self._command, self._is_new = Command(*cut), True

    def _ask(self, request: Request) -> "Future[str]":
        with self._lock:
            if len(self._requests) >= _MOST_REQUESTS:
                raise ConfigurationError(f"{_MOST_REQUESTS} requests are waiting, and no more may")
            self._requests.append((request, Future[str]()))
            return self._requests[-1][1]

    def requests(self) -> list[tuple[Request, "Future[str]"]]:
        """Take the requests that wait, in their order, with what is told what was done."""
        with self._lock:
            taken = [*self._requests]
            self._requests.clear()
            return taken

    def command(self, now_s: float) -> Command | None:
        """Return the command at a simulated time [s]; None where there was none since the last reset."""
        with self._lock:
            if self._is_new:
                self._is_new, self._since_s = False, now_s
            return STOP if self._command is not None and now_s - self._since_s > HOLD_S else self._command

    def forget(self) -> None:
        """Forget the command, so that the follower drives."""
        with self._lock:
            self._command, self._is_new = None, False


def answer_of(asked: "Future[str] | None") -> tuple[bool, str]:
    """Wait until a request is done; return whether it was, and what was done or why not."""
    try:
        return (True, asked.result(PATIENCE_S)) if asked else (False, "refused; the reason is on the screen")
    except (FieldtruthError, TimeoutError) as error:
        return False, str(error) or "no answer in time"

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Nodes on the fixed benchmark: a task as topics, and the commands on /cmd_vel as actions.

Each step of control sends the clock, odometry, /tf and the scan, and keeps to the pace of the wall clock: the command
that has come by then is the action of the next step. Physics and metrics are those of a function that drives.
"""

import time
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import messages, topics
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation
from fieldtruth.drive.physics import STOP
from fieldtruth.drive.track import Motion
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.learning.environment import Reach
from fieldtruth.learning.policies import Act
from fieldtruth.live.commands import Inbox
from fieldtruth.live.loop import Pace, Sink
from fieldtruth.live.messages import Message

GOAL: Final = "/goal_pose"
_PATIENCE_S: Final = 2.0
"""Wall clock [s] for which a task waits for a publisher of commands; the first one has no limit."""
_AGAIN_S: Final = 0.1
"""Wall clock [s] after which the state is sent again while the task waits, for nodes that come late."""


class NodeDriver:
    """A node that drives the tasks of the benchmark, each of which begins at time 0.

    Args:
        name: in the results.
        sink: gets the messages.
        inbox: has the commands; other requests are refused.
        rate: as in ``Pace``.
        say: prints a line.
    """

    observation: str | tuple[str, ...] = ("state", "lidar")
    digest = ""

    def __init__(self, name: str, sink: Sink, inbox: Inbox, rate: float, say: Callable[[str], None]) -> None:
        self.name, self._sink, self._inbox, self._say = name, sink, inbox, say
        self._pace, self._sent, self._has_begun = Pace(rate), 0, False

    def begin(self, env: Reach) -> Act:
        """Say goal and frames of a task, wait for a publisher of commands, and return what answers with its commands.

        The first action comes a step of control after the state at time 0 was sent, as do all others.
        """
        if not self._has_begun:
            self._sink.advertise(_topics(env))
        self._take()
        self._inbox.forget()
        self._send_task(env)
        self._wait(env)
        self._pace.begin(-1.0 / env.config.control_hz)
        return lambda seen: self._act(env)

    def _act(self, env: Reach) -> NDArray[np.float64]:
        """Send the state, and return the action that is commanded when it is due."""
        self._send_state(env)
        self._pace.wait(env.robot.seconds)
        self._take()
        command, robot = self._inbox.command(env.robot.seconds) or STOP, env.senses.rig.robot
        return np.array([command.speed / robot.max_speed, command.turn_rate / robot.max_turn_rate])

    def _take(self) -> None:
        """Take what has come; a task can be neither paused nor stepped nor begun anew."""
        self._sink.poll()
        for _, answer in self._inbox.requests():
            self._inbox.refuse("/fieldtruth", why := "a score can be neither paused nor stepped nor reset")
            answer.set_exception(ConfigurationError(why))

    def _wait(self, env: Reach) -> None:
        if not self._has_begun:
            self._say(f"waits until something publishes {topics.COMMANDS}; Ctrl-C ends it")
        until_s = time.monotonic() + _PATIENCE_S
        while not self._sink.is_commanded() and not (self._has_begun and time.monotonic() > until_s):
            self._send_state(env)
            time.sleep(_AGAIN_S)
            self._take()
        self._has_begun = True

    def _send(self, env: Reach, sent: dict[str, bytes]) -> None:
        stamp = round(1e9 * env.robot.seconds)
        for topic, data in ({topics.CLOCK: messages.clocks(np.array([stamp]))[0]} | sent).items():
            self._sink.send(Message(stamp, topic, data))

    def _send_task(self, env: Reach) -> None:
        """Send what is latched, behind the clock, which is back at 0."""
        world, goal = env.senses.world, env.task.goal
        assert goal is not None
        height = world.terrain.field.height_at(goal[:1], goal[1:])
        head = messages.header_fields(self._sent, np.zeros(1, np.int64), messages.WORLD)
        fixed = messages.fixed_transforms(env.senses.rig, world.origin)
        pose = np.array([*goal, *height, 0.0, 0.0, 0.0, 1.0])
        self._send(env, {topics.TF_STATIC: messages.tf_static(0, fixed), GOAL: messages.serialized(1, *head, pose)[0]})

    def _send_state(self, env: Reach) -> None:
        motion, number = _motion(env), np.array([self._sent])
        scans = zip(env.senses.scan_topics, env.senses.scan_messages(), strict=True)
        sent = {
            topics.ODOMETRY: messages.odometry(number, motion)[0],
            topics.TF: messages.tf(number, motion, {})[0],
            **{topic.name: data for topic, data in scans},
        }
        self._send(env, sent)
        self._sent += 1


def _topics(env: Reach) -> list[Topic]:
    """Return what is sent."""
    known = {topic.name: topic for topic in topics.topics_of(env.senses.rig)}
    hz = env.config.control_hz
    moving = [known[name]._replace(rate_hz=hz) for name in (topics.CLOCK, topics.ODOMETRY, topics.TF)]
    scans = [topic._replace(rate_hz=hz) for topic in env.senses.scan_topics]
    return [*moving, known[topics.TF_STATIC], *scans, Topic(GOAL, "geometry_msgs/msg/PoseStamped", None)]


def _motion(env: Reach) -> Motion:
    """Return the state of the robot as the only row of a motion."""
    physics = env.robot.physics
    pose, (velocity, turning) = physics.world_from_base, physics.velocity
    return Motion(
        stamps_ns=np.array([round(1e9 * env.robot.seconds)]),
        position=pose[None, :3, 3],
        quaternion_wxyz=quaternion_wxyz_from_rotation(pose[None, :3, :3]),
        linear_velocity=velocity[None],
        angular_velocity=(pose[:3, :3] @ turning)[None],
    )

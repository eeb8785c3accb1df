# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the robot's base reports: joint states, wheel odometry, turning frames and commands, compared with each other.

Wheel odometry is compared with the angles from which it is integrated, not with the true motion: its slip is real.
"""

from typing import Any, Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.base_messages import JOINTS, WHEEL_FRAMES, wheel_transforms
from fieldtruth.bag.decode import matrix
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.frames import rotation_from_quaternion_wxyz, yaw_from_rotation
from fieldtruth.drive.controller import WaypointFollower
from fieldtruth.drive.odometry import advance
from fieldtruth.drive.sensors import antenna_geodetic
from fieldtruth.experiment.odometry_config import JOINT_STATES
from fieldtruth.experiment.route import geodetic_route
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import Checker, Context, at

POSE: Final = Rule("wheel odometry adds up what the wheels turn", 1e-9, "m or rad")
TWIST: Final = Rule("the twist of wheel odometry is its change", 1e-9, "m/s or rad/s")
FRAMES: Final = Rule("wheels in /tf have the angles of /joint_states", 1e-9, "m or of a rotation")
SPEEDS: Final = Rule("tachometers read the speeds of /joint_states", 1e-5, "rad/s")
_NO_JOINTS: Final = f"no {JOINT_STATES}"
ODOMETRY: Final[Spec] = Spec("wheel odometry", (POSE, TWIST, FRAMES, SPEEDS), "joint states", _NO_JOINTS)

# The controller's first fix is that of time 0, the first known one a millisecond later.
COMMAND: Final = Rule("commands are those of the controller for fix and heading", 1e-5, "m/s or rad/s")
COMMANDS: Final[Spec] = Spec("commands", (COMMAND,), "commands", f"no {table.COMMANDS}, or no waypoints")


class WheelOdometry(Checker):
    """Angles of the wheels in joint states, odometry, /tf and tachometers."""

    def __init__(self, context: Context) -> None:
        self._rig, self._tally = context.rig, context.tally(ODOMETRY)
        config = context.rig.wheel_odometry
        end = "" if config is None else config.true_topic("")
        self._topic = "" if config is None else config.topic + end
        self._speed_topics = tuple(name + end for name in self._rig.wheel_speed_topics)
        self._joint_states = JOINT_STATES + end
        self.topics = () if config is None else (table.TF, *self._speed_topics, self._joint_states, self._topic)
        self.tallies = [self._tally]
        self._frames: tuple[int, dict[str, Array]] = (0, {})
        self._speeds: dict[str, tuple[int, float]] = {}
        self._joints = JOINTS[: len(self._rig.wheels.names)]
        self._angles, self._stamp, self._last_stamp = np.zeros(len(self._joints)), 0, 0
        self._turned = np.zeros(len(self._joints))
        self._pose = np.zeros(3)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message; at equal stamps, those of joint states come after /tf and before odometry."""
        if raw.topic == table.TF:
            parts = {each.child_frame_id: matrix(each.transform) for each in message.transforms}
            self._frames = raw.stamp_ns, {name: parts[name] for name in WHEEL_FRAMES if name in parts}
        elif raw.topic in self._speed_topics:
            self._speeds[raw.topic] = raw.stamp_ns, float(message.data)
        elif raw.topic == self._joint_states and set(self._joints) <= set(message.name):
            order = [message.name.index(joint) for joint in self._joints]
            self._see_joints(raw, np.asarray(message.position)[order], np.asarray(message.velocity)[order])
        elif raw.topic == self._topic and raw.stamp_ns == self._stamp:
            self._see_odometry(raw, message)

    def _see_joints(self, raw: RawMessage, angles: Array, speeds: Array) -> None:
        self._turned, self._angles = angles - self._angles, angles
        self._last_stamp, self._stamp = self._stamp, raw.stamp_ns
        stamp, found = self._frames
        if stamp == raw.stamp_ns and found:
            true = wheel_transforms(self._rig, angles)
            apart = max(float(np.abs(found[name] - true[name]).max()) for name in found)
            self._tally[FRAMES].measure(apart, at(raw))
        for topic, speed in zip(self._speed_topics, speeds, strict=True):
            stamp, read = self._speeds.get(topic, (0, 0.0))
            if stamp == raw.stamp_ns:
                self._tally[SPEEDS].measure(read - speed, at(raw))

    def _see_odometry(self, raw: RawMessage, message: Any) -> None:
        (forward,), (turn,) = advance(self._turned[None], self._rig.wheels)
        x, y, yaw = self._pose
        # On an arc, the robot moves along its chord.
        chord = forward * np.sinc(turn / (2 * np.pi))
        self._pose = np.array([x + chord * np.cos(yaw + turn / 2), y + chord * np.sin(yaw + turn / 2), yaw + turn])
        pose, twist = message.pose.pose, message.twist.twist
        q = pose.orientation
        apart = np.array([pose.position.x, pose.position.y, 2 * np.arctan2(q.z, q.w)]) - self._pose
        apart[2] = np.remainder(apart[2] + np.pi, 2 * np.pi) - np.pi
        self._tally[POSE].measure(float(np.abs(apart).max()), at(raw))
        rates = np.array([forward, turn]) / ((self._stamp - self._last_stamp) / 1e9)
        self._tally[TWIST].measure(float(np.abs(rates - (twist.linear.x, twist.angular.z)).max()), at(raw))


class Commands(Checker):
    """Commands against the controller, which gets the fixes and the headings of the bag."""

    def __init__(self, context: Context) -> None:
        self._context, self._tally = context, context.tally(COMMANDS)
        self._imu, self._gnss = context.rig.imu, context.rig.gnss
        self._fixes, readings = (each.true_topic(each.topic) for each in (self._gnss, self._imu))
        self.topics = (readings, self._fixes, table.COMMANDS)
        self.tallies = [self._tally]
        self._heading: tuple[int, float] = (0, 0.0)
        self._follower: WaypointFollower | None = None
        experiment = context.experiment
        if experiment is None:
            return
        if not (self._imu.enabled and self._gnss.enabled):
            self._tally.skipped = "the IMU or the GNSS receiver that steers the robot is not enabled"
            return
        try:
            self._follower = WaypointFollower(geodetic_route(experiment.route).waypoints, experiment.control)
        except FieldtruthError:
            return  # a random route has no waypoints before it is planned, a track file has none
        context.motion.when_known(0, self._see_start)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message; at equal stamps, IMU and fix come before the command."""
        follower = self._follower
        if follower is None:
            return
        if raw.topic == self._fixes:
            follower.update_fix(message.latitude, message.longitude)
        elif raw.topic != table.COMMANDS:
            q = message.orientation
            world_from_imu = rotation_from_quaternion_wxyz(np.array([q.w, q.x, q.y, q.z]))
            base_from_imu = self._imu.mount.base_from_sensor[:3, :3]
            self._heading = raw.stamp_ns, float(yaw_from_rotation(world_from_imu @ base_from_imu.T))
        elif self._heading[0] == raw.stamp_ns:
            due, found = follower.command(self._heading[1]), (message.linear.x, message.angular.z)
            self._tally[COMMAND].measure(float(np.abs(np.subtract(due, found)).max()), at(raw))

    def _see_start(self) -> None:
        assert self._follower is not None
        state = self._context.motion.state(0)
        antenna = antenna_geodetic(state.position, state.quaternion_wxyz, self._gnss.mount)
        self._follower.update_fix(float(antenna[0]), float(antenna[1]))

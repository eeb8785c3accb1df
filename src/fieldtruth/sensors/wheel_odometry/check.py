# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of wheel encoders: joint states, wheel odometry, turning frames and speeds.

Wheel odometry is compared with the angles from which it is integrated, not with the true motion: its slip is real.
Tachometers are compared with the true motion. Wheels slip: up to 0.12 m/s and 0.18 rad/s were measured on rough ground
over drives of 268 and 515 s, and twice as much is tolerated.

Readings of real encoders are compared with the ideal ones beside them: laws within five standard deviations.
"""

import math
from typing import Any, Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import matrix
from fieldtruth.bag.messages import JOINTS, WHEEL_FRAMES, wheel_mounts, wheel_transforms
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.sensor_config import TRUTH
from fieldtruth.sensors.wheel_odometry.config import JOINT_STATES, WHEEL_SPEEDS, WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensing import advance
from fieldtruth.validation.check import SIGMAS, Rule, Spec
from fieldtruth.validation.context import Checker, Context, at
from fieldtruth.validation.kind_checks import KindChecks

COUNTS: Final = Rule("angles of the wheels are whole counts of their encoders", 1e-6, "counts")
RADII: Final = Rule("wheels turn by what their radii make of the true angles", SIGMAS, "deviations")
ROUNDING: Final = Rule("angles differ by at most a count from those of the true wheels", 1.0 + 1e-6, "counts")
WHEEL_NOISE: Final[Spec] = Spec("wheel noise", (COUNTS, RADII, ROUNDING), "readings", "no encoders with a signal")
_FINE: Final = 1e-9
"""Step [rad] for encoders without counts: rounding of the computer."""


class WheelNoise(Checker):
    """Encoders with a signal against the true angles of the wheels."""

    def __init__(self, context: Context) -> None:
        self._tally = context.tally(WHEEL_NOISE)
        self.tallies = [self._tally]
        config = next(iter(context.rig.enabled(WheelOdometryConfig)), None)
        self._signal = None if config is None else config.signal
        self.topics = () if self._signal is None else (JOINT_STATES, JOINT_STATES + TRUTH)
        self._angles: dict[str, dict[int, Array]] = {name: {} for name in self.topics}

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        self._angles[raw.topic][raw.stamp_ns] = np.array(message.position)

    def finish(self) -> None:
        """Compare the angles after the last message."""
        signal = self._signal
        if signal is None:
            return
        read, true = (self._angles[name] for name in self.topics)
        stamps = [stamp for stamp in sorted(read) if stamp in true]
        if not stamps:
            return
        angles, of_true = (np.array([part[stamp] for stamp in stamps]) for part in (read, true))
        count = signal.counts_per_revolution
        step = 2.0 * math.pi / count if count else _FINE
        if count:
            off = np.abs(angles / step - np.rint(angles / step)).max(axis=1)
            self._tally[COUNTS].measure_all(off, lambda k: f"{JOINT_STATES} at {stamps[k]} ns")
        far = np.abs(of_true).max(axis=0)
        ratio = np.sum(angles * of_true, axis=0) / np.maximum(np.sum(of_true**2, axis=0), 1e-300)
        order = np.hypot(signal.radius_error, 2.0 * step / np.maximum(far, step))
        self._tally[RADII].measure_all((ratio - 1.0) / order, lambda k: f"wheel {k}")
        off = np.abs(angles - ratio * of_true).max(axis=1) / step
        self._tally[ROUNDING].measure_all(off, lambda k: f"{JOINT_STATES} at {stamps[k]} ns")


POSE: Final = Rule("wheel odometry adds up what the wheels turn", 1e-9, "m or rad")
TWIST: Final = Rule("the twist of wheel odometry is its change", 1e-9, "m/s or rad/s")
FRAMES: Final = Rule("wheels in /tf have the angles of /joint_states", 1e-9, "m or of a rotation")
SPEEDS: Final = Rule("tachometers read the speeds of /joint_states", 1e-5, "rad/s")
_NO_JOINTS: Final = f"no {JOINT_STATES}"
ODOMETRY: Final[Spec] = Spec("wheel odometry", (POSE, TWIST, FRAMES, SPEEDS), "joint states", _NO_JOINTS)
SLIP: Final = Rule("both wheels of a side roll alike, and all as fast as the robot drives", 0.25, "m/s")
SKID: Final = Rule("the difference of the sides turns the robot", 0.4, "rad/s")
ROLLED: Final = Rule("wheels roll the length of the path and their slip, if it is over 2 m", 0.5, "of the length")
_NO_WHEELS: Final = "no tachometers of all four wheels, or no true motion"
WHEELS: Final[Spec] = Spec("wheels", (SLIP, SKID, ROLLED), "readings of four wheels", _NO_WHEELS)
_ROLLED_FROM: Final = 2.0
"""Shortest path [m] that is compared; in shorter ones, starting and turning have too large a share."""


class WheelOdometry(Checker):
    """Angles of the wheels in joint states, odometry, /tf and tachometers."""

    def __init__(self, context: Context) -> None:
        self._rig, self._tally = context.rig, context.tally(ODOMETRY)
        config = next(iter(context.rig.enabled(WheelOdometryConfig)), None)
        end = "" if config is None else config.true_topic("")
        self._topic, self._joint_states = "" if config is None else config.topic + end, JOINT_STATES + end
        self._speed_topics = tuple(name + end for name in WHEEL_SPEEDS[: len(self._rig.wheels.names)])
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
            true = wheel_transforms(wheel_mounts(self._rig), angles)
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


class Wheels(Checker):
    """Tachometers against the true motion, with wide tolerances, as wheels slip and skid."""

    def __init__(self, context: Context) -> None:
        config = next(iter(context.rig.enabled(WheelOdometryConfig)), None)
        names = WHEEL_SPEEDS if config is None else map(config.true_topic, WHEEL_SPEEDS)
        self.topics = [name for name in names if name in context.run.counts]
        self._motion, self._tally, self._wheels = context.motion, context.tally(WHEELS), context.rig.wheels
        self.tallies = [self._tally]
        self._speeds: dict[int, dict[str, float]] = {}
        self._rolled = self._driven = 0.0
        self._last: int | None = None

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        met = self._speeds.setdefault(raw.stamp_ns, {})
        met[raw.topic] = float(message.data)
        if len(met) == len(self.topics):
            speeds = np.array([met[name] for name in self.topics])
            del self._speeds[raw.stamp_ns]
            self._motion.when_known(raw.stamp_ns, lambda: self._compare(raw, speeds))
        elif len(self._speeds) > 100:
            self._speeds.pop(next(iter(self._speeds)))

    def finish(self) -> None:
        """Finish the checks after the last message."""
        self._tally.note = f"{self._rolled:.2f} m rolled, {self._driven:.2f} m driven"
        if self._driven > _ROLLED_FROM:
            self._tally[ROLLED].measure(self._rolled / self._driven - 1.0, self._tally.note)

    def _compare(self, raw: RawMessage, speeds: Array) -> None:
        state, wheels = self._motion.state(raw.stamp_ns), self._wheels
        base_from_world = transforms.rotation_from_quaternion_wxyz(state.quaternion_wxyz).T
        ahead = float((base_from_world @ state.linear_velocity)[0])
        turn = float((base_from_world @ state.angular_velocity)[2])
        sides = [speeds[side::2] * wheels.radius for side in (0, 1)]
        left, right = (float(side.mean()) for side in sides)
        # A skid-steered robot turns more slowly than its wheels suggest: see drive/physics.py.
        skid = 1.0 + (wheels.half_wheelbase / wheels.half_track) ** 2
        apart = max(float(np.ptp(side)) for side in sides)
        self._tally[SLIP].measure(max(apart, abs(ahead - (left + right) / 2)), at(raw))
        self._tally[SKID].measure(turn - (right - left) / (2 * wheels.half_track * skid), at(raw))
        seconds = 0.0 if self._last is None else (raw.stamp_ns - self._last) / 1e9
        self._rolled += seconds * (left + right) / 2
        self._driven += seconds * ahead
        self._last = raw.stamp_ns


CHECKS: Final = KindChecks(
    make=lambda shared: [Wheels(shared.context), WheelOdometry(shared.context), WheelNoise(shared.context)],
    motion=(WHEELS, ODOMETRY),
    signal=(WHEEL_NOISE,),
)

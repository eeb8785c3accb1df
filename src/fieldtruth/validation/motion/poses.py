# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""True poses: /gazebo/model_states, and the odometry and /tf that repeat them.

The physics steps velocity first and then the pose with the new velocity (semi-implicit Euler), so from one message to
the next the robot moves by ``v dt`` and turns by ``w dt`` exactly. The residual is rounding, 1e-14 m; the tolerance of
1e-9 leaves room for other mathematics libraries.
"""

from collections import Counter
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.base_messages import WHEEL_FRAMES
from fieldtruth.bag.model_states import ROBOT, ModelStatesReader
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import STEP_NS, Checker, Context, at
from fieldtruth.validation.window import is_attitude

STILL: Final = Rule("only the robot moves, and names do not change")
UNIQUE: Final = Rule("names are unique")
_NO_STATES: Final = f"no {table.MODEL_STATES} with a model {ROBOT!r}"
STATIC_OBJECTS: Final[Spec] = Spec("static objects", (STILL, UNIQUE), "messages", _NO_STATES)

UNIT: Final = Rule("attitudes are unit quaternions", 1e-9, "from length 1", minor=True)
# 10 ms of jitter in the stamps at several metres a second.
JUMPS: Final = Rule("the robot does not jump", 0.05, "m")
MOVES: Final = Rule("the robot moves by velocity times time step", 1e-9, "m")
TURNS: Final = Rule("the robot turns by turn rate times time step", 1e-9, "rad")
MOTION: Final[Spec] = Spec("motion", (UNIT, JUMPS, MOVES, TURNS), "messages", _NO_STATES)

ODOMETRY_POSE: Final = Rule("the pose of odometry is that of model states", 0.0, "m or of a quaternion")
TF_POSE: Final = Rule("the pose of /tf is that of model states", 0.0, "m or of a quaternion")
TWIST: Final = Rule("the twist of odometry is that of model states in base_link", 1e-9, "m/s or rad/s")
EXACT: Final = Rule("covariances of odometry are zero", minor=True)
_NO_PAIR: Final = "only one of /gazebo/model_states, /ground_truth/odom and /tf"
POSES: Final[Spec] = Spec("poses", (ODOMETRY_POSE, TF_POSE, TWIST, EXACT), "poses", _NO_PAIR)

_JUMP_NS: Final = 100_000_000
"""Longest time [ns] between messages over which jumps are checked."""
_BLOCK: Final = 500


class ModelStates(Checker):
    """Static objects and the motion of the robot in /gazebo/model_states."""

    topics = (table.STATIC_MODEL_STATES, table.MODEL_STATES)

    def __init__(self, context: Context) -> None:
        self._context = context
        self._reader = ModelStatesReader()
        self._static, self._motion = context.tally(STATIC_OBJECTS), context.tally(MOTION)
        if context.run.is_frames:
            self._motion.skipped = "separate frames: the robot does not move from one to the next"
        self.tallies = [self._static, self._motion]
        self._first: tuple[tuple[str, ...], Array] | None = None
        self._stamps: list[int] = []
        self._rows: list[Array] = []
        self._fresh = 0  # first row that no earlier block has checked
        self._length = 0.0

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        poses, twists, names = self._reader.poses(raw.data), self._reader.twists(raw.data), self._reader.names
        if not self._context.names:
            self._context.names = names
            twice = sorted(name for name, count in Counter(names).items() if count > 1)
            self._static[UNIQUE].see(not twice, f"{at(raw)}: {', '.join(twice)}")
        if raw.topic == table.STATIC_MODEL_STATES or ROBOT not in names:
            return
        row = names.index(ROBOT)
        others = np.concatenate([poses, twists], axis=1)
        state = others[row, [0, 1, 2, 6, 3, 4, 5, 7, 8, 9, 10, 11, 12]]
        others[row] = 0.0
        if self._first is None:
            self._first = names, others
        same = names == self._first[0] and np.array_equal(others, self._first[1])
        self._static[STILL].see(same, "" if same else f"{at(raw)}: {self._moved(names, others)}")
        self._context.motion.add(raw.stamp_ns, state)
        self._stamps.append(raw.stamp_ns)
        self._rows.append(state)
        if len(self._rows) > _BLOCK:
            self._check_motion()

    def finish(self) -> None:
        """Finish the checks after the last message."""
        self._check_motion()
        self._motion.note = f"{self._length:.2f} m driven"

    def _check_motion(self) -> None:
        """Check the collected rows; the last one begins the next block."""
        if len(self._rows) < 2:
            return
        stamps, rows, tally, fresh = np.array(self._stamps), np.array(self._rows), self._motion, self._fresh
        spans = np.diff(stamps)
        steps = np.flatnonzero(spans == STEP_NS)  # gaps are reported by the stamps
        near = np.flatnonzero(spans < _JUMP_NS)
        moved = np.linalg.norm(np.diff(rows[:, :3], axis=0) - spans[:, None] / 1e9 * rows[1:, 7:10], axis=1)
        length = np.linalg.norm(rows[fresh:, 3:7], axis=1)
        tally[UNIT].measure_all(length - 1.0, lambda k: _states_at(stamps[fresh + k]))
        tally[JUMPS].measure_all(moved[near], lambda k: f"after {_states_at(stamps[near[k]])}")
        tally[MOVES].measure_all(moved[steps], lambda k: _states_at(stamps[steps[k] + 1]))
        tally[TURNS].measure_all(_turn_residuals(rows, steps), lambda k: _states_at(stamps[steps[k] + 1]))
        self._length += float(np.linalg.norm(rows[-1, :3] - rows[0, :3]))
        del self._stamps[:-1], self._rows[:-1]
        self._fresh = 1

    def _moved(self, names: tuple[str, ...], others: Array) -> str:
        """Name what differs from the first message."""
        assert self._first is not None
        if names != self._first[0]:
            return "other names than in the first message"
        row, column = np.argwhere(~(others == self._first[1]))[0]
        return f"the {'pose' if column < 7 else 'twist'} of {names[row]!r} has changed"


def _turn_residuals(rows: Array, steps: NDArray[np.intp]) -> Array:
    """Angle [rad] between attitudes after some steps and those that follow from the turn rate; NaN without attitude."""
    before, after = rows[steps], rows[steps + 1]
    if not (len(steps) and np.isfinite(rows).all() and np.linalg.norm(rows[:, 3:7], axis=1).min() > 0.0):
        return np.full(len(steps), np.nan)
    turn = Rotation.from_quat(after[:, [4, 5, 6, 3]]) * Rotation.from_quat(before[:, [4, 5, 6, 3]]).inv()
    residuals: Array = np.linalg.norm(turn.as_rotvec() - STEP_NS / 1e9 * after[:, 10:], axis=1)
    return residuals


def _states_at(stamp_ns: int) -> str:
    return f"{table.MODEL_STATES} at {stamp_ns} ns"


class Poses(Checker):
    """/ground_truth/odom and /tf against /gazebo/model_states; without those, odometry is taken for the true motion."""

    def __init__(self, context: Context) -> None:
        self._motion, self._tally = context.motion, context.tally(POSES)
        self.tallies = [self._tally]
        self._has_states = table.MODEL_STATES in context.run.counts
        self.topics = [name for name in (table.ODOMETRY, table.TF) if name in context.run.counts]

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if raw.topic == table.TF:
            for each in message.transforms:
                if each.child_frame_id in WHEEL_FRAMES:
                    continue
                pose = _row(each.transform.translation, each.transform.rotation)
                self._motion.when_known(raw.stamp_ns, partial(self._compare, raw, pose, TF_POSE))
            return
        pose, twist = _row(message.pose.pose.position, message.pose.pose.orientation), message.twist.twist
        self._tally[EXACT].see(not (message.pose.covariance.any() or message.twist.covariance.any()), at(raw))
        velocities = np.array([[v.x, v.y, v.z] for v in (twist.linear, twist.angular)])
        if self._has_states:
            self._motion.when_known(raw.stamp_ns, lambda: self._compare(raw, pose, ODOMETRY_POSE, velocities))
        elif is_attitude(pose[3:]):
            rotated = velocities @ transforms.rotation_from_quaternion_wxyz(pose[3:]).T
            self._motion.add(raw.stamp_ns, np.concatenate([pose, rotated.ravel()]))

    def _compare(self, raw: RawMessage, pose: Array, rule: Rule, velocities: Array | None = None) -> None:
        state = self._motion.state(raw.stamp_ns)
        true = np.concatenate([state.position, state.quaternion_wxyz])
        self._tally[rule].measure(float(np.abs(pose - true).max()), at(raw))
        if velocities is not None:
            world_from_base = transforms.rotation_from_quaternion_wxyz(state.quaternion_wxyz)
            in_base = np.stack([state.linear_velocity, state.angular_velocity]) @ world_from_base
            self._tally[TWIST].measure(float(np.abs(velocities - in_base).max()), at(raw))


def _row(position: Any, q: Any) -> Array:
    return np.array([position.x, position.y, position.z, q.w, q.x, q.y, q.z])

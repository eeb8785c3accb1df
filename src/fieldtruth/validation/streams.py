# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The three streams of the true pose tell one story: /ground_truth/odom and /tf repeat /gazebo/model_states bit by bit.

Without /gazebo/model_states the odometry is the truth that everything else is held against.
"""

from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import frames
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.motion import is_attitude
from fieldtruth.validation.subject import Examiner, Subject, place_of

F8 = NDArray[np.float64]

TWIST_BOUND: Final = 1e-9
"""[m/s] and [rad/s]: turning a twist from world to base_link rounds at 1e-16 of a metre a second."""


class PoseStreams(Examiner):
    """/ground_truth/odom and /tf against /gazebo/model_states."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._has_states = table.MODEL_STATES in subject.run.counts
        self.topics = [name for name in (table.ODOMETRY, table.TF) if name in subject.run.counts]
        words = {table.ODOMETRY: "odometry", table.TF: "/tf"}
        self._same = {n: subject.law(f"the pose of {words[n]} is the true one, bit by bit", 0.0, "m or of a quaternion")
                      for n in self.topics}  # fmt: skip
        self._twist = subject.law("the twist of odometry is the true one in base_link", TWIST_BOUND, "m/s or rad/s")
        self._exact = subject.law("covariances are zero", minor=True)

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        if raw.topic == table.ODOMETRY:
            pose = _row(message.pose.pose.position, message.pose.pose.orientation)
            twist = message.twist.twist
            self._exact.see(not (message.pose.covariance.any() or message.twist.covariance.any()), place_of(raw))
            spoken = np.array([*_xyz(twist.linear), *_xyz(twist.angular)])
            if self._has_states:
                self._subject.motion.when_known(raw.stamp_ns, lambda: self._judge(raw, pose))
                self._subject.motion.when_known(raw.stamp_ns, lambda: self._judge_twist(raw, spoken))
            elif is_attitude(pose[3:]):
                rotation = frames.rotation_from_quaternion_wxyz(pose[3:])
                world = np.concatenate([rotation @ spoken[:3], rotation @ spoken[3:]])
                self._subject.motion.add(raw.stamp_ns, np.concatenate([pose, world]))
        else:
            for each in message.transforms:
                pose = _row(each.transform.translation, each.transform.rotation)
                self._subject.motion.when_known(raw.stamp_ns, partial(self._judge, raw, pose))

    def results(self) -> list[Check]:
        """Pose streams."""
        counts = ", ".join(f"{law.seen:,} poses of {name}" for name, law in self._same.items() if law.seen)
        return [
            check_of(
                "pose streams",
                [*self._same.values(), self._twist, self._exact],
                f"{counts} are the true ones bit by bit; twists differ by {self._twist.margin}",
                "there are not two of /gazebo/model_states, /ground_truth/odom and /tf",
            )
        ]

    def _judge(self, raw: RawMessage, pose: F8) -> None:
        state = self._subject.motion.state(raw.stamp_ns)
        true = np.concatenate([state.position, state.quaternion_wxyz])
        self._same[raw.topic].measure(float(np.abs(pose - true).max()), lambda: place_of(raw))

    def _judge_twist(self, raw: RawMessage, spoken: F8) -> None:
        state = self._subject.motion.state(raw.stamp_ns)
        base_from_world = frames.rotation_from_quaternion_wxyz(state.quaternion_wxyz).T
        true = np.concatenate([base_from_world @ state.linear_velocity, base_from_world @ state.angular_velocity])
        self._twist.measure(float(np.abs(spoken - true).max()), lambda: place_of(raw))


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _row(position: Any, q: Any) -> F8:
    return np.array([position.x, position.y, position.z, q.w, q.x, q.y, q.z])

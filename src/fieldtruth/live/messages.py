# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of the steps of a simulation: those of the bag, with the same types, topics, frames and bytes.

The clock comes at the end of each step, and the states of the models at the rate of the other poses, not at that of the
physics. /cmd_vel is not published: it is what is listened to.
"""

from collections.abc import Callable, Collection, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from fieldtruth.bag import messages, topics
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.drive.track import STEP_NS, Stamps, count_at_rate, stamps_at_rate
from fieldtruth.experiment.config import Experiment
from fieldtruth.simulation.stepped import DueReading, Simulation


class Message(NamedTuple):
    """A message as ROS 1 serialises it."""

    stamp_ns: int
    topic: str
    data: bytes


def outputs_wanted(experiment: Experiment, wanted: Collection[str]) -> list[str]:
    """Return the names of the sensors' outputs with a topic that is wanted."""
    rig = experiment.rig
    outputs = (output for config in rig.in_order() for output in config.outputs_on(rig.robot))
    return [output.name for output in outputs if any(topic.name in wanted for topic in output.topics)]


def messages_of(due: DueReading, wanted: Collection[str]) -> list[Message]:
    """Sense a reading, and return its messages that are wanted."""
    return [Message(due.at.stamp_ns, topic, data) for topic, data in due.messages() if topic in wanted]


class StepMessages:
    """Makes the messages of the steps of a simulation, whose world is built.

    Args:
        simulation: what is stepped.
        latched: whether static objects come once; None: as in a bag, by their number.
    """

    def __init__(self, simulation: Simulation, latched: bool | None = None) -> None:
        made, world = simulation.experiment, simulation.world
        self._simulation, self._wheels = simulation, messages.wheel_mounts(made.rig)
        self.latched = topics.latches_objects(made, len(world.instances)) if latched is None else latched
        found = topics.topics_of_run(made, latched=self.latched)
        self.topics = tuple(topic for topic in found if topic.name != topics.COMMANDS)
        """What is published."""
        self._objects = messages.ModelStatesWriter(world) if self.latched else None
        self._states = messages.ModelStatesWriter(world, rows=GROUND_ID + 1 if self.latched else None)
        self._fixed = messages.fixed_transforms(made.rig, world.origin)

    def of(self, since_ns: int, due: Iterable[DueReading], wanted: Collection[str]) -> Iterator[Message]:
        """Yield the messages of a step since a stamp [ns], in time order behind the clock, of topics that are wanted.

        What is latched comes with the first step, also if it is not wanted yet.

        Args:
            since_ns: where the step began.
            due: the readings of the step that need no rays.
            wanted: topics.
        """
        reached_ns = round(self._simulation.seconds * 1e9)
        yield Message(reached_ns, topics.CLOCK, messages.clocks(np.array([reached_ns]))[0])
        if not since_ns:
            yield from self._latched()
        sensed = (message for each in due for message in messages_of(each, wanted))
        yield from sorted([*self._truth(reached_ns, since_ns, wanted), *sensed], key=lambda message: message.stamp_ns)

    def _latched(self) -> Iterator[Message]:
        yield Message(STEP_NS, topics.TF_STATIC, messages.tf_static(STEP_NS, self._fixed))
        if self._objects is not None:
            data = self._objects.message(0, self._simulation.track.motion)
            yield Message(STEP_NS, topics.STATIC_MODEL_STATES, data)

    def _truth(self, reached_ns: int, since_ns: int, wanted: Collection[str]) -> Iterator[Message]:
        stamps = stamps_at_rate(topics.POSE_RATE, reached_ns, since_ns)
        track = self._simulation.track
        rows = np.searchsorted(track.motion.stamps_ns, stamps)
        motion = track.motion.at(rows)
        numbers: Stamps = count_at_rate(topics.POSE_RATE, since_ns) + np.arange(len(stamps))
        made: dict[str, Callable[[], list[bytes]]] = {
            topics.MODEL_STATES: lambda: [self._states.message(k, motion) for k in range(len(stamps))],
            topics.ODOMETRY: lambda: messages.odometry(numbers, motion),
            topics.TF: lambda: messages.tf(
                numbers,
                motion,
                {} if track.base is None else messages.wheel_transforms(self._wheels, track.base.wheels.angle[rows]),
            ),
        }
        for topic in (topic for topic in made if topic in wanted):
            for stamp, data in zip(stamps.tolist(), made[topic](), strict=True):
                yield Message(stamp, topic, data)

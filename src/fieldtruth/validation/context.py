# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""State that the checks share during the pass over the bag: the run, its world, the latest true motion, and samples."""

import heapq
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import StaticFrames
from fieldtruth.bag.messages import WORLD
from fieldtruth.bag.movers import Movers
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import STATIC_MODEL_STATES, topics_of, topics_of_run
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin, origin_of_world
from fieldtruth.drive.track import Motion, State, state_at
from fieldtruth.experiment.actor_config import LABELS, actor_names
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.validation.check import Spec, Tally

KEPT: Final = 4096
"""Rows that are kept at least: four seconds at 1 kHz."""


def is_attitude(quaternion: Array) -> bool:
    """Return whether four numbers can be normalised to a unit quaternion."""
    return bool(0.5 < np.linalg.norm(quaternion) < 2.0)


class MotionWindow:
    """True motion, to which rows are added in time order."""

    def __init__(self) -> None:
        self._stamps: NDArray[np.int64] = np.zeros(2 * KEPT, np.int64)
        self._rows = np.zeros((2 * KEPT, 13))
        self._count = 0
        self._waiting: list[tuple[int, int, Callable[[], None]]] = []
        self._asked = 0
        self._over = False

    @property
    def started(self) -> bool:
        """True if there is any motion."""
        return self._count > 0

    def add(self, stamp_ns: int, row: Array) -> None:
        """Add a row: position (3) [m], quaternion wxyz (4), linear (3) [m/s] and angular velocity (3) [rad/s].

        All of base_link in the world frame. A row that is not later than the one before, or without an attitude, is
        left out; the check of its own stream reports it.
        """
        if (self._count and stamp_ns <= self._stamps[self._count - 1]) or not is_attitude(row[3:7]):
            return
        if self._count == len(self._stamps):
            self._stamps[:KEPT], self._rows[:KEPT] = self._stamps[KEPT:].copy(), self._rows[KEPT:].copy()
            self._count = KEPT
        self._stamps[self._count], self._rows[self._count] = stamp_ns, row
        self._count += 1
        self._run_waiting(stamp_ns)

    def finish(self) -> None:
        """Declare that no more rows will come."""
        self._over = True
        if self.started:
            self._run_waiting(None)

    def when_known(self, stamp_ns: int, action: Callable[[], None]) -> None:
        """Call ``action`` once the motion is known up to a stamp [ns], or is over; never if there is no motion."""
        if self.started and (self._over or stamp_ns <= self._stamps[self._count - 1]):
            action()
        elif not self._over:
            self._asked += 1
            heapq.heappush(self._waiting, (stamp_ns, self._asked, action))

    def state(self, stamp_ns: int) -> State:
        """State at a stamp [ns], interpolated between rows. It is only valid until the next row is added."""
        return state_at(self.motion, stamp_ns)

    def row(self, stamp_ns: int) -> int | None:
        """Index of the row with exactly this stamp, counted from the oldest that is kept."""
        k = int(np.searchsorted(self._stamps[: self._count], stamp_ns))
        return k if k < self._count and self._stamps[k] == stamp_ns else None

    @property
    def motion(self) -> Motion:
        """The rows that are kept; only valid until the next row is added."""
        rows = self._rows[: self._count]
        return Motion(
            stamps_ns=self._stamps[: self._count],
            position=rows[:, :3],
            quaternion_wxyz=rows[:, 3:7],
            linear_velocity=rows[:, 7:10],
            angular_velocity=rows[:, 10:],
        )

    def _run_waiting(self, stamp_ns: int | None) -> None:
        while self._waiting and (stamp_ns is None or self._waiting[0][0] <= stamp_ns):
            heapq.heappop(self._waiting)[2]()


STEP_NS: Final = 1_000_000
"""Time step [ns] of the physics, at which sensors of the robot's own motion read."""


@dataclass
class Context:
    """The run and the data read from it so far."""

    run: Run
    rebuilt: SensorWorld | None = None
    """The world of the run, built again; None if it was not."""
    no_world: str = ""
    """The reason why the world was not rebuilt."""
    made_elsewhere: str = ""
    """The reason why readings may differ in last digits from those that this process makes; empty if they may not."""
    motion: MotionWindow = field(default_factory=MotionWindow)
    parents: dict[str, tuple[str, Array]] = field(default_factory=dict)
    """Fixed frames of /tf_static: parent and parent_from_child (4, 4) by child."""
    names: tuple[str, ...] = ()
    """Objects of ``objects_topic``; the row is the object's id."""
    jobs: deque[Callable[[], Sequence[Tally]]] = field(default_factory=deque)
    """Work for threads, in order; each job returns the partial tallies that it has filled."""

    @property
    def origin(self) -> Origin:
        """Origin of the world's frame: of the world, or of the bag; before its /tf_static without height."""
        if self.rebuilt is not None:
            return self.rebuilt.world.origin
        _, pose = self.parents.get(WORLD, ("", None))
        if pose is not None:
            return origin_of_world(pose)
        return PAPER_ORIGIN if self.experiment is None else self.experiment.origin

    @property
    def experiment(self) -> Experiment | None:
        """Experiment of the run; None for a bag from elsewhere."""
        return self.run.experiment

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots of an experiment with several."""
        return () if self.experiment is None else tuple(self.experiment.robots)

    @cached_property
    def movers(self) -> Movers:
        """What moves beside the robot; nothing if the bag lacks it, which other checks report."""
        try:
            return self.run.movers
        except BagError:
            return Movers()

    @property
    def actors(self) -> tuple[str, ...]:
        """Names of the actors of the experiment."""
        return () if self.experiment is None else tuple(name for name, _ in actor_names(self.experiment.actors))

    @cached_property
    def moving(self) -> Mapping[str, tuple[Label, ...]]:
        """Classes of all that may move, beside the robot in the first row, by name."""
        robots = dict.fromkeys(self.robots, (Label.ROBOT,))
        given = {} if self.experiment is None else self.experiment.actors
        return robots | {name: LABELS[given[key].kind] for name, key in actor_names(given)}

    @property
    def rig(self) -> Rig:
        """Rig of the run; of a bag from elsewhere the paper's."""
        return self.run.rig

    @property
    def has_weather(self) -> bool:
        """True if there is something in the air of the run."""
        return self.experiment is not None and not self.experiment.weather.is_clear

    @property
    def topics(self) -> tuple[Topic, ...]:
        """Topics that the rig publishes, with the rates of this run; of a bag from elsewhere all that are known."""
        if self.experiment is None:
            return topics_of(self.rig, latched=True)
        latched = self.experiment.static_objects == "latched" or STATIC_MODEL_STATES in self.run.counts
        return topics_of_run(self.experiment, latched=latched)

    @property
    def frames(self) -> StaticFrames:
        """Fixed frames read so far."""
        return StaticFrames(self.parents, str(self.run.bag))

    def tally(self, spec: Spec) -> Tally:
        """Return an empty tally of a check, strict if the run's experiment is known."""
        return Tally(spec, strict=self.experiment is not None)


class Checker:
    """A group of checks, which sees the messages of ``topics`` in time order."""

    topics: Sequence[str] = ()
    tallies: Sequence[Tally] = ()

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message, decoded except on /clock and of model states (None), which are too many."""

    def finish(self) -> None:
        """Finish the checks after the last message."""


def at(raw: RawMessage) -> str:
    """Topic and stamp of a message, for messages."""
    return f"{raw.topic} at {raw.stamp_ns} ns"


class Sampler:
    """Chooses about ``count`` stamps of each sensor, evenly over a run's time [ns]; calls must be in time order."""

    def __init__(self, start_ns: int, end_ns: int, count: int) -> None:
        self._start, self._period = start_ns, max(1, (end_ns - start_ns) // max(1, count))
        self._due: dict[tuple[str, ...], int] = {}
        self._chosen: dict[tuple[str, ...], set[int]] = {}

    def takes(self, stamp_ns: int, *sensors: str) -> bool:
        """Return whether a stamp of these sensors is chosen; repeated calls with a stamp give the same result."""
        chosen, due = self._chosen.setdefault(sensors, set()), self._due.get(sensors, self._start)
        if stamp_ns not in chosen and stamp_ns >= due:
            chosen.add(stamp_ns)
            self._due[sensors] = due + self._period * ((stamp_ns - due) // self._period + 1)
        return stamp_ns in chosen

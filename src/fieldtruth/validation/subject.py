# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What is checked, and what the checks share while the bag passes by."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from fieldtruth.bag.calibration import StaticFrames
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.run import Run
from fieldtruth.bag.types import F8
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.render.bake import BakedScene
from fieldtruth.sense.scene import Scene
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import Law
from fieldtruth.validation.motion import MotionWindow
from fieldtruth.world.model import World

STEP_NS: Final = 1_000_000
"""[ns] of the physics, in which IMU, receiver and tachometers read."""


@dataclass(frozen=True)
class Place:
    """The world of a run, built again, and its ray scene."""

    world: World
    scene: Scene
    baked: BakedScene | None  # if the bag has photographs


@dataclass
class Subject:
    """A run under examination."""

    run: Run
    place: Place | None
    """None where the world cannot be built again, or need not."""
    no_place: str
    """Why there is no place."""
    motion: MotionWindow = field(default_factory=MotionWindow)
    """True motion of the robot, up to where the bag was read."""
    parents: dict[str, tuple[str, F8]] = field(default_factory=dict)
    """Fixed frames, as /tf_static has them: parent and parent_from_child by child."""
    names: tuple[str, ...] = ()
    """Objects in /gazebo/model_states; the row is the object's id."""
    jobs: deque["Job"] = field(default_factory=deque)
    """Work for the threads, in order."""

    @property
    def experiment(self) -> Experiment | None:
        """What made the run; None for a bag from elsewhere."""
        return self.run.experiment

    @property
    def binding(self) -> bool:
        """Whether the run says what made it, so that it is known which laws hold."""
        return self.experiment is not None

    @property
    def rig(self) -> Rig:
        """The robot that made the run, or, if that is not known, the one that this package has by default."""
        return Rig() if self.experiment is None else self.experiment.rig

    @property
    def frames(self) -> StaticFrames:
        """Fixed frames read so far."""
        return StaticFrames(self.parents, str(self.run.bag))

    def law(self, rule: str, bound: float | None = None, unit: str = "", *, minor: bool = False) -> Law:
        """Make a law that binds if the run says what made it."""
        return Law(rule, bound, unit, binding=self.binding, minor=minor)

    def submit(self, work: Callable[[], Any], fold: Callable[[Any], None]) -> None:
        """Let a thread do ``work``; ``fold`` gets its result here, in the order of submission."""
        self.jobs.append(Job(work, fold))


@dataclass(frozen=True)
class Job:
    """Work for a thread, and what is done with its result."""

    work: Callable[[], Any]
    fold: Callable[[Any], None]


class Examiner:
    """A group of checks. It sees the messages of ``topics`` as they pass by, in time order."""

    topics: Sequence[str] = ()

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message; ``message`` is None for /clock and /gazebo/model_states, which are too many to unpack."""

    def finish(self) -> None:
        """See the end of the bag."""

    def results(self) -> list[Check]:
        """Say what came of it."""
        raise NotImplementedError


def place_of(raw: RawMessage) -> str:
    """Where a message is, in words."""
    return f"{raw.topic} at {raw.stamp_ns} ns"

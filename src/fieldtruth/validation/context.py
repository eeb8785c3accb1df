# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""State that the checks share during the pass over the bag."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from fieldtruth.bag.geometry import StaticFrames
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import STATIC_MODEL_STATES, topics_of, topics_of_run
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.topic import Topic
from fieldtruth.render.bake import BakedScene
from fieldtruth.sense.scene import Scene
from fieldtruth.validation.check import Spec, Tally
from fieldtruth.validation.window import MotionWindow
from fieldtruth.world.model import World

STEP_NS: Final = 1_000_000
"""Time step [ns] of the physics, at which IMU, GNSS receiver and tachometers read."""


class RebuiltWorld(NamedTuple):
    """The rebuilt world of a run and its ray scene; baked if photographs are rendered."""

    world: World
    scene: Scene
    baked: BakedScene | None


@dataclass
class Context:
    """The run and the data read from it so far."""

    run: Run
    rebuilt: RebuiltWorld | None = None
    no_world: str = ""
    """Why the world was not rebuilt."""
    made_elsewhere: str = ""
    """Why readings need not be equal to the last digit to those that this process makes; empty if they must be."""
    motion: MotionWindow = field(default_factory=MotionWindow)
    parents: dict[str, tuple[str, Array]] = field(default_factory=dict)
    """Fixed frames of /tf_static: parent and parent_from_child (4, 4) by child."""
    names: tuple[str, ...] = ()
    """Objects of ``objects_topic``; the row is the object's id."""
    jobs: deque[Callable[[], Sequence[Tally]]] = field(default_factory=deque)
    """Work for threads, in order; each job returns the partial tallies that it has filled."""

    @property
    def experiment(self) -> Experiment | None:
        """Experiment of the run; None for a bag from elsewhere."""
        return self.run.experiment

    @property
    def rig(self) -> Rig:
        """Rig of the run; of a bag from elsewhere the paper's."""
        return self.run.rig

    @property
    def has_weather(self) -> bool:
        """Whether there is something in the air of the run."""
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

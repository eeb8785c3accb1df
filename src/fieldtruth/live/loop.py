# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The loop of a live simulation: step, send, and wait for the wall clock.

If that takes longer than its share of the wall clock, simulated time is slower: no reading that is subscribed to is
left out. What is not subscribed to is not sensed. Threads trace rays while the robot drives on, until the next reading
of the same output is due: a cloud or an image arrives as long after its stamp as that takes, as from real drivers.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final

from fieldtruth.core.errors import ConfigurationError, DriveError, FieldtruthError
from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.live.commands import Inbox, Pause, Request, Reset, Step
from fieldtruth.live.messages import Message, StepMessages, messages_of, outputs_wanted
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.world.model import World

STEP_S: Final = 0.02
"""Simulated time [s] of a step, the period of /tf: a command waits at most so long."""
_NEARLY_S: Final = 0.0006
"""Simulated time [s] before the end of a step that is too short for one of the physics."""
_IDLE_S: Final = 0.01
"""Wall clock [s] between two looks for commands in a pause."""
_CATCH_UP_S: Final = 0.2
"""Wall clock [s] by which simulated time may be late and still catch up."""
_SCREEN_S: Final = 1.0
LOOPBACK: Final = "127.0.0.1"
"""Where sinks listen by default: only this machine reaches them."""


class Sink(ABC):
    """What messages go to and commands come from: a server, or a node of ROS. It is open from the start."""

    where: str
    """Where it listens and who can reach it, for the first line on the screen."""

    @abstractmethod
    def advertise(self, topics: Sequence[Topic]) -> None:
        """Say what will be sent; called once."""

    def show(self, world: World, rig: Rig) -> None:  # noqa: B027 most have nothing to show
        """Show the world and the robot, where that is not done by messages; called when time begins anew."""

    @abstractmethod
    def wants(self, topic: str) -> bool:
        """Return whether anybody listens to a topic."""

    @abstractmethod
    def send(self, message: Message) -> None:
        """Send a message; of a latched topic it is kept for those who listen later."""

    def poll(self) -> None:  # noqa: B027 most are called
        """Look for commands that have arrived; called often, also in pauses."""

    def is_commanded(self) -> bool:
        """Return whether a publisher of commands is connected; True where that cannot be known."""
        return True

    @abstractmethod
    def close(self) -> None:
        """End in order."""


class Pace:
    """Holds simulated time back to a rate, and measures its factor of real time.

    Args:
        rate: simulated seconds in a second; 0 for as fast as it goes.
    """

    def __init__(self, rate: float) -> None:
        self.rate, self.factor = rate, 0.0
        """``factor``: simulated time by wall clock, over the last second."""
        self.begin(0.0)

    def begin(self, now_s: float) -> None:
        """Go on from a simulated time [s] now."""
        wall = time.monotonic()
        self._origin, self._seen = (now_s, wall), (now_s, wall)

    def wait(self, now_s: float) -> bool:
        """Wait until a simulated time [s] is due; return whether the factor is new."""
        if self.rate:
            began_s, wall = self._origin
            late_s = time.monotonic() - (wall + (now_s - began_s) / self.rate)
            if late_s < 0.0:
                time.sleep(-late_s)
            elif late_s > _CATCH_UP_S:
                self._origin = began_s, wall + late_s
        since, (seen_s, wall) = time.monotonic(), self._seen
        if since - wall < _SCREEN_S:
            return False
        self.factor, self._seen = (now_s - seen_s) / (since - wall), (now_s, since)
        return True


class Live:
    """A simulation that runs until Ctrl-C, or the end of its experiment.

    Args:
        simulation: without a last waypoint, at which it would end.
        sink: gets the messages.
        inbox: has the commands.
        rate: as in ``Pace``.
        say: prints a line.
    """

    def __init__(
        self, simulation: Simulation, sink: Sink, inbox: Inbox, rate: float, say: Callable[[str], None]
    ) -> None:
        self._simulation, self._sink, self._inbox, self._say = simulation, sink, inbox, say
        self._pool, self._sensing = ThreadPoolExecutor(cpu_count()), dict[str, Future[list[Message]]]()
        self.pace, self._paused, self._until_s = Pace(rate), False, 0.0  # [s]: a pause begins, or began, at that time
        simulation.endless = True
        simulation.reset()
        simulation.prepare()
        self._messages = StepMessages(simulation)
        sink.advertise(self._messages.topics)
        sink.show(simulation.world, simulation.experiment.rig)

    @property
    def state(self) -> str:
        """What is going on, for the screen."""
        now = self._simulation.seconds
        driver = "paused" if self._paused else "follower" if self._inbox.command(now) is None else "commanded"
        return f"{now:.1f} s simulated, {self.pace.factor:.2f} of real time, {driver}"

    def run(self, show: Callable[[str], None]) -> None:
        """Run to the end of the experiment; ``show`` gets the state once a second."""
        self.pace.begin(self._simulation.seconds)
        while True:
            self._sink.poll()
            for request, answer in self._inbox.requests():
                self._answer(request, answer)
            now = self._simulation.seconds
            if self._simulation.done or (self._paused and now > self._until_s - _NEARLY_S):
                self._finish()
                if self._simulation.done and not self._simulation.failed:
                    return
                time.sleep(_IDLE_S)
                self.pace.begin(now)
                continue
            self._step(min(STEP_S, self._until_s - now) if self._paused else STEP_S)
            if self.pace.wait(self._simulation.seconds):
                show(self.state)

    def _step(self, seconds: float) -> None:
        made = self._simulation
        wanted = {topic.name for topic in self._messages.topics if self._sink.wants(topic.name)}
        command = None if made.track_file is not None else self._inbox.command(made.seconds)
        since_ns = round(made.seconds * 1e9)
        try:
            due = made.due(seconds, command, sensors=outputs_wanted(made.experiment, wanted))
        except DriveError as error:
            self._say(str(error))
            return
        for message in self._messages.of(since_ns, (each for each in due if each.known is not None), wanted):
            self._sink.send(message)
        for each in due:
            if each.known is None:
                self._send_sensed(each.output.name)
                self._sensing[each.output.name] = self._pool.submit(messages_of, each, wanted)
        for name in [name for name, sensing in self._sensing.items() if sensing.done()]:
            self._send_sensed(name)

    def _send_sensed(self, name: str) -> None:
        """Send the last reading of an output, for which simulated time waits, if it is not sent yet."""
        if name in self._sensing:
            for message in self._sensing.pop(name).result():
                self._sink.send(message)

    def _finish(self) -> None:
        """Send what is being sensed."""
        for name in [*self._sensing]:
            self._send_sensed(name)

    def _answer(self, request: Request, answer: "Future[str]") -> None:
        try:
            answer.set_result(self._done(request))
        except FieldtruthError as error:
            self._say(str(error))
            answer.set_exception(error)

    def _done(self, request: Request) -> str:
        """Do what is asked, and say so."""
        made = self._simulation
        if isinstance(request, Reset):
            self._reset(request)
            return f"reset, seed {made.experiment.seed}"
        if made.failed:
            raise ConfigurationError("the drive has ended; reset begins another")
        if isinstance(request, Step):
            self._paused, self._until_s = True, max(self._until_s * self._paused, made.seconds) + request.seconds
            return f"steps to {self._until_s:.3f} s"
        assert isinstance(request, Pause)
        self._paused, self._until_s = request.paused, made.seconds
        return f"{'paused' if request.paused else 'goes on'} at {made.seconds:.3f} s"

    def _reset(self, request: Reset) -> None:
        self._finish()
        made, seed = self._simulation, self._simulation.experiment.seed
        try:
            made.reset(request.seed, request.start)
        except FieldtruthError:
            if made.experiment.seed != seed:  # else the drive goes on
                made.reset(seed)
                self._begin()
            raise
        self._begin()

    def _begin(self) -> None:
        """Go on at time 0, maybe in another world."""
        made = self._simulation
        made.prepare()
        self._inbox.forget()
        self._until_s, self._messages = 0.0, StepMessages(made, self._messages.latched)
        self._sink.show(made.world, made.experiment.rig)
        self.pace.begin(0.0)

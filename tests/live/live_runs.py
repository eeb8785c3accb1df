# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Live simulations in a thread, with a rig of every kind of sensor in a small world."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from stepped_rigs import SCENE, experiment

import fieldtruth as ft
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.live.commands import Inbox
from fieldtruth.live.loop import Live, Sink
from fieldtruth.live.messages import Message


class Recorder(Sink):
    """Keeps what is sent of the topics that it wants; None: of all."""

    where = "here"

    def __init__(self, wanted: set[str] | None = None) -> None:
        self.wanted, self.messages, self.shown = wanted, list[Message](), 0
        self.topics: Sequence[Topic] = ()

    def advertise(self, topics: Sequence[Topic]) -> None:
        self.topics = topics

    def show(self, world: object, rig: object) -> None:
        self.shown += 1

    def wants(self, topic: str) -> bool:
        return self.wanted is None or topic in self.wanted

    def send(self, message: Message) -> None:
        self.messages.append(message)

    def close(self) -> None:
        """Do nothing."""


class Run(NamedTuple):
    """A live simulation that runs, and the lines that it prints."""

    live: Live
    inbox: Inbox
    simulation: ft.Simulation
    lines: list[str]


class _StoppedError(Exception):
    pass


def simulation_of(made: ft.Experiment) -> ft.Simulation:
    return ft.Simulation(made, scene=SCENE)


@contextmanager
def running(
    connect: Callable[[Inbox], Sink], made: ft.Experiment | None = None, *, rate: float = 1.0
) -> Iterator[tuple[Sink, Run]]:
    """Run an experiment, by default without an end, until the context ends; what the loop raises is raised there."""
    made = experiment().model_copy(update={"seconds": None}) if made is None else made
    lines, stop, failed = list[str](), threading.Event(), list[BaseException]()
    inbox = Inbox(made.rig.robot, lines.append)
    sink, simulation = connect(inbox), simulation_of(made)
    poll = sink.poll

    def poll_or_stop() -> None:
        if stop.is_set():
            raise _StoppedError
        poll()

    sink.poll = poll_or_stop  # type: ignore[method-assign]
    live = Live(simulation, sink, inbox, rate, lines.append)

    def work() -> None:
        try:
            live.run(lambda state: None)
        except _StoppedError:
            pass
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield sink, Run(live, inbox, simulation, lines)
    finally:
        stop.set()
        thread.join(20.0)
        sink.close()
    assert not thread.is_alive()
    if failed:
        raise failed[0]


def wait_for(condition: Callable[[], object], seconds: float = 20.0) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)

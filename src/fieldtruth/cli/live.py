# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sub-command live: an experiment that runs for ROS 2, ROS 1, Foxglove or rerun until Ctrl-C."""

import argparse
import ipaddress
import math
import sys
import time
from contextlib import closing, suppress
from typing import TYPE_CHECKING, Final

from fieldtruth.cli.arguments import UsageError, changes
from fieldtruth.cli.generation import checked_experiment
from fieldtruth.cli.terminal import print_line
from fieldtruth.core.progress import show_progress

if TYPE_CHECKING:
    from fieldtruth.live.commands import Inbox
    from fieldtruth.live.loop import Sink

_MOST_RATE: Final = 1000.0
_LINES_APART_S: Final = 10.0


def _live(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.files import with_overrides

    _check(options)
    options.extras = None
    experiment = with_overrides(checked_experiment(options.experiment), **changes(options))
    if experiment.frames is not None:
        raise UsageError(f"{experiment.name} makes separate frames; live needs a route or a track file")
    # After the checks: compiled kernels and physics take a second to load.
    from fieldtruth.live.commands import Inbox
    from fieldtruth.live.loop import Live
    from fieldtruth.simulation.stepped import Simulation

    simulation = Simulation(experiment)
    inbox = Inbox(experiment.rig.robot, print_line)
    with closing(sink_of(options, inbox)) as sink:
        print_line(f"{experiment.name} at {sink.where}; Ctrl-C ends it")
        with show_progress() as progress, progress.stage("build the world"):
            live = Live(simulation, sink, inbox, options.rate, print_line)
        with suppress(KeyboardInterrupt):
            live.run(_Screen())
        print_line(f"ended: {live.state}")


class _Screen:
    """Shows what is going on: on a terminal in one line, in a log file now and then."""

    def __init__(self) -> None:
        self._due_s = 0.0

    def __call__(self, state: str) -> None:
        if sys.stderr.isatty():
            print(f"\r{state:<78}", end="\r", file=sys.stderr, flush=True)
        elif time.monotonic() >= self._due_s:
            self._due_s = time.monotonic() + _LINES_APART_S
            print(state, file=sys.stderr, flush=True)


def _check(options: argparse.Namespace) -> None:
    if not (options.ros2 or options.ros1 or options.foxglove or options.rerun):
        raise UsageError("give one of --ros2, --ros1, --foxglove and --rerun")
    check_pace_and_host(options)
    if options.seconds is not None and not math.isfinite(options.seconds):
        raise UsageError(f"--seconds must be finite, got {options.seconds:g}")
    if options.port is not None and options.port > 65535:
        raise UsageError(f"--port must be from 1 to 65535, got {options.port}")


def check_pace_and_host(options: argparse.Namespace) -> None:
    """Raise UsageError if --rate or --host has a value that is not allowed."""
    if not 0.0 <= options.rate <= _MOST_RATE:  # also false for nan
        raise UsageError(f"--rate must be from 0 to {_MOST_RATE:g}, got {options.rate:g}")
    try:
        ipaddress.IPv4Address(options.host)
    except ValueError:
        raise UsageError(f"--host must be an IPv4 address of this machine, got {options.host!r}") from None


def sink_of(options: argparse.Namespace, inbox: "Inbox") -> "Sink":
    """Return what --ros2, --ros1, --foxglove or --rerun says."""
    if options.ros2:
        from fieldtruth.live.ros2 import Ros2Sink

        return Ros2Sink(inbox, options.host)
    if options.ros1:
        from fieldtruth.live.ros1 import Ros1Sink

        return Ros1Sink(inbox, options.host)
    port = {} if options.port is None else {"port": options.port}
    if options.rerun:
        from fieldtruth.live.rerun import RerunSink

        return RerunSink(options.host, **port)
    from fieldtruth.live.foxglove import FoxgloveSink

    return FoxgloveSink(inbox, options.host, **port)


COMMANDS: Final = {"live": _live}
"""Sub-commands by name."""

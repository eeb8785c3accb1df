# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Factor of real time of live simulations, as fast as they go: LiDAR and IMU alone, a small stereo pair, the whole rig.

``python benchmarks/live.py [EXPERIMENT ...]``; by default the first experiment of each of the paper's environments.
Messages are made and counted, but not sent. Run nothing else meanwhile.
"""

import sys
import time
from collections.abc import Sequence

from fieldtruth.bag.topics import CLOCK, TF, topics_of
from fieldtruth.core.readings import Cloud, Inertial
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, validated
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.live.commands import Inbox
from fieldtruth.live.loop import Live, Sink
from fieldtruth.live.messages import Message
from fieldtruth.simulation.stepped import Simulation

SECONDS, SECONDS_OF_ALL = 15.0, 2.0
"""Simulated time [s]; images of the whole rig take minutes."""
PAIR = {"cameras": {"width": 640, "height": 360, "rate_hz": 5.0}}


class Counter(Sink):
    """Wants some topics, and counts the bytes of their messages."""

    where = "-"

    def __init__(self, wanted: set[str]) -> None:
        self.wanted, self.bytes = wanted, 0

    def advertise(self, topics: Sequence[Topic]) -> None:
        """Do nothing."""

    def wants(self, topic: str) -> bool:
        return topic in self.wanted

    def send(self, message: Message) -> None:
        self.bytes += len(message.data)

    def close(self) -> None:
        """Do nothing."""


def factor(made: Experiment, wanted: set[str], seconds: float) -> tuple[float, float]:
    """Return the factor of real time, after the first second, and megabytes per simulated second."""
    made = made.model_copy(update={"seconds": seconds})
    counter, begun = Counter(wanted), list[tuple[float, float]]()
    simulation = Simulation(made)
    live = Live(simulation, counter, Inbox(made.rig.robot, print), 0.0, print)
    live.run(lambda state: begun.append((simulation.seconds, time.monotonic())))
    simulated, wall = begun[0] if begun else (0.0, time.monotonic())
    return (seconds - simulated) / (time.monotonic() - wall), counter.bytes / seconds / 1e6


def main() -> None:
    for name in sys.argv[1:] or ["park_1", "lake_1", "forest_1", "hillside_1"]:
        made = load_experiment(name)
        rig = made.rig
        few = {CLOCK, TF}
        for config in rig.in_order():
            if issubclass(config.gives, Cloud | Inertial):
                few |= {topic.name for topic in config.topics()}
        everything = {topic.name for topic in topics_of(rig)}
        small = validated(made.model_dump() | {"rig": PAIR}, "")
        rows = [("LiDAR and IMU", made, few), ("pair 640 x 360, 5 Hz", small, everything), ("all", made, everything)]
        for what, experiment, wanted in rows:
            speed, megabytes = factor(experiment, wanted, SECONDS_OF_ALL if what == "all" else SECONDS)
            print(f"{name:<12} {what:<22} {speed:5.2f} of real time, {megabytes:6.1f} MB/s simulated", flush=True)


if __name__ == "__main__":
    main()

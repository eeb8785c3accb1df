# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A bag and its description: that of the folder that ``generate`` made, or any bag with the same topics."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fieldtruth.bag.file import BagError, first_bytes
from fieldtruth.bag.ros2 import is_database
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.sensor_config import TRUTH

EXPERIMENT: str = "experiment.yaml"
"""The experiment beside a bag."""
CARD: str = "DATASET.md"
"""The data card beside a bag."""
MADE_BY: str = "made_by.json"
"""What made the readings beside a bag; see ``made_by``."""
TRACK: str = "track.csv"
"""The poses of the track file beside a bag, if its experiment has one."""

BAG_ENDINGS: Final = (".bag", ".mcap")
"""Endings of the names of bags, the preferred one first."""


@dataclass(frozen=True)
class BagFile:
    """A bag and its metadata, which is known without reading all of it."""

    bag: Path
    experiment: Experiment | None
    """The experiment that generated it; None for a bag from elsewhere."""
    counts: Mapping[str, int]
    """Messages by topic; every topic has at least one."""
    msgtypes: Mapping[str, str]
    """Message type by topic, like ``sensor_msgs/msg/Imu``."""
    start_ns: int
    end_ns: int
    """First and last stamp [ns]."""

    @property
    def name(self) -> str:
        """The bag's name without its suffix."""
        return self.bag.stem

    @property
    def folder(self) -> Path:
        """The folder of the bag."""
        return self.bag.parent

    @property
    def clocked(self) -> frozenset[str]:
        """Topics whose headers have a sensor's own time, while their stamps in the bag are the true ones."""
        if self.experiment is None:
            return frozenset()
        sensors = (sensor for sensor in self.experiment.rig.sensors if sensor.clock is not None)
        topics = (topic.name for sensor in sensors for topic in sensor.topics())
        return frozenset(name for name in topics if name in self.counts and not name.endswith(TRUTH))

    @property
    def world(self) -> str | None:
        """Text that is equal for runs in the same world; None for a bag from elsewhere, whose world is unknown."""
        if self.experiment is None:
            return None
        parts = self.experiment.model_dump(mode="json", include={"environment", "seed", "layout"})
        return json.dumps(parts, sort_keys=True)

    @property
    def is_frames(self) -> bool:
        """Whether each pose stands for itself, so that nothing moves from one to the next."""
        return self.experiment is not None and self.experiment.frames is not None

    @property
    def duration_s(self) -> float:
        """Time [s] from the first to the last stamp."""
        return (self.end_ns - self.start_ns) / 1e9

    def require(self, *topics: str) -> None:
        """Check that the bag has messages of all these topics.

        Raises:
            BagError: lists the missing and the available topics.
        """
        missing = [topic for topic in topics if topic not in self.counts]
        if missing:
            raise BagError(f"{self.bag} has no {', '.join(missing)}; available: {', '.join(sorted(self.counts))}")

    def require_instances(self, *topics: str) -> None:
        """Check that the bag has these topics of instance images.

        Raises:
            BagError: lists the missing ones and states how to make them.
        """
        missing = [topic for topic in topics if topic not in self.counts]
        if missing:
            name = "NAME" if self.experiment is None else self.experiment.name
            hint = f"`fieldtruth generate {name} --extras instances` makes a bag that has them"
            raise BagError(f"{self.bag} has no {', '.join(missing)}, the object of each pixel; {hint}")


def find_bag(path: Path | str) -> Path:
    """Return the path of the bag: the file itself, or the one in the folder of a run.

    In a folder, a bag of ROS 1 goes before MCAP files, and one with the folder's name before others. A folder of ROS 2,
    which has metadata.yaml, is itself the bag, unless there is one MCAP file in it.

    Raises:
        BagError: no such path, something else than a file or a folder, no bag in the folder, or several.
    """
    path = Path(path)
    if not path.is_dir():
        if not path.exists():
            raise BagError(f"{path} does not exist; a run must be the folder of a run, or a bag")
        first_bytes(path)
        return path
    bags: list[Path] = []
    for ending in BAG_ENDINGS:
        own = path / f"{path.resolve().name}{ending}"
        bags = bags or ([own] if own.exists() else sorted(path.glob(f"*{ending}")))
    if len(bags) != 1 and is_database(path):
        return path
    if len(bags) != 1:
        what = f"{len(bags)} bags ({', '.join(bag.name for bag in bags)})" if bags else "no bag"
        raise BagError(f"{path} has {what}; a run must be a folder with one bag, or a bag")
    first_bytes(bags[0])
    return bags[0]


def experiment_of(bag: Path) -> Experiment | None:
    """Return the experiment beside a bag if it has the bag's name, else it belongs to another bag."""
    path = bag.parent / EXPERIMENT
    if not path.exists():
        return None
    experiment = load_experiment(path)
    return experiment if experiment.name == bag.stem else None

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs on tiny worlds whose path, clouds and images are given as arrays, without a bag."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.geometry import Trajectory
from fieldtruth.bag.readings import series
from fieldtruth.bag.run import Run
from fieldtruth.core.readings import Cloud, Image, Reading
from fieldtruth.experiment.rig import Rig

F8 = NDArray[np.float64]


class Series:
    """Readings in a list."""

    def __init__(self, readings: Sequence[Any]) -> None:
        self.readings = list(readings)
        self.stamps_ns = np.array([each.stamp_ns for each in readings], np.int64)

    def __len__(self) -> int:
        return len(self.readings)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.readings)

    def __getitem__(self, rows: slice) -> Any:
        return series(self.readings[rows])

    def read(self, row: int, parts: Sequence[str] | None = None) -> Any:
        return self.readings[row]


class TinyRun(Run):
    """A run whose sensors have readings as given, all mounted at ``base_from`` by name."""

    bag = Path("tiny.bag")
    folder = Path()
    name = "tiny"
    duration_s = 1.0

    def __init__(
        self, path: Trajectory, readings: Mapping[str, Sequence[Any]], base_from: Mapping[str, F8], lens: Any = None
    ) -> None:
        self._read = {name: Series(each) for name, each in readings.items()}
        self.__dict__.update(trajectory=path, rig=Rig(), counts=dict.fromkeys([*readings, "depth"], 1))
        self.__dict__["calibration"] = SimpleNamespace(base_from=base_from.__getitem__, lens=lambda name: lens)

    def of(self, kind: type[Reading], *parts: str, recorded: bool = True) -> Any:
        topics = {"photo": "photo", "depth": "depth", "main": "main"}
        known = [n for n, each in self._read.items() if len(each) and isinstance(each.readings[0], kind)]
        return [
            SimpleNamespace(name=n, label=n, type=kind, topics=topics, has=lambda counts, *parts: True, config=None)
            for n in known
        ]

    def readings(self, name: str, parts: Sequence[str] = (), *, labelled: bool = True) -> Any:
        return self._read[name]


def straight(speed: float, seconds: float, heading: float = 0.0, start: Sequence[float] = (0.0, 0.0)) -> Trajectory:
    """A straight drive at a constant speed [m/s], with a pose each 10 ms."""
    stamps = np.arange(0, round(seconds * 100) + 1, dtype=np.int64) * 10_000_000
    way = speed * stamps / 1e9
    position = np.stack(
        [start[0] + way * np.cos(heading), start[1] + way * np.sin(heading), np.zeros(len(way))], axis=1
    )
    return Trajectory(stamps, position, np.tile([np.cos(heading / 2), 0, 0, np.sin(heading / 2)], (len(way), 1)))


def cloud(stamp_ns: int, xyz: Sequence[Sequence[float]], t_ns: Sequence[int] | None = None) -> Cloud:
    """Points in the frame of their sensor."""
    points = np.array(xyz, np.float32).reshape(-1, 3)
    after = None if t_ns is None else np.array(t_ns, np.int64)
    label = np.zeros(len(points), np.uint8)
    return Cloud(stamp_ns=stamp_ns, header_ns=stamp_ns, xyz=points, label=label, t_ns=after)


def image(stamp_ns: int, **parts: Any) -> Image:
    """An image."""
    return Image(stamp_ns=stamp_ns, header_ns=stamp_ns, **parts)

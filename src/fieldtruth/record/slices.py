# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The unit of work is a time slice: a small bag that is a pure function of (world, track, rig, slice number).

Slice k holds the stamps in (k S, (k + 1) S] after the start. It gets its name only when it is whole, so what
stands in the folder is done, whatever stopped the run; missing slices are made by threads, and joined in time order
they are the recording.
"""

import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.bag.topics import Topic
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.files import output_errors
from fieldtruth.record.streams import Sensors, Stream

SLICE_NS: Final = 10**9  # [ns] of simulated time
TELL_NS: Final = 10**8  # [ns] of simulated time between two reports of progress

Advance = Callable[[float], None]


def ignore(seconds: float) -> None:
    """Tell nobody about progress."""


class _Stopped(Exception):  # noqa: N818 - it reports no error
    """The run was told to stop while this slice was being made."""


class Slices:
    """The slices of one recording in one folder.

    Args:
        folder: where the files are; it holds slices of this recording only.
        streams: every stream of the recording, in the topic table's order.
        topics: what they publish.
        make_sensors: called once in each worker thread, which then owns them.
        start_ns: where slice 0 begins [ns]; every stamp is above it.
    """

    def __init__(
        self,
        folder: Path,
        streams: Sequence[Stream],
        topics: Sequence[Topic],
        make_sensors: Callable[[], Sensors],
        start_ns: int = 0,
    ) -> None:
        self.folder = folder
        self.streams = streams
        self.topics = topics
        self.start_ns = start_ns
        self._make_sensors = make_sensors
        self._worker = threading.local()
        self._stop = threading.Event()

    @property
    def end_ns(self) -> int:
        """Last stamp [ns] of the recording."""
        return max(int(stream.stamps_ns[-1]) for stream in self.streams if len(stream.stamps_ns))

    @property
    def count(self) -> int:
        """Number of slices."""
        return -(-(self.end_ns - self.start_ns) // SLICE_NS)

    def path(self, k: int) -> Path:
        """File of slice ``k``."""
        return self.folder / f"{k:06d}.bag"

    def seconds(self, k: int) -> float:
        """Simulated time [s] that slice ``k`` holds."""
        return (min(self._begin_ns(k + 1), self.end_ns) - self._begin_ns(k)) / 1e9

    def missing(self) -> list[int]:
        """Slices that are still to be made."""
        return [k for k in range(self.count) if not self.path(k).exists()]

    def make(self, workers: int, advance: Advance = ignore) -> None:
        """Make what is missing; ``advance`` is called from the workers with the simulated time [s] just done.

        An error, or Ctrl-C, stops all workers at their next message; finished slices stay.

        Raises:
            OutputError: no space left, or the folder cannot be written.
        """
        self._stop.clear()
        pool = ThreadPoolExecutor(workers, thread_name_prefix="slice")
        try:
            for done in as_completed([pool.submit(self._make_one, k, advance) for k in self.missing()]):
                done.result()
        finally:
            self._stop.set()
            pool.shutdown(cancel_futures=True)

    def join(self, path: Path, advance: Advance = ignore) -> None:
        """Write all slices to one bag; ``advance`` is called with the simulated time [s] just written."""
        with output_errors(path), BagWriter(path, self.topics) as bag:
            for k in range(self.count):
                bag.append(self.path(k))
                advance(self.seconds(k))

    def _begin_ns(self, k: int) -> int:
        return self.start_ns + k * SLICE_NS

    def _make_one(self, k: int, advance: Advance) -> None:
        if not hasattr(self._worker, "sensors"):
            self._worker.sensors = self._make_sensors()
        told_ns = self._begin_ns(k)
        with output_errors(self.path(k)), BagWriter(self.path(k), self.topics) as bag:
            for stamp_ns, stream, reading in self._readings(k):
                if self._stop.is_set():
                    raise _Stopped
                messages = stream.messages(reading, self._worker.sensors)
                for topic, data in zip(stream.topics, messages, strict=True):
                    bag.write(topic, stamp_ns, data)
                if stamp_ns - told_ns >= TELL_NS:
                    advance((stamp_ns - told_ns) / 1e9)
                    told_ns = stamp_ns
        advance(self.seconds(k) - (told_ns - self._begin_ns(k)) / 1e9)

    def _readings(self, k: int) -> Iterable[tuple[int, Stream, int]]:
        """Stamp, stream and number of each reading of slice ``k``: in time order, ties in the streams' order."""
        found: list[tuple[int, int, int]] = []
        for order, stream in enumerate(self.streams):
            first, last = np.searchsorted(stream.stamps_ns, [self._begin_ns(k), self._begin_ns(k + 1)], side="right")
            found += [(int(stream.stamps_ns[i]), order, i) for i in range(int(first), int(last))]
        return ((stamp, self.streams[order], i) for stamp, order, i in sorted(found))

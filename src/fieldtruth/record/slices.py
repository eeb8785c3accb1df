# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time slices, the unit of work: small bags that depend only on world, track, rig and slice number.

Slice k holds the stamps in (k S, (k + 1) S] after the start. It gets its name only when it is complete, so every slice
in the folder is finished, however the run was interrupted. Threads make the missing slices; joined in time order they
are the recording.
"""

import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.bag.topics import Topic
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.cache import cache_key
from fieldtruth.core.files import output_errors
from fieldtruth.core.progress import Advance
from fieldtruth.record.streams import Sensors, Stream

SLICE_NS: Final = 10**9
"""Simulated time [ns] in a slice."""
_PROGRESS_NS: Final = 10**8
"""Simulated time [ns] between two reports of progress."""

_MODULES: Final = ("fieldtruth.record.slices", "fieldtruth.record.sensors")
_LIBRARIES: Final = ("numpy", "scipy", "numba", "embreex", "simplejpeg", "lz4", "rosbags")


def slices_key(*inputs: object) -> str:
    """Key of the slices made from ``inputs`` by the current code of sensors, rendering and bags; see ``cache_key``."""
    return cache_key(_MODULES, *inputs, libraries=_LIBRARIES)


def ignore(seconds: float) -> None:
    """Report no progress."""


class _StoppedError(Exception):
    """The run was stopped while this slice was being made."""


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

    @property
    def seconds_done(self) -> float:
        """Simulated time [s] in the slices that exist."""
        return (self.end_ns - self.start_ns) / 1e9 - sum(map(self.seconds, self.missing()))

    def path(self, k: int) -> Path:
        """File of slice ``k``."""
        return self.folder / f"{k:06d}.bag"

    def seconds(self, k: int) -> float:
        """Simulated time [s] in slice ``k``."""
        return (min(self._begin_ns(k + 1), self.end_ns) - self._begin_ns(k)) / 1e9

    def missing(self) -> list[int]:
        """Numbers of the slices that do not exist yet."""
        return [k for k in range(self.count) if not self.path(k).exists()]

    def make(self, workers: int, advance: Advance = ignore) -> None:
        """Make the missing slices; the workers call ``advance`` with the simulated time [s] just done.

        An error, or Ctrl-C, stops all workers at their next message; finished slices are kept.

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
        reported_ns = self._begin_ns(k)
        with output_errors(self.path(k)), BagWriter(self.path(k), self.topics) as bag:
            for stamp_ns, stream, reading in self._readings(k):
                if self._stop.is_set():
                    raise _StoppedError
                messages = stream.messages(reading, self._worker.sensors)
                for topic, data in zip(stream.topics, messages, strict=True):
                    bag.write(topic, stamp_ns, data)
                if stamp_ns - reported_ns >= _PROGRESS_NS:
                    advance((stamp_ns - reported_ns) / 1e9)
                    reported_ns = stamp_ns
        advance(self.seconds(k) - (reported_ns - self._begin_ns(k)) / 1e9)

    def _readings(self, k: int) -> Iterable[tuple[int, Stream, int]]:
        """Stamp, stream and number of each reading of slice ``k``: in time order, ties in the streams' order."""
        found: list[tuple[int, int, int]] = []
        for order, stream in enumerate(self.streams):
            first, last = np.searchsorted(stream.stamps_ns, [self._begin_ns(k), self._begin_ns(k + 1)], side="right")
            found += [(int(stream.stamps_ns[i]), order, i) for i in range(int(first), int(last))]
        return ((stamp, self.streams[order], i) for stamp, order, i in sorted(found))

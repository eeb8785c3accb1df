# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time slices, the unit of work: small bags that depend only on world, track, rig and slice number.

Slice k holds the stamps in (k S, (k + 1) S] after the start. It gets its name only when it is complete and on the disk,
and a seal shows damage after that, or a slice of another recording. Threads make the missing slices. In time order each
is joined to the recording as soon as it can be, and removed, so that no second copy of the data is on the disk.
"""

import threading
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.bag.provenance import LIBRARIES
from fieldtruth.bag.writer import BagWriter, GrowingBag
from fieldtruth.core.cache import cache_key, is_sealed
from fieldtruth.core.errors import FieldtruthError, OutputError, SliceError
from fieldtruth.core.files import output_errors, remove
from fieldtruth.core.progress import Advance, Progress
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.record.streams import Sensors, Stream
from fieldtruth.sensors.kind import SENSORS
from fieldtruth.sensors.known import OWN

SLICE_NS: Final = 10**8
"""Simulated time [ns] in a slice: short, so that a few seconds keep many cores busy."""
_MODULES: Final = ("fieldtruth.record.slices", "fieldtruth.record.streams")
"""They import the package's kinds of sensors."""


def slices_key(*inputs: object) -> str:
    """Key of the slices made from ``inputs`` by the current code of sensors, rendering and bags; see ``cache_key``."""
    added = {kind.__module__ for kind in SENSORS.values()} - {kind.__module__ for kind in OWN}
    return cache_key((*_MODULES, *sorted(added)), *inputs, libraries=LIBRARIES)


def ignore(seconds: float) -> None:
    """Report no progress."""


class _StoppedError(Exception):
    """The run was stopped while this slice was being made."""


class SliceFolder(ABC):
    """The slices of one recording in one folder; subclasses say who makes them.

    Args:
        folder: where the files are; its name is the key of the recording.
        topics: what the recording publishes.
        start_ns: where slice 0 begins [ns]; every stamp is above it.
        end_ns: last stamp [ns] of the recording.
        slice_ns: simulated time [ns] in a slice.
    """

    def __init__(
        self, folder: Path, topics: Sequence[Topic], start_ns: int, end_ns: int, slice_ns: int = SLICE_NS
    ) -> None:
        self.folder, self.topics = folder, topics
        self.start_ns, self.end_ns, self.slice_ns = start_ns, end_ns, slice_ns
        self.joined = 0
        """Number of slices that are joined; their files are removed."""

    @abstractmethod
    def made(self, workers: int, advance: Advance) -> Generator[int]:
        """Make the missing slices, and yield the number of each when its file is in the folder.

        ``advance`` is called, from any thread, with the simulated time [s] just done. Finished slices are kept if this
        raises.

        Raises:
            OutputError: no space left, or the folder cannot be written.
            SliceError: something else went wrong in a slice.
        """

    def make(self, workers: int, advance: Advance = ignore) -> None:
        """Make the missing slices, and those that are damaged; raises as ``made``."""
        self.remove_damaged()
        for _ in self.made(workers, advance):
            pass

    def record(self, path: Path, workers: int, progress: Progress) -> None:
        """Make the missing slices and join all to one bag; after an interruption, go on. Raises as ``made``."""
        with output_errors(path, resumes=True), GrowingBag(path, self.topics) as bag:
            self.joined = bag.added
            self.remove_damaged()
            seconds = (self.end_ns - self.start_ns) / 1e9
            with progress.stage("sense and label", seconds, self.seconds_done) as advance:
                self._join(bag)
                with closing(self.made(workers, advance)) as made:
                    for _ in made:
                        self._join(bag)

    @property
    def count(self) -> int:
        """Number of slices."""
        return -(-(self.end_ns - self.start_ns) // self.slice_ns)

    @property
    def seconds_done(self) -> float:
        """Simulated time [s] in the slices that exist."""
        return (self.end_ns - self.start_ns - sum(map(self._length_ns, self.missing()))) / 1e9

    def path(self, k: int) -> Path:
        """File of slice ``k``."""
        return self.folder / f"{k:06d}.bag"

    def seconds(self, k: int) -> float:
        """Simulated time [s] in slice ``k``."""
        return self._length_ns(k) / 1e9

    def missing(self) -> list[int]:
        """Numbers of the slices that are neither joined nor in the folder."""
        return [k for k in range(self.joined, self.count) if not self.path(k).exists()]

    def is_intact(self, k: int) -> bool:
        """Return whether the file of slice ``k`` is as it was made, for this recording and this number."""
        return is_sealed(self.path(k), self.seal(k))

    def seal(self, k: int) -> str:
        """Name under which slice ``k`` is sealed."""
        return f"{self.folder.name} {k}"

    def remove_damaged(self) -> None:
        """Remove slices that are damaged, of another recording or joined already, and unfinished ones."""
        for part in self.folder.glob("*.part"):
            part.unlink(missing_ok=True)
        for k in range(self.count):
            if self.path(k).exists() and (k < self.joined or not self.is_intact(k)):
                remove(self.path(k))

    def _join(self, bag: GrowingBag) -> None:
        """Join the slices that follow the joined ones and are in the folder."""
        while self.path(self.joined).exists():
            path = self.path(self.joined)
            if not self.is_intact(self.joined):
                remove(path)
                raise OutputError(f"{path} was damaged on the disk; run the same command again: it makes it again")
            bag.add(path)
            self.joined += 1
            path.unlink()

    def _length_ns(self, k: int) -> int:
        return min(self._begin_ns(k + 1), self.end_ns) - self._begin_ns(k)

    def _begin_ns(self, k: int) -> int:
        return self.start_ns + k * self.slice_ns


class Slices(SliceFolder):
    """Slices that threads of this process make.

    Args:
        folder: as in ``SliceFolder``.
        streams: every stream of the recording, in the topic table's order.
        topics: what they publish.
        make_sensors: called once in each worker thread, which then owns them.
        start_ns: as in ``SliceFolder``.
        slice_ns: as in ``SliceFolder``.
    """

    def __init__(
        self,
        folder: Path,
        streams: Sequence[Stream],
        topics: Sequence[Topic],
        make_sensors: Callable[[], Sensors],
        start_ns: int = 0,
        slice_ns: int = SLICE_NS,
    ) -> None:
        end_ns = max(int(stream.stamps_ns[-1]) for stream in streams if len(stream.stamps_ns))
        super().__init__(folder, topics, start_ns, end_ns, slice_ns)
        self.streams = streams
        self._make_sensors = make_sensors
        self._worker = threading.local()
        self._stop = threading.Event()

    def made(self, workers: int, advance: Advance) -> Generator[int]:
        """Make the missing slices in threads; an error, or Ctrl-C, stops all of them at their next message."""
        self._stop.clear()
        pool = ThreadPoolExecutor(workers, thread_name_prefix="slice")
        try:
            waiting = {pool.submit(self.make_one, k, advance): k for k in self.missing()}
            for done in as_completed(waiting):
                done.result()
                yield waiting.pop(done)
        finally:
            self._stop.set()
            pool.shutdown(cancel_futures=True)

    def make_one(self, k: int, advance: Advance = ignore) -> None:
        """Make slice ``k`` with the sensors of the calling thread; raises as ``made``."""
        try:
            with output_errors(self.path(k), resumes=True):
                self._write(k, advance)
        except (FieldtruthError, _StoppedError):
            raise
        except Exception as error:
            begin, end = ((self._begin_ns(each) - self.start_ns) / 1e9 for each in (k, k + 1))
            when = f"between {begin:g} and {end:g} s of the recording"
            raise SliceError(f"{when}: {_where(error)}; the rest is kept") from error

    def _write(self, k: int, advance: Advance) -> None:
        if not hasattr(self._worker, "sensors"):
            self._worker.sensors = self._make_sensors()
        with BagWriter(self.path(k), self.topics, self.seal(k)) as bag:
            for stamp_ns, topics, messages in self._readings(k):
                if self._stop.is_set():
                    raise _StoppedError
                for topic, data in zip(topics, next(messages), strict=True):
                    bag.write(topic, stamp_ns, data)
        advance(self.seconds(k))

    def _readings(self, k: int) -> Iterable[tuple[int, tuple[str, ...], Iterator[Iterable[bytes]]]]:
        """Return stamp and topics of each reading of slice ``k``, in time order, ties in the streams' order.

        With them the messages of the stream, of which those of the reading are the next.
        """
        found: list[tuple[int, int]] = []
        made: dict[int, Iterator[Iterable[bytes]]] = {}
        for order, stream in enumerate(self.streams):
            first, last = np.searchsorted(stream.stamps_ns, [self._begin_ns(k), self._begin_ns(k + 1)], side="right")
            if first < last:
                made[order] = iter(stream.messages(np.arange(first, last), self._worker.sensors))
                found += [(stamp, order) for stamp in stream.stamps_ns[first:last].tolist()]
        return ((stamp, self.streams[order].topics, made[order]) for stamp, order in sorted(found))


def _where(error: Exception) -> str:
    """Return an error with the line of code that raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(last.filename).name}, line {last.lineno})"

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The engine that has world, drive and slices made by the workers of a Dask scheduler."""

import time
import uuid
import warnings
from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any, Final

from distributed import Client, Future, as_completed

from fieldtruth.bag.provenance import note
from fieldtruth.bag.topics import topics_of_run
from fieldtruth.bag.track_file import TrackFile
from fieldtruth.cluster import worker
from fieldtruth.cluster.worker import Order, OtherWorkerError, cluster_errors, difference, facts, make_slice
from fieldtruth.core.errors import ClusterError, FieldtruthWarning
from fieldtruth.core.files import output_errors, write_atomically
from fieldtruth.core.progress import Advance, Progress
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.record.slices import SliceFolder
from fieldtruth.simulation.stepped import Simulation

_AHEAD: Final = 3
"""Slices per thread that are submitted and not yet in the folder, so that results do not fill memory."""
_COUNT_S: Final = 5.0
"""Seconds between two looks at the number of threads: workers come and go."""
_VISIBLE_S: Final = 90.0
"""Seconds in which a network folder must show a file of another machine; NFS looks again after 60."""


class ClusterSlices(SliceFolder):
    """Slices in a folder of this machine, made by workers that have the motion."""

    def __init__(self, client: Client, order: Order, moved: Future, topics: Sequence[Topic], end_ns: int) -> None:
        super().__init__(Path(order.folder), topics, 0, end_ns)
        self._client = client
        self._order = order
        self._moved = moved

    def made(self, workers: int, advance: Advance) -> Generator[int]:
        """Have the workers make the missing slices; ``workers`` counts threads of this process and is not used.

        Raises:
            OutputError: no space left, or the folder cannot be written.
            ClusterError: workers or scheduler are lost, or all workers differ from this machine.
        """
        todo, ahead = deque(self.missing()), _Ahead(self._client)
        running: dict[Future, int] = {}
        with cluster_errors(), self._token():
            done = as_completed(loop=self._client.loop)
            try:
                while todo or running:
                    while todo and len(running) < ahead.count():
                        future = self._submit(todo[0])
                        running[future] = todo.popleft()
                        done.add(future)
                    future = next(done)
                    k = running.pop(future)
                    if self._keep(k, future):
                        advance(self.seconds(k))
                        yield k
                    else:
                        todo.append(k)
            finally:
                self._client.cancel(list(running))

    def _submit(self, k: int) -> Future:
        key = f"slice-{k:06d}-{uuid.uuid4().hex}"  # earlier slices first
        return self._client.submit(make_slice, self._order, self._moved, k, key=key, priority=self._order.priority)

    def _keep(self, k: int, future: Future) -> bool:
        """Have the slice of a finished task in the folder; False if another worker must make it."""
        if future.status == "finished" and self._is_here(k):
            return True  # without asking for the result, which takes longer than all the rest
        try:
            made = future.result()
        except OtherWorkerError as error:
            self._dismiss(error)
            return False
        if made is not None:
            content, maker = made
            with output_errors(self.path(k), resumes=True):
                note(self.folder, [maker])
                write_atomically(self.path(k), content)
        end = time.monotonic() + _VISIBLE_S
        while not self._is_here(k):
            if time.monotonic() > end:
                raise ClusterError(f"a worker wrote {self.path(k)}, but it cannot be seen from here")
            time.sleep(0.1)
        return True

    def _is_here(self, k: int) -> bool:
        return k < self.joined or self.path(k).exists()  # a slice may be joined before its task is reported

    def _dismiss(self, error: OtherWorkerError) -> None:
        """Give a worker that differs from this machine, and came after the check at the start, no more slices."""
        self._client.retire_workers([error.address])
        if not self._client.nthreads():
            raise ClusterError(f"{error}, and there is no other worker") from error
        warnings.warn(f"{error}; it is dismissed", FieldtruthWarning, stacklevel=2)

    @contextmanager
    def _token(self) -> Iterator[None]:
        """Put the file into the folder by which workers know that they see the same folder."""
        token = self.folder / self._order.token
        with output_errors(token):
            token.touch()
        try:
            yield
        finally:
            token.unlink(missing_ok=True)


class _Ahead:
    """Number of slices that may be submitted at once."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._counted_at = -_COUNT_S
        self._count = 0

    def count(self) -> int:
        """Return the limit for the present workers, at least 1."""
        if time.monotonic() - self._counted_at > _COUNT_S:
            self._count = max(1, _AHEAD * sum(self._client.nthreads().values()))
            self._counted_at = time.monotonic()
        return self._count


class ClusterEngine:
    """Prepares runs on a cluster; to be passed to ``generate`` as its engine."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self._begun = count()

    def runs_at_once(self) -> int:
        """Return how many runs of a campaign keep the present workers busy: a world and a drive are one task."""
        with cluster_errors():
            self.client.wait_for_workers(1)
            threads: int = sum(self.client.nthreads().values())
        return 2 + threads // 4

    def __call__(self, simulation: Simulation, progress: Progress) -> "PreparedThere":
        """Have a worker build the world and drive, or follow the track file.

        Raises:
            ConfigurationError: an actor cannot begin where it should.
            ClusterError: a worker differs from this machine, or workers or scheduler are lost.
            RouteError, DriveError, TrackError: as in ``generate``.
        """
        with cluster_errors():
            with progress.stage("wait for workers"):
                self.client.wait_for_workers(1)
                self._agree()
            with progress.stage("world and drive"):
                return PreparedThere(self.client, simulation.experiment, simulation.track_file, -next(self._begun))

    def _agree(self) -> None:
        """Check that the present workers are like this machine; later ones are checked by their first slice."""
        here = facts()
        for address, there in self.client.run(facts, on_error="return").items():
            if isinstance(there, OSError):
                continue  # it has just ended
            if isinstance(there, Exception):
                raise ClusterError(f"worker {address} cannot run the fieldtruth of this machine: {there}")
            if different := difference(there, here):
                raise ClusterError(f"worker {address} differs from this machine: {different}")


class PreparedThere:
    """A run whose world and track are on the cluster; what has a higher priority is made first."""

    def __init__(self, client: Client, experiment: Experiment, given: TrackFile | None, priority: int) -> None:
        self._client = client
        self._priority = priority
        self._text = dump_experiment(experiment)
        self._moved = self._task(worker.drive_track, given)
        self._facts = self._task(worker.run_facts, self._moved).result()
        self._topics = topics_of_run(experiment, latched=self._facts.latched)

    @property
    def key(self) -> str:
        """Key of its slices."""
        key: str = self._facts.key
        return key

    def slices(self, folder: Path) -> ClusterSlices:
        """Return the slices in a folder, which workers make."""
        order = worker.Order(self._text, self.key, str(folder.resolve()), f".{uuid.uuid4().hex}.token", self._priority)
        return ClusterSlices(self._client, order, self._moved, self._topics, self._facts.end_ns)

    def card(self, counts: Mapping[str, int]) -> str:
        """Return the data card."""
        with cluster_errors():
            text: str = self._task(worker.card, self._moved, counts).result()
        return text

    def _task(self, function: Any, *inputs: object) -> Future:
        """Submit a task on this run; it runs once more if its worker is lost."""
        key = f"{function.__name__}-{uuid.uuid4().hex}"
        return self._client.submit(function, self._text, *inputs, key=key, priority=self._priority)

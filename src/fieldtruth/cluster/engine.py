# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The engine that has world, drive and slices made by the workers of a Dask scheduler."""

import uuid
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

from distributed import Client, Future

from fieldtruth.bag.topics import topics_of_run
from fieldtruth.bag.track_file import TrackFile
from fieldtruth.cluster import worker
from fieldtruth.cluster.agreement import difference, facts
from fieldtruth.cluster.errors import cluster_errors
from fieldtruth.cluster.slices import ClusterSlices
from fieldtruth.core.errors import ClusterError
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment


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

    def __call__(self, experiment: Experiment, given: TrackFile | None, progress: Progress) -> "PreparedThere":
        """Have a worker build the world and drive, or follow the track file.

        Raises:
            ClusterError: a worker differs from this machine, or workers or scheduler are lost.
            RouteError, DriveError, TrackError: as in ``generate``.
        """
        with cluster_errors():
            with progress.stage("wait for workers"):
                self.client.wait_for_workers(1)
                self._agree()
            with progress.stage("world and drive"):
                return PreparedThere(self.client, experiment, given, -next(self._begun))

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
        self._track = self._task(worker.drive_track, given)
        self._facts = self._task(worker.run_facts, self._track).result()
        self._topics = topics_of_run(experiment, latched=self._facts.latched)

    @property
    def key(self) -> str:
        """Key of its slices."""
        key: str = self._facts.key
        return key

    def slices(self, folder: Path) -> ClusterSlices:
        """Return the slices in a folder, which workers make."""
        order = worker.Order(self._text, self.key, str(folder.resolve()), f".{uuid.uuid4().hex}.token", self._priority)
        return ClusterSlices(self._client, order, self._track, self._topics, self._facts.end_ns)

    def card(self, counts: Mapping[str, int]) -> str:
        """Return the data card."""
        with cluster_errors():
            text: str = self._task(worker.card, self._track, counts).result()
        return text

    def _task(self, function: Any, *inputs: object) -> Future:
        """Submit a task on this run; it runs once more if its worker is lost."""
        key = f"{function.__name__}-{uuid.uuid4().hex}"
        return self._client.submit(function, self._text, *inputs, key=key, priority=self._priority)

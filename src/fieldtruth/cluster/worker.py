# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tasks that run on a worker: the drive, a slice, the card. A world is loaded once per process.

A slice goes to the run's folder if the worker sees the same folder, which a token in it proves, else through the
scheduler as bytes. Slices of a worker have the client's bytes only if both have the same versions, code and worlds.
"""

import platform
import tempfile
from collections.abc import Callable, Hashable, Iterator, Mapping
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any, Final, Generic, NamedTuple, TypeVar

from distributed import KilledWorker, get_worker
from distributed.comm import CommClosedError

import fieldtruth
from fieldtruth.bag.provenance import LIBRARIES, Maker, this_process
from fieldtruth.bag.track_file import TrackFile
from fieldtruth.core.errors import ClusterError, SliceError
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import parse_experiment
from fieldtruth.experiment.sensor_config import load_added_kinds
from fieldtruth.pipeline import PreparedHere
from fieldtruth.record.slices import Slices, slices_key
from fieldtruth.simulation.company import Company, Known
from fieldtruth.simulation.motion import track_in
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

Facts = Mapping[str, str]
_KEY: Final = "key of the code"
K = TypeVar("K", bound=Hashable)
V = TypeVar("V")
_KEPT: Final = 2
"""Worlds, and scenes with their light, that a worker keeps: a run, and the next one of a campaign."""


def facts() -> Facts:
    """Versions of this process, and the key of its code with all kinds of sensors; see ``slices_key``."""
    load_added_kinds()
    shared = {name: this_process()[name] for name in ("Python", *LIBRARIES)}
    own = {"fieldtruth": fieldtruth.__version__, "processor": platform.machine()}
    return own | shared | {_KEY: slices_key()}


def difference(there: Facts, here: Facts) -> str:
    """Say in what a worker differs from the client; empty if it does not."""
    different = [f"{name} {there.get(name)} instead of {here[name]}" for name in here if there.get(name) != here[name]]
    if len(different) > 1:  # the key follows from the versions
        different = [text for text in different if not text.startswith(_KEY)]
    return ", ".join(different)


class Recent(Generic[K, V]):
    """The ``size`` values used last. Threads that ask for a value while another one makes it wait for that."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._lock = Lock()
        self._values: dict[K, Future[V]] = {}

    def get(self, key: K, make: Callable[[], V]) -> V:
        """Return the value of a key, which is made if it is not kept; an error of ``make`` is not kept."""
        with self._lock:
            value = self._values.pop(key, None)
            mine = value is None
            value = Future[V]() if value is None else value
            self._values[key] = value  # the last in order is the last used
            for oldest in list(self._values)[: -self._size]:
                del self._values[oldest]
        if mine:
            try:
                value.set_result(make())
            except BaseException as error:
                with self._lock:
                    self._values.pop(key, None)
                value.set_exception(error)
        return value.result()


class OtherWorkerError(ClusterError):
    """The worker at ``address`` would make other slices than the client expects."""

    def __init__(self, address: str) -> None:
        super().__init__(f"worker {address} has other code, libraries or worlds than this machine")
        self.address = address

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep the address in another process."""
        return type(self), (self.address,)


@contextmanager
def cluster_errors() -> Iterator[None]:
    """Turn what Dask raises when it loses scheduler or workers into one clear line.

    Raises:
        ClusterError: what was lost; the same command resumes.
        SliceError: a task ended one worker after the other.
    """
    again = "finished slices are kept, and the same command makes the rest"
    try:
        yield
    except KilledWorker as error:
        workers = f"{error.allowed_failures + 1} workers in turn, the last one {error.last_worker.address}"
        raise SliceError(f"{error.task} ended {workers}; give them more memory; {again}") from error
    except (CancelledError, CommClosedError, TimeoutError) as error:
        raise ClusterError(f"the connection to the scheduler was lost; {again}") from error
    except (ImportError, AttributeError) as error:
        raise ClusterError(f"a worker does not have the fieldtruth of this machine: {error}") from error


_worlds: Final = Recent[str, World](_KEPT)
_slices: Final = Recent[str, Slices](_KEPT)
_writing: Final = Recent[str, Lock](1000)


class RunFacts(NamedTuple):
    """Facts that the client needs of a run that a worker prepared."""

    key: str
    end_ns: int
    latched: bool
    """True if static objects are published once."""


class Order(NamedTuple):
    """Order to make slices of a run.

    ``text`` is experiment.yaml, ``key`` that of its slices, ``folder`` the client's folder for them, ``token`` the
    name of a file in it, and ``priority`` higher for an earlier run.
    """

    text: str
    key: str
    folder: str
    token: str
    priority: int


class Moved(NamedTuple):
    """Motion of a run: the robot's, and where it has actors, plants that yield or ruts, what these need."""

    track: Track
    known: Known | None


def drive_track(text: str, given: TrackFile | None) -> Moved:
    """Drive in the world, or follow the track file, with all that moves."""
    experiment = parse_experiment(text)
    world, company = _company(experiment)
    track = track_in(world, experiment, given, company=company)
    return Moved(track, None if company is None else company.known())


def run_facts(text: str, moved: Moved) -> RunFacts:
    """Return key and end of a run whose drive is done."""
    prepared = _prepared(text, moved)
    return RunFacts(prepared.key, int(moved.track.motion.stamps_ns[-1]), prepared.latched)


def card(text: str, moved: Moved, counts: Mapping[str, int]) -> str:
    """Return the data card of a run."""
    return _prepared(text, moved).card(counts)


def make_slice(order: Order, moved: Moved, k: int) -> tuple[bytes, Maker] | None:
    """Make slice ``k`` of a run; returns None if it is in the client's folder, else its content and what made it.

    Raises:
        OtherWorkerError: code, libraries, world or track of this worker are not those of the client.
    """
    slices = _slices.get(order.token, lambda: _open(order, moved))
    shared = slices.folder == Path(order.folder)
    # A task that was cancelled runs on in its thread, and the same slice may be asked for again.
    with _writing.get(str(slices.path(k)), Lock):
        if not slices.path(k).exists():
            slices.make_one(k)
        if shared:
            return None
        content = slices.path(k).read_bytes()
        slices.path(k).unlink()
        return content, this_process()


def _world(experiment: Experiment) -> World:
    inputs = [experiment.environment, experiment.seed, experiment.layout]
    return _worlds.get(repr(inputs), lambda: world_of(experiment))


def _company(experiment: Experiment) -> tuple[World, Company | None]:
    """Return the world of an experiment, and what moves in it with the robot, if anything does."""
    world = _world(experiment)
    if not experiment.is_living:
        return world, None
    company = Company(experiment, lambda: world)
    return company.world, company


def _prepared(text: str, moved: Moved) -> PreparedHere:
    experiment = parse_experiment(text)
    world, company = _company(experiment)
    if company is not None and moved.known is not None:
        company.know(moved.known)
    return PreparedHere(experiment, world, moved.track, company=company)


def _open(order: Order, moved: Moved) -> Slices:
    worker, prepared = get_worker(), _prepared(order.text, moved)
    if prepared.key != order.key:
        raise OtherWorkerError(worker.address)
    folder = Path(order.folder)
    if not (folder / order.token).is_file():
        folder = Path(tempfile.mkdtemp(dir=worker.local_directory)) / order.key  # slices are sealed under its name
        folder.mkdir()
    return prepared.slices(folder)

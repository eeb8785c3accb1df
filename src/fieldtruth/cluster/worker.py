# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tasks that run on a worker: the drive, a slice, the card. A world is loaded once per process.

A slice goes to the run's folder if the worker sees the same folder, which a token in it proves, else through the
scheduler as bytes.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from threading import Lock
from typing import Final, NamedTuple

from distributed import get_worker

from fieldtruth.bag.provenance import Maker, this_process
from fieldtruth.bag.track_file import TrackFile
from fieldtruth.cluster.errors import OtherWorkerError
from fieldtruth.cluster.recent import Recent
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import parse_experiment
from fieldtruth.pipeline import PreparedHere
from fieldtruth.record.slices import Slices
from fieldtruth.simulation.motion import track_in
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

_KEPT: Final = 2
"""Worlds, and scenes with their light, that a worker keeps: a run, and the next one of a campaign."""

_worlds: Final = Recent[str, World](_KEPT)
_slices: Final = Recent[str, Slices](_KEPT)
_writing: Final = Recent[str, Lock](1000)


class RunFacts(NamedTuple):
    """What the client must know of a run that a worker prepared."""

    key: str
    end_ns: int
    latched: bool
    """Whether static objects are published once."""


class Order(NamedTuple):
    """What a worker must know to make slices of a run.

    ``text`` is experiment.yaml, ``key`` that of its slices, ``folder`` the client's folder for them, ``token`` the
    name of a file in it, and ``priority`` higher for an earlier run.
    """

    text: str
    key: str
    folder: str
    token: str
    priority: int


def drive_track(text: str, given: TrackFile | None) -> Track:
    """Drive in the world, or follow the track file; returns the track."""
    experiment = parse_experiment(text)
    return track_in(_world(experiment), experiment, given)


def run_facts(text: str, track: Track) -> RunFacts:
    """Return key and end of a run whose drive is done."""
    prepared = _prepared(text, track)
    return RunFacts(prepared.key, int(track.motion.stamps_ns[-1]), prepared.latched)


def card(text: str, track: Track, counts: Mapping[str, int]) -> str:
    """Return the data card of a run."""
    return _prepared(text, track).card(counts)


def make_slice(order: Order, track: Track, k: int) -> tuple[bytes, Maker] | None:
    """Make slice ``k`` of a run; returns None if it is in the client's folder, else its content and what made it.

    Raises:
        OtherWorkerError: code, libraries, world or track of this worker are not those of the client.
    """
    slices = _slices.get(order.token, lambda: _open(order, track))
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


def _prepared(text: str, track: Track) -> PreparedHere:
    experiment = parse_experiment(text)
    return PreparedHere(experiment, _world(experiment), track)


def _open(order: Order, track: Track) -> Slices:
    worker, prepared = get_worker(), _prepared(order.text, track)
    if prepared.key != order.key:
        raise OtherWorkerError(worker.address)
    folder = Path(order.folder)
    if not (folder / order.token).is_file():
        folder = Path(tempfile.mkdtemp(dir=worker.local_directory)) / order.key  # slices are sealed under its name
        folder.mkdir()
    return prepared.slices(folder)

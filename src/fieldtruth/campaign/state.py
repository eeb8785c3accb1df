# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""State of each run of a campaign, from the files in its folder: a manifest if it is finished, or why it failed.

The manifest is written last, so a run without one is not done.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final, NamedTuple, Self

from pydantic import Field, ValidationError

import fieldtruth
from fieldtruth.bag.file import BagError
from fieldtruth.bag.provenance import sha256_of
from fieldtruth.bag.reader import open_bag
from fieldtruth.campaign.draw import PlannedRun, simulated_s
from fieldtruth.core.files import output_errors, write_atomically
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.fields import Frozen
from fieldtruth.record.folder import is_in_use

MANIFEST: Final = "manifest.json"
FAILURE: Final = "failure.json"
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Scene = tuple[str, int, str, str]


def clock(seconds: float) -> str:
    """Write a time as "45 s", "12 min" or "5 h 20 min"."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def size(count: float) -> str:
    """Write a number of bytes as "3.4 MB" or "212.4 GB"."""
    return f"{count / 1e6:.1f} MB" if count < 1e9 else f"{count / 1e9:.1f} GB"


class _Record(Frozen):
    fieldtruth: str
    """Version that wrote it."""
    experiment: Digest
    """Digest of the experiment; see ``digest_of``."""

    def write(self, path: Path) -> None:
        """Write the record atomically; folders are made."""
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, json.dumps(self.model_dump(), indent=1) + "\n")

    @classmethod
    def read(cls, path: Path) -> Self | None:
        """Read a record; None if it is missing or damaged."""
        try:
            return cls.model_validate_json(path.read_bytes())
        except (OSError, ValidationError):
            return None


class Manifest(_Record):
    """A finished run."""

    bag: str
    """Name of the bag."""
    bytes: int
    sha256: Digest
    messages: dict[str, int]
    """Number by topic."""
    simulated_s: float
    took_s: float
    """Time [s] of the process that finished the run; what interrupted ones did before is not in it."""
    world_s: float = 0.0
    """Of it, time [s] for the world and its light, which later runs in the same light find in the cache."""


class Failure(_Record):
    """A run that ended with an error."""

    reason: str
    final: bool
    """True if the same version would fail again, as where no route is found."""


def digest_of(experiment: Experiment) -> str:
    """SHA-256 of the values of an experiment."""
    return hashlib.sha256(json.dumps(experiment.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()


def failure_of(experiment: Experiment, reason: str, *, final: bool) -> Failure:
    """Record of a failure with the installed version."""
    line = " ".join(reason.split())
    return Failure(fieldtruth=fieldtruth.__version__, experiment=digest_of(experiment), reason=line, final=final)


class Kind(StrEnum):
    """State of a run."""

    DONE = "done"
    RUNNING = "running"
    MISSING = "missing"
    BROKEN = "broken"
    FAILED = "failed"


class State(NamedTuple):
    """State of a run, with the reason why it is not done and the manifest of a finished one."""

    run: PlannedRun
    kind: Kind
    reason: str = ""
    manifest: Manifest | None = None
    final: bool = False
    """Of a failed run: whether this version would fail again."""

    @property
    def is_left(self) -> bool:
        """True if the same command would make this run."""
        return self.kind in (Kind.MISSING, Kind.BROKEN) or (self.kind is Kind.FAILED and not self.final)


def state_of(run: PlannedRun, out: Path, *, checksums: bool = False) -> State:
    """Return the state of a run in OUT/SPLIT/NAME; ``checksums`` reads the whole bag, else its size and index."""
    folder = run.folder(out)
    if is_in_use(folder):
        return State(run, Kind.RUNNING)
    manifest = Manifest.read(folder / MANIFEST)
    digest = digest_of(run.experiment)
    if (folder / MANIFEST).exists():
        reason = _damage(folder, manifest, digest, checksums=checksums)
        return State(run, Kind.BROKEN, reason) if reason else State(run, Kind.DONE, manifest=manifest)
    failure = Failure.read(folder / FAILURE)
    if failure is not None and failure.experiment == digest:
        final = failure.final and failure.fieldtruth == fieldtruth.__version__
        return State(run, Kind.FAILED, failure.reason, final=final)
    return State(run, Kind.MISSING)


def _damage(folder: Path, manifest: Manifest | None, digest: str, *, checksums: bool) -> str:
    """Say why a run with a manifest is not done; empty if it is."""
    if manifest is None:
        return f"{MANIFEST} cannot be read"
    if manifest.experiment != digest:
        return f"{MANIFEST} is that of another experiment"
    bag = folder / manifest.bag
    if not bag.exists():
        return f"{manifest.bag} is missing"
    if bag.stat().st_size != manifest.bytes:
        return f"{manifest.bag} has {bag.stat().st_size} bytes, its manifest says {manifest.bytes}"
    try:
        with open_bag(bag):
            pass
    except BagError as error:
        return str(error)
    return f"{manifest.bag} does not fit its checksum" if checksums and sha256_of(bag) != manifest.sha256 else ""


def counts(states: Sequence[State]) -> str:
    """Return "12 of 20 done, 2 running, ..."."""
    found = Counter(state.kind for state in states)
    others = "".join(f", {found[kind]} {kind}" for kind in Kind if kind is not Kind.DONE and found[kind])
    return f"{found[Kind.DONE]} of {len(states)} done{others}"


def time_left_s(states: Sequence[State], jobs: int) -> float | None:
    """Estimate the time [s] that ``jobs`` processes need for the rest, from the finished runs of each environment.

    Building a world and baking its light count once for each world and light that is left. A run that was found
    finished, without its manifest, needed no world and says nothing about the time. None while no other run is done.
    """
    done = [(s.run.experiment, s.manifest) for s in states if s.manifest is not None and s.manifest.world_s > 0]
    left = [state.run.experiment for state in states if state.is_left or state.kind is Kind.RUNNING]
    if not done:
        return None
    time_s = 0.0
    for environment in sorted({experiment.world_name for experiment in left}):
        own = [(e, m) for e, m in done if e.world_name == environment] or done
        longest: dict[Scene, float] = {}
        for experiment, manifest in own:
            scene = _scene(experiment)
            longest[scene] = max(longest.get(scene, 0.0), manifest.world_s)
        worlds_s = sum(longest.values())
        per_second = (sum(m.took_s for _, m in own) - worlds_s) / sum(m.simulated_s for _, m in own)
        rest = [experiment for experiment in left if experiment.world_name == environment]
        new = {_scene(experiment) for experiment in rest} - longest.keys()
        time_s += per_second * sum(map(simulated_s, rest)) + worlds_s / len(longest) * len(new)
    return time_s / min(max(1, jobs), max(1, len(left)))


def _scene(experiment: Experiment) -> Scene:
    """Return the values on which the world and its light depend."""
    return experiment.world_name, experiment.seed, str(experiment.layout), str(experiment.light)

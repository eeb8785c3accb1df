# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What of a campaign is done: the state of each run from the files in its folder."""

from collections import Counter
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import fieldtruth
from fieldtruth.bag.file import BagError
from fieldtruth.bag.provenance import sha256_of
from fieldtruth.bag.reader import open_bag
from fieldtruth.campaign.draw import PlannedRun
from fieldtruth.campaign.duration import simulated_s
from fieldtruth.campaign.manifest import FAILURE, MANIFEST, Failure, Manifest, digest_of
from fieldtruth.experiment.config import Experiment
from fieldtruth.record.folder import is_in_use

Scene = tuple[str, int, str, str]


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
        """Whether the same command would make this run."""
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
    for environment in sorted({experiment.environment for experiment in left}):
        own = [(e, m) for e, m in done if e.environment == environment] or done
        longest: dict[Scene, float] = {}
        for experiment, manifest in own:
            scene = _scene(experiment)
            longest[scene] = max(longest.get(scene, 0.0), manifest.world_s)
        worlds_s = sum(longest.values())
        per_second = (sum(m.took_s for _, m in own) - worlds_s) / sum(m.simulated_s for _, m in own)
        rest = [experiment for experiment in left if experiment.environment == environment]
        new = {_scene(experiment) for experiment in rest} - longest.keys()
        time_s += per_second * sum(map(simulated_s, rest)) + worlds_s / len(longest) * len(new)
    return time_s / min(max(1, jobs), max(1, len(left)))


def _scene(experiment: Experiment) -> Scene:
    """What the world and its light depend on."""
    return experiment.environment, experiment.seed, str(experiment.layout), str(experiment.light)

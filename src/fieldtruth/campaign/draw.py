# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From a campaign to its runs: each a split and a complete experiment.

Every run has random generators of its own, one for each axis, so a run depends neither on those before it nor on the
number of runs: a larger ``runs`` keeps the earlier ones. The layout of a world is drawn once per environment and seed.
"""

import hashlib
import math
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from pydantic import ValidationError

from fieldtruth.campaign.config import BUILT_IN, MOST_RUNS, PRODUCT, Campaign, axis, entries
from fieldtruth.campaign.distributions import Tree, drawn
from fieldtruth.campaign.split import splits_of
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.catalogue import experiment_names
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.experiment.problems import configuration_error
from fieldtruth.experiment.sections import SECTIONS

_RUN, _LAYOUT, _SPLIT = range(3)
_AXES: Final = ("environments", "seeds", "routes", "lights", "rigs", "seconds")


class PlannedRun(NamedTuple):
    """One run of a campaign."""

    split: str
    """Its split, which is a folder; empty in a campaign without."""
    experiment: Experiment

    @property
    def name(self) -> str:
        """Name of the run within the campaign, such as train/autumn_00001."""
        return f"{self.split}/{self.experiment.name}" if self.split else self.experiment.name

    def folder(self, out: Path) -> Path:
        """Folder of the run, OUT/SPLIT/NAME."""
        return out / self.name


class Entries(NamedTuple):
    """What a run takes from the axes; distributions in them are not drawn yet."""

    environment: str
    seed: int
    layout: Tree
    route: Tree
    light: Tree
    rig: Tree


def draw(campaign: Campaign, source: str = "") -> tuple[PlannedRun, ...]:
    """Draw the runs of a campaign; ``source``, a file for example, is put in front of errors.

    Raises:
        ConfigurationError: a drawn value that is not allowed, too many runs, or a split without a world.
    """
    try:
        return _drawn(campaign)
    except ConfigurationError as error:
        raise ConfigurationError(f"{source}: {error}" if source else str(error)) from error


def _drawn(campaign: Campaign) -> tuple[PlannedRun, ...]:
    if campaign.experiments:
        experiments = [_changed(campaign, experiment, k) for k, experiment in enumerate(campaign.experiments)]
    else:
        taken = _every(campaign) if campaign.runs == PRODUCT else _some(campaign)
        experiments = [_made(campaign, entry, k) for k, entry in enumerate(taken)]
    worlds = [world_of_run(experiment) for experiment in experiments]
    shares = {} if campaign.split is None else campaign.split.shares
    splits = splits_of(worlds, shares, lambda i: _rng(campaign, _SPLIT, i))
    return tuple(PlannedRun(split, experiment) for split, experiment in zip(splits, experiments, strict=True))


def world_of_run(experiment: Experiment) -> tuple[str, int]:
    """Return what selects the split of a run: environment and seed.

    Worlds that differ in their layout alone share the ground and most objects, so they stay in one split.
    """
    return experiment.environment, experiment.seed


def _some(campaign: Campaign) -> Iterator[Entries]:
    assert isinstance(campaign.runs, int)
    for k in range(campaign.runs):
        environment = str(axis(campaign.environments).draw(_rng(campaign, _RUN, k, "environments")))
        seed = int(_entry(campaign, "seeds", k, default=0))
        layouts = axis(campaign.layouts.get(environment, {}))
        layout = layouts.draw(_rng(campaign, _LAYOUT, environment, seed))
        rest = [_entry(campaign, key, k) for key in ("routes", "lights", "rigs")]
        yield Entries(environment, seed, layout, *rest)


def _every(campaign: Campaign) -> Iterator[Entries]:
    seeds = (0,) if campaign.seeds is None else entries(campaign.seeds)
    axes = [entries(tree) for tree in (campaign.environments, campaign.routes, campaign.lights, campaign.rigs)]
    if len(seeds) * math.prod(map(len, axes)) > MOST_RUNS:
        raise ConfigurationError(f"runs: {PRODUCT} gives more than {MOST_RUNS} runs; give fewer entries")
    for seed, environment in ((s, e) for s in seeds for e in entries(campaign.environments)):
        routes = [
            route
            for entry in entries(campaign.routes)
            for route in (_built_in(environment) if entry == BUILT_IN else [entry])
        ]
        layouts = [
            drawn(layout, _rng(campaign, _LAYOUT, environment, seed, i))
            for i, layout in enumerate(entries(campaign.layouts.get(environment, {})))
        ]
        others = product(layouts, routes, entries(campaign.lights), entries(campaign.rigs))
        yield from (Entries(environment, seed, *other) for other in others)


def _entry(campaign: Campaign, key: str, k: int, default: Tree = None) -> Any:
    tree = getattr(campaign, key)
    return default if tree is None else axis(tree).draw(_rng(campaign, _RUN, k, key))


def _made(campaign: Campaign, taken: Entries, k: int) -> Experiment:
    """Make the experiment of run k."""
    rng = _rng(campaign, _RUN, k, "routes", 1)
    route = _built_in(taken.environment) if taken.route == BUILT_IN else [taken.route]
    base = _route(route[int(rng.integers(len(route)))], rng)
    light, rig = (drawn(part, _rng(campaign, _RUN, k, key, 1)) for part, key in ((taken.light, "l"), (taken.rig, "r")))
    values = base | {
        "name": f"{campaign.name}_{k + 1:05d}",
        "description": "",
        "environment": taken.environment,
        "seed": taken.seed,
        "layout": taken.layout,
        "light": light,
        "rig": rig,
    }
    return _finished(campaign, values, k)


def _changed(campaign: Campaign, experiment: Experiment, k: int) -> Experiment:
    """Return a listed experiment with what the campaign changes in it."""
    changes: dict[str, Any] = {
        "light": _entry(campaign, "lights", k),
        "rig": _entry(campaign, "rigs", k),
        **({} if campaign.seeds is None else {"seed": _entry(campaign, "seeds", k)}),
    }
    layout = campaign.layouts.get(experiment.environment)
    if layout is not None:
        seed = changes.get("seed", experiment.seed)
        changes["layout"] = axis(layout).draw(_rng(campaign, _LAYOUT, experiment.environment, seed))
    return _finished(campaign, changed_values(experiment, changes), k)


def _finished(campaign: Campaign, values: dict[str, Any], k: int) -> Experiment:
    try:
        experiment = Experiment.model_validate(values)
        frames = experiment.frames is not None  # as many as its count says
        seconds = None if frames else drawn(campaign.seconds, _rng(campaign, _RUN, k, "seconds"))
        kept = {key: getattr(campaign, key) for key in ("cameras", "lidar", "extras", "signal")}
        return with_overrides(experiment, seconds=seconds, **kept)
    except ValidationError as report:
        raise configuration_error(Experiment, report, str(values["name"])) from report


def _route(entry: Tree, rng: np.random.Generator) -> dict[str, Any]:
    """Values of an experiment that a route entry gives."""
    if isinstance(entry, str):
        builtin = _catalogue()[entry].model_dump()
        return {key: builtin[key] for key in ("route", "control", "soil")}
    values = drawn(entry, rng)
    if isinstance(values.get("frames"), Mapping):
        return {"frames": {"seed": int(rng.integers(2**31))} | values["frames"]}
    if isinstance(values.get("random"), Mapping):
        values["random"] = {"seed": int(rng.integers(2**31))} | values["random"]
    return {"route": values}


def _built_in(environment: str) -> list[str]:
    names = [name for name, experiment in _catalogue().items() if experiment.environment == environment]
    if not names:
        raise ConfigurationError(
            f"routes: {environment} has no built-in experiment; give routes: {{random: {{length_m: ...}}}}"
        )
    return names


@cache
def _catalogue() -> dict[str, Experiment]:
    return {name: load_experiment(name) for name in experiment_names()}


def changed_values(experiment: Experiment, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of an experiment with ``changes``, mapping by mapping.

    Sensors of its rig that are not changed stay as they are. A section, like ``lidar``, changes the first of its kind.
    """
    values = merged(experiment.model_dump(exclude_unset=True), changes)
    rig, change = experiment.rig, dict(changes.get("rig") or {})
    for key, section in change.items():
        kind = SECTIONS[key].model_fields.get("kind") if key in SECTIONS else None
        first = next((sensor for sensor in rig.sensors if kind is not None and sensor.kind == kind.default), None)
        if first is not None and isinstance(section, Mapping) and "model" not in section:
            own = first.model_dump(exclude_unset=True)
            change[key] = merged({name: own[name] for name in section if name in own}, section)
    own_rig = rig.model_dump(exclude_unset=True, exclude={"sensors"}) | {"sensors": rig.sensors}
    return values | {"rig": merged(own_rig, change)}


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``base`` with ``changes``, mapping by mapping."""
    both = dict(base)
    for key, value in changes.items():
        old = both.get(key)
        both[key] = merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return both


def _rng(campaign: Campaign, *position: int | str) -> np.random.Generator:
    words = [int.from_bytes(hashlib.sha256(str(part).encode()).digest()[:8]) for part in position]
    return np.random.default_rng(np.random.SeedSequence(campaign.seed, spawn_key=words))

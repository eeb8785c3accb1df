# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From a campaign to its runs: each a split and a complete experiment.

Every run has random generators of its own, one for each axis, so a run depends neither on those before it nor on the
number of runs: a larger ``runs`` keeps the earlier ones. The layout of a world is drawn once per environment and seed.
Every world, with all its runs, is in exactly one of train, val and test. Shards are the runs in N parts.
"""

import hashlib
import math
import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from pydantic import ValidationError

from fieldtruth.bag.track_file import read_track_file
from fieldtruth.campaign.config import BUILT_IN, MOST_RUNS, PRODUCT, Campaign, Tree, axis, drawn, entries
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.config import FRAME_RATE, RANDOM_ROUTE, Experiment, RandomRouteConfig, metres_from_route
from fieldtruth.experiment.environment_file import is_environment_file, world_name
from fieldtruth.experiment.fields import configuration_error
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.experiment.rig import SECTIONS
from fieldtruth.experiment.sensor_config import PRESET, SIGNAL

T = TypeVar("T")
_RUN, _LAYOUT, _SPLIT = range(3)
_AXES: Final = ("environments", "seeds", "routes", "lights", "weathers", "rigs", "seconds")


def simulated_s(experiment: Experiment) -> float:
    """Return the simulated time [s]: until the route's end at the controller's speed, at most ``seconds``."""
    if experiment.frames is not None:
        return experiment.frames.count / FRAME_RATE
    limit = float("inf") if experiment.seconds is None else experiment.seconds
    if experiment.drive is not None:
        if experiment.seconds is not None:
            return limit
        stamps = read_track_file(experiment.drive).poses.stamps_ns
        return float(stamps[-1] - stamps[0]) / 1e9
    route = experiment.route
    if isinstance(route, RandomRouteConfig):
        length = route.random.length_m
    else:
        length = float(np.linalg.norm(np.diff(metres_from_route(route, experiment.origin), axis=0), axis=1).sum())
    return min(limit, length / experiment.control.speed)


def motion_of(experiment: Experiment) -> str:
    """Say what moves the robot: runs of one environment that differ in it differ in cost, too."""
    if experiment.frames is not None:
        return "frames"
    if experiment.drive is not None:
        return "track file"
    return "random route" if isinstance(experiment.route, RandomRouteConfig) else "route"


def splits_of(
    worlds: Sequence[Hashable], shares: Mapping[str, float], rng_of: Callable[[int], np.random.Generator]
) -> list[str]:
    """Return the split of each run.

    Worlds get their split in the order in which they first occur, so that later runs do not move earlier ones: the
    first ones give every split a world, each other is drawn among the splits in proportion to the worlds that they
    lack. A split never exceeds its share by a whole world.

    Args:
        worlds: the world of each run.
        shares: share of the worlds by split; empty for no split, then all are "".
        rng_of: random generator of the i-th world.

    Raises:
        ConfigurationError: fewer worlds than splits.
    """
    found: dict[Hashable, str] = {}
    names = list(shares)
    counts = np.zeros(len(names), int)
    for world in worlds if names else ():
        if world not in found:
            lacking = np.array([*shares.values()]) * (len(found) + 1) - counts
            empty = np.flatnonzero(counts == 0)
            weights = np.maximum(lacking, 0.0)
            drawn = rng_of(len(found)).choice(len(names), p=weights / weights.sum())
            chosen = int(empty[0] if len(empty) else drawn)
            counts[chosen] += 1
            found[world] = names[chosen]
    if len(found) < len(names):
        raise ConfigurationError(
            f"split: {', '.join(names[len(found) :])} would be empty, because the runs have {len(found)} "
            f"world{'s' * (len(found) != 1)} (environments and seeds) for {len(names)} splits; give more runs or seeds"
        )
    return [found.get(world, "") for world in worlds]


class Shard(NamedTuple):
    """Part ``part`` of ``parts``, counted from 1."""

    part: int
    parts: int

    def has(self, k: int) -> bool:
        """Return whether run k, counted from 0, is in this part.

        Each N runs in a row are in N different parts, in an order that moves on by one from row to row: parts differ by
        at most one run, and a product whose axes have N entries does not put one environment into one part. With as
        many parts as runs, part I is run I.
        """
        row, column = divmod(k, self.parts)
        return (column + row) % self.parts == self.part - 1

    def of(self, runs: Sequence[T]) -> list[T]:
        """Return the runs of this part."""
        return [run for k, run in enumerate(runs) if self.has(k)]


def parse_shard(text: str) -> Shard:
    """Parse "I/N", part I of N, counted from 1.

    Raises:
        ConfigurationError: another form, or a part that does not exist.
    """
    match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
    if match is None:
        raise ConfigurationError(f"a shard must be I/N, part I of N, such as 3/10, got {text!r}")
    shard = Shard(int(match[1]), int(match[2]))
    if not 1 <= shard.part <= shard.parts:
        raise ConfigurationError(
            f"a shard must be I/N with I from 1 to N, got {text!r}; as a SLURM array: --array=1-N, and N as a number, "
            f"because SLURM_ARRAY_TASK_COUNT of a smaller array is smaller"
        )
    return shard


def ranges(numbers: Iterable[int]) -> str:
    """Write numbers as in a SLURM array: "1,4-7,12"."""
    spans: list[list[int]] = []
    for number in sorted(set(numbers)):
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in spans)


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
    """Entries of the axes for one run; distributions in them are not drawn yet."""

    environment: str
    seed: int
    layout: Tree
    route: Tree
    light: Tree
    weather: Tree
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
    return experiment.world_name, experiment.seed


def _some(campaign: Campaign) -> Iterator[Entries]:
    assert isinstance(campaign.runs, int)
    for k in range(campaign.runs):
        environment = str(axis(campaign.environments).draw(_rng(campaign, _RUN, k, "environments")))
        seed = int(_entry(campaign, "seeds", k, default=0))
        layouts = axis(campaign.layouts.get(environment, {}))
        layout = layouts.draw(_rng(campaign, _LAYOUT, world_name(environment), seed))
        rest = [_entry(campaign, key, k) for key in ("routes", "lights", "weathers", "rigs")]
        yield Entries(environment, seed, layout, *rest)


def _every(campaign: Campaign) -> Iterator[Entries]:
    seeds = (0,) if campaign.seeds is None else entries(campaign.seeds)
    trees = campaign.environments, campaign.routes, campaign.lights, campaign.weathers, campaign.rigs
    axes = [entries(tree) for tree in trees]
    if len(seeds) * math.prod(map(len, axes)) > MOST_RUNS:
        raise ConfigurationError(f"runs: {PRODUCT} gives more than {MOST_RUNS} runs; give fewer entries")
    for seed, environment in ((s, e) for s in seeds for e in entries(campaign.environments)):
        routes = [
            route
            for entry in entries(campaign.routes)
            for route in (_built_in(environment) if entry == BUILT_IN else [entry])
        ]
        layouts = [
            drawn(layout, _rng(campaign, _LAYOUT, world_name(environment), seed, i))
            for i, layout in enumerate(entries(campaign.layouts.get(environment, {})))
        ]
        others = product(layouts, routes, *axes[2:])
        yield from (Entries(environment, seed, *other) for other in others)


def _entry(campaign: Campaign, key: str, k: int, default: Tree = None) -> Any:
    tree = getattr(campaign, key)
    return default if tree is None else axis(tree).draw(_rng(campaign, _RUN, k, key))


def _made(campaign: Campaign, taken: Entries, k: int) -> Experiment:
    """Make the experiment of run k."""
    rng = _rng(campaign, _RUN, k, "routes", 1)
    route = _built_in(taken.environment) if taken.route == BUILT_IN else [taken.route]
    base = _route(route[int(rng.integers(len(route)))], rng)
    parts = (taken.light, "l"), (taken.weather, "w"), (taken.rig, "r")
    light, weather, rig = (drawn(part, _rng(campaign, _RUN, k, key, 1)) for part, key in parts)
    values = base | {
        "name": f"{campaign.name}_{k + 1:05d}",
        "description": "",
        "environment": taken.environment,
        "seed": taken.seed,
        "layout": taken.layout,
        "light": light,
        "weather": weather,
        "rig": rig,
    }
    return _finished(campaign, values, k)


def _changed(campaign: Campaign, experiment: Experiment, k: int) -> Experiment:
    """Return a listed experiment with what the campaign changes in it."""
    changes: dict[str, Any] = {
        "light": _entry(campaign, "lights", k),
        "weather": _entry(campaign, "weathers", k),
        "rig": _entry(campaign, "rigs", k),
        **({} if campaign.seeds is None else {"seed": _entry(campaign, "seeds", k)}),
    }
    layout = campaign.layouts.get(experiment.world_name)
    if layout is not None:
        seed = changes.get("seed", experiment.seed)
        changes["layout"] = axis(layout).draw(_rng(campaign, _LAYOUT, experiment.world_name, seed))
    return _finished(campaign, changed_values(experiment, changes), k)


def _finished(campaign: Campaign, values: dict[str, Any], k: int) -> Experiment:
    try:
        experiment = Experiment.model_validate(values)
        frames = experiment.frames is not None  # as many as its count says
        seconds = None if frames else drawn(campaign.seconds, _rng(campaign, _RUN, k, "seconds"))
        kept: dict[str, Any] = {"extras": campaign.extras, "signal": campaign.signal, **campaign.switches}
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


def _built_in(environment: str) -> list[Tree]:
    if is_environment_file(environment):
        return [{"random": {"length_m": RANDOM_ROUTE["random"]["length_m"]}}]
    names: list[Tree] = [
        name for name, made in _catalogue().items() if made.environment == environment and not made.is_living
    ]
    if not names:
        raise ConfigurationError(
            f"routes: {environment} has no built-in experiment; give routes: {{random: {{length_m: ...}}}}"
        )
    return names


@cache
def _catalogue() -> dict[str, Experiment]:
    return {name: load_experiment(name) for name in EXPERIMENTS}


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
        replaces = key == SIGNAL and isinstance(value, Mapping) and PRESET in value  # it would have every old figure
        if isinstance(old, Mapping) and isinstance(value, Mapping) and not replaces:
            value = merged(old, value)
        both[key] = value
    return both


def _rng(campaign: Campaign, *position: int | str) -> np.random.Generator:
    words = [int.from_bytes(hashlib.sha256(str(part).encode()).digest()[:8]) for part in position]
    return np.random.default_rng(np.random.SeedSequence(campaign.seed, spawn_key=words))

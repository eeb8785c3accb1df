# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Split runs into parts for training and testing: whole runs, because neighbouring frames show the same objects."""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.datasets.folder import Runs
from fieldtruth.datasets.run import RunDataset

Groups = list[list[RunDataset]]


def split(
    runs: Runs,
    *,
    rng: np.random.Generator | None = None,
    by: Literal["run", "world"] = "run",
    **parts: float | Sequence[str],
) -> dict[str, Runs]:
    """Split runs into data sets without a common run.

    Args:
        runs: all runs.
        rng: assigns runs to parts; required with shares.
        by: unit that is not split: a run, or all runs in the same world (equal environment, layout and seed).
        parts: by name, shares of the number of runs (or worlds) with the sum 1, ``train=0.7, val=0.3``; or lists of
            runs, ``train=["park_1", "lake_1"], val=["forest_1"]``.

    Raises:
        ConfigurationError: fewer runs than parts, shares whose sum is not 1, or a run in two lists.
        UnknownNameError: an unknown run in a list.
    """
    shares = {name: float(part) for name, part in parts.items() if isinstance(part, int | float)}
    lists = {name: part for name, part in parts.items() if not isinstance(part, int | float)}
    if not parts or (shares and lists):
        raise ConfigurationError("parts must be either all shares, such as train=0.7, val=0.3, or all lists of runs")
    groups = _groups(runs, by)
    chosen = _by_list(runs, groups, by, lists) if lists else _by_share(groups, by, shares, rng)
    return {name: Runs([run for run in runs.runs if run in members]) for name, members in chosen.items()}


def _groups(runs: Runs, by: str) -> Groups:
    """Group runs that must not be separated; data sets of the same bag never are."""
    if by not in ("run", "world"):
        raise UnknownNameError("unit of a split", by, ("run", "world"))
    groups: dict[object, list[RunDataset]] = {}
    for run in runs.runs:
        world = run.run.world
        groups.setdefault(run.run.bag.resolve() if by == "run" or world is None else world, []).append(run)
    return list(groups.values())


def _by_share(
    groups: Groups, by: str, shares: Mapping[str, float], rng: np.random.Generator | None
) -> dict[str, list[RunDataset]]:
    values = np.array(list(shares.values()))
    if not (values > 0.0).all() or abs(values.sum() - 1.0) > 1e-6:
        raise ConfigurationError(f"shares must be above 0 with the sum 1, got {', '.join(f'{v:g}' for v in values)}")
    if len(groups) < len(values):
        raise ConfigurationError(f"{len(values)} parts need at least {len(values)} {by}s, got {len(groups)}")
    if rng is None:
        raise ConfigurationError("shares need a random generator, such as rng=np.random.default_rng(0)")
    counts = np.ones(len(values), np.int64)
    while counts.sum() < len(groups):
        counts[np.argmax(values * len(groups) - counts)] += 1
    drawn = np.split(rng.permutation(len(groups)), np.cumsum(counts)[:-1])
    return {name: [run for k in own for run in groups[k]] for name, own in zip(shares, drawn, strict=True)}


def _by_list(runs: Runs, groups: Groups, by: str, lists: Mapping[str, Sequence[str]]) -> dict[str, list[RunDataset]]:
    taken: dict[int, tuple[str, str]] = {}
    for part, names in lists.items():
        if isinstance(names, str) or not names:
            raise ConfigurationError(f"part {part!r} must be a share or a list of runs, got {names!r}")
        for name in names:
            if name not in runs.names:
                raise UnknownNameError("run", name, runs.names)
            group = next(k for k, members in enumerate(groups) if any(run.name == name for run in members))
            other, first = taken.setdefault(group, (part, name))
            if other != part:
                what = f"run {name!r} is" if first == name else f"{first!r} and {name!r} are of the same {by}, which is"
                raise ConfigurationError(f"{what} in two parts, {other!r} and {part!r}")
    return {part: [run for run in runs.runs if run.name in names] for part, names in lists.items()}

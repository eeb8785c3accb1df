# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts for training and testing: whole runs, never neighbouring frames, which show the same things."""

import json
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
    """Part runs into data sets that have no run in common.

    Args:
        runs: all of them.
        rng: draws which run goes where; needed for shares.
        by: what stays together: each run, or all runs through the same world (environment, layout and seed are equal).
        parts: by name, shares of the number of runs (or worlds) that add to 1, ``train=0.7, val=0.3``; or lists of
            runs, ``train=["park_1", "lake_1"], val=["forest_1"]``.

    Raises:
        ConfigurationError: fewer runs than parts, shares that do not add to 1, or a run that is in two lists.
        UnknownNameError: a list names a run that does not exist.
    """
    shares = {name: float(part) for name, part in parts.items() if isinstance(part, int | float)}
    lists = {name: part for name, part in parts.items() if not isinstance(part, int | float)}
    if not parts or (shares and lists):
        raise ConfigurationError("parts are either all shares, as train=0.7, val=0.3, or all lists of runs")
    groups = _groups(runs, by)
    chosen = _by_list(runs, groups, by, lists) if lists else _by_share(groups, by, shares, rng)
    return {name: Runs([run for run in runs.runs if run in members]) for name, members in chosen.items()}


def _groups(runs: Runs, by: str) -> Groups:
    """Runs that stay together; the cameras of one bag always do."""
    if by not in ("run", "world"):
        raise UnknownNameError("way to split by", by, ("run", "world"))
    groups: dict[object, list[RunDataset]] = {}
    for run in runs.runs:
        made_by = run.run.experiment
        if by == "run" or made_by is None:
            groups.setdefault(run.run.bag.resolve(), []).append(run)
        else:
            world = made_by.model_dump(mode="json", include={"environment", "seed", "layout"})
            groups.setdefault(json.dumps(world, sort_keys=True), []).append(run)
    return list(groups.values())


def _by_share(
    groups: Groups, by: str, shares: Mapping[str, float], rng: np.random.Generator | None
) -> dict[str, list[RunDataset]]:
    values = np.array(list(shares.values()))
    if not (values > 0.0).all() or abs(values.sum() - 1.0) > 1e-6:
        raise ConfigurationError(f"shares must be above 0 and add to 1, not {', '.join(f'{v:g}' for v in values)}")
    if len(groups) < len(values):
        there = f"there {'is' if len(groups) == 1 else 'are'} {len(groups)}"
        raise ConfigurationError(f"{len(values)} parts need at least as many {by}s; {there}")
    if rng is None:
        raise ConfigurationError("shares need rng=np.random.default_rng(0), say: it draws what goes where")
    counts = np.ones(len(values), np.int64)
    while counts.sum() < len(groups):
        counts[np.argmax(values * len(groups) - counts)] += 1
    drawn = np.split(rng.permutation(len(groups)), np.cumsum(counts)[:-1])
    return {name: [run for k in own for run in groups[k]] for name, own in zip(shares, drawn, strict=True)}


def _by_list(runs: Runs, groups: Groups, by: str, lists: Mapping[str, Sequence[str]]) -> dict[str, list[RunDataset]]:
    taken: dict[int, tuple[str, str]] = {}
    for part, names in lists.items():
        if isinstance(names, str) or not names:
            raise ConfigurationError(f"part {part!r} must be a share or a list of runs, not {names!r}")
        for name in names:
            if name not in runs.names:
                raise UnknownNameError("run", name, runs.names)
            group = next(k for k, members in enumerate(groups) if any(run.name == name for run in members))
            other, first = taken.setdefault(group, (part, name))
            if other != part:
                what = f"run {name!r} is" if first == name else f"{first!r} and {name!r} show one {by}, which is"
                raise ConfigurationError(f"{what} in two parts, {other!r} and {part!r}")
    return {part: [run for run in runs.runs if run.name in names] for part, names in lists.items()}

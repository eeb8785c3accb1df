# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Check of a campaign before it starts: names, and both ends of every distribution against what experiments allow."""

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import ValidationError

from fieldtruth.campaign.config import BUILT_IN, ROUTES, Campaign, axis, entries
from fieldtruth.campaign.distributions import Integers, Tree, extremes
from fieldtruth.campaign.draw import changed_values
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.problems import configuration_error, shortened
from fieldtruth.experiment.sensor_families import EXTRAS
from fieldtruth.world.build import check_experiment, check_layout


def check_campaign(campaign: Campaign, source: str) -> None:
    """Check names, layouts and the ends of distributions; ``source``, a file for example, is put in front of errors.

    Raises:
        UnknownNameError: unknown environment or extra.
        ConfigurationError: a value that is not allowed.
    """
    for experiment in campaign.experiments:
        check_experiment(experiment, f"{source}: {experiment.name}")
    for environment in () if campaign.experiments else entries(campaign.environments):
        check_layout(environment, {}, source)
    for environment, tree in campaign.layouts.items():
        for position, end in _ends(f"layouts.{environment}", tree):
            check_layout(environment, end, f"{source}: {position}")
    _check_routes(campaign.routes, source)
    for key, name in (("seeds", "seed"), ("lights", "light"), ("weathers", "weather"), ("rigs", "rig")):
        for position, end in _ends(key, getattr(campaign, key)):
            for experiment in campaign.experiments:
                _check_values(changed_values(experiment, {name: end}), f"{source}: {position}: {experiment.name}")
            if not campaign.experiments:
                _check_values({name: end}, f"{source}: {position}")
    for name in campaign.extras or ():
        if name not in EXTRAS:
            raise UnknownNameError("extra", name, EXTRAS, source)
    runs = campaign.experiments or (() if campaign.routes == BUILT_IN else entries(campaign.routes))
    if campaign.seconds is not None and runs and all(map(_has_frames, runs)):
        raise ConfigurationError(f"{source}: seconds is for drives; of frames, frames.count says how many there are")
    for end in extremes(campaign.seconds):
        _check_values({"seconds": end}, source)


def _has_frames(run: Experiment | Tree) -> bool:
    return run.frames is not None if isinstance(run, Experiment) else isinstance(run, Mapping) and "frames" in run


def _check_routes(tree: Tree, source: str) -> None:
    for position, end in _ends("routes", tree):
        if end == BUILT_IN:
            continue
        if isinstance(end, str) or end.keys() not in ({"random"}, {"frames"}):
            raise ConfigurationError(f"{source}: {position} must be {ROUTES}, got {shortened(end)}")
        if "frames" in end:
            _check_values({"route": None, "frames": end["frames"]}, f"{source}: {position}")
            continue
        values = {"seed": 0} | end["random"] if isinstance(end["random"], dict) else end["random"]
        _check_values({"route": {"random": values}}, f"{source}: {position}")


def _ends(key: str, tree: Tree) -> Iterator[tuple[str, Any]]:
    """Entries of an axis at the ends of their distributions, each with its position in the file."""
    if tree is None:
        return
    found = axis(tree)
    rows = found.integers if isinstance(found, Integers) else found.choice
    for i, entry in enumerate(rows):
        yield from ((f"{key}[{i}]" if len(rows) > 1 else key, end) for end in extremes(entry))


def _check_values(values: dict[str, Any], source: str) -> None:
    base = {"name": "x", "environment": "x", "route": {"random": {"length_m": 100, "seed": 0}}}
    try:
        Experiment.model_validate(base | values)
    except ValidationError as report:
        raise configuration_error(Experiment, report, source) from report

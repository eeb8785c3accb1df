# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-commands for existing runs and bags: export, annotate, validate, report, view."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Final

from fieldtruth.cli.arguments import UsageError, chosen
from fieldtruth.cli.generation import warn_of_missing
from fieldtruth.cli.terminal import print_output
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import show_progress
from fieldtruth.experiment.environment_file import world_name

FAILED: Final = 1
"""Exit code of a run that fails validation."""


def _export(options: argparse.Namespace) -> None:
    from fieldtruth.exporters import FORMATS, MapOptions, export

    if options.to in FORMATS and FORMATS[options.to].publishes:
        for path in options.runs:
            warn_of_missing(path)
    with show_progress() as progress:
        made = export(
            options.runs,
            options.to,
            out=options.out,
            label_map=options.label_map,
            split=options.split,
            shard_mb=options.shard_mb,
            boxes=options.boxes,
            voxel_m=options.voxel,
            maps=MapOptions(options.side, options.resolution, options.layers, options.cost),
            workers=options.workers,
            progress=progress,
        )
    print_output(made)


def _annotate(options: argparse.Namespace) -> None:
    from fieldtruth.annotation import WorldConfig, annotate
    from fieldtruth.bag.run import open_run
    from fieldtruth.core.readings import Cloud
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.experiment.rig import Rig

    like = None if options.experiment is None else load_experiment(options.experiment)
    if like is not None and world_name(options.environment) not in (like.world_name, like.environment):
        expected = f"{like.world_name!r}, the environment of {options.experiment}"
        raise UsageError(f"--environment must be {expected}, got {options.environment!r}")
    if like is not None and like.moving and open_run(options.bag).experiment is None:
        what = f"{options.experiment} has {' and '.join(like.moving)}"
        known = "what moves is labelled in runs that have their experiment.yaml"
        raise UsageError(f"{what}: {known}, and {options.bag} has none")
    rig = Rig() if like is None else like.rig
    if not options.clouds:
        rig = rig.with_each(lambda each: {"enabled": False} if issubclass(each.gives, Cloud) else {})
    environment, layout = chosen(options, None, None if like is None else like.layout)
    world = (
        WorldConfig(environment, layout=layout)
        if like is None
        else WorldConfig(like.environment, like.seed, like.layout, like.light, like.weather)
    )
    if options.seed is not None:
        world = replace(world, seed=options.seed)
    if options.layout is not None:
        world = replace(world, layout=layout)
    with show_progress() as progress:
        made = annotate(
            options.bag,
            world,
            rig=rig,
            robot=options.robot,
            out=options.out,
            workers=options.workers,
            progress=progress,
        )
    print_output(made)


def _validate(options: argparse.Namespace) -> int:
    from fieldtruth.bag.file import runs_of_robots
    from fieldtruth.cost.check import has_costs, validate_cost_map
    from fieldtruth.local_maps.check import costs_in, is_map, maps_in, validate_map
    from fieldtruth.validation import Check, as_json, as_text
    from fieldtruth.validation.runner import validate

    failed, robots = False, runs_of_robots(options.run_path)
    for path in map(Path, robots or [options.run_path]):
        with show_progress() as progress:
            own = {"workers": options.workers, "progress": progress}
            alone = is_map(path)
            maps = [path] if alone else maps_in(path) * (not options.quick)
            costs = [each for folder in maps for each in costs_in(folder)]
            checks = list[Check]()
            if not alone:
                checks += validate(path, quick=options.quick, full=options.full, samples=options.samples, **own)
            for each in [*maps, *costs]:
                try:
                    checks += (validate_cost_map if each in costs or has_costs(each) else validate_map)(each, **own)
                except FieldtruthError as error:
                    if each == path:
                        raise
                    name = "costs" if each in costs else "local maps"
                    checks.append(Check(name, False, str(error)))  # beside those of the run
        heading = f"{path}:\n" * bool(robots and not options.json)
        print(heading + (as_json(checks) if options.json else as_text(checks)))
        failed |= any(check.passed is False for check in checks)
    return FAILED if failed else 0


def _report(options: argparse.Namespace) -> None:
    from fieldtruth.report.page import write_report

    with show_progress() as progress:
        made = write_report(options.run_path, out=options.out, overwrite=options.overwrite, progress=progress)
    print_output(made)


def _view(options: argparse.Namespace) -> None:
    from fieldtruth.report.viewer import view

    with show_progress() as progress:
        view(options.run_path, save=options.save, progress=progress)
    if options.save is not None:
        print_output(Path(options.save))


COMMANDS: Final = {"export": _export, "annotate": _annotate, "validate": _validate, "report": _report, "view": _view}
"""Sub-commands by name."""

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-commands for existing runs and bags: export, annotate, validate, report, view."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Final

from fieldtruth.cli.arguments import AddCommand, UsageError, add_workers, checked_layout, count, number, seed
from fieldtruth.cli.generation import warn_of_missing
from fieldtruth.cli.terminal import print_output
from fieldtruth.core.progress import show_progress

FAILED: Final = 1
"""Exit code of a run that fails validation."""

RUN: Final = "folder of a run, or a bag file"


def _export(options: argparse.Namespace) -> None:
    from fieldtruth.exporters import FORMATS, export

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
            workers=options.workers,
            progress=progress,
        )
    print_output(made)


def _annotate(options: argparse.Namespace) -> None:
    from fieldtruth.annotation import WorldConfig, annotate
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.experiment.rig import Rig

    like = None if options.experiment is None else load_experiment(options.experiment)
    if like is not None and like.environment != options.environment:
        expected = f"{like.environment!r}, the environment of {options.experiment}"
        raise UsageError(f"--environment must be {expected}, got {options.environment!r}")
    rig = Rig() if like is None else like.rig
    if not options.lidar:
        rig = rig.with_each(lambda each: {"enabled": False} if each.switch == "lidar" else {})
    world = (
        WorldConfig(options.environment)
        if like is None
        else WorldConfig(like.environment, like.seed, like.layout, like.light, like.weather)
    )
    if options.seed is not None:
        world = replace(world, seed=options.seed)
    if options.layout is not None:
        world = replace(world, layout=checked_layout(options.environment, options.layout))
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
    from fieldtruth.validation import as_json, as_text
    from fieldtruth.validation.runner import validate

    with show_progress() as progress:
        checks = validate(
            options.run_path,
            workers=options.workers,
            progress=progress,
            quick=options.quick,
            full=options.full,
            samples=options.samples,
        )
    print(as_json(checks) if options.json else as_text(checks))
    return FAILED if any(check.passed is False for check in checks) else 0


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


# ---------------------------------------------------------------------------------------------------------------------
# Arguments


def add_commands(command: AddCommand) -> None:
    """Add the sub-commands."""
    export = command("export", _export, "Export runs to another format.")
    export.add_argument(
        "runs", metavar="RUN", type=Path, nargs="+", help=f"{RUN}; for data sets, also a folder of runs"
    )
    export.add_argument(
        "--to",
        metavar="FORMAT",
        required=True,
        help="files, zip, semantickitti, kitti, kitti-object, tum, mcap, coco, occupancy, pcd, webdataset, "
        "huggingface, mmseg, slam-configs or stereo-depth",
    )
    export.add_argument("--out", metavar="PATH", help="output (beside the bag, named after it)")
    export.add_argument("--label-map", metavar="NAME", help="ontology: ganav6, goose, goose9, rellis or rugd")
    export.add_argument("--split", metavar="NAME", help="of runs outside folders train, val and test (train)")
    export.add_argument("--shard-mb", metavar="N", type=count, help="largest file of many frames [MB] (500)")
    export.add_argument("--boxes", action="store_true", help="of coco: boxes of whole objects in image and space")
    export.add_argument("--voxel", metavar="M", type=number, help="of occupancy: edge length of a voxel [m] (0.1)")
    add_workers(export, "the output")

    annotate = command("annotate", _annotate, "Add labelled images to a bag from another simulator.")
    annotate.add_argument("bag", metavar="BAG", type=Path, help="bag with /gazebo/model_states or /ground_truth/odom")
    annotate.add_argument("--environment", metavar="ENVIRONMENT", required=True, help="name from `fieldtruth list`")
    annotate.add_argument("--seed", metavar="N", type=seed, help="seed of the world (that of the experiment, or 0)")
    annotate.add_argument("--layout", metavar="FILE", type=Path, help="YAML file with changes to the world's layout")
    annotate.add_argument("--lidar", action="store_true", help="also add labelled point clouds")
    annotate.add_argument("--experiment", metavar="EXPERIMENT", help="source of rig, light, layout and seed")
    annotate.add_argument("--robot", metavar="NAME", default="husky", help="name in /gazebo/model_states (husky)")
    annotate.add_argument("--out", metavar="BAG", help="output file (BAG_annotated.bag)")
    add_workers(annotate, "the bag")

    validate = command("validate", _validate, "Check a run; exit code 1 if a check fails.")
    validate.add_argument("run_path", metavar="RUN", type=Path, help=RUN)
    validate.add_argument("--json", action="store_true", help="JSON instead of text")
    extent = validate.add_mutually_exclusive_group()
    extent.add_argument("--quick", action="store_true", help="do not build the world and simulate readings again")
    extent.add_argument("--full", action="store_true", help="render every image again, not only a sample")
    validate.add_argument("--samples", metavar="N", type=count, default=20, help="number of stamps in the sample (20)")
    add_workers(validate, "the result")

    report = command("report", _report, "Write an HTML report of a run.")
    report.add_argument("run_path", metavar="RUN", type=Path, help=RUN)
    report.add_argument("--out", metavar="FILE", help=".html file (beside the bag, named after it)")
    report.add_argument("--overwrite", action="store_true", help="replace an existing file")

    view = command("view", _view, "Show a run in the rerun viewer (pip install 'fieldtruth[view]').")
    view.add_argument("run_path", metavar="RUN", type=Path, help=RUN)
    view.add_argument("--save", metavar="FILE", help="write an .rrd file instead of opening the viewer")

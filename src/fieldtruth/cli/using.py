# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-commands that take a finished run: other forms of it, its check, its report, its view, and its annotation."""

import argparse
from pathlib import Path
from typing import Final

from fieldtruth.cli.arguments import AddCommand, UsageError, add_workers, count, seed

FAILED: Final = 1
"""Exit code of a run that does not pass its check."""

RUN: Final = "folder of a run, or a bag"


def _export(options: argparse.Namespace) -> None:
    from fieldtruth.core.progress import show_progress
    from fieldtruth.exporters import export

    with show_progress() as progress:
        made = export(
            options.runs,
            options.to,
            out=options.out,
            label_map=options.label_map,
            workers=options.workers,
            progress=progress,
        )
    files = [path for path in made.rglob("*") if path.is_file()] if made.is_dir() else [made]
    print(f"{made}: {len(files)} file{'s' * (len(files) != 1)}, {sum(p.stat().st_size for p in files) / 1e6:.1f} MB")


def _annotate(options: argparse.Namespace) -> None:
    from fieldtruth.annotation import annotate
    from fieldtruth.core.progress import show_progress
    from fieldtruth.experiment.files import load_experiment

    like = None if options.experiment is None else load_experiment(options.experiment)
    if like is not None and like.environment != options.world:
        raise UsageError(f"{options.experiment} takes place in {like.environment!r}, not in {options.world!r}")
    with show_progress() as progress:
        made = annotate(
            options.bag,
            options.world,
            seed=options.seed if options.seed is not None else like.seed if like is not None else 0,
            out=options.out,
            lidar=options.lidar,
            rig=None if like is None else like.rig,
            light=None if like is None else like.light,
            layout=None if like is None else like.layout,
            robot=options.robot,
            workers=options.workers,
            progress=progress,
        )
    print(f"{made}: {made.stat().st_size / 1e6:.1f} MB")


def _validate(options: argparse.Namespace) -> int:
    from fieldtruth.core.progress import show_progress
    from fieldtruth.validation import as_json, as_text, validate

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
    from fieldtruth.core.progress import show_progress
    from fieldtruth.report.page import write_report

    with show_progress() as progress:
        made = write_report(options.run_path, out=options.out, overwrite=options.overwrite, progress=progress)
    print(f"{made}: {made.stat().st_size / 1e6:.1f} MB")


def _view(options: argparse.Namespace) -> None:
    from fieldtruth.core.progress import show_progress
    from fieldtruth.report.viewer import view

    with show_progress() as progress:
        view(options.run_path, save=options.save, progress=progress)
    if options.save is not None:
        print(f"{options.save}: {options.save.stat().st_size / 1e6:.1f} MB")


# ---------------------------------------------------------------------------------------------------------------------
# Arguments


def add_commands(command: AddCommand) -> None:
    """Add them to the command line."""
    export = command("export", _export, "Write a run in another form.")
    export.add_argument("runs", metavar="RUN", type=Path, nargs="+", help=RUN)
    export.add_argument(
        "--to", metavar="FORM", required=True, help="files, zip, semantickitti, kitti, tum, mcap, coco or pcd"
    )
    export.add_argument("--out", metavar="PATH", type=Path, help="what to make (beside the bag, named after it)")
    export.add_argument("--label-map", metavar="NAME", help="other labels: rellis, rugd, goose, goose9 or ganav6")
    add_workers(export, "threads (all cores); the output is the same")

    annotate = command("annotate", _annotate, "Add labelled images to a bag that was recorded elsewhere.")
    annotate.add_argument("bag", metavar="BAG", type=Path, help="with /gazebo/model_states or /ground_truth/odom")
    annotate.add_argument("--world", metavar="ENV", required=True, help="a name that `fieldtruth list` shows")
    annotate.add_argument("--seed", metavar="N", type=seed, help="of the world (the experiment's, or 0)")
    annotate.add_argument("--lidar", action="store_true", help="add labelled clouds, too")
    annotate.add_argument("--experiment", metavar="EXP", help="its rig, light, layout and seed; a name or a YAML file")
    annotate.add_argument("--robot", metavar="NAME", default="husky", help="in /gazebo/model_states (husky)")
    annotate.add_argument("--out", metavar="BAG", type=Path, help="the new bag (BAG_annotated.bag)")
    add_workers(annotate, "threads (all cores); the bag is the same")

    validate = command("validate", _validate, "Check everything in a run; exit code 1 if something is wrong.")
    validate.add_argument("run_path", metavar="RUN", type=Path, help=RUN)
    validate.add_argument("--json", action="store_true", help="one JSON object instead of lines")
    extent = validate.add_mutually_exclusive_group()
    extent.add_argument("--quick", action="store_true", help="do not build the world and measure in it again")
    extent.add_argument("--full", action="store_true", help="see every image again, not only a sample")
    validate.add_argument("--samples", metavar="N", type=count, default=20, help="moments in the sample (20)")
    add_workers(validate, "threads (all cores); the result is the same")

    report = command("report", _report, "Write one HTML page that shows a run.")
    report.add_argument("run_path", metavar="RUN", type=Path, help=RUN)
    report.add_argument("--out", metavar="FILE", type=Path, help="an .html file (beside the bag, named after it)")
    report.add_argument("--overwrite", action="store_true", help="replace the file if it is there")

    view = command("view", _view, "Show a run in the rerun viewer (pip install 'fieldtruth[view]').")
    view.add_argument("run_path", metavar="RUN", type=Path, help=RUN)
    view.add_argument("--save", metavar="FILE", type=Path, help="write an .rrd file instead of opening the viewer")

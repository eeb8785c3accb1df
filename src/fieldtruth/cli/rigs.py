# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-command for the robot and its sensors: rig."""

import argparse
from typing import Final

from fieldtruth.cli.arguments import AddCommand, UsageError
from fieldtruth.cli.streams import print_line, print_output
from fieldtruth.core.errors import UnknownNameError

_YAML: Final = (".yaml", ".yml")
_ENDINGS: Final = {"tree": (".txt", ".md"), "urdf": (".urdf", ".xml"), "camchain": _YAML, "imu": _YAML}
_EXAMPLES: Final = """\
examples:
  fieldtruth rig park_1                                  the tree of its frames and a table of its sensors
  fieldtruth rig park_1 --preview                        park_1_rig.png: fields of view, blind spots
  fieldtruth rig my.yaml --to urdf --out robot.urdf      for RViz and robot_state_publisher
  fieldtruth rig my.yaml --to camchain                   the cameras for Kalibr
  fieldtruth rig my.yaml --to imu                        the noise of the IMUs for Kalibr
"""


def _rig(options: argparse.Namespace) -> None:
    if options.to is not None and options.preview:
        raise UsageError("give either --to or --preview")
    if options.to not in (None, *_ENDINGS):
        raise UnknownNameError("format", options.to, _ENDINGS)
    if options.preview:
        _preview(options)
        return
    from fieldtruth.core.outputs import output_path
    from fieldtruth.experiment.files import load_experiment

    out = options.out
    if out is not None:
        endings = _ENDINGS[options.to or "tree"]
        out = output_path(out, endings=endings, parents=False, overwrite=options.overwrite)
    rig = load_experiment(options.experiment).rig
    from fieldtruth.core.files import output_errors, write_atomically
    from fieldtruth.report.rig import FORMATS, sensor_table

    text = FORMATS[options.to](rig) if options.to is not None else f"{FORMATS['tree'](rig)}\n{sensor_table(rig)}"
    if out is None:
        print(text, end="")
        return
    with output_errors(out):
        write_atomically(out, text)
    print_line(f"{out}: {len(text.splitlines())} lines")


def _preview(options: argparse.Namespace) -> None:
    from fieldtruth.core.outputs import output_path
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.report.drawing.images import IMAGE_ENDINGS, write_image

    experiment = load_experiment(options.experiment)
    path = f"{experiment.name}_rig.png" if options.out is None else options.out
    path = output_path(path, endings=IMAGE_ENDINGS, parents=False, overwrite=options.overwrite)
    # After the checks: the drawing library takes a second to load.
    from fieldtruth.report.rig.picture import draw_rig

    picture = draw_rig(experiment.rig, experiment.name)
    write_image(path, picture, overwrite=options.overwrite)
    print_output(path, f"{picture.shape[1]} x {picture.shape[0]} pixels")


# ---------------------------------------------------------------------------------------------------------------------
# Arguments


def add_commands(command: AddCommand) -> None:
    """Add the sub-command."""
    rig = command("rig", _rig, "Show the robot's frames and sensors, or write them for other tools.", _EXAMPLES)
    rig.add_argument("experiment", metavar="EXPERIMENT", help="name from `fieldtruth list`, or a YAML file")
    rig.add_argument("--to", metavar="FORMAT", help="tree, urdf, camchain or imu (the tree and a table of the sensors)")
    rig.add_argument("--preview", action="store_true", help="draw the robot, its fields of view and its blind spots")
    rig.add_argument("--out", metavar="FILE", help="file (NAME_rig.png with --preview, else the terminal)")
    rig.add_argument("--overwrite", action="store_true", help="replace an existing file")

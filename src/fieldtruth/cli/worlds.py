# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-commands for worlds in other tools: scene, gazebo."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fieldtruth.cli.arguments import AddCommand, Parser, UsageError, checked_layout, seed
from fieldtruth.cli.streams import print_output

if TYPE_CHECKING:
    from fieldtruth.experiment.config import Experiment
    from fieldtruth.world.model import World

_SCENE_EXAMPLES: Final = """\
examples:
  fieldtruth scene park --to gltf                        park_0.glb, for Blender, three.js and others
  fieldtruth scene lake --to obj --no-beyond --out lake  only what is inside the world's edge
"""

_GAZEBO_EXAMPLES: Final = """\
examples:
  fieldtruth gazebo park --flavour classic --out park     a package for Gazebo 11 and ROS 1; its README has commands
  fieldtruth gazebo lake --flavour both --no-beyond --out lake      lake/classic and lake/gz, without the land around
  fieldtruth gazebo park --flavour gz --experiment my.yaml --out my       with the sensors of an experiment
"""


def add_world_arguments(parser: Parser) -> None:
    """Add the environment, ``--seed`` and ``--layout``, which select a world."""
    parser.add_argument("environment", metavar="ENVIRONMENT", help="name from `fieldtruth list`")
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="root of all randomness (0)")
    parser.add_argument(
        "--layout", metavar="FILE", type=Path, help="YAML file with changes to the environment's layout"
    )


def selected_world(options: argparse.Namespace, default: Mapping[str, Any] | None = None) -> "World":
    """Load the world that the arguments select; ``default`` are changes of the layout that its file may replace."""
    from fieldtruth.world.build import load_world

    layout = {} if options.layout is None else checked_layout(options.environment, options.layout)
    return load_world(options.environment, options.seed, {**(default or {}), **layout})


def _scene(options: argparse.Namespace) -> None:
    from fieldtruth.interchange import check_scene_output, write_scene

    out = check_scene_output(
        f"{options.environment}_{options.seed}", options.out, to=options.to, overwrite=options.overwrite
    )
    from fieldtruth.core.progress import show_progress

    with show_progress() as progress:
        with progress.stage("world"):
            world = selected_world(options)
        with progress.stage("write the scene"):
            write_scene(world, out, to=options.to, beyond=not options.no_beyond, overwrite=options.overwrite)
    print_output(out)


def _gazebo(options: argparse.Namespace) -> None:
    from fieldtruth.world.environments import ENVIRONMENTS

    ENVIRONMENTS.find(options.environment)
    from fieldtruth.core.progress import show_progress
    from fieldtruth.gazebo import DEFAULT_LAYOUT, check_gazebo_output, write_gazebo

    check_gazebo_output(options.out, flavour=options.flavour, overwrite=options.overwrite)
    like = None if options.experiment is None else _experiment_in(options.environment, options.experiment)
    if options.seed is None:
        options.seed = 0 if like is None else like.seed
    layout = DEFAULT_LAYOUT if like is None else {**DEFAULT_LAYOUT, **like.layout}
    with show_progress() as progress:
        with progress.stage("world"):
            world = selected_world(options, layout)
        with progress.stage("write the package"):
            out = write_gazebo(
                world,
                options.out,
                flavour=options.flavour,
                rig=None if like is None else like.rig,
                beyond=not options.no_beyond,
                overwrite=options.overwrite,
            )
    print_output(out)


def _experiment_in(environment: str, name_or_path: str) -> "Experiment":
    """Load an experiment in this environment, whose sensors Gazebo has."""
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.gazebo.robot.parts import check_rig
    from fieldtruth.world.build import check_layout

    like = load_experiment(name_or_path)
    if like.environment != environment:
        expected = f"{like.environment!r}, the environment of {name_or_path}"
        raise UsageError(f"ENVIRONMENT must be {expected}, got {environment!r}")
    check_layout(environment, like.layout, name_or_path)
    check_rig(like.rig)
    return like


# ---------------------------------------------------------------------------------------------------------------------
# Arguments


def add_commands(command: AddCommand) -> None:
    """Add the sub-commands."""
    scene = command("scene", _scene, "Write an environment for other tools.", _SCENE_EXAMPLES)
    add_world_arguments(scene)
    scene.add_argument("--to", metavar="FORMAT", required=True, help="gltf, gltf-plain, obj, usd or inventory")
    scene.add_argument("--out", metavar="PATH", help="file or folder (ENVIRONMENT_SEED and the format's ending)")
    scene.add_argument("--no-beyond", action="store_true", help="without the land beyond the world's edge")
    scene.add_argument("--overwrite", action="store_true", help="replace an existing output")

    gazebo = command("gazebo", _gazebo, "Write an environment and the robot for Gazebo and ROS.", _GAZEBO_EXAMPLES)
    add_world_arguments(gazebo)
    gazebo.set_defaults(seed=None)
    gazebo.add_argument("--experiment", metavar="EXPERIMENT", help="source of rig, layout and seed")
    gazebo.add_argument("--out", metavar="DIR", required=True, help="folder of the package")
    gazebo.add_argument(
        "--flavour",
        metavar="NAME",
        required=True,
        help="classic (Gazebo 11, ROS 1), gz (the newer Gazebo, ROS 2) or both",
    )
    gazebo.add_argument("--no-beyond", action="store_true", help="without the land beyond the world's edge")
    gazebo.add_argument("--overwrite", action="store_true", help="replace an existing package")

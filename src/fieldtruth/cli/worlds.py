# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-commands for worlds in other tools: scene."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldtruth.cli.arguments import AddCommand, Parser, seed

if TYPE_CHECKING:
    from fieldtruth.world.model import World

_SCENE_EXAMPLES: Final = """\
examples:
  fieldtruth scene park --to gltf                        park_0.glb, for Blender, three.js and others
  fieldtruth scene lake --to obj --no-beyond --out lake  only what is inside the world's edge
"""


def add_world_arguments(parser: Parser) -> None:
    """Add the environment, ``--seed`` and ``--layout``, which select a world."""
    parser.add_argument("environment", metavar="ENV", help="name from `fieldtruth list`")
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="root of all randomness (0)")
    parser.add_argument(
        "--layout", metavar="FILE", type=Path, help="YAML file with changes to the environment's layout"
    )


def selected_world(options: argparse.Namespace) -> "World":
    """Load the world that the arguments select."""
    from fieldtruth.experiment.files import load_layout
    from fieldtruth.world.build import check_layout, load_world

    layout = None if options.layout is None else load_layout(options.layout)
    check_layout(options.environment, layout, "" if options.layout is None else str(options.layout))
    return load_world(options.environment, options.seed, layout)


def _scene(options: argparse.Namespace) -> None:
    from fieldtruth.interchange import check_scene_output, write_scene

    out = check_scene_output(
        f"{options.environment}_{options.seed}", options.out, form=options.to, overwrite=options.overwrite
    )
    from fieldtruth.core.progress import show_progress

    with show_progress() as progress:
        with progress.stage("world"):
            world = selected_world(options)
        with progress.stage("write the scene"):
            write_scene(world, out, form=options.to, beyond=not options.no_beyond, overwrite=options.overwrite)
    files = [path for path in out.rglob("*") if path.is_file()] if out.is_dir() else [out]
    print(f"{out}: {len(files)} file{'s' * (len(files) != 1)}, {sum(p.stat().st_size for p in files) / 1e6:.1f} MB")


# ---------------------------------------------------------------------------------------------------------------------
# Arguments


def add_commands(command: AddCommand) -> None:
    """Add the sub-commands."""
    scene = command("scene", _scene, "Write an environment for other tools.", _SCENE_EXAMPLES)
    add_world_arguments(scene)
    scene.add_argument("--to", metavar="FORM", required=True, help="gltf, gltf-plain, obj, usd or inventory")
    scene.add_argument("--out", metavar="PATH", type=Path, help="file or folder (ENV_SEED and the form's ending)")
    scene.add_argument("--no-beyond", action="store_true", help="without the land beyond the world's edge")
    scene.add_argument("--overwrite", action="store_true", help="replace an existing output")

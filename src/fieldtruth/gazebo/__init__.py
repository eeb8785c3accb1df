# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The worlds, the robot and its ROS nodes for Gazebo."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.files import atomic_output, output_errors, output_path, remove

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fieldtruth.experiment.config import Experiment
    from fieldtruth.experiment.rig import Rig
    from fieldtruth.gazebo.robot import Flavour
    from fieldtruth.world.model import World

FLAVOURS: Final[dict[str, tuple["Flavour", ...]]] = {"classic": ("classic",), "gz": ("gz",), "both": ("classic", "gz")}
"""Flavours of the packages that are written: of one, or of several in a folder, which are named after them."""
DEFAULT_LAYOUT: Final = {"grid": 0.2}
"""Of the command's worlds: as a mesh of text, ground with nodes 5 cm apart would be 400 MB, at 10 cm 100."""
_MARKS: Final = ("worlds", "classic/worlds")
"""Folders of which every output has one, which marks it as replaceable."""


def write_gazebo(
    world: "World",
    out: Path | str,
    *,
    flavour: str = "classic",
    rig: "Rig | None" = None,
    beyond: bool = True,
    overwrite: bool = False,
    experiments: "Sequence[Experiment] | None" = None,
) -> Path:
    """Write a world and the robot as a package for Gazebo 11 and ROS 1 (classic), or the newer Gazebo and ROS 2 (gz).

    Args:
        world: see ``load_world``; the command uses ``layout={"grid": 0.2}``.
        out: folder of the package.
        flavour: classic, gz, or both: a folder with a package of each, ``classic`` and ``gz``.
        rig: sensors of the robot; None takes the paper's.
        beyond: whether to include the land beyond the world's edge.
        overwrite: replace an existing package.
        experiments: whose starts and waypoints the package has, with routes that are not random; None takes the
            built-in ones of the environment.

    Returns:
        The folder.

    Raises:
        UnknownNameError: an unknown flavour.
        ConfigurationError: a sensor that a Gazebo package cannot have; the text names it.
        OutputError: the folder already exists or cannot be written.
    """
    target = check_gazebo_output(out, flavour=flavour, overwrite=overwrite)
    from fieldtruth.experiment.rig import Rig  # late: the command line checks its arguments first
    from fieldtruth.gazebo.robot import check_rig, write_robot
    from fieldtruth.gazebo.ros import write_ros_package
    from fieldtruth.gazebo.worlds import write_worlds

    chosen, sensors = FLAVOURS[flavour], Rig() if rig is None else rig
    check_rig(sensors, chosen)
    with output_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_output(target) as part:
            packages = {name: part if len(chosen) == 1 else part / name for name in chosen}
            for name, package in packages.items():
                write_ros_package(package, world, sensors, name, experiments)
                write_robot(package, sensors, name, world.origin)
            write_worlds(packages, world, beyond=beyond)
            if overwrite:
                remove(target)
    return target


def check_gazebo_output(out: Path | str, *, flavour: str, overwrite: bool = False) -> Path:
    """Return the folder of the package, before any work; raises as ``write_gazebo``."""
    if flavour not in FLAVOURS:
        raise UnknownNameError("flavour", flavour, FLAVOURS)
    target = output_path(out, overwrite=overwrite)
    with output_errors(target):
        if os.path.lexists(target) and not any((target / mark).is_dir() for mark in _MARKS):
            raise OutputError(f"{target} does not hold a package for Gazebo; choose another --out")
    return target

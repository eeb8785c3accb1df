# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The worlds, the robot and its ROS nodes for Gazebo."""

import os
from pathlib import Path
from typing import Final

from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.files import atomic_output, output_errors, remove
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import World

FLAVOURS: Final = {"classic": "Gazebo 11 and ROS 1"}
"""What a package can be written for."""
MARK: Final = "worlds"
"""Folder that every package has, which marks it as replaceable."""


def write_gazebo(
    world: World,
    out: Path | str,
    *,
    flavour: str = "classic",
    rig: Rig | None = None,
    beyond: bool = True,
    overwrite: bool = False,
) -> Path:
    """Write a world and the robot as a package for Gazebo.

    Args:
        world: see ``load_world``.
        out: folder of the package.
        flavour: a key of ``FLAVOURS``.
        rig: sensors of the robot; None takes the defaults.
        beyond: whether to include the land beyond the world's edge.
        overwrite: replace an existing package.

    Returns:
        The folder.

    Raises:
        UnknownNameError: an unknown flavour.
        OutputError: the folder already exists or cannot be written.
    """
    target = check_output(out, flavour=flavour, overwrite=overwrite)
    from fieldtruth.gazebo.robot import write_robot
    from fieldtruth.gazebo.ros import write_ros_package
    from fieldtruth.gazebo.worlds.classic import write_classic

    sensors = Rig() if rig is None else rig
    with output_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_output(target) as part:
            write_classic(part, world, beyond=beyond)
            write_robot(part, sensors, "classic")
            write_ros_package(part, world, sensors, "classic")
            if overwrite:
                remove(target)
    return target


def check_output(out: Path | str, *, flavour: str, overwrite: bool = False) -> Path:
    """Return the folder of the package, before any work; raises as ``write_gazebo``."""
    if flavour not in FLAVOURS:
        raise UnknownNameError("flavour", flavour, FLAVOURS)
    target = Path(out)
    with output_errors(target):
        if os.path.lexists(target) and not overwrite:
            raise OutputError(f"{target} already exists; choose another --out, or use --overwrite to replace it")
        if os.path.lexists(target) and not (target / MARK).is_dir():
            raise OutputError(f"{target} does not hold a package for Gazebo; choose another --out")
    return target

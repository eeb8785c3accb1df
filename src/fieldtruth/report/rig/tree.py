# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The tree of a rig's frames and a table of its sensors, as text."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from fieldtruth.bag.base_messages import BASE
from fieldtruth.bag.robot_messages import WORLD, rig_transforms
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.report.rig import body

_HEAD: Final = ("frame", "x", "y", "z [m]", "roll", "pitch", "yaw [deg]", "of")


def tree_text(rig: Rig) -> str:
    """Return the frames of a rig, each below its parent, with their poses in it and the sensors that they belong to."""
    transforms = rig_transforms(rig)
    owner = {name: each for each in rig.sensors for name in (*each.frames(), *each.optical_frames())}
    moving = [wheel.frame for wheel in body.wheels(rig)]
    rows: list[Sequence[str]] = [_HEAD, (WORLD, *[""] * 7), (f"  {BASE}", *[""] * 6, "the robot, which moves")]

    def add(parent: str, depth: int) -> None:
        for (above, name), parent_from_child in transforms.items():
            if above == parent:
                sensor = owner.get(name)
                what = "a wheel, which turns" if name in moving else _title(sensor) if sensor else "the robot"
                rows.append(("  " * depth + name, *_pose(parent_from_child), what))
                add(name, depth + 1)

    add(BASE, 2)
    return _aligned(rows, right=range(1, 7))


def sensor_table(rig: Rig) -> str:
    """Return a line for each sensor: name, kind, model, rate, topic and figures."""
    rows = [("sensor", "kind", "model", "rate [Hz]", "topic", "figures")]
    for sensor in rig.sensors:
        head = (sensor.name, sensor.kind, sensor.model or "-", f"{sensor.rate_hz:g}", sensor.topic)
        rows.append((*head, sensor.figures() if sensor.enabled else "off"))
    return _aligned(rows, right=(3,))


def _title(sensor: SensorConfig) -> str:
    own = sensor.kind if sensor.kind == sensor.name else f"{sensor.kind} {sensor.name}"
    return own if sensor.enabled else f"{own}, off"


def _pose(parent_from_child: Array) -> list[str]:
    angles = frames.rpy_deg_from_rotation(parent_from_child[:3, :3])
    return [f"{value:g}" for value in np.round([*parent_from_child[:3, 3], *angles], 6) + 0.0]


def _aligned(rows: Sequence[Sequence[str]], right: Sequence[int]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = (
        "  ".join(
            cell.rjust(width) if i in right else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )
    return "".join(f"{line.rstrip()}\n" for line in lines)

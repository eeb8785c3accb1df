# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export the true trajectory in the format of the TUM RGB-D benchmark, which evo and most SLAM systems read."""

from collections.abc import Sequence
from pathlib import Path

from fieldtruth.bag.geometry import Trajectory, seconds
from fieldtruth.bag.run import Run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.exporters import Options


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write a line ``t x y z qx qy qz qw`` per pose of base_link in the world, with every digit of the bag.

    Raises:
        BagError: the bag has no true poses, or is damaged.
    """
    (run,) = runs
    with options.progress.stage("write the trajectory"):
        target.write_text(tum_text(run.trajectory), encoding="ascii")


def tum_text(trajectory: Trajectory, base_from_sensor: Array | None = None) -> str:
    """Lines of the poses of base_link or, with its mount (4, 4), of a sensor."""
    position, quaternion = trajectory.position, trajectory.quaternion_wxyz
    if base_from_sensor is not None:
        world_from_sensor = transforms.pose_from_quaternion_wxyz(position, quaternion) @ base_from_sensor
        position = world_from_sensor[:, :3, 3]
        quaternion = transforms.quaternion_wxyz_from_rotation(world_from_sensor[:, :3, :3])
    frame = "base_link" if base_from_sensor is None else "the sensor"
    lines = [f"# true poses of {frame} in the world: x north, y west, z up\n# t[s] x[m] y[m] z[m] qx qy qz qw\n"]
    for stamp_ns, (x, y, z), (qw, qx, qy, qz) in zip(trajectory.stamps_ns, position, quaternion, strict=True):
        values = " ".join(repr(float(value)) for value in (x, y, z, qx, qy, qz, qw))
        lines.append(f"{seconds(int(stamp_ns))} {values}\n")
    return "".join(lines)

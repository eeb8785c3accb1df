# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export the true trajectory in the format of the TUM RGB-D benchmark, which evo and most SLAM systems read."""

from collections.abc import Sequence
from pathlib import Path

from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import read_trajectory, seconds
from fieldtruth.exporters import Options


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write a line ``t x y z qx qy qz qw`` per pose of base_link in the world, with every digit of the bag.

    Raises:
        BagError: the bag has no true poses, or is damaged.
    """
    (run,) = runs
    with options.progress.stage("write the trajectory"), target.open("w", encoding="ascii") as file:
        trajectory = read_trajectory(run)
        file.write("# true poses of base_link in the world: x north, y west, z up\n# t[s] x[m] y[m] z[m] qx qy qz qw\n")
        rows = zip(trajectory.stamps_ns, trajectory.position, trajectory.quaternion_wxyz, strict=True)
        for stamp_ns, (x, y, z), (qw, qx, qy, qz) in rows:
            values = " ".join(repr(float(value)) for value in (x, y, z, qx, qy, qz, qw))
            file.write(f"{seconds(int(stamp_ns))} {values}\n")

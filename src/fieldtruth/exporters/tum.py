# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The true trajectory as the TUM RGB-D benchmark writes it, which evo and most SLAM systems read."""

from collections.abc import Sequence
from pathlib import Path

from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import read_trajectory
from fieldtruth.exporters import Options


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write ``t x y z qx qy qz qw`` a pose: base_link in the world, every digit as in the bag.

    Raises:
        BagError: the bag tells no true poses, or is damaged.
    """
    (run,) = runs
    with options.progress.stage("write the trajectory"), target.open("w", encoding="ascii") as file:
        way = read_trajectory(run)
        file.write("# true poses of base_link in the world: x north, y west, z up\n# t[s] x[m] y[m] z[m] qx qy qz qw\n")
        for stamp_ns, (x, y, z), (qw, qx, qy, qz) in zip(way.stamps_ns, way.position, way.quaternion_wxyz, strict=True):
            values = " ".join(repr(float(value)) for value in (x, y, z, qx, qy, qz, qw))
            file.write(f"{seconds(int(stamp_ns))} {values}\n")


def seconds(ns: int) -> str:
    """Seconds of a time [ns], all nine digits after the point as they are."""
    return f"{'-' * (ns < 0)}{abs(ns) // 10**9}.{abs(ns) % 10**9:09d}"

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How fast a data set opens and how many frames a second it gives. Run: python benchmarks/dataset.py data/park_1

Frames are those of the left camera or of the LiDAR. Each is read once, in random order, then in order. CPU is the
process's, so that what else runs on the machine counts little; a number of loader workers multiplies its reciprocal.
"""

import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from fieldtruth.datasets import RunDataset, storage

SETS = (
    ("image",),
    ("mask",),
    ("image", "mask"),
    ("depth",),
    ("instance_mask",),
    ("cloud", "labels"),
    ("pose",),
    ("image", "mask", "cloud", "labels", "pose", "calibration"),
    ("image", "mask", "depth", "instance_mask", "cloud", "labels", "instances", "pose", "calibration"),
)
MOST = 100


def cost(work: Callable[[], object]) -> tuple[float, float]:
    """CPU and wall time [s]."""
    cpu, wall = process_time(), perf_counter()
    work()
    return process_time() - cpu, perf_counter() - wall


def read(dataset: RunDataset, order: Sequence[int]) -> None:
    for i in order:
        dataset[i]


def main() -> None:
    run = Path(sys.argv[1])
    rng = np.random.default_rng(0)
    print(f"{'items':<86}{'open':>8}{'frames':>8}{'random':>9}{'in order':>10}   frames/s of CPU (of wall time)")
    for items in SETS:
        seconds, _ = cost(partial(RunDataset, run, items))
        dataset = RunDataset(run, items)
        count = min(len(dataset), MOST)
        rates = []
        for order in (rng.permutation(len(dataset))[:count].tolist(), range(count)):
            storage._RECENT.forget()
            rates.append([count / spent for spent in cost(partial(read, dataset, order))])
        told = "".join(f"{cpu:>9.1f} ({wall:.1f})" for cpu, wall in rates)
        print(f"{' '.join(items):<86}{seconds:>7.3f}s{len(dataset):>8}{told}")


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time to open a data set, and frames per second. Run: python benchmarks/dataset.py data/park_1

Up to a hundred frames of the left camera or the LiDAR are read, in random order and in order. Times are CPU times of
the process, so that other load matters little.
"""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np

from fieldtruth.bag import reader
from fieldtruth.datasets import RunDataset
from fieldtruth.datasets.items import GEOMETRY, ITEMS

SETS = (
    ("image",),
    ("mask",),
    ("image", "mask"),
    ("depth",),
    ("instance_mask",),
    ("cloud", "labels"),
    ("pose",),
    ("image", "mask", "cloud", "labels", "pose", "calibration"),
    (*ITEMS, *GEOMETRY),
)
MOST, TRIES = 100, 3


def least_cpu(work: Callable[[], object]) -> float:
    """CPU time [s] of the process, the least of some tries."""
    tries = []
    for _ in range(TRIES):
        reader._RECENT.forget()
        start = process_time()
        work()
        tries.append(process_time() - start)
    return min(tries)


def read(dataset: RunDataset, order: Sequence[int]) -> None:
    for i in order:
        dataset[i]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    run = parser.parse_args().run
    rng = np.random.default_rng(0)
    print(f"{'items':<74}{'opened in':>12}{'frames':>8}{'random':>9}{'in order':>10}  a second of CPU")
    for items in SETS:
        seconds = least_cpu(partial(RunDataset, run, items))
        dataset = RunDataset(run, items)
        count = min(len(dataset), MOST)
        shuffled = rng.permutation(len(dataset))[:count].tolist()
        random, ordered = (count / least_cpu(partial(read, dataset, order)) for order in (shuffled, range(count)))
        print(f"{' '.join(items):<74}{seconds:>10.3f} s{len(dataset):>8}{random:>9.1f}{ordered:>10.1f}")


if __name__ == "__main__":
    main()

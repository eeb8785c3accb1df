# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Classes that a LiDAR sees, by range, as a plot: python class_statistics.py RUN IMAGE."""

import sys
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np

import fieldtruth as ft

BINS = np.array([0.0, 5.0, 10.0, 20.0, 40.0, 80.0, 120.0])  # [m]


def main(run: str, image: str) -> None:
    """Count points by class and range over a whole run, and draw the shares as stacked bars."""
    counts = np.zeros((len(ft.CLASSES), len(BINS) - 1))
    for sample in ft.RunDataset(run, items=("cloud", "labels")):
        ranges = np.linalg.norm(sample["cloud"], axis=1)
        for label in np.unique(sample["labels"]):
            counts[label] += np.histogram(ranges[sample["labels"] == label], BINS)[0]

    shares = 100 * counts / np.maximum(counts.sum(axis=0), 1)
    figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
    bottom = np.zeros(len(BINS) - 1)
    names = [f"{a:g}-{b:g}" for a, b in pairwise(BINS)]
    for row in ft.CLASSES:
        if counts[row.label].any() and row.rgb is not None:
            colour = np.array(row.rgb) / 255
            axes.bar(names, shares[row.label], bottom=bottom, color=colour, edgecolor="0.5", label=row.name)
            bottom += shares[row.label]
    axes.set(xlabel="range [m]", ylabel="share of points [%]")
    figure.legend(loc="outside right upper", fontsize="small")
    figure.savefig(image, dpi=120)
    print(f"{counts.sum():.0f} points, {np.count_nonzero(counts.any(axis=1))} classes: {image}")


if __name__ == "__main__":
    main(*sys.argv[1:])

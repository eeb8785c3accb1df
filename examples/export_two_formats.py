# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One run as SemanticKITTI with RELLIS-3D's labels and as a TUM trajectory: python export_two_formats.py RUN OUT."""

import sys
from pathlib import Path

import numpy as np

import fieldtruth as ft


def main(run: str, out: str) -> None:
    """Export twice, and read both back with NumPy alone."""
    target = Path(out)
    target.mkdir(parents=True, exist_ok=True)
    sequences = ft.export(run, to="semantickitti", out=target / "semantickitti", label_map="rellis")
    trajectory = ft.export(run, to="tum", out=target / "truth.tum")

    labels = sorted(sequences.rglob("*.label"))
    first = np.fromfile(labels[0], np.uint32)
    print(f"{len(labels)} clouds; class ids of the first: {sorted(set((first & 0xFFFF).tolist()))}")
    poses = np.loadtxt(trajectory)
    length = np.linalg.norm(np.diff(poses[:, 1:4], axis=0), axis=1).sum()
    print(f"{len(poses)} poses, {length:.2f} m driven")


if __name__ == "__main__":
    main(*sys.argv[1:])

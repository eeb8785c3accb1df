# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Make contact sheets of runs: ten photographs of the first camera, evenly spaced in time.

Run: fieldtruth generate park_people --seconds 12 --out RUNS; python docs/actor_sheets.py FOLDER RUNS/park_people ...
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import fieldtruth as ft
from fieldtruth.exporters.frames import first_views

VIEWS, COLUMNS = 10, 5
WIDTH, HEIGHT = 384, 216  # [pixel] of a photograph in the sheet


def sheet(run: ft.Run, middle: float) -> NDArray[np.uint8]:
    """Ten photographs in two rows, of each its middle share in both directions, a little above the centre."""
    images = run.readings(first_views(run)[0].name, ["photo"])
    rows = np.linspace(0, len(images) - 1, VIEWS).astype(int).tolist()
    views = []
    for row in rows:
        whole = Image.fromarray(images[row].photo)
        edge = (1.0 - middle) / 2
        box = (
            edge * whole.width,
            0.7 * edge * whole.height,
            (1.0 - edge) * whole.width,
            (1.0 - 1.3 * edge) * whole.height,
        )
        views.append(np.asarray(whole.resize((WIDTH, HEIGHT), Image.Resampling.BOX, box)))
    return np.vstack([np.hstack(views[k : k + COLUMNS]) for k in range(0, VIEWS, COLUMNS)])


def main() -> None:
    """Write sheet_NAME.jpg of each run into the folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--middle", type=float, default=1.0, help="share of each photograph that is shown")
    parser.add_argument("runs", nargs="+", type=Path)
    options = parser.parse_args()
    if not 0.0 < options.middle <= 1.0:
        parser.error(f"argument --middle: must be above 0 and at most 1, got {options.middle:g}")
    if not options.folder.is_dir():
        parser.error(f"argument folder: {options.folder} is no folder")
    for path in options.runs:
        try:
            run = ft.open_run(path)
        except ft.FieldtruthError as error:
            parser.error(str(error))
        Image.fromarray(sheet(run, options.middle)).save(options.folder / f"sheet_{run.name}.jpg", quality=72)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A sheet that mixes our photographs with real ones, for people to pick out the rendered ones.

Run: python benchmarks/blind_sheet.py OURS REAL SHEET.png [--seed N] [--count N]

OURS and REAL are folders of images; benchmarks/naturalness.py --save makes the first. SHEET.txt, beside the sheet, has
the solution: the numbers of ours.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT, COLUMNS = 640, 352, 4


def tile(file: Path) -> NDArray[np.uint8]:
    """The middle of an image, WIDTH pixels wide."""
    image = cv2.imread(str(file))
    if image is None:
        raise SystemExit(f"{file} is no image")
    height = round(WIDTH / image.shape[1] * image.shape[0])
    if height < HEIGHT:
        raise SystemExit(f"{file} must be at least {HEIGHT} pixels high at a width of {WIDTH}, is {height}")
    small = cv2.resize(image, (WIDTH, height), interpolation=cv2.INTER_AREA)
    top = (height - HEIGHT) // 2
    return np.asarray(small[top : top + HEIGHT], np.uint8)


def main() -> None:
    """Write the sheet and its solution."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ours", type=Path)
    parser.add_argument("real", type=Path)
    parser.add_argument("sheet", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=10, help="images of each kind")
    options = parser.parse_args()
    rng, chosen = np.random.default_rng(options.seed), list[tuple[Path, bool]]()
    for folder, is_ours in ((options.ours, True), (options.real, False)):
        files = sorted(file for file in folder.iterdir() if file.suffix in (".jpg", ".png"))
        picked = rng.permutation(len(files))[: options.count]
        chosen += [(files[k], is_ours) for k in picked]
    order = [chosen[k] for k in rng.permutation(len(chosen))]
    tiles = [tile(file) for file, _ in order]
    for number, image in enumerate(tiles, 1):
        cv2.rectangle(image, (0, 0), (56, 34), (0, 0, 0), -1)
        cv2.putText(image, str(number), (6, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (255, 255, 255), 2)
    tiles += [np.zeros((HEIGHT, WIDTH, 3), np.uint8)] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    cv2.imwrite(str(options.sheet), np.vstack(rows))
    lines = [f"{number} {file.name}" for number, (file, is_ours) in enumerate(order, 1) if is_ours]
    options.sheet.with_suffix(".txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

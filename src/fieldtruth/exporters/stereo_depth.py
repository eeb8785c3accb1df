# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export depth as a stereo camera measures it: semi-global matching of a pair's photographs, and its errors.

OpenCV's StereoSGBM finds for each pixel of the left photograph the disparity d [pixel] to the right one; the depth is
f B / d. Where the bag has the true depth, it is written as well, with a table of the errors.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.file import BagError
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import first_views, require_pinholes
from fieldtruth.exporters.image_files import metres_npy, millimetres_png

EDGES: Final = (0.0, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0, np.inf)
"""Ranges of true depth [m], each without its end."""
BAD: Final = 3.0
"""Error [pixel] of a disparity from which a match is wrong, as in KITTI's stereo benchmark (2012)."""
_STEPS: Final = 4000
_LEAST: Final = 1e-5
_PER_DECADE: Final = 500
"""Relative errors are counted in a histogram of even steps of their logarithm, each 0.46 %, from 1e-5 to 1e3."""


class Errors(NamedTuple):
    """Counts by range of true depth (n,), and the histogram (n, steps) of relative errors of the matched."""

    pixels: Counts
    matched: Counts
    bad: Counts
    histogram: Counts


def errors_of(found: NDArray[np.float32], expected: Array, depth: NDArray[np.float32]) -> Errors:
    """Compare the found disparities (h, w) [pixel], NaN without a match, with those of the true depth (h, w) [m].

    Pixels of the sky, whose depth is infinite, are left out.
    """
    real = np.isfinite(depth) & (depth > 0.0)
    band = np.searchsorted(EDGES, depth[real], side="right") - 1
    found, expected = found[real].astype(np.float64), expected[real]
    has = np.isfinite(found)
    count = len(EDGES) - 1
    wrong = np.abs(found[has] - expected[has]) > BAD
    relative = np.abs(expected[has] / found[has] - 1.0)  # depth is inverse to disparity
    with np.errstate(divide="ignore"):
        step = np.floor(_PER_DECADE * np.log10(relative / _LEAST))
    step = np.clip(step, 0, _STEPS - 1).astype(np.int64)
    histogram = np.bincount(band[has] * _STEPS + step, minlength=count * _STEPS).reshape(count, _STEPS)
    return Errors(
        np.bincount(band, minlength=count),
        np.bincount(band[has], minlength=count),
        np.bincount(band[has][wrong], minlength=count),
        histogram,
    )


def errors_csv(errors: Sequence[Errors]) -> str:
    """Table of the errors of all images: a row per range of true depth, and one of all."""
    total = Errors(*(np.sum([getattr(each, name) for each in errors], axis=0) for name in Errors._fields))
    lines = ["depth_from_m,depth_to_m,pixels,matched_share,bad_3px_share,median_relative_error"]
    return "\n".join([*lines, *_rows(total)]) + "\n"


def _rows(total: Errors) -> Iterator[str]:
    for k, (start, end) in enumerate(pairwise(EDGES)):
        yield _row(start, end, Errors(*(values[k] for values in total)))
    yield _row(EDGES[0], EDGES[-1], Errors(*(values.sum(axis=0) for values in total)))


def _row(start: float, end: float, row: Errors) -> str:
    pixels, matched, bad = int(row.pixels), int(row.matched), int(row.bad)
    shares = f"{matched / pixels:.4f}" if pixels else "", f"{bad / matched:.4f}" if matched else ""
    return ",".join([f"{start:g}", f"{end:g}", str(pixels), *shares, _median(row.histogram)])


def _median(histogram: Counts) -> str:
    total = np.cumsum(histogram)
    if not total[-1]:
        return ""
    step = int(np.searchsorted(total, (total[-1] + 1) // 2))
    return f"{_LEAST * 10 ** ((step + 0.5) / _PER_DECADE):.4g}"


NEAREST: Final = 1.0
"""Depth [m] of the largest disparity that is searched."""
_UNIT: Final = 16.0
"""OpenCV's disparities are integers in sixteenths of a pixel."""
_TEXTS: Final = package_data("fieldtruth.exporters", "stereo_depth.yaml")


class Pair(NamedTuple):
    """The geometry of a rectified pair."""

    scale: float
    """f B [pixel m]."""
    disparities: int
    """Number of disparities that are searched, a multiple of 16."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: the depth of each pair of photographs, with the true depth and errors if recorded.

    Raises:
        BagError: the rig has no stereo pair, the bag lacks its photographs or calibration, its lenses are not pinholes,
            or it is damaged.
    """
    (run,) = runs
    views = first_views(run)
    if len(views) != 2:
        raise BagError(f"the rig of {run.bag} has no stereo pair, and stereo-depth matches its photographs")
    left, right = views
    run.require(*(view.topics["photo"] for view in views), *(view.info for view in views))
    require_pinholes(run, "stereo-depth")
    pair = _pair(run, right)
    has_truth = left.has(run.counts, "depth")
    images = [
        run.readings(left.name, ["photo", "depth"] if has_truth else ["photo"]),
        run.readings(right.name, ["photo"]),
    ]
    for folder in ("stereo", "true")[: 1 + has_truth]:
        (target / folder).mkdir(parents=True)
    errors = _write_frames(run, images, pair, target, options)
    if has_truth:
        (target / "errors.csv").write_text(errors_csv(errors), encoding="ascii")
    truth = _TEXTS["truth" if has_truth else "no_truth"]
    text = _TEXTS["readme"].format(
        left=left.label, right=right.label, run=run.name, truth=truth, scale=pair.scale,
        most=pair.disparities - 1, nearest=pair.scale / (pair.disparities - 1),
    )  # fmt: skip
    (target / "README.txt").write_text(text, encoding="utf-8")


def disparity(left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: int) -> NDArray[np.float32]:
    """Match two grey photographs (h, w): the disparity (h, w) [pixel] of the left one's pixels; NaN without a match."""
    matcher = cv2.StereoSGBM.create(numDisparities=disparities, **_TEXTS["matcher"])
    found = matcher.compute(left, right).astype(np.float32) / np.float32(_UNIT)
    return np.where(found > 0.0, found, np.float32(np.nan))


def _pair(run: Run, right: Source) -> Pair:
    lens = run.calibration.lens(right.name)
    scale = -float(lens.P[0, 3])
    if not scale > 0.0:
        raise BagError(f"{right.info} of {run.bag} has no baseline: P[3] must be below 0")
    most = lens.width // 2
    return Pair(scale, 16 * max(min(int(np.ceil(scale / NEAREST)) + 16, most) // 16, 1))


def _write_frames(run: Run, images: Sequence[Readings], pair: Pair, target: Path, options: Options) -> list[Errors]:
    """Write the frames and return their errors, if the left images have the true depth."""
    stamps = np.intersect1d(images[0].stamps_ns, images[1].stamps_ns).tolist()
    if not stamps:
        topics = ", ".join(each.source.topics[part] for each in images for part in each.parts)
        raise BagError(f"{run.bag} has no frame: no stamp is common to {topics}")
    work = partial(_write_frame, images, pair, target)
    return [errors for found in options.each("match the photographs", run, stamps, work) for errors in found]


def _write_frame(images: Sequence[Readings], pair: Pair, target: Path, stamp: int) -> list[Errors]:
    first, second = (each.at(stamp) for each in images)
    left, right = _grey(first.photo), _grey(second.photo)
    if left.shape != right.shape:
        raise BagError(f"the photographs of a pair differ in size: {left.shape[::-1]} and {right.shape[::-1]}")
    found = disparity(left, right, pair.disparities)
    metres = np.where(np.isnan(found), np.float32(np.inf), np.float32(pair.scale) / found)
    name = str(stamp)
    _save(target / "stereo", name, metres)
    if first.depth is None:
        return []
    _save(target / "true", name, first.depth)
    with np.errstate(divide="ignore"):
        expected = pair.scale / first.depth.astype(np.float64)
    return [errors_of(found, expected, first.depth)]


def _grey(photo: NDArray[np.uint8]) -> NDArray[np.uint8]:
    grey: NDArray[np.uint8] = np.asarray(cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY), np.uint8)
    return grey


def _save(folder: Path, name: str, metres: NDArray[np.float32]) -> None:
    (folder / f"{name}.png").write_bytes(millimetres_png(metres))
    (folder / f"{name}.npy").write_bytes(metres_npy(metres))

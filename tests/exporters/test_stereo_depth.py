# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stereo depth: disparities of a wall are f B / Z, those of a run nearly, and the table is that of the files."""

import csv
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.core.errors import OutputError
from fieldtruth.exporters import export
from fieldtruth.exporters.stereo_depth import EDGES, disparity, errors_csv, errors_of

WIDTH, HEIGHT = 160, 92


@pytest.fixture(scope="module")
def folder(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(small_run, "stereo-depth", out=tmp_path_factory.mktemp("stereo") / "park_1_stereo_depth")


def wall(focal: float, baseline: float, distance: float) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Left and right image of a textured wall parallel to the image planes: the texture lies at X f / Z in the left
    image, and (X - B) f / Z in the right."""
    rng = np.random.default_rng(3)
    texture = cv2.GaussianBlur(rng.uniform(0, 255, (HEIGHT, 2 * WIDTH)).astype(np.float32), (0, 0), 1.2)
    texture = np.clip(128 + 4 * (texture - 128), 0, 255)
    columns = np.arange(WIDTH, dtype=np.float32) + WIDTH / 2
    rows = np.broadcast_to(np.arange(HEIGHT, dtype=np.float32)[:, None], (HEIGHT, WIDTH)).copy()

    def seen_from(x: float) -> NDArray[np.uint8]:
        shifted = np.broadcast_to(columns + np.float32(x * focal / distance), (HEIGHT, WIDTH)).copy()
        return np.asarray(cv2.remap(texture, shifted, rows, cv2.INTER_CUBIC)).clip(0, 255).astype(np.uint8)

    return seen_from(0.0), seen_from(baseline)


@pytest.mark.parametrize("distance", [1.5, 3.0, 7.0])
def test_disparity_of_a_wall_is_f_b_over_z(distance: float) -> None:
    focal, baseline = 300.0, 0.12
    left, right = wall(focal, baseline, distance)
    found = disparity(left, right, 64)
    has = np.isfinite(found)
    assert has[:, 64:].mean() > 0.95
    assert np.abs(found[has] - focal * baseline / distance).mean() < 0.1
    assert (np.abs(found[has] - focal * baseline / distance) < 1.0).mean() > 0.99


def test_pair_with_exchanged_photographs_does_not_match() -> None:
    left, right = wall(300.0, 0.12, 3.0)
    found = disparity(right, left, 64)
    close = np.abs(found - 12.0) < 1.0
    assert close.mean() < 0.01


def test_depth_of_a_run_agrees_with_the_true_depth(folder: Path) -> None:
    scale = WIDTH / 2 / np.tan(np.radians(69.0 / 2)) * 0.12
    errors, shares = [], []
    for path in sorted((folder / "stereo").glob("*.npy")):
        found, truth = np.load(path), np.load(folder / "true" / path.name)
        assert found.dtype == truth.dtype == np.float32
        real = np.isfinite(truth)
        has = np.isfinite(found) & real
        errors.append(np.abs(scale / found[has] - scale / truth[has]))
        shares.append(has.sum() / real.sum())
    assert len(errors) == 30  # 1.2 s at 25 Hz
    assert np.mean(shares) > 0.5
    assert (np.concatenate(errors) < 1.0).mean() > 0.9


def test_png_is_the_depth_in_millimetres(folder: Path) -> None:
    path = next((folder / "stereo").glob("*.npy"))
    metres = np.load(path)
    png = cv2.imread(str(path.with_suffix(".png")), cv2.IMREAD_UNCHANGED)
    assert png is not None
    assert png.dtype == np.uint16
    near = metres < 65.0
    assert near.sum() > 1000
    assert np.abs(png[near] - 1000.0 * metres[near]).max() <= 0.51
    assert (png[~np.isfinite(metres)] == 0).all()


def test_table_is_that_of_the_files(folder: Path) -> None:
    scale = WIDTH / 2 / np.tan(np.radians(69.0 / 2)) * 0.12
    pairs = [
        (np.load(path), np.load(folder / "true" / path.name)) for path in sorted((folder / "stereo").glob("*.npy"))
    ]
    found, truth = (np.concatenate([pair[k].ravel() for pair in pairs]).astype(np.float64) for k in (0, 1))
    with (folder / "errors.csv").open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(EDGES)
    for row in rows:
        real = np.isfinite(truth) & (truth >= float(row["depth_from_m"])) & (truth < float(row["depth_to_m"]))
        assert int(row["pixels"]) == real.sum()
        if not real.any():
            assert row["matched_share"] == ""
            continue
        has = real & np.isfinite(found)
        assert float(row["matched_share"]) == pytest.approx(has.sum() / real.sum(), abs=1e-4)
        bad = np.abs(scale / found[has] - scale / truth[has]) > 3.0
        assert float(row["bad_3px_share"] or 0.0) == pytest.approx(bad.mean() if has.any() else 0.0, abs=2e-4)
        if has.any():
            median = np.median(np.abs(found[has] / truth[has] - 1.0))
            assert float(row["median_relative_error"]) == pytest.approx(median, rel=0.01)


def test_table_of_known_errors() -> None:
    depth = np.array([[1.0, 3.0, 3.0, np.inf, 30.0, 30.0]], np.float32)
    expected = 60.0 / depth.astype(np.float64)
    found = np.array([[60.0, 22.0, 24.0, 9.0, np.nan, 1.0]], np.float32)
    lines = errors_csv([errors_of(found, expected, depth)]).splitlines()
    row = {line.split(",")[0]: line.split(",")[2:] for line in lines[1:-1]}
    assert row["0"][:3] == ["1", "1.0000", "0.0000"]
    assert row["2.5"][:3] == ["2", "1.0000", "0.5000"]  # 2 and 4 pixels wrong
    assert float(row["2.5"][3]) == pytest.approx(abs(20 / 22 - 1), rel=0.01)  # the lower of two
    assert row["20"][:3] == ["2", "0.5000", "0.0000"]
    assert float(row["20"][3]) == pytest.approx(1.0, rel=0.01)  # 60 m instead of 30
    assert row["5"] == ["0", "", "", ""]


def test_missing_library_is_one_line(brief_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.delitem(sys.modules, "fieldtruth.exporters.stereo_depth", raising=False)
    with pytest.raises(
        OutputError, match=r"the cv2 library is not installed; run: pip install 'fieldtruth\[stereo-dep"
    ):
        export(brief_run, "stereo-depth", out=tmp_path / "out")
    assert not list(tmp_path.iterdir())

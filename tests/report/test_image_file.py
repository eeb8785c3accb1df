# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Image files: PNG is lossless, JPEG is small, existing files are kept."""

from pathlib import Path

import numpy as np
import pytest
import simplejpeg
from matplotlib.image import imread

from fieldtruth.core.errors import OutputError
from fieldtruth.report.drawing.images import LARGEST_JPEG, write_image

NOISE = np.random.default_rng(0).integers(0, 256, (40, 60, 3)).astype(np.uint8)


def test_png_keeps_every_pixel(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", NOISE)
    np.testing.assert_array_equal(np.rint(255 * imread(tmp_path / "a.png")[..., :3]), NOISE)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_jpeg_has_the_best_quality_below_the_size_limit(tmp_path: Path) -> None:
    smooth = np.broadcast_to(np.linspace(0, 255, 200).astype(np.uint8)[:, None], (100, 200, 3))
    write_image(tmp_path / "smooth.jpg", smooth.copy())
    seen = simplejpeg.decode_jpeg((tmp_path / "smooth.jpg").read_bytes())
    assert np.abs(seen.astype(int) - smooth).max() < 8
    noise = np.random.default_rng(0).integers(0, 256, (800, 1200, 3)).astype(np.uint8)
    assert len(simplejpeg.encode_jpeg(noise, quality=90, colorspace="RGB")) > LARGEST_JPEG
    write_image(tmp_path / "noise.JPEG", noise)
    assert (tmp_path / "noise.JPEG").stat().st_size < LARGEST_JPEG


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.bmp", r"its name must end in \.png, \.jpg or \.jpeg"),
        ("a", r"its name must end in \.png, \.jpg or \.jpeg"),
        ("old.png", "old.png already exists; choose another --out, or use --overwrite to replace it"),
        ("folder.png", "folder.png: it is a folder"),
        ("no/a.png", "folder .*no does not exist"),
    ],
)
def test_invalid_image_paths_are_errors(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "old.png").write_bytes(b"old")
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(OutputError, match=text):
        write_image(tmp_path / name, NOISE)
    assert (tmp_path / "old.png").read_bytes() == b"old"


def test_overwrite_replaces_the_file(tmp_path: Path) -> None:
    (tmp_path / "old.png").write_bytes(b"old")
    write_image(tmp_path / "old.png", NOISE, overwrite=True)
    assert imread(tmp_path / "old.png").shape[:2] == (40, 60)

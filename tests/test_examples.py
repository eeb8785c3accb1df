# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Examples run, and what they print is sane."""

import re
import runpy
from pathlib import Path

import pytest
import simplejpeg

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_labelled_frame_counts_every_point_and_every_pixel_once(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "labelled_frame.py"), run_name="__main__")
    rows = [re.split(r"\s{2,}", line) for line in capsys.readouterr().out.splitlines()]
    shares = {row[0]: (float(row[1].rstrip("%")), float(row[2].rstrip("%"))) for row in rows[1:]}
    assert rows[0] == ["class", "points", "pixels"]
    for column in (0, 1):
        assert sum(share[column] for share in shares.values()) == pytest.approx(100, abs=0.05 * len(shares))
    assert shares["sky"][0] == 0
    assert shares["sky"][1] > 5
    assert min(shares["ground"]) > 5


def test_park_picture_writes_a_picture_of_two_images_and_a_cloud(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "park.jpg"
    monkeypatch.setattr("sys.argv", ["park_picture.py", str(path)])
    runpy.run_path(str(EXAMPLES / "park_picture.py"), run_name="__main__")
    picture = simplejpeg.decode_jpeg(path.read_bytes(), "RGB")
    assert picture.shape == (720, 1200, 3)
    assert picture[:180, :640, 2].mean() > picture[200:360, :640, 2].mean()  # sky above ground


def test_train_loader_shows_a_batch_and_its_loss(
    small_run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    monkeypatch.setattr("sys.argv", ["train_loader.py", str(small_run)])
    runpy.run_path(str(EXAMPLES / "train_loader.py"), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "6 frames"
    assert "image (4, 3, 184, 320) torch.uint8" in lines
    assert "mask (4, 184, 320) torch.int64" in lines
    assert re.fullmatch(r"loss [1-9]\.\d{3}", lines[-1])


def test_every_example_is_run_here() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    assert [path.name for path in EXAMPLES.glob("*.py") if path.name not in text] == []

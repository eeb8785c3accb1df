# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of a training set that the table of ablations compares."""

from pathlib import Path

import ablation
import numpy as np
import pytest
from ablation import Conditions, Frames, Tried, changes


def test_each_row_has_the_frames_of_its_runs() -> None:
    """24 worlds, half of them parks along trails in summer, with 30 frames each."""
    worlds = tuple(
        Conditions(("park", "quarry")[k % 2], k % 2 == 0, ("summer", "winter")[k % 2], "none") for k in range(24)
    )
    run = np.repeat(np.arange(24), 30)
    nothing = np.zeros((720, 1, 1), np.uint8)
    found = {row.name: row for row in changes(Frames(nothing, nothing, worlds, run), has_ideal=True)}
    parks = np.flatnonzero(run % 2 == 0)
    for name in ("only park", "worlds: those of the paper", "viewpoints: along trails", "season: summer"):
        np.testing.assert_array_equal(found[name].frames, parks)
    assert len(found["light: overcast"].frames) == 0
    assert [len(found[name].frames) for name in ("everything", "curve: 12 worlds")] == [720, 360]
    assert "curve: 24 worlds" not in found  # it is everything
    few = found["curve: 12 worlds, each fifteenth frame"].frames
    assert (len(few), sorted(set((few % 30).tolist()))) == (24, [0, 15])
    assert set(run[few].tolist()) == set(run[found["curve: 12 worlds"].frames].tolist())
    assert not found["signal: none"].signal
    assert not found["augmentation: none"].augmented


def test_a_row_shows_means_and_half_the_range_of_its_seeds() -> None:
    row = Tried("everything", 24, 720, {"real, trail": [50.0, 53.0], "real, mean": [40.0, 40.0]})
    assert row.head().splitlines()[0] == "| trained on | worlds | frames | real, trail | real, mean |"
    assert row.line() == "| everything | 24 | 720 | 51.5 ± 1.5 | 40.0 ± 0.0 |"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--steps", "0"], "--steps must be at least 1, got 0"),
        (["--seeds", "0"], "--seeds must be at least 1, got 0"),
        (["--processes", "0"], "--processes must be at least 1, got 0"),
        (["--width", "8"], "--width must be at least 32, got 8"),
        (["--json", "nowhere/x.json"], "nowhere/x.json cannot be written: {folder}/nowhere is not a folder"),
        (["--cache", "nowhere/cache"], "nowhere/cache cannot be written: {folder}/nowhere is not a folder"),
        (["--real", "nowhere"], "nowhere is not a folder"),
        ([], "sets is not a folder; runs are opened from the folder that contains them"),
    ],
)
def test_a_mistake_is_one_line_and_nothing_is_written(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("torch", reason="pip install torch")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        ablation.main(["sets", "--cache", "cache", *arguments])
    assert ended.value.code == 2
    assert capsys.readouterr().err.splitlines() == [f"ablation.py: {message.format(folder=tmp_path)}"]
    assert list(tmp_path.iterdir()) == []

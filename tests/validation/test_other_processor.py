# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of another processor: differences in the last digit pass, wrong readings fail, in both directions."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import other_processor
import pytest
from changed_bags import LEFT, POINTS, SMALL, Edit, Edits, bag_in, edited, failures, pixels_in, points_in, rewritten

from fieldtruth.bag.provenance import difference, makers_of, note, noted, read_checksums, sha256_of, this_process
from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.pipeline import generate
from fieldtruth.render import daylight
from fieldtruth.sense.embree import native_packet
from fieldtruth.validation.runner import validate

TAG = LEFT.topic_of("tag")
LARGE = 540, 960
ELSEWHERE = this_process() | {"packet width": "1", "Numba's processor": "abacus"}
needs_another = pytest.mark.skipif(not other_processor.INTEL, reason="Embree has one instruction set on this processor")


def there(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line as on another processor."""
    other = other_processor.AVX512 if native_packet() == 16 else other_processor.OTHERS
    environment = os.environ | {"OTHER_PROCESSOR": " ".join(other), "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, other_processor.__file__, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


# ---------------------------------------------------------------------------------------------------------------------
# What made a run


def test_a_run_names_what_made_it(small_run: Path) -> None:
    path = small_run / "made_by.json"
    assert json.loads(path.read_text()) == [this_process()]
    assert read_checksums(small_run)[path.name] == sha256_of(path)
    assert this_process()["packet width"] in ("8", "16")
    assert difference(makers_of(small_run)) == ""


@needs_another
def test_a_process_with_other_settings_knows_it() -> None:
    found = dict(line.split(": ", 1) for line in there().stdout.splitlines())
    different = difference([found])
    assert found.keys() == this_process().keys()
    assert "Embree's instruction set" in different
    assert "Numba's processor" in different
    assert "numpy" not in different.split(", ")


def test_all_makers_of_slices_are_named_once(tmp_path: Path) -> None:
    """Two processors, or workers, may make a run together; an unknown one counts as another."""
    for makers in ([this_process()], [ELSEWHERE], [this_process()]):
        note(tmp_path, makers)
    (tmp_path / "made_by.json").write_text(noted(tmp_path))
    found = makers_of(tmp_path)
    assert len(found) == 2
    assert this_process() in found
    assert difference(found) == "made with other packet width, Numba's processor"
    assert difference([this_process(), {}]) == "no made_by.json says what made it"


@pytest.mark.parametrize("text", [None, "", "[", "[]", "3", "[3]", "{}", "null"])
def test_a_record_that_cannot_be_read_is_no_record(text: str | None, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "made_by.json").write_text(text)
    assert difference(makers_of(tmp_path)) == "no made_by.json says what made it"


# ---------------------------------------------------------------------------------------------------------------------
# Validation: readings of this processor, said to be of another one


def last_digit(data: bytearray) -> None:
    """Move a point by half a micrometre, as another processor may."""
    points = points_in(data)
    for axis in "xyz":
        points[axis][77] = np.nextafter(points[axis][77], np.float32(0))


def half_a_millimetre(data: bytearray) -> None:
    """Move some points along their rays."""
    points = points_in(data)
    for axis in "xyz":
        points[axis][100:110] *= np.float32(1 + 5e-4 / np.linalg.norm([points[a][105] for a in "xyz"]))


def flipped_pixels(size: tuple[int, int]) -> Edit:
    """Give three leaves the class of trunks, which their object can have, too."""

    def edit(data: bytearray) -> None:
        pixels = pixels_in(data, "u1", 3, size)
        rows, columns = np.nonzero((pixels == PALETTE[Label.TREETOP]).all(axis=-1))
        chosen = np.linspace(0, len(rows) - 1, 5).astype(int)[1:4]
        pixels[rows[chosen], columns[chosen]] = PALETTE[Label.TRUNK]

    return edit


def wrong(size: tuple[int, int]) -> Edits:
    """Ten points and three pixels, in images of a size."""
    return {(POINTS, 2): half_a_millimetre, (TAG, 1): flipped_pixels(size)}


def changed(run: Path, target: Path, edits: Edits, makers: list[dict[str, str]] | None) -> Path:
    """Copy a run with edited messages and another record, None for none, of what made it."""
    copy = rewritten(run, target, edited(edits))
    (copy / "SHA256SUMS").unlink()
    (copy / "made_by.json").unlink()
    if makers is not None:
        (copy / "made_by.json").write_text(json.dumps(makers))
    return copy


@pytest.mark.parametrize(
    "makers", [[ELSEWHERE], *(pytest.param(k, marks=pytest.mark.slow) for k in ([this_process(), ELSEWHERE], None))]
)
@pytest.mark.usefixtures("in_park")
def test_last_digits_of_another_processor_pass(
    makers: list[dict[str, str]] | None, lean_run: Path, tmp_path: Path
) -> None:
    """Four of five clouds are equal, so that no share of equal ones shows the processor."""
    checks = validate(changed(lean_run, tmp_path, {(POINTS, 2): last_digit}, makers), samples=1)
    assert failures(checks) == {}
    texts = {check.name: check.text for check in checks}
    reason = "no made_by.json says" if makers is None else "made with other packet width, Numba's processor"
    assert reason in texts["retraced clouds"]
    assert reason in texts["retraced images"]


@pytest.mark.usefixtures("in_park")
def test_last_digits_of_this_processor_fail(lean_run: Path, tmp_path: Path) -> None:
    """All five clouds differ."""
    edits: Edits = {(POINTS, k): last_digit for k in range(5)}
    texts = failures(validate(changed(lean_run, tmp_path, edits, [this_process()]), samples=1))
    assert list(texts) == ["retraced clouds"]
    assert "equal to the last digit: 5 of 5 mismatch" in texts["retraced clouds"]


@pytest.mark.parametrize("makers", [[ELSEWHERE], pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.usefixtures("in_park")
def test_wrong_readings_of_another_processor_fail(
    makers: list[dict[str, str]] | None, lean_run: Path, tmp_path: Path
) -> None:
    texts = failures(validate(changed(lean_run, tmp_path, wrong(SMALL), makers), full=True, samples=1))
    assert set(texts) == {"retraced clouds", "retraced images"}
    assert "10 of" in texts["retraced clouds"]
    assert "3 of" in texts["retraced images"]


# ---------------------------------------------------------------------------------------------------------------------
# Two processes: bags that either makes are validated by the other


FOREST: dict[str, Any] = {
    "layout": {"size": [40.0, 24.0], "individuals": 1, "beyond": False},
    "route": {"metres": {"start": [-4.9, -4.5], "waypoints": [[1.7, -0.8], [7.8, 4.0]]}},
}
"""As dense as the full forest, and a part of a route through it. Needles and ferns fill its images with edges, where
the last digits decide what a ray meets; without land beyond, every leaf belongs to a plant with a trunk."""


def short() -> Experiment:
    """Some clouds and two large images of each camera: these differ between processors, small ones of few do."""
    values = load_experiment("forest_1").model_dump() | FOREST | {"seconds": 0.4}
    values["rig"]["cameras"] = {"rate_hz": 5.0, "instances": True, "width": 960, "height": 540}
    return Experiment.model_validate(values)


def failures_here(run: Path) -> dict[str, str]:
    """Failed checks in this process."""
    return failures(validate(run, full=True))


def failures_there(run: Path) -> dict[str, str]:
    """Failed checks on the other processor."""
    checks = json.loads(there("validate", str(run), "--full", "--json").stdout)["checks"]
    return {check["name"]: check["text"] for check in checks if check["passed"] is False}


@pytest.mark.slow
@needs_another
def test_each_processor_accepts_the_bags_of_the_other_and_finds_wrong_readings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a bag with some wrong readings, all that is not wrong is accepted, to the last point and pixel."""
    monkeypatch.setattr(daylight, "DOME_TEXELS", 512)
    monkeypatch.setenv("SKY_TEXELS", "512")  # of the other process
    made_here = short()
    name = made_here.name
    (tmp_path / "short.yaml").write_text(dump_experiment(made_here))
    made = there("generate", str(tmp_path / "short.yaml"), "--out", str(tmp_path / "there"))
    assert made.returncode == 0, made.stderr
    run, here = tmp_path / "there" / name, generate(made_here, tmp_path / "here").parent
    assert difference(makers_of(run)).startswith(
        "made with other packet width" if native_packet() == 16 else "made with"
    )
    assert bag_in(run).read_bytes() != bag_in(here).read_bytes()
    for folder, judge in ((run, failures_here), (here, failures_there)):
        texts = judge(rewritten(folder, tmp_path / f"wrong {folder.parent.name}", edited(wrong(LARGE))))
        assert set(texts) == {"retraced clouds", "retraced images"}, texts
        assert "10 of" in texts["retraced clouds"]
        assert "3 of" in texts["retraced images"]

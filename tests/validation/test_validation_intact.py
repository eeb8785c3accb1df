# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Intact runs of several rigs pass every check; the output and the documentation name all checks."""

import json
from pathlib import Path

import pytest
from changed_bags import CAMERA_TOPICS, POINTS, failures, failures_of, points_in, rewritten
from small_park import in_small_park

from fieldtruth.bag.reader import RawMessage
from fieldtruth.cli import main
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, load_experiment, with_overrides
from fieldtruth.pipeline import generate
from fieldtruth.validation import Check, as_json, as_text
from fieldtruth.validation.__main__ import with_table
from fieldtruth.validation.runner import validate

MAPS = ["map", "local maps", "costs", "costs by drives", "heights by rays"]
NOT_IDEAL = ["clocks", "imu noise", "gnss noise", "wheel noise", "noise of LiDARs", "normals", "optical flow"]
MOVING = "moving objects"
"""Of runs in which something moves beside the robot."""
NAMES = [
    "checksums", "experiment", "structure", "messages", "topics", "counts", "stamps", "synchronisation", "clock",
    "headers", "frames", "calibration", "static objects", "motion", "poses", "drive", "imu", "gnss", "wheels",
    "wheel odometry", "commands", "labels",
    "rays", "images", "tag colours", "depth", "object classes", "lidar and cameras", "world", "retraced clouds",
    "retraced images", "photographs", "independent rays",
]  # fmt: skip
"""Names for programs: they are stable."""


def passed(checks: list[Check]) -> dict[str, bool | None]:
    return {check.name: check.passed for check in checks}


@pytest.mark.usefixtures("in_park")
def test_an_intact_run_passes_every_check(lean_run: Path) -> None:
    checks = validate(lean_run, full=True, samples=4)
    assert passed(checks) == dict.fromkeys(NAMES, True), failures(checks)
    assert list(passed(checks)) == NAMES
    texts = {check.name: check.text for check in checks}
    assert f"{5 * 512 * 64:,} rays" in texts["retraced clouds"]
    assert f"{26 * 320 * 184:,} pixels; all images" in texts["retraced images"]
    assert "26 photographs" in texts["photographs"]


def test_without_the_world_only_its_checks_are_skipped(lean_run: Path) -> None:
    checks = validate(lean_run, quick=True)
    skipped = {"world", "retraced clouds", "retraced images", "photographs", "independent rays"}
    assert passed(checks) == {name: None if name in skipped else True for name in NAMES}, failures(checks)


def test_the_result_does_not_depend_on_the_number_of_threads(lean_run: Path) -> None:
    assert validate(lean_run, quick=True, workers=1) == validate(lean_run, quick=True, workers=5)


@pytest.mark.usefixtures("in_park")
def test_a_run_without_cameras_passes(lean_run: Path, tmp_path: Path) -> None:
    """A rig without cameras records the same bag without their topics."""

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        return None if raw.topic in CAMERA_TOPICS else raw

    blind = with_overrides(load_experiment(lean_run / "experiment.yaml"), cameras=False)
    checks = validate(rewritten(lean_run, tmp_path, change, blind), samples=4)
    about_images = {"images", "tag colours", "depth", "lidar and cameras", "retraced images", "photographs"}
    assert passed(checks) == {name: None if name in about_images else True for name in NAMES}, failures(checks)


@pytest.fixture(scope="module")
def spinning_run(in_park: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rates that divide neither a second nor each other, a LiDAR whose columns leave one by one, a slow receiver."""
    values = load_experiment("park_2").model_dump()
    values["seconds"] = 0.45
    rig = values["rig"]
    rig["cameras"] = {"width": 200, "height": 104, "rate_hz": 7.0, "far": 60.0, "instances": True}
    rig["lidar"] = {"spinning": True, "rate_hz": 3.0, "columns": 300, "rings": 16, "max_range": 20.0, "min_range": 2.0}
    rig["imu"], rig["tachometers"] = {"rate_hz": 333.0}, {"rate_hz": 7.0}
    return generate(Experiment.model_validate(values), tmp_path_factory.mktemp("spinning")).parent


@pytest.mark.usefixtures("in_park")
def test_run_with_odd_rates_and_a_spinning_lidar_passes(spinning_run: Path) -> None:
    checks = validate(spinning_run, samples=6)
    skipped = {"gnss", "lidar and cameras", "photographs", "depth"}
    assert passed(checks) == {name: None if name in skipped else True for name in NAMES}, failures(checks)


@pytest.mark.usefixtures("in_park")
@pytest.mark.parametrize(("rate", "sampling"), [pytest.param(50.0, "instant", marks=pytest.mark.slow), (7.0, "mean")])
def test_imu_of_any_rate_and_sampling_passes(rate: float, sampling: str, tmp_path: Path) -> None:
    values = in_small_park(seconds=0.3).model_dump()
    values["rig"]["cameras"] = values["rig"]["lidar"] = {"enabled": False}
    values["rig"]["imu"] = {"rate_hz": rate, "sampling": sampling}
    run = generate(Experiment.model_validate(values), tmp_path).parent
    (imu,) = (check for check in validate(run, quick=True) if check.name == "imu")
    assert imu.passed, imu.text
    assert imu.text.startswith(f"{int(0.3 * rate)} readings")
    # The other mode is found to be wrong.
    values["rig"]["imu"] = {"rate_hz": rate, "sampling": "mean" if sampling == "instant" else "instant"}
    (run / "experiment.yaml").write_text(dump_experiment(Experiment.model_validate(values)))
    (imu,) = (check for check in validate(run, quick=True) if check.name == "imu")
    assert imu.passed is False


def test_column_time_of_one_point_is_found(spinning_run: Path, tmp_path: Path) -> None:
    def edit(data: bytearray) -> None:
        points_in(data)["t"][500] += 1

    text = failures_of(spinning_run, tmp_path, {(POINTS, 0): edit})["rays"]
    assert text.startswith("t, where present, is the time at which the ray leaves: 1 of")


def test_text_and_json_have_the_same_checks() -> None:
    checks = [Check("stamps", True, "12 rise"), Check("imu", False, "off by 1 m"), Check("gnss", None, "no receiver")]
    assert as_text(checks).splitlines() == [
        "pass     stamps  12 rise",
        "FAIL     imu     off by 1 m",
        "skipped  gnss    no receiver",
        "3 checks: 1 passed, 1 failed, 1 skipped",
    ]
    output = json.loads(as_json(checks))
    assert output["passed"] is False
    assert [(row["name"], row["passed"]) for row in output["checks"]] == [
        ("stamps", True),
        ("imu", False),
        ("gnss", None),
    ]
    assert json.loads(as_json([checks[0], checks[2]]))["passed"] is True


def test_command_prints_the_checks_and_exits_with_1_on_failure(
    lean_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["validate", str(lean_run), "--quick"]) == 0
    assert (
        capsys.readouterr().out.splitlines()[-1] == f"{len(NAMES)} checks: {len(NAMES) - 5} passed, 0 failed, 5 skipped"
    )
    bad = tmp_path / "bad.bag"
    bad.write_bytes((lean_run / "park_1.bag").read_bytes()[:-100])
    assert main(["validate", str(bad), "--quick", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["passed"] is False


def test_document_has_the_generated_table_of_checks() -> None:
    text = (Path(__file__).parents[2] / "docs/validate.md").read_text(encoding="utf-8")
    assert [line.split("`")[1] for line in text.splitlines() if line.startswith("| `")] == [
        *NAMES,
        MOVING,
        "actors",
        *NOT_IDEAL,
        *MAPS,
    ]
    assert text == with_table(text), "run: python -m fieldtruth.validation docs/validate.md"

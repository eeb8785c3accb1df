# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The training sets of the package: each run another world, many frames along trails, splits by world."""

from collections import Counter
from pathlib import Path

import pytest
from pydantic import ValidationError

from fieldtruth import cli
from fieldtruth.campaign.draw import draw, merged, world_of_run
from fieldtruth.campaign.files import CAMPAIGNS, check_campaign, load_campaign, with_changes
from fieldtruth.core.registry import VARIABLE
from fieldtruth.experiment.config import Experiment


@pytest.mark.parametrize(("name", "along"), [("standard-images", 3 / 4), ("standard-clouds", 2 / 5)])
def test_each_run_is_another_world_in_one_split(name: str, along: float) -> None:
    campaign = load_campaign(name)
    check_campaign(campaign, name)
    runs = draw(campaign)
    assert len(runs) == 300
    assert len({world_of_run(run.experiment) for run in runs}) == 300
    assert Counter(run.split for run in runs) == {"train": 240, "val": 30, "test": 30}
    experiments = [run.experiment for run in runs if run.experiment.environment not in ("lake", "hillside")]
    on_trails = sum(each.frames is not None and each.frames.along == "trail" for each in experiments) / 300
    assert on_trails == pytest.approx(along, abs=0.05)
    assert {run.experiment.environment for run in runs} == set(campaign.environments["choice"])
    assert len({run.experiment.layout["season"] for run in runs}) == 4


def test_fewer_runs_are_the_first_of_more() -> None:
    campaign = load_campaign("standard-images")
    few = draw(with_changes(campaign, runs=9))
    assert few == draw(campaign)[:9]


def test_each_photograph_has_the_preset_of_a_robot_with_an_exposure_of_its_own() -> None:
    cameras = [run.experiment.rig.sensors[0] for run in draw(with_changes(load_campaign("standard-images"), runs=20))]
    signals = [camera.model_dump()["signal"] for camera in cameras]
    assert len({signal["exposure_ev"] for signal in signals}) == 20
    assert {signal["jpeg_quality"] for signal in signals} == {80}


def test_a_campaign_in_a_folder_of_the_users_has_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "campaigns").mkdir()
    text = "name: own\ndescription: two parks\nruns: 2\nenvironments: [park]\n"
    (tmp_path / "campaigns" / "own.yaml").write_text(text)
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    assert "own" in CAMPAIGNS
    assert len(draw(load_campaign("own"))) == 2
    assert cli.main(["list", "campaigns"]) == 0
    assert "own              two parks" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("all", "error: --runs is for campaigns with a number of runs; all has none\n"),
        ("park_1", "error: --runs is for campaigns; park_1 is one experiment\n"),
    ],
)
def test_a_number_of_runs_where_there_is_none_is_one_line(
    name: str, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["generate", name, "--runs", "3"]) == 2
    assert capsys.readouterr().err == line


def test_a_preset_of_a_signal_changes_single_keys_and_replaces_a_stored_signal() -> None:
    camera = {"kind": "camera", "name": "a", "mount": {"xyz": [0, 0, 1]}}

    def signal(given: object) -> object:
        values = {
            "name": "x",
            "environment": "park",
            "frames": {"count": 1},
            "rig": {"sensors": [camera | {"signal": given}]},
        }
        return Experiment.model_validate(values).rig.sensors[0].signal

    robot = signal("robot")
    assert signal({"preset": "robot"}) == robot
    brighter = signal({"preset": "robot", "exposure_ev": 1.0})
    assert brighter == robot.model_copy(update={"exposure_ev": 1.0})  # type: ignore[attr-defined]
    stored = {"signal": {"exposure_ev": 1.0, "bloom": 0.5}}
    assert merged(stored, {"signal": {"preset": "clean"}}) == {"signal": {"preset": "clean"}}
    assert merged(stored, {"signal": {"bloom": 0.1}}) == {"signal": {"exposure_ev": 1.0, "bloom": 0.1}}
    with pytest.raises(ValidationError, match="must be ideal, datasheet, clean, robot; got 'park'"):
        signal({"preset": "park"})

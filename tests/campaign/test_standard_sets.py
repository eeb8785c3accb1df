# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The training sets of the package: each run another world, many frames along trails, splits by world."""

from collections import Counter
from pathlib import Path

import pytest

from fieldtruth import cli
from fieldtruth.campaign.draw import draw, world_of_run
from fieldtruth.campaign.files import CAMPAIGNS, check_campaign, load_campaign, with_changes
from fieldtruth.core.registry import VARIABLE


@pytest.mark.parametrize(("name", "along"), [("standard-images", 4 / 5), ("standard-clouds", 1 / 2)])
def test_each_run_is_another_world_in_one_split(name: str, along: float) -> None:
    campaign = load_campaign(name)
    check_campaign(campaign, name)
    runs = draw(campaign)
    assert len(runs) == 300
    assert len({world_of_run(run.experiment) for run in runs}) == 300
    assert Counter(run.split for run in runs) == {"train": 240, "val": 30, "test": 30}
    frames = [run.experiment.frames for run in runs]
    assert sum(each is not None and each.along == "trail" for each in frames) / 300 == pytest.approx(along, abs=0.08)
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

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Data sets of several runs: splits by folder, unique names, and no world in two splits."""

import json
from pathlib import Path

import pytest
from published_truth import as_world

from fieldtruth import cli
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.exporters.frames import find_members


@pytest.fixture(scope="module")
def campaign(brief_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs of one world in train, one of another world in val, all with the same name."""
    folder = tmp_path_factory.mktemp("campaign")
    as_world(brief_run, folder / "train" / "a", 5)
    as_world(brief_run, folder / "train" / "b", 5)
    as_world(brief_run, folder / "val" / "c", 6)
    return folder


def test_runs_of_a_folder_belong_to_the_split_whose_folder_holds_them(campaign: Path, brief_run: Path) -> None:
    members = find_members([campaign, brief_run], "test")
    assert [(m.split, m.name) for m in members] == [
        ("train", "park_1"),
        ("train", "park_1-2"),
        ("val", "park_1-3"),
        ("test", "park_1-4"),
    ]
    assert [(m.split, m.name) for m in find_members([campaign / "val" / "c"], "train")] == [("val", "park_1")]


def test_a_world_in_two_splits_is_refused(campaign: Path, tmp_path: Path, brief_run: Path) -> None:
    other = as_world(brief_run, tmp_path / "test" / "d", 6)
    with pytest.raises(
        OutputError, match=r"c/park_1\.bag in split 'val' and .*d/park_1\.bag in split 'test' are of the same world"
    ):
        find_members([campaign, other], "train")
    with pytest.raises(OutputError, match="is given twice"):
        find_members([campaign, campaign / "val"], "train")
    with pytest.raises(UnknownNameError, match="unknown split 'valid'; did you mean 'val'"):
        find_members([campaign], "valid")


def test_campaign_becomes_one_folder_beside_it(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["export", str(campaign), "--to", "webdataset"]) == 0
    made = campaign.with_name(f"{campaign.name}_webdataset")
    assert capsys.readouterr().out.startswith(f"{made}: 5 files, ")
    described = json.loads((made / "dataset.json").read_text())
    assert [(row["name"], row["split"], row["seed"]) for row in described["runs"]] == [
        ("park_1", "train", 5),
        ("park_1-2", "train", 5),
        ("park_1-3", "val", 6),
    ]
    assert [(row["url"], row["samples"]) for row in described["shards"]] == [
        ("train-000000.tar", 2 * described["runs"][0]["frames"]),
        ("clouds-train-000000.tar", 2 * described["runs"][0]["clouds"]),
        ("val-000000.tar", described["runs"][2]["frames"]),
        ("clouds-val-000000.tar", described["runs"][2]["clouds"]),
    ]


def test_missing_runs_of_a_campaign_are_a_warning(
    brief_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "c"
    as_world(brief_run, folder / "park_1", 0)
    (folder / "campaign.yaml").write_text("name: c\nexperiments: [park_1, lake_1]\n")
    assert cli.main(["export", str(folder), "--to", "mmseg"]) == 0
    line = f"warning: 2 of 2 runs of {folder} are not done, see `fieldtruth status {folder}`"
    assert line in capsys.readouterr().err.splitlines()


def test_errors_are_one_line_and_write_nothing(
    campaign: Path, brief_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    out = ["--out", str(tmp_path / "out")]
    for words, line in (
        ([str(tmp_path / "no"), "--to", "webdataset"], f"{tmp_path}/no does not exist; it must be the folder of a run"),
        ([str(tmp_path / "empty"), "--to", "webdataset"], f"{tmp_path}/empty has no runs: no bag in it"),
        ([str(brief_run), "--to", "webdataset", "--shard-mb", "0"], "--shard-mb must be an integer of at least 1"),
        ([str(brief_run), "--to", "tum", "--split", "val"], "format 'tum' has neither splits nor shards; formats that"),
        ([str(campaign), "--to", "tum"], f"{campaign} has no bag"),
    ):
        assert cli.main(["export", *words, *out]) == 2
        assert capsys.readouterr().err.startswith(f"error: {line}")
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]

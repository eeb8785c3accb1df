# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Campaign files: short ones are enough, and every mistake is one line that names the key and what is allowed."""

from pathlib import Path

import pytest

from fieldtruth import cli
from fieldtruth.campaign.draw import draw
from fieldtruth.campaign.files import dump_campaign, is_campaign, load_campaign
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.sensor_config import KINDS

DRAWN = "name: c\nruns: 4\nenvironments: [park]\n"


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


MISTAKES = [
    (DRAWN + "sedes: 3\n", "unknown key 'sedes'; did you mean 'seeds'? Available: name, "),
    (DRAWN + "seconds: 0\n", "seconds must be a number between 0.001 and 86400, got 0"),
    (DRAWN + "seconds: {uniform: [5, 100000]}\n", "seconds must be a number between 0.001 and 86400, got 100000.0"),
    ("name: c\nenvironments: [park]\n", "runs is required: an integer between 1 and 100000, or product"),
    ("name: c\nruns: 4\n", "environments or experiments is required: a list of names"),
    ("name: c\nruns: 0\nenvironments: park\n", "runs must be an integer between 1 and 100000, or product "),
    (
        "name: c\nruns: 4\nenvironments: [prak]\n",
        "unknown environment 'prak'; did you mean 'park'? Available: forest, ",
    ),
    ("name: c\nruns: 4\nenvironments: []\n", "environments or experiments is required: a list of names"),
    ("name: c\nruns: 4\nenvironments: {choice: []}\n", "environments: choice must be a list with at least one value"),
    ("name: c\nruns: 4\nenvironments: [3]\n", "environments must be a name or a list of names, got 3"),
    ("name: c\nruns: 4\nexperiments: [park_1]\n", "experiments exclude runs: each listed experiment is one run"),
    ("name: c\nexperiments: [prak_1]\n", "unknown experiment 'prak_1'; did you mean 'park_1'? Available: forest_1, "),
    ("name: c\nexperiments: [x.yaml]\n", "cannot read x.yaml: No such file or directory"),
    (DRAWN + "seeds: {integers: [9, 0]}\n", "seeds: the first end must be at most the second, got [9, 0]"),
    (DRAWN + "seeds: {integers: [0, 1.5]}\n", "seeds: integers[1] must be an integer"),
    (
        DRAWN + "seeds: {uniform: [0, 5]}\n",
        "seeds must be an integer, a list of integers or {integers: [first, last]}, ",
    ),
    (DRAWN + "seeds: [1, -1]\n", "seeds[1]: seed must be an integer between 0 and "),
    (DRAWN + "lights: {sun_elevation_deg: {uniform: [-9, 60]}}\n", "lights: light.sun_elevation_deg must be a number "),
    (DRAWN + "lights: {sun_elevation: 40}\n", "lights: unknown key 'light.sun_elevation'; did you mean "),
    (DRAWN + "lights: {sun_elevation_deg: {unifrom: [9, 60]}}\n", "lights: light.sun_elevation_deg must be a number "),
    (
        DRAWN + "lights: {sun_elevation_deg: {choice: [20, 30], weights: [1]}}\n",
        "lights: sun_elevation_deg.choice has 2 values, but weights has 1",
    ),
    (
        DRAWN + "rigs: {lidar: {rings: {choice: [32, 64], weights: [1, 0]}}}\n",
        "rigs: lidar.rings.weights[1] must be a number above 0, got 0",
    ),
    (DRAWN + "rigs: [{}, {lidar: {ringz: 3}}]\n", "rigs[1]: unknown key 'rig.lidar.ringz'; did you mean "),
    (
        DRAWN + "routes: park_3\n",
        "routes must be built-in, {random: {length_m: ...}}, {metres: ...}, {frames: {count: ...}}, or a list "
        "of these, got 'park_3'",
    ),
    (DRAWN + "routes: {metres: {start: [0, 0]}}\n", "routes: route.metres.waypoints is required"),
    (DRAWN + "routes: {random: {length_m: 5}}\n", "routes: route.random.length_m must be a number between 20 and 5000"),
    (DRAWN + "layouts: {park: {old_tres: 3}}\n", "layouts.park: layout: unknown key 'old_tres'; did you mean "),
    (DRAWN + "layouts: {lake: {}}\n", "layouts.lake: 'lake' is not one of the environments"),
    (DRAWN + "split: {train: 0.8, val: 0.1}\n", "split: train, val and test must add up to 1, got 0.9"),
    (DRAWN + "split: {train: 1.1, val: -0.1}\n", "split.train must be a number between 0 and 1, got 1.1"),
    (DRAWN + "split: {train: 0.5, dev: 0.5}\n", "unknown key 'split.dev'; Available: train, val, test"),
    (DRAWN + "split: {train: 0.5, val: 0.5}\n", "split: val would be empty, because the runs have 1 world "),
    (DRAWN + "seconds: 3\nroutes: {frames: {count: 5}}\n", "seconds is for drives; of frames, frames.count says how "),
    (DRAWN + "switches: {camras: false}\n", "unknown switch 'camras'; did you mean 'cameras'? Available: "),
    (DRAWN + "extras: [depht]\n", "unknown extra 'depht'; did you mean 'depth'? Available: depth, instances"),
    (
        "name: c\nruns: product\nenvironments: {choice: [park, lake], weights: [1, 2]}\n",
        "environments: weights have no meaning with runs: product, where every entry counts once",
    ),
    (
        "name: c\nruns: product\nenvironments: park\nseeds: {integers: [0, 1000000000000]}\n",
        "runs: product gives more than 100000 runs; give fewer entries",
    ),
    (DRAWN + "runs: 4\n", "invalid YAML at line 4, column 1: duplicate key 'runs'"),
    (DRAWN + "fieldtruth: 99.0.0\n", "written by fieldtruth 99.0.0, but version "),
]


@pytest.mark.parametrize(("text", "line"), MISTAKES, ids=[line[:50] for _, line in MISTAKES])
def test_a_mistake_is_one_line_and_nothing_is_written(
    text: str, line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "campaign.yaml"
    path.write_text(text)
    assert cli.main(["generate", "campaign.yaml"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert line in err
    assert err.startswith("error: " if line.startswith("cannot read x.yaml") else "error: campaign.yaml: ")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == [path]


def test_a_misspelt_switch_of_an_added_kind_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(KINDS, "sonar", type("SonarConfig", (), {"switch": "sonar"}))
    (tmp_path / "campaign.yaml").write_text(DRAWN + "sonr: false\n")
    with pytest.raises(ConfigurationError, match="unknown key 'sonr'; did you mean 'sonar'"):
        load_campaign("campaign.yaml")


OPTIONS = [
    (["generate", "park_1", "--jobs", "2"], "--jobs is for campaigns; park_1 is one experiment"),
    (["generate", "park_1", "--shard", "1/2"], "--shard is for campaigns; park_1 is one experiment"),
    (["generate", "all", "--jobs", "0"], "--jobs must be an integer of at least 1, got '0'"),
    (["generate", "all", "--shard", "0/4"], "a shard must be I/N with I from 1 to N, got '0/4'; as a SLURM array: "),
    (["generate", "all", "--shard", "5/4"], "a shard must be I/N with I from 1 to N, got '5/4'; as a SLURM array: "),
    (["generate", "all", "--shard", "3"], "a shard must be I/N, part I of N, such as 3/10, got '3'"),
    (["generate", "all", "--seconds", "0"], "all: seconds must be a number between 0.001 and 86400, got 0.0"),
    (
        ["generate", "all", "--extras", "dept"],
        "all: unknown extra 'dept'; did you mean 'depth'? Available: depth, instances",
    ),
    (["status", "data"], "cannot read data/campaign.yaml: No such file or directory"),
    (["status", "data", "--format", "slurm"], "unknown format without --missing 'slurm'; Available: text, json"),
    (["status", "data", "--missing", "--format", "x"], "unknown format 'x'; Available: text, json, lines, slurm"),
]


@pytest.mark.parametrize(("argv", "line"), OPTIONS, ids=[" ".join(argv) for argv, _ in OPTIONS])
def test_a_wrong_option_is_one_line(
    argv: list[str], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(argv) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith(f"error: {line}")
    assert not any(tmp_path.iterdir())


def test_a_campaign_is_recognised_by_its_keys() -> None:
    texts = {"a.yaml": DRAWN, "b.yaml": "experiments: [park_1]", "c.yaml": "name: c\nenvironment: park"}
    for name, text in texts.items():
        Path(name).write_text(text)
    assert [name for name in ("all", *texts, "park_1", "no.yaml") if is_campaign(name)] == ["all", "a.yaml", "b.yaml"]


def test_mounts_of_a_urdf_beside_the_file_are_in_the_campaign(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(
        '<robot name="r"><link name="base_link"/><link name="mast"/><joint name="j" type="fixed">'
        '<parent link="base_link"/><child link="mast"/><origin xyz="0 0.1 1.25"/></joint></robot>'
    )
    text = """\
name: masts
environments: [park]
routes: {random: {length_m: 30}}
runs: 1
rigs:
  - {urdf: robot.urdf, sensors: [{kind: lidar, name: top, frame: mast, rate_hz: {uniform: [5, 10]}}]}
"""
    file = tmp_path / "masts.yaml"
    file.write_text(text)
    campaign = load_campaign(file)
    assert "urdf" not in dump_campaign(campaign)
    (stored := tmp_path / "stored" / "campaign.yaml").parent.mkdir()
    stored.write_text(dump_campaign(campaign))
    assert load_campaign(stored) == campaign
    [run] = draw(campaign)
    lidar = run.experiment.rig.lidar
    assert (lidar.name, lidar.mount.xyz) == ("top", (0.0, 0.1, 1.25))
    assert 5.0 <= lidar.rate_hz <= 10.0
    file.write_text(text.replace("frame: mast", "frame: mast_2"))
    with pytest.raises(ConfigurationError, match=r"^.*masts\.yaml: rigs: sensors\[0\]\.frame .*mast"):
        load_campaign(file)


def test_objects_of_layouts_lie_beside_the_file(tmp_path: Path) -> None:
    """Their paths are those that a run in any folder needs; numbers of their rules are drawn."""
    entry = "{file: rocks/a.glb, label: rock, scatter: {count: {integers: [2, 6]}}}"
    (tmp_path / "rocks").mkdir()
    (tmp_path / "rocks" / "a.glb").write_bytes(b"")
    seeds, layouts = "seeds: {integers: [0, 99]}", f"layouts: {{park: {{objects: [{entry}]}}}}"
    (tmp_path / "c.yaml").write_text(f"{DRAWN.replace('4', '8')}{seeds}\n{layouts}\n")
    objects = [run.experiment.layout["objects"][0] for run in draw(load_campaign(tmp_path / "c.yaml"))]
    assert {each["file"] for each in objects} == {str(tmp_path / "rocks" / "a.glb")}
    assert {each["scatter"]["count"] for each in objects} <= set(range(2, 7))
    assert len({each["scatter"]["count"] for each in objects}) > 1

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""``fieldtruth rig``: what it prints and writes, and one line for each mistake."""

from pathlib import Path

import numpy as np
import png
import pytest
import yaml

from fieldtruth import cli, load_experiment
from fieldtruth.report.rig import FORMATS, sensor_table

SENSOR = "[{kind: camera, name: view, frame: view}]"


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_without_options_it_prints_tree_and_sensors(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["rig", "park_1"]) == 0
    rig = load_experiment("park_1").rig
    assert capsys.readouterr().out == f"{FORMATS['tree'].text(rig)}\n{sensor_table(rig)}"


@pytest.mark.parametrize(("to", "name"), [("tree", "rig.txt"), ("urdf", "rig.urdf"), ("camchain", "rig.yaml")])
def test_formats_are_printed_or_written(to: str, name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    text = FORMATS[to].text(load_experiment("park_1").rig)
    assert cli.main(["rig", "park_1", "--to", to]) == 0
    assert capsys.readouterr().out == text
    assert cli.main(["rig", "park_1", "--to", to, "--out", name]) == 0
    assert (tmp_path / name).read_text("utf-8") == text
    assert capsys.readouterr().out == f"{name}: {len(text.splitlines())} lines\n"
    (tmp_path / name).write_text("mine", "utf-8")
    assert cli.main(["rig", "park_1", "--to", to, "--out", name]) == 2
    assert capsys.readouterr().err.startswith(f"error: {name} already exists; ")
    assert (tmp_path / name).read_text("utf-8") == "mine"
    assert cli.main(["rig", "park_1", "--to", to, "--out", name, "--overwrite"]) == 0
    assert (tmp_path / name).read_text("utf-8") == text


def test_the_preview_is_a_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert cli.main(["rig", "park_1", "--preview"]) == 0
    width, height, rows, _ = png.Reader(str(tmp_path / "park_1_rig.png")).asRGB8()
    assert (width, np.array(list(rows)).shape) == (2400, (height, 3 * width))
    assert capsys.readouterr().out.startswith(f"park_1_rig.png: 2400 x {height} pixels, ")
    assert cli.main(["rig", "park_1", "--preview"]) == 2
    assert capsys.readouterr().err.startswith("error: park_1_rig.png already exists; ")


ERRORS = [
    (["rig"], "the following arguments are required: EXPERIMENT"),
    (["rig", "park1"], "unknown experiment 'park1'; did you mean 'park_1'? Available: "),
    (
        ["rig", "park_1", "--to", "urfd"],
        "unknown format 'urfd'; did you mean 'urdf'? Available: tree, urdf, camchain, imu",
    ),
    (["rig", "park_1", "--to", "urdf", "--preview"], "give either --to or --preview"),
    (["rig", "park_1", "--to", "urdf", "--out", "a.yaml"], "cannot write a.yaml: its name must end in .urdf or .xml"),
    (["rig", "park_1", "--out", "no/a.txt"], "cannot write no/a.txt: the folder no does not exist"),
    (["rig", "park_1", "--preview", "--out", "a.svg"], "cannot write a.svg: its name must end in .png, .jpg or .jpeg"),
    (["rig", "no.yaml"], "cannot read no.yaml: No such file or directory"),
    (["rig", "park_1", "--prevew"], "unknown option '--prevew'; did you mean '--preview'? Available: "),
]


@pytest.mark.parametrize(("argv", "line"), ERRORS, ids=[" ".join(argv) for argv, _ in ERRORS])
def test_a_mistake_is_one_line_and_nothing_is_written(
    argv: list[str], line: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert cli.main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"error: {line}")
    assert err.count("\n") == 1
    assert not any(tmp_path.iterdir())


def test_a_mistake_in_the_urdf_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "robot.xacro").write_text('<robot><xacro:if value="1"/></robot>', "utf-8")
    text = f"name: own\nenvironment: park\nframes: {{count: 1}}\nrig: {{urdf: robot.xacro, sensors: {SENSOR}}}\n"
    (tmp_path / "own.yaml").write_text(text, "utf-8")
    assert cli.main(["rig", "own.yaml"]) == 2
    expected = "error: own.yaml: rig.urdf robot.xacro needs xacro first; run: xacro robot.xacro > robot.urdf\n"
    assert capsys.readouterr().err == expected


def test_the_urdf_that_it_writes_can_be_named_in_an_experiment(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert cli.main(["rig", "park_1", "--to", "urdf", "--out", "robot.urdf"]) == 0
    sensors = [{"kind": "camera", "name": "view", "frame": "GNSS_link"}]
    values = {"name": "own", "environment": "park", "frames": {"count": 1}}
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(values | {"rig": {"urdf": "robot.urdf", "sensors": sensors}}))
    capsys.readouterr()
    assert cli.main(["rig", "own.yaml", "--to", "tree"]) == 0
    [line] = [line for line in capsys.readouterr().out.splitlines() if line.split()[0] == "GNSS_link"]
    assert line.split() == ["GNSS_link", "0.1", "0", "0.89", "0", "0", "0", "camera", "view"]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""``fieldtruth gazebo --experiment``: rig, layout and seed of an experiment. The files of the world are not written."""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from test_many_sensors_in_gazebo import RIG
from test_ros_package import inclined_park

import fieldtruth.gazebo.worlds
import fieldtruth.world.build
from fieldtruth import cli
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.experiment.rig import Rig


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple[Any, ...]]:
    """Worlds that the command asks for; it gets a plane."""
    asked: list[tuple[Any, ...]] = []

    def load_world(*given: Any) -> Any:
        asked.append(given)
        return inclined_park()

    monkeypatch.setattr(fieldtruth.world.build, "load_world", load_world)
    monkeypatch.setattr(fieldtruth.gazebo.worlds, "write_worlds", lambda *given, **named: None)
    monkeypatch.chdir(tmp_path)
    return asked


def gazebo(*arguments: str) -> int:
    return cli.main(["gazebo", *arguments, "--flavour", "gz", "--no-beyond", "--out", "out"])


def write(rig: Rig = RIG) -> None:
    changes = {"rig": rig, "seed": 7, "layout": {"large_trees": 5}}
    Path("mine.yaml").write_text(dump_experiment(load_experiment("park_1").model_copy(update=changes)))


def test_the_experiment_gives_rig_layout_and_seed(built: list[tuple[Any, ...]]) -> None:
    write()
    assert gazebo("park", "--experiment", "mine.yaml") == 0
    assert built == [("park", 7, {"grid": 0.2, "large_trees": 5})]
    sensors = {s.get("name") for s in ET.parse("out/models/husky/model.sdf").getroot().iter("sensor")}
    assert {"top_link", "low_link", "imu_rear", "antenna_right", "rear_camera"} <= sensors


def test_arguments_replace_layout_and_seed(built: list[tuple[Any, ...]]) -> None:
    write()
    Path("layout.yaml").write_text("large_trees: 6\n")
    assert gazebo("park", "--experiment", "mine.yaml", "--seed", "0", "--layout", "layout.yaml") == 0
    assert built == [("park", 0, {"grid": 0.2, "large_trees": 6})]


def test_without_an_experiment_it_is_the_paper_s_rig(built: list[tuple[Any, ...]]) -> None:
    assert gazebo("park") == 0
    assert built == [("park", 0, {"grid": 0.2})]
    sensors = {s.get("name") for s in ET.parse("out/models/husky/model.sdf").getroot().iter("sensor")}
    assert {"os1_lidar", "imu", "gnss", "left_camera", "right_camera"} <= sensors


def test_mistakes_are_one_line_before_any_work(
    built: list[tuple[Any, ...]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert gazebo("lake", "--experiment", "park_1") == 2
    expected = "ENVIRONMENT must be 'park', the environment of park_1, got 'lake'"
    assert capsys.readouterr().err == f"error: {expected}\n"
    fisheye = {"kind": "stereo", "lens": {"model": "equidistant", "coefficients": [0.0] * 4}}
    write(Rig.model_validate({"sensors": [fisheye]}))
    assert gazebo("park", "--experiment", "mine.yaml") == 2
    line = "rig.sensors: stereo has the lens equidistant; a Gazebo package has plain pinhole cameras only; "
    assert capsys.readouterr().err == f"error: {line}give enabled: false\n"
    assert built == []
    assert not Path("out").exists()

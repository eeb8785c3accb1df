# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Noise for a finished run: the bytes of a run that was generated with it, and what cannot be degraded."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from kept_worlds import Kept
from small_park import in_small_park

from fieldtruth.bag.file import BagError
from fieldtruth.bag.provenance import makers_of, sha256_of, this_process
from fieldtruth.cli import main
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.degradation import degrade
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import with_overrides
from fieldtruth.pipeline import generate
from fieldtruth.sense.scene import Scene

pytestmark = pytest.mark.usefixtures("in_park")
NOISE: dict[str, Any] = {"lidar": {"range_noise": [[12.0, 0.02]]}, "imu": "datasheet", "gnss": "datasheet"}
OF_MOTION: dict[str, Any] = {"imu": "datasheet", "gnss": "datasheet"}


def short() -> Experiment:
    cameras = {"width": 64, "height": 48, "depth": True}
    rig = {"cameras": cameras, "lidar": {"columns": 64, "rings": 16, "spinning": True}}
    return in_small_park(name="park_1", seconds=0.6, rig=rig)


@pytest.fixture
def scene(kept: Kept) -> Scene:
    return kept.scene(kept.world_of(short()))


@pytest.fixture(scope="module")
def ideal(in_park: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return generate(short(), tmp_path_factory.mktemp("ideal")).parent


@pytest.mark.parametrize(
    "signal",
    [NOISE | {"stereo": {"read_noise_e": 4.0, "full_well_e": 10000.0}}, OF_MOTION],
    ids=["lidar, cameras, imu, gnss", "imu, gnss"],
)
def test_the_bytes_are_those_of_a_run_with_noise(signal: dict[str, Any], ideal: Path, tmp_path: Path) -> None:
    """A spinning LiDAR needs poses after the last stamp, which no bag has."""
    whole = generate(with_overrides(short(), signal=signal), tmp_path / "noisy")
    before = sha256_of(ideal / "park_1.bag")
    made = degrade(ideal, tmp_path / "degraded", signal=signal, workers=2)
    assert sha256_of(made) == sha256_of(whole) != before
    for name in ("experiment.yaml", "DATASET.md"):
        assert (made.parent / name).read_bytes() == (whole.parent / name).read_bytes()
    assert sha256_of(ideal / "park_1.bag") == before
    with pytest.raises(BagError, match="has signals of real sensors already: "):
        degrade(made, tmp_path / "twice")


@pytest.mark.parametrize("signal", [{"lidar": {"range_noise": [[12.0, 0.02]]}}, OF_MOTION], ids=["lidar", "imu, gnss"])
def test_the_bytes_among_actors_are_those_of_a_run_with_noise(signal: dict[str, Any], tmp_path: Path) -> None:
    rig = {
        "sensors": [{"kind": "imu"}, {"kind": "gnss"}, {"kind": "lidar", "columns": 64, "rings": 16, "spinning": True}]
    }
    made = in_small_park(name="park_1", seconds=0.3, rig=rig, actors={"anna": {"kind": "person"}})
    whole = generate(with_overrides(made, signal=signal), tmp_path / "noisy")
    ideal = generate(made, tmp_path / "ideal")
    assert sha256_of(degrade(ideal, tmp_path / "degraded", signal=signal)) == sha256_of(whole) != sha256_of(ideal)


@pytest.mark.slow
def test_the_bytes_among_plants_that_yield_are_those_of_a_run_with_noise(tmp_path: Path) -> None:
    """In a bed of grass of the small park."""
    lidar = {"kind": "lidar", "columns": 256, "rings": 32, "spinning": True}
    rig = {"sensors": [{"kind": "imu"}, {"kind": "gnss"}, lidar]}
    route = {"metres": {"start": (-6.2, 9.2), "waypoints": [(-4.0, 9.2)]}}
    made = in_small_park(name="park_1", seconds=0.4, rig=rig, plants={"yielding": True}, route=route)
    signal = {"lidar": {"range_noise": [[12.0, 0.02]]}}
    whole = generate(with_overrides(made, signal=signal), tmp_path / "noisy")
    ideal = generate(made, tmp_path / "ideal")
    assert sha256_of(degrade(ideal, tmp_path / "degraded", signal=signal)) == sha256_of(whole) != sha256_of(ideal)


def test_cameras_that_stay_ideal_are_not_rendered_again(
    ideal: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled = list[Experiment]()
    monkeypatch.setattr("fieldtruth.simulation.stepped.compile_beside", compiled.append)
    monkeypatch.setattr("fieldtruth.sensors.kind.bake", lambda *_: pytest.fail("the light was baked"))
    degrade(ideal, tmp_path, signal={"lidar": {"range_noise": [[12.0, 0.02]]}})
    assert [[each.name for each in experiment.rig.in_order()] for experiment in compiled] == [["lidar"]]


def test_sensors_of_motion_take_it_from_the_bag(
    ideal: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene: Scene
) -> None:
    monkeypatch.setattr("fieldtruth.degradation.prepare", lambda *_: pytest.fail("the robot drives again"))
    degrade(ideal, tmp_path, signal=OF_MOTION, scene=scene)


def test_what_made_the_readings_that_stay_is_named(ideal: Path, tmp_path: Path, scene: Scene) -> None:
    """Images of another processor stay in the degraded bag; if the robot drives otherwise here, that is the reason."""
    shutil.copytree(ideal, tmp_path / "park_1")
    other = this_process() | {"packet width": "1"}
    (tmp_path / "park_1" / "made_by.json").write_text(json.dumps([other]))
    made = degrade(tmp_path / "park_1", tmp_path / "mixed", signal={"imu": "datasheet"}).parent
    assert sorted(makers_of(made), key=str) == sorted([other, this_process()], key=str)
    same = degrade(ideal, tmp_path / "same", signal={"imu": "datasheet"}, scene=scene).parent
    assert makers_of(same) == [this_process()]


def test_a_run_that_would_be_recorded_otherwise_is_refused(ideal: Path, tmp_path: Path) -> None:
    copy = tmp_path / "park_1"
    shutil.copytree(ideal, copy)
    text = (copy / "experiment.yaml").read_text()
    assert "speed: 0.3\n" in text
    (copy / "experiment.yaml").write_text(text.replace("speed: 0.3\n", "speed: 0.4\n"))
    line = r"differs in /ground_truth/odom from what fieldtruth records here \(its experiment or version was another\)"
    for name, signal in (("all", NOISE), ("motion", OF_MOTION)):
        with pytest.raises(BagError, match=line):
            degrade(copy, tmp_path / name, signal=signal)
    (copy / "made_by.json").unlink()
    with pytest.raises(BagError, match=r"records here \(no made_by\.json says what made it\); generate it again"):
        degrade(copy, tmp_path / "out", signal=NOISE)


def test_mistakes_are_one_line(ideal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    alone = tmp_path / "alone.bag"
    shutil.copy(ideal / "park_1.bag", alone)
    out, file = str(tmp_path / "out"), tmp_path / "signals.yaml"
    file.write_text("lidr: datasheet\n")
    for arguments, line in (
        ([str(alone)], "has no experiment.yaml beside it"),
        ([str(tmp_path / "gone")], "gone does not exist"),
        (
            [str(ideal), "--signal", "loud"],
            "signal must be ideal, datasheet, clean, robot or the path of a YAML file, got 'loud'",
        ),
        ([str(ideal), "--signal", "ideal"], "signal must change a sensor of the run"),
        ([str(ideal), "--signal", str(file)], "signal: 'lidr' must be a sensor of the rig or its kind: imu, gnss, "),
    ):
        assert main(["degrade", *arguments, "--out", out]) == 2
        error = capsys.readouterr().err
        assert line in error
        assert error.count("\n") == 1
    assert not Path(out).exists()
    with pytest.raises(ConfigurationError, match="signal must change a sensor"):
        degrade(ideal, out, signal={})

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A kind of another package that gives clouds is exported and read as a LiDAR is, under its own noun."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from test_texts_of_rigs import texts_of

import fieldtruth as ft
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.core.readings import Cloud
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import KINDS, MountedConfig, Output
from fieldtruth.exporters import export


@pytest.fixture(scope="module")
def radar_run(faked_many_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The run with many sensors, as if its first LiDAR were a radar, and it had no other."""

    class RadarConfig(MountedConfig):
        noun: ClassVar[str] = "radar"
        gives: ClassVar[type[Cloud]] = Cloud
        kind: str = "radar"

        def outputs(self) -> tuple[Output, ...]:
            return (self.output(self.new_topic(self.topic, "sensor_msgs/msg/PointCloud2"), reading=Cloud),)

    experiment = ft.load_experiment(faked_many_run / "experiment.yaml")
    (top,) = (sensor for sensor in experiment.rig.sensors if sensor.name == "top")
    keys = ("name", "rate_hz", "topic", "frame", "mount")
    radar = RadarConfig.model_validate({key: getattr(top, key) for key in keys} | {"kind": "radar"})
    kept = [sensor for sensor in experiment.rig.sensors if sensor.name not in ("top", "low")]
    folder = tmp_path_factory.mktemp("radar") / "many"
    folder.mkdir()
    shutil.copy(faked_many_run / "many.bag", folder)
    rig = Rig.model_validate({"robot": experiment.rig.robot, "sensors": [radar, *kept]})
    (folder / "experiment.yaml").write_text(dump_experiment(experiment.model_copy(update={"rig": rig})))
    yield folder
    del KINDS["radar"]


@pytest.mark.parametrize("to", ["files", "kitti", "semantickitti", "pcd", "webdataset", "huggingface"])
def test_its_clouds_are_those_of_a_lidar(to: str, radar_run: Path, faked_many_run: Path, tmp_path: Path) -> None:
    own, other = (export(run, to, out=tmp_path / name) for name, run in (("a", radar_run), ("b", faked_many_run)))
    clouds = {"files": "top/*.csv", "pcd": "top/*.pcd"}.get(to, "sequences/00/velodyne/*.bin")
    for found in own.glob(clouds):
        assert found.read_bytes() == (other / found.relative_to(own)).read_bytes()
    assert list(own.glob({"webdataset": "clouds_top-train-*.tar", "huggingface": "clouds/*.parquet"}.get(to, clouds)))
    text = texts_of(own)
    if to == "huggingface":  # the limits of fieldtruth, which are those of any run, name its own kinds
        text = text.partition("## Known limits")[0]
    assert "LiDAR" not in text
    assert ("radar" in text) is (to != "webdataset")


def test_samples_have_its_clouds(radar_run: Path, faked_many_run: Path) -> None:
    own, other = (ft.RunDataset(run, ("cloud", "labels", "pose"), lidar="top") for run in (radar_run, faked_many_run))
    assert len(own) == len(other) == 6
    for sample, same in zip(own, other, strict=True):
        for key in ("cloud", "labels", "world_from_lidar"):
            np.testing.assert_array_equal(sample[key], same[key])


def test_programs_of_lidar_odometry_do_not_read_it(radar_run: Path, tmp_path: Path) -> None:
    with pytest.warns(FieldtruthWarning, match="KISS-ICP: no LiDAR"):
        folder = export(radar_run, "slam-configs", out=tmp_path / "slam")
    assert "not used: top" in (folder / "README.txt").read_text()
    assert not (folder / "kiss_icp.yaml").exists()

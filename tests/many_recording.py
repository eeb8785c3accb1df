# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A short run of a rig with many sensors: driven on flat ground, with fake LiDARs and cameras, in three seconds."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

from drive_worlds import make_experiment, make_world
from many_sensors import many_rig
from numpy.typing import NDArray
from record_fakes import FakeCamera, FakeEngine, FakeImages, FakeLidar, FakeScan

from fieldtruth.drive.plan import plan_and_drive
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.pipeline import generate_by

SECONDS = 0.6


class _Lidar(FakeLidar):
    """Its instances are rows of /gazebo/model_states, which has robot and ground only; times are within a turn."""

    def scan(self, world_from_lidar: NDArray[Any], stamp_ns: int = 0, number: int = 0) -> FakeScan:
        scan = super().scan(world_from_lidar.reshape(-1, 4, 4)[0])  # the first of those of a spinning LiDAR
        return replace(scan, instance=scan.instance // 600 % 2, t_ns=scan.t_ns // 10**5)


class _Camera(FakeCamera):
    """Its instances are rows of /gazebo/model_states."""

    def render(self, world_from_optical: NDArray[Any], robot: object = None, stamp_ns: int = 0) -> FakeImages:
        images = super().render(world_from_optical)
        return replace(images, instance=images.instance // 300 % 2)


def record_many(folder: Path, rig: Rig | None = None) -> Path:
    """Record a run in ``folder``, and return its folder; images and clouds depend on the poses of their sensors."""
    world = replace(make_world(), object_names=("husky", "ground"))
    engine = FakeEngine(lambda _: world, plan_and_drive, _Lidar, _Camera)
    rig = rig or many_rig()
    experiment = make_experiment([(5.0, 2.0)], name="many", environment="park", seconds=SECONDS, rig=rig)
    return generate_by(engine, experiment, folder).parent


def with_sensors(run: Path, folder: Path, *names: str) -> Path:
    """Copy a run, as if its rig had only these sensors, in this order; return the new folder."""
    folder.mkdir(parents=True)
    shutil.copy(run / "many.bag", folder)
    experiment = load_experiment(run / "experiment.yaml")
    of_name = {sensor.name: sensor for sensor in experiment.rig.sensors}
    rig = experiment.rig.model_copy(update={"sensors": tuple(of_name[name] for name in names)})
    (folder / "experiment.yaml").write_text(dump_experiment(experiment.model_copy(update={"rig": rig})))
    return folder

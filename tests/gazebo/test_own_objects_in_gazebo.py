# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Objects from a user's files in real Gazebo: its beams meet them where ours do, with their classes."""

from pathlib import Path

import numpy as np
import pytest
from comparison import Beams, compare_scan
from gazebo_run import missing_chroot, run_gazebo
from object_files import bales, barrel, entry, gate, plain
from rig_models import add_rig, beams, tour

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.gazebo import write_gazebo
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig

pytestmark = [pytest.mark.gazebo, pytest.mark.skipif(bool(missing_chroot()), reason=missing_chroot() or "-")]

RIG = paper_rig(lidar=LidarConfig(columns=512, rings=32, min_range=0.3, max_range=60.0))
POSES = [transforms.pose((0.0, 0.0, 0.13), (0, 0, 20)), transforms.pose((8.0, -4.0, 0.13), (0, 0, 130))]


def test_beams_meet_own_objects_where_ours_do(tmp_path: Path) -> None:
    """A barrel, a wall of bales, a gate, and bales without a collider."""
    world = plain(
        [
            entry(barrel(tmp_path / "barrel.glb"), pose=[4, 1.5, 40]),
            entry(bales(tmp_path / "bales.stl"), pose=[3, -4, 75], label="building"),
            entry(gate(tmp_path / "gate.ply"), pose=[-4, 2, 10], label="fence", collider="mesh"),
            entry(bales(tmp_path / "ghost.obj"), pose=[-6, -5, 0], label="rock", collider="none"),
        ]
    )
    folder = write_gazebo(world, tmp_path / "package")
    rigged = add_rig(folder / "worlds/plain.world", folder / "worlds/rigged.world", RIG, lidar=True)
    run = run_gazebo(rigged, tmp_path / "run", readings=len(POSES), tour=tour(POSES), limit_s=600)
    assert not run.complaints
    seen = set[int]()
    for pose, reading in zip(POSES, run.at_stops("rig__link__lidar"), strict=True):
        scan = Beams.of_gazebo(*(beams(part, RIG.lidar) for part in reading.values))
        compared = compare_scan(Scene(world), RIG.lidar, pose @ RIG.lidar.mount.base_from_sensor, scan)
        unexplained = int((compared.differ & ~compared.grazing).sum())
        print(f"\n{compared.differ.mean():.3%} of the beams differ, {unexplained} unexplained")
        assert compared.differ.mean() < 0.005
        assert unexplained == 0
        seen |= {int(k) for k in np.unique(scan.label)}
    assert {Label.TRASH_BIN, Label.BUILDING, Label.FENCE, Label.ROCK} <= seen

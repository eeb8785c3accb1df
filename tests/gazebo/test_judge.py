# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Gazebo 11 judges our geometry: in the exported worlds its LiDAR, camera, IMU and GNSS measure what ours do.

``pytest -m gazebo -n 0 -s tests/gazebo/test_judge.py`` prints the figures, a line per environment and sensor.
"""

import shutil
from pathlib import Path
from typing import Final

import numpy as np
import pytest
from comparison import Beams, ImageComparison, ScanComparison, compare_image, compare_scan
from gazebo_packages import ENVIRONMENTS, Package, package
from gazebo_run import WORK, GazeboRun, missing_chroot, run_gazebo
from rig_models import add_rig, beams, tour

from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.drive.plan import expected_path, experiments_in, pose_on_ground
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.sense.scene import Scene

pytestmark = [pytest.mark.gazebo, pytest.mark.skipif(bool(missing_chroot()), reason=missing_chroot() or "-")]

RIG: Final = Rig()
SHARES: Final = (0.1, 0.5, 0.9)
"""Of the first experiment's path, where scans and images are made."""
LIMIT_S: Final = 900.0
"""A guard against a hang, far above what a busy machine takes."""


class Judged:
    """An environment, poses of the robot on its route, and what Gazebo measures there."""

    def __init__(self, environment: str, folder: Path) -> None:
        self.package: Package = package(environment)
        world = self.package.world
        self.scene = Scene(world)
        path = expected_path(experiments_in(environment)[0], world)
        rows = path[[int(share * (len(path) - 1)) for share in SHARES]]
        self.poses = [pose_on_ground(world.terrain.field, row, RIG) for row in rows]
        self.run = self._run(folder / "textured", plain=False)
        self.plain = self._run(folder / "plain", plain=True)

    def _run(self, folder: Path, *, plain: bool) -> GazeboRun:
        """Scans in the world itself, images of its plain twin."""
        world = self.package.world_file(plain=plain)
        rigged = add_rig(world, world.with_name(f"rigged_{world.name}"), RIG, lidar=not plain, camera=plain)
        return run_gazebo(rigged, folder, readings=2 + plain, tour=tour(self.poses), limit_s=LIMIT_S)

    def scans(self) -> list[ScanComparison]:
        mount, found = RIG.lidar.mount.base_from_sensor, self.run.at_stops("rig__link__lidar")
        return [
            compare_scan(
                self.scene,
                RIG.lidar,
                pose @ mount,
                Beams.of_gazebo(*(beams(part, RIG.lidar) for part in reading.values)),
            )
            for pose, reading in zip(self.poses, found, strict=True)
        ]

    def images(self) -> list[ImageComparison]:
        mount, found = RIG.stereo.left.base_from_sensor, self.plain.at_stops("rig__link__left")
        return [
            compare_image(self.scene, RIG.stereo, pose @ mount, reading.values)
            for pose, reading in zip(self.poses, found, strict=True)
        ]


@pytest.fixture(scope="module", params=ENVIRONMENTS)
def judged(request: pytest.FixtureRequest) -> Judged:
    folder = WORK / "judge" / str(request.param)
    shutil.rmtree(folder, ignore_errors=True)
    return Judged(request.param, folder)


def report(judged: Judged, text: str) -> None:
    print(f"\n{judged.package.world.name}, {text}", end="")


def test_the_world_and_its_plain_twin_load_without_an_error_line(judged: Judged) -> None:
    for what, run in (("world", judged.run), ("plain twin", judged.plain)):
        report(judged, f"{what}: loads in {run.load_s:.0f} s, {run.memory_mb} MB")
        assert not run.complaints


def test_every_beam_that_grazes_no_edge_has_our_range_and_class(judged: Judged) -> None:
    scans = judged.scans()
    differ, grazing = (np.stack([getattr(scan, name) for scan in scans]) for name in ("differ", "grazing"))
    returned = np.stack([np.isfinite(scan.ours.range_m) for scan in scans])
    error = np.abs(np.stack([scan.gazebo.errors(scan.ours) for scan in scans]))[returned & ~differ]
    report(
        judged,
        f"LiDAR: {differ.sum()} of {differ.size} beams ({differ.mean():.4%}) differ, {(differ & ~grazing).sum()}"
        f" of these graze no edge; other ranges differ by "
        f"{np.median(error):.0e} m (median), {error.max():.0e} m (most)",
    )
    assert returned.mean() > 0.2
    assert differ.mean() < 0.005
    assert not (differ & ~grazing).any()


def test_plain_images_are_our_tag_images_except_at_silhouettes(judged: Judged) -> None:
    images = judged.images()
    differ, near = (np.stack([getattr(image, name) for image in images]) for name in ("differ", "near_silhouette"))
    report(
        judged,
        f"camera: {differ.sum()} of {differ.size} pixels ({differ.mean():.4%}) differ, {(differ & ~near).sum()} of"
        f" these more than 2 pixels from a silhouette; {near.mean():.0%} of all are nearer",
    )
    assert differ.mean() < 0.02
    assert not (differ & ~near).any()


def test_imu_at_rest_and_fix_are_ours(judged: Judged) -> None:
    force: list[float] = []
    apart: list[Array] = []
    readings = (judged.run.at_stops(f"rig__link__{name}") for name in ("imu", "gnss"))
    for pose, imu, fix in zip(judged.poses, *readings, strict=True):
        expected = (pose @ RIG.imu.mount.base_from_sensor)[:3, :3].T @ [0.0, 0.0, GRAVITY]
        force.append(float(np.abs(imu.values[7:] - expected).max()))
        apart.append(np.abs(fix.values - geodetic_from_world((pose @ RIG.gnss.mount.base_from_sensor)[:3, 3])))
    latitude, longitude, height = np.max(apart, axis=0)
    degrees = max(latitude, longitude)
    report(
        judged, f"at rest: specific force differs by {max(force):.0e} m/s^2, fix by {degrees:.0e} deg, {height:.0e} m"
    )
    assert max(force) < 1e-6
    assert degrees < 1e-8
    assert height < 0.01

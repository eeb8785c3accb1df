# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's loop: a drive in Gazebo 11 along our route, steered by our node, recorded by ROS 1, annotated here.

``pytest -m gazebo -n 0 -s tests/gazebo/test_drives.py`` prints the figures of each environment.
"""

from pathlib import Path
from typing import Final

import numpy as np
import pytest
from comparison import Beams, compare_scan
from drive_figures import Drive, attitude_difference, cross_track, drive_of_bag, drive_of_track, table
from gazebo_packages import ENVIRONMENTS, package
from ros_drive import add_robot, drive_with_ros, missing_ros

from fieldtruth.annotation import WorldConfig, annotate
from fieldtruth.bag.decode import points, read_bag, stamp_ns
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.drive.plan import experiments_in
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.files import with_overrides
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig

pytestmark = [pytest.mark.gazebo, pytest.mark.skipif(bool(missing_ros()), reason=missing_ros() or "-")]

METRES: Final = 10.0
LIMIT_S: Final = 900.0
"""A guard against a hang, far above what a busy machine takes."""
CLOUDS: Final = (10, 11, 12)
"""Stamps [s] of Gazebo's clouds: each takes it seconds."""
RIG: Final = paper_rig(lidar=LidarConfig(rate_hz=1.0), cameras=StereoConfig(rate_hz=1.0, width=320, height=184))


class Driven:
    """The beginning of the first experiment of an environment: our drive, and Gazebo's with its bag."""

    def __init__(self, environment: str, folder: Path) -> None:
        exported = package(environment)
        self.world, experiment = exported.world, experiments_in(environment)[0]
        config = exported.folder / "config" / f"{experiment.name}.yaml"
        world = exported.world_file()
        self.gazebo = drive_with_ros(
            add_robot(world, world.with_name(f"drive_{world.name}"), config),
            folder / "drive",
            config,
            metres=METRES,
            seconds=2.0 * METRES / experiment.control.speed,
            limit_s=LIMIT_S,
            clouds=f"{CLOUDS[0]}:{CLOUDS[-1]}:1",
        )
        track = drive(self.world, with_overrides(experiment, seconds=1.3 * METRES / experiment.control.speed))
        self.ours: Drive = drive_of_track(track).first(METRES)
        self.theirs: Drive = drive_of_bag(self.gazebo.bag).first(METRES)
        self.speed = experiment.control.speed


@pytest.fixture(scope="module", params=ENVIRONMENTS)
def driven(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Driven:
    return Driven(request.param, tmp_path_factory.mktemp(request.param))


def test_the_robot_drives_the_first_ten_metres_of_the_route(driven: Driven) -> None:
    across = cross_track(driven.theirs, driven.ours)
    print(
        f"\n{driven.world.name}: {driven.gazebo.metres:.2f} m in {driven.gazebo.seconds:.1f} s of simulated time; from"
        f" our path {np.abs(across).mean():.3f} m, at most {np.abs(across).max():.3f} m",
        end="",
    )
    assert driven.gazebo.metres >= METRES
    assert driven.gazebo.seconds < 1.15 * METRES / driven.speed
    assert np.abs(across).max() < 0.2


def test_the_robot_moves_over_the_same_ground_as_ours(driven: Driven) -> None:
    print("\n" + table(driven.world.name, driven.ours, driven.theirs, RIG.wheels))
    turned = np.sqrt((attitude_difference(driven.theirs, driven.ours) ** 2).mean(axis=0))
    assert turned.max() < 1.0
    slips = [float(np.nanmedian(each.slip(RIG.wheels))) for each in (driven.ours, driven.theirs)]
    assert np.abs(slips).max() < 0.05
    shaken = [float(np.sqrt((each.vertical_acceleration**2).mean())) for each in (driven.ours, driven.theirs)]
    # Gazebo's wheels are rigid and meet edges of triangles; ours are tyres.
    assert shaken[0] < 2.0 * shaken[1]
    assert shaken[1] < 0.5


def beams(bag: Path, topic: str) -> dict[int, Beams]:
    """Beams of each cloud by stamp [ns]; Gazebo's intensity is the class."""
    found = {}
    for reading in read_bag(bag, [topic]):
        cloud, shape = points(reading.message), (RIG.lidar.columns, RIG.lidar.rings)
        scan = Beams(np.full(shape, np.inf), np.zeros(shape))
        xyz = np.stack([cloud[axis].astype(np.float64) for axis in "xyz"], axis=1)
        scan.range_m[cloud["column"], cloud["ring"]] = np.linalg.norm(xyz, axis=1)
        scan.label[cloud["column"], cloud["ring"]] = cloud["intensity"]
        found[stamp_ns(reading.message.header)] = Beams.of_gazebo(*scan)
    return found


@pytest.mark.filterwarnings("ignore:the bag's own messages")
def test_annotated_clouds_are_gazebos_own_except_at_edges(driven: Driven, tmp_path: Path) -> None:
    world = WorldConfig(driven.world.name, layout=driven.world.layout)
    bag = annotate(driven.gazebo.bag, world, rig=RIG, out=tmp_path / "annotated.bag")
    ours, theirs = beams(bag, RIG.lidar.topic), beams(bag, f"/recorded{RIG.lidar.topic}")
    assert list(theirs) == [second * 10**9 for second in CLOUDS]
    scene, differ, grazing, error = Scene(driven.world), list[Mask](), list[Mask](), list[Array]()
    for stamp, scan in theirs.items():
        row = stamp // 10**6 - 1
        pose = driven.theirs.world_from_base(row) @ RIG.lidar.mount.base_from_sensor
        compared = compare_scan(scene, RIG.lidar, pose, scan)
        assert not compared.ours.differ(ours[stamp]).any()
        differ.append(compared.differ)
        grazing.append(compared.grazing)
        met = np.isfinite(scan.range_m) & ~compared.differ
        error.append(np.abs(scan.range_m[met] - ours[stamp].range_m[met]))
    share, unexplained = np.mean(differ), int(np.sum(np.array(differ) & ~np.array(grazing)))
    tags = sum(1 for imager in RIG.imagers for _ in read_bag(bag, [imager.topic_of("tag")]))
    print(
        f"\n{driven.world.name}: {len(ours)} clouds and {tags} tag images added; {share:.3%} of the beams at {CLOUDS} s"
        f" differ from Gazebo's, {unexplained} of them without grazing an edge; the others by {np.median(error[0]):.1e}"
        f" m, at most {max(each.max() for each in error):.1e} m",
        end="",
    )
    assert tags == 2 * len(ours) == 2 * int(driven.gazebo.seconds)
    assert share < 0.005
    assert unexplained == 0

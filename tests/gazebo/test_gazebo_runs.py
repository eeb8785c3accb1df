# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors in a world of two walls read what closed formulas say: the other tests of this folder depend on it."""

import math
from pathlib import Path
from typing import Final

import numpy as np
import pytest
from gazebo_run import GazeboError, GazeboRun, complaints, missing_chroot, run_gazebo
from rig_models import add_rig, beams, tour

from fieldtruth.core import transforms
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.sense.lens import intrinsics_of
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import ray_directions

needs_gazebo = pytest.mark.skipif(bool(missing_chroot()), reason=missing_chroot() or "-")

POSES: Final = [
    transforms.pose((3.0, -2.0, 1.0), (0.0, 0.0, 30.0)),
    transforms.pose((-4.0, 5.0, 2.0), (10.0, -15.0, 200.0)),
]
RIG: Final = paper_rig(lidar=LidarConfig(columns=72, rings=8, min_range=0.5, max_range=100.0))
WALLS: Final = {7: ((30.0, 0.0), (2.0, 60.0)), 12: ((0.0, 20.0), (100.0, 2.0))}
"""laser_retro of each wall: its centre and its sizes along x and y [m]."""
COLOURS: Final = {7: (255, 0, 0), 12: (0, 255, 0)}
TOP: Final = 3.0  # [m]


def box(retro: int, position: tuple[float, ...], size: tuple[float, ...]) -> str:
    """A static box whose middle is at height 0, of one colour whatever the light."""
    (x, y), (r, g, b) = position, COLOURS[retro]
    shape = f"<geometry><box><size>{size[0]} {size[1]} {2 * TOP}</size></box></geometry>"
    return (
        f"<model name='box_{retro}'><static>true</static><pose>{x} {y} 0 0 0 0</pose><link name='link'>"
        f"<collision name='c'><laser_retro>{retro}</laser_retro>{shape}</collision><visual name='v'>{shape}<material>"
        f"<ambient>0 0 0 1</ambient><diffuse>0 0 0 1</diffuse><emissive>{r / 255} {g / 255} {b / 255} 1</emissive>"
        "</material></visual></link></model>"
    )


def write_world(path: Path, models: str) -> Path:
    path.write_text(
        "<sdf version='1.6'><world name='walls'><gravity>0 0 -9.81</gravity><scene><shadows>false</shadows>"
        "<ambient>0 0 0 1</ambient><background>0 0 1 1</background></scene><spherical_coordinates>"
        "<surface_model>EARTH_WGS84</surface_model><latitude_deg>49.9</latitude_deg><longitude_deg>8.9</longitude_deg>"
        f"<elevation>0</elevation><heading_deg>90</heading_deg></spherical_coordinates>{models}</world></sdf>"
    )
    return path


@pytest.fixture(scope="module")
def walls(tmp_path_factory: pytest.TempPathFactory) -> GazeboRun:
    """A run among two walls, with two readings of each sensor at two poses."""
    folder = tmp_path_factory.mktemp("walls")
    world = write_world(folder / "walls.world", "".join(box(k, *where) for k, where in WALLS.items()))
    rigged = add_rig(world, folder / "rigged.world", RIG, lidar=True, camera=True)
    return run_gazebo(rigged, folder / "run", readings=2, tour=tour(POSES), limit_s=600)


@pytest.mark.gazebo
@needs_gazebo
@pytest.mark.parametrize("k", range(len(POSES)))
def test_scan_of_two_walls_follows_the_plane_equation(walls: GazeboRun, k: int) -> None:
    assert not walls.complaints
    range_m, retro = (beams(part, RIG.lidar) for part in walls.at_stops("rig__link__lidar")[k].values)
    world_from_lidar = POSES[k] @ RIG.lidar.mount.base_from_sensor
    directions = ray_directions(RIG.lidar) @ world_from_lidar[:3, :3].T
    origin = world_from_lidar[:3, 3]
    with np.errstate(divide="ignore"):
        to_first, to_second = (29.0 - origin[0]) / directions[..., 0], (19.0 - origin[1]) / directions[..., 1]
    to_first[(to_first < 0) | (np.abs(origin[1] + to_first * directions[..., 1]) > 30.0)] = np.inf
    to_second[(to_second < 0) | (np.abs(origin[0] + to_second * directions[..., 0]) > 50.0)] = np.inf
    expected = np.minimum(to_first, to_second)
    met = expected < RIG.lidar.max_range
    met[met] = np.abs(origin[2] + (expected * directions[..., 2])[met]) < TOP - 0.01
    assert met.sum() > 50
    np.testing.assert_allclose(range_m[met], expected[met], atol=1e-4)
    np.testing.assert_array_equal(retro[met], np.where(to_first < to_second, 7, 12)[met])


@pytest.mark.gazebo
@needs_gazebo
def test_imu_and_fix_at_known_poses(walls: GazeboRun) -> None:
    for pose, imu, fix in zip(POSES, walls.at_stops("rig__link__imu"), walls.at_stops("rig__link__gnss"), strict=True):
        world_from_imu = pose @ RIG.imu.mount.base_from_sensor
        np.testing.assert_allclose(imu.values[7:], world_from_imu[:3, :3].T @ [0.0, 0.0, 9.81], atol=1e-6)
        antenna = (pose @ RIG.gnss.mount.base_from_sensor)[:3, 3]
        np.testing.assert_allclose(fix.values, geodetic_from_world(antenna), atol=1e-6)


@pytest.mark.gazebo
@needs_gazebo
def test_image_shows_the_corner_of_two_walls_where_it_is(walls: GazeboRun) -> None:
    image = walls.at_stops("rig__link__left")[0].values
    lens, heading = intrinsics_of(RIG.stereo), math.radians(30.0)
    x, y, z = (POSES[0] @ RIG.stereo.left.base_from_sensor)[:3, 3]
    dx, dy = 29.0 - x, 19.0 - y
    ahead, aside = dx * math.cos(heading) + dy * math.sin(heading), dy * math.cos(heading) - dx * math.sin(heading)
    column, top, bottom = lens.cx - lens.fx * aside / ahead, lens.fy * (TOP - z) / ahead, lens.fy * (TOP + z) / ahead
    row = round(lens.cy)
    assert image[row, : math.floor(column)].tolist() == [list(COLOURS[12])] * math.floor(column)
    assert image[row, math.ceil(column) :].tolist() == [list(COLOURS[7])] * (RIG.stereo.width - math.ceil(column))
    walled = (image[:, round(column)] != (0, 0, 255)).any(axis=-1)
    assert abs(walled.argmax() - (lens.cy - top)) < 1.5
    assert abs(len(walled) - 1 - walled[::-1].argmax() - (lens.cy + bottom)) < 1.5


@pytest.mark.gazebo
@needs_gazebo
def test_gazebo_reports_a_missing_mesh_and_too_long_runs(tmp_path: Path) -> None:
    mesh = "<geometry><mesh><uri>file://missing.obj</uri></mesh></geometry>"
    model = f"<model name='m'><static>true</static><link name='l'><collision name='c'>{mesh}</collision></link></model>"
    run = run_gazebo(write_world(tmp_path / "a.world", model), tmp_path / "run", seconds=0.1, limit_s=60)
    assert any("missing.obj" in line for line in run.complaints)
    with pytest.raises(GazeboError, match="not finished in 5"):
        run_gazebo(write_world(tmp_path / "b.world", ""), tmp_path / "endless", limit_s=5.0)


def test_complaints_are_error_and_warning_lines_without_harmless_ones() -> None:
    log = (
        "\x1b[1;33m[Wrn] [Publisher.cc:136] \x1b[0mQueue limit reached for topic /gazebo/default/x\n"
        "ALSA lib confmisc.c:767:(parse_card) Error: cannot find card '0'\n"
        "[Msg] Publicized address: 127.0.0.1\n"
        "\x1b[1;31m[Err] [Mesh.cc:2] \x1b[0mfile not found\n[Err] [Mesh.cc:2] file not found\n"
    )
    assert complaints(log) == ("[Err] [Mesh.cc:2] file not found",)

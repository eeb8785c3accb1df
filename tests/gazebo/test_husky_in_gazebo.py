# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The exported Husky in real Gazebo 11 on flat ground: no error line, stands still, drives and turns as commanded."""

import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from gazebo_run import (
    CHROOT,
    GazeboRun,
    in_chroot,
    master_uri,
    missing_chroot,
    results,
    run_gazebo,
    running_gazebo,
    stop,
)
from gazebo_run import wait as wait_for

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.gazebo.robot import write_robot
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import ray_directions

pytestmark = [
    pytest.mark.gazebo,
    pytest.mark.skipif(bool(missing_chroot()), reason=missing_chroot() or "-"),
]

WORLD = """<?xml version="1.0"?>
<sdf version="1.7">
  <world name="flat">
    <physics type="ode">
      <max_step_size>0.001</max_step_size>
      <real_time_update_rate>1000</real_time_update_rate>
      <ode><solver><type>quick</type><iters>50</iters><sor>1.3</sor><friction_model>{friction}</friction_model></solver></ode>
    </physics>
    <gravity>0 0 -9.81</gravity>
    <spherical_coordinates>
      <surface_model>EARTH_WGS84</surface_model>
      <latitude_deg>49.9</latitude_deg>
      <longitude_deg>8.9</longitude_deg>
      <elevation>0</elevation>
      <heading_deg>90</heading_deg>
    </spherical_coordinates>
    <scene><shadows>0</shadows><ambient>1 1 1 1</ambient><background>0 0 1 1</background></scene>
    <model name="ground">
      <static>1</static>
      <link name="link">
        <collision name="collision">
          <laser_retro>1</laser_retro>
          <geometry><mesh><uri>model://ground/ground.obj</uri></mesh></geometry>
        </collision>
        <visual name="visual">
          <geometry><mesh><uri>model://ground/ground.obj</uri></mesh></geometry>
          <material><ambient>1 0 0 1</ambient><diffuse>0 0 0 1</diffuse><emissive>1 0 0 1</emissive></material>
        </visual>
      </link>
    </model>
    <include><uri>model://husky</uri><pose>1 2 0.1324 0 0 0</pose></include>
  </world>
</sdf>
"""
SIDE = 40  # [m]


def package(folder: Path, rig: Rig, friction: str = "cone_model") -> Path:
    """A flat ground of triangles with the robot on it; return the world file."""
    write_robot(folder, rig, "classic")
    ground = folder / "models" / "ground"
    ground.mkdir()
    corners = [(x - SIDE // 2, y - SIDE // 2) for x in range(SIDE + 1) for y in range(SIDE + 1)]
    lines = ["mtllib ground.mtl", *(f"v {x} {y} 0" for x, y in corners), "vt 0 0", "vn 0 0 1", "usemtl red"]
    for x in range(SIDE):
        for y in range(SIDE):
            a, b = x * (SIDE + 1) + y + 1, (x + 1) * (SIDE + 1) + y + 1
            lines += [f"f {a}/1/1 {b}/1/1 {b + 1}/1/1", f"f {a}/1/1 {b + 1}/1/1 {a + 1}/1/1"]
    (ground / "ground.obj").write_text("\n".join(lines) + "\n")
    (ground / "ground.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (folder / "worlds").mkdir()
    (folder / "worlds/flat.world").write_text(WORLD.format(friction=friction))
    return folder / "worlds/flat.world"


def drive(world: Path, folder: Path, commands: list[tuple[float, float, float]]) -> GazeboRun:
    """Publish (from second, speed, turn rate) on Gazebo's own topic; the run ends at the last one's second."""
    with running_gazebo(world, folder) as process:
        for second, speed, turn_rate in commands:
            while stamp(folder) < second:
                assert process.poll() is None
                time.sleep(0.05)
            half = turn_rate / 2
            message = f"position {{x: {speed} y: 0 z: 0}} orientation {{x: 0 y: 0 z: {np.sin(half)} w: {np.cos(half)}}}"
            publish = ["gz", "topic", "-p", "/gazebo/flat/husky/vel_cmd", "-m", message]
            address = [f"GAZEBO_MASTER_URI={master_uri(folder)}", "GAZEBO_IP=127.0.0.1"]
            environment = {"GZ_CHROOT": str(CHROOT), "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}
            subprocess.run(in_chroot("env", *address, *publish), env=environment, check=True, timeout=60)
        stop(folder)
        wait_for(process, folder, 60)
    return results(folder)


def stamp(folder: Path) -> float:
    """Simulated time [s] of the last recorded pose; 0 before the first."""
    path = folder / "husky.pose"
    record = 16 + 13 * 8
    count = path.stat().st_size // record if path.exists() else 0
    if count == 0:
        return 0.0
    with path.open("rb") as file:
        file.seek((count - 1) * record)
        return int.from_bytes(file.read(8), "little") / 1e9


def motion(run: GazeboRun) -> tuple[Array, Array]:
    """Stamps (n,) [s] and poses and velocities (n, 13), as the recorder explains."""
    found = run.readings("husky")
    return np.array([r.stamp_ns for r in found]) / 1e9, np.array([r.values for r in found])


def turn_rates(seconds: Array, states: Array) -> Array:
    """Turn rate (n - 500,) [rad/s] over half a second that begins at each row."""
    yaw = np.unwrap(transforms.yaw_from_rotation(transforms.rotation_from_quaternion_wxyz(states[:, 3:7])))
    rates: Array = (yaw[500:] - yaw[:-500]) / (seconds[500:] - seconds[:-500])
    return rates


@pytest.mark.parametrize("friction", ["cone_model", "pyramid_model"])
def test_drives_and_turns_as_commanded(friction: str, tmp_path: Path) -> None:
    rig = paper_rig(lidar=LidarConfig(enabled=False), cameras=StereoConfig(enabled=False))
    world = package(tmp_path / "package", rig, friction)
    run = drive(world, tmp_path / "run", [(2, 0.3, 0.0), (7, 0.3, 0.3), (20, 0.0, 0.0), (22, 0.0, 0.0)])
    assert run.complaints == ()
    seconds, states = motion(run)
    speed = np.linalg.norm(states[:, 7:9], axis=1)
    rest = (seconds > 0.5) & (seconds < 2)
    assert np.ptp(states[rest, :3], axis=0).max() < 1e-4
    assert states[rest, 2] == pytest.approx(0.1323, abs=1e-3)
    assert np.linalg.norm(states[-1, 7:10]) < 1e-3
    straight = (seconds > 4) & (seconds < 7)
    assert speed[straight].mean() == pytest.approx(0.3, abs=0.003)
    assert np.ptp(states[straight, 1]) < 0.01
    rates = turn_rates(seconds, states)
    turning = (seconds[:-500] > 10) & (seconds[500:] < 20)
    print(f"{friction}: {speed[straight].mean():.4f} m/s straight; turning {speed[10_000:20_000].mean():.4f} m/s,")
    print(f"  {rates[turning].mean():.4f} rad/s, least {rates[turning].min():.4f}, most {rates[turning].max():.4f}")
    if friction == "cone_model":
        assert rates[turning].mean() == pytest.approx(0.3, rel=0.05)
        assert np.ptp(rates[turning]) < 0.03


def test_every_sensor_reads_at_its_frame(tmp_path: Path) -> None:
    """At rest above red ground under a blue sky, with the default rig: ranges, horizon, attitude, gravity and fix."""
    rig = Rig()
    run = run_gazebo(package(tmp_path / "package", rig), tmp_path / "run", readings=2, limit_s=900)
    check_readings(run, rig)


def check_readings(run: GazeboRun, rig: Rig) -> None:
    assert run.complaints == ()
    assert set(run.names()) == {"husky", *(f"husky__base_link__{s}" for s in SENSORS)}
    _, states = motion(run)
    position = states[-1, :3]
    ranges, retro = run.readings("husky__base_link__os1_lidar")[-1].values
    n = rig.lidar.columns
    down = ray_directions(rig.lidar)[(n // 2 - np.arange(n)) % n][:, ::-1, 2].T  # (rings, columns), the lowest first
    expected = np.divide(position[2] + rig.lidar.mount.xyz[2], -down, out=np.full_like(down, np.inf), where=down < 0)
    within = expected < 18.0  # the ground has an edge
    hit = within & np.isfinite(ranges)
    assert (within & ~hit).sum() <= 3  # ODE's rays can pass between two triangles where they meet
    np.testing.assert_allclose(ranges[hit], expected[hit], rtol=0, atol=0.001)
    assert (retro[hit] == 1).all()
    assert np.isinf(ranges[down > 0]).all()
    for side in ("left", "right"):
        image = run.readings(f"husky__base_link__{side}_camera")[-1].values.astype(int)
        red, blue = (image == (255, 0, 0)).all(axis=-1), (image == (0, 0, 255)).all(axis=-1)
        assert (red | blue).all()  # nothing of the robot
        assert red[500:].all()
        assert blue[:359].all()
    gps = run.readings("husky__base_link__gnss")[-1].values
    np.testing.assert_allclose(gps[:2], geodetic_from_world(position + rig.gnss.mount.xyz)[:2], rtol=0, atol=2e-8)
    imu = run.readings("husky__base_link__imu")[-1].values
    up = rig.imu.mount.base_from_sensor[:3, :3].T @ (0.0, 0.0, GRAVITY)
    assert any(np.allclose(imu[k : k + 3], up, atol=0.01) for k in range(len(imu) - 2))


SENSORS = ("os1_lidar", "left_camera", "right_camera", "imu", "gnss")

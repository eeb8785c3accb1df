# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays of the LiDAR models against figures of their manuals: angles, azimuths while the head turns, and times."""

from pathlib import Path

import numpy as np
import pytest
from sense_worlds import F8, at, box, floating
from small_park import LAYOUT, ROUTE

from fieldtruth import cli
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.catalogue import list_models
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar, column_times_ns, ray_directions, ray_times_ns, sweep_times_ns

pytestmark = pytest.mark.usefixtures("in_park")

TOLERANCE = 1e-4  # [m]


def room(x: float, y: float, z: float) -> Scene:
    """A closed room about the origin with half edge lengths [m]."""
    return floating((box("room", (x, y, z)), at(0, 0, 0)))


def azimuths(config: LidarConfig) -> F8:
    """Azimuths (columns, rings) [deg] of the rays, counterclockwise from +x, 0 to 360."""
    rays = ray_directions(config)
    return np.asarray(np.degrees(np.arctan2(rays[..., 1], rays[..., 0])) % 360)


def vlp_16_laser(ring: np.ndarray) -> np.ndarray:
    """Laser of a ring: even lasers are the lower eight rings, odd ones the upper eight (manual, table 9-1)."""
    return np.where(ring < 8, 2 * ring, 2 * (ring - 8) + 1)


def test_a_vlp_16_has_the_angles_of_its_manual() -> None:
    """Laser k of 16 fires 2.304 us after laser k - 1 (manual, figure 9-4), while the head turns clockwise."""
    config, ring, column = LidarConfig(model="vlp_16"), np.arange(16), np.arange(1808)
    rays = ray_directions(config)
    assert rays.shape == (1808, 16, 3)  # 0.1 s of sequences of 55.296 us
    assert np.degrees(np.arcsin(rays[7, :, 2])) == pytest.approx(-15.0 + 2.0 * ring, abs=1e-9)
    turned = 3600.0 * 2.304e-6 * vlp_16_laser(ring)  # [deg] at 10 Hz
    assert turned.max() == pytest.approx(0.124416)
    expected = -(360.0 * column[:, None] / 1808 + turned)
    np.testing.assert_allclose(azimuths(config), expected % 360, rtol=0, atol=1e-9)


def test_a_spinning_vlp_16_measures_walls_from_its_angles_and_times() -> None:
    """Ranges to the walls of a room, d / (cos elevation |cos azimuth|), with angles that are written out here."""
    config, half = LidarConfig(model="vlp_16"), np.array([6.0, 5.0, 4.0])
    assert config.spinning
    scan = IdealLidar(config, room(*half)).scan(np.broadcast_to(np.eye(4), (1809, 4, 4)))
    assert len(scan.range_m) == 1808 * 16
    elevation = np.radians(-15.0 + 2.0 * scan.ring.astype(float))
    laser = vlp_16_laser(scan.ring.astype(int))
    azimuth = -np.radians(360.0 * scan.column.astype(float) / 1808 + 3600.0 * 2.304e-6 * laser)
    direction = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    expected = (half / np.maximum(np.abs(direction), 1e-12)).min(axis=1)
    np.testing.assert_allclose(scan.range_m, expected, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(scan.xyz, direction * expected[:, None], rtol=0, atol=TOLERANCE)
    due = np.rint(scan.column.astype(float) * (1e8 / 1808)) + 2304 * laser
    assert np.array_equal(scan.t_ns, due.astype(np.uint32))


def test_each_ray_of_a_moving_lidar_leaves_from_the_pose_of_its_own_time() -> None:
    """It turns by 60 deg/s and moves at 2 m/s; the walls are met from the pose at each ray's time, in closed form."""
    config, half = LidarConfig(model="vlp_16"), np.array([6.0, 5.0, 4.0])
    times = sweep_times_ns(config)

    def pose(seconds: float) -> Array:
        return transforms.pose((2.0 * seconds - 0.1, 0.3, 0.1), (1.0, 2.0, 60.0 * seconds))

    scan = IdealLidar(config, room(*half)).scan(np.stack([pose(t / 1e9) for t in times.tolist()]))
    world_from_ray = np.stack([pose(t / 1e9) for t in scan.t_ns.tolist()])
    world = np.einsum("nij,nj->ni", world_from_ray[:, :3, :3], scan.xyz.astype(np.float64)) + world_from_ray[:, :3, 3]
    off = np.abs((half - np.abs(world)).min(axis=1))
    assert off.max() < TOLERANCE
    late = scan.ring == 15  # 34.56 us after its column, whose pose is 69 um and 0.002 deg away
    column = np.stack([pose(t / 1e9) for t in times[scan.column].tolist()])
    begun = np.einsum("nij,nj->ni", column[:, :3, :3], scan.xyz.astype(np.float64)) + column[:, :3, 3]
    assert np.abs((half - np.abs(begun)).min(axis=1))[late].max() > 1e-4
    with pytest.raises(ValueError, match=r"^poses must be 1809, one more than columns, got 1808$"):
        IdealLidar(config, room(*half)).scan(np.broadcast_to(np.eye(4), (1808, 4, 4)))


def test_offsets_of_azimuth_and_of_firing_turn_clockwise() -> None:
    """A ring with an offset of 10 deg looks to the right; so does one that fires later."""
    config = LidarConfig(
        columns=8, elevations_deg=(1.0, 0.0, -1.0), azimuth_offsets_deg=(0.0, 10.0, -10.0), spinning=True
    )
    assert azimuths(config)[0] == pytest.approx([0.0, 350.0, 10.0], abs=1e-9)
    assert azimuths(config)[2] == pytest.approx([270.0, 260.0, 280.0], abs=1e-9)
    late = LidarConfig(columns=8, elevations_deg=(1.0, 0.0), firing_offsets_ns=(0, 1_000_000), rate_hz=10.0)
    assert azimuths(late)[0] == pytest.approx([0.0, 356.4], abs=1e-9)  # 3600 deg/s in 1 ms
    assert ray_times_ns(late)[1].tolist() == [12_500_000, 13_500_000]


def test_a_vlp_32c_has_the_offsets_of_its_manual() -> None:
    """Lasers 0, 1, 3 and 6 of table 9-1 of its manual: elevation, azimuth offset; and pairs that fire together."""
    config = LidarConfig(model="vlp_32c")
    assert config.elevations_deg is not None
    assert config.azimuth_offsets_deg is not None
    assert config.firing_offsets_ns is not None
    rings = {angle: ring for ring, angle in enumerate(config.elevations_deg)}
    for laser, elevation, offset in ((0, -25.0, 1.4), (1, -1.0, -4.2), (3, -15.639, -1.4), (6, -0.667, 4.2)):
        ring = rings[elevation]
        assert config.azimuth_offsets_deg[ring] == offset
        assert config.firing_offsets_ns[ring] == 2304 * (laser // 2)
    assert sorted(config.firing_offsets_ns) == [2304 * (k // 2) for k in range(32)]


def test_an_ouster_has_the_angles_of_its_makers_formula() -> None:
    """Azimuth of measurement m: 2 pi (1 - m / 1024) - 2 pi offset / 360 (Ouster, sensor data, lidar range to xyz)."""
    config = LidarConfig(model="os1_64_gen1")
    m, offset = np.arange(1024)[:, None], np.array([3.164, 1.055, -1.055, -3.164] * 16)
    encoder, beam = 2 * np.pi * (1 - m / 1024), -2 * np.pi * offset / 360
    difference = azimuths(config) - np.degrees(encoder + beam)
    assert np.abs((difference + 180) % 360 - 180).max() < 1e-9
    assert np.degrees(np.arcsin(ray_directions(config)[0, [0, 63], 2])) == pytest.approx([16.611, -16.611])
    assert np.array_equal(ray_times_ns(config), np.repeat(column_times_ns(config)[:, None], 64, axis=1))


@pytest.mark.parametrize("name", list_models("lidar"))
def test_every_model_sees_the_walls_of_a_room_and_ends_within_its_period(name: str) -> None:
    config, half = LidarConfig(model=name), np.array([9.0, 8.0, 7.0])
    pose = transforms.pose((0.5, -0.3, 0.2), (4, 5, 6))
    scan = IdealLidar(config, room(*half)).scan(np.broadcast_to(pose, (config.columns + 1, 4, 4)))
    assert len(scan.range_m) == config.columns * config.rings
    world = scan.xyz.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    assert np.abs((half - np.abs(world)).min(axis=1)).max() < TOLERANCE
    x, y, z = scan.xyz.astype(np.float64).T
    if config.pattern is None:
        assert config.elevations_deg is not None
        elevations = np.array(config.elevations_deg)
        assert np.abs(np.degrees(np.arctan2(z, np.hypot(x, y))) - elevations[scan.ring]).max() < 1e-3
    assert np.all(scan.t_ns < 1e9 / config.rate_hz)
    assert np.all(np.diff(column_times_ns(config)) > max(config.firing_offsets_ns or (0,)))


@pytest.mark.slow
def test_a_run_with_a_vlp_16_is_valid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = f"{{name: vlp, environment: park, layout: {LAYOUT}, route: {ROUTE}, rig: {{lidar: {{model: vlp_16}}}}}}\n"
    Path("vlp.yaml").write_text(text, encoding="utf-8")
    assert cli.main(["generate", "vlp.yaml", "--seconds", "0.2", "--no-cameras"]) == 0
    assert cli.main(["validate", "data/vlp"]) == 0, capsys.readouterr().out
    assert "- LiDAR vlp_16: 1808 x 16 rays, 360 x 30 deg (elevations -15 to 15 deg), 1 to 100 m; " in Path(
        "data/vlp/DATASET.md"
    ).read_text(encoding="utf-8")

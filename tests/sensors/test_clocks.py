# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clocks of sensors: the laws of offset, drift, jitter and losses, in arrays and in the messages of a bag."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from record_fakes import FakeLidar, fake_sensors, make_experiment, make_slices, make_world
from rosbags.typesys import Stores, get_typestore

from fieldtruth.bag.decode import Reading, points, read_bag, stamp_ns
from fieldtruth.bag.reader import RawMessage, decoder_of, open_bag
from fieldtruth.core.progress import Silent
from fieldtruth.drive.track import stamps_at_rate
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.experiment.sensor_config import ClockConfig
from fieldtruth.record.streams import ClockReadings, read_clock
from fieldtruth.sensors.kind import At, Movement
from fieldtruth.sensors.lidar.config import LidarConfig

STAMPS = stamps_at_rate(100.0, 600 * 10**9)
TYPES = get_typestore(Stores.ROS1_NOETIC)
LEFT, RIGHT = "/stereo/camera/left/real/compressed", "/stereo/camera/right/real/compressed"


def shown(seed: int = 0, **values: float) -> ClockReadings:
    return read_clock(STAMPS, ClockConfig(**values), np.random.default_rng(seed))


def test_offset_and_drift_are_exact() -> None:
    clock = shown(offset_s=0.25, drift_ppm=-40.0)
    np.testing.assert_array_equal(
        clock.shown_ns[[0, 9_999]], [10**7 + 250_000_000 - 400, 10**11 + 250_000_000 - 4_000_000]
    )
    assert len(clock.kept) == len(STAMPS)


def test_jitter_is_normal_and_of_each_reading_its_own() -> None:
    jitter = (shown(jitter_s=1e-3).shown_ns - STAMPS) / 1e6
    assert jitter.std() == pytest.approx(1.0, rel=0.02)
    assert jitter.mean() == pytest.approx(0.0, abs=0.02)
    assert np.mean(np.abs(jitter) < 1.0) == pytest.approx(0.6827, abs=0.01)
    assert np.corrcoef(jitter[:-1], jitter[1:])[0, 1] == pytest.approx(0.0, abs=0.02)


def test_stamps_rise_whatever_the_jitter() -> None:
    clock = shown(jitter_s=0.1, offset_s=1.0)
    assert np.diff(clock.shown_ns).min() >= 1


def test_losses_are_independent_and_have_their_share() -> None:
    clock = shown(drop_share=0.1, jitter_s=1e-3)
    assert 1.0 - len(clock.kept) / len(STAMPS) == pytest.approx(0.1, abs=0.006)
    lost = ~np.isin(np.arange(len(STAMPS)), clock.kept)
    assert np.mean(lost[1:] & lost[:-1]) == pytest.approx(0.01, abs=0.003)
    np.testing.assert_array_equal(clock.shown_ns, shown(jitter_s=1e-3).shown_ns)  # losses do not change the jitter


def test_readings_before_time_zero_are_lost() -> None:
    clock = shown(offset_s=-0.1)
    assert (clock.kept[0], clock.shown_ns[clock.kept[0]]) == (10, 10_000_000)


CLOCKS: dict[str, dict[str, float]] = {
    "imu": {"offset_s": 0.02, "drift_ppm": 100.0, "jitter_s": 1e-4},
    "gnss": {"offset_s": -0.6},
    "wheel_odometry": {"drop_share": 0.2},
    "lidar": {"offset_s": 0.004, "drop_share": 0.2},
    "stereo": {"jitter_s": 1e-3, "drop_share": 0.3},
}


def rig(clocks: dict[str, dict[str, float]], **changes: Any) -> Rig:
    own = {"stereo": {"width": 64, "height": 48}} | changes
    return Rig.model_validate(
        {
            "sensors": [
                {"kind": kind, **own.get(kind, {}), **({"clock": clocks[kind]} if clocks else {})} for kind in CLOCKS
            ]
        }
    )


def record(folder: Path, own: Rig) -> dict[str, list[tuple[Reading, bytes]]]:
    slices = make_slices(folder, make_experiment(2.5, seed=3, rig=own))
    slices.record(folder / "tiny.bag", 2, Silent())
    found: dict[str, list[tuple[Reading, bytes]]] = {}
    with open_bag(folder / "tiny.bag") as bag:
        for reading, raw in zip(read_bag(folder / "tiny.bag"), bag.messages(), strict=True):
            found.setdefault(raw.topic, []).append((reading, raw.data))
    return found


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], dict[str, Any]]:
    with_clocks, ideal = (record(tmp_path_factory.mktemp("clocks"), rig(clocks)) for clocks in (CLOCKS, {}))
    return with_clocks, ideal


def test_ideal_readings_have_topics_of_their_own_with_the_same_bytes(bags: tuple[dict[str, Any], ...]) -> None:
    own, ideal = bags
    kept = {name: rows for name, rows in own.items() if not name.endswith("/truth")}
    assert kept.keys() == ideal.keys()
    for name in own.keys() - kept.keys():
        same = ideal[name.removesuffix("/truth")]
        assert [(reading.stamp_ns, data) for reading, data in own[name]] == [(r.stamp_ns, data) for r, data in same]
    assert {"/imu/data", "/navsat/fix", "/joint_states", "/odometry/wheel"} <= {
        name.removesuffix("/truth") for name in own if name.endswith("/truth")
    }
    for name in ("/tf", "/cmd_vel", "/gazebo/model_states", "/ground_truth/odom", "/clock"):
        assert [data for _, data in own[name]] == [data for _, data in ideal[name]], name


def test_headers_have_the_clocks_time_and_the_bag_the_true_one(bags: tuple[dict[str, Any], ...]) -> None:
    own, ideal = bags
    for name in ("/imu/data", "/os1_cloud_node/points", LEFT, "/joint_states"):
        true = {reading.stamp_ns for reading, _ in ideal[name]}
        assert {reading.stamp_ns for reading, _ in own[name]} <= true, name
    late = [stamp_ns(reading.message.header) - reading.stamp_ns for reading, _ in own["/imu/data"]]
    assert np.mean(late) == pytest.approx(20e6, abs=5e5)
    assert 0.5e5 < np.std(late) < 2e5
    cloud = own["/os1_cloud_node/points"][-1][0]
    assert stamp_ns(cloud.message.header) == cloud.stamp_ns + 4_000_000
    early = own["/navsat/fix"]
    assert [reading.stamp_ns for reading, _ in early] == [k * 500_000_000 for k in (2, 3, 4, 5)]
    assert [stamp_ns(reading.message.header) for reading, _ in early] == [k * 100_000_000 for k in (4, 9, 14, 19)]


def test_times_of_points_follow_the_clock_and_poses_do_not() -> None:
    config, seen = LidarConfig(spinning=True, time_field="timestamp", columns=64), list[Any]()

    class Spinning(FakeLidar):
        def scan(self, world_from_lidar: Any, stamp_ns: int = 0, number: int = 0) -> Any:
            return super().scan(world_from_lidar[0])

    def world_from_base(stamp_ns: Any) -> Any:
        seen.append(stamp_ns)
        return np.tile(np.eye(4), (len(stamp_ns), 1, 1))

    sensor, (output,) = fake_sensors(make_world(), paper_rig(lidar=config), Spinning)["lidar"], config.outputs()
    reading = sensor.read(output, At(1, 2 * 10**8, 2 * 10**8 + 7_000_000, Movement(world_from_base)))
    (data,) = sensor.messages(output, 1, reading)
    cloud = decoder_of(TYPES, Path())(RawMessage(0, "", "sensor_msgs/msg/PointCloud2", data))
    rows = points(cloud)
    np.testing.assert_allclose(rows["timestamp"] - rows["t"] / 1e9, 0.207, atol=1e-9)
    assert stamp_ns(cloud.header) == 207_000_000
    assert seen[0][0] == 2 * 10**8


def test_views_of_a_pair_have_one_clock_and_lose_the_same(bags: tuple[dict[str, Any], ...]) -> None:
    own, ideal = bags
    left, right = (
        [(r.stamp_ns, stamp_ns(r.message.header), r.message.header.seq) for r, _ in own[name]] for name in (LEFT, RIGHT)
    )
    assert left == right
    assert 0.5 < len(left) / len(ideal[LEFT]) < 0.9
    # seq counts readings, so that a loss is a gap, as from a publisher in ROS 1.
    assert [seq for _, _, seq in left] == [round(true / 40_000_000) - 1 for true, _, _ in left]


def test_what_remains_of_lossy_sensors_is_the_same_reading(bags: tuple[dict[str, Any], ...]) -> None:
    own, ideal = bags
    for name in ("/odometry/wheel", "/gazebo_client/rear_left_speed", LEFT):
        same = {reading.stamp_ns: data for reading, data in ideal[name]}
        pairs = [(data[12:] if name == LEFT else data, same[reading.stamp_ns]) for reading, data in own[name]]
        assert 0 < len(pairs) < len(same)
        assert all(data == (true[12:] if name == LEFT else true) for data, true in pairs), name

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs as readings by sensor name: the values are those of rosbags, and stamps that do not rise are refused."""

import io
import pickle
import shutil
import struct
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from many_sensors import many_rig
from PIL import Image as Picture
from rosbags.rosbag1 import Reader, Writer

import fieldtruth as ft
from fieldtruth.bag.decode import read_bag
from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import misfits, open_run
from fieldtruth.bag.stamps import rising_rows
from fieldtruth.bag.topics import sources_of
from fieldtruth.bag.track_file import read_track_file
from fieldtruth.core.errors import FieldtruthWarning, UnknownNameError
from fieldtruth.core.readings import Cloud, Image, Inertial
from fieldtruth.experiment.config import DriveConfig
from fieldtruth.experiment.rig import Rig

POINTS, ODOMETRY, IMU = "/os1_cloud_node/points", "/ground_truth/odom", "/imu/data"
PHOTOS = "/stereo/camera/left/real/compressed"
Change = Callable[[str, int, bytes], tuple[int, bytes] | None]


def rewritten(run: Path, path: Path, change: Change, passes: int = 1) -> Path:
    """Copy a run's bag; ``change`` gives a message's new stamp in the bag and bytes, or None to drop it.

    It may be played several times.
    """
    with Reader(run / f"{run.name}.bag") as reader, Writer(path) as writer:
        connections = {
            c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest)
            for c in reader.connections
        }
        rows = [(c, stamp, bytes(data)) for c, stamp, data in reader.messages()]
        for number in range(passes):
            for connection, stamp, data in rows:
                if changed := change(connection.topic, stamp, data):
                    writer.write(connections[connection.id], changed[0] + number * reader.duration, changed[1])
    return path


def stamped(data: bytes, stamp_ns: int) -> bytes:
    return data[:4] + struct.pack("<2L", *divmod(stamp_ns, 10**9)) + data[12:]


# ---------------------------------------------------------------------------------------------------------------------
# Readings


def test_readings_are_the_messages_as_arrays(small_run: Path) -> None:
    run = open_run(small_run)
    clouds, views, imu = run["lidar"], run["stereo/left"], run["imu"]
    messages = [reading.message for reading in read_bag(run.bag, [POINTS])]
    assert (len(clouds), clouds[-1].stamp_ns, clouds[3].frame) == (12, 1_200_000_000, "os1_lidar")
    for cloud, message in zip(clouds[2:5], messages[2:5], strict=True):
        assert isinstance(cloud, Cloud)
        raw = np.frombuffer(message.data.tobytes(), np.uint8).reshape(-1, message.point_step)
        assert np.array_equal(cloud.xyz, raw[:, :12].copy().view("<f4"))
        assert list(cloud.fields()) == [field.name for field in message.fields]
        assert np.array_equal(cloud.label, cloud.others["intensity"])
        assert cloud.stamp_ns == cloud.header_ns == message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    image = views.at(400_000_000)
    assert isinstance(image, Image)
    (photo,) = [r.message for r in read_bag(run.bag, [PHOTOS]) if r.stamp_ns == 400_000_000]
    assert image.jpeg == photo.data.tobytes()
    assert image.photo is not None
    assert np.array_equal(image.photo, np.asarray(Picture.open(io.BytesIO(photo.data.tobytes()))))
    assert image.flow is None
    assert image.depth is not None
    assert image.depth.shape == (92, 160)
    series = imu[:]
    assert isinstance(series, Inertial)
    rates = [(m.x, m.y, m.z) for m in (r.message.angular_velocity for r in read_bag(run.bag, [IMU]))]
    assert np.array_equal(series.angular_velocity, rates)
    assert np.array_equal(series.stamp_ns, imu.stamps_ns)
    assert series.orientation_wxyz.shape == (len(imu), 4)


def test_frames_come_in_time_order_with_the_true_pose(small_run: Path) -> None:
    run = open_run(small_run)
    frames = list(run.frames(sensors=["lidar", "stereo/left"]))
    stamps = {*range(10**8, 13 * 10**8, 10**8), *range(4 * 10**7, 121 * 10**7, 4 * 10**7)}
    assert [frame.stamp_ns for frame in frames] == sorted(stamps)
    assert [len(frame) for frame in frames].count(2) == 6
    both = next(frame for frame in frames if len(frame) == 2)
    assert np.array_equal(both["lidar"].xyz, run["lidar"].at(both.stamp_ns).xyz)
    assert both.pose == pytest.approx(run.trajectory.world_from_base(both.stamp_ns))
    assert {name for frame in run.frames() for name in frame} == {
        "imu", "gnss", "wheel_odometry/odometry", "wheel_odometry/speeds", "wheel_odometry/joints", "lidar",
        "stereo/left", "stereo/right",
    }  # fmt: skip


@pytest.mark.parametrize("rig", [Rig(), many_rig()])
def test_names_are_those_of_a_simulation(rig: Rig) -> None:
    assert list(sources_of(rig)) == [o.name for sensor in rig.sensors for o in sensor.outputs() if not o.ideal]


def test_names_and_copies(small_run: Path, tmp_path: Path) -> None:
    run = open_run(small_run)
    assert np.array_equal(run["left"][0].photo, run["stereo/left"][0].photo)
    assert np.array_equal(pickle.loads(pickle.dumps(run["lidar"]))[5].xyz, run["lidar"][5].xyz)
    assert run.calibration.base_from("stereo/right")[:3, 3] == pytest.approx([0.15, -0.06, 0.72])
    assert run.calibration.lens("stereo/left").is_pinhole
    with pytest.raises(UnknownNameError, match="unknown sensor 'radar'"):
        run["radar"]
    with pytest.raises(BagError, match=r"lidar of .* has no reading at 5 ns; the nearest is at 100000000 ns"):
        run["lidar"].at(5)
    with pytest.raises(IndexError):
        run["lidar"][12]


def test_a_run_is_printed_as_its_messages(small_run: Path) -> None:
    run = open_run(small_run)
    assert f"{small_run.name}.bag, {run.duration_s:.3f} s, {sum(run.counts.values())} messages, " in repr(run)
    assert f"{IMU}: {run.counts[IMU]}" in repr(run)
    assert "\n" not in repr(run)


def test_what_is_assumed_is_said_once(small_run: Path, tmp_path: Path) -> None:

    def every_other(topic: str, stamp: int, data: bytes) -> tuple[int, bytes] | None:
        return None if topic == POINTS and stamp % 200_000_000 else (stamp, data)

    bag = rewritten(small_run, tmp_path / "other.bag", every_other)
    run = open_run(bag)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert run["lidar"].source.frame == "os1_lidar"
        assert run["imu"].source.config in run.rig.sensors
    (text,) = [str(each.message) for each in said]
    assert "there is no experiment.yaml of this bag" in text
    lidar, stereo = run.sensors["lidar"].config, run.sensors["stereo/left"].config
    assert (lidar.columns, lidar.rings, stereo.width, stereo.height) == (512, 64, 160, 92)
    assert (lidar.rate_hz, stereo.rate_hz) == (5.0, 25.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made = ft.export(bag, "pcd", out=tmp_path / "pcd")
    assert "other: there is no experiment.yaml of this bag" in (made / "README.md").read_text()


def test_an_experiment_that_does_not_fit_is_reported_in_one_line(small_run: Path, tmp_path: Path) -> None:
    shutil.copytree(small_run, tmp_path / "park_1")
    path = tmp_path / "park_1/experiment.yaml"
    changed = path.read_text().replace("  rate_hz: 10.0\n", "  rate_hz: 5.0\n")
    assert changed != path.read_text()
    path.write_text(changed)
    with pytest.warns(FieldtruthWarning) as said:
        open_run(tmp_path / "park_1")
    (text,) = [str(each.message) for each in said]
    assert "does not fit the bag" in text
    assert "points has 9.17 Hz, not 5 Hz" in text
    assert "\n" not in text


def test_a_sensor_that_the_experiment_does_not_fit_is_said_when_it_is_read(small_run: Path) -> None:
    run = open_run(small_run)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # its own experiment fits
        opened = [run[name] for name, source in run.sensors.items() if source.recorded(run.counts)]
    assert len(opened) > 5
    lidar = run.experiment.rig.lidar if run.experiment is not None else None
    assert lidar is not None
    assert run.experiment is not None
    changes = {"frame": "mast_link", "rings": lidar.rings // 2}
    rig = run.experiment.rig.with_sensors(type(lidar), **changes)
    other = replace(run, experiment=run.experiment.model_copy(update={"rig": rig}))
    with pytest.warns(
        FieldtruthWarning, match=f"points has the frame '{lidar.frame}', not 'mast_link' and .* rings, not"
    ):
        assert len(other["lidar"]) > 0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"spinning": True, "time_field": "time"}, "no field t, time"),
        ({"point_fields": "livox"}, "no field tag, line, timestamp"),
        ({"point_fields": "ouster"}, "no field reflectivity, ambient, range and ring as u2, not u1"),
    ],
)
def test_fields_of_clouds_that_the_experiment_does_not_have_are_said(
    small_run: Path, changes: dict[str, Any], text: str
) -> None:
    run = open_run(small_run)
    assert run.experiment is not None
    rig = run.experiment.rig.with_sensors(ft.LidarConfig, **changes)
    other = replace(run, experiment=run.experiment.model_copy(update={"rig": rig}))
    assert f"does not fit the bag: /os1_cloud_node/points has {text}" in misfits(other)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it is said once
        assert len(other["lidar"]) > 0
    assert not misfits(run)


# ---------------------------------------------------------------------------------------------------------------------
# Stamps


def test_stamps_must_rise(tmp_path: Path) -> None:
    def rows(stamps: list[int], **options: Any) -> list[int]:
        return list(map(int, rising_rows(np.array(stamps) * 10**7, "/t", tmp_path, **options)))

    assert rows([1, 2, 3]) == [0, 1, 2]
    assert rows([3, 1, 30, 2]) == [1, 3, 0, 2]  # messages that arrived late
    assert rows([0, 0, 5, 6]) == [2, 3]  # before the clock started
    assert rows([0]) == [0]
    assert rows([1, 1, 2, 2, 3], coarse=True) == [0, 2, 4]
    for stamps, words in (
        ([10, 50, 100, 11, 51], r"stamps of /t go back from 1000000000 ns to 110000000 ns"),
        ([1, 2, 3, 2], "two messages of /t have the stamp 20000000 ns"),
        ([0, 0], "two messages of /t have the stamp 0 ns"),  # in the bag itself
    ):
        with pytest.raises(BagError, match=words):
            rows(stamps)
    with pytest.raises(BagError, match="two messages"):
        rows([1, 2, 1, 2], coarse=True)  # a second pass, not a coarse clock


def reset(topic: str, stamp: int, data: bytes) -> tuple[int, bytes]:
    """The clock of the headers begins again after 0.6 s, 7 ms later."""
    return stamp, stamped(data, stamp if stamp < 6 * 10**8 else stamp - 593_000_000) if headed(topic) else data


def headed(topic: str) -> bool:
    return topic in (ODOMETRY, POINTS, IMU) or topic.startswith("/stereo/camera/")


FORMS = ["tum", "kitti", "semantickitti", "webdataset", "mmseg", "pcd", "files", "coco", "stereo-depth"]


@pytest.fixture(scope="module")
def repeated(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Bags of a run that was reset, and of one that was looped."""
    folder = tmp_path_factory.mktemp("repeated")
    again = rewritten(small_run, folder / "reset.bag", reset)
    return again, rewritten(small_run, folder / "loop.bag", lambda topic, stamp, data: (stamp, data), passes=2)


@pytest.mark.filterwarnings("ignore::fieldtruth.core.errors.FieldtruthWarning")
@pytest.mark.parametrize("to", FORMS)
def test_every_form_refuses_a_run_that_was_reset_or_looped(
    repeated: tuple[Path, Path], tmp_path: Path, to: str
) -> None:
    for bag in repeated:
        with pytest.raises(BagError, match=r"stamps of /\S+ go back from \d+ ns to \d+ ns.*; cut the bag there"):
            ft.export(bag, to, out=tmp_path / "out", workers=2)
        assert not (tmp_path / "out").exists()


@pytest.mark.filterwarnings("ignore::fieldtruth.core.errors.FieldtruthWarning")
def test_data_sets_and_track_files_refuse_them_too(repeated: tuple[Path, Path]) -> None:
    again, _ = repeated
    with pytest.raises(BagError, match="go back"):
        ft.RunDataset(again)
    with pytest.raises(BagError, match="go back"):
        ft.RunDataset(again, ["pose"])
    with pytest.raises(BagError, match="go back"):
        read_track_file(DriveConfig(track=str(again)))


@pytest.mark.filterwarnings("ignore::fieldtruth.core.errors.FieldtruthWarning")
def test_a_repeated_stamp_amid_others_is_refused_where_it_is_read(small_run: Path, tmp_path: Path) -> None:
    def repeat(topic: str, stamp: int, data: bytes) -> tuple[int, bytes]:
        return stamp, stamped(data, 500_000_000) if topic == POINTS and stamp == 600_000_000 else data

    bag = rewritten(small_run, tmp_path / "once.bag", repeat)
    with pytest.raises(BagError, match=f"stamps of {POINTS} go back from 600000000 ns to 500000000 ns"):
        ft.export(bag, "semantickitti", out=tmp_path / "out")


@pytest.mark.filterwarnings("ignore::fieldtruth.core.errors.FieldtruthWarning")
def test_stamps_of_the_bag_that_go_back_in_the_file_are_refused(small_run: Path, tmp_path: Path) -> None:
    """With ``use_sim_time`` the recorder's clock is reset, too."""

    def both(topic: str, stamp: int, data: bytes) -> tuple[int, bytes]:
        new = stamp if stamp < 6 * 10**8 else stamp - 593_000_000
        return new, stamped(data, new) if headed(topic) else data

    bag = rewritten(small_run, tmp_path / "sim.bag", both)
    for name in ("imu", "lidar", "stereo/left"):
        with pytest.raises(BagError, match="go back"):
            open_run(bag)[name]
    with pytest.raises(BagError, match="go back"):
        _ = open_run(bag).trajectory
    rng = np.random.default_rng(1)
    late = rewritten(
        small_run, tmp_path / "late.bag", lambda topic, stamp, data: (stamp + int(rng.integers(3 * 10**8)), data)
    )
    assert np.array_equal(open_run(late)["lidar"].stamps_ns, open_run(small_run)["lidar"].stamps_ns)

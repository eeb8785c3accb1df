# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Track files: every form gives the same poses, and a wrong line is named."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import ros_types as ros
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance
from rosbags.typesys.stores.ros1_noetic import nav_msgs__msg__Odometry as Odometry
from scipy.spatial.transform import Rotation

from fieldtruth.bag.decode import read_bag
from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import open_run
from fieldtruth.bag.track_file import TrackFile, read_track_file
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthError, FieldtruthWarning, TrackError, UnknownNameError
from fieldtruth.experiment.config import DriveConfig
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig
from fieldtruth.exporters import export
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL
from fieldtruth.validation.runner import validate

RPY = np.array([[10.0, -20.0, 30.0], [11.0, -21.0, 40.0], [12.0, -22.0, 50.0]])
XYZW = Rotation.from_euler("xyz", RPY, degrees=True).as_quat()
TIMES = ("1700000000.123456789", "1700000000.223456789", "1700000000.323456790")
NS = (1700000000123456789, 1700000000223456789, 1700000000323456790)
XYZ = np.array([[1.0, 2.0, 3.0], [1.5, 2.5, 3.0], [2.0, 3.5, 3.25]])


def joined(separator: str, *columns: object) -> str:
    return separator.join(f"{value!r}" if isinstance(value, float) else str(value) for value in columns)


def lines(separator: str, values: Array) -> list[str]:
    return [joined(separator, t, *xyz.tolist(), *row.tolist()) for t, xyz, row in zip(TIMES, XYZ, values, strict=True)]


TUM = "\n".join(["# t[s] x[m], y, z qx qy qz qw", "", *lines(" ", XYZW)])
CSV = "\n".join(["t,x,y,z,qx,qy,qz,qw", *lines(",", XYZW)])
FORMS = {
    "a.tum": TUM,
    "a.txt": TUM.replace(" ", "\t"),
    "a.csv": CSV,
    "b.csv": "\n".join(["\ufeff# Stamp, X, Y, Z, roll_deg, pitch_deg, yaw_deg", *lines(", ", RPY)]),
    "c.csv": "\n".join(["t,x,y,z,roll,pitch,yaw,", *(f"{line},spare" for line in lines(",", np.radians(RPY)))]),
}
FORMS["d.csv"] = "\n".join(
    [
        "note,stamp_ns,x,y,z,qx,qy,qz,qw",
        *("a," + line.replace(t, str(ns)) for t, ns, line in zip(TIMES, NS, lines(",", XYZW), strict=True)),
    ]
)


def read(folder: Path, name: str, text: str | bytes, **config: object) -> TrackFile:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_track_file(DriveConfig.model_validate({"track": str(path), **config}))


@pytest.mark.parametrize("name", FORMS)
def test_every_form_is_read_to_the_nanosecond(name: str, tmp_path: Path) -> None:
    file = read(tmp_path, name, FORMS[name])
    assert (file.name, file.frame, file.stamps) == (name, "base_link", list(NS))
    np.testing.assert_array_equal(file.poses.position, XYZ)
    np.testing.assert_allclose(transforms.xyzw_from_wxyz(file.poses.quaternion_wxyz), XYZW, atol=1e-15)


@pytest.mark.parametrize("name", FORMS)
def test_the_copy_of_a_file_reads_as_the_file_itself(name: str, tmp_path: Path) -> None:
    file = read(tmp_path, name, FORMS[name])
    again = read(tmp_path, "track.csv", file.csv())
    assert again.csv() == file.csv()
    for one, other in zip(vars(again.poses).values(), vars(file.poses).values(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_poses_of_a_sensor_in_another_reference_frame_become_those_of_base_link(tmp_path: Path) -> None:
    rig, world_from_base = Rig(), transforms.pose_from_quaternion_wxyz(XYZ, transforms.wxyz_from_xyzw(XYZW))
    place = Mount(xyz=(3.0, -2.0, 1.0), rpy_deg=(0.0, 0.0, 90.0))
    base_from_optical = rig.stereo.left.base_from_sensor @ CAMERA_FROM_OPTICAL
    seen = transforms.inverse(place.base_from_sensor) @ world_from_base @ base_from_optical
    quaternions = transforms.xyzw_from_wxyz(transforms.quaternion_wxyz_from_rotation(seen[:, :3, :3]))
    rows = zip(TIMES, seen[:, :3, 3].tolist(), quaternions.tolist(), strict=True)
    text = "\n".join(joined(" ", t, *xyz, *xyzw) for t, xyz, xyzw in rows)
    config = {"pose_of": "left_camera_optical", "world_from_track": place.model_dump()}
    poses = read(tmp_path, "slam.txt", text, **config).in_world(
        DriveConfig.model_validate({"track": "slam.txt", **config}), rig
    )
    np.testing.assert_allclose(poses.position, XYZ, atol=1e-14)
    np.testing.assert_allclose(
        transforms.rotation_from_quaternion_wxyz(poses.quaternion_wxyz), world_from_base[:, :3, :3], atol=1e-14
    )


def test_an_unknown_frame_lists_those_of_the_rig(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="unknown frame 'os1_lidr'; did you mean 'os1_lidar'"):
        read(tmp_path, "a.csv", CSV, pose_of="os1_lidr").in_world(DriveConfig(track="a.csv"), Rig())


def test_rounded_quaternions_are_normalised(tmp_path: Path) -> None:
    rounded = "\n".join(f"{t} 0 0 0 0.707 0 0 0.707" for t in TIMES)
    poses = read(tmp_path, "a.txt", rounded).in_world(DriveConfig(track="a.txt"), Rig())
    np.testing.assert_allclose(poses.quaternion_wxyz, np.sqrt(0.5) * np.array([[1, 1, 0, 0]] * 3), atol=1e-15)


POSE = "0 0 0 0 0 0 1"
HEADER = "t,x,y,z,qx,qy,qz,qw\n"
UNIT = "the quaternion must have the length 1, got"
ERRORS: dict[str, tuple[str, str | bytes, str]] = {
    "nothing": ("a.txt", "", "a.txt must have at least 2 poses, got 0"),
    "one pose": ("a.txt", f"1 {POSE}", "a.txt must have at least 2 poses, got 1"),
    "short line": ("a.txt", f"1 {POSE}\n2 0 0 0 1",
                   "a.txt: line 2 must be 8 numbers, t x y z qx qy qz qw, got '2 0 0 0 1'"),
    "word": ("a.txt", f"1 {POSE}\n2 a 0 0 0 0 0 1", "a.txt: line 2: 'a' is not a number"),
    "stamp": ("a.txt", f"now {POSE}", "a.txt: line 1: 'now' is not a stamp"),
    "nan stamp": ("a.txt", f"nan {POSE}", "a.txt: line 1: 'nan' is not a stamp"),
    "large stamp": ("a.txt", f"1e30 {POSE}", "a.txt: line 1: the stamp '1e30' is too large"),
    "nan": ("a.txt", f"1 {POSE}\n2 0 nan 0 0 0 0 1", "a.txt: line 2: y must be finite, got nan"),
    "infinite": ("a.txt", f"1 {POSE}\n\n2 0 0 0 0 0 0 inf", "a.txt: line 3: qw must be finite, got inf"),
    "twice": ("a.txt", f"1 {POSE}\n1 {POSE}", "a.txt: line 2: stamps must rise, got 1.000000000 s after 1.000000000 s"),
    "back": ("a.csv", f"{HEADER}2,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1",
             "a.csv: line 3: stamps must rise, got 1.000000000 s after 2.000000000 s"),
    "length": ("a.txt", f"1 {POSE}\n2 0 0 0 0 0 0 0.5", f"a.txt: line 2: {UNIT} 0.5"),
    "zero": ("a.txt", f"1 0 0 0 0 0 0 0\n2 {POSE}", f"a.txt: line 1: {UNIT} 0"),
    "jump": ("a.txt", f"1 {POSE}\n1.1 {POSE}\n1.2 11 0 0 0 0 0 1",
             "a.txt: line 3: the path jumps by 11.0 m in 0.1 s; at most 100 m/s are allowed"),
    "header": ("a.csv", "t,x,y\n1,2,3",
               "a.csv: the header must name t (or stamp, stamp_ns), x, y, z and qx, qy, qz, qw (or roll, pitch, yaw, "
               "or roll_deg, pitch_deg, yaw_deg), got 't, x, y'"),
    "columns": ("a.csv", f"{HEADER}1,2", "a.csv: line 2 has 2 columns, the header 8"),
    "bytes": ("a.csv", b"t,\xff\xfe", "a.csv is neither text nor a bag; a track file is TUM, CSV, or a bag"),
    "empty MCAP": ("a.mcap", b"\x89MCAP0\r\n", "a.mcap has no messages"),
    "damaged database": ("a.db3", b"SQLite", "cannot read a.db3: "),
    "damaged bag": ("a.bag", b"#ROSBAG V2.0\n", "cannot read a.bag: "),
}  # fmt: skip


@pytest.mark.parametrize("case", ERRORS)
def test_a_wrong_file_is_one_clear_line(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    name, text, expected = ERRORS[case]
    with pytest.raises(FieldtruthError) as error:
        read(Path(), name, text)
    message = str(error.value)
    assert message.startswith(expected) if case.startswith("damaged") else message == expected
    assert "\n" not in message


def test_a_missing_file_is_named() -> None:
    with pytest.raises(TrackError, match=r"cannot read the track file no/such.tum: No such file or directory"):
        read_track_file(DriveConfig(track="no/such.tum"))


@pytest.mark.parametrize("name", ["pipe", "/dev/null"])
def test_what_is_no_file_is_refused_before_it_is_read(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    what = f"{name}: it is a {'named pipe' if name == 'pipe' else 'device'}, not a file"
    with pytest.raises(TrackError, match=f"^cannot read the track file {what}$"):
        read_track_file(DriveConfig(track=name))
    readers: list[Callable[[], object]] = [
        lambda: validate(name),
        lambda: open_run(name),
        lambda: list(read_bag(name)),
        lambda: export(name, "tum", out="x.tum"),
    ]
    for work in readers:
        with pytest.raises(BagError, match=f"^cannot read {what}$"):
            work()


def drive_bag(folder: Path, stamps_ms: list[int]) -> Path:
    """Write a bag of ROS 1 with odometry along x, 1 mm a message, whose headers have these stamps [ms]."""
    still = TwistWithCovariance(ros.Twist(ros.Vector3(0.0, 0.0, 0.0), ros.Vector3(0.0, 0.0, 0.0)), np.zeros(36))
    with Ros1Writer(folder / "x.bag") as writer:
        text, digest = ros.STORE.generate_msgdef("nav_msgs/msg/Odometry")
        connection = writer.add_connection("/ground_truth/odom", "nav_msgs/msg/Odometry", msgdef=text, md5sum=digest)
        for k, stamp in enumerate(stamps_ms):
            pose = ros.Pose(ros.Point(stamp / 1000, 0.0, 0.0), ros.Quaternion(0.0, 0.0, 0.0, 1.0))
            head = ros.header(k, stamp * 10**6, "world")
            message = Odometry(head, "base_link", PoseWithCovariance(pose, np.zeros(36)), still)
            writer.write(connection, (k + 1) * 10**7, ros.serialize(message, "nav_msgs/msg/Odometry"))
    return folder / "x.bag"


@pytest.mark.parametrize(
    ("stamps", "back_to"),
    [
        ([*range(20, 520, 20), *range(0, 500, 20)], 0),
        ([*range(20, 520, 20)] * 2, 20),
        ([0, 0, *range(20, 520, 20), 20], 20),
    ],
)
def test_a_bag_whose_time_goes_back_is_refused(stamps: list[int], back_to: int, tmp_path: Path) -> None:
    line = f"x.bag: stamps of /ground_truth/odom go back from 500000000 ns to {back_to * 10**6} ns: a simulation"
    with pytest.raises(BagError, match=line):
        read_track_file(DriveConfig(track=str(drive_bag(tmp_path, stamps))))


def test_headers_without_a_stamp_have_those_of_the_bag(tmp_path: Path) -> None:
    bag = drive_bag(tmp_path, [0] * 9)
    words = "x.bag: the headers of /ground_truth/odom have no stamp .0., so the stamps in the bag are used"
    with pytest.warns(FieldtruthWarning, match=words) as said:
        file = read_track_file(DriveConfig(track=str(bag)))
    assert len([each for each in said if "no stamp" in str(each.message)]) == 1
    assert file.stamps == [k * 10**7 for k in range(1, 10)]
    with pytest.warns(FieldtruthWarning, match=words):
        assert list(open_run(bag).trajectory.stamps_ns) == file.stamps
    with pytest.warns(FieldtruthWarning, match=words):
        assert list(open_run(bag).streams(["/ground_truth/odom"])["/ground_truth/odom"].stamps_ns) == file.stamps


def test_delayed_messages_are_sorted_and_those_before_the_clock_started_left_out(tmp_path: Path) -> None:
    file = read_track_file(DriveConfig(track=str(drive_bag(tmp_path, [0, 0, 20, 60, 40, 40, 180, 100, 200]))))
    assert [stamp // 10**6 for stamp in file.stamps] == [20, 40, 60, 100, 180, 200]
    assert file.poses.position[:, 0].tolist() == [0.02, 0.04, 0.06, 0.1, 0.18, 0.2]


def test_a_topic_is_for_bags(tmp_path: Path) -> None:
    with pytest.raises(TrackError, match=r"drive\.topic is allowed for a bag only"):
        read(tmp_path, "a.csv", CSV, topic="/odom")


def test_a_long_time_without_a_pose_is_described(tmp_path: Path) -> None:
    gap = read(tmp_path, "a.txt", "\n".join(f"{t} {POSE}" for t in (1, 1.5, 4.5, 5, 6))).gap
    start = "a.txt: no pose for 3.0 s after 1.500 s"
    assert gap == f"{start}, and 1 more of over 0.5 s; the path between is a smooth curve"
    assert read(tmp_path, "a.txt", "\n".join(f"{t} {POSE}" for t in (1, 1.5, 2))).gap == ""


def test_the_start_is_exact_to_the_nanosecond(tmp_path: Path) -> None:
    file = read(tmp_path, "a.csv", CSV)
    assert file.start_ns(DriveConfig(track="a.csv", start_s=1700000000.2)) == 1700000000_200_000_000
    assert file.start_ns(DriveConfig(track="a.csv")) == NS[0]


def test_the_odometry_and_the_states_of_a_run_are_tracks(small_run: Path) -> None:
    odometry = read_track_file(DriveConfig(track=str(small_run)))
    assert (odometry.name, odometry.frame, len(odometry.stamps)) == ("park_1.bag", "base_link", 60)
    named = read_track_file(DriveConfig(track=str(small_run / "park_1.bag"), topic="/ground_truth/odom"))
    assert named.csv() == odometry.csv()
    with pytest.raises(UnknownNameError, match=r"park_1\.bag: '/odom'; .*Available: /ground_truth/odom"):
        read_track_file(DriveConfig(track=str(small_run), topic="/odom"))


def test_an_mcap_file_gives_the_same_track_as_its_bag(small_run: Path, tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    path = export(small_run, "mcap", out=tmp_path / "park_1.mcap")
    file = read_track_file(DriveConfig(track=str(path)))
    assert (file.name, file.frame) == ("park_1.mcap", "base_link")
    assert file.csv() == read_track_file(DriveConfig(track=str(small_run))).csv()
    with pytest.raises(UnknownNameError, match=r"park_1\.mcap: '/odom'; .*Available: /ground_truth/odom"):
        read_track_file(DriveConfig(track=str(path), topic="/odom"))


def drone_bag(folder: Path, stamps: Sequence[int], rows: Sequence[int], recorded: Sequence[int]) -> None:
    """Write a bag of ROS 2 with rows of the poses, with stamps of the headers and of the bag [ns]."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    pose, twist = types["geometry_msgs/msg/PoseWithCovariance"], types["geometry_msgs/msg/TwistWithCovariance"]
    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    still = twist(types["geometry_msgs/msg/Twist"](zero, zero), np.zeros(36))
    with Writer(folder / "drone", version=8) as writer:
        odometry = writer.add_connection("/mavros/odom", "nav_msgs/msg/Odometry", typestore=store)
        poses = zip(XYZ[[*rows]].tolist(), XYZW[[*rows]].tolist(), strict=True)
        for ns, bag_ns, (xyz, xyzw) in zip(stamps, recorded, poses, strict=True):
            header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](*divmod(ns, 10**9)), "map")
            place = types["geometry_msgs/msg/Pose"](
                types["geometry_msgs/msg/Point"](*xyz), types["geometry_msgs/msg/Quaternion"](*xyzw)
            )
            message = types["nav_msgs/msg/Odometry"](header, "os1_lidar", pose(place, np.zeros(36)), still)
            writer.write(odometry, bag_ns, store.serialize_cdr(message, "nav_msgs/msg/Odometry"))


def test_a_database_of_ros_2_whose_headers_have_no_stamp_has_those_of_the_bag(tmp_path: Path) -> None:
    drone_bag(tmp_path, (0, 0, 0), (0, 1, 2), NS)
    with pytest.warns(FieldtruthWarning, match="headers of /mavros/odom have no stamp .* in the bag are used"):
        file = read_track_file(DriveConfig(track=str(tmp_path / "drone"), topic="/mavros/odom"))
    assert file.stamps == list(NS)
    np.testing.assert_array_equal(file.poses.position, XYZ)


def test_a_database_of_ros_2_gives_its_odometry(tmp_path: Path) -> None:
    # The clock has not started, and then ticks too coarsely for the second and the third message.
    stamps = (0, NS[0], NS[0], *NS[1:])
    drone_bag(tmp_path, stamps, (0, 0, 1, 1, 2), stamps)
    for path in (tmp_path / "drone", tmp_path / "drone/drone.db3"):
        file = read_track_file(DriveConfig(track=str(path), topic="/mavros/odom"))
        assert (file.frame, file.stamps) == ("os1_lidar", list(NS))
        np.testing.assert_array_equal(file.poses.position, XYZ)
        np.testing.assert_array_equal(transforms.xyzw_from_wxyz(file.poses.quaternion_wxyz), XYZW)
    with pytest.raises(TrackError, match=r"neither /ground_truth/odom nor.*; set drive\.topic to one of /mavros/odom"):
        read_track_file(DriveConfig(track=str(tmp_path / "drone")))

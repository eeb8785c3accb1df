# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The human-readable form, read by NumPy, Pillow and PyYAML, against the bag, read by rosbags' own reader."""

import io
import struct
from collections.abc import Callable
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from export_bags import bag_of, copied, longer, peak_memory, without
from numpy.typing import NDArray
from PIL import Image
from rosbags.highlevel import AnyReader

from fieldtruth.classes import PALETTE
from fieldtruth.cli import main
from fieldtruth.errors import OutputError
from fieldtruth.export import Options, export, files
from fieldtruth.export.label_map import LabelMap, OtherClass
from fieldtruth.export.text_files import points_csv
from fieldtruth.record import ros
from fieldtruth.record.run import open_run
from fieldtruth.record.stored import BagError
from fieldtruth.report.progress import Silent

SIDES = ("left", "right")
CAMERA = "/stereo/camera/{}/{}"
POINTS = "/os1_cloud_node/points"
IMU = "/imu/data"
MODELS = "/gazebo/model_states"
ODOMETRY = "/ground_truth/odom"
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
FOLDERS = ("img_{}", "img_{}_tag", "depth_{}", "depth_{}_raw", "instances_{}")
ONCE = {
    "README.txt", "calibration.yaml", "data_proportion.xlsx", "instances.csv", "lidar", "imu_data.txt", "GNSS_data.txt",
    "tacho_data", "pose_ground_truth.txt",
}  # fmt: skip
OTHER = LabelMap(
    "other",
    (200 + np.arange(16)).astype(np.uint8),
    {200 + k: OtherClass(f"thing {k}", (k, 255 - k, 7 * k)) for k in range(16)},
)

Messages = list[tuple[int, Any]]


@pytest.fixture(scope="module")
def bag(small_run: Path) -> Path:
    return small_run / "park_1.bag"


@pytest.fixture(scope="module")
def made(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(small_run, "files", out=tmp_path_factory.mktemp("files") / "park_1", workers=2)


@pytest.fixture(scope="module")
def read(bag: Path) -> Callable[[str], Messages]:
    @cache
    def messages(topic: str) -> Messages:
        with AnyReader([bag]) as reader:
            chosen = [connection for connection in reader.connections if connection.topic == topic]
            return [(t, reader.deserialize(raw, c.msgtype)) for c, t, raw in reader.messages(connections=chosen)]

    return messages


def header_ns(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def table(path: Path) -> tuple[list[int], NDArray[np.float64]]:
    """Stamps, as whole numbers, and the columns behind them."""
    rows = np.loadtxt(path, dtype=str, ndmin=2)
    return [int(stamp) for stamp in rows[:, 0]], rows[:, 1:].astype(np.float64)


def names(folder: Path, ending: str) -> list[int]:
    paths = list(folder.iterdir())
    assert {path.suffix for path in paths} == {ending}
    return sorted(int(path.stem) for path in paths)


def picture(path: Path) -> NDArray[Any]:
    with Image.open(path) as image:
        return np.asarray(image)


# ---------------------------------------------------------------------------------------------------------------------
# What is there


def test_all_of_the_papers_files_are_there_and_no_others(made: Path) -> None:
    assert {path.name for path in made.iterdir()} == ONCE | {name.format(side) for name in FOLDERS for side in SIDES}
    assert {path.name for path in (made / "tacho_data").iterdir()} == {f"{wheel}.txt" for wheel in WHEELS}


def test_names_are_the_stamps_of_the_headers(made: Path, read: Callable[[str], Messages]) -> None:
    for side in SIDES:
        for topic, folder, ending in (
            ("real/compressed", f"img_{side}", ".png"),
            ("tag/img_raw", f"img_{side}_tag", ".png"),
            ("depth", f"depth_{side}", ".png"),
            ("depth", f"depth_{side}_raw", ".npy"),
            ("instances", f"instances_{side}", ".png"),
        ):
            stamps = [header_ns(m) for _, m in read(CAMERA.format(side, topic))]
            assert stamps
            assert names(made / folder, ending) == stamps
    assert names(made / "lidar", ".csv") == [header_ns(m) for _, m in read(POINTS)]


def test_one_worker_and_two_make_the_same_bytes(small_run: Path, made: Path, tmp_path: Path) -> None:
    again = export(small_run, "files", out=tmp_path / "again", workers=1)
    paths = sorted(path.relative_to(made) for path in made.rglob("*") if path.is_file())
    assert paths == sorted(path.relative_to(again) for path in again.rglob("*") if path.is_file())
    assert [path for path in paths if (made / path).read_bytes() != (again / path).read_bytes()] == []


# ---------------------------------------------------------------------------------------------------------------------
# Images


@pytest.mark.parametrize("side", SIDES)
def test_photographs_are_those_of_the_bag(made: Path, read: Callable[[str], Messages], side: str) -> None:
    for _, message in read(CAMERA.format(side, "real/compressed"))[::10]:
        with Image.open(io.BytesIO(message.data.tobytes())) as jpeg:
            expected = np.asarray(jpeg)
        assert np.array_equal(picture(made / f"img_{side}" / f"{header_ns(message)}.png"), expected)


@pytest.mark.parametrize("side", SIDES)
def test_tags_and_instances_are_those_of_the_bag(made: Path, read: Callable[[str], Messages], side: str) -> None:
    for _, message in read(CAMERA.format(side, "tag/img_raw")):
        expected = message.data.reshape(message.height, message.width, 3)
        assert np.array_equal(picture(made / f"img_{side}_tag" / f"{header_ns(message)}.png"), expected)
    for _, message in read(CAMERA.format(side, "instances"))[::5]:
        ids = message.data.view("<u2").reshape(message.height, message.width)
        assert ids.max() > 1
        assert np.array_equal(picture(made / f"instances_{side}" / f"{header_ns(message)}.png"), ids)


@pytest.mark.parametrize("side", SIDES)
def test_depth_is_in_millimetres_and_raw(made: Path, read: Callable[[str], Messages], side: str) -> None:
    for _, message in read(CAMERA.format(side, "depth"))[::10]:
        metres = message.data.view("<f4").reshape(message.height, message.width)
        raw = np.load(made / f"depth_{side}_raw" / f"{header_ns(message)}.npy", allow_pickle=False)
        assert raw.dtype == np.float32
        assert raw.tobytes() == metres.tobytes()
        millimetres = picture(made / f"depth_{side}" / f"{header_ns(message)}.png")
        assert millimetres.dtype == np.uint16
        near = metres.astype(np.float64) < 65.5355
        assert near.any()
        assert not near.all()
        assert np.abs(millimetres[near] - 1000.0 * metres[near].astype(np.float64)).max() <= 0.5
        assert not millimetres[~near].any()


def test_depth_ends_at_65_535_m(tmp_path: Path, read: Callable[[str], Messages]) -> None:
    message = deepcopy(read(CAMERA.format("left", "depth"))[0][1])
    metres = np.array([0.0, 0.001, 1.2344, 1.2346, 65.535, 65.5354, 65.5356, 70.0, np.inf, np.nan, -1.0], "<f4")
    message.height, message.width, message.step = 1, len(metres), 4 * len(metres)
    message.data = metres.view(np.uint8)
    stamp = header_ns(message)
    found = export(bag_of(tmp_path / "d.bag", [(CAMERA.format("left", "depth"), stamp, message)]), "files")
    expected = [[0, 1, 1234, 1235, 65535, 65535, 0, 0, 0, 0, 0]]
    assert picture(found / "depth_left" / f"{stamp}.png").tolist() == expected
    assert np.load(found / "depth_left_raw" / f"{stamp}.npy").tobytes() == metres.tobytes()


def test_objects_have_the_names_of_the_model_states(made: Path, read: Callable[[str], Messages]) -> None:
    lines = (made / "instances.csv").read_text().splitlines()
    assert lines == [f"{k},{name}" for k, name in enumerate(read(MODELS)[0][1].name)]
    assert lines[0] == "0,husky"


# ---------------------------------------------------------------------------------------------------------------------
# Clouds


def cloud_columns(message: Any) -> NDArray[np.float32]:
    """x, y, z, intensity of a cloud, point by point at the offsets that it tells."""
    offsets = [field.offset for name in ("x", "y", "z", "intensity") for field in message.fields if field.name == name]
    data, step = message.data.tobytes(), message.point_step
    rows = [[struct.unpack_from("<f", data, k * step + at)[0] for at in offsets] for k in range(message.width)]
    return np.array(rows, np.float32)


def test_clouds_come_back_to_the_last_bit(made: Path, read: Callable[[str], Messages]) -> None:
    for _, message in read(POINTS)[::5]:
        path = made / "lidar" / f"{header_ns(message)}.csv"
        back = np.loadtxt(path, delimiter=",", dtype=np.float32)
        assert back.shape == (message.width, 4)
        assert back.tobytes() == cloud_columns(message).tobytes()
        lines = path.read_text().splitlines()
        assert {line.count(",") for line in lines} == {3}
        assert {line.rsplit(",", 1)[1] for line in lines} <= {str(k) for k in range(1, 14)}


def test_a_float_of_every_size_is_read_back() -> None:
    rng = np.random.default_rng(0)
    bits = rng.integers(0, 2**32, (5000, 4), dtype=np.uint32)
    special = np.array([[0x80000000, 1, 0x007FFFFF, 0x00800000], [0x7F7FFFFF, 0xFF7FFFFF, 0x3F800000, 0]], np.uint32)
    values = np.vstack([special, bits]).view(np.float32)
    values = values[np.isfinite(values).all(axis=1)]
    text = points_csv(values)
    back = np.loadtxt(io.BytesIO(text), delimiter=",", dtype=np.float32)
    assert back.tobytes() == values.tobytes()
    exact = [[np.float32(number) for number in line.split(",")] for line in text.decode().splitlines()]
    assert np.array(exact, np.float32).tobytes() == values.tobytes()


def test_lines_of_a_cloud() -> None:
    points = np.array([[1.5, -0.25, 3.0, 7.0], [0.1, 100.0, -2.0, 10.0], [0.0, 1e-9, 1e20, 2.5]], np.float32)
    assert points_csv(points) == b"1.5,-0.25,3.0,7\n0.1,100.0,-2.0,10\n0.0,1e-9,1e+20,2.5\n"
    assert points_csv(points[:0]) == b""
    assert points_csv(np.array([[1.0, 2.0, 3.0, np.nan]], np.float32)) == b"1.0,2.0,3.0,nan\n"


# ---------------------------------------------------------------------------------------------------------------------
# Lines


def test_imu(made: Path, read: Callable[[str], Messages]) -> None:
    stamps, values = table(made / "imu_data.txt")
    expected = [
        (q.x, q.y, q.z, q.w, w.x, w.y, w.z, a.x, a.y, a.z)
        for m in (m for _, m in read(IMU))
        for q, w, a in [(m.orientation, m.angular_velocity, m.linear_acceleration)]
    ]
    assert stamps == [header_ns(m) for _, m in read(IMU)]
    assert values.tolist() == [list(row) for row in expected]


def test_gnss(made: Path, read: Callable[[str], Messages]) -> None:
    stamps, values = table(made / "GNSS_data.txt")
    fixes = [m for _, m in read("/navsat/fix")]
    assert stamps == [header_ns(m) for m in fixes]
    assert values.tolist() == [[m.latitude, m.longitude, m.altitude] for m in fixes]
    assert values[0] == pytest.approx([49.9, 8.9, 0.75], abs=0.01)


def test_each_wheel_has_its_own_file(made: Path, read: Callable[[str], Messages]) -> None:
    speeds = {}
    for wheel in WHEELS:
        stamps, values = table(made / "tacho_data" / f"{wheel}.txt")
        messages = read(f"/gazebo_client/{wheel}_speed")
        assert stamps == [stamp for stamp, _ in messages]
        assert values.shape == (len(stamps), 1)
        assert values[:, 0].astype(np.float32).tolist() == [m.data for _, m in messages]
        speeds[wheel] = tuple(values[:, 0])
    assert len(set(speeds.values())) == 4


def test_poses_are_those_of_the_robot_at_1000_hz(made: Path, read: Callable[[str], Messages]) -> None:
    stamps, values = table(made / "pose_ground_truth.txt")
    messages = read(MODELS)
    row = messages[0][1].name.index("husky")
    poses = [m.pose[row] for _, m in messages]
    expected = [[p.position.x, p.position.y, p.position.z] for p in poses]
    turns = [[q.x, q.y, q.z, q.w] for q in (p.orientation for p in poses)]
    assert stamps == [stamp for stamp, _ in messages]
    assert set(np.diff(stamps)) == {1_000_000}
    assert values.tolist() == np.hstack([expected, turns]).tolist()


def test_without_model_states_poses_are_those_of_the_odometry(
    bag: Path, tmp_path: Path, read: Callable[[str], Messages]
) -> None:
    images = [CAMERA.format(side, name) for side in SIDES for name in ("real/compressed", "tag/img_raw", "depth")]
    found = export(without(bag, tmp_path / "bag" / "b.bag", MODELS, *images), "files", out=tmp_path / "found")
    stamps, values = table(found / "pose_ground_truth.txt")
    messages = [m for _, m in read(ODOMETRY)]
    assert stamps == [header_ns(m) for m in messages]
    poses = [m.pose.pose for m in messages]
    assert values[:, :3].tolist() == [[p.position.x, p.position.y, p.position.z] for p in poses]
    assert values[:, 3:].tolist() == [[q.x, q.y, q.z, q.w] for q in (p.orientation for p in poses)]
    assert not (found / "instances.csv").exists()


# ---------------------------------------------------------------------------------------------------------------------
# Calibration and README


def test_calibration(made: Path, read: Callable[[str], Messages]) -> None:
    found = yaml.safe_load((made / "calibration.yaml").read_text())
    for side in SIDES:
        info, camera = read(CAMERA.format(side, "camera_info"))[0][1], found["cameras"][side]
        assert (camera["width"], camera["height"]) == (info.width, info.height) == (320, 184)
        for name, shape in (("K", (3, 3)), ("R", (3, 3)), ("P", (3, 4)), ("D", (5,))):
            assert np.reshape(getattr(info, name), shape).tolist() == camera[name]
        assert camera["frame"] == f"{side}_camera_optical"
    assert found["baseline_m"] == pytest.approx(0.12, abs=1e-12)
    poses = {name: np.array(frame["base_link_from_frame"]) for name, frame in found["frames"].items()}
    ahead = np.array([0.0, 0.0, 2.0, 1.0])  # in optical frames; in base_link that is along x
    assert np.allclose(poses["left_camera_optical"] @ ahead, [2.15, 0.06, 0.72, 1.0], atol=1e-9)
    assert np.allclose(poses["right_camera_optical"] @ ahead, [2.15, -0.06, 0.72, 1.0], atol=1e-9)
    assert found["frames"]["os1_lidar"]["translation"] == [0.09, 0.0, 0.826]
    assert found["frames"]["GNSS_link"]["translation"] == [0.1, 0.0, 0.89]
    imu = found["frames"]["imu_link"]
    assert np.allclose(imu["quaternion_xyzw"], np.array([1, 0, 1, 0]) / 2**0.5, atol=1e-9)
    assert len(poses) == 12


def test_the_readme_names_every_file_and_the_columns_are_as_many_as_it_says(made: Path) -> None:
    text = (made / "README.txt").read_text()
    for name in {path.name for path in made.iterdir()} - {"README.txt"}:
        assert name in text
    lines = [line.split(maxsplit=1) for line in text.splitlines() if " t_ns " in line]
    assert len(lines) == 7
    for name, columns in lines:
        assert len(columns.split()) == np.loadtxt(made / name, ndmin=2).shape[1]
    assert "Not here" not in text
    assert max(map(len, text.splitlines())) <= 120


def test_what_the_bag_lacks_is_left_out_and_told(bag: Path, tmp_path: Path) -> None:
    images = [CAMERA.format(side, name) for side in SIDES for name in ("real/compressed", "tag/img_raw", "depth",
                                                                       "instances", "camera_info")]  # fmt: skip
    lean = without(bag, tmp_path / "b.bag", "/tf_static", "/navsat/fix", MODELS, ODOMETRY, *images)
    found = export(lean, "files", out=tmp_path / "found")
    assert {path.name for path in found.iterdir()} == {
        "README.txt", "lidar", "imu_data.txt", "tacho_data", "data_proportion.xlsx"
    }  # fmt: skip
    missing = (found / "README.txt").read_text().partition("Not here")[2]
    for name in (
        "img_left/",
        "img_right_tag/",
        "depth_left/",
        "instances_right/",
        "GNSS_data.txt",
        "pose_ground_truth",
    ):
        assert name in missing
    assert "lidar/" not in missing


# ---------------------------------------------------------------------------------------------------------------------
# Labels of another ontology


def test_labels_of_another_ontology(small_run: Path, made: Path, tmp_path: Path) -> None:
    target = tmp_path / "mapped"
    files.write([open_run(small_run)], target, Options(OTHER, 2, Silent()))
    for side in SIDES:
        assert names(target / f"img_{side}_label_id", ".png") == names(made / f"img_{side}_tag", ".png")
        for path in list((made / f"img_{side}_tag").iterdir())[::10]:
            tag = picture(path)
            ids = picture(target / f"img_{side}_label_id" / path.name)
            assert ids.dtype == np.uint8
            assert ids.shape == tag.shape[:2]
            assert np.array_equal(PALETTE[ids - 200], tag)
            colours = picture(target / f"img_{side}_label_color" / path.name).astype(int)
            k = ids.astype(int) - 200
            assert np.array_equal(colours, np.stack([k, 255 - k, 7 * k], axis=-1))
            assert len(np.unique(k)) > 3
    for path in (made / "lidar").iterdir():
        reflectivity = np.loadtxt(path, delimiter=",", usecols=3)
        label = np.fromfile(target / "lidar_label" / f"{path.stem}.label", "<u4")
        assert np.array_equal(label, 200 + reflectivity)
    text = (target / "README.txt").read_text()
    assert "205 thing 5, colour 5 250 35" in text
    plain = {path.relative_to(made) for path in made.rglob("*") if path.suffix in (".png", ".csv", ".npy")}
    assert all((target / path).read_bytes() == (made / path).read_bytes() for path in plain)


# ---------------------------------------------------------------------------------------------------------------------
# Other bags


def test_a_stamp_of_0_gives_way_to_the_bags_and_equal_stamps_are_refused(bag: Path, tmp_path: Path) -> None:
    topic = CAMERA.format("left", "tag/img_raw")

    def stamped(path: Path, stamp_ns: int) -> Path:
        stamp = struct.pack("<2L", *divmod(stamp_ns, 10**9))
        return copied(bag, path, lambda t, _, data: data[:4] + stamp + data[12:] if t == topic else None)

    found = export(stamped(tmp_path / "zero.bag", 0), "files", out=tmp_path / "found")
    assert names(found / "img_left_tag", ".png") == [40_000_000 * k for k in range(1, 31)]
    with pytest.raises(BagError, match=r"tag/img_raw has two messages with the stamp 5000000003 ns"):
        export(stamped(tmp_path / "same.bag", 5_000_000_003), "files", out=tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_points_without_a_place_are_no_returns(tmp_path: Path, read: Callable[[str], Messages]) -> None:
    message = deepcopy(read(POINTS)[0][1])
    data = message.data.copy().reshape(message.width, message.point_step)
    data[[0, 7], 4:8] = np.frombuffer(np.array([np.nan, -np.inf], "<f4").tobytes(), np.uint8).reshape(2, 4)
    message.data = data.reshape(-1)
    found = export(bag_of(tmp_path / "b.bag", [(POINTS, 5, message)]), "files")
    back = np.loadtxt(found / "lidar" / f"{header_ns(message)}.csv", delimiter=",", dtype=np.float32)
    assert back.tobytes() == np.delete(cloud_columns(message), [0, 7], axis=0).tobytes()


def test_a_cloud_without_points_is_an_empty_file(tmp_path: Path, read: Callable[[str], Messages]) -> None:
    message = deepcopy(read(POINTS)[0][1])
    message.width, message.row_step, message.data = 0, 0, message.data[:0]
    found = export(bag_of(tmp_path / "b.bag", [(POINTS, 5, message)]), "files")
    assert (found / "lidar" / f"{header_ns(message)}.csv").read_bytes() == b""
    assert not (found / "data_proportion.xlsx").exists()


def bad_colour(data: bytes) -> bytes:
    return data[:-3] + bytes([1, 2, 3])


def cut_short(data: bytes) -> bytes:
    return data[:-100]


@pytest.mark.parametrize(
    ("topic", "change", "words"),
    [
        (CAMERA.format("right", "tag/img_raw"), bad_colour, "at 40000000 ns: tag image: pixel in row 183, column 319"),
        (
            CAMERA.format("left", "real/compressed"),
            cut_short,
            "the message of .*/left/real/compressed at 40000000 ns is",
        ),
        (POINTS, cut_short, "the message of /os1_cloud_node/points at 100000000 ns is damaged"),
        (MODELS, cut_short, "a message of /gazebo/model_states is damaged"),
        (IMU, cut_short, "the message of /imu/data at 20000000 ns is damaged"),
    ],
)
def test_damage_is_one_line_that_names_the_place(
    bag: Path, tmp_path: Path, topic: str, change: Callable[[bytes], bytes], words: str
) -> None:
    def hand_on(name: str, _: int, data: bytes) -> bytes | None:
        return change(data) if name == topic else data if name == "/navsat/fix" else None

    with pytest.raises(BagError, match=words):
        export(copied(bag, tmp_path / "wrong.bag", hand_on), "files", out=tmp_path / "none")
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.bag"]


def test_a_bag_without_a_sensor_is_refused(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lean = copied(bag, tmp_path / "b.bag", lambda topic, _, data: data if topic in ("/clock", ODOMETRY) else None)
    assert main(["export", str(lean), "--to", "files", "--out", str(tmp_path / "none")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "has no sensor's messages" in error
    assert "it has: /clock, /ground_truth/odom" in error
    assert not (tmp_path / "none").exists()


def test_a_topic_of_another_type_is_refused(tmp_path: Path) -> None:
    clock = ros.STORE.types["std_msgs/msg/Float32"](1.0)
    wrong = bag_of(tmp_path / "b.bag", [(IMU, 5, clock)])
    with pytest.raises(BagError, match=r"/imu/data of .* is std_msgs/msg/Float32; needed is sensor_msgs/msg/Imu"):
        export(wrong, "files")


def test_what_is_there_already_stays(small_run: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")
    with pytest.raises(OutputError, match="is there already"):
        export(small_run, "files", out=tmp_path / "mine")
    assert [path.name for path in tmp_path.rglob("*")] == ["mine", "notes.txt"]


def test_memory_does_not_grow_with_the_bag(bag: Path, tmp_path: Path) -> None:
    topics = (CAMERA.format("left", "tag/img_raw"), IMU)
    bags = [longer(bag, tmp_path / f"{times}.bag", times, topics, ()) for times in (1, 4)]
    peaks = [peak_memory(lambda path=path: export(path, "files", workers=1)) for path in bags]  # type: ignore[misc]
    assert len(list((tmp_path / "4_files" / "img_left_tag").iterdir())) == 120
    assert peaks[1] < 1.2 * peaks[0] + 1e6

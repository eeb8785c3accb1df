# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Every format has the sensors of a rig with many of them: each under its name, with the values of its own topics."""

import io
import json
import tarfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pyarrow.parquet as pq
import pytest
import simplejpeg
import yaml
from export_bags import copied, without
from files_reader import cloud_columns, header_ns, messages, names, read_image, table
from many_recording import with_sensors
from many_sensors import many_rig
from mcap.reader import make_reader
from pypcd4.pypcd4 import PointCloud

from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.file import BagError
from fieldtruth.exporters import export
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.lidar.config import LidarConfig

RIG = many_rig()
TOPICS = {imager.name: imager.topic for imager in RIG.imagers}
CAMERAS = ("pair_left", "pair_right", "front", "rear", "fisheye", "panorama")
CLOUDS = {lidar.name: lidar.topic for lidar in RIG.enabled(LidarConfig)}


@pytest.fixture(scope="module")
def made(faked_many_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Export of the run in a format, made once."""
    folder, done = tmp_path_factory.mktemp("many_exports"), dict[str, Path]()

    def once(to: str) -> Path:
        return done[to] if to in done else done.setdefault(to, export(faked_many_run, to, out=folder / to, workers=2))

    return once


@pytest.fixture(scope="module")
def bag(faked_many_run: Path) -> Path:
    return faked_many_run / "many.bag"


def stamps(bag: Path, topic: str) -> list[int]:
    return [header_ns(message) for _, message in messages(bag, topic)]


def photographs(bag: Path, camera: str) -> dict[int, bytes]:
    """JPEG by stamp."""
    return {header_ns(m): m.data.tobytes() for _, m in messages(bag, f"{TOPICS[camera]}/real/compressed")}


def test_run_has_sensors_at_different_rates(bag: Path) -> None:
    counts = {name: len(stamps(bag, topic)) for name, topic in CLOUDS.items()}
    assert counts == {"top": 6, "low": 12}
    assert {camera: len(photographs(bag, camera)) for camera in CAMERAS} == dict.fromkeys(CAMERAS, 3) | {"rear": 6}


# ---------------------------------------------------------------------------------------------------------------------
# files


def test_files_has_folders_of_every_camera(made: Callable[[str], Path], bag: Path) -> None:
    folder = made("files")
    assert {path.name.removeprefix("img_").removesuffix("_tag") for path in folder.glob("img_*")} == {*CAMERAS}
    depths = {"depth_pair_left", "depth_pair_right", "depth_rear"}
    assert {path.name.removesuffix("_raw") for path in folder.glob("depth_*")} == depths
    assert [path.name for path in folder.glob("instances_*")] == ["instances_front"]
    for camera in CAMERAS:
        for stamp, jpeg in photographs(bag, camera).items():
            photo = read_image(folder / f"img_{camera}" / f"{stamp}.png")
            np.testing.assert_array_equal(photo, simplejpeg.decode_jpeg(jpeg, "RGB"))
        for _, tag in messages(bag, f"{TOPICS[camera]}/tag/img_raw"):
            colours = read_image(folder / f"img_{camera}_tag" / f"{header_ns(tag)}.png")
            assert colours.tobytes() == tag.data.tobytes()


def test_files_has_clouds_and_readings_of_every_sensor(made: Callable[[str], Path], bag: Path) -> None:
    folder = made("files")
    for name, topic in CLOUDS.items():
        assert names(folder / name, ".csv") == stamps(bag, topic)
        for _, cloud in messages(bag, topic):
            rows = np.loadtxt(folder / name / f"{header_ns(cloud)}.csv", delimiter=",", dtype=np.float32)
            np.testing.assert_array_equal(rows, cloud_columns(cloud))
    for name in ("imu_front", "imu_rear"):
        at, values = table(folder / f"{name}_data.txt")
        forces = [m.linear_acceleration for _, m in messages(bag, f"/{name}/data")]
        assert at == stamps(bag, f"/{name}/data")
        np.testing.assert_array_equal(values[:, 7:], [(f.x, f.y, f.z) for f in forces])
    for name in ("antenna_left", "antenna_right"):
        at, values = table(folder / f"{name}_data.txt")
        fixes = [(m.latitude, m.longitude, m.altitude) for _, m in messages(bag, f"/{name}/fix")]
        assert at == stamps(bag, f"/{name}/fix")
        np.testing.assert_array_equal(values, fixes)


def test_files_describe_every_sensor(made: Callable[[str], Path], bag: Path) -> None:
    folder = made("files")
    text = " ".join((folder / "README.txt").read_text(encoding="utf-8").split())
    assert "metres in low_link (x forward" in text
    assert "both in imu_rear_link" in text
    assert "antenna (antenna_right_link)" in text
    assert "depth_front/ (/front/depth)" in text.partition("Missing")[2]
    assert "stereo" not in text
    calibration = yaml.safe_load((folder / "calibration.yaml").read_text(encoding="utf-8"))
    assert tuple(calibration["cameras"]) == CAMERAS
    assert calibration["baseline_m"] == pytest.approx(0.1)
    assert {"top_link", "low_link", "imu_front_link", "antenna_left_link"} < set(calibration["frames"])
    sheet = openpyxl.load_workbook(folder / "data_proportion.xlsx")["class shares"]
    titles = [cell.value for cell in sheet[1] if cell.value]
    cameras = [f"pixels, {camera} camera" for camera in CAMERAS]
    assert titles == [*cameras, "pixels, all cameras", "points, top LiDAR", "points, low LiDAR", "points, both LiDARs"]
    total = {title: sheet.cell(sheet.max_row, 4 + 2 * k).value for k, title in enumerate(titles)}
    assert total["pixels, all cameras"] == sum(total[name] for name in cameras) == 21 * 160 * 96
    assert total["points, both LiDARs"] == sum(
        len(cloud_columns(m)) for t in CLOUDS.values() for _, m in messages(bag, t)
    )


def test_two_sensors_with_one_path_are_refused(faked_many_run: Path, tmp_path: Path) -> None:
    run = with_sensors(faked_many_run, tmp_path / "many", "top", "front")
    text = (run / "experiment.yaml").read_text()
    (run / "experiment.yaml").write_text(text.replace("name: top", "name: img_front"))
    with pytest.raises(BagError, match="two sensors of the rig would have the same path img_front"):
        export(run, "files")


# ---------------------------------------------------------------------------------------------------------------------
# mcap, pcd, coco


def test_mcap_has_every_message(made: Callable[[str], Path], bag: Path) -> None:
    with made("mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = {c.topic: summary.statistics.channel_message_counts[c.id] for c in summary.channels.values()}
    assert counts == count_messages(bag)
    assert (counts[CLOUDS["low"]], counts["/imu_rear/data"]) == (12, 60)


def test_pcd_has_a_folder_per_lidar(made: Callable[[str], Path], bag: Path) -> None:
    folder = made("pcd")
    assert sorted(path.name for path in folder.iterdir()) == ["README.md", "low", "top"]
    assert "in folders of their names: `top/`, `low/`" in (folder / "README.md").read_text()
    for name, topic in CLOUDS.items():
        for _, cloud in messages(bag, topic):
            read = PointCloud.from_path(folder / name / f"{header_ns(cloud)}.pcd")
            np.testing.assert_array_equal(read.numpy(("x", "y", "z")), cloud_columns(cloud)[:, :3])
            assert ("t" in read.fields) == (name == "low")  # only this one spins
    top, low = (PointCloud.from_path(folder / name / "300000000.pcd").metadata.viewpoint for name in ("top", "low"))
    base_from = [RIG.mounts()[frame].base_from_sensor[:3, 3] for frame in ("top_link", "low_link")]
    apart = float(np.linalg.norm(np.subtract(top[:3], low[:3])))
    assert apart == pytest.approx(float(np.linalg.norm(np.subtract(*base_from))))


def test_coco_has_the_cameras_with_instances(made: Callable[[str], Path], bag: Path) -> None:
    folder = made("coco")
    document = json.loads((folder / "panoptic.json").read_text())
    assert [image["file_name"] for image in document["images"]] == [f"front/{t}.jpg" for t in photographs(bag, "front")]
    for stamp, jpeg in photographs(bag, "front").items():
        assert (folder / "images" / "front" / f"{stamp}.jpg").read_bytes() == jpeg


# ---------------------------------------------------------------------------------------------------------------------
# Data sets of many runs


def test_mmseg_has_every_image(made: Callable[[str], Path], bag: Path) -> None:
    folder = made("mmseg")
    expected = {f"many_{camera}_{t:019d}": jpeg for camera in CAMERAS for t, jpeg in photographs(bag, camera).items()}
    assert {path.stem: path.read_bytes() for path in folder.glob("img_dir/train/*.jpg")} == expected
    assert {path.stem for path in folder.glob("ann_dir/train/*.png")} == set(expected)


def samples(path: Path) -> dict[int, dict[str, bytes]]:
    """Members of each sample by its stamp."""
    found: dict[int, dict[str, bytes]] = {}
    with tarfile.open(path) as tar:
        for member in tar:
            key, _, extension = member.name.partition(".")
            stream = tar.extractfile(member)
            assert stream is not None
            found.setdefault(int(key.rpartition("_")[2]), {})[extension] = stream.read()
    return found


def test_webdataset_has_every_image_and_cloud(made: Callable[[str], Path], bag: Path) -> None:
    folder = made("webdataset")
    described = json.loads((folder / "dataset.json").read_text())
    (row,) = described["runs"]
    assert row["cameras"] == [*CAMERAS]
    counts = {"frames": 3, "frames_rear": 6, "clouds_low": 12, "clouds_top": 6}
    assert {key: value for key, value in row.items() if key.startswith(("frames", "clouds"))} == counts
    assert {shard["content"]: shard["samples"] for shard in described["shards"]} == counts
    frames = samples(folder / "train-000000.tar")
    for camera in CAMERAS:
        read = samples(folder / "frames_rear-train-000000.tar") if camera == "rear" else frames
        assert {t: parts[f"{camera}.jpg"] for t, parts in read.items()} == photographs(bag, camera)
    for parts in frames.values():
        about = json.loads(parts["json"])
        assert tuple(about["cameras"]) == CAMERAS
        assert tuple(about["lidars"]) == ("top", "low")
        assert "lidar" not in about
        assert about["cameras"]["fisheye"]["distortion_model"] == "equidistant"
        mount = RIG.mounts()["low_link"].base_from_sensor
        np.testing.assert_allclose(about["lidars"]["low"]["base_from_lidar"], mount, atol=1e-12)
    for name, topic in CLOUDS.items():
        clouds = samples(folder / f"clouds_{name}-train-000000.tar")
        for _, message in messages(bag, topic):
            with np.load(io.BytesIO(clouds[header_ns(message)][f"{name}.cloud.npz"])) as cloud:
                np.testing.assert_array_equal(cloud["xyz"], cloud_columns(message)[:, :3])


def test_samples_without_a_cloud_have_an_empty_one(faked_many_run: Path, bag: Path, tmp_path: Path) -> None:
    """The cloud of one LiDAR at 0.4 s is missing; all samples still have the same members."""
    dropped = messages(bag, CLOUDS["top"])[3][0]
    assert dropped == 400_000_000
    run = with_sensors(faked_many_run, tmp_path / "many", "top", "low", "front")
    (run / "many.bag").unlink()
    copied(bag, run / "many.bag", lambda topic, t, data: None if (topic, t) == (CLOUDS["top"], dropped) else data)
    frames = samples(export(run, "webdataset") / "train-000000.tar")
    assert len({frozenset(parts) for parts in frames.values()}) == 1
    sizes = {}
    for stamp, parts in frames.items():
        with np.load(io.BytesIO(parts["top.cloud.npz"])) as cloud:
            sizes[stamp] = len(cloud["xyz"])
    assert [stamp for stamp, size in sizes.items() if not size] == [dropped]
    assert "top" not in json.loads(frames[dropped]["json"])["lidars"]


def test_cameras_without_a_common_stamp_have_files_of_their_own(
    faked_many_run: Path, bag: Path, tmp_path: Path
) -> None:
    run = with_sensors(faked_many_run, tmp_path / "many", "front", "rear")
    (run / "many.bag").unlink()

    def odd(topic: str, t: int, data: bytes) -> bytes | None:
        return None if topic.startswith("/rear/") and t % 200_000_000 == 0 and "info" not in topic else data

    copied(bag, run / "many.bag", odd)
    folder = export(run, "webdataset")
    assert sorted(path.name for path in folder.glob("*.tar")) == [
        "frames_front-train-000000.tar", "frames_rear-train-000000.tar",
    ]  # fmt: skip
    assert len(samples(folder / "frames_rear-train-000000.tar")) == 3


def test_huggingface_has_a_row_per_image_and_cloud(made: Callable[[str], Path], bag: Path) -> None:
    folder = made("huggingface")
    images = pq.read_table(folder / "images" / "train-00000-of-00001.parquet").to_pylist()
    expected = {(camera, t): jpeg for camera in CAMERAS for t, jpeg in photographs(bag, camera).items()}
    assert {(row["camera"], row["stamp_ns"]): row["image"]["bytes"] for row in images} == expected
    with_depth = Counter(row["camera"] for row in images if row["depth"] is not None)
    assert with_depth == {"pair_left": 3, "pair_right": 3, "rear": 6}
    lens = next(camera for camera in RIG.enabled(CameraConfig) if camera.name == "fisheye").lens
    fisheye = next(row for row in images if row["camera"] == "fisheye")
    assert (fisheye["distortion_model"], tuple(fisheye["D"])) == (lens.model, lens.coefficients)
    clouds = pq.read_table(folder / "clouds" / "train-00000-of-00001.parquet").to_pylist()
    assert Counter(row["lidar"] for row in clouds) == {"top": 6, "low": 12}
    for row in clouds:
        cloud = next(m for _, m in messages(bag, CLOUDS[row["lidar"]]) if header_ns(m) == row["stamp_ns"])
        np.testing.assert_array_equal(row["x"], cloud_columns(cloud)[:, 0])
        assert (row["t"] is not None) == (row["lidar"] == "low")
    document = json.loads((folder / "croissant.json").read_text())
    (clouds,) = (each for each in document["recordSet"] if each["name"] == "clouds")
    assert [key["@id"] for key in clouds["key"]] == ["clouds/run", "clouds/lidar", "clouds/stamp_ns"]


def test_card_does_not_promise_stereo(faked_many_run: Path, tmp_path: Path) -> None:
    folder = export(with_sensors(faked_many_run, tmp_path / "many", "top", "rear"), "huggingface")
    assert "\nPhotographs and LiDAR clouds of a ground robot" in (folder / "README.md").read_text()


# ---------------------------------------------------------------------------------------------------------------------
# kitti and semantickitti have one LiDAR and one pair


@pytest.mark.parametrize("to", ["kitti", "semantickitti"])
def test_sequences_have_the_first_lidar_and_the_first_pair(to: str, made: Callable[[str], Path], bag: Path) -> None:
    folder = made(to) / "sequences" / "00"
    numbered = {
        t: k for k, t in enumerate(stamps(bag, CLOUDS["top"]) if to == "semantickitti" else photographs(bag, "front"))
    }
    clouds = {header_ns(m): m for _, m in messages(bag, CLOUDS["top"])}
    for stamp, number in numbered.items():
        points = np.fromfile(folder / "velodyne" / f"{number:06d}.bin", "<f4").reshape(-1, 4)
        np.testing.assert_array_equal(points[:, :3], cloud_columns(clouds[stamp])[:, :3])
    for name, camera in (("image_2", "pair_left"), ("image_3", "pair_right")):
        for stamp, jpeg in photographs(bag, camera).items():
            photo = read_image(folder / name / f"{numbered[stamp]:06d}.png")
            np.testing.assert_array_equal(photo, simplejpeg.decode_jpeg(jpeg, "RGB"))
    calib = dict(line.split(":") for line in (folder / "calib.txt").read_text().splitlines())
    p2, p3 = (np.array(calib[name].split(), float).reshape(3, 4) for name in ("P2", "P3"))
    assert p3[0, 3] / p2[0, 0] == pytest.approx(-0.1)
    if to == "kitti":
        said = "many: LiDAR top, photographs of pair_left and pair_right."
        assert said in (made(to) / "README.md").read_text()
    else:
        sequence = yaml.safe_load((made(to) / "fieldtruth.yaml").read_text())["sequences"][0]
        assert (sequence["lidar"], sequence["cameras"]) == ("top", ["pair_left", "pair_right"])


def test_kitti_of_a_single_camera_has_it_as_the_left_one(faked_many_run: Path, bag: Path, tmp_path: Path) -> None:
    folder = export(with_sensors(faked_many_run, tmp_path / "many", "low", "rear"), "kitti")
    sequence = folder / "sequences" / "00"
    assert sorted(path.name for path in sequence.iterdir()) == ["calib.txt", "image_2", "times.txt", "velodyne"]
    assert len(list((sequence / "velodyne").iterdir())) == len(photographs(bag, "rear")) == 6
    calib = dict(line.split(":") for line in (sequence / "calib.txt").read_text().splitlines())
    assert calib["P3"] == calib["P2"]
    assert "many: LiDAR low, photographs of rear." in (folder / "README.md").read_text()


@pytest.mark.parametrize(
    ("to", "sensors", "words"),
    [
        ("kitti", ["top"], "has no camera, and KITTI's frames have photographs"),
        ("kitti", ["front"], "has no LiDAR, and this format is made of clouds"),
        ("kitti", ["top", "fisheye"], "have the lens 'equidistant'"),
        ("semantickitti", ["front"], "has no LiDAR, and this format is made of clouds"),
        ("pcd", ["front"], "has no LiDAR, and this format is made of clouds"),
        ("coco", ["top"], "has no camera, and COCO is made of photographs"),
        ("coco", ["rear"], "has no /rear/instances, the object of each pixel"),
        ("mmseg", ["top"], "has no camera; available: "),
        ("webdataset", ["imu_front"], "has no camera or LiDAR; available: "),
        ("huggingface", ["imu_front"], "has no camera or LiDAR; available: "),
    ],
)
def test_rig_without_what_a_format_needs_is_one_line(
    to: str, sensors: list[str], words: str, faked_many_run: Path, tmp_path: Path
) -> None:
    run = with_sensors(faked_many_run, tmp_path / "many", *sensors)
    with pytest.raises(BagError) as caught:
        export(run, to)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert sorted(path.name for path in run.iterdir()) == ["experiment.yaml", "many.bag"]


def test_instances_that_are_not_recorded_are_missed_where_the_rig_has_them(bag: Path, tmp_path: Path) -> None:
    """A bag without its experiment is read as one of the paper's rig, whose topics it lacks."""
    with pytest.raises(BagError, match="has no /stereo/camera/left/real/compressed"):
        export(without(bag, tmp_path / "a.bag", "/front/instances"), "coco")


def test_semantickitti_needs_no_camera(faked_many_run: Path, tmp_path: Path) -> None:
    folder = export(with_sensors(faked_many_run, tmp_path / "many", "low"), "semantickitti") / "sequences" / "00"
    assert len(list((folder / "velodyne").iterdir())) == 12
    assert not (folder / "image_2").exists()


@pytest.mark.parametrize("to", ["files", "mcap", "webdataset"])  # test_formats.py has all formats with two cameras
def test_output_does_not_depend_on_threads(
    to: str, made: Callable[[str], Path], faked_many_run: Path, tmp_path: Path
) -> None:
    other, first = export(faked_many_run, to, out=tmp_path / to, workers=1), made(to)

    def contents(path: Path) -> dict[str, Any]:
        files = [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file())
        return {str(each.relative_to(path)): each.read_bytes() for each in files}

    assert contents(other) == contents(first)

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Format ``files``: names, images and labels against the bag."""

import io
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from export_bags import bag_of
from files_reader import (
    MODELS,
    POINTS,
    SIDES,
    WHEELS,
    camera,
    header_ns,
    messages,
    names,
    read_image,
)
from PIL import Image

from fieldtruth.bag.run import open_run
from fieldtruth.core.classes import PALETTE
from fieldtruth.core.progress import Silent
from fieldtruth.exporters import Options, export, files
from fieldtruth.ontology import LabelMap, OntologyClass

FOLDERS = ("img_{}", "img_{}_tag", "depth_{}", "depth_{}_raw", "instances_{}")
ONCE = {
    "README.txt", "calibration.yaml", "data_proportion.xlsx", "instances.csv", "lidar", "imu_data.txt", "GNSS_data.txt",
    "tacho_data", "joint_states.txt", "wheel_odometry.txt", "commands.txt", "pose_ground_truth.txt",
}  # fmt: skip
OTHER = LabelMap(
    "other",
    (200 + np.arange(20)).astype(np.uint8),
    {200 + k: OntologyClass(f"class {k}", (k, 255 - k, 7 * k)) for k in range(20)},
)


@pytest.fixture(scope="module")
def made(exported: Callable[[str], Path]) -> Path:
    return exported("files")


# ---------------------------------------------------------------------------------------------------------------------
# Names


def test_folder_has_the_files_of_the_paper(made: Path) -> None:
    assert {path.name for path in made.iterdir()} == ONCE | {name.format(side) for name in FOLDERS for side in SIDES}
    assert {path.name for path in (made / "tacho_data").iterdir()} == {f"{wheel}.txt" for wheel in WHEELS}


def test_files_are_named_by_header_stamp(made: Path, bag: Path) -> None:
    for side in SIDES:
        for topic, folder, ending in (
            ("real/compressed", f"img_{side}", ".png"),
            ("tag/img_raw", f"img_{side}_tag", ".png"),
            ("depth", f"depth_{side}", ".png"),
            ("depth", f"depth_{side}_raw", ".npy"),
            ("instances", f"instances_{side}", ".png"),
        ):
            stamps = [header_ns(m) for _, m in messages(bag, camera(side, topic))]
            assert stamps
            assert names(made / folder, ending) == stamps
    assert names(made / "lidar", ".csv") == [header_ns(m) for _, m in messages(bag, POINTS)]


def test_bytes_do_not_depend_on_workers(small_run: Path, made: Path, tmp_path: Path) -> None:
    again = export(small_run, "files", out=tmp_path / "again", workers=1)
    paths = sorted(path.relative_to(made) for path in made.rglob("*") if path.is_file())
    assert paths == sorted(path.relative_to(again) for path in again.rglob("*") if path.is_file())
    assert [path for path in paths if (made / path).read_bytes() != (again / path).read_bytes()] == []


# ---------------------------------------------------------------------------------------------------------------------
# Images


@pytest.mark.parametrize("side", SIDES)
def test_photographs_match_the_bag(made: Path, bag: Path, side: str) -> None:
    for _, message in messages(bag, camera(side, "real/compressed"))[::10]:
        with Image.open(io.BytesIO(message.data.tobytes())) as jpeg:
            expected = np.asarray(jpeg)
        assert np.array_equal(read_image(made / f"img_{side}" / f"{header_ns(message)}.png"), expected)


@pytest.mark.parametrize("side", SIDES)
def test_tag_and_instance_images_match_the_bag(made: Path, bag: Path, side: str) -> None:
    for _, message in messages(bag, camera(side, "tag/img_raw")):
        expected = message.data.reshape(message.height, message.width, 3)
        assert np.array_equal(read_image(made / f"img_{side}_tag" / f"{header_ns(message)}.png"), expected)
    for _, message in messages(bag, camera(side, "instances"))[::5]:
        ids = message.data.view("<u2").reshape(message.height, message.width)
        assert ids.max() > 1
        assert np.array_equal(read_image(made / f"instances_{side}" / f"{header_ns(message)}.png"), ids)


@pytest.mark.parametrize("side", SIDES)
def test_depth_is_in_millimetres_and_in_metres(made: Path, bag: Path, side: str) -> None:
    for _, message in messages(bag, camera(side, "depth"))[::10]:
        metres = message.data.view("<f4").reshape(message.height, message.width)
        raw = np.load(made / f"depth_{side}_raw" / f"{header_ns(message)}.npy", allow_pickle=False)
        assert raw.dtype == np.float32
        assert raw.tobytes() == metres.tobytes()
        millimetres = read_image(made / f"depth_{side}" / f"{header_ns(message)}.png")
        assert millimetres.dtype == np.uint16
        near = metres.astype(np.float64) < 65.5355
        assert near.any()
        assert not near.all()
        assert np.abs(millimetres[near] - 1000.0 * metres[near].astype(np.float64)).max() <= 0.5
        assert not millimetres[~near].any()


def test_depth_above_65_535_m_is_0(tmp_path: Path, bag: Path) -> None:
    message = deepcopy(messages(bag, camera("left", "depth"))[0][1])
    metres = np.array([0.0, 0.001, 1.2344, 1.2346, 65.535, 65.5354, 65.5356, 70.0, np.inf, np.nan, -1.0], "<f4")
    message.height, message.width, message.step = 1, len(metres), 4 * len(metres)
    message.data = metres.view(np.uint8)
    stamp = header_ns(message)
    found = export(bag_of(tmp_path / "d.bag", [(camera("left", "depth"), stamp, message)]), "files")
    expected = [[0, 1, 1234, 1235, 65535, 65535, 0, 0, 0, 0, 0]]
    assert read_image(found / "depth_left" / f"{stamp}.png").tolist() == expected
    assert np.load(found / "depth_left_raw" / f"{stamp}.npy").tobytes() == metres.tobytes()


def test_object_names_match_model_states(made: Path, bag: Path) -> None:
    lines = (made / "instances.csv").read_text().splitlines()
    assert lines == [f"{k},{name}" for k, name in enumerate(messages(bag, MODELS, 40)[0][1].name)]
    assert lines[0] == "0,husky"


# ---------------------------------------------------------------------------------------------------------------------
# Labels of another ontology


def test_label_map_relabels(small_run: Path, made: Path, tmp_path: Path) -> None:
    target = tmp_path / "mapped"
    run = open_run(small_run)
    files.write([run], target, Options(OTHER.over(run.classes), 2, Silent()))
    for side in SIDES:
        assert names(target / f"img_{side}_label_id", ".png") == names(made / f"img_{side}_tag", ".png")
        for path in list((made / f"img_{side}_tag").iterdir())[::10]:
            tag = read_image(path)
            ids = read_image(target / f"img_{side}_label_id" / path.name)
            assert ids.dtype == np.uint8
            assert ids.shape == tag.shape[:2]
            assert np.array_equal(PALETTE[ids - 200], tag)
            colours = read_image(target / f"img_{side}_label_color" / path.name).astype(int)
            k = ids.astype(int) - 200
            assert np.array_equal(colours, np.stack([k, 255 - k, 7 * k], axis=-1))
            assert len(np.unique(k)) > 3
    for path in (made / "lidar").iterdir():
        reflectivity = np.loadtxt(path, delimiter=",", usecols=3)
        label = np.fromfile(target / "lidar_label" / f"{path.stem}.label", "<u4")
        assert np.array_equal(label, 200 + reflectivity)
    text = (target / "README.txt").read_text()
    assert "205 class 5, colour 5 250 35" in text
    plain = {path.relative_to(made) for path in made.rglob("*") if path.suffix in (".png", ".csv", ".npy")}
    assert all((target / path).read_bytes() == (made / path).read_bytes() for path in plain)

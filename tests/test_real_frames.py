# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readers of real frames: tiny files in each data set's layout, and mistakes in them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from real_frames import CLOUD_CLASSES, IGNORED, IMAGE_CLASSES, LAYOUTS, frames_of, of_names, of_own_classes

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.ontology import label_map_of

SKY, TRAIL, GRASS, VEGETATION, OBSTACLE = range(5)
GROUND, BUSH, TREE = range(3)


def write(file: Path, values: NDArray[Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(values).save(file)


def photo(file: Path, width: int = 3) -> None:
    write(file, np.full((2, width, 3), 90, np.uint8))


def colours(*rgb: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Labels of three columns, two rows."""
    return np.array([rgb, rgb], np.uint8)


def ids(*numbers: int) -> NDArray[np.uint8]:
    return np.array([numbers, numbers], np.uint8)


def ycor(folder: Path) -> None:
    photo(folder / "train/iid000007/rgb.jpg")
    write(folder / "train/iid000007/labels.png", colours((156, 76, 30), (0, 160, 0), (255, 255, 255)))


def rugd(folder: Path) -> None:
    photo(folder / "RUGD_frames-with-annotations/park-1/park-1_00001.png")
    labels = colours((108, 64, 20), (255, 153, 204), (0, 128, 255))  # dirt, bush, water
    write(folder / "RUGD_annotations/park-1/park-1_00001.png", labels)


def goose(folder: Path) -> None:
    name = "2022-07-22_flight/2022-07-22_flight__0001_1658"
    photo(folder / f"images/train/{name}_windshield_vis.png")
    write(folder / f"labels/train/{name}_labelids.png", ids(24, 27, 8))  # gravel, tree crown, ego vehicle
    write(folder / f"labels/train/{name}_color.png", ids(1, 1, 1))


def goose_ex(folder: Path) -> None:
    photo(folder / "images/val/spot_scenario1/a_0003_16_camera_left.png")
    write(folder / "labels/val/spot_scenario1/a_0003_16_labelids.png", ids(31, 17, 0))


def wildscenes(folder: Path) -> None:
    photo(folder / "WildScenes2d/K-01/image/1624326169-277052847.png")
    write(folder / "WildScenes2d/K-01/indexLabel/1624326169-277052847.png", ids(2, 8, 4))  # dirt, foliage, water


def rellis(folder: Path) -> None:
    photo(folder / "00000/pylon_camera_node/frame000000-1581624652_750.jpg")
    write(folder / "00000/pylon_camera_node_label_id/frame000000-1581624652_750.png", ids(33, 19, 6))


def rellis_example(folder: Path) -> None:
    photo(folder / "frame000104-1581624663_149.jpg")
    write(folder / "frame000104-1581624663_149.png", ids(1, 4, 0))


@pytest.mark.parametrize("make", [ycor, rugd, goose, goose_ex, wildscenes, rellis, rellis_example])
@pytest.mark.parametrize("named", [False, True])
def test_images_of_each_layout(make: Callable[[Path], None], named: bool, tmp_path: Path) -> None:
    make(tmp_path)
    name = make.__name__.partition("_")[0]
    frames = frames_of(tmp_path, name if named else "")
    assert (frames.layout.name, len(frames)) == (name, 1)
    image, mask = frames[0]
    assert image.shape == (2, 3, 3)
    assert image.dtype == np.uint8
    assert abs(int(image[0, 0, 0]) - 90) < 3
    assert mask.tolist() == [[TRAIL, VEGETATION, IGNORED]] * 2


def test_orfd_has_classes_that_are_merged(tmp_path: Path) -> None:
    photo(tmp_path / "training/y0613_1242/image_data/1623721491895.png")
    write(tmp_path / "training/y0613_1242/gt_image/1623721491895_fillcolor.png", ids(255, 0, 128))
    frames = frames_of(tmp_path)
    assert frames.layout.is_merged
    assert frames[0][1].tolist() == [[GRASS, VEGETATION, SKY]] * 2


@pytest.mark.parametrize(
    ("scan", "labels", "layout", "numbers", "expected"),
    [
        (
            "00000/os1_cloud_node_kitti_bin/000104.bin",
            "00000/os1_cloud_node_semantickitti_label_id/000104.label",
            "rellis-clouds",
            (3, 19, 4, 17),
            [GROUND, BUSH, TREE, IGNORED],
        ),
        ("000104.bin", "000104.label", "rellis-clouds", (23, 31, 0, 4), [GROUND, GROUND, IGNORED, TREE]),
        (
            "lidar/val/hills/hills__0000_167_vls128.bin",
            "labels/val/hills/hills__0000_167_goose.label",
            "goose-clouds",
            (50, 17, 28, 38),
            [GROUND, BUSH, TREE, IGNORED],
        ),
        (
            "sequences/08/velodyne/000001.bin",
            "sequences/08/labels/000001.label",
            "semantickitti",
            (72, 70, 71, 252),
            [GROUND, TREE, TREE, IGNORED],
        ),
    ],
)
def test_clouds(
    scan: str, labels: str, layout: str, numbers: tuple[int, ...], expected: list[int], tmp_path: Path
) -> None:
    points = np.arange(16, dtype=np.float32).reshape(4, 4)
    for name in (scan, labels):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    points.tofile(tmp_path / scan)
    (np.array(numbers, np.uint32) | 5 << 16).tofile(tmp_path / labels)
    frames = frames_of(tmp_path, clouds=True)
    assert frames.layout.name == layout
    assert (frames[0][0] == points).all()
    assert frames[0][1].tolist() == expected
    np.zeros(3, np.uint32).tofile(tmp_path / labels)
    with pytest.raises(ConfigurationError, match=r"3 labels, but .* has 4 points"):
        frames[0]


def test_numbers_are_those_of_folders_and_neighbours_stay_in_order(tmp_path: Path) -> None:
    for number in (20, 3, 100, 11):
        photo(tmp_path / f"{number:04d}/rgb.jpg")
        write(tmp_path / f"{number:04d}/labels.png", colours(*[(1, 88, 255)] * 3))
    frames = frames_of(tmp_path)
    assert [pair.number for pair in frames.pairs] == [3, 11, 20, 100]
    assert [pair.number for pair in frames.between(11, 100).pairs] == [11, 20]
    assert [pair.number for pair in frames.spread(2).pairs] == [3, 100]
    with pytest.raises(ConfigurationError, match="numbers 3 to 100"):
        frames.between(101, 200)
    with pytest.raises(ConfigurationError, match="5 pairs are asked for; there are 4"):
        frames.spread(5)


def test_images_without_labels_are_left_out(tmp_path: Path) -> None:
    rellis(tmp_path)
    photo(tmp_path / "00000/pylon_camera_node/frame000001-1581624652_850.jpg")
    assert len(frames_of(tmp_path)) == 1


def test_mistakes(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="missing is not a folder"):
        frames_of(tmp_path / "missing")
    with pytest.raises(ConfigurationError, match="no pairs of an image and labels as ycor, rugd"):
        frames_of(tmp_path)
    with pytest.raises(ConfigurationError, match="layout 'kitti' must be one of ycor"):
        frames_of(tmp_path, "kitti")
    labels = tmp_path / "0001/labels.png"
    photo(tmp_path / "0001/rgb.jpg")
    write(labels, colours((1, 2, 3), (1, 88, 255), (1, 88, 255)))
    with pytest.raises(ConfigurationError, match=r"labels.png: colour \(1, 2, 3\) is no class of ycor"):
        frames_of(tmp_path)[0]
    write(labels, colours((1, 88, 255)))
    with pytest.raises(ConfigurationError, match=r"they have \(1, 2\) pixels, and the image \(3, 2\)"):
        frames_of(tmp_path)[0]
    labels.write_text("no image")
    with pytest.raises(ConfigurationError, match=r"labels\.png"):
        frames_of(tmp_path)[0]


def test_unknown_id(tmp_path: Path) -> None:
    rellis(tmp_path)
    write(tmp_path / "00000/pylon_camera_node_label_id/frame000000-1581624652_750.png", ids(3, 4, 77))
    with pytest.raises(ConfigurationError, match="id 77 is no class of rellis"):
        frames_of(tmp_path)[0]


def test_every_layout_has_each_class() -> None:
    merged = {"orfd": {GRASS, VEGETATION, SKY}, "semantickitti": {GROUND, TREE}}
    for layout in LAYOUTS:
        found = {int(layout.table()[number]) for number in layout.classes} - {IGNORED}
        assert found == merged.get(layout.name, set(range(len(layout.coarse_classes)))), layout.name


def test_only_names_without_a_class_are_ignored() -> None:
    without = {"background", "void", "undefined", "unlabelled", "water", "snow", "ego_vehicle", "outlier"}
    for layout in (each for each in LAYOUTS if not each.is_cloud):
        ignored = {name for number, name in layout.classes.items() if layout.table()[number] == IGNORED}
        assert ignored <= without, layout.name


def test_own_classes_are_those_of_training() -> None:
    trained = label_map_of("offroad")
    names = [trained.classes[number].name for number in trained.ids]
    assert of_own_classes().tolist() == of_names(names).tolist()


def test_own_classes() -> None:
    of = of_own_classes()
    assert [of[label] for label in (Label.GROUND, Label.TRAIL, Label.SKY)] == [GRASS, TRAIL, SKY]
    assert {of[label] for label in (Label.TRUNK, Label.TREETOP, Label.BUSH, Label.HIGH_GRASS)} == {VEGETATION}
    assert {of[label] for label in (Label.ROCK, Label.BUILDING, Label.FENCE, Label.POST)} == {OBSTACLE}
    assert {of[label] for label in (Label.VOID, Label.WATER, Label.ROBOT, Label.PARTICLE)} == {IGNORED}
    assert of_names(IMAGE_CLASSES).tolist() == [*range(5)]
    assert of_names(CLOUD_CLASSES, clouds=True).tolist() == [*range(3)]

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""SemanticKITTI export of bags without cameras, with clouds as in the paper, incomplete or invalid."""

import filecmp
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import paper_topics
import pytest
from semantickitti_reader import (
    LIDAR_ONLY,
    lidar_poses,
    read_calib,
    read_poses,
    read_scan,
    rewritten,
    true_lidar_poses,
)

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import points
from fieldtruth.bag.file import BagError
from fieldtruth.exporters import export


@pytest.fixture(scope="module")
def made(exported: Callable[[str], Path]) -> Path:
    return exported("semantickitti")


def test_cam0_is_in_the_lidar_without_cameras(bag: Path, tmp_path: Path) -> None:
    alone = rewritten(bag, tmp_path / "alone.bag", LIDAR_ONLY)
    folder = export(alone, "semantickitti") / "sequences/00"
    assert folder.parents[1] == tmp_path / "alone_semantickitti"
    assert sorted(p.name for p in folder.iterdir()) == ["calib.txt", "labels", "poses.txt", "times.txt", "velodyne"]
    calib = read_calib(folder)
    assert np.array_equal(calib["Tr"], [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    assert all(np.array_equal(calib[f"P{i}"], np.eye(4)) for i in range(4))
    true = true_lidar_poses(bag)
    assert np.allclose(true[0] @ lidar_poses(folder), true, atol=1e-9)
    assert read_poses(folder)[-1][2, 3] > 0.3  # forward is z


def test_class_is_read_from_intensity_without_instances(bag: Path, made: Path, tmp_path: Path) -> None:
    def as_published(cloud: Any) -> None:
        rows = points(cloud)
        few = np.zeros(len(rows) + 1, [(name, "<f4") for name in ("x", "y", "z", "intensity")])
        for name in ("x", "y", "z", "intensity"):
            few[name][1:] = rows[name]
        few["z"][0] = np.nan  # not a return
        cloud.fields = cloud.fields[:4]
        cloud.width, cloud.point_step, cloud.row_step = len(few), 16, 16 * len(few)
        cloud.data = few.view(np.uint8)

    published = rewritten(bag, tmp_path / "published.bag", LIDAR_ONLY, points=as_published)
    folder = export(published, "semantickitti") / "sequences/00"
    for number in (0, 7):
        (scan, label), (true_scan, true_label) = read_scan(folder, number), read_scan(made / "sequences/00", number)
        assert np.array_equal(scan, true_scan)
        assert np.array_equal(label, true_label & 0xFFFF)


@pytest.mark.parametrize(
    ("dropped", "message"),
    [
        ((paper_topics.POINTS,), f"has no {paper_topics.POINTS}; available: "),
        ((table.TF_STATIC,), f"has no {table.TF_STATIC}; available: "),
        (
            (table.ODOMETRY, table.MODEL_STATES),
            f"has no {table.ODOMETRY}, nor /gazebo/model_states in its place; available: ",
        ),
        ((paper_topics.camera_info("right"),), f"has no {paper_topics.camera_info('right')}; available: "),
    ],
)
def test_missing_topics_are_named(bag: Path, tmp_path: Path, dropped: tuple[str, ...], message: str) -> None:
    kept = {*LIDAR_ONLY, *map(paper_topics.camera_info, paper_topics.SIDES)} - {*dropped}
    poor = rewritten(bag, tmp_path / "poor.bag", kept)
    with pytest.raises(BagError, match=message):
        export(poor, "semantickitti")
    assert [p.name for p in tmp_path.iterdir()] == ["poor.bag"]


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        (
            "label",
            24,
            r"odd\.bag: .*points at 100000000 ns: label of a point must be a class, one of 0, 1, .*, 22, 23, got 24",
        ),
        ("x", None, r"must have x, y and z, got y, z, "),
    ],
)
def test_invalid_clouds_are_refused(bag: Path, tmp_path: Path, field: str, value: int | None, message: str) -> None:
    def odd(cloud: Any) -> None:
        rows = points(cloud).copy()
        if value is None:
            cloud.fields = [each for each in cloud.fields if each.name != field]
        else:
            rows[field][7] = value
        cloud.data = rows.view(np.uint8)

    strange = rewritten(bag, tmp_path / "odd.bag", LIDAR_ONLY, points=odd)
    with pytest.raises(BagError, match=message):
        export(strange, "semantickitti")


def test_bytes_do_not_depend_on_workers(small_run: Path, made: Path, tmp_path: Path) -> None:
    other = export(small_run, "semantickitti", out=tmp_path / "other", workers=1)

    def files(folder: Path) -> Iterator[Path]:
        return (p.relative_to(folder) for p in sorted(folder.rglob("*")) if p.is_file())

    names = list(files(made))
    assert list(files(other)) == names
    assert all(filecmp.cmp(other / name, made / name, shallow=False) for name in names)


def test_camera_without_projection_is_refused(bag: Path, tmp_path: Path) -> None:
    def blind(message: Any) -> None:
        message.P = np.zeros(12)

    kept = {*LIDAR_ONLY, *map(paper_topics.camera_info, paper_topics.SIDES)}
    strange = rewritten(bag, tmp_path / "blind.bag", kept, camera_info=blind)
    with pytest.raises(
        BagError, match=r"left/camera_info of .*blind.bag has an invalid projection: P has fx 0\.0, fy 0\.0"
    ):
        export(strange, "semantickitti")

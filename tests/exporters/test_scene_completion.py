# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Voxels ahead of a sensor: closed forms on tiny worlds, and the files of a run read as SemanticKITTI's API does."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, box, make_world

from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.transforms import pose
from fieldtruth.exporters import export
from fieldtruth.exporters.scene_completion import FIRST, SHAPE, VOXEL_M, Volumes, points_in
from fieldtruth.kernels.walks import hide_voxels

UP = 0.95
"""[m] of the sensor above the ground, which is in the sixth layer."""


@pytest.mark.parametrize("yaw", [0.0, 30.0])
def test_ground_is_a_layer_and_a_box_its_shell_in_the_frame_of_the_sensor(yaw: float) -> None:
    turn = pose((0.0, 0.0, 0.0), (0.0, 0.0, yaw))
    stone = box("stone", (0.45, 0.45, 0.45))
    world = make_world([(stone, turn @ at(5.1, 0.5, 1.5))], side=200.0, spacing=1.0)
    volumes, sensor = Volumes(world), turn @ at(0.0, 0.0, UP)
    label, unknown = volumes.labels(sensor), volumes.unknown(sensor)
    assert (label[:, :, 5] == Label.GROUND).all()
    rocks = np.argwhere(label == Label.ROCK)
    low, high = ((np.array([5.1, 0.5, 1.5 - UP]) + side * 0.45 - FIRST) / VOXEL_M for side in (-1, 1))
    first, last = np.floor(low + 1e-4).astype(int), np.floor(high - 1e-4).astype(int)
    assert (rocks.min(axis=0) == first).all()
    assert (rocks.max(axis=0) == last).all()
    side = last - first + 1
    assert len(rocks) == np.prod(side) - np.prod(side - 2)
    assert (label > 0).sum() == len(rocks) + 256 * 256
    assert (unknown == (np.arange(32) < 5)).all()


def test_beyond_the_world_nothing_is_known() -> None:
    unknown = Volumes(make_world(side=40.0)).unknown(at(0.0, 0.0, UP))
    x = (np.arange(256) + 0.5) * VOXEL_M
    assert (unknown[:, 128, 20] == (x > 20.0)).all()


def test_leaves_give_way_to_stems_and_ground_to_all() -> None:
    objects = [(box(name, (0.5, 0.5, 0.5), name), at(5.0, 0.0, 0.5)) for name in ("leaf", "bark", "stone")]
    label = Volumes(make_world(objects)).labels(at(0.0, 0.0, UP))
    assert {*np.unique(label)} == {0, Label.GROUND, Label.TRUNK}


def test_a_wall_hides_what_is_behind_it_and_nothing_else() -> None:
    solid, hidden = np.zeros(SHAPE, np.uint8), np.zeros(SHAPE, np.uint8)
    solid[20] = 1
    hide_voxels(solid, FIRST, VOXEL_M, hidden)
    assert hidden[21:].all()
    assert not hidden[:20].any()  # parts of the wall hide others
    solid[20], hidden[:] = 0, 0
    solid[10, 138, 20] = 1  # ahead by 2 m, 2 m to the left, 2 m up: the diagonal
    hide_voxels(solid, FIRST, VOXEL_M, hidden)
    assert hidden[11, 139, 21] == hidden[20, 148, 30] == 1
    assert hidden[:10].sum() == hidden[20, 128, 10] == hidden[20, 139, 30] == 0


def unpacked(path: Path) -> NDArray[np.uint8]:
    """The bits of a file, written out as SemanticKITTI's API does: the highest first."""
    packed = np.fromfile(path, np.uint8)
    return np.stack([packed >> (7 - k) & 1 for k in range(8)], axis=1).reshape(SHAPE)


@pytest.mark.slow
@pytest.mark.usefixtures("in_park")
def test_files_of_a_run_have_the_points_of_its_clouds(brief_run: Path, tmp_path: Path) -> None:
    run = open_run(brief_run)
    made = export(brief_run, "scene-completion", out=tmp_path / "v", workers=1)
    folder, clouds = made / "sequences/00/voxels", run["lidar"]
    assert len([*folder.iterdir()]) == 4 * len(clouds)
    label = np.fromfile(folder / "000001.label", np.uint16).reshape(SHAPE)
    hit, invalid, occluded = (unpacked(folder / f"000001.{name}") for name in ("bin", "invalid", "occluded"))
    cloud = clouds.read(1)
    assert (hit == points_in(cloud.xyz.astype(float))).all()
    assert not (hit & occluded).any()
    assert not (invalid & (label > 0)).any()
    cells = (cloud.xyz.astype(float) - FIRST) / VOXEL_M
    world = transforms.transform(run.calibration.base_from("lidar"), cloud.xyz)
    world = transforms.transform(run.trajectory.world_from_base(cloud.stamp_ns), world)
    inner = (np.abs(world[:, :2]) < np.array([50.0, 25.0])).all(axis=1)  # in the park
    inner &= (np.abs(cells - np.rint(cells)) > 0.1).all(axis=1) & ((cells >= 0) & (cells < SHAPE)).all(axis=1)
    assert inner.sum() > 100
    found = label[tuple(np.floor(cells[inner]).astype(int).T)]
    assert (found > 0).all()
    rank = {Label.GROUND: 0, Label.TRAIL: 1, Label.HIGH_GRASS: 2, Label.TREETOP: 3, Label.BUSH: 4, Label.TRUNK: 6}
    won, had = (np.array([rank.get(Label(each), 5) for each in ids.tolist()]) for ids in (found, cloud.label[inner]))
    assert (won >= had).all()
    assert (found == cloud.label[inner]).mean() > 0.8

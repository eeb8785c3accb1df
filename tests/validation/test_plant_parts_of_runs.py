# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs with parts of plants: from bag to data set and files, all else as without; `validate` finds a flipped one."""

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pyarrow.parquet as pq
import pytest
from changed_bags import POINTS, bag_in, checks_of, clouds_in, messages_in
from small_park import in_small_park

from fieldtruth.bag import decode as read
from fieldtruth.bag.messages import STORE
from fieldtruth.core.classes import GROUND_ID, Label, PlantPart
from fieldtruth.datasets import RunDataset
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import with_overrides
from fieldtruth.exporters import export
from fieldtruth.pipeline import generate
from fieldtruth.sensors.camera import sensor as write
from fieldtruth.validation.runner import validate

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")

LEFT = "/stereo/camera/left/parts"


def experiment(*extras: str) -> Experiment:
    camera = {"width": 96, "height": 64, "rate_hz": 12.5}
    made = in_small_park(seconds=0.4, rig={"cameras": camera, "lidar": {"columns": 256, "rings": 32}})
    return with_overrides(made, extras=extras)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders of runs with parts, by one worker and by two, and without."""
    given: dict[str, tuple[Experiment, int]] = {
        "one": (experiment("parts", "instances"), 1),
        "two": (experiment("parts", "instances"), 2),
        "plain": (experiment("instances"), 2),
    }
    return {
        name: generate(made, tmp_path_factory.mktemp(name), workers=workers).parent
        for name, (made, workers) in given.items()
    }


def test_all_else_is_as_without(runs: dict[str, Path]) -> None:
    one, plain = messages_in(runs["one"]), messages_in(runs["plain"])
    assert bag_in(runs["one"]).read_bytes() == bag_in(runs["two"]).read_bytes()
    assert one.keys() - plain.keys() == {LEFT, LEFT.replace("left", "right")}
    assert {topic: one[topic] for topic in plain if topic != POINTS} == {t: plain[t] for t in plain if t != POINTS}
    for with_parts, without in zip(clouds_in(runs["one"]), clouds_in(runs["plain"]), strict=True):
        names = without.dtype.names or ()
        assert (with_parts.dtype.names or ()) == (*names, "part")
        assert all(np.array_equal(with_parts[name], without[name]) for name in names)


def test_parts_are_of_the_classes_of_plants(runs: dict[str, Path]) -> None:
    cloud = np.concatenate([each[["label", "part", "instance"]] for each in clouds_in(runs["one"])])
    images = RunDataset(runs["one"], items=("mask", "part_mask", "instance_mask"))
    rows = [tuple(cloud[name] for name in ("label", "part", "instance"))]
    rows += [(each["mask"], each["part_mask"], each["instance_mask"]) for each in images]
    label, part, instance = (np.concatenate([np.ravel(row[k]) for row in rows]) for k in range(3))
    assert {PlantPart.STEM, PlantPart.BRANCH, PlantPart.LEAF, PlantPart.BLADE} <= set(part)
    near = instance != GROUND_ID  # beyond the edge, woods are one surface
    assert set(part[(label == Label.TREETOP) & near]) == {PlantPart.LEAF}
    assert set(part[(label == Label.TRUNK) & near]) == {PlantPart.STEM, PlantPart.BRANCH}
    assert not part[np.isin(label, (Label.BENCH, Label.TRAIL, Label.SKY, Label.LAMP_POST)) | ~near].any()
    points = RunDataset(runs["one"], items=("labels", "parts"))[0]
    assert np.array_equal(points["parts"], clouds_in(runs["one"])[0]["part"])


def test_files_and_tables_have_them(runs: dict[str, Path], tmp_path: Path) -> None:
    files = export(runs["one"], "files", out=tmp_path / "files")
    assert len(list((files / "parts_left").glob("*.png"))) == 5
    assert "parts_right" in (files / "README.txt").read_text()
    made = export(runs["one"], "huggingface", out=tmp_path / "hf")
    (row, *_) = pq.read_table(next((made / "images").glob("*.parquet"))).select(["parts"]).to_pylist()
    stored = next(iter(read.read_bag(bag_in(runs["one"]), [LEFT]))).message
    assert np.array_equal(np.asarray(PIL.Image.open(io.BytesIO(row["parts"]["bytes"]))), read.parts(stored))
    points = pq.read_table(next((made / "clouds").glob("*.parquet")))["part"][0].as_py()
    assert np.array_equal(points, clouds_in(runs["one"])[0]["part"])


def test_validate_passes_and_finds_a_flipped_part(runs: dict[str, Path], tmp_path: Path) -> None:
    for name in ("one", "plain"):
        assert not [check for check in validate(runs[name], samples=3) if check.passed is False]

    def point(message: Any) -> bytes:
        points = read.points(message).copy()
        row = int(np.flatnonzero(points["part"] == PlantPart.STEM)[0])
        points["part"][row] = PlantPart.BRANCH
        changed = replace(message, data=points.view(np.uint8))
        return bytes(STORE.serialize_ros1(changed, "sensor_msgs/msg/PointCloud2"))

    check = checks_of(runs["one"], tmp_path / "point", POINTS, point)["retraced clouds"]
    assert check.passed is False
    assert "part 2, of object" in str(check)

    def pixel(message: Any) -> bytes:
        part = read.parts(message).copy()
        row, column = np.argwhere(part == PlantPart.LEAF)[0]
        part[row, column] = PlantPart.NONE
        return write.parts(0, read.stamp_ns(message.header), message.header.frame_id, part)

    check = checks_of(runs["one"], tmp_path / "pixel", LEFT, pixel)["retraced images"]
    assert check.passed is False

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs with passability: from bag to data set and files, all else as without; `validate` finds a flipped value."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pyarrow.parquet as pq
import pytest
from changed_bags import POINTS, bag_in, checks_of, clouds_in, messages_in
from small_park import in_small_park, small_park

from fieldtruth.bag import decode as read
from fieldtruth.bag.messages import STORE
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.datasets import RunDataset
from fieldtruth.drive.passability import Passability
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import with_overrides
from fieldtruth.experiment.rig import Rig
from fieldtruth.exporters import export
from fieldtruth.interchange.inventory import COLUMNS, inventory_rows, named_objects, swarm_members
from fieldtruth.pipeline import generate
from fieldtruth.sensors.camera import sensor as write
from fieldtruth.validation.runner import validate

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")

LEFT = "/stereo/camera/left/passability"


def experiment(*extras: str) -> Experiment:
    camera = {"width": 96, "height": 64, "rate_hz": 12.5}
    made = in_small_park(seconds=0.2, rig={"cameras": camera, "lidar": {"columns": 256, "rings": 32}})
    return with_overrides(made, extras=extras)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders of runs with passability and without."""
    given = {"passing": experiment("passability", "instances"), "plain": experiment("instances")}
    return {name: generate(made, tmp_path_factory.mktemp(name), workers=1).parent for name, made in given.items()}


def test_all_else_is_as_without(runs: dict[str, Path]) -> None:
    passing, plain = messages_in(runs["passing"]), messages_in(runs["plain"])
    assert passing.keys() - plain.keys() == {LEFT, LEFT.replace("left", "right")}
    assert all(passing[topic] == plain[topic] for topic in plain if topic != POINTS)
    for own, without in zip(clouds_in(runs["passing"]), clouds_in(runs["plain"]), strict=True):
        names = without.dtype.names or ()
        assert (own.dtype.names or ()) == (*names, "passability", "force")
        assert all(np.array_equal(own[name], without[name]) for name in names)


def test_trunks_are_solid_and_ground_and_sky_are_free(runs: dict[str, Path]) -> None:
    images = RunDataset(runs["passing"], items=("mask", "passability_mask"))
    rows = [(each["mask"].ravel(), *each["passability_mask"].reshape(2, -1)) for each in images]
    points = RunDataset(runs["passing"], items=("labels", "passability"))[0]
    rows.append((points["labels"], *points["passability"].T))
    label, share, force = (np.concatenate(each) for each in zip(*rows, strict=True))
    solid = np.isin(label, (Label.TRUNK, Label.TREETOP, Label.BENCH, Label.LAMP_POST, Label.TABLE))
    free = np.isin(label, (Label.GROUND, Label.TRAIL, Label.SKY))
    assert set(label[solid]) > {Label.TRUNK, Label.TREETOP}
    assert np.isinf(force[solid]).all()
    assert not share[solid].any()
    assert not force[free].any()
    assert (share[free] == 1.0).all()
    grass = label == Label.HIGH_GRASS
    assert ((share[grass] > 0.99) & (force[grass] < 3.0)).all()
    assert force[grass].max() > 0.0


def test_the_inventory_has_the_values_of_the_sensors() -> None:
    world = small_park()
    items = [*named_objects(world), *swarm_members(world)]
    column = list(COLUMNS).index("force_n")
    rows = [row[column : column + 2] for row in inventory_rows(world, items)]
    values = Passability(world, Rig().robot).values[-len(items) :]
    for (force, share), (expected, own) in zip(rows, values[:, ::-1].tolist(), strict=True):
        assert share == pytest.approx(own, abs=1e-4)
        assert force is None if np.isinf(expected) else force == pytest.approx(expected, abs=1e-4)


def test_files_and_tables_have_them(runs: dict[str, Path], tmp_path: Path) -> None:
    files = export(runs["passing"], "files", out=tmp_path / "files")
    images = [read.passability(each.message) for each in read.read_bag(bag_in(runs["passing"]), [LEFT])]
    first = min(int(path.stem) for path in (files / "passability_left").iterdir())
    shown = np.asarray(PIL.Image.open(files / "passability_left" / f"{first}.png"))
    assert np.array_equal(shown, np.rint(255 * images[0][..., 0]))
    assert np.array_equal(np.load(files / "force_left" / f"{first}.npy"), images[0][..., 1])
    made = export(runs["passing"], "huggingface", out=tmp_path / "hf")
    row = pq.read_table(next((made / "images").glob("*.parquet"))).select(["passability"]).to_pylist()[0]
    assert np.array_equal(np.float32(row["passability"]), images[0].ravel())
    points = pq.read_table(next((made / "clouds").glob("*.parquet"))).select(["passability", "force"]).to_pylist()[0]
    for name, values in points.items():
        assert np.array_equal(np.float32(values), clouds_in(runs["passing"])[0][name])
    with pytest.raises(FieldtruthError, match="--extras passability"):
        _ = RunDataset(runs["plain"], items=("passability",))[0]


def test_validate_passes_and_finds_a_flipped_value(runs: dict[str, Path], tmp_path: Path) -> None:
    assert not [check for check in validate(runs["passing"], samples=3) if check.passed is False]

    def point(message: Any) -> bytes:
        points = read.points(message).copy()
        row = int(np.flatnonzero(points["label"] == Label.GROUND)[7])
        points["passability"][row] = 0.5
        changed = replace(message, data=points.view(np.uint8))
        return bytes(STORE.serialize_ros1(changed, "sensor_msgs/msg/PointCloud2"))

    check = checks_of(runs["passing"], tmp_path / "point", POINTS, point)["retraced clouds"]
    assert check.passed is False
    assert "passability 0.5 and 0 N, of object 1" in str(check)

    def pixel(message: Any) -> bytes:
        passing = read.passability(message).copy()
        row, column = np.argwhere(np.isinf(passing[..., 1]))[0]
        passing[row, column, 1] = 1000.0
        return write.passability(0, read.stamp_ns(message.header), message.header.frame_id, passing)

    check = checks_of(runs["passing"], tmp_path / "pixel", LEFT, pixel)["retraced images"]
    assert check.passed is False
    assert "passability 0 and 1000 N" in str(check)

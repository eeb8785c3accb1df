# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Instance ids above 65,535 in every field, image and export: a run, and the same with 70,000 more objects."""

import csv
import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from changed_bags import FILLERS, LEFT, POINTS, bag_in, failures, points_in, rewritten, wide, with_wide_ids
from numpy.typing import NDArray
from PIL import Image
from record_fakes import FakeCamera, FakeEngine, FakeLidar, FakeScan, make_experiment, make_track, make_world

from fieldtruth.bag import decode as read
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import read_objects
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.run import open_run
from fieldtruth.core.png import ids_png
from fieldtruth.datasets import RunDataset
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.exporters import export
from fieldtruth.exporters.coco import Numbering, categories_of
from fieldtruth.ontology import own_labels
from fieldtruth.pipeline import generate_by
from fieldtruth.report.viewer import view
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.validation.runner import validate
from fieldtruth.world.model import World

END_NS = 200_000_000
IDS = LEFT.topic_of("instances")
Numbers = NDArray[np.uint32]


@pytest.fixture(scope="module")
def runs(lean_run: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The first 0.2 s of the small run, and the same with wide ids."""

    def shorter(raw: RawMessage, k: int) -> RawMessage | None:
        return raw if raw.stamp_ns <= END_NS else None

    folder = tmp_path_factory.mktemp("ids")
    return rewritten(lean_run, folder / "usual", shorter), with_wide_ids(lean_run, folder / "wide", END_NS)


def both(runs: tuple[Path, Path], find: Callable[[Path], NDArray[Any]]) -> tuple[Numbers, Numbers]:
    """Ids that are found in the wide run, and those that must be there."""
    usual, found = (find(run) for run in runs)
    assert usual.max() > 2
    return found.astype(np.uint32), wide(usual)


def clouds(run: Path) -> NDArray[Any]:
    parts = [read.points(each.message)["instance"] for each in read.read_bag(bag_in(run), [POINTS])]
    return np.concatenate(parts)


def images(run: Path) -> NDArray[Any]:
    return np.stack([read.instances(each.message) for each in read.read_bag(bag_in(run), [IDS])])


def png(data: bytes) -> NDArray[Any]:
    pixels = np.asarray(Image.open(io.BytesIO(data)))
    return pixels if pixels.ndim == 2 else pixels.astype(np.uint32) @ np.array([1, 256, 65536], np.uint32)


def test_bags_have_wide_fields_and_images(runs: tuple[Path, Path]) -> None:
    for find in (clouds, images):
        np.testing.assert_array_equal(*both(runs, find))
    for run, datatype, encoding in zip(runs, (4, 6), ("16UC1", "32SC1"), strict=True):
        cloud = next(iter(read.read_bag(bag_in(run), [POINTS]))).message
        assert {field.name: field.datatype for field in cloud.fields}["instance"] == datatype
        assert next(iter(read.read_bag(bag_in(run), [IDS]))).message.encoding == encoding


def test_validate_passes(runs: tuple[Path, Path]) -> None:
    checks = validate(runs[1], quick=True)
    assert failures(checks) == {}
    assert {check.name: check.passed for check in checks}["object classes"]


def test_validate_finds_a_wrong_upper_bit_and_a_narrow_form(runs: tuple[Path, Path], tmp_path: Path) -> None:
    def wrong(raw: RawMessage, k: int) -> RawMessage:
        data = bytearray(raw.data)
        if raw.topic == POINTS:
            points_in(data)["instance"] ^= 0x10000  # also of the ground, which is in view everywhere
        return raw._replace(data=bytes(data))

    assert "lidar and cameras" in failures(validate(rewritten(runs[1], tmp_path, wrong), quick=True))

    def narrow(raw: RawMessage, k: int) -> RawMessage:
        return raw._replace(data=raw.data.replace(b"32SC1", b"16UC1")) if raw.topic == IDS else raw

    assert "images" in failures(validate(rewritten(runs[1], tmp_path / "narrow", narrow), quick=True))


def test_files_are_coloured_images_and_have_all_names(runs: tuple[Path, Path], tmp_path: Path) -> None:
    made = {run: export(run, "files", out=tmp_path / run.parent.name) for run in runs}

    def exported(run: Path) -> NDArray[Any]:
        return np.stack([png(path.read_bytes()) for path in sorted((made[run] / "instances_left").iterdir())])

    np.testing.assert_array_equal(*both(runs, exported))
    rows = list(csv.reader((made[runs[1]] / "instances.csv").open()))
    assert rows[FILLERS + 2] == [str(FILLERS + 2), read_objects(open_run(runs[0]))[0][2]]
    assert "beyond id 65,535: R + 256 G + 65536 B" in (made[runs[1]] / "README.txt").read_text()


def test_coco_numbers_objects_with_more_bits(runs: tuple[Path, Path], tmp_path: Path) -> None:
    pytest.importorskip("pycocotools")
    found: list[Any] = []
    for run in runs:
        folder = export(run, "coco", out=tmp_path / run.parent.name)
        rows = json.loads((folder / "instances.json").read_text())["annotations"]
        panoptic = json.loads((folder / "panoptic.json").read_text())["annotations"]
        for each in panoptic:
            pixels = png((folder / "panoptic" / each["file_name"]).read_bytes())
            assert {segment["id"]: segment["area"] for segment in each["segments_info"]} == {
                int(number): int(count) for number, count in zip(*np.unique(pixels, return_counts=True), strict=True)
            }
        found.append([(row["object_id"], row["category_id"], row["area"]) for row in rows])
    usual, of_wide = (sorted(rows, key=str) for rows in found)
    assert of_wide == sorted([(int(wide(np.array([k]))[0]) if k else k, *rest) for k, *rest in usual], key=str)


def test_coco_refuses_what_24_bits_do_not_hold() -> None:
    names = ["tree_1"] * (1 << 19)  # 17, the last class, takes five bits
    Numbering(categories_of(own_labels()), own_labels(), names)
    with pytest.raises(BagError, match=r"at most 524288 objects with these classes, got 524289"):
        Numbering(categories_of(own_labels()), own_labels(), [*names, "tree_1"])


def test_semantickitti_is_refused_before_anything_is_written(runs: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"has 70\d\d\d objects; instance ids of a label file have 16 bits, up to 65535"):
        export(runs[1], "semantickitti", out=tmp_path / "x")
    assert list(tmp_path.iterdir()) == []


def test_webdataset_and_huggingface(runs: tuple[Path, Path], tmp_path: Path) -> None:
    tars = {run: export(run, "webdataset", out=tmp_path / f"{run.parent.name}_tar") for run in runs}

    def packed(member: str, name: str) -> Callable[[Path], NDArray[Any]]:
        def find(run: Path) -> NDArray[Any]:
            with tarfile.open(next(tars[run].glob("train-*.tar"))) as tar:
                files = [m for m in tar.getmembers() if m.name.endswith(member)]
                contents = [tar.extractfile(each) for each in files]
                return np.concatenate([np.load(io.BytesIO(each.read()))[name].ravel() for each in contents if each])

        return find

    np.testing.assert_array_equal(*both(runs, packed("left.npz", "instances")))
    np.testing.assert_array_equal(*both(runs, packed("cloud.npz", "instance")))
    parquet = pytest.importorskip("pyarrow.parquet")
    tables = {run: export(run, "huggingface", out=tmp_path / f"{run.parent.name}_hf") for run in runs}

    def column(kind: str, name: str) -> Callable[[Path], NDArray[Any]]:
        def find(run: Path) -> NDArray[Any]:
            cells = parquet.read_table(next((tables[run] / kind).glob("*.parquet")))[name].to_pylist()
            return np.concatenate([png(c["bytes"]).ravel() if kind == "images" else np.array(c) for c in cells])

        return find

    np.testing.assert_array_equal(*both(runs, column("images", "instances")))
    np.testing.assert_array_equal(*both(runs, column("clouds", "instance")))


def test_pcd_datasets_and_viewer(runs: tuple[Path, Path], tmp_path: Path) -> None:
    for run in runs:
        folder = export(run, "pcd", out=tmp_path / run.parent.name)
        head, _, body = next(folder.glob("*.pcd")).read_bytes().partition(b"DATA binary\n")
        fields = {k: v.split() for k, _, v in (line.partition(" ") for line in head.decode().splitlines())}
        sizes = dict(zip(fields["FIELDS"], map(int, fields["SIZE"]), strict=True))
        kinds = [(name, f"V{size}" if name != "instance" else f"<u{size}") for name, size in sizes.items()]
        np.testing.assert_array_equal(np.frombuffer(body, kinds)["instance"], clouds(run)[: int(fields["POINTS"][0])])
        view(run, save=tmp_path / f"{run.parent.name}.rrd")

    def sample(name: str) -> Callable[[Path], NDArray[Any]]:
        return lambda run: np.asarray(RunDataset(run, items=(name,))[0][name])

    np.testing.assert_array_equal(*both(runs, sample("instance_mask")))
    np.testing.assert_array_equal(*both(runs, sample("instances")))


def test_what_24_bits_do_not_hold_is_no_image() -> None:
    assert png(ids_png(np.array([[0, 65536, 2**24 - 1]], np.uint32))).tolist() == [[0, 65536, 2**24 - 1]]
    with pytest.raises(ValueError, match="below 16777216, got 16777216"):
        ids_png(np.array([[2**24]], np.uint32))


def wide_world(environment: str, seed: int) -> World:
    """The world of the fakes; its last object has the id 70,000."""
    world = make_world(environment, seed)
    last = world.instances[-1]
    instances = (*world.instances[:-1], last.__class__(**{**last.__dict__, "object_id": 70_000}))
    names = ("husky", "ground", *(f"tree_{k}" for k in range(2, 70_001)))
    return world.__class__(**{**world.__dict__, "instances": instances, "object_names": names})


@pytest.mark.slow
def test_a_world_with_wide_ids_is_recorded_with_them(tmp_path: Path) -> None:
    class WideLidar(FakeLidar):
        def scan(self, world_from_lidar: NDArray[np.float64], stamp_ns: int = 0, number: int = 0) -> FakeScan:
            scan = super().scan(world_from_lidar)
            scan.instance[:] = 70_000 - np.arange(len(scan.instance))
            return scan

    class WideCamera(FakeCamera):
        def render(self, world_from_optical: NDArray[np.float64], robot: object = None, stamp_ns: int = 0) -> Any:
            pictures = super().render(world_from_optical)
            return pictures.__class__(**{**pictures.__dict__, "instance": pictures.instance + np.uint32(65_500)})

    engine = FakeEngine(lambda e: wide_world(e.environment, e.seed), make_track, WideLidar, WideCamera)
    rig = paper_rig(cameras=StereoConfig(width=64, height=48, instances=True))
    experiment = make_experiment(0.1, rig=rig).model_copy(update={"static_objects": "latched"})
    bag = generate_by(engine, experiment, tmp_path, workers=1)
    [cloud] = [read.points(each.message)["instance"] for each in read.read_bag(bag, [POINTS])]
    assert cloud.tolist() == list(range(70_000, 70_000 - len(cloud), -1))
    first = read.instances(next(iter(read.read_bag(bag, [IDS]))).message)
    assert first[0].tolist() == [65_500 + 300 * (k % 15 + 1) for k in range(64)]
    assert read_objects(open_run(bag))[0][70_000] == "tree_70000"

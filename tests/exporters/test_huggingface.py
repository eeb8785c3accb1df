# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parquet folder read by Hugging Face's datasets, croissant.json by mlcroissant: images and clouds as in the bag."""

import io
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from PIL import Image
from published_truth import Truth, publish, read_truth

from fieldtruth.bag.provenance import sha256_of
from fieldtruth.core.errors import OutputError
from fieldtruth.exporters import export
from fieldtruth.exporters.image_files import encode_tiff
from fieldtruth.ontology import LABEL_MAPS


@pytest.fixture(scope="module")
def truth(brief_run: Path) -> Truth:
    return read_truth(brief_run / "park_1.bag")


@pytest.fixture(scope="module")
def folder(brief_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run for training in several files, and one, as if of another world, for validation."""
    return publish(brief_run, tmp_path_factory.mktemp("published"), "huggingface", shard_mb=1)


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """The library, without network and with a cache of its own."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "cache"))
    datasets = pytest.importorskip("datasets")
    monkeypatch.setattr(datasets.config, "HF_DATASETS_CACHE", tmp_path / "cache")
    datasets.disable_progress_bars()
    return datasets


def rows_of(folder: Path, pattern: str) -> Iterator[dict[str, Any]]:
    for path in sorted(folder.glob(pattern)):
        yield from pq.read_table(path).to_pylist()


def test_rows_of_images_are_those_of_the_bag(folder: Path, truth: Truth) -> None:
    rows = list(rows_of(folder, "images/train-*"))
    assert [(row["stamp_ns"], row["camera"]) for row in rows] == sorted(truth.pictures)
    for row in rows:
        picture = truth.pictures[row["stamp_ns"], row["camera"]]
        assert row["run"] == "park_1"
        assert row["image"]["bytes"] == picture.jpeg
        for name, expected in (("mask", picture.label), ("depth", picture.depth), ("instances", picture.instances)):
            np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(row[name]["bytes"]))), expected)
        assert row["classes"] == np.unique(picture.label).tolist()


def test_rows_of_clouds_are_all_clouds_of_the_bag(folder: Path, truth: Truth) -> None:
    rows = list(rows_of(folder, "clouds/val-*"))
    assert [row["stamp_ns"] for row in rows] == sorted(truth.clouds)
    for row in rows:
        cloud = truth.clouds[row["stamp_ns"]]
        for name in ("x", "y", "z", "label", "instance", "ring", "column"):
            np.testing.assert_array_equal(np.array(row[name], cloud[name].dtype), cloud[name])


def test_files_are_numbered_and_small(small_run: Path, tmp_path: Path) -> None:
    folder = publish(small_run, tmp_path, "huggingface", shard_mb=1)
    names = sorted(path.name for path in (folder / "images").glob("train-*"))
    assert len(names) > 2
    assert names == [f"train-{k:05d}-of-{len(names):05d}.parquet" for k in range(len(names))]
    assert max(path.stat().st_size for path in folder.rglob("*.parquet")) <= 1_000_000
    assert not [
        path for path in folder.rglob("*") if path.is_file() and path.suffix not in (".parquet", ".md", ".json")
    ]


@pytest.mark.slow
def test_datasets_loads_the_folder(folder: Path, truth: Truth, library: Any) -> None:
    loaded = library.load_dataset(str(folder))
    assert {split: len(rows) for split, rows in loaded.items()} == dict.fromkeys(("train", "val"), len(truth.pictures))
    header = yaml.safe_load((folder / "README.md").read_text().split("---\n")[1])
    assert header["license"] == "cc-by-4.0"
    assert header["size_categories"] == ["n<1K"]
    features = library.Features._from_yaml_list(header["dataset_info"][0]["features"])
    assert features == loaded["train"].features
    assert features["classes"].feature.names[15] == "sky"
    counts = np.zeros(18, np.int64)
    for row in loaded["val"]:
        assert row["image"].size == (160, 92)
        counts += np.bincount(np.asarray(row["mask"]).ravel(), minlength=18)
    np.testing.assert_array_equal(counts, truth.pixels())
    clouds = library.load_dataset(str(folder), "clouds", split="train")
    assert [len(row["x"]) for row in clouds] == [len(truth.clouds[stamp]) for stamp in sorted(truth.clouds)]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")
def test_mlcroissant_loads_the_records(folder: Path, truth: Truth) -> None:
    mlcroissant = pytest.importorskip("mlcroissant")
    dataset = mlcroissant.Dataset(folder / "croissant.json")
    issues = dataset.metadata.ctx.issues
    assert not issues.errors
    assert [issue.split('"')[1] for issue in issues.warnings] == ["https://schema.org/datePublished"]  # not known yet
    assert dataset.metadata.data_collection_type == ["Software Collection", "Experiments"]
    assert dataset.metadata.personal_sensitive_information == ["There are no people and no personal data."]
    assert any(limit.startswith("Everything is simulated.") for limit in dataset.metadata.data_limitations)
    assert [row["classes/name"] for row in dataset.records("classes")][1] == "ground"
    counts = {b"train": np.zeros(18, np.int64), b"val": np.zeros(18, np.int64)}
    for row in dataset.records("images"):
        picture = truth.pictures[row["images/stamp_ns"], row["images/camera"].decode()]
        assert row["images/image"].size == (160, 92)
        np.testing.assert_array_equal(np.asarray(row["images/depth"]), picture.depth)
        counts[row["images/split"]] += np.bincount(np.asarray(row["images/mask"]).ravel(), minlength=18)
    for count in counts.values():
        np.testing.assert_array_equal(count, truth.pixels())


def test_croissant_lists_every_file_with_its_checksum(folder: Path) -> None:
    document = json.loads((folder / "croissant.json").read_text())
    listed = {row["contentUrl"]: row for row in document["distribution"] if row["@type"] == "cr:FileObject"}
    paths = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*.parquet")}
    assert listed.keys() == paths.keys()
    for name, path in paths.items():
        assert listed[name]["sha256"] == sha256_of(path)
        assert listed[name]["contentSize"] == f"{path.stat().st_size} B"


def test_labels_of_another_ontology_and_runs_from_elsewhere(brief_run: Path, tmp_path: Path, truth: Truth) -> None:
    """A bag without its experiment: no licence is claimed, and nothing is known of its world."""
    bag = tmp_path / "drive.bag"
    bag.write_bytes((brief_run / "park_1.bag").read_bytes())
    folder = export(bag, "huggingface", out=tmp_path / "set", label_map="rellis", split="test")
    label_map = LABEL_MAPS["rellis"]
    for row in rows_of(folder, "images/test-*"):
        mask = np.asarray(Image.open(io.BytesIO(row["mask"]["bytes"])))
        np.testing.assert_array_equal(mask, label_map.ids[truth.pictures[row["stamp_ns"], row["camera"]].label])
    header = yaml.safe_load((folder / "README.md").read_text().split("---\n")[1])
    names = header["dataset_info"][0]["features"][4]["sequence"]["class_label"]["names"]
    assert {int(number): name for number, name in names.items() if not name.startswith("unused")} == {
        number: other.name for number, other in label_map.classes.items()
    }
    assert header["license"] == "unknown"
    assert "license" not in json.loads((folder / "croissant.json").read_text())


def test_tiff_holds_every_bit_of_depth() -> None:
    depth = np.array([[0.1, np.inf, 3.0], [1e-30, 65536.5, 0.0]], np.float32)
    image = cv2.imdecode(np.frombuffer(encode_tiff(depth), np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert image.dtype == np.float32
    np.testing.assert_array_equal(image, depth)


def test_missing_library_is_one_line(brief_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for name in ("huggingface", "parquet"):
        monkeypatch.delitem(sys.modules, f"fieldtruth.exporters.{name}", raising=False)
    with pytest.raises(OutputError, match=r"the pyarrow library is not installed; run: pip install 'fieldtruth\[hugg"):
        export(brief_run, "huggingface", out=tmp_path / "set")
    assert not any(tmp_path.iterdir())

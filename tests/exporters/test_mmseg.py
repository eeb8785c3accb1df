# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""MMSegmentation's layout, read by Pillow and by mmseg itself: every pixel has the train id of its class in the bag."""

import io
import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from export_bags import without
from PIL import Image
from published_truth import Truth, publish, read_truth

from fieldtruth.bag.file import BagError
from fieldtruth.core.classes import CLASSES
from fieldtruth.exporters import export
from fieldtruth.exporters.mmseg import train_ids
from fieldtruth.ontology import LABEL_MAPS, own_labels

SIDES = ("left", "right")


@pytest.fixture(scope="module")
def truth(brief_run: Path) -> Truth:
    return read_truth(brief_run / "park_1.bag")


@pytest.fixture(scope="module")
def folder(brief_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run for training and one, as if of another world, for validation."""
    return publish(brief_run, tmp_path_factory.mktemp("published"), "mmseg")


def test_files_are_pairs_of_photograph_and_train_ids(folder: Path, truth: Truth) -> None:
    assert sorted(path.name for path in folder.iterdir()) == ["ann_dir", "dataset.py", "img_dir"]
    for split, run in (("train", "park_1"), ("val", "park_1-2")):
        names = sorted(f"{run}_{side}_{stamp:019d}" for stamp, side in truth.pictures)
        assert sorted(path.name for path in (folder / "img_dir" / split).iterdir()) == [f"{n}.jpg" for n in names]
        assert sorted(path.name for path in (folder / "ann_dir" / split).iterdir()) == [f"{n}.png" for n in names]
        for (stamp, side), picture in truth.pictures.items():
            name = f"{split}/{run}_{side}_{stamp:019d}"
            assert (folder / "img_dir" / f"{name}.jpg").read_bytes() == picture.jpeg
            image = Image.open(io.BytesIO((folder / "ann_dir" / f"{name}.png").read_bytes()))
            assert image.mode == "L"
            np.testing.assert_array_equal(np.asarray(image), picture.label - 1)  # void, 0, is in no image


def test_configuration_names_and_colours_each_train_id(folder: Path) -> None:
    values = runpy.run_path(str(folder / "dataset.py"))
    rows = CLASSES[1:18]
    assert values["metainfo"] == {"classes": tuple(r.name for r in rows), "palette": [list(r.rgb or ()) for r in rows]}
    assert train_ids(own_labels()).tolist() == [255, *range(23)]
    assert {name for name in values if name.endswith("_dataloader")} == {"train_dataloader", "val_dataloader"}


@pytest.mark.parametrize("name", LABEL_MAPS)
def test_train_ids_of_other_ontologies_have_no_gaps(name: str) -> None:
    label_map = LABEL_MAPS[name]
    void = int(label_map.ids[0])
    used = sorted(set(label_map.classes) - {void})
    for ours, theirs in enumerate(label_map.ids.tolist()):
        assert train_ids(label_map)[ours] == (255 if theirs == void else used.index(theirs))


def test_run_without_photographs_is_refused_in_one_line(brief_run: Path, tmp_path: Path) -> None:
    topics = [f"/stereo/camera/{side}/real/compressed" for side in SIDES]
    blind = without(brief_run / "park_1.bag", tmp_path / "blind.bag", *topics)
    with pytest.raises(BagError, match=r"blind\.bag has no /stereo/camera/left/real/compressed with /stereo/.*tag"):
        export(blind, "mmseg")
    assert [path.name for path in tmp_path.iterdir()] == ["blind.bag"]


@pytest.mark.slow
def test_mmseg_reads_it_by_its_configuration(
    folder: Path, truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A user's configuration inherits ours; mmseg builds both data sets from it and loads each pair."""
    pytest.importorskip("torch")
    mmengine = pytest.importorskip("mmengine")
    registry = pytest.importorskip("mmengine.registry")
    pytest.importorskip("mmcv", reason="pip install --no-deps mmcv-lite==2.1.0")
    operators: Any = ModuleType("mmcv.ops")  # of CUDA; mmcv's wheel without them reads data as well
    operators.point_sample = None
    monkeypatch.setitem(sys.modules, "mmcv.ops", operators)
    datasets = pytest.importorskip("mmseg.datasets")
    registry.init_default_scope("mmseg")
    user = tmp_path / "user.py"
    user.write_text(f"_base_ = [{str(folder / 'dataset.py')!r}]\ntrain_dataloader = dict(batch_size=2)\n")
    configuration = mmengine.Config.fromfile(user)
    assert configuration.train_dataloader.batch_size == 2
    for split in ("train", "val"):
        parts = dict(configuration[f"{split}_dataloader"].dataset)
        assert parts.pop("type") == "BaseSegDataset"
        data = datasets.BaseSegDataset(**parts | {"pipeline": configuration.test_pipeline})
        assert data.metainfo["classes"] == tuple(row.name for row in CLASSES[1:18])
        assert len(data) == len(truth.pictures)
        for item in data:
            _, side, stamp = Path(item["data_samples"].img_path).stem.rsplit("_", 2)
            picture = truth.pictures[int(stamp), side]
            np.testing.assert_array_equal(item["data_samples"].gt_sem_seg.data[0].numpy(), picture.label - 1)
            assert tuple(item["inputs"].shape) == (3, *picture.label.shape)
    cropped = datasets.BaseSegDataset(**parts | {"pipeline": configuration.train_pipeline})
    assert {int(value) for item in cropped for value in item["data_samples"].gt_sem_seg.data.unique()} <= {*range(15)}

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Photographs that another recorder stored as PNG are copied as they are, and named by what they are."""

import io
import json
import runpy
import shutil
import struct
import tarfile
from pathlib import Path

import numpy as np
import pytest
import simplejpeg
from export_bags import copied
from PIL import Image

from fieldtruth.bag.decode import read_bag
from fieldtruth.bag.file import BagError
from fieldtruth.core.png import encode_png
from fieldtruth.exporters import export

TOPIC = "/stereo/camera/left/real/compressed"


def as_png(data: bytes) -> bytes:
    """A sensor_msgs/CompressedImage with its JPEG decoded and stored as PNG."""
    at = 16 + struct.unpack_from("<L", data, 12)[0]
    start = at + 8 + struct.unpack_from("<L", data, at)[0]
    png = encode_png(simplejpeg.decode_jpeg(data[start:], "RGB"))
    return data[:at] + struct.pack("<L3sL", 3, b"png", len(png)) + png


def copy(run: Path, folder: Path, *ends: str) -> Path:
    """A few frames of a run; photographs of topics with one of these ends are PNG."""
    bag = copied(
        run / "park_1.bag",
        folder / "park_1" / "park_1.bag",
        lambda topic, stamp, data: None if stamp > 120_000_000 else as_png(data) if topic.endswith(ends) else data,
    )
    shutil.copy(run / "experiment.yaml", bag.parent)
    return bag.parent


@pytest.fixture(scope="module")
def stored(brief_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy(brief_run, tmp_path_factory.mktemp("png"), "real/compressed")


@pytest.fixture(scope="module")
def photographs(stored: Path) -> dict[int, bytes]:
    """Bytes of the left photographs by stamp."""
    return {reading.stamp_ns: bytes(reading.message.data) for reading in read_bag(stored / "park_1.bag", [TOPIC])}


@pytest.mark.parametrize("to", ["mmseg", "coco", "webdataset", "huggingface"])
def test_png_photographs_are_copied(to: str, stored: Path, photographs: dict[int, bytes], tmp_path: Path) -> None:
    out = export(stored, to, out=tmp_path / "out")
    if to == "mmseg":
        found = {int(p.stem[-19:]): p.read_bytes() for p in (out / "img_dir" / "train").glob("park_1_left_*.png")}
        assert runpy.run_path(str(out / "dataset.py"))["train_dataloader"]["dataset"]["img_suffix"] == ".png"
    elif to == "coco":
        found = {int(p.stem): p.read_bytes() for p in (out / "images" / "left").glob("*.png")}
        rows = json.loads((out / "panoptic.json").read_bytes())["images"]
        assert {Path(row["file_name"]).suffix for row in rows} == {".png"}
    elif to == "webdataset":
        with tarfile.open(out / "train-000000.tar") as archive:
            members = [member for member in archive if member.name.endswith("left.png")]
            found = {int(m.name.split(".")[0][-19:]): archive.extractfile(m).read() for m in members}  # type: ignore[union-attr]
    else:
        table = pytest.importorskip("pyarrow.parquet").read_table(out / "images").to_pylist()
        rows = [row for row in table if row["camera"] == "left"]
        assert {Path(row["image"]["path"]).suffix for row in rows} == {".png"}
        found = {row["stamp_ns"]: row["image"]["bytes"] for row in rows}
        assert "photograph, PNG, byte for byte" in (out / "README.md").read_text("utf-8")
    assert found == photographs
    first = Image.open(io.BytesIO(next(iter(found.values()))))
    assert (first.format, np.asarray(first).shape) == ("PNG", (92, 160, 3))


def test_readme_of_slam_configs_names_the_format(stored: Path, tmp_path: Path) -> None:
    out = export(stored, "slam-configs", out=tmp_path / "out")
    assert "the photographs in the bag are PNG:\n" in (out / "README.txt").read_text("utf-8")


def test_photographs_of_two_formats_are_refused_where_one_is_named(brief_run: Path, tmp_path: Path) -> None:
    mixed = copy(brief_run, tmp_path, "left/real/compressed")
    with pytest.raises(BagError, match="photographs of one format; those of these runs are"):
        export(mixed, "mmseg", out=tmp_path / "out")
    assert not (tmp_path / "out").exists()

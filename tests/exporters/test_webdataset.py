# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tar files read by the webdataset library: photographs byte for byte, labels and clouds value by value."""

import io
import json
import tarfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import webdataset
from export_bags import without
from numpy.typing import NDArray
from PIL import Image
from published_truth import Truth, read_truth

from fieldtruth.bag.provenance import sha256_of
from fieldtruth.exporters import export
from fieldtruth.ontology import LABEL_MAPS

SIDES = ("left", "right")


def image(data: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(data)))


def arrays(data: bytes) -> dict[str, Any]:
    with np.load(io.BytesIO(data)) as archive:
        return dict(archive)


def read(urls: list[Path]) -> list[dict[str, Any]]:
    """All samples, decoded as docs/formats.md shows."""
    handlers = webdataset.handle_extension("mask.png", image), webdataset.handle_extension("npz", arrays)
    return list(webdataset.WebDataset([str(url) for url in urls], shardshuffle=False).decode(*handlers))


@pytest.fixture(scope="module")
def truth(brief_run: Path) -> Truth:
    return read_truth(next(brief_run.glob("*.bag")))


@pytest.fixture(scope="module")
def folder(brief_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(brief_run, "webdataset", out=tmp_path_factory.mktemp("published") / "wds", shard_mb=1)


def test_every_frame_is_a_sample_with_the_images_of_the_bag(folder: Path, truth: Truth) -> None:
    samples = read(sorted(folder.glob("train-*.tar")))
    stamps = sorted({stamp for stamp, _ in truth.pictures})
    assert [sample["json"]["stamp_ns"] for sample in samples] == stamps
    assert len({frozenset(sample) for sample in samples}) == 1  # loaders stack the same members of all samples
    for sample, stamp in zip(samples, stamps, strict=True):
        for side in SIDES:
            picture = truth.pictures[stamp, side]
            assert sample[f"{side}.jpg"] == picture.jpeg
            np.testing.assert_array_equal(sample[f"{side}.mask.png"], picture.label)
            np.testing.assert_array_equal(sample[f"{side}.npz"]["depth"], picture.depth)
            np.testing.assert_array_equal(sample[f"{side}.npz"]["instances"], picture.instances)


def test_every_cloud_has_a_sample_and_is_in_the_frame_of_its_stamp(folder: Path, truth: Truth) -> None:
    frames = {s["json"]["stamp_ns"]: s for s in read(sorted(folder.glob("train-*.tar")))}
    clouds = {s["json"]["stamp_ns"]: s for s in read(sorted(folder.glob("clouds-train-*.tar")))}
    with_cloud = {stamp for stamp, frame in frames.items() if len(frame["cloud.npz"]["xyz"])}
    assert with_cloud == set(truth.clouds) & set(frames) > set()
    assert list(clouds) == sorted(truth.clouds)
    assert set(clouds) > with_cloud
    for stamp, sample in [*clouds.items(), *((stamp, frames[stamp]) for stamp in with_cloud)]:
        cloud, rows = sample["cloud.npz"], truth.clouds[stamp]
        assert sample["json"]["lidar"] == clouds[stamp]["json"]["lidar"]
        np.testing.assert_array_equal(cloud["xyz"], np.stack([rows["x"], rows["y"], rows["z"]], axis=1))
        for name in ("label", "instance", "ring", "column"):
            np.testing.assert_array_equal(cloud[name], rows[name])
    described = json.loads((folder / "dataset.json").read_text())
    (row,) = described["runs"]
    assert (row["frames"], row["clouds"]) == (len(frames), len(clouds))


def test_poses_take_points_to_the_pixels_of_their_class(folder: Path) -> None:
    """Points of the cloud, through the poses in JSON and K, fall on pixels of the same class, but at silhouettes."""
    agree = []
    for sample in read(sorted(folder.glob("train-*.tar"))):
        if "lidar" not in sample["json"]:
            continue
        about, cloud = sample["json"], sample["cloud.npz"]
        for side in SIDES:
            camera = about["cameras"][side]
            camera_from_lidar = np.linalg.inv(camera["world_from_camera"]) @ np.array(
                about["lidar"]["world_from_lidar"]
            )
            xyz = cloud["xyz"] @ camera_from_lidar[:3, :3].T + camera_from_lidar[:3, 3]
            uvw = xyz @ np.array(camera["K"]).T
            column, row = np.round(uvw[:, :2] / uvw[:, 2:]).astype(int).T
            mask = sample[f"{side}.mask.png"]
            seen = (xyz[:, 2] > 0.1) & (column >= 0) & (column < mask.shape[1]) & (row >= 0) & (row < mask.shape[0])
            agree.append(np.mean(mask[row[seen], column[seen]] == cloud["label"][seen]))
    assert min(agree) > 0.8


def test_shards_are_small_plain_tar_files_and_their_list_is_true(folder: Path, truth: Truth) -> None:
    described = json.loads((folder / "dataset.json").read_text())
    paths = [*sorted(folder.glob("train-*.tar")), *sorted(folder.glob("clouds-train-*.tar"))]
    assert len(paths) > 3
    assert len(paths) == len(list(folder.glob("*.tar")))
    assert [shard["url"] for shard in described["shards"]] == [path.name for path in paths]
    for shard, path in zip(described["shards"], paths, strict=True):
        assert (shard["bytes"], shard["sha256"]) == (path.stat().st_size, sha256_of(path))
        assert path.stat().st_size <= 1_000_000
        assert path.read_bytes()[257:263] == b"ustar\0"  # POSIX.1-1988, without extensions
        with tarfile.open(path) as tar:
            members = tar.getmembers()
        assert {(m.mtime, m.uid, m.gid, m.uname, m.mode) for m in members} == {(0, 0, 0, "", 0o644)}
        assert [m.name for m in members] == sorted(m.name for m in members)
        assert shard["samples"] == len({m.name.split(".")[0] for m in members})
    for content, count in (("frames", len(truth.pictures) / 2), ("clouds", len(truth.clouds))):
        assert sum(shard["samples"] for shard in described["shards"] if shard["content"] == content) == count


def test_a_shuffled_loop_counts_the_pixels_of_the_bag(folder: Path, truth: Truth) -> None:
    urls = [str(path) for path in folder.glob("train-*.tar")]
    shuffled = webdataset.WebDataset(urls, shardshuffle=4, seed=1).shuffle(5)
    decoded = shuffled.decode(webdataset.handle_extension("mask.png", image), "rgb8").to_tuple(
        "left.jpg", "left.mask.png", "right.mask.png", "__key__"
    )
    counts, keys = np.zeros(18, np.int64), []
    for photo, left, right, key in decoded:
        assert photo.shape == (*left.shape, 3)
        counts += np.bincount(left.ravel(), minlength=18) + np.bincount(right.ravel(), minlength=18)
        keys.append(key)
    np.testing.assert_array_equal(counts, truth.pixels())
    assert keys != sorted(keys)
    assert max(Counter(keys).values()) == 1


def test_labels_of_another_ontology(brief_run: Path, tmp_path: Path, truth: Truth) -> None:
    folder = export(brief_run, "webdataset", out=tmp_path / "wds", label_map="rellis")
    label_map = LABEL_MAPS["rellis"]
    for sample in read([folder / "train-000000.tar"]):
        stamp = sample["json"]["stamp_ns"]
        np.testing.assert_array_equal(sample["left.mask.png"], label_map.ids[truth.pictures[stamp, "left"].label])
        if len(sample["cloud.npz"]["label"]):
            np.testing.assert_array_equal(sample["cloud.npz"]["label"], label_map.ids[truth.clouds[stamp]["label"]])
    described = json.loads((folder / "dataset.json").read_text())
    assert {row["id"]: row["name"] for row in described["classes"]} == {k: v.name for k, v in label_map.classes.items()}


def test_run_without_cameras_has_a_sample_per_cloud(brief_run: Path, tmp_path: Path, truth: Truth) -> None:
    bag = next(brief_run.glob("*.bag"))
    topics = [f"/stereo/camera/{side}/real/compressed" for side in SIDES]
    folder = export(without(bag, tmp_path / "blind.bag", *topics), "webdataset")
    samples = read(list(folder.glob("*.tar")))
    assert [sample["json"]["stamp_ns"] for sample in samples] == sorted(truth.clouds)
    assert all({"cloud.npz", "json"} == {key for key in sample if "__" not in key} for sample in samples)


def test_loader_of_pytorch_reads_it_with_two_workers(folder: Path, truth: Truth) -> None:
    torch = pytest.importorskip("torch")
    urls = [str(path) for path in sorted(folder.glob("train-*.tar"))]
    frames = webdataset.WebDataset(urls, shardshuffle=4).shuffle(5)
    decoded = frames.decode(webdataset.handle_extension("mask.png", image), "torchrgb8")
    loader = torch.utils.data.DataLoader(
        decoded.to_tuple("left.jpg", "left.mask.png").batched(2), batch_size=None, num_workers=2
    )
    counts = np.zeros(18, np.int64)
    for photos, masks in loader:
        assert photos.shape[1:] == (3, *masks.shape[1:])
        counts += np.bincount(np.asarray(masks).ravel(), minlength=18)
    left = [picture.label for (_, side), picture in truth.pictures.items() if side == "left"]
    np.testing.assert_array_equal(counts, np.bincount(np.ravel(left), minlength=18))

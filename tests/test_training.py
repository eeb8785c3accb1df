# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Baselines in examples/: pixels keep their labels, a training goes on as if in one go, and what is learnt holds."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

torch = pytest.importorskip("torch")

import augmentation  # noqa: E402
import baseline  # noqa: E402
import frame_arrays  # noqa: E402
import scoring  # noqa: E402
import segmentation  # noqa: E402
import train_clouds  # noqa: E402
import train_images  # noqa: E402

import fieldtruth as ft  # noqa: E402
from fieldtruth.cli import main as fieldtruth_main  # noqa: E402
from fieldtruth.ontology import label_map_of  # noqa: E402

DOCUMENT = (Path(__file__).parents[1] / "docs/baselines.md").read_text("utf-8")
SMALL = segmentation.Settings(("dark", "red", "green"), 32, 48, seed=3)


@pytest.fixture(autouse=True)
def one_thread() -> Any:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def coloured_blocks(n: int, seed: int = 0) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Images of blocks of 8 pixels in three colours with noise; the mask tells the colour."""
    rng = np.random.default_rng(seed)
    masks = rng.integers(0, 3, (n, 4, 6)).repeat(8, axis=1).repeat(8, axis=2).astype(np.uint8)
    colours = np.array([[60, 60, 60], [160, 60, 60], [60, 160, 60]])
    images = colours[masks] + rng.normal(0, 15, (*masks.shape, 3))
    return images.clip(0, 255).astype(np.uint8), masks


# ---------------------------------------------------------------------------------------------------------------------
# Figures


def test_confusion_and_iou_are_those_counted_by_hand() -> None:
    truth = np.array([[0, 0, 1, 1, 255, 255]], np.uint8)
    predicted = np.array([[0, 1, 1, 1, 2, 0]])
    matrix = segmentation.confusion(truth, predicted, 3)
    assert matrix.tolist() == [[1, 1, 0], [0, 2, 0], [0, 0, 0]]
    np.testing.assert_allclose(segmentation.iou(matrix), [1 / 2, 2 / 3, np.nan])
    assert scoring.majority_iou(matrix) == pytest.approx((2 / 4 + 0) / 2)


def test_calibration_error_is_the_difference_of_confidence_and_share_of_right_ones() -> None:
    confidence = np.full(10, 0.9, np.float32)
    right = np.arange(10) < 6
    assert scoring.calibration_error(scoring.reliability(confidence, right)) == pytest.approx(0.3)
    assert scoring.calibration_error(scoring.reliability(confidence, np.arange(10) < 9)) == pytest.approx(0.0, abs=1e-6)


def test_rare_classes_weigh_more_and_the_mean_weight_of_pixels_is_one() -> None:
    masks = np.array([0] * 99 + [2] + [255] * 50, np.uint8)
    weights = segmentation.class_weights(masks, 3)
    assert weights[2] / weights[0] == pytest.approx(99**0.5, rel=1e-3)
    assert 0.99 * weights[0] + 0.01 * weights[2] == pytest.approx(1.0, rel=1e-3)
    assert weights[1] == 0


# ---------------------------------------------------------------------------------------------------------------------
# Pixels and labels


def test_moved_pixels_keep_their_labels() -> None:
    """Each pixel's colour is its place, and its label the cell of this place."""
    h, w, cell = 64, 96, 16
    y, x = np.mgrid[:h, :w].astype(np.float32)
    image = torch.from_numpy(np.stack([x / w, y / h, 0 * x])).expand(32, -1, -1, -1)
    mask = torch.from_numpy((y // cell * (w // cell) + x // cell).astype(np.int64)).expand(32, -1, -1)
    moved, labels = augmentation.moved(image, mask, torch.Generator().manual_seed(1))
    at_x, at_y = (moved[:, 0] * w).numpy(), (moved[:, 1] * h).numpy()
    inside = (labels != augmentation.IGNORED).numpy()
    near_edge = np.minimum(*(np.abs((v + 0.5) / cell - np.round((v + 0.5) / cell)) for v in (at_x, at_y))) < 1.5 / cell
    expected = at_y // cell * (w // cell) + at_x // cell
    assert (labels.numpy() == expected)[inside & ~near_edge].all()
    assert (inside & ~near_edge).mean() > 0.5
    is_mirrored = np.diff(at_x[:, h // 2, w // 3 : 2 * w // 3], axis=1).mean(axis=1) < 0
    assert 5 < is_mirrored.sum() < 27


def test_changed_colours_stay_colours_and_differ_between_images() -> None:
    images = torch.from_numpy(coloured_blocks(1)[0]).permute(0, 3, 1, 2).float().expand(8, -1, -1, -1) / 255
    changed = augmentation.coloured(images, torch.Generator().manual_seed(0))
    assert 0 <= changed.min() < changed.max() <= 1
    assert changed.mean(dim=(1, 2, 3)).std() > 0.03


def test_turned_clouds_keep_labels_and_the_direction_of_each_column() -> None:
    rings, columns = 8, 64
    azimuth = -2 * np.pi * np.arange(columns) / columns
    label = np.random.default_rng(0).integers(0, 4, (rings, columns))
    ranges = 10.0 + 5.0 * label  # far apart, so that they tell the label
    xyz = np.stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), 0 * ranges])
    one = np.concatenate([xyz, 0.5 * np.ones((1, rings, columns)), np.ones((1, rings, columns))]).astype(np.float32)
    images, masks = torch.from_numpy(one).expand(32, -1, -1, -1), torch.from_numpy(label).expand(32, -1, -1)
    turned, labels = augmentation.clouds(images, masks, torch.Generator().manual_seed(0))
    kept = turned[:, 4].numpy() > 0
    assert ((labels != augmentation.IGNORED).numpy() == kept).all()
    assert 0.8 < kept.mean() < 0.97
    x, y, z = turned[:, :3].numpy().transpose(1, 0, 2, 3)
    told = np.round((np.sqrt(x * x + y * y + z * z) - 10.0) / 5.0)
    assert (told == labels.numpy())[kept].mean() > 0.95
    off = np.angle(np.exp(1j * (np.arctan2(y, x) - azimuth)))
    assert np.abs(off[kept]).max() < 0.02
    assert len({tuple(row) for row in labels[:, 0].tolist()}) > 20


def test_small_images_are_means_and_their_masks_are_of_the_same_places() -> None:
    mask = np.arange(6, dtype=np.uint8).reshape(2, 3).repeat(40, axis=0).repeat(40, axis=1)  # 80 x 120
    image = np.repeat(10 * mask[..., None], 3, axis=2)
    image[::2] += 4
    small, labels = frame_arrays.small_image(image, 8, 12), frame_arrays.small_mask(mask, 8, 12)
    assert (small[..., 0] == 10 * labels + 2).all()
    assert set(labels.ravel().tolist()) == set(range(6))
    assert set(frame_arrays.small_mask(mask, 8, 4).ravel().tolist()) == {1, 4}  # the middle column of a narrow one


def test_classes_are_those_of_the_label_map_without_void() -> None:
    classes = frame_arrays.classes_of(label_map_of("offroad"))
    assert classes.names == ("sky", "trail", "ground", "vegetation", "obstacle", "water")
    assert classes.index[[0, 1, 6, 200]].tolist() == [255, 0, 5, 255]


def test_a_range_image_has_the_nearest_return_of_each_direction() -> None:
    """Rings of any order: rows follow from the elevation, the highest first; a point without a return is not there."""
    points = np.array([[9, -0.1, 3.6], [5, -0.1, 2], [0.1, -5, -2], [-5, -0.1, 0], [0, 0, 0], [-5, 0.1, 0]], np.float32)
    points = np.append(points, np.full((1, 3), np.nan, np.float32), axis=0)
    nowhere = (1, 0)  # the pixel of a point at the origin, or of NaN
    light = np.array([0.6, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7], np.float32)
    image, (row, column) = frame_arrays.range_image(points, light, (3, 4))
    assert (row[:4].tolist(), column[:4].tolist()) == ([0, 0, 2, 1], [0, 0, 0, 1])
    assert (row[5], column[5]) == (1, 2)
    assert image[..., 4].sum() == 4
    assert image[0, 0].tolist() == pytest.approx([5, -0.1, 2, 0.1, 1])
    classes = frame_arrays.classes_of(label_map_of("offroad"))
    labels = np.array([4, 3, 5, 1, 1, 2, 4])
    again, mask = train_clouds.RangeImage((3, 4), classes)({"cloud": points, "labels": labels, "reflectivity": light})
    assert np.abs(again - image).max() < 1e-2
    assert mask[[0, 2, 1, 1], [0, 0, 1, 2]].tolist() == classes.index[[3, 5, 1, 2]].tolist()
    assert (mask != frame_arrays.IGNORED).sum() == 4
    assert (image[nowhere] == 0).all()


# ---------------------------------------------------------------------------------------------------------------------
# Training


def test_blocks_are_learnt_and_kept_in_a_file(tmp_path: Path) -> None:
    images, masks = coloured_blocks(16)
    network = segmentation.make_network(SMALL)
    segmentation.fit(network, SMALL, images, masks, steps=40, batch=4, log=lambda line: None, out=tmp_path)
    others, truth = coloured_blocks(4, seed=1)
    found = segmentation.predict(network, others)
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-5)
    assert np.nanmin(segmentation.iou(segmentation.confusion(truth, found.argmax(axis=1), 3))) > 0.6
    loaded, settings = segmentation.load(tmp_path / "network.pt")
    assert settings == SMALL
    np.testing.assert_allclose(segmentation.predict(loaded, others), found, atol=1e-5)


def test_an_interrupted_training_goes_on_as_if_in_one_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    images, masks = coloured_blocks(6)
    monkeypatch.setattr(segmentation, "CHECKPOINT_S", 0.0)

    def fit(out: Path, stop: int = 99) -> Any:
        network, calls = segmentation.make_network(SMALL), 0

        def augment(x: Any, y: Any, generator: Any) -> Any:
            nonlocal calls
            calls += 1
            if calls > stop:
                raise InterruptedError
            return augmentation.moved(x, y, generator)

        plan = {"steps": 5, "batch": 3, "augment": augment, "log": lambda line: None}
        segmentation.fit(network, SMALL, images, masks, out=out, **plan)  # type: ignore[arg-type]
        return network.state_dict()

    whole = fit(tmp_path / "whole")
    with pytest.raises(InterruptedError):
        fit(tmp_path / "parts", stop=3)
    resumed = fit(tmp_path / "parts", stop=2)
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)
    with pytest.raises(ft.ConfigurationError, match=r"parts has a training with batch 3, not 2; choose another folder"):
        segmentation.fit(
            segmentation.make_network(SMALL), SMALL, images, masks, out=tmp_path / "parts", steps=5, batch=2
        )


@pytest.mark.parametrize("script", [train_images, train_clouds], ids=["images", "clouds"])
def test_options_are_documented_with_their_defaults(script: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        script.main(["--help"])
    shown = capsys.readouterr().out
    rows = [re.findall(r"`(--[\w-]+)`", line) for line in DOCUMENT.splitlines() if line.startswith("| `--")]
    documented = {name for row in rows for name in row}
    options = set(re.findall(r"^  (--[\w-]+)", shown, re.MULTILINE))
    assert options <= documented
    assert len(options) >= 11


def test_a_mistake_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["train_images.py", str(tmp_path), "--out", str(tmp_path / "out")])
    with pytest.raises(SystemExit) as stop:
        baseline.call(train_images.main)
    assert stop.value.code == 2
    assert capsys.readouterr().err == f"error: {tmp_path} has no runs: no bag in it or its subfolders\n"


RESULTS = ("network.pt", "confusion.csv", "confusion.png", "calibration.png", "predictions.png")


@pytest.mark.parametrize(
    ("script", "size"), [(train_images, ["--width", "64", "--height", "32"]), (train_clouds, ["--width", "128"])]
)
def test_a_run_becomes_results(script: Any, size: list[str], small_run: Path, tmp_path: Path) -> None:
    for split in ("train", "val"):
        (tmp_path / "data" / split).mkdir(parents=True)
        (tmp_path / "data" / split / "park_1").symlink_to(small_run)
    out = tmp_path / "out"
    arguments = [
        str(tmp_path / "data"),
        "--out",
        str(out),
        "--steps",
        "2",
        "--batch",
        "2",
        "--workers",
        "0",
        *size,
    ]
    script.main(arguments)
    assert all((out / name).stat().st_size > 100 for name in RESULTS)
    scores = json.loads((out / "scores.json").read_text("utf-8"))
    assert scores["split"] == "val"
    assert 0 <= scores["mean_iou"] <= 1
    assert scores["pixels"] > 1000


# ---------------------------------------------------------------------------------------------------------------------
# What is learnt holds in other worlds

CAMPAIGN = {
    "name": "small",
    "seed": 1,
    "runs": 4,
    "environments": ["park"],
    "seeds": {"integers": [0, 40]},
    "layouts": {
        "park": {
            **{"size": [36.0, 36.0], "trails": [[[-20.0, -6.0], [20.0, -6.0]]], "bushes": 2},
            **{"large_trees": 6, "small_trees": 6, "benches": 2, "lamp_posts": 2, "tables": 2, "individuals": 1},
        }
    },
    "routes": {"frames": {"count": 20}},
    "rigs": {"cameras": {"width": 192, "height": 102}, "lidar": {"columns": 256, "rings": 32}},
    "split": {"train": 0.75, "test": 0.25},
}


def best_without_looking(out: Path, classes: int) -> float:
    """Mean IoU in test of the class that is most frequent in train at each pixel: the most that labels alone give."""
    train, test = (np.load(out / "frames" / f"{split}.masks.npy") for split in ("train", "test"))
    frequent = np.argmax([(train == k).sum(axis=0) for k in range(classes)], axis=0)
    return float(
        np.nanmean(segmentation.iou(segmentation.confusion(test, np.broadcast_to(frequent, test.shape), classes)))
    )


@pytest.mark.slow
def test_networks_know_worlds_that_they_have_not_seen(tmp_path: Path) -> None:
    """By 0.25 (images) and 0.1 (clouds) of mean IoU above what a network could reach that sees nothing."""
    (tmp_path / "campaign.yaml").write_text(yaml.safe_dump(CAMPAIGN), "utf-8")
    assert (
        fieldtruth_main(["generate", str(tmp_path / "campaign.yaml"), "--out", str(tmp_path / "data"), "--no-estimate"])
        == 0
    )
    for script, options, margin in (
        (train_images, ["--width", "128", "--height", "68", "--steps", "250"], 0.25),
        (train_clouds, ["--width", "256", "--steps", "200"], 0.1),
    ):
        out = tmp_path / script.__name__
        script.main([str(tmp_path / "data"), "--out", str(out), "--batch", "8", *options])
        scores = json.loads((out / "scores.json").read_text("utf-8"))
        assert scores["split"] == "test"
        assert scores["mean_iou"] > best_without_looking(out, len(scores["iou"])) + margin

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Scores on real frames and figures of scenes, on images whose answers are known beforehand."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import transfer
from PIL import Image
from real_frames import IGNORED, IMAGE_CLASSES, LAYOUTS, MERGED_IMAGE, frames_of
from scene_statistics import WIDTH, figures, hue_and_saturation, images_of, statistics, table

SKY, TRAIL, GRASS, VEGETATION, OBSTACLE = range(5)
BLUE, SOIL, GREEN = (1, 88, 255), (156, 76, 30), (128, 255, 0)  # labels of sky, rough trail, traversable grass


def write_pairs(folder: Path, count: int = 4) -> None:
    """Pairs of YCOR's layout, numbered 0, 10, 20, ...: bright sky above dark trail, and grass at the left."""
    for k in range(count):
        labels = np.full((32, 64, 3), SOIL, np.uint8)
        labels[:, :16], labels[:12] = GREEN, BLUE
        photo = np.where(labels == BLUE, 230, 60).astype(np.uint8)
        photo[12:, :16] = 30, 120, 30
        place = folder / f"{10 * k:04d}"
        place.mkdir(parents=True)
        Image.fromarray(photo).save(place / "rgb.jpg", quality=95)
        Image.fromarray(labels).save(place / "labels.png")


def test_merged_classes() -> None:
    matrix = np.zeros((6, 6), np.int64)
    matrix[SKY, SKY] = 10
    matrix[TRAIL, GRASS], matrix[GRASS, GRASS], matrix[GRASS, OBSTACLE] = 4, 5, 1
    matrix[VEGETATION, VEGETATION], matrix[VEGETATION, TRAIL] = 7, 2
    matrix[OBSTACLE, SKY] = 100  # true obstacles do not count
    assert transfer.merged(matrix, IMAGE_CLASSES, MERGED_IMAGE).tolist() == [
        [10, 0, 0, 0],
        [0, 9, 0, 1],
        [0, 2, 7, 0],
        [0, 0, 0, 0],
    ]


def test_figures_of_a_row() -> None:
    pytest.importorskip("torch")
    matrix = np.zeros((6, 6), np.int64)
    matrix[SKY, SKY], matrix[TRAIL, TRAIL], matrix[TRAIL, GRASS], matrix[TRAIL, 5] = 6, 1, 2, 1
    by_name = {layout.name: layout for layout in LAYOUTS}
    found = transfer.Row("a", "b", by_name["ycor"], matrix).figures()
    assert found["sky"] == 1.0
    assert found["trail"] == pytest.approx(1 / 4)
    assert found["mean"] == pytest.approx((1 + 1 / 4) / 2)  # classes without a true pixel do not count
    assert found["mean of 3"] == pytest.approx((1 + 3 / 4) / 2)
    assert found["right"] == pytest.approx(7 / 10)
    of_merged = transfer.Row("a", "b", by_name["orfd"], matrix).figures()
    assert np.isnan(of_merged["sky"])
    assert np.isnan(of_merged["mean"])
    assert of_merged["mean of 3"] == found["mean of 3"]


def test_network_of_other_classes_is_scored_in_ours(tmp_path: Path) -> None:
    """Trunks and treetops are vegetation together, although neither is the most probable; robots are another class."""
    segmentation = pytest.importorskip("segmentation", exc_type=ImportError)
    settings = segmentation.Settings(("ground", "trunk", "treetop", "robot"), 32, 64)
    shares = np.array([[0.4, 0.3, 0.3, 0.0], [0.1, 0.2, 0.2, 0.5]]).T.reshape(1, 4, 1, 2)
    tall = np.repeat(np.repeat(shares, 16, axis=2), 16, axis=3).astype(np.float32)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segmentation, "predict", lambda network, images: tall)
        mask = transfer.predicted(None, settings, np.zeros((16, 32, 3), np.uint8))
    assert (mask[:, :12] == VEGETATION).all()
    assert (mask[:, 20:] == transfer.OTHER).all()


def test_training_set_has_the_classes_of_the_network(tmp_path: Path) -> None:
    segmentation = pytest.importorskip("segmentation", exc_type=ImportError)
    write_pairs(tmp_path, 1)
    settings = segmentation.Settings(("trail", "sky", "vegetation"), 16, 32)
    images, masks = transfer.training_set(frames_of(tmp_path), settings)
    assert images.shape == (1, 16, 32, 3)
    assert masks[0, 0, 0] == 1
    assert masks[0, -1, -1] == 0
    assert masks[0, -1, 0] == IGNORED  # grass, which the network does not have


@pytest.mark.slow
def test_trained_on_some_and_scored_on_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Three classes of plain colours are learnt in few steps, and no pair that is scored is trained on."""
    segmentation = pytest.importorskip("segmentation", exc_type=ImportError)
    segmentation.torch.set_num_threads(1)  # networks this small are slower on more, above all where others compute
    write_pairs(tmp_path / "ycor")
    settings = segmentation.Settings(IMAGE_CLASSES, 32, 64)
    segmentation.save(tmp_path / "first.pt", segmentation.make_network(settings), settings)
    arguments = [str(tmp_path / "ycor"), "--checkpoint", str(tmp_path / "first.pt"), "--from", "20", "--steps", "30"]
    arguments += ["--train-to", "20", "--real-only", "all", "--fine-tune", "1"]
    arguments += ["--sheet", str(tmp_path / "sheet.png"), "--worst", "1", "--json", str(tmp_path / "figures.json")]
    transfer.main(arguments)
    assert "| synthetic | ycor 20 to 30 (2) |" in capsys.readouterr().out
    first, real, both = json.loads((tmp_path / "figures.json").read_text())
    assert (real["network"], both["network"]) == ("real, 2 pairs", "synthetic, then real, 1 pairs")
    assert np.sum(first["matrix"]) == 2 * 32 * 64
    assert real["figures"]["right"] > max(0.8, first["figures"]["right"])
    assert Image.open(tmp_path / "sheet.png").size == (3 * transfer.TILE, transfer.TILE // 2)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "pairs", "frames"), [(5, "1", (10, 5)), (1, "all", (4, 2))])
def test_synthetic_frames_between_real_ones_are_not_forgotten(
    count: int, pairs: str, frames: tuple[int, int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A class that only synthetic frames have, magenta, is learnt beside those of real pairs; equally often."""
    segmentation = pytest.importorskip("segmentation", exc_type=ImportError)
    segmentation.torch.set_num_threads(1)
    write_pairs(tmp_path / "ycor")
    settings = segmentation.Settings(IMAGE_CLASSES, 32, 64)
    segmentation.save(tmp_path / "first.pt", segmentation.make_network(settings), settings)
    arguments = [str(tmp_path / "ycor"), "--checkpoint", str(tmp_path / "first.pt"), "--from", "20", "--steps", "40"]
    arguments += ["--train-to", "20", "--joint", pairs, "--json", str(tmp_path / "figures.json")]
    magenta = np.zeros((count, 32, 64, 3), np.uint8)
    magenta[..., 0] = magenta[..., 2] = 255
    (tmp_path / "frames").mkdir()
    for wrong, message in (
        (None, "there is no"),
        (magenta[:, :16], "has frames of 64x16, "),
        (np.array([None]), "has no frames that can be read"),
    ):
        if wrong is not None:
            for name in ("images", "masks"):
                np.save(tmp_path / "frames" / f"train.{name}.npy", wrong)
        with pytest.raises(SystemExit) as stopped:
            transfer.main(arguments)
        assert stopped.value.code == 2
        told = capsys.readouterr()
        assert (told.out, len(told.err.splitlines()), message in told.err) == ("", 1, True)
        assert not (tmp_path / "figures.json").exists()
    np.save(tmp_path / "frames" / "train.images.npy", magenta)
    masks = np.full(magenta.shape[:3], IMAGE_CLASSES.index("obstacle"), np.uint8)
    np.save(tmp_path / "frames" / "train.masks.npy", masks)
    seen = list[tuple[int, int]]()
    fit = segmentation.fit

    def kept(network: Any, settings: Any, images: Any, masks: Any, **options: Any) -> None:
        seen.append((len(images), int((masks == IMAGE_CLASSES.index("obstacle")).all(axis=(1, 2)).sum())))
        fit(network, settings, images, masks, **options)
        found = segmentation.predict(network, magenta[:1])[0].argmax(axis=0)
        assert np.mean(found == IMAGE_CLASSES.index("obstacle")) > 0.9

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segmentation, "fit", kept)
        transfer.main(arguments)
    assert seen == [frames]
    _, both = json.loads((tmp_path / "figures.json").read_text())
    assert both["network"] == f"synthetic, then both, {frames[1] if pairs == 'all' else pairs} pairs"
    assert both["figures"]["right"] > 0.8


def test_clouds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A network that sees ground below the horizon and trees above it; people count as neither."""
    segmentation = pytest.importorskip("segmentation", exc_type=ImportError)
    points = np.array([[5, -1, 1, 0], [5, -2, 1, 0], [5, -1, -1, 0], [-5, 1, -1, 0], [0, 3, -1, 0]], np.float32)
    points.tofile(tmp_path / "000104.bin")
    np.array([4, 19, 3, 3, 17], np.uint32).tofile(tmp_path / "000104.label")
    settings = segmentation.Settings(("grass", "tree", "bush"), 4, 32, 5)
    shares = np.zeros((1, 3, 4, 32), np.float32)
    shares[:, 0, 2:], shares[:, 1, :2] = 1.0, 1.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segmentation, "load", lambda path: (None, settings))
        patch.setattr(segmentation, "predict", lambda network, images: shares)
        transfer.main([str(tmp_path), "--clouds", "any.pt"])
    assert "| synthetic | rellis-clouds (1) | 100.0 | 0.0 | 50.0 | 50.0 | 100.0 | 75.0 |" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "there is no network to score"),
        (["--checkpoint", "missing.pt"], "missing.pt"),
        (["--checkpoint", __file__], "is not a trained network"),
        (["--fine-tune", "10"], "there is no network to score"),
        (["--real-only", "3", "--fine-tune", "3"], "--fine-tune needs --checkpoint"),
        (["--real-only", "3", "--joint", "3"], "--joint needs --checkpoint"),
        (["--real-only", "3"], "need --train-from and --train-to"),
        (["--real-only", "3", "--train-to", "20", "--from", "10"], "0 to 20 and 10 to"),
        (["--real-only", "3", "--train-to", "20", "--from", "20"], "3 pairs are asked for; there are 2"),
        (["--worst", "0"], "must be at least 1, got '0'"),
        (["--minutes", "nan"], "must be a time above 0, got 'nan'"),
        (["--real-only", "none"], "at least 1, or all; got 'none'"),
        (["--checkpoint", "a", "--from", "50"], "no pairs from 50"),
        (["--checkpoint", "a", "--layout", "kitti"], "layout 'kitti' must be one of ycor"),
    ],
)
def test_mistakes_are_a_line(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("segmentation", exc_type=ImportError)
    write_pairs(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        transfer.main([str(tmp_path), *arguments])
    assert stopped.value.code == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_figures_of_a_scene() -> None:
    """Sky over the upper 3/8; below it trail at the right 3/4 and grass at the left; a pole of vegetation before it."""
    mask = np.full((256, WIDTH), TRAIL, np.uint8)
    mask[:, : WIDTH // 4] = GRASS
    mask[:96] = SKY
    mask[64:128, WIDTH // 2 - 64 : WIDTH // 2 + 64] = VEGETATION
    mask[-64:, -WIDTH // 4 :] = IGNORED
    image = np.full((256, WIDTH, 3), 100, np.uint8)
    image[mask == TRAIL] = 120, 90, 60
    image[mask == TRAIL] += (np.indices(mask.shape)[1][mask == TRAIL, None] % 2 * 10).astype(np.uint8)
    image[:32] = 255
    found = figures(image, mask)
    known = (mask != IGNORED).sum()
    assert found["without a class [%]"] == pytest.approx(100 * 64 / 256 / 4)
    assert found["vegetation [%]"] == pytest.approx(100 * 64 * 128 / known)
    assert found["row where the sky ends [% of height]"] == pytest.approx(37.5)
    assert found["row where the ground begins [% of height]"] == pytest.approx(37.5)
    assert found["vegetation in the middle columns [%]"] == pytest.approx(25.0)
    assert found["trail in the lowest rows [%]"] == pytest.approx(50.0)
    assert found["borders of classes per row"] == pytest.approx((32 * 2 + 32 * 3 + 128 * 1) / 256)
    assert found["clipped to white [%]"] == pytest.approx(12.5)
    assert [found[f"trail: {name}"] for name in ("red", "green", "blue")] == pytest.approx([125, 95, 65], abs=0.5)
    assert found["trail: contrast of neighbours [%]"] == pytest.approx(1000 / 255, rel=0.02)
    assert np.isnan(found["obstacle: red"])


def test_hue_of_reds_and_browns_is_continuous() -> None:
    assert hue_and_saturation(np.array([200.0, 100.0, 100.0])) == pytest.approx((0.0, 0.5), abs=1e-3)
    assert hue_and_saturation(np.array([200.0, 100.0, 101.0]))[0] == pytest.approx(-0.6, abs=0.01)
    assert hue_and_saturation(np.array([0.0, 100.0, 0.0]))[0] == pytest.approx(120.0, abs=1e-3)


def test_statistics_of_pairs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_pairs(tmp_path / "ycor")
    found = statistics(images_of(tmp_path / "ycor"), 2)
    assert found["sky [%]"] == pytest.approx([37.5] * 4, abs=0.1)
    assert np.isnan(found["obstacle: red"]).all()
    assert "| obstacle: red | none |" in table({"ycor": found})
    transfer.main(["statistics", str(tmp_path / "ycor"), "--count", "2"])
    assert "| sky [%] | 37.5 (37.5, 37.5, 37.5) |" in capsys.readouterr().out
    with pytest.raises(SystemExit) as stopped:
        transfer.main(["statistics", str(tmp_path / "missing")])
    assert stopped.value.code == 2

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of many runs as arrays for training: each is read from its bag, made smaller once, and kept in a file.

A file of NumPy is mapped into memory, so that neither the bags nor all frames are held there, and epochs read no bag.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from torch.utils.data import DataLoader, Subset

import fieldtruth as ft
from fieldtruth.ontology import LabelMap

IGNORED = 255
SPLITS = ("train", "val", "test")
SHARES = {"train": 0.7, "val": 0.15, "test": 0.15}  # of the worlds, for a folder that has no splits
LINE_S = 10.0
NO_RETURN_M = 0.1

Arrays = tuple[NDArray[Any], NDArray[np.uint8]]
"""Images, (n, h, w, c), and masks, (n, h, w)."""
Shrink = Callable[[Any], tuple[NDArray[Any], NDArray[np.uint8]]]
"""Makes image, (h, w, c), and mask, (h, w), of a sample."""


@dataclass(frozen=True)
class Classes:
    """Classes that a network is trained on: those that a label map has for ours, without void."""

    names: tuple[str, ...]
    index: NDArray[np.uint8]
    """(256,) by id of the ontology: the index of the class, 255 of void."""
    colours: NDArray[np.uint8]
    """(classes, 3) RGB."""


def classes_of(labels: LabelMap) -> Classes:
    """Return the classes of a label map."""
    used = [number for number in np.unique(labels.ids).tolist() if number != labels.ids[0]]
    index = np.full(256, IGNORED, np.uint8)
    index[used] = np.arange(len(used))
    return Classes(tuple(labels.classes[number].name for number in used), index, labels.colours()[used])


def splits_of(folder: Path, seed: int, **options: Any) -> dict[str, ft.Runs]:
    """Open the runs of each split: those of a campaign, else drawn by world, so that no two splits share one.

    Raises:
        ft.FieldtruthError: no runs, or too few worlds.
    """
    found = [name for name in SPLITS if (folder / name).is_dir()]
    if found:
        if "train" not in found or len(found) < 2:
            raise ft.ConfigurationError(f"{folder} must have the folders train and val or test, got {', '.join(found)}")
        opened = {name: ft.open_runs(folder / name, **options) for name in found}
        worlds = {name: {run.run.world for run in runs.runs} - {None} for name, runs in opened.items()}
        for name in found[1:]:
            if common := len(worlds["train"] & worlds[name]):
                print(f"warning: train and {name} have {common} worlds in common, so scores are not of unseen worlds")
        return opened
    runs = ft.open_runs(folder, **options)
    return ft.split(runs, by="world", rng=np.random.default_rng(seed), **SHARES)


def read(runs: ft.Runs, shrink: Shrink, count: int, path: Path, key: dict[str, Any], workers: int) -> Arrays:
    """Return images and masks of frames of runs, at most ``count`` evenly taken; from files if they are there.

    Args:
        runs: opened with the items that ``shrink`` takes.
        shrink: a function of a module, because other processes call it.
        count: most frames.
        path: of the files, without ending.
        key: what the files depend on, beside the runs.
        workers: processes that read.
    """
    chosen = np.unique(np.linspace(0, len(runs) - 1, min(count, len(runs))).astype(np.int64))
    bags = [(run.run.bag, run.run.bag.stat()) for run in runs.runs]
    key = key | {"bags": [[str(bag), stat.st_size, stat.st_mtime_ns] for bag, stat in bags], "frames": chosen.tolist()}
    files = [path.with_suffix(f".{name}.npy") for name in ("images", "masks")]
    stamp, text = path.with_suffix(".json"), json.dumps(key)
    if not all(file.exists() for file in (stamp, *files)) or stamp.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        stamp.unlink(missing_ok=True)
        _write(files, Subset(_Shrunk(runs, shrink), chosen.tolist()), path.name, workers)
        part = stamp.with_suffix(".part")
        part.write_text(text, encoding="utf-8")
        part.replace(stamp)
    images, masks = (np.load(file, mmap_mode="r") for file in files)
    return images, masks


@dataclass(frozen=True)
class _Shrunk:
    """Frames of runs, made smaller."""

    runs: ft.Runs
    shrink: Shrink

    def __len__(self) -> int:
        return len(self.runs)

    def __getitem__(self, index: int) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        return self.shrink(self.runs[index])


def _write(files: list[Path], frames: Any, name: str, workers: int) -> None:
    first = frames[0]
    arrays = [
        np.lib.format.open_memmap(file, "w+", each.dtype, (len(frames), *each.shape))
        for file, each in zip(files, first, strict=True)
    ]
    start = shown = monotonic()
    loader = DataLoader(frames, batch_size=4, num_workers=workers, collate_fn=list)
    done = 0
    for batch in loader:
        for frame in batch:
            for array, each in zip(arrays, frame, strict=True):
                array[done] = each
            done += 1
        now = monotonic()
        if now - shown > LINE_S:
            shown, left = now, (now - start) * (len(frames) - done) / done
            print(f"{name}: {done} of {len(frames)} frames, {left:.0f} s left", flush=True)
    print(f"{name}: {done} frames, {done / (monotonic() - start):.1f} frames/s", flush=True)


def small_image(image: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """Return a photograph, (h, w, 3), of another size: its middle of the same shape, averaged over areas."""
    return np.asarray(Image.fromarray(_middle(image, height, width)).resize((width, height), Image.Resampling.BOX))


def small_mask(mask: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """Return a mask of another size: its middle of the same shape, of each area the label in its centre."""
    middle = _middle(mask, height, width)
    h, w = middle.shape
    rows = ((np.arange(height) + 0.5) * h / height).astype(np.int64)
    columns = ((np.arange(width) + 0.5) * w / width).astype(np.int64)
    found: NDArray[np.uint8] = middle[rows[:, None], columns]
    return found


def range_image(
    xyz: NDArray[Any], reflectivity: NDArray[Any], shape: tuple[int, int]
) -> tuple[NDArray[np.float32], tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Return the range image of a scan, (rows, columns, 5), and the row and column of each point.

    Rows are evenly spaced from the highest elevation of the scan to the lowest, columns go clockwise from ahead, so
    that scans of all LiDARs, real ones too, look alike whatever the order of their rings. Of several points in a
    pixel, the nearest is seen: x, y, z [m], reflectivity, and 1. Points at the origin, or NaN, are no returns.
    """
    (rows, columns), xyz = shape, np.nan_to_num(xyz)
    order = far_first(xyz)
    elevation = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))
    low, high = (elevation[order].min(), elevation[order].max()) if len(order) else (0.0, 0.0)
    row = ((high - elevation) / max(high - low, 1e-6) * (rows - 1)).round().clip(0, rows - 1).astype(np.int64)
    column = np.floor(-np.arctan2(xyz[:, 1], xyz[:, 0]) / (2 * np.pi) * columns).astype(np.int64) % columns
    image = np.zeros((rows, columns, 5), np.float32)
    image[row[order], column[order]] = np.column_stack([xyz[order], reflectivity[order], np.ones(len(order))])
    return image, (row, column)


def far_first(xyz: NDArray[Any]) -> NDArray[np.int64]:
    """Return the points by falling distance, so that of several in a pixel the nearest is written last; no others."""
    distance = np.linalg.norm(xyz, axis=1)
    order = np.argsort(-distance, kind="stable")
    found: NDArray[np.int64] = order[distance[order] > NO_RETURN_M]
    return found


def _middle(image: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    h, w = image.shape[:2]
    kept_h, kept_w = min(h, round(w * height / width)), min(w, round(h * width / height))
    top, left = (h - kept_h) // 2, (w - kept_w) // 2
    return np.ascontiguousarray(image[top : top + kept_h, left : left + kept_w])

# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes as a data set of LeRobot, format 3.0: Parquet files with a row for each step, images as PNG in them.

Pixels have no video's loss. The format has no place for what is seen after an episode's last action.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from fieldtruth.core.png import encode_png
from fieldtruth.learning.driven import Drives, Env, Episode

_VERSION: Final = "v3.0"
_FILE: Final = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_FILE_MB, _CHUNK = 100, 1000
"""Largest file, before compression, and files of a folder."""
_TASKS: Final = {
    "Reach": "drive to the goal",
    "Follow": "follow the trail",
    "Explore": "see the free ground around the start",
}
_PHOTO: Final = "camera/photo"
_ACTIONS: Final = {"speed": ["speed", "turn_rate"], "wheels": ["left", "right"]}
_COUNTERS: Final = ("frame_index", "episode_index", "index", "task_index")
_QUANTILES: Final = (0.01, 0.1, 0.5, 0.9, 0.99)
Features = dict[str, dict[str, Any]]
Columns = Mapping[str, NDArray[Any]]
Stats = dict[str, NDArray[Any]]


def id_of(drives: Drives) -> str:
    """Return the id of a data set, and its folder below a root."""
    return f"fieldtruth/{'-'.join(drives.parts)}"


def write(drives: Drives, env: Env, episodes: Iterable[Episode], root: Path) -> None:
    """Write a data set below a root."""
    config, folder = drives.config, root / id_of(drives)
    features = _features(drives, env)
    rows, total, stats = list[dict[str, Any]](), 0, dict[str, Stats]()
    with _Files(folder / "data") as files:
        for number, episode in enumerate(episodes):
            columns = _columns(episode, config.control_hz, number, total)
            chunk, file = files.write(_table(columns, features))
            length = len(episode.actions)
            own = {name: _stats_of(values, image=_is_image(features[name])) for name, values in columns.items()}
            stats = {name: _joined(stats[name], each) if stats else each for name, each in own.items()}
            rows.append(
                {"episode_index": number, "tasks": [_TASKS[drives.task]], "length": length}
                | {"data/chunk_index": chunk, "data/file_index": file}
                | {"dataset_from_index": total, "dataset_to_index": total + length}
                | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
                | {f"stats/{name}/{key}": value.tolist() for name, each in own.items() for key, value in each.items()}
            )
            total += length
    with _Files(folder / "meta/episodes") as files:
        files.write(pa.Table.from_pylist(rows))
    _write_tasks(folder, _TASKS[drives.task])
    lists = {name: {key: value.tolist() for key, value in each.items()} for name, each in stats.items()}
    _write_json(folder / "meta/stats.json", lists)
    _write_json(folder / "meta/info.json", _info(drives, features, total))


def _info(drives: Drives, features: Features, frames: int) -> dict[str, Any]:
    hertz = drives.config.control_hz
    return {
        "codebase_version": _VERSION,
        "robot_type": drives.config.experiment().rig.robot.model,
        "total_episodes": drives.episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": _CHUNK,
        "data_files_size_in_mb": _FILE_MB,
        "video_files_size_in_mb": 200,
        "fps": int(hertz) if hertz == int(hertz) else hertz,
        "splits": {drives.config.split: f"0:{drives.episodes}"},
        "data_path": f"data/{_FILE}",
        "video_path": None,
        "features": features,
    }


def _feature_of(name: str) -> str:
    """Return the feature of an observation; LeRobot allows no slash, and looks for cameras by ``images``."""
    return "observation.images.camera" if name == _PHOTO else f"observation.{name.replace('/', '_')}"


def _features(drives: Drives, env: Env) -> Features:
    """Return dtype, shape and names of the parts of each feature."""
    space: Any = env.observation_space
    found: Features = {}
    for name in drives.config.names:
        image = name == _PHOTO
        found[_feature_of(name)] = {
            "dtype": "image" if image else str(space[name].dtype),
            "shape": [*space[name].shape],
            "names": ["height", "width", "channels"] if image else None,
        }
    found["action"] = {"dtype": "float32", "shape": [2], "names": _ACTIONS[drives.config.action]}
    kinds = {"next.reward": "float32", "next.done": "bool", "next.truncated": "bool", "next.success": "bool"}
    kinds |= {"timestamp": "float32"} | dict.fromkeys(_COUNTERS, "int64")
    return found | {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in kinds.items()}


def _columns(episode: Episode, hertz: float, number: int, first: int) -> Columns:
    """Return the n values of each feature."""
    count = len(episode.actions)
    steps, last = np.arange(count), np.arange(count) == count - 1
    return {_feature_of(name): values[:-1] for name, values in episode.seen.items()} | {
        "action": episode.actions,
        "next.reward": np.array(episode.rewards, np.float32),
        "next.done": last,
        "next.truncated": np.array(episode.truncated),
        "next.success": last & episode.success,
        "timestamp": (steps / hertz).astype(np.float32),
        "frame_index": steps,
        "episode_index": np.full(count, number),
        "index": first + steps,
        "task_index": np.zeros(count, np.int64),
    }


def _is_image(feature: Mapping[str, Any]) -> bool:
    return bool(feature["dtype"] == "image")


# ---------------------------------------------------------------------------------------------------------------------
# Files


class _Files:
    """Parquet files ``chunk-000/file-000.parquet`` in a folder, as a context."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._number, self._size = folder, 0, 0
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> "_Files":
        return self

    def __exit__(self, *error: object) -> None:
        if self._writer is not None:
            self._writer.close()

    def write(self, table: Any) -> tuple[int, int]:
        """Write a table as a group of rows, and return the numbers of its folder and its file."""
        if self._writer is not None and self._size + table.nbytes > _FILE_MB * 2**20:
            self._writer.close()
            self._writer, self._number, self._size = None, self._number + 1, 0
        chunk, file = divmod(self._number, _CHUNK)
        if self._writer is None:
            path = self._folder / _FILE.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, table.schema, compression="zstd")
        self._writer.write_table(table, row_group_size=len(table))
        self._size += table.nbytes
        return chunk, file


def _table(columns: Columns, features: Features) -> Any:
    """Return the rows of an episode; the schema tells Hugging Face's ``datasets`` which columns are images."""
    images = {name: {"_type": "Image"} for name, feature in features.items() if _is_image(feature)}
    arrays = {name: _images(values) if name in images else _nested(values) for name, values in columns.items()}
    return pa.table(arrays, metadata={"huggingface": json.dumps({"info": {"features": images}})})


def _images(values: NDArray[np.uint8]) -> Any:
    kind = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    return pa.array([{"bytes": encode_png(image), "path": None} for image in values], kind)


def _nested(values: NDArray[Any]) -> Any:
    """Return values (n, ...) as lists of fixed lengths."""
    array = pa.array(values.ravel())
    for length in reversed(values.shape[1:]):
        array = pa.FixedSizeListArray.from_arrays(array, length)
    return array


def _write_tasks(folder: Path, task: str) -> None:
    """Write the only task; the text is the index of a table of pandas."""
    kinds = {"task": ("unicode", "object"), "task_index": ("int64", "int64")}
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}
        for name, (kind, numpy_kind) in kinds.items()
    ]
    about = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    pq.write_table(
        pa.table({"task_index": [0], "task": [task]}, metadata={"pandas": json.dumps(about)}),
        folder / "meta/tasks.parquet",
    )


def _write_json(path: Path, values: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(values, indent=4) + "\n", encoding="utf-8")


# ---------------------------------------------------------------------------------------------------------------------
# Statistics


def _stats_of(values: NDArray[Any], *, image: bool) -> Stats:
    """Return statistics of an episode, as LeRobot's: by the last index, of images (3, 1, 1) of values from 0 to 1."""
    flat = values.reshape(-1, values.shape[-1] if values.ndim > 1 else 1).astype(np.float64)
    flat = flat / 255.0 if image else flat
    found = {"min": flat.min(0), "max": flat.max(0), "mean": flat.mean(0), "std": flat.std(0)}
    found |= {
        f"q{100 * share:02.0f}": each for share, each in zip(_QUANTILES, np.quantile(flat, _QUANTILES, 0), strict=True)
    }
    shaped = {key: value.reshape(-1, 1, 1) if image else value for key, value in found.items()}
    return {**shaped, "count": np.array([len(values)])}


def _joined(first: Stats, second: Stats) -> Stats:
    """Return statistics of both; quantiles are means, as LeRobot joins them."""
    count = first["count"] + second["count"]
    a, b = first["count"] / count, second["count"] / count
    means = {key: a * first[key] + b * second[key] for key in first}
    squares = a * first["std"] ** 2 + b * second["std"] ** 2 + a * b * (first["mean"] - second["mean"]) ** 2
    low, high = np.minimum(first["min"], second["min"]), np.maximum(first["max"], second["max"])
    return means | {"min": low, "max": high, "std": np.sqrt(squares), "count": count}
